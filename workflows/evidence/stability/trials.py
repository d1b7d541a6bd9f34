"""Runs of a chain at a wall, each beside a finer one."""

from functools import partial

import numpy as np

from beadwave import dem
from beadwave.dem.spheres import time_scale
from beadwave.workflows.evidence.harness import Outcome

STEEL = 210e9  # Pa


def settled(
    chain: dem.Chain,
    wall: dem.Wall | None,
    v0: np.ndarray,
    duration: float,
    *,
    young: float | np.ndarray = STEEL,
    error: float = 1e-4,
    n_save: int = 100,
) -> Outcome:
    """A run from velocities v0 (n,) [m/s] to an error, its true error against a finer one, and
    where it left the model's range; young [Pa] of all spheres or of each, (n,).

    An energy error counts as a hundredth of its size as an error of the velocities, so that it may
    be a hundred times `error`. The search for the step is given 1e9 evaluations of all contacts and
    modes.
    """
    size = chain.mass.size + (0 if wall is None else wall.omega.size)
    run = dem.march_to_error(
        chain, wall, v0, duration=duration, error=error, n_save=n_save,
        search=dem.StepSearch(max_evaluations=1e9 / size),
    ).trajectory  # fmt: skip
    speed = float(np.abs(v0).max()) or 1.0
    true = float(np.abs(finer(chain, wall, v0, run).v - run.v).max()) / speed
    warnings = dem.outside(dem.strain(chain, young, run.contact_force, run.v))
    return Outcome(max(true, 1e-2 * run.energy_error), error, warnings)


def finer(
    chain: dem.Chain, wall: dem.Wall | None, v0: np.ndarray, run: dem.Trajectory
) -> dem.Trajectory:
    """The march from v0 (n,) with a quarter of the step by another scheme, where one bears the
    damping.

    The implicit schemes, which alone average a force that jumps, take an eighth of the step. Beside
    a light wall the step is no longer than the contacts' stability allows: a run to an error
    resolves the motion by longer ones, which `march` refuses.
    """
    march = partial(dem.march, chain, wall, v0, duration=run.t[-1], n_save=run.t.size - 1)
    if run.scheme.startswith("energy"):
        return march(scheme=run.scheme, dt=run.dt / 8)

    def stable(scheme: str) -> float:
        # half: contacts that share a sphere lower the limit by up to sqrt(2)
        return min(run.dt / 4, dem.stability_limit(chain, wall, v0, scheme=scheme) / 2)

    scheme = "split6" if chain.dissipation == "none" else "kahan-li6"
    try:
        return march(scheme=scheme, dt=stable(scheme))
    except dem.UnstableStep:  # of the damping
        return march(scheme=run.scheme, dt=stable(run.scheme))


def collisions(chain: dem.Chain, speed: float, count: float) -> float:
    """Duration [s] of so many of the slowest contact's natural times."""
    n = chain.A.size
    return count * float(time_scale(chain.mass[:n], chain.A, speed).max())
