"""Estimate of the seconds and the memory that a sweep takes, by timing its first cases."""

from collections.abc import Sequence
from time import perf_counter
from typing import NamedTuple, TypeVar

from beadwave.workflows.report.tables import Table
from beadwave.workflows.scene.tables.walls import gives_way
from beadwave.workflows.sweep.cases import Base, groups
from beadwave.workflows.sweep.core.design import Design
from beadwave.workflows.sweep.marched_group import rows
from beadwave.workflows.sweep.models import has_spheres, is_kept, models, shared_wall
from beadwave.workflows.sweep.sweep import AT_ONCE
from beadwave.workflows.sweep.tasks import CHUNK, pressed_keys, sharing, sharings

Item = TypeVar("Item")


class Price(NamedTuple):
    """Cases and what they share, seconds and memory to expect."""

    cases: int
    refused: int
    walls: int
    models: int  # reduced models of assemblies
    models_missing: int  # of these, those that are not in the cache
    side_by_side: int  # cases that the batch takes
    seconds_case: float
    seconds_model: float
    workers: int
    seconds: float
    memory_GB: float  # of each process, beyond what the program takes
    notes: tuple[str, ...] = ()  # why cases are refused, or the first one fails

    def table(self) -> Table:
        """The price as a table of one row."""
        labels = (
            "cases", "refused", "walls", "reduced models", "reduced models to compute",
            "cases side by side", "seconds a case", "seconds a reduced model", "processes",
            "seconds", "GB of a process for its cases",
        )  # fmt: skip
        # the program itself, and models that it reduces, take 0.5 to 0.8 GB (docs/sweeps.md)
        return Table("price", ("", "to expect"), tuple(zip(labels, self[:-1], strict=True)))


def price(base: Base, design: Design, workers: int) -> Price:
    """Timed on the first cases and on the first reduced model that is missing, which are kept.

    Of many walls, and of many cases on a wall, a sample stands for the rest.
    """
    # walls of the sample, and shares of its cases that are refused and that march side by side
    all_groups = list(groups(base, design, range(design.n_cases)))
    sample = []
    for group in spread(all_groups):
        sample.append(sharing(base, design, group.take(spread(range(len(group.cases)))), False))
    walls = [group for group in sample if group.scene is not None]
    joining = [group for group in walls if group.tasks[-1].checked.side_by_side]
    n_sampled = sum(len(task.checked.group.cases) for group in sample for task in group.tasks)
    refusals = [
        message for group in sample for task in group.tasks
        for message in task.checked.refused.values()
    ]  # fmt: skip
    n_refused = round(design.n_cases * len(refusals) / n_sampled)
    n_joining = sum(len(task.checked.sound.cases) for group in joining for task in group.tasks)
    n_side_by_side = round(design.n_cases * n_joining / n_sampled)

    # reduced models: where most walls of the sample have their own, so do those beyond it
    sources = {group.key: group.source for group in walls if group.key is not None}
    missing = [source for source in sources.values() if not is_kept(source)]
    scale = len(all_groups) / len(sample) if len(sources) > len(sample) / 2 else 1.0
    n_models, n_missing = round(scale * len(sources)), round(scale * len(missing))
    model, seconds_model = None, 0.0
    if missing:
        started = perf_counter()
        model = models(missing[0])
        seconds_model = perf_counter() - started
    notes = [*refusals[:1], *([model] if isinstance(model, str) else [])]

    # seconds a case: without spheres of its modes, else on the first wall
    seconds_case, memory_GB, of_modes = 0.0, 0.0, None
    if walls and not has_spheres(walls[0].scene):
        of_modes = price_of_modes(base, design, n_refused, here=workers == 1)
        seconds_case, notes = of_modes.seconds_case, notes + of_modes.notes
    elif walls:
        first = walls[0]
        reduced = models(first.source) if first.key is not None else None
        shared, checked = shared_wall(first.scene, first.source, reduced), first.tasks[-1].checked
        # 64 cases side by side are timed, or one alone
        cases = next(checked.pieces(64 if checked.side_by_side else 1))
        rows(cases, shared, False)  # compiles
        started = perf_counter()
        timed_rows = rows(cases, shared, False)
        seconds_case = (perf_counter() - started) / len(cases.group.cases)
        failures = [said for piece in timed_rows for said in piece.columns["message"] if said]
        notes += failures[:1] if not isinstance(model, str) else []

        # three times the signals of all cases that march or wait to be stored at once
        output, n_together = first.scene.output, 1
        if checked.side_by_side:
            n_together = min(design.n_cases, (AT_ONCE + 1) * CHUNK)
        per_case = output.samples * (len(output.spheres) + 1) if output else 0
        memory_GB = 8e-9 * 3 * per_case * n_together

    # parts of a scene that the lanes of `dem.batch` do not take
    if n_side_by_side:
        law, slow = walls[0].scene.contact.dissipation, []
        if law.startswith("linear"):
            slow.append(f'contact.dissipation = "{law}"')
        if gives_way(wall := walls[0].scene.wall):
            slow.append(f'wall.kind = "{wall.kind}"')
        notes += [
            f"{key} is marched chain by chain, dealt to the threads: seconds a case are those of "
            "such a march."
            for key in slow
        ]
    seconds = seconds_case * (design.n_cases - n_refused) + seconds_model * max(0, n_missing - 1)
    if of_modes:
        seconds = of_modes.seconds
    return Price(
        design.n_cases, n_refused, round(len(all_groups) * len(walls) / len(sample)), n_models,
        n_missing, n_side_by_side, seconds_case, seconds_model, workers, seconds / workers,
        memory_GB, tuple(notes),
    )  # fmt: skip


