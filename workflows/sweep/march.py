"""Cases of a group on one wall: side by side where the batch takes them, else one after another."""

from time import perf_counter

import numpy as np

import coupling
import dem
from workflows.scene import RomWall, Scene
from workflows.stages.chain import on_surface, simple_wall, start, together
from workflows.stages.impact import impact, require_start
from workflows.sweep.cases import Checked, Group
from workflows.sweep.core.rows import FAILED, REFUSED, Rows, measured, without_result
from workflows.sweep.models import FAILURES, Prepared, sentence


def rows(checked: Checked, shared: Prepared, signals: bool) -> list[Rows]:
    """Rows of all cases of a group, in any order; a case that fails is a row with its sentence."""
    found, group = [], checked.sound
    if checked.refused:
        places = sorted(checked.refused)
        cases = tuple(checked.group.cases[i] for i in places)
        sentences = [checked.refused[i] for i in places]
        found.append(without_result(_spheres(checked), cases, REFUSED, sentences))
    if not group.cases:
        return found
    if shared.failure:
        sentences = [shared.failure] * len(group.cases)
        return [*found, without_result(_spheres(checked), group.cases, FAILED, sentences)]
    joins = checked.joins and not isinstance(shared.wall, coupling.CoupledWall)
    take = _side_by_side if joins and len(group.cases) > 1 else _one_by_one
    return found + take(checked, group, shared, signals)


def _spheres(checked: Checked) -> tuple[int, ...]:
    scene = checked.scene
    return scene.output.spheres if scene else checked.base.with_values({}).output.spheres


def _side_by_side(checked: Checked, group: Group, shared: Prepared, signals: bool) -> list[Rows]:
    """Cases in one march; where it fails, its halves."""
    scene, started = checked.scene, perf_counter()
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
            return [without_result(_spheres(checked), group.cases, FAILED, [sentence(reason)])]
        middle = len(group.cases) // 2
        halves = range(middle), range(middle, len(group.cases))
        parts = (group.take(list(half)) for half in halves)
        return [row for part in parts for row in _side_by_side(checked, part, shared, signals)]
    seconds, done = (perf_counter() - started) / len(group.cases), []
    if batch.refused:
        places = sorted(batch.refused)
        sentences = [_refusal(checked, group, i, shared, batch.refused[i]) for i in places]
        cases = tuple(group.cases[i] for i in places)
        done.append(without_result(_spheres(checked), cases, FAILED, sentences))
        rest = [i for i in range(len(group.cases)) if i not in batch.refused]
        if not rest:
            return done
        group, batch = group.take(rest), taken(batch, rest)
    run = {
        "energy_error": batch.energy_error, "error_time": batch.error_estimate,
        "error_reduction": shared.error_reduction, "error_mesh": shared.error_mesh,
        "dt_s": batch.dt, "steps": batch.n_steps, "seconds": seconds,
    }  # fmt: skip
    table = measured(scene.output.spheres, batch.t, batch.v, batch.wall_force, **run)
    return [*done, Rows(group.cases, table, saved(scene, batch) if signals else None)]


def taken(batch: dem.Batch, rows: list[int]) -> dem.Batch:
    """Some chains of a batch."""
    names = ("v", "wall_force", "energy_error", "dt", "n_steps", "error_estimate")
    return batch._replace(refused={}, **{name: getattr(batch, name)[rows] for name in names})


def _refusal(checked: Checked, group: Group, i: int, shared: Prepared, reason: str) -> str:
    """Why a run of the i-th case is refused: before its march, if it is then already."""
    try:
        scene = checked.base.with_values(group.values(i))
        require_start(scene)
        begun = start(scene, shared.surface)
        leant_on = shared.wall if isinstance(scene.wall, RomWall) else simple_wall(scene)
        judged = coupling.verdict(begun.chain, leant_on, begun.velocity)
    except FAILURES as earlier:
        return sentence(earlier)
    return reason if judged.possible else judged.findings[0]


def observed(scene: Scene) -> list[int]:
    """Indices of the spheres that errors are judged by: all where the scene names none."""
    return [sphere - 1 for sphere in scene.output.spheres] or list(range(scene.chain.count))


def saved(scene: Scene, batch: dem.Batch) -> dict[str, np.ndarray]:
    """Signals of a batch: velocities of the spheres that the scene names, and the wall's force."""
    v = batch.v[:, :, : len(scene.output.spheres)]
    return {"t": batch.t, "v": v, "wall_force": batch.wall_force}


def _one_by_one(checked: Checked, group: Group, shared: Prepared, signals: bool) -> list[Rows]:
    return [_alone(checked, group, i, shared, signals) for i in range(len(group.cases))]


def _alone(checked: Checked, group: Group, i: int, shared: Prepared, signals: bool) -> Rows:
    started, cases = perf_counter(), (group.cases[i],)
    try:
        scene = checked.base.with_values(group.values(i))
        require_start(scene)
        leant_on = shared.wall if isinstance(scene.wall, RomWall) else simple_wall(scene)
        run = impact(scene, start(scene, shared.surface), leant_on).trajectory
    except FAILURES as reason:
        return without_result(_spheres(checked), cases, FAILED, [sentence(reason)])
    v = run.v[None][:, :, [sphere - 1 for sphere in scene.output.spheres]]
    force = run.contact_force[None, :, -1] if scene.wall else np.zeros((1, len(run.t)))
    table = measured(
        scene.output.spheres, run.t, v, force,
        energy_error=run.energy_error, error_time=_number(run.error_estimate),
        error_reduction=shared.error_reduction, error_mesh=shared.error_mesh,
        dt_s=run.dt, steps=run.n_steps, seconds=perf_counter() - started,
    )  # fmt: skip
    return Rows(cases, table, {"t": run.t, "v": v, "wall_force": force} if signals else None)


def _number(value: float | None) -> float:
    return float("nan") if value is None else value
