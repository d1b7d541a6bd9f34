"""A wall without the modes that hardly matter: the error that leaving out each one would cause.

A mode can be frozen (it hardly moves while the spheres are there: 51 Hz) or made static (it follows
the force at once: 40 kHz). Its cost is the change of velocity of the last sphere that the missing
displacement causes through the contact stiffness,
    cost_j = max_t | int k(t) (u_j - u_j') dt | / (m V),   k = 3/2 A^(2/3) F^(1/3),
estimated from the force of one run; what all of it costs together is measured by a second run.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from beadwave.coupling.march import impact
from beadwave.coupling.verdict import largest_monotone_force
from beadwave.dem import Chain, Trajectory, Wall


class TruncatedMode(NamedTuple):
    """A mode left out: its index in the wall, frequency [Hz], "frozen" or "static", its cost in
    relative velocity."""

    mode: int
    frequency_hz: float
    how: str
    cost: float

    def __str__(self) -> str:
        return f"{self.frequency_hz:.4g} Hz: leave out ({self.how}), {self.cost:.1e}"


class Pruning(NamedTuple):
    """A wall of fewer modes: what was left out, the largest velocity change over the striker's
    speed that was measured for it."""

    wall: Wall
    left_out: tuple[TruncatedMode, ...]
    cost: float

    @property
    def sentences(self) -> tuple[str, ...]:
        """One for each mode left out and one for all of them."""
        n_left_out = len(self.left_out)
        return (
            *map(str, self.left_out),
            f"{n_left_out} of {len(self.wall.omega) + n_left_out} wall modes left out; together "
            f"they change the velocities by {self.cost:.1e} of the striker's.",
        )


def prune(chain: Chain, wall: Wall, v0: ArrayLike, *, duration: float, error: float) -> Pruning:
    """Leave out wall modes while all velocities from v0 (n,) [m/s] over `duration` [s] stay within
    error of the striker's speed.

    Modes go in the order of their costs; the pruned wall is marched and modes come back until the
    measured change is below error. Costs about three runs: worth it before a series of them. The
    wall is as good as measured at this speed and duration only. Raises what `impact` does.
    """
    # marches ten times as exact as what is measured by them, their forces saved finely
    options = {"duration": duration, "error": 0.1 * error, "n_save": 20000}
    reference = impact(chain, wall, v0, **options)

    # as many modes, the least costly first, as cost the error in total if no costs cancel
    order = sorted(mode_costs(chain, wall, reference.trajectory), key=lambda mode: mode.cost)
    total = np.cumsum([mode.cost for mode in order])
    n = int(np.searchsorted(total, error))

    # the change they make is measured by a second run, and a fifth of them comes back after each
    # run that misses the error; no run where the contact would be unstable with static modes
    speed = np.abs(v0).max()
    while n > 0:
        pruned = without(wall, order[:n])
        allowed = largest_monotone_force(pruned.residual_compliance, chain.elastic.at(-1))
        if reference.verdict.predicted_peak_force < allowed:
            run = impact(chain, pruned, v0, **options)
            cost = np.abs(run.trajectory.v - reference.trajectory.v).max() / speed
            if cost <= error:
                return Pruning(pruned, tuple(order[:n]), float(cost))
        n = int(0.8 * n)
    return Pruning(wall, (), 0.0)


def without(wall: Wall, left_out: ArrayLike) -> Wall:
    """The wall without the modes of some `TruncatedMode`; the static ones go into the residual
    compliance, by (phi / omega)^2 each."""
    static = [mode.mode for mode in left_out if mode.how == "static"]
    moving = np.setdiff1d(np.arange(len(wall.omega)), [mode.mode for mode in left_out])
    softer = np.sum((wall.phi[static] / wall.omega[static]) ** 2)
    return wall._replace(
        omega=wall.omega[moving],
        zeta=wall.zeta[moving],
        phi=wall.phi[moving],
        residual_compliance=float(wall.residual_compliance + softer),
    )


def mode_costs(chain: Chain, wall: Wall, run: Trajectory) -> tuple[TruncatedMode, ...]:
    """Cost of leaving out each mode, in relative velocity, frozen or static, whichever costs less,
    estimated from the wall force of a run. The displacement that a mode lacks is that under this
    force, and changes it by the contact's stiffness; what the changed force does to the modes in
    turn is left out, and only measured by the march of `prune`."""
    # the velocity that a displacement held for a step makes, relative to the striker's
    F = run.contact_force[:, -1]
    h = run.t[1] - run.t[0]
    law = chain.elastic.at(-1)
    stiffness = law.stiffness(law.overlap(np.maximum(F, 0)))
    stiffness = stiffness / (1 + wall.residual_compliance * stiffness)
    momentum = chain.mass[-1] * np.abs(run.v[0]).max()
    slope = h * stiffness / momentum

    costs = []
    swing = F - F[0]  # the static part of the mode is in its state of rest
    for j, (omega, phi) in enumerate(zip(wall.omega, wall.phi, strict=True)):
        u = phi**2 * oscillation(swing, omega, wall.zeta[j], h)
        missing = {"frozen": u}
        if omega > 0:
            missing["static"] = u - (phi / omega) ** 2 * swing
        cost = {how: float(np.abs(np.cumsum(slope * d)).max()) for how, d in missing.items()}
        how = min(cost, key=cost.get)
        costs.append(TruncatedMode(j, float(omega / (2 * np.pi)), how, cost[how]))
    return tuple(costs)


def oscillation(F: np.ndarray, omega: float, zeta: float, h: float) -> np.ndarray:
    """q (k,) of q'' + 2 zeta omega q' + omega^2 q = F from rest, F held over steps of h [s]."""
    from scipy.signal import lfilter  # half a second that a run without pruning does not pay for

    if omega == 0:
        p = h * np.append(0, np.cumsum(F)[:-1])
        return np.append(0, np.cumsum(h * p + h**2 / 2 * F)[:-1])
    # partial fractions of its two poles, kept apart where critical damping joins them
    root = np.emath.sqrt(1 - zeta**2)
    p1 = omega * (-zeta + 1j * root)
    p2 = omega * (-zeta - 1j * root)
    if abs(root) < 1e-6:
        p1, p2 = p1 + 1e-6 * omega, p2 - 1e-6 * omega
    first, second = (lfilter([0, np.expm1(p * h) / p], [1, -np.exp(p * h)], F) for p in (p1, p2))
    return ((first - second) / (p1 - p2)).real