class PriceOfModes(NamedTuple):
    """Seconds to expect of cases without spheres."""

    seconds_case: float  # of a further case
    seconds: float  # of all that are not kept
    notes: list[str]  # why the first one fails, and what cases share


def price_of_modes(base: Base, design: Design, n_refused: int, *, here: bool) -> PriceOfModes:
    """Timed on two cases that are not kept, of which the first has besides what all share: the mesh
    and, in this process, faces in contact whose preload, friction or roughness varies."""
    times, notes, key, n_kept, n_seen = [], [], None, 0, 0
    cases = spread(range(design.n_cases))
    for group in sharings(base, design, cases, False, here=here):
        if group.scene is None:
            continue
        # cases of a family are computed each time, others may be kept
        family, n_seen = group.source.family, n_seen + 1
        if family is None and group.source.pipeline.kept("modes"):
            n_kept += 1
            continue
        if len(times) == 2 or (times and family is not key):
            continue
        key, started = family, perf_counter()
        shared = shared_wall(group.scene, group.source, None)
        found = rows(group.tasks[-1].checked, shared, False)
        times.append(perf_counter() - started)
        notes += [note for piece in found for note in piece.columns["message"] if note]

    n = round((design.n_cases - n_refused) * (1 - n_kept / max(n_seen, 1)))
    if not times:
        return PriceOfModes(0.0, 0.0, notes)
    once, case = max(times[0] - times[-1], 0.0), times[-1]
    if key is None:
        # the cases timed are kept, and so is what they share
        return PriceOfModes(case, case * max(n - len(times), 0), notes[:1])
    varied = pressed_keys(base, design)
    others = zip(*(design.columns[k] for k in design.keys if k not in varied), strict=True)
    n_families = max(len(set(map(repr, others))), 1)
    shared = max(n_families * once - key.seconds_kept, 0.0)
    note = f"{shared:.2g} s of these are for meshes and faces that cases share."
    return PriceOfModes(case, shared + n * case, [*notes[:1], note])


def spread(items: Sequence[Item], n: int = 100) -> list[Item]:
    """All of them, or `n` in equal distances, the first and the last among them."""
    if len(items) <= n:
        return list(items)
    return [items[i * (len(items) - 1) // (n - 1)] for i in range(n)]
