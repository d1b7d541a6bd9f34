"""Periodic states one after the other, each from its neighbour's: of a curve, or of a study.

The state of a neighbouring amplitude, frequency, coefficient or arm is a good first guess, and the
linear system with the contact's stiffness and damping over the neighbour's cycle a good Jacobian
(`coupling.periodic_state`). What the contact keeps of its past comes along: a state reached so may
have another mean force than one from a contact that was never sheared, by residual slip.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from beadwave.coupling.periodic_state import (
    USUAL_PERIODIC_SEARCH,
    PeriodicSearch,
    PeriodicState,
    fixed_point,
    linear_period,
    numbers_of,
    period_of,
    periodic_state,
)
from beadwave.coupling.spatial_march import Before, MarchState, PreparedImpact
from beadwave.dem.kernels.arguments import Steps
from beadwave.dem.kernels.spatial import RUBBED
from beadwave.dem.richardson import richardson


class SteadyState(NamedTuple):
    """A periodic state at t = 0, and what its cycle shows."""

    moving: MarchState
    energy: float  # [J] heat of friction in a period
    friction: float  # [N] half of peak to peak, along the direction that slips most
    slip: float  # [m] half of peak to peak
    stick: float  # least share of the contact's area that sticks in the cycle
    n_steps: int  # of a period
    speed: float  # [m/s] largest of spheres and of the wall at the contact
    # change from period to period, and by half as many steps, samples or cells; infinite where
    # these were not compared
    error: float
    cold: bool = True  # from rest: a neighbour's state was not asked for, or not near enough


# a neighbour's state is near: a search that needs more than this is started cold instead
NEIGHBOURS = USUAL_PERIODIC_SEARCH._replace(most_iterations=4)


def cold_state(
    body: PreparedImpact,
    before: Before,
    *,
    error: float,
    speed: float,
    search: PeriodicSearch = USUAL_PERIODIC_SEARCH,
) -> SteadyState:
    """The periodic state from a contact that was never sheared. Raises UnstableStep where none is
    found; arguments as in `periodic_state`."""
    return steady(body, periodic_state(body, before, error=error, speed=speed, search=search))


def steady(body: PreparedImpact, state: PeriodicState) -> SteadyState:
    """Result of a search from rest; its cycle may be one of samples, coarser than a march takes."""
    cycle = state.cycle
    amplitude = 0.5 * np.ptp(cycle.friction_force, axis=0)
    speed = max(state.wall_speed, float(np.abs(state.moving.motion.v).max()))
    # at most 0.05 rad of the fastest contact in a step: a tenth of a percent a period
    return SteadyState(
        state.moving,
        cycle.energy,
        float(amplitude[cycle.axis]),
        float(0.5 * np.ptp(cycle.slip[:, cycle.axis])),
        float(cycle.stick_share.min()),
        max(cycle.n_steps // cycle.periods, math.ceil(body.shakers.period * body.rate / 0.05)),
        speed,
        state.error_estimate + cycle.periodicity_error,
    )


def neighbouring_state(
    body: PreparedImpact,
    before: Before,
    neighbour: SteadyState,
    *,
    error: float,
    speed: float,
    compared: bool = True,
    search: PeriodicSearch = NEIGHBOURS,
) -> SteadyState:
    """The periodic state of a body, from that of a similar one with as many bodies and modes, by
    its steps of a period; from rest where that is not near enough, which `cold` says. Raises
    UnstableStep.

    The error is found by half as many steps and cells, twice the time; `compared=False` leaves
    it out, as differences of neighbours do, whose errors by the steps are alike.
    """
    # Newton's method from the neighbour's state, with the linear system of its cycle as Jacobian
    period = period_of(body, before, neighbour.n_steps, search)
    n_steps = period.steps.n_save * period.steps.stride
    moving = neighbour.moving.copied()
    body.settle(moving, period.system, 0.0)
    saved = period.march(moving.copied())
    M, weights = linear_period(period, saved)
    units = np.where(weights > 0.0, weights, 1.0)
    point = fixed_point(
        period, moving, search, search.periodicity * error, units[:, None] * M / units
    )
    if not point.change <= search.accepted * error:
        return cold_state(body, before, error=error, speed=speed)

    # compared with half as many steps and cells, from the state that was just found
    saved, of_steps = point.saved, math.inf
    if compared:
        coarser = period_of(body, before, n_steps // 2, search)
        start, n_cells = point.moving.copied(), body.search.n_cells
        if point.moving.contacts.cells is not None:
            start = point.moving.divided(n_cells // 2)
        body.settle(start, coarser.system, 0.0)
        coarse_point = fixed_point(
            coarser, start, search, search.periodicity * error, point.jacobian
        )
        if coarse_point.change <= search.accepted * error:
            numbers = [numbers_of(one, speed, body) for one in (saved, coarse_point.saved)]
            order = 1.0 if len(body.frame) == 2 else 2.0
            of_steps = richardson(numbers[0].difference(numbers[1]), 2.0, order)
    axis = int(np.ptp(saved.slip, axis=0).argmax())
    speeds = np.concatenate([saved.v, saved.wall[:, 1]], axis=1)
    return SteadyState(
        point.moving,
        float(saved.energy[-1, RUBBED] - saved.energy[0, RUBBED]),
        float(0.5 * np.ptp(saved.force[:, 1 + axis])),
        float(0.5 * np.ptp(saved.slip[:, axis])),
        float(saved.stick.min()),
        n_steps,
        float(np.abs(speeds).max()),
        point.change + of_steps,
        cold=False,
    )


def later(
    body: PreparedImpact, before: Before, state: SteadyState, turn: float
) -> tuple[PreparedImpact, MarchState]:
    """Body and state with all shakers later in their cycle by `turn` common periods, rounded to a
    step of the march: a periodic state holds every phase, and a march on reaches it. Raises
    UnstableStep."""
    T = body.shakers.period
    n_steps = state.n_steps
    n = round((turn % 1.0) * n_steps)
    moving, h = state.moving.copied(), T / n_steps
    if n:
        system = body.stepped(h, before_striker=before)
        body.settle(moving, system, -T)
        body.march(moving, system, -T, Steps(h, 1, n))
    phase = body.shakers.phase + 2.0 * math.pi * body.shakers.frequency * n * h
    return body._replace(shakers=body.shakers._replace(phase=phase)), moving


def before_striker(body: PreparedImpact, v0: ArrayLike, *, upstream_held: bool = False) -> Before:
    """The chain before velocities v0 (n,) [m/s]: a first sphere that moves and that nothing presses
    is the striker, and not there yet; `upstream_held` holds all but the last."""
    v0 = np.asarray(v0, float)
    striker = v0.size > 1 and v0[0] > 0.0 and body.prepared.static.force[0] == 0.0
    rests = np.zeros(v0.size, bool)
    rests[:-1] = upstream_held
    rests[0] |= striker
    return Before(rests, int(striker))


def struck(moving: MarchState, before: Before, v0: ArrayLike) -> None:
    """Add velocities v0 (n,) [m/s] of the chain to a state, in place; a striker that was not there
    touches the second sphere."""
    if before.n_absent:
        moving.motion.x[0] = moving.motion.x[1]
    moving.motion.v[:] += np.asarray(v0, float)
