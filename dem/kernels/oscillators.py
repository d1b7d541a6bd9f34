"""Exact motion of damped oscillators over a time: of wall modes and leaf springs in a drift."""

import math

import numpy as np
from numpy.typing import ArrayLike

from beadwave.dem.kernels.arguments import Array
from beadwave.dem.kernels.compiled import ieee, ieee_entry


@ieee
def propagator(omega: float, zeta: float, t: float) -> tuple[float, float, float, float]:
    """qq, qp [s], pq [1/s], pp of  q -> qq q + qp p,  p -> pq q + pp p  after the time t [s] of
    q'' + 2 zeta omega q' + omega^2 q = 0,  for any damping and omega = 0; t may be negative.

    With the decay zeta omega and the beat b = omega sqrt(1 - zeta^2) they follow from
    c = exp(-decay t) cos b t  and  s = exp(-decay t) sin(b t) / b.
    """
    decay, square = zeta * omega, omega * omega * (1.0 - zeta * zeta)
    beat = math.sqrt(abs(square))
    z = beat * t

    # near critical damping, or in a short time, s is a quotient of two small numbers: a series
    if abs(z) < 1e-3:
        sign = 1.0 if square > 0.0 else -1.0
        shrink = math.exp(-decay * t)
        c = shrink * (1.0 - sign * z * z * (0.5 - sign * z * z / 24.0))
        s = shrink * t * (1.0 - sign * z * z * (1.0 / 6.0 - sign * z * z / 120.0))
    elif square > 0.0:
        shrink = math.exp(-decay * t)
        c, s = shrink * math.cos(z), shrink * math.sin(z) / beat
    else:
        # overdamped: the slow rate  decay - beat  as a quotient, which does not cancel
        rise = math.exp(-omega * t / (zeta + math.sqrt(zeta * zeta - 1.0)))
        fall = math.exp(-(decay + beat) * t)
        c, s = 0.5 * (rise + fall), 0.5 * (rise - fall) / beat
    return c + decay * s, s, -omega * omega * s, c - decay * s


@ieee_entry
def fill_propagator(omega: Array, zeta: Array, t: Array, out: Array) -> None:
    """`propagator` of oscillators omega, zeta (k,) over times t (k,) [s] into out (4, k)."""
    for j in range(omega.size):
        out[0, j], out[1, j], out[2, j], out[3, j] = propagator(omega[j], zeta[j], t[j])


@ieee_entry
def fill_propagators(steps: Array, omega: Array, zeta: Array, out: Array) -> None:
    """`propagator` of every mode (n_modes,) over every of the steps (n_steps,) [s] into out
    (n_steps, 4, n_modes); steps that come again in a palindrome are copied."""
    n = steps.size
    for k in range(n):
        mirror = n - 1 - k
        if mirror < k and steps[mirror] == steps[k]:
            for j in range(omega.size):
                for row in range(4):
                    out[k, row, j] = out[mirror, row, j]
            continue
        for j in range(omega.size):
            a, b, c, d = propagator(omega[j], zeta[j], steps[k])
            out[k, 0, j], out[k, 1, j], out[k, 2, j], out[k, 3, j] = a, b, c, d


def oscillator_propagator(omega: ArrayLike, zeta: ArrayLike, t: ArrayLike) -> Array:
    """(4, ...) rows qq, qp, pq, pp of `propagator` for oscillators omega [rad/s], zeta and times
    t [s] of shapes that broadcast to (...)."""
    omega, zeta, t = np.broadcast_arrays(*(np.asarray(p, float) for p in (omega, zeta, t)))
    out = np.empty((4, omega.size))
    fill_propagator(omega.flatten(), zeta.flatten(), t.flatten(), out)
    return out.reshape(4, *omega.shape)


def step_response(omega: Array, zeta: Array, t: float) -> Array:
    """Displacement (k,) [m] of each oscillator, omega and zeta (k,), after the time t [s] of unit
    force on unit mass from rest: the integral of `oscillator_propagator`'s qp.

    That is (1 - qq) / omega^2, which cancels in a time short against the period or the decay, and
    is 0/0 of a free mass: there by 12 Gauss points.
    """
    nodes, weights = np.polynomial.legendre.leggauss(12)
    slow = omega * np.maximum(zeta, 1.0) * abs(t) < 1.0
    moved = [oscillator_propagator(omega, zeta, 0.5 * t * (1.0 + node))[1] for node in nodes]
    closed = (1.0 - oscillator_propagator(omega, zeta, t)[0]) / np.where(slow, 1.0, omega) ** 2
    return np.where(slow, 0.5 * t * (weights @ np.array(moved)), closed)


def propagators(steps: Array, omega: Array, zeta: Array) -> Array:
    """(n_steps, 4, k) of `oscillator_propagator`, of oscillators (k,) over steps (n_steps,) [s].

    The array has a row more than is returned. Kicks are one more than drifts, and the machine code
    of a march takes its wide loops only where the modes do not overlap as many rows as there are
    kicks: modes that happened to lie right behind were summed in another order, and the same run
    had other last digits.
    """
    out = np.empty((steps.size + 1, 4, omega.size))[:-1]
    fill_propagators(steps, np.asarray(omega, float), np.asarray(zeta, float), out)
    return out
