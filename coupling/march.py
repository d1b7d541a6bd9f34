"""The coupled run: the verdict on chain and wall, then the march of both."""

from typing import NamedTuple

from numpy.typing import ArrayLike

from beadwave.coupling.coupled_march import EnergyGain, energy_gain, march_coupled
from beadwave.coupling.coupled_wall import CoupledWall
from beadwave.coupling.errors import CouplingError
from beadwave.coupling.verdict import Verdict, verdict
from beadwave.dem import (
    Chain,
    StepReport,
    Trajectory,
    Wall,
    march,
    march_to_error,
    stability_limit,
    with_step_error,
)

# Step of a run beyond its horizon
LEDGER_ERROR = 1e-2  # of the ledger, over the velocity error asked for
MAX_HALVINGS = 5  # of the step, at most, until the ledger closes; then the best of them counts
# shortest opening by which a step is chosen, in longest stable steps, some ten impacts: chosen
# by a shorter one, steps came out tiny
MIN_OPENING = 30.0


class Impact(NamedTuple):
    """A coupled run: trajectory, the verdict before it, how its step was found (None for a given
    step and for a CoupledWall), and the energy that it made out of nothing, which is rounding at a
    passive wall."""

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
    elif horizon is None:
        trajectory, report = march_to_error(chain, wall, v0, error=error, **run)
    else:
        trajectory, report = _beyond_horizon(chain, wall, v0, error, horizon, run)
    return Impact(trajectory, judged, report, energy_gain(trajectory))


def _beyond_horizon(
    chain: Chain,
    wall: Wall | None,
    v0: ArrayLike,
    error: float,
    horizon: float,
    run: dict,
) -> tuple[Trajectory, StepReport]:
    """A run whose velocities meet the error up to the horizon [s], and whose energy balance closes
    beyond it; with the report on its step."""
    duration, n_save = run["duration"], run["n_save"]
    horizon = max(horizon, MIN_OPENING * stability_limit(chain, wall, v0))
    if horizon >= duration:
        return march_to_error(chain, wall, v0, error=error, **run)

    # the step that the error asks for up to the horizon
    opening = run | {"duration": horizon, "n_save": max(1, round(n_save * horizon / duration))}
    first, report = march_to_error(chain, wall, v0, error=error, **opening)

    # halved until the energy of all of the run is closed; the last halving may be no better
    options = {"duration": duration, "n_save": n_save, "scheme": first.scheme}
    best = finest = march(chain, wall, v0, dt=first.dt, **options)
    for _ in range(MAX_HALVINGS):
        if best.energy_error <= LEDGER_ERROR * error:
            break
        finest = march(chain, wall, v0, dt=finest.dt / 2, **options)
        best = min(best, finest, key=lambda trajectory: trajectory.energy_error)
    return best._replace(error_estimate=report.error_estimate), report
