"""Wall modes that are not worth their time: what leaving each one out costs, and a smaller wall.

A mode can be frozen (it hardly moves while the spheres are there: 51 Hz) or made static (it follows
the force at once: 40 kHz). Its cost is the change of velocity of the last sphere that the missing
displacement causes through the contact stiffness,
    cost_j = max_t | int k(t) (u_j - u_j') dt | / (m V),   k = 3/2 A^(2/3) F^(1/3),
estimated from the force of one run; what all of it costs together is measured by a second run.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from coupling.march import impact
from coupling.verdict import largest_monotone_force
from dem import Chain, Trajectory, Wall
from dem.spheres import hertz_overlap, hertz_stiffness

FINE = 20000  # saved forces of the run that the costs are estimated from


class LeftOut(NamedTuple):
    """A mode left out: its place in the wall, frequency [Hz], "frozen" or "static", its cost in
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
    left_out: tuple[LeftOut, ...]
    cost: float

    @property
    def sentences(self) -> tuple[str, ...]:
        """One for each mode left out and one for all of them."""
        kept = len(self.wall.omega)
        return (
            *map(str, self.left_out),
            f"{len(self.left_out)} of {kept + len(self.left_out)} wall modes left out; together "
            f"they change the velocities by {self.cost:.1e} of the striker's.",
        )


def prune(chain: Chain, wall: Wall, v0: ArrayLike, *, duration: float, error: float) -> Pruning:
    """Leave out wall modes while all velocities stay within error of the striker's speed.

    Modes go in the order of their costs; the pruned wall is marched and modes come back until the
    measured change is below error. Costs about three runs: worth it before a series of them.
    """
    whole = impact(chain, wall, v0, duration=duration, error=0.1 * error, n_save=FINE)
    costs = mode_costs(chain, wall, whole.trajectory)
    order = sorted(costs, key=lambda mode: mode.cost)
    total = np.cumsum([mode.cost for mode in order])
    n = int(np.searchsorted(total, error))
    speed = np.abs(v0).max()
    while True:
        pruned = without(wall, order[:n])
        allowed = largest_monotone_force(pruned.residual_compliance, chain.A[-1])
        if n == 0:
            return Pruning(wall, (), 0.0)
        if whole.verdict.predicted_peak_force < allowed:
            run = impact(chain, pruned, v0, duration=duration, error=0.1 * error, n_save=FINE)
            cost = np.abs(run.trajectory.v - whole.trajectory.v).max() / speed
            if cost <= error:
                return Pruning(pruned, tuple(order[:n]), float(cost))
        n = int(0.8 * n)


def without(wall: Wall, left_out: ArrayLike) -> Wall:
    """The wall with modes left out; the static ones go into the residual compliance."""
    static = [one.mode for one in left_out if one.how == "static"]
    kept = np.setdiff1d(np.arange(len(wall.omega)), [one.mode for one in left_out])
    softer = np.sum((wall.phi[static] / wall.omega[static]) ** 2)
    return wall._replace(
        omega=wall.omega[kept],
        zeta=wall.zeta[kept],
        phi=wall.phi[kept],
        residual_compliance=float(wall.residual_compliance + softer),
    )


def mode_costs(chain: Chain, wall: Wall, run: Trajectory) -> tuple[LeftOut, ...]:
    """What leaving out each mode would cost, by the cheaper way, from the wall force of a run."""
    F = run.contact_force[:, -1]
    h = run.t[1] - run.t[0]
    stiffness = hertz_stiffness(hertz_overlap(np.maximum(F, 0), chain.A[-1]), chain.A[-1])
    stiffness = stiffness / (1 + wall.residual_compliance * stiffness)
    momentum = chain.mass[-1] * np.abs(run.v[0]).max()
    slope = h * stiffness / momentum
    return tuple(_cheaper_way(wall, j, F - F[0], slope, h) for j in range(len(wall.omega)))


def _cheaper_way(wall: Wall, j: int, F: np.ndarray, slope: np.ndarray, h: float) -> LeftOut:
    omega, phi = wall.omega[j], wall.phi[j]
    u = phi**2 * oscillation(F, omega, wall.zeta[j], h)
    missing = {"frozen": u}
    if omega > 0:
        missing["static"] = u - (phi / omega) ** 2 * F
    cost = {how: float(np.abs(np.cumsum(slope * d)).max()) for how, d in missing.items()}
    how = min(cost, key=cost.get)
    return LeftOut(j, float(omega / (2 * np.pi)), how, cost[how])


def oscillation(F: np.ndarray, omega: float, zeta: float, h: float) -> np.ndarray:
    """q (k,) of q'' + 2 zeta omega q' + omega^2 q = F from rest, F held over steps of h [s]."""
    from scipy.signal import lfilter  # half a second that a run without pruning does not pay for

    if omega == 0:
        p = h * np.append(0, np.cumsum(F)[:-1])
        return np.append(0, np.cumsum(h * p + h**2 / 2 * F)[:-1])
    root = np.emath.sqrt(1 - zeta**2)
    pole = omega * (-zeta + 1j * root)
    other = omega * (-zeta - 1j * root)
    if abs(root) < 1e-6:
        pole, other = pole + 1e-6 * omega, other - 1e-6 * omega
    first, second = (
        lfilter([0, np.expm1(p * h) / p], [1, -np.exp(p * h)], F) for p in (pole, other)
    )
    return ((first - second) / (pole - other)).real
