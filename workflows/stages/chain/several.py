"""Several chains on one structure, as stages: the rows, their march, waves and errors."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from beadwave import coupling, dem
from beadwave.coupling.reduced_structure import require_answer, structure_of
from beadwave.dem import space
from beadwave.dem.space.march import MOST_WORK, first_step, work
from beadwave.dem.waves.chain_waves import ChainWaves, chain_waves
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.stages.chain import chain as one_chain
from beadwave.workflows.stages.chain.damping import damping
from beadwave.workflows.stages.chain.friction import last_sphere
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
    columns = np.column_stack([reduction.w, reduction.columns.load])
    # along each chain first, then across it
    point = np.append(np.arange(len(contacts.point)), np.repeat(contacts.rubbing, 2))
    direction = np.vstack([contacts.direction, contacts.frame.reshape(-1, 3)])
    order = np.argsort(point, kind="stable")
    law = damping(scene.damping, reduction)
    return structure_of(
        reduction, columns[:, order], point[order], direction[order], contacts.half_space,
        half_space_besides=contacts.half_space_besides if contacts.rubbing.size else None,
        damping=law,
    )  # fmt: skip


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


def march(scene: Scene, start: ChainsStart, structure: space.Structure) -> space.SpaceTrajectory:
    """The march of all chains and the structure, to the scene's error or at its step."""
    packing, time = start.rows.packing, scene.time
    step = time.dt or first_step(packing, start.rows.velocity, time.duration)
    if (least := work(packing, time.duration, step)) > MOST_WORK:
        raise InvalidScene(
            f"{scene.name}: time.duration = {time.duration:g} s takes {least:.1e} contacts "
            f"computed at least, allowed are {MOST_WORK:.0e}; take less, or fewer spheres."
        )
    run = {"duration": time.duration, "n_save": scene.output.samples - 1}
    arguments = packing, structure, start.rows.velocity
    if time.dt is not None:
        return space.march(*arguments, dt=time.dt, **run)
    return space.march_to_error(*arguments, error=time.error, **run)


def waves(
    scene: Scene,
    start: ChainsStart,
    structure: space.Structure,
    march: space.SpaceTrajectory,
) -> tuple[tuple[space.RowRun, ChainWaves], ...]:
    """Each chain's part of the march, and its waves."""
    found = []
    runs = space.row_runs(start.rows, structure, march)
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
) -> ChainsErrors:
    """Errors of the velocities by the reduction: the march again on the model that stands for the
    full structure at all contacts together, up to any frequency."""
    finer = structure(scene, reduction.finer, contacts)
    again = space.march(
        start.rows.packing, finer, start.rows.velocity, duration=scene.time.duration,
        dt=march.dt / SHORTER, n_save=scene.output.samples - 1,
    )  # fmt: skip
    return errors_of_difference(start, march, again, MARGIN)


def errors_of_difference(
    start: ChainsStart, march: space.SpaceTrajectory, again: space.SpaceTrajectory, share: float
) -> ChainsErrors:
    """Errors of a march, as a share of its largest difference to another one of the same chains."""
    change = np.linalg.norm(again.velocity - march.velocity, axis=2).max(axis=0)
    speed = float(np.linalg.norm(start.rows.velocity, axis=1).max()) or 1.0
    relative, row = share * change / speed, start.rows.row
    of_chains = tuple(float(relative[row == i].max()) for i in range(row[-1] + 1))
    return ChainsErrors(of_chains, max(of_chains))
