"""The last sphere across the chain before a wall that stays in its plane, or is moved along itself.

A case of the march in three directions: the wall has no mode across the chain, and what moves it
is its motion L f at the contact. Friction leaves the motion along the chain alone (Cattaneo and
Mindlin take both problems as uncoupled), so that the march along the chain may be one of its own;
of this one the motion across is kept. Errors are those of the velocities of the centre and of the
surface by its turn.
"""

import math
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
    USUAL_SPATIAL_SEARCH,
    Before,
    MarchState,
    PreparedImpact,
    SpatialRun,
    SpatialSearch,
    across_alone,
    body_of,
    march_to_error,
)
from beadwave.coupling.spatial_wall import SpatialWall
from beadwave.dem import Chain, Trajectory, Wall
from beadwave.dem.checks import require
from beadwave.dem.kernels.arguments import Array
from beadwave.dem.lateral import LastSphere, LateralTrajectory, at_rest_across
from beadwave.dem.shakers import ShakerForces, common_period

CAPACITY = 1024  # nodes of the contact at an error of 1e-5, as its inverse root from a quarter on
# of the leaf spring that presses a sphere as the chain before it does, not varied
BENT = 1e-3  # [m]


class WallMotion(NamedTuple):
    """The wall moves along itself by the sum of amplitude cos(2 pi frequency t + phase)."""

    amplitude: Array  # (n, 2) [m] along t1, t2
    frequency: Array  # (n,) [Hz]
    phase: Array  # (n,) [rad]

    @property
    def speed(self) -> float:
        """[m/s] Largest amplitude of the velocity along t1 or t2."""
        return float(np.abs(self.amplitude * np.reshape(self.frequency, (-1, 1))).max()) * math.tau

    @property
    def period(self) -> float:
        """[s] Shortest common period; raises InvalidChain without one, see `common_period`."""
        return common_period(self.frequency)


class LateralSearch(NamedTuple):
    """Searches for the step of the march, and for the periodic state before it."""

    march: SpatialSearch = USUAL_SPATIAL_SEARCH
    periodic: PeriodicSearch = USUAL_PERIODIC_SEARCH


USUAL_LATERAL_SEARCH = LateralSearch()


def march_lateral(
    chain: Chain,
    wall: Wall,
    v0: ArrayLike,
    trajectory: Trajectory,
    last: LastSphere,
    *,
    motion: WallMotion | None = None,
    error: float | None = None,
    search: LateralSearch = USUAL_LATERAL_SEARCH,
) -> LateralTrajectory:
    """The last sphere across the chain, at the instants of the trajectory along it from velocities
    v0 (n,) [m/s].

    `error` is relative to the largest speed at the start, across or along, and the ledger of the
    motion across closes to it; without it `search.march.dt` is the step [s] of the coarser of two
    marches, which state the error of the finer. Where the wall has a `motion`, all is periodic
    before the striker. Raises InvalidChain for a chain whose contact has no tangential law,
    UnstableStep where the error takes too many steps, or no state is periodic.
    """
    v0, velocity = np.asarray(v0, float), np.asarray(last.velocity, float)
    simple = wall is not None and wall.omega.size < 2 and wall.mobility == 0.0
    require(
        simple and wall.residual_compliance == 0.0,
        "friction at the wall takes a rigid wall or one of one mode; change it",
    )
    moved, shakers = moved_wall(wall, motion)
    fine = 1.0 if error is None else math.sqrt(1e-5 / error)
    nodes = int(CAPACITY * min(max(fine, 0.25), 16.0))
    body = body_of(chain, moved, v0, last, shakers, search.march._replace(capacity=nodes))
    if motion is None and not velocity.any():
        return at_rest_across(trajectory)

    # before the striker: at rest, or the wall's motion has become periodic
    speed = max(float(np.abs(v0).max()), float(np.hypot(*velocity)))
    start, before, share = body.at_rest(), None, error
    if motion is not None:
        speed = max(speed, motion.speed)
        tail = tail_of(body)
        held = np.arange(tail.prepared.chain.mass.size) < tail.prepared.chain.mass.size - 1
        wanted = 1e-4 if error is None else error
        before = periodic_state(
            tail, Before(held, 0), error=wanted, speed=speed, search=search.periodic
        )
        start = grafted(before.moving, start)
        share = None if error is None else max(error - before.error_estimate, 0.5 * error)
    start.motion.v[:] += v0
    start.motion.u_v[:] += body.frame @ velocity
    while True:
        run = march_to_error(
            body, start, duration=float(trajectory.t[-1]), error=share,
            n_save=trajectory.t.size - 1, speed=speed or None, measure=across_alone,
        )  # fmt: skip
        across = across_of(run, before, 0.5 * float(np.sum(chain.mass * np.square(v0))))
        if error is None or across.energy_error <= error:
            return across
        # the ledger is of order 2 as well; of a sphere that is clamped it alone has an error, so
        # that a smaller one of the velocities shortens no step
        lower = 0.8 * error / across.energy_error
        share *= lower
        finer = body.search._replace(phase=math.sqrt(lower) * body.search.phase)
        body = body._replace(search=finer)


