"""A chain's velocities and their exact derivatives by parameters: forward sensitivities.

    m x'' = F(x, v; theta),   X = dx/dtheta:   m X'' = F_x X + F_v X' + F_theta

marched by one scheme, so that X is the derivative of the discrete solution, the static state it
starts from included. E. Hairer, S. P. Norsett, G. Wanner, Solving ODE I, I.14.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from beadwave.dem.chain import Chain, validate
from beadwave.dem.checks import InvalidChain
from beadwave.dem.kernels.arguments import Array
from beadwave.dem.kernels.oscillators import oscillator_propagator
from beadwave.dem.kernels.sensitivities import (
    DerivativeRecord,
    SensitivityRig,
    Slopes,
    SphereDerivatives,
    march,
    workspace,
)
from beadwave.dem.spheres import time_scale
from beadwave.dem.static_sensitivities import Directions, static_sensitivities
from beadwave.dem.statics import equilibrium
from beadwave.dem.walls import Wall

STEPS_PER_TIME_SCALE = 40.0  # of the stiffest contact: 1e-6 in the velocities of a chain of 17


class Sensitivities(NamedTuple):
    """Velocity and acceleration of m observed spheres at every step, and their derivatives."""

    t: Array  # (n_steps + 1,) [s]
    v: Array  # (n_steps + 1, m) [m/s]
    a: Array  # (n_steps + 1, m) [m/s^2]
    dv: Array  # (n_steps + 1, m, p) by the parameters
    da: Array  # (n_steps + 1, m, p)

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """v (k, m), a (k, m), dv (k, m, p) at any times t (k,) [s] within the run: cubic Hermite.

        a is the slope of the interpolant, so that it is the derivative of v by a shift in time.
        """
        h = self.t[1]
        i = np.clip((t / h).astype(int), 0, len(self.t) - 2)
        s = t / h - i

        # weights of v0, a0, v1, a1 for the value and for its slope by s
        value = (2 * s**3 - 3 * s**2 + 1, h * (s**3 - 2 * s**2 + s), 3 * s**2 - 2 * s**3)
        value = (*value, h * (s**3 - s**2))
        slope = (6 * s**2 - 6 * s, h * (3 * s**2 - 4 * s + 1), 6 * s - 6 * s**2)
        slope = (*slope, h * (3 * s**2 - 2 * s))
        v = _weighted(value, self.v, self.a, i)
        return v, _weighted(slope, self.v, self.a, i) / h, _weighted(value, self.dv, self.da, i)


def _weighted(weights, v, a, i):
    """(k, ...) between the steps i and i + 1 by weights (4, k) of v, a at both."""
    w = [weight.reshape(-1, *[1] * (v.ndim - 1)) for weight in weights]
    return w[0] * v[i] + w[1] * a[i] + w[2] * v[i + 1] + w[3] * a[i + 1]


def no_directions(chain: Chain, wall: Wall | None) -> Directions:
    """Zero directions, of no parameter."""
    n, n_contacts = chain.mass.size, chain.A.size
    k = 0 if wall is None else wall.omega.size
    sizes = (n_contacts, n_contacts, n, None, k, k, k)
    return Directions(*(np.zeros((0,) if size is None else (size, 0)) for size in sizes))


def usual_step(chain: Chain, wall: Wall | None, v0: ArrayLike) -> float:
    """Step [s] from the stiffest contact at the impact of the fastest of the spheres, v0 (n,)
    [m/s], or at rest. Raises InvalidChain, NoEquilibrium."""
    mass, law, speed = chain.mass.min(), chain.elastic, np.abs(v0).max()
    force = equilibrium(chain, wall).force.max(initial=0.0)
    at_rest = np.sqrt(law.stiffness(law.overlap(force)).max(initial=0.0) / mass)
    moving = 0.0
    if speed and law.shape is None:
        moving = 1.0 / time_scale(mass, chain.A.max(), speed)
    elif speed:
        # the time 1 / sqrt(k / m) of the contact that holds the sphere's energy, by the factor
        # which it is longer by than the time scale of Hertz' law
        deepest = law.overlap_of_energy(np.full(chain.A.shape, 0.5 * mass * speed**2))
        moving = float(np.sqrt(law.stiffness(deepest) / mass).max()) / 1.34
    return 1.0 / (STEPS_PER_TIME_SCALE * max(moving, at_rest))


def march_with_sensitivities(
    chain: Chain,
    wall: Wall | None,
    v0: ArrayLike,
    directions: Directions | None = None,
    *,
    duration: float,
    dt: float,
    observed: Sequence[int],
) -> Sensitivities:
    """Sensitivities of a run from the static state with velocities v0 (n,) [m/s], for `duration`
    [s] at steps of at most dt [s]; without `directions` by no parameter, the run alone.

    observed: indices of spheres, (m,). Takes any elastic law, with Hunt and Crossley's dissipation
    or none. Raises NoEquilibrium, and InvalidChain for forces that jump or remember (dampers that
    jump, guides' friction, yield, a dashpot wall) and for a run that is not finite.
    """
    validate(chain, wall, v0)
    require_smooth(chain, wall)
    directions = no_directions(chain, wall) if directions is None else directions
    static = equilibrium(chain, wall)
    d_static = static_sensitivities(chain, wall, static, directions)
    n_steps = int(np.ceil(duration / dt * (1 - 1e-9)))
    h = duration / n_steps
    m, p = len(observed), directions.preload.size

    # chain and wall, zeros for what they lack; modes rotate over half a step at a time
    gamma = np.zeros(chain.A.size) if chain.gamma is None else np.asarray(chain.gamma, float)
    walled = 0.0, 0.0, 0.0, np.zeros(0), *np.zeros((3, 0, 2, 2))
    if wall is not None:
        walled = (
            float(wall.residual_compliance), float(wall.phi @ static.q), float(static.force[-1]),
            wall.phi, *propagator_with_sensitivities(wall.omega, wall.zeta, 0.5 * h),
        )  # fmt: skip
    rig = SensitivityRig(
        chain.A, chain.elastic.shape, gamma, chain.mass, chain.steady, *chain.springs, *walled
    )  # fmt: skip

    # their derivatives by the parameters
    load = np.zeros((chain.mass.size, p))
    load[-1] = directions.preload
    d = directions
    derivatives = (d.A, d.gamma, d.phi, d.omega, d.zeta, load)
    parameters = None if d.parameters is None else np.ascontiguousarray(d.parameters, float)
    slopes = Slopes(
        *(np.ascontiguousarray(values, float) for values in derivatives), d_static.offset,
        d_static.force, parameters,
    )  # fmt: skip

    start = SphereDerivatives(static.x, np.array(v0, float), d_static.x, directions.v0)
    out = DerivativeRecord(*np.zeros((2, n_steps + 1, m)), *np.zeros((2, n_steps + 1, m, p)))
    march(workspace(start, rig), rig, slopes, h, n_steps, np.asarray(observed, np.int64), out)
    if not np.isfinite(out.v).all():
        raise InvalidChain(
            f"the run with sensitivities is not finite with dt = {h:.3g} s; take a smaller dt"
        )
    return Sensitivities(np.linspace(0.0, duration, n_steps + 1), *out)


def require_smooth(chain: Chain, wall: Wall | None) -> None:
    """Raise InvalidChain for a force that jumps or remembers: it has no derivative."""
    if chain.jumps and np.any(chain.gamma):
        raise InvalidChain(
            f"dissipation {chain.dissipation!r} jumps at first touch and has no sensitivities; "
            "take hunt-crossley or none"
        )
    if chain.slides:
        raise InvalidChain("friction jumps and has no sensitivities; leave out friction")
    if chain.yield_overlap is not None:
        raise InvalidChain("plastic contacts have no sensitivities here; leave out yield_overlap")
    if wall is not None and wall.mobility > 0.0:
        raise InvalidChain("a dashpot wall has no sensitivities here; take another wall")


def propagator_with_sensitivities(omega: Array, zeta: Array, t: float) -> tuple[Array, ...]:
    """Free motion over t [s] of q'' + 2 zeta omega q' + omega^2 q = 0, omega and zeta (k,), as
    (k, 2, 2), and its derivatives by omega and zeta, (k, 2, 2) each.

    By the complex step, f'(x) = Im f(x + i h) / h with h = 1e-30: no difference, no cancellation;
    exact to rounding below critical damping.
    """
    moved = oscillator_propagator(omega, zeta, t)
    by_omega, by_zeta = (np.zeros_like(moved) for _ in range(2))
    if omega.size:
        step = 1e-30
        by_omega = _propagator(omega + 1j * step, zeta, t).imag / step
        by_zeta = _propagator(omega, zeta + 1j * step, t).imag / step
    return tuple(np.ascontiguousarray(E.T.reshape(-1, 2, 2)) for E in (moved, by_omega, by_zeta))


def _propagator(omega, zeta, t):
    """(4, k) of `oscillator_propagator`, analytic in omega and zeta, which may be complex:
    sin(b t) / b and its like through b^2 alone."""
    square = omega**2 * (1.0 - zeta**2) * t**2
    root = np.sqrt(square.astype(complex))
    small = np.abs(root) < 1e-3
    safe = np.where(small, 1.0, root)
    series = 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0))
    sine = t * np.where(small, series, np.sin(safe) / safe)
    fade, decay = np.exp(-zeta * omega * t), zeta * omega
    cosine = np.cos(root)
    return fade * np.array([
        cosine + decay * sine, sine, -(omega**2) * sine, cosine - decay * sine
    ])  # fmt: skip
