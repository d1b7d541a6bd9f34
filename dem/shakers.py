"""Harmonic forces that shake a structure, and what they do to its modes in a step."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from beadwave.dem.checks import InvalidChain
from beadwave.dem.kernels.arguments import Array
from beadwave.dem.kernels.oscillators import oscillator_propagator
from beadwave.dem.kernels.shaking import ModalShakerForces


class ShakerForces(NamedTuple):
    """Shakers push by force cos(2 pi frequency t + phase), (s,) each, in a march from t = 0 on."""

    force: Array  # [N]
    frequency: Array  # [Hz]
    phase: Array  # [rad]

    @property
    def period(self) -> float:
        """[s] Shortest common period; raises InvalidChain without one, see `common_period`."""
        return common_period(self.frequency)


def common_period(frequency: ArrayLike, most_cycles: int = 100) -> float:
    """Shortest common period [s] of frequencies (n,) [Hz]: k cycles of the slowest, the least k for
    which the cycles of all others in that time are whole numbers to 1e-9 k. Raises InvalidChain
    where no k up to `most_cycles` is one."""
    frequency = np.asarray(frequency, float)
    slowest = float(frequency.min())
    for cycles in range(1, most_cycles + 1):
        numbers = cycles * frequency / slowest
        if np.abs(numbers - np.round(numbers)).max() < 1e-9 * cycles:
            return cycles / slowest
    raise InvalidChain(
        f"frequencies {', '.join(f'{f:g}' for f in frequency)} Hz have no common period "
        f"within {most_cycles} cycles; take others"
    )


class Oscillators(NamedTuple):
    """k modes under the forces of s shakers, and what these move besides."""

    omega: Array  # (k,) [rad/s]
    zeta: Array  # (k,)
    load: Array  # (k, s) [kg^-1/2] participations of the shakers
    residual: Array  # (d, s) [m/N] of a contact's d directions, beyond the modes


def modal_shaker_forces(
    modes: Oscillators, shakers: ShakerForces | None, spans: ArrayLike
) -> ModalShakerForces:
    """Effect of shakers on modes over steps of `spans` (n,) [s], exact: integrals of the modes'
    response to an impulse, by Gauss' rule with as many points as the fastest of them asks for.

    Shakers of one frequency are one force, B e^(i omega t) with complex B (k,) on the modes and
    L (d,) on the contact's residual motion.
    """
    spans, k, d = np.atleast_1d(spans), modes.omega.size, len(modes.residual)
    frequency = np.zeros(0) if shakers is None else np.asarray(shakers.frequency, float)

    # shakers of one frequency in one
    omega, where = np.unique(2.0 * np.pi * frequency, return_inverse=True)
    m, n = omega.size, spans.size
    B, L = np.zeros((m, k), complex), np.zeros((m, d), complex)
    for j, g in enumerate(where):
        amplitude = shakers.force[j] * np.exp(1j * shakers.phase[j])
        B[g] += amplitude * modes.load[:, j]
        L[g] += amplitude * modes.residual[:, j]

    response, work = np.zeros((n, m, 4, k)), np.zeros((n, m, 4, k))
    mutual_work = np.zeros((n, m, m, 4))
    for i in range(n if B.any() else 0):  # of a wall that is moved along itself no mode is pushed
        response[i], work[i], mutual_work[i] = _in_a_step(modes, omega, B, float(spans[i]))
    return ModalShakerForces(omega, response, work, mutual_work, _parts(L), np.zeros((2, k)))


def _in_a_step(modes: Oscillators, omega: Array, B: Array, h: float) -> tuple[Array, Array, Array]:
    """`response`, `work` and `mutual_work` of forces B (m, k) e^(i omega t) in a step of h [s]."""
    # points for the phase that modes and shakers pass in a step
    fastest = float((modes.omega * np.maximum(modes.zeta, 1.0)).max(initial=0.0))
    fastest += float(omega.max(initial=0.0))
    nodes, weights = np.polynomial.legendre.leggauss(16 + math.ceil(abs(h) * fastest))
    nodes, weights = 0.5 * (1.0 + nodes), 0.5 * weights

    def response(t: float) -> tuple[Array, Array]:
        """(m, k) complex q and p after t under B e^(i omega t) from rest at 0."""
        q, p = np.zeros(B.shape, complex), np.zeros(B.shape, complex)
        for node, weight in zip(nodes, weights, strict=True):
            after = oscillator_propagator(modes.omega, modes.zeta, t * (1.0 - node))
            push = weight * t * np.exp(1j * omega * node * t)[:, None] * B
            q += push * after[1]
            p += push * after[3]
        return q, p

    # the work, the integral of f p: over q and p at the start as the modes swing freely, and over
    # what the shakers have moved since, products of e^(i w t) at sums and differences
    over_q, over_p = np.zeros(B.shape, complex), np.zeros(B.shape, complex)
    at_sum, at_difference = np.zeros((2, omega.size, omega.size), complex)
    for node, weight in zip(nodes, weights, strict=True):
        t = node * h
        after = oscillator_propagator(modes.omega, modes.zeta, t)
        push = weight * h * np.exp(1j * omega * t)[:, None] * B
        over_q += push * after[2]
        over_p += push * after[3]
        speed = response(t)[1]
        at_sum += 0.5 * push @ speed.T
        at_difference += 0.5 * push @ speed.conj().T
    mutual = np.stack([at_sum.real, at_sum.imag, at_difference.real, at_difference.imag], axis=2)
    return _parts(*response(h)), _parts(over_q, over_p), mutual


def _parts(*values: Array) -> Array:
    """Real and imaginary parts of arrays (m, ...) side by side, (m, 2 n, ...)."""
    return np.stack([part for z in values for part in (z.real, z.imag)], axis=1)
