"""What a sweep will take, from its first cases."""

from time import perf_counter
from typing import NamedTuple

from workflows.results.tables import Table
from workflows.sweep.cases import Base
from workflows.sweep.design import Design
from workflows.sweep.march import rows
from workflows.sweep.models import is_kept, models, prepared
from workflows.sweep.tasks import CHUNK, Sharing, sharings

TRIED = 64  # cases side by side that are timed, or one alone
SIZE = 8e-9  # GB of a number


class Price(NamedTuple):
    """Cases and what they share, seconds and memory to expect."""

    cases: int
    refused: int
    walls: int
    models: int  # reduced models of assemblies
    models_missing: int  # of these, not kept from earlier
    side_by_side: int  # cases that the batch takes
    seconds_case: float
    seconds_model: float
    workers: int
    seconds: float
    memory_GB: float  # of each process, beyond what the program takes

    def table(self) -> Table:
        """For a person and for machines."""
        labels = (
            "cases", "refused", "walls", "reduced models", "reduced models to compute",
            "cases side by side", "seconds a case", "seconds a reduced model", "processes",
            "seconds", "memory of a process [GB]",
        )  # fmt: skip
        return Table("price", ("", "to expect"), tuple(zip(labels, self, strict=True)))


def price(base: Base, design: Design, workers: int) -> Price:
    """Timed on the first cases and on the first reduced model that is missing, which are kept."""
    every = list(sharings(base, design, list(range(design.n_cases)), False))
    walls = [one for one in every if one.scene is not None]
    sources = {one.key: one.source for one in walls if one.key is not None}
    missing = [source for source in sources.values() if not is_kept(source)]
    started = perf_counter()
    if missing:
        models(missing[0])
    seconds_model = perf_counter() - started if missing else 0.0
    seconds_case = _seconds_case(walls[0]) if walls else 0.0
    tasks = [task.checked for one in every for task in one.tasks]
    refused = sum(len(one.refused) for one in tasks)
    joined = sum(len(t.checked.group.cases) for w in walls if _joins(w) for t in w.tasks)
    run = seconds_case * (design.n_cases - refused) + seconds_model * max(0, len(missing) - 1)
    return Price(
        design.n_cases, refused, len(walls), len(sources), len(missing), joined, seconds_case,
        seconds_model, workers, run / workers, _memory(walls[0]) if walls else 0.0,
    )  # fmt: skip


def _joins(one: Sharing) -> bool:
    return one.tasks[-1].checked.joins


def _seconds_case(one: Sharing) -> float:
    found = models(one.source) if one.key is not None else None
    shared, looked = prepared(one.scene, one.source, found), one.tasks[-1].checked
    some = next(looked.parts(TRIED if looked.joins else 1))
    rows(some, shared, False)  # compiles
    started = perf_counter()
    rows(some, shared, False)
    return (perf_counter() - started) / len(some.group.cases)


def _memory(one: Sharing) -> float:
    scene = one.scene
    per_case = scene.output.samples * (len(scene.output.spheres) + 1)
    return SIZE * 3 * per_case * (CHUNK if _joins(one) else 1)