def moved_wall(wall: Wall, motion: WallMotion | None) -> tuple[SpatialWall, ShakerForces | None]:
    """The wall in three directions and forces of 1 that move it."""
    k, s = wall.omega.size, 0 if motion is None else len(motion.frequency)
    phi, L = np.zeros((k, 3)), np.zeros((3, s))
    phi[:, 0] = wall.phi
    shakers = None
    if motion is not None:
        L[1:] = np.asarray(motion.amplitude, float).T
        shakers = ShakerForces(np.ones(s), np.asarray(motion.frequency), np.asarray(motion.phase))
    none = np.zeros((k, s)), L, np.zeros((k, 0)), np.zeros((0, 3)), np.zeros((0, s))
    return SpatialWall(wall.omega, wall.zeta, phi, np.zeros((3, 3)), *none), shakers


def tail_of(body: PreparedImpact) -> PreparedImpact:
    """The last sphere alone, or with the one before if friction acts between them, pressed as the
    chain before presses: nothing comes down the chain while it is at rest."""
    chain, static = body.prepared.chain, body.prepared.static
    k = 1 if body.last.before is None else 2
    names = ("mass", "radius", "A", "gamma", "leaf_stiffness", "leaf_anchor")
    fields = {name: getattr(chain, name) for name in names}
    fields = {name: a if a is None else np.array(a, float)[-k:] for name, a in fields.items()}
    fields |= {"n_falling": 0}
    if k == 2:  # the sphere before is held: a leaf spring gives the force that it passes on
        leaf, anchor = (values[-2:].copy() for values in chain.springs)
        pressed = float(static.force[-2]) - chain.gravity * float(chain.mass[-2])
        leaf[0], anchor[0] = pressed / BENT, float(static.x[-2]) + BENT
        fields |= {"leaf_stiffness": leaf, "leaf_anchor": anchor}
    elif chain.mass.size > 1:
        fields |= {"preload": chain.preload + float(static.force[-2])}
    still = np.zeros(k)
    last = body.last._replace(velocity=np.zeros(2))
    tail = body_of(chain._replace(**fields), body.wall, still, last, body.shakers, body.search)
    return tail._replace(frame=body.frame)


def grafted(tail: MarchState, start: MarchState) -> MarchState:
    """The state of the last sphere, its contacts and the wall, with other spheres as in `start`."""
    motion, k = tail.copied().motion, tail.motion.x.size
    along = {name: getattr(start.motion, name) for name in ("x", "v", "f")}
    for name, values in along.items():
        values[-k:] = getattr(motion, name)[-k:]
    return MarchState(motion._replace(**along), tail.contacts.copied())


def across_of(run: SpatialRun, before: PeriodicState | None, kinetic: float) -> LateralTrajectory:
    """The motion across of a run, with a ledger of its own over the kinetic energy of the chain at
    the start [J], or over the largest that any part of it reaches, if that is more."""
    lateral, shift = run.lateral, 0.0 if before is None else before.slip_mean
    # the shakers' work is that of the wall on the contact, of the integral of F dw
    at_wall = np.sum(lateral.friction_force * lateral.wall_t, axis=1)
    work = lateral.work_shaker - (at_wall - at_wall[0])
    across = lateral._replace(slip=lateral.slip - shift, work_shaker=work)
    parts = (
        across.energy_lateral, across.energy_rotation, across.energy_arm, across.energy_tangential,
        across.dissipated_friction, work,
    )  # fmt: skip
    scale = max(kinetic, *(float(np.abs(part).max()) for part in parts)) or 1.0
    off = float(np.abs(across.energy - across.energy[0]).max()) / scale
    across = across._replace(energy_error=off)
    if before is None:
        return across
    stated = across.error_estimate + before.error_estimate
    return across._replace(cycle=before.cycle, error_estimate=stated)
