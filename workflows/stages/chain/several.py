"""Several chains on one structure, as stages: the rows, their march, waves and errors."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from beadwave import coupling, dem
from beadwave.coupling.reduced_spatial_wall import with_stingers
from beadwave.coupling.reduced_structure import require_answer, structure_of
from beadwave.coupling.shaken_packing import (
    ShakenState,
    march_shaken_rows,
    shaken_state,
    with_cycles,
)
from beadwave.dem import space
from beadwave.dem.space.march import MOST_WORK, first_step, work
from beadwave.dem.waves.chain_waves import ChainWaves, chain_waves
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.stages.chain import chain as one_chain
from beadwave.workflows.stages.chain.damping import damping
from beadwave.workflows.stages.chain.friction import last_sphere, shaker_forces
from beadwave.workflows.stages.chain.walls import require_support

if TYPE_CHECKING:
    from beadwave.rom import ReducedModel
    from beadwave.workflows.stages.structure.several import ChainContacts

# as of one chain (`errors.better_walls`): of a difference, for what the finer model itself misses;
# times the step for the finer model, whose highest modes move faster than any kept
MARGIN = 1.25
SHORTER = 8


class ChainsStart(NamedTuple):
    """Several chains before the impact."""

    starts: tuple[one_chain.Start, ...]  # each alone
    rows: space.Rows


class ChainsErrors(NamedTuple):
    """Errors by the reduction or the mesh, relative to the largest speed at the start."""

    of_chains: tuple[float, ...]  # of the spheres of each chain
    largest: float


def structure(scene: Scene, reduction: ReducedModel, contacts: ChainContacts) -> space.Structure:
    """The structure as the chains push it."""
    shakers, load = scene.shakers or (), reduction.columns.load
    columns = np.column_stack([reduction.w, load])
    if any(shaker.stinger for shaker in shakers):
        stiffness = np.zeros(load.shape[1])
        stiffness[load.shape[1] - len(shakers) :] = [s.stinger or 0.0 for s in shakers]
        reduction = with_stingers(reduction, stiffness)
    # along each chain first, then across it
    point = np.append(np.arange(len(contacts.point)), np.repeat(contacts.rubbing, 2))
    direction = np.vstack([contacts.direction, contacts.frame.reshape(-1, 3)])
    order = np.argsort(point, kind="stable")
    columns[:, : point.size] = columns[:, order]
    law = damping(scene.damping, reduction)
    behind = structure_of(
        reduction, columns, point[order], direction[order], contacts.half_space, damping=law,
        shakers=shaker_forces(scene) if shakers else None,
    )  # fmt: skip
    if not contacts.rubbing.size:
        return behind
    return behind._replace(residual_besides=-contacts.half_space_besides)


def start(scene: Scene, contacts: ChainContacts, structure: space.Structure) -> ChainsStart:
    """All chains at rest on the structure. Raises InvalidScene for chains that cannot be marched,
    and for spheres of two chains that overlap."""
    starts, rows = [], []
    each = zip(scene.chains, scene.of_each_chain.values(), strict=True)
    for i, (row, one) in enumerate(each):
        if scene.gravity:
            one = one.but(gravity=scene.gravity.on(contacts.direction[i]))
            across = one.gravity.across
            if one.friction and one.arm is None and across > 1e-9 * one.gravity.acceleration:
                raise InvalidScene(
                    f"{scene.name}: gravity weighs {across:.3g} m/s^2 across chains.{row.name}, "
                    f"which nothing carries at its last sphere; add chains.{row.name}.arm, or "
                    "turn gravity.direction along the chain."
                )
        first = one_chain.start(one, contacts.surface[i])
        starts.append(first)
        delay = row.striker.time if row.striker else 0.0
        place = contacts.point[i], contacts.direction[i]
        last = last_sphere(one, first) if one.friction else None
        rows.append(space.Row(first.chain, first.velocity, *place, delay, row.name, last))
        along = np.flatnonzero(structure.point == i)[0]
        wall = dem.Wall(structure.omega, structure.zeta, structure.phi[along])
        require_support(one, wall)
    try:
        together = space.rows_of(rows, structure)
        require_answer(together.packing, structure, together.velocity)
    except (dem.InvalidChain, dem.NoEquilibrium, coupling.CouplingError) as error:
        raise InvalidScene(f"{scene.name}: [[chains]]: {str(error).rstrip('.')}.") from None
    _require_apart(scene, together)
    return ChainsStart(tuple(starts), together)


def _require_apart(scene: Scene, rows: space.Rows) -> None:
    """Raise InvalidScene where spheres of two chains overlap at the start."""
    packing, names = rows.packing, [row.name for row in scene.chains]
    for i in range(len(names)):
        of_row, others = rows.row == i, rows.row > i
        if not others.any():
            return
        between = packing.rest[of_row][:, None] - packing.rest[others][None]
        apart = np.linalg.norm(between, axis=2)
        apart -= packing.radius[of_row][:, None] + packing.radius[others][None]
        if apart.min() < 0.0:
            other = names[rows.row[others][apart.min(axis=0).argmin()]]
            raise InvalidScene(
                f"{scene.name}: spheres of chains.{names[i]} and chains.{other} overlap by "
                f"{-apart.min():.3g} m; move one of them by its `at`."
            )


def state_before(
    scene: Scene, start: ChainsStart, structure: space.Structure, **steps: float
) -> ShakenState:
    """The state that shakers keep up before the strikers come, to the scene's error or by `steps`,
    dt [s] and n_cells. Raises InvalidScene for a chain that nothing presses on the structure and a
    sphere that nothing holds, UnstableStep where there is none."""
    held = [bool(one.friction and one.friction.upstream == "held")
            for one in scene.of_each_chain.values()]  # fmt: skip
    try:
        packing = space.before_striker(start.rows, held)
    except dem.InvalidChain as error:
        raise InvalidScene(f"{scene.name}: [[shakers]]: {str(error).rstrip('.')}.") from None
    wanted = 1e-4 if scene.time.error is None else scene.time.error
    speed = float(np.linalg.norm(start.rows.velocity, axis=1).max())
    try:
        return shaken_state(packing, structure, error=wanted, speed=speed, **steps)
    except dem.UnstableStep as error:
        raise dem.UnstableStep(f"{scene.name}: [[shakers]]: {str(error).rstrip('.')}.") from None


def march(
    scene: Scene,
    start: ChainsStart,
    structure: space.Structure,
    before: ShakenState | None = None,
) -> space.SpaceTrajectory:
    """The march of all chains and the structure, to the scene's error or at its step; from the
    state `before` the strikers where there are shakers."""
    packing, time = start.rows.packing, scene.time
    step = time.dt or first_step(packing, start.rows.velocity, time.duration)
    if (least := work(packing, time.duration, step)) > MOST_WORK:
        raise InvalidScene(
            f"{scene.name}: time.duration = {time.duration:g} s takes {least:.1e} contacts "
            f"computed at least, allowed are {MOST_WORK:.0e}; take less, or fewer spheres."
        )
    run = {"duration": time.duration, "n_save": scene.output.samples - 1}
    if before is not None:
        error = time.error if time.dt is None else None
        return march_shaken_rows(start.rows, structure, before, error=error, dt=time.dt, **run)
    arguments = packing, structure, start.rows.velocity
    if time.dt is not None:
        return space.march(*arguments, dt=time.dt, **run)
    return space.march_to_error(*arguments, error=time.error, **run)


def march_at_step(
    scene: Scene,
    first: ChainsStart,
    structure: space.Structure,
    dt: float,
    other: ShakenState | None = None,
) -> space.SpaceTrajectory:
    """The march by steps of dt [s] on another structure; with shakers from its own state before the
    strikers on, by the steps of the `other` structure's or shorter ones for faster modes."""
    time = {"duration": scene.time.duration, "dt": dt, "n_save": scene.output.samples - 1}
    if other is not None:
        of_cycle = min(other.duration / other.n_steps, 1.0 / float(structure.omega.max()))
        state = state_before(scene, first, structure, dt=of_cycle, n_cells=other.n_cells)
        return march_shaken_rows(first.rows, structure, state, **time)
    return space.march(first.rows.packing, structure, first.rows.velocity, **time)


