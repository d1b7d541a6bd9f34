"""The march of a group of cases on one wall: side by side in a batch, or one after another."""

from time import perf_counter

import numpy as np

from beadwave import coupling, dem
from beadwave.dem.space import row_runs
from beadwave.workflows.scene import RomWall, Scene
from beadwave.workflows.stages.chain import several
from beadwave.workflows.stages.chain.chain import on_surface, start, together
from beadwave.workflows.stages.chain.impact import impact, require_start
from beadwave.workflows.stages.chain.walls import simple_wall
from beadwave.workflows.sweep.cases import CheckedGroup, Group
from beadwave.workflows.sweep.core.case_row import (
    ACROSS,
    FAILED,
    REFUSED,
    Rows,
    measured,
    without_result,
)
from beadwave.workflows.sweep.models import FAILURES, SharedWall, sentence


def rows(checked: CheckedGroup, shared: SharedWall, signals: bool) -> list[Rows]:
    """Rows of all cases of a group, in any order; a case that fails is a row with its sentence."""
    scene, group = checked.scene, checked.sound
    watched, finished = checked.watched, []

    # cases whose scene was refused
    if checked.refused:
        places = sorted(checked.refused)
        cases = tuple(checked.group.cases[i] for i in places)
        sentences = [checked.refused[i] for i in places]
        finished.append(without_result(watched, cases, REFUSED, sentences, across=checked.across))
    if not group.cases:
        return finished

    # cases whose wall failed
    if shared.failure:
        sentences = [shared.failure] * len(group.cases)
        failed = without_result(watched, group.cases, FAILED, sentences, across=checked.across)
        return [*finished, failed]

    # cases without a chain have modes
    if shared.source is not None:
        from beadwave.workflows.sweep.modal_cases import rows_of_modes  # finite elements

        return finished + rows_of_modes(checked, group, shared.source)

    # cases that march; the batch takes walls of oscillators alone
    side_by_side = checked.side_by_side and not isinstance(shared.wall, coupling.CoupledWall)
    if scene.chains:
        return finished + _several(checked, group, shared)
    take = _side_by_side if side_by_side and len(group.cases) > 1 else _one_by_one
    return finished + take(checked, group, shared, signals)


def _side_by_side(
    checked: CheckedGroup, group: Group, shared: SharedWall, signals: bool
) -> list[Rows]:
    """Cases in one march; where it fails as a whole, its halves, down to the case that fails."""
    # an invalid case fails the whole batch: its halves are tried, so that only that case is lost
    scene, started = checked.scene, perf_counter()
    watched = checked.watched
    columns = {key: np.array(values, float) for key, values in group.columns.items()}
    try:
        chains = together(on_surface(scene, shared.surface), columns, shared.wall)
        batch = dem.march_batch(
            chains,
            duration=scene.time.duration,
            error=scene.time.error,
            observed=observed(scene),
            n_save=scene.output.samples - 1,
        )
    except FAILURES as reason:
        if len(group.cases) == 1:
            return [without_result(watched, group.cases, FAILED, [sentence(reason)])]
        middle = len(group.cases) // 2
        halves = range(middle), range(middle, len(group.cases))
        groups = (group.take(list(half)) for half in halves)
        return [row for half in groups for row in _side_by_side(checked, half, shared, signals)]
    seconds, finished = (perf_counter() - started) / len(group.cases), []

    # chains that the batch refuses: a run of such a case alone may be refused before its march
    # already (no equilibrium, a chaotic chain), and then says so in other words
    if batch.refused:
        places, sentences = sorted(batch.refused), []
        for i in places:
            try:
                case = checked.base.with_values(group.values(i))
                require_start(case)
                at_rest = start(case, shared.surface)
                wall = shared.wall if isinstance(case.wall, RomWall) else simple_wall(case)
                verdict = coupling.verdict(at_rest.chain, wall, at_rest.velocity)
            except FAILURES as reason:
                sentences.append(sentence(reason))
                continue
            sentences.append(batch.refused[i] if verdict.possible else verdict.findings[0])
        cases = tuple(group.cases[i] for i in places)
        finished.append(without_result(watched, cases, FAILED, sentences))
        marched = [i for i in range(len(group.cases)) if i not in batch.refused]
        if not marched:
            return finished
        group, batch = group.take(marched), taken(batch, marched)

    # waves, forces and errors of the cases that were marched
    table = measured(
        watched, batch.t, batch.v, batch.wall_force[:, :, None],
        energy_error=batch.energy_error, error_time=batch.error_estimate,
        error_reduction=shared.error_reduction, error_mesh=shared.error_mesh,
        message=shared.message,
        dt_s=batch.dt, steps=batch.n_steps, seconds=seconds,
    )  # fmt: skip
    return [*finished, Rows(group.cases, table, saved(scene, batch) if signals else None)]


