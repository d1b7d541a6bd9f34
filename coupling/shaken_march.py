"""A chain that strikes a structure which shakers move: the periodic state, then the march."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from beadwave.coupling.periodic_state import (
    USUAL_PERIODIC_SEARCH,
    PeriodicSearch,
    PeriodicState,
    periodic_state,
)
from beadwave.coupling.spatial_march import (
    Before,
    PreparedImpact,
    SpatialRun,
    march_to_error,
)
from beadwave.dem import ArrayErrors
from beadwave.dem.checks import require, saves


class ShakenRun(NamedTuple):
    """A march from the periodic state on."""

    run: SpatialRun
    before: PeriodicState


def march_shaken(
    body: PreparedImpact,
    v0: ArrayLike,
    *,
    duration: float,
    error: float | None = None,
    n_save: int = 1000,
    upstream_held: bool = False,
    periodic: PeriodicSearch = USUAL_PERIODIC_SEARCH,
) -> ShakenRun:
    """A body (`body_of`) with velocities v0 (n,) [m/s] of its chain added at t = 0 to the periodic
    state of chain, contact and structure under the shakers; at n_save + 1 equal times.

    A first sphere that moves and that nothing presses is the striker: it is not there before, and
    touches the second one at t = 0. `upstream_held`: all spheres but the last rest until then.
    Errors are relative to the largest speed, of the striker or in the cycle. Raises InvalidChain,
    and UnstableStep where no state is periodic.
    """

    # the striker is not there before, others may be held until it comes
    chain, last = body.prepared.chain, body.last
    n, v0 = chain.mass.size, np.asarray(v0, float)
    saves(n_save, n)
    pressed = body.prepared.static.force
    striker = n > 1 and v0[0] > 0.0 and pressed[0] == 0.0
    held = np.zeros(n, bool)
    held[:-1] = upstream_held
    held[0] |= striker

    # spheres before the last that nothing holds would be pushed away
    loose = (chain.springs[0] == 0.0) & ~held
    loose[:-1] &= pressed[: n - 1] == 0.0
    loose[-1] = False
    require(
        not loose.any(),
        f"sphere {int(loose.argmax()) + 1} of {n} is held by nothing while the shakers move the "
        'wall; add leaf springs, press the chain together, or set friction.upstream to "held"',
    )

    # the periodic state, and from there the march with the velocities added; the error is shared
    # by both, half of it at least is the march's
    speed = float(max(np.abs(v0).max(), np.hypot(*np.asarray(last.velocity, float))))
    wanted = 1e-4 if error is None else error
    before = periodic_state(
        body, Before(held, int(striker)), error=wanted, speed=speed, search=periodic
    )
    start = before.moving.copied()
    if striker:
        start.motion.x[0] = start.motion.x[1]
    start.motion.v[:] += v0
    start.motion.u_v[:] += body.frame @ np.asarray(last.velocity, float)
    speed = max(speed, before.wall_speed, float(np.abs(before.moving.motion.v).max()))
    of_march = None if error is None else max(error - before.error_estimate, 0.5 * error)
    run = march_to_error(
        body, start, duration=duration, error=of_march, n_save=n_save, speed=speed or None
    )
    lateral = run.lateral._replace(
        cycle=before.cycle,
        slip=run.lateral.slip - before.slip_mean,
        error_estimate=run.lateral.error_estimate + before.error_estimate,
    )
    trajectory = run.trajectory
    if trajectory.errors is not None:
        # the periodic state is off by its error too, a share of each motion and force
        share = before.error_estimate
        x, v, force = trajectory.errors
        moved = np.ptp(trajectory.x, axis=0).max()
        pushed = np.ptp(trajectory.contact_force, axis=0).max()
        errors = ArrayErrors(x + share * moved, v + share * speed, force + share * pushed)
        run = run._replace(trajectory=trajectory._replace(errors=errors))
    return ShakenRun(run._replace(lateral=lateral), before)