def runs_of(
    start: ChainsStart,
    structure: space.Structure,
    march: space.SpaceTrajectory,
    before: ShakenState | None,
) -> tuple[space.RowRun, ...]:
    """Each chain's part of the march, with the cycle of its last sphere before the striker."""
    runs = space.row_runs(start.rows, structure, march)
    return runs if before is None else with_cycles(runs, start.rows, before)


def waves(
    scene: Scene,
    start: ChainsStart,
    structure: space.Structure,
    march: space.SpaceTrajectory,
    before: ShakenState | None = None,
) -> tuple[tuple[space.RowRun, ChainWaves], ...]:
    """Each chain's part of the march, and its waves."""
    found = []
    runs = runs_of(start, structure, march, before)
    each = scene.of_each_chain.values()
    for one, first, run in zip(each, start.starts, runs, strict=True):
        observed = [n for n in one.output.spheres if n <= len(first.velocity)]
        at_wall = bool(first.velocity.any())
        found.append((run, chain_waves(run, first.chain, observed, at_wall=at_wall)))
    return tuple(found)


def reduction_errors(
    scene: Scene,
    start: ChainsStart,
    coarse: space.Structure,
    march: space.SpaceTrajectory,
    reduction: ReducedModel,
    contacts: ChainContacts,
    before: ShakenState | None = None,
) -> ChainsErrors:
    """Errors of the velocities by the reduction: the march again on the model that stands for the
    full structure at all contacts together, up to any frequency."""
    finer = structure(scene, reduction.finer, contacts)
    again = march_at_step(scene, start, finer, march.dt / SHORTER, before)
    return errors_of_difference(start, march, again, MARGIN, before)


def errors_of_difference(
    start: ChainsStart,
    march: space.SpaceTrajectory,
    again: space.SpaceTrajectory,
    share: float,
    before: ShakenState | None,
) -> ChainsErrors:
    """Errors of a march, as a share of its largest difference to another one of the same chains,
    over the largest speed of strikers and of the state `before` them."""
    change = np.linalg.norm(again.velocity - march.velocity, axis=2).max(axis=0)
    speed = float(np.linalg.norm(start.rows.velocity, axis=1).max())
    speed = max(speed, before.fastest if before else 0.0) or 1.0
    relative, row = share * change / speed, start.rows.row
    of_chains = tuple(float(relative[row == i].max()) for i in range(row[-1] + 1))
    return ChainsErrors(of_chains, max(of_chains))
