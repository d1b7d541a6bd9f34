"""A rig whose last sphere rubs on its structure, marched along and across the chain at once.

Steps are of one length, so that differences of two runs are smooth in the numbers. Where shakers
move the structure, a run starts from the periodic state, looked for from that of the scene's own
values.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.coupling.continuation import (
    NEIGHBOURS,
    before_striker,
    cold_state,
    neighbouring_state,
    struck,
)
from beadwave.coupling.spatial_march import USUAL_SPATIAL_SEARCH, PreparedImpact, body_of
from beadwave.coupling.structure_sensors import SensorSignals, sensed_in_march
from beadwave.dem.kernels.arguments import Steps
from beadwave.workflows.fit.marched_system import Rig, RubbingSurface


class RubbingMarch(NamedTuple):
    """Steps of its march; not varied."""

    n_cells: int = 64  # of the contact
    # [rad] of the fastest contact in a step, at most; at 0.1 the steps' error made up to 90 % of a
    # bar of the shaken rig, at 0.02 up to 1 %
    phase: float = 0.02
    state_error: float = 3e-3  # of the scene's own periodic state
    # of others, from it: what half a percent of the bounds changes is resolved
    neighbour_error: float = 1e-3


USUAL_RUBBING_MARCH = RubbingMarch()


class RubbingRun(NamedTuple):
    """A run at k instants, as `coupling.sensors.measured` reads it."""

    t: NDArray[np.float64]  # (k,) [s] from the first touch on
    x: NDArray[np.float64]  # (k, n) [m] towards the wall
    v: NDArray[np.float64]  # (k, n) [m/s]
    contact_force: NDArray[np.float64]  # (k, n) [N], the last one at the wall
    structure: SensorSignals | None  # where sensors are on it


def body(rig: Rig, options: RubbingMarch = USUAL_RUBBING_MARCH) -> PreparedImpact:
    """Chain, last sphere and structure, prepared."""
    across, search = rig.across, USUAL_SPATIAL_SEARCH._replace(n_cells=options.n_cells)
    return body_of(rig.chain, across.wall, rig.v0, across.last, across.shakers, search)


def prepared(rig: Rig, dt: float, options: RubbingMarch = USUAL_RUBBING_MARCH) -> RubbingSurface:
    """`rig.across` with its steps of dt [s] divided, and its periodic state. Raises UnstableStep
    where the shakers lead to none."""
    whole, across = body(rig), rig.across
    substeps = max(1, math.ceil(dt * whole.rate / options.phase))
    near = None
    if across.shakers is not None:
        before = before_striker(whole, rig.v0, upstream_held=across.upstream_held)
        speed = float(np.abs(rig.v0).max())
        near = cold_state(whole, before, error=options.state_error, speed=speed)
    return across._replace(substeps=substeps, near=near)


def march_rubbing(
    rig: Rig, duration: float, dt: float, options: RubbingMarch = USUAL_RUBBING_MARCH
) -> RubbingRun:
    """A run by steps of dt [s], saved at each. Raises UnstableStep, InvalidChain, NoEquilibrium,
    CouplingError."""
    across, whole = rig.across, body(rig)

    # before the striker: at rest, or the periodic state under the shakers. It is continued from
    # that of the scene's own values, so that neighbouring values end in the same branch of the
    # continuum of states that residual slip leaves, and difference quotients are of one branch
    before = before_striker(whole, rig.v0, upstream_held=across.upstream_held)
    if across.shakers is None:
        moving = whole.at_rest()
    else:
        speed = float(np.abs(rig.v0).max())
        moving = neighbouring_state(
            whole, before, across.near, error=options.neighbour_error, speed=speed,
            compared=False, search=NEIGHBOURS,
        ).moving  # fmt: skip
    struck(moving, before, rig.v0)

    # each step of dt is divided into the substeps that the fastest contact asks for
    n, h = math.ceil(duration / dt), dt / across.substeps
    system = whole.stepped(h)
    whole.settle(moving, system, 0.0)
    sensed = across.wall.sense.shape[1] > 0
    saved = whole.march(moving, system, 0.0, Steps(h, n, across.substeps), modes=sensed)
    t = dt * np.arange(n + 1)

    # sensors on the structure read the modes under what moves them: contact forces beyond the
    # static ones, turned from n and the directions across to n, t1, t2, and the shakers' forces
    structure = None
    if sensed:
        Q = whole.to_frame
        static = np.append(whole.prepared.static.force[-1], np.zeros(len(Q) - 1))
        shaken = np.zeros((n + 1, across.wall.load.shape[1]))
        if across.shakers is not None:
            angle = 2 * np.pi * np.outer(t, across.shakers.frequency) + across.shakers.phase
            shaken = across.shakers.force * np.cos(angle)
        structure = sensed_in_march(
            across.wall, saved.q, saved.p, (saved.force - static) @ Q, shaken
        )
    return RubbingRun(t, saved.x, saved.v, saved.contact_force, structure)