def _one_by_one(
    checked: CheckedGroup, group: Group, shared: SharedWall, signals: bool
) -> list[Rows]:
    """Cases that no batch takes, each as a run of it alone."""
    finished = []
    for i, number in enumerate(group.cases):
        started = perf_counter()
        try:
            scene = checked.base.with_values(group.values(i))
            require_start(scene)
            wall = shared.wall if isinstance(scene.wall, RomWall) else simple_wall(scene)
            first = start(scene, shared.surface)
            result = impact(scene, first, wall)
            run, across = result.trajectory, {}
            error_time = np.nan if run.error_estimate is None else run.error_estimate
            if scene.friction:
                # the motion across is loaded by scenes that have one
                from beadwave.workflows.stages.chain.friction import friction, numbers_across

                lateral = friction(scene, first, wall, result)
                numbers = numbers_across(
                    scene, first, result.trajectory, lateral, lateral.dt, lateral.error_estimate
                )
                error_time += lateral.error_estimate
                values = (
                    numbers.peak_friction_N, numbers.surface_velocity_ratio, numbers.dissipated_J,
                    numbers.loop_energy_J, numbers.stick_share_at_impact,
                )  # fmt: skip
                across = {
                    n: np.nan if x is None else x for n, x in zip(ACROSS, values, strict=True)
                }
        except FAILURES as reason:
            # this case alone is lost: the others go on
            watched, failed = checked.watched, [sentence(reason)]
            finished.append(
                without_result(watched, (number,), FAILED, failed, across=checked.across)
            )
            continue

        # a batch of one: v (1, k, spheres), force (1, k), zeros of a chain without a wall
        v = run.v[None][:, :, [sphere - 1 for sphere in scene.output.spheres]]
        force = run.contact_force[None, :, -1] if scene.wall else np.zeros((1, len(run.t)))
        table = measured(
            checked.watched, run.t, v, force[:, :, None],
            energy_error=run.energy_error,
            error_time=error_time,
            error_reduction=shared.error_reduction, error_mesh=shared.error_mesh,
            message=shared.message,
            dt_s=run.dt, steps=run.n_steps, seconds=perf_counter() - started, **across,
        )  # fmt: skip
        series = {"t": run.t, "v": v, "wall_force": force} if signals else None
        finished.append(Rows((number,), table, series))
    return finished


def _several(checked: CheckedGroup, group: Group, shared: SharedWall) -> list[Rows]:
    """Cases of several chains, a march each on their structure."""
    finished, watched = [], checked.watched
    for i, number in enumerate(group.cases):
        started = perf_counter()
        try:
            scene = checked.base.with_values(group.values(i))
            at_rest = several.start(scene, shared.surface, shared.wall)
            before = several.state_before(scene, at_rest, shared.wall) if scene.shakers else None
            run = several.march(scene, at_rest, shared.wall, before)
        except FAILURES as reason:
            finished.append(without_result(watched, (number,), FAILED, [sentence(reason)]))
            continue
        rows_of_run = row_runs(at_rest.rows, shared.wall, run)
        pairs = list(zip(rows_of_run, watched.values(), strict=True))
        v = np.hstack([row.v[:, [s - 1 for s in spheres]] for row, spheres in pairs])[None]
        force = np.stack([row.contact_force[:, -1] for row in rows_of_run], axis=1)[None]
        table = measured(
            watched, run.t, v, force,
            energy_error=run.energy_error,
            error_time=np.nan if run.error_estimate is None else run.error_estimate,
            error_reduction=shared.error_reduction, error_mesh=shared.error_mesh,
            dt_s=run.dt, steps=run.n_steps, seconds=perf_counter() - started,
        )  # fmt: skip
        finished.append(Rows((number,), table))
    return finished


def taken(batch: dem.Batch, rows: list[int]) -> dem.Batch:
    """The batch of the chains at these rows alone."""
    names = ("v", "wall_force", "energy_error", "dt", "n_steps", "error_estimate")
    return batch._replace(refused={}, **{name: getattr(batch, name)[rows] for name in names})


def observed(scene: Scene) -> list[int]:
    """Indices of the spheres that errors are judged by: all where the scene names none."""
    return [sphere - 1 for sphere in scene.output.spheres] or list(range(scene.chain.count))


def saved(scene: Scene, batch: dem.Batch) -> dict[str, np.ndarray]:
    """Signals of a batch of m chains: velocities v (m, k, spheres) [m/s] of the spheres that the
    scene names, and the wall's force (m, k) [N], at t (k,) [s]."""
    v = batch.v[:, :, : len(scene.output.spheres)]
    return {"t": batch.t, "v": v, "wall_force": batch.wall_force}
