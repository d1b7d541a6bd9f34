"""The coupled run: judge the chain and its wall, then march both."""

from collections.abc import Callable
from typing import NamedTuple

from numpy.typing import ArrayLike

from coupling.coupled_march import EnergyGain, energy_gain, march_coupled
from coupling.coupled_wall import CoupledWall
from coupling.errors import CouplingError
from coupling.verdict import Verdict, verdict
from dem import (
    Chain,
    StepReport,
    Trajectory,
    Wall,
    march,
    march_to_error,
    stability_limit,
    with_step_error,
)

CLOSED = 1e-2  # energy error over the error of the velocities
HALVINGS = 5
OPENING = 30.0  # longest stable steps, some ten impacts: an earlier horizon says nothing on a step


class Impact(NamedTuple):
    """A coupled run: trajectory, the judgement before it, how its step was found (None for a given
    step and for a CoupledWall), and the energy made of nothing (a passive wall: rounding)."""

    trajectory: Trajectory
    verdict: Verdict
    step_report: StepReport | None
    energy_gain: EnergyGain


def impact(
    chain: Chain,
    wall: Wall | CoupledWall | None,
    v0: ArrayLike,
    *,
    duration: float,
    error: float | None = None,
    dt: float | None = None,
    horizon: float | None = None,
    n_save: int = 1000,
    **options,
) -> Impact:
    """Run a chain with velocities v0 (n,) [m/s] into a wall for duration [s].

    Give error, the relative velocity error asked for, or the step dt [s], whose error a march with
    half of it estimates. With horizon [s] the error is held up to there and the rest of the run
    takes a step that closes its energy to a hundredth of it: after tens of impacts spheres move
    chaotically, and no step holds a velocity error for long. options go to the march
    (observed, scale, scheme, ...). A CoupledWall is marched by march_coupled, where error bounds
    the error of a step; with_coupled_error estimates that of the run. Raises CouplingError if the
    verdict says it cannot work.
    """
    if (error is None) == (dt is None):
        raise CouplingError("give either error or dt to say how finely to march.")
    judged = verdict(chain, wall, v0)
    if not judged.possible:
        raise CouplingError(judged.findings[0])
    run = {"duration": duration, "n_save": n_save} | options
    report = None
    if isinstance(wall, CoupledWall):
        if error is None:
            raise CouplingError("a CoupledWall is marched to an error; give error instead of dt.")
        trajectory = march_coupled(chain, wall, v0, error=error, **run)
    elif dt is not None:
        trajectory = march(chain, wall, v0, dt=dt, **run)
        trajectory = with_step_error(chain, wall, v0, trajectory, state=run.get("state"))
    else:
        trajectory, report = _controlled(chain, wall, v0, error, horizon, run)
    return Impact(trajectory, judged, report, energy_gain(trajectory))


def _controlled(
    chain: Chain,
    wall: Wall | None,
    v0: ArrayLike,
    error: float,
    horizon: float | None,
    run: dict,
) -> tuple[Trajectory, StepReport]:
    if horizon is not None:
        horizon = max(horizon, OPENING * stability_limit(chain, wall, v0))
    if horizon is None or horizon >= run["duration"]:
        return march_to_error(chain, wall, v0, error=error, **run)
    saves = max(1, round(run["n_save"] * horizon / run["duration"]))
    first = run | {"duration": horizon, "n_save": saves}
    opening, report = march_to_error(chain, wall, v0, error=error, **first)
    rest = {"duration": run["duration"], "n_save": run["n_save"], "scheme": opening.scheme}
    whole = _closed(lambda dt: march(chain, wall, v0, dt=dt, **rest), opening.dt, CLOSED * error)
    return whole._replace(error_estimate=report.error_estimate), report


def _closed(run: Callable[[float], Trajectory], dt: float, energy_error: float) -> Trajectory:
    """The run with a step that keeps the ledger closed to energy_error, or the closest found."""
    found = finer = run(dt)
    for _ in range(HALVINGS):
        if found.energy_error <= energy_error:
            break
        finer = run(finer.dt / 2)
        found = min(found, finer, key=lambda one: one.energy_error)
    return found
