"""What a sweep will take, from its first cases."""

from collections.abc import Callable, Sequence
from time import perf_counter
from typing import NamedTuple, TypeVar

from workflows.report.tables import Table
from workflows.scene import DashpotWall, Scene
from workflows.sweep.cases import Base, Group, groups
from workflows.sweep.core.design import Design
from workflows.sweep.march import rows
from workflows.sweep.models import is_kept, models, prepared
from workflows.sweep.sweep import AT_ONCE
from workflows.sweep.tasks import CHUNK, Sharing, sharing

TRIED = 64  # cases side by side that are timed, or one alone
LOOKED = 100  # walls, and cases on a wall, that are looked at
Item = TypeVar("Item")
SIZE = 8e-9  # GB of a number
DEALT = (
    "{} is marched chain by chain, dealt to the threads: seconds a case are those of such a march."
)


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
    notes: tuple[str, ...] = ()  # why cases are refused, or the first one fails

    def table(self) -> Table:
        """For a person and for machines."""
        labels = (
            "cases", "refused", "walls", "reduced models", "reduced models to compute",
            "cases side by side", "seconds a case", "seconds a reduced model", "processes",
            "seconds", "memory of a process [GB]",
        )  # fmt: skip
        return Table("price", ("", "to expect"), tuple(zip(labels, self[:-1], strict=True)))


def price(base: Base, design: Design, workers: int) -> Price:
    """Timed on the first cases and on the first reduced model that is missing, which are kept.

    Of many walls, and of many cases on a wall, some are looked at and stand for the rest.
    """
    every = list(groups(base, design, range(design.n_cases)))
    some = [sharing(base, design, _some(group), False) for group in spread(every)]
    walls = [one for one in some if one.scene is not None]
    sources = {one.key: one.source for one in walls if one.key is not None}
    missing = [source for source in sources.values() if not is_kept(source)]
    more = len(every) / len(some) if len(sources) > len(some) / 2 else 1.0  # others have models too
    started = perf_counter()
    first = models(missing[0]) if missing else None
    seconds_model = perf_counter() - started if missing else 0.0
    alone = _case(walls[0]) if walls else Measured()
    refused, joined = (_in_all(design, some, share) for share in (_refused, _joined))
    n_models, n_missing = round(more * len(sources)), round(more * len(missing))
    run = alone.seconds * (design.n_cases - refused) + seconds_model * max(0, n_missing - 1)
    said = [*_refusals(some)[:1], *([first] if isinstance(first, str) else alone.failures[:1])]
    said += [DEALT.format(part) for part in _dealt(walls[0].scene)] if joined else []
    return Price(
        design.n_cases, refused, round(len(every) * len(walls) / len(some)), n_models, n_missing,
        joined, alone.seconds, seconds_model, workers, run / workers,
        _memory(walls[0], design.n_cases) if walls else 0.0, tuple(said),
    )  # fmt: skip


def spread(items: Sequence[Item], n: int = LOOKED) -> list[Item]:
    """All of them, or `n` in equal distances, the first and the last among them."""
    if len(items) <= n:
        return list(items)
    return [items[i * (len(items) - 1) // (n - 1)] for i in range(n)]


def _some(group: Group) -> Group:
    return group.take(spread(range(len(group.cases))))


def _refusals(some: list[Sharing]) -> list[str]:
    return [told for one in some for task in one.tasks for told in task.checked.refused.values()]


def _refused(one: Sharing) -> int:
    return len(_refusals([one]))


def _joined(one: Sharing) -> int:
    return sum(len(task.checked.sound.cases) for task in one.tasks if _joins(one))


def _in_all(design: Design, some: list[Sharing], count: Callable[[Sharing], int]) -> int:
    """Cases of a kind in all, of as many as those that are looked at hold."""
    looked = sum(len(task.checked.group.cases) for one in some for task in one.tasks)
    return round(design.n_cases * sum(map(count, some)) / looked)


def _joins(one: Sharing) -> bool:
    return one.scene is not None and one.tasks[-1].checked.joins


def _dealt(scene: Scene) -> list[str]:
    """Parts of a scene that the lanes of `dem.batch` do not take."""
    law = scene.contact.dissipation
    found = [f'contact.dissipation = "{law}"'] if law.startswith("linear") else []
    return found + ['wall.kind = "dashpot"'] * isinstance(scene.wall, DashpotWall)


class Measured(NamedTuple):
    """What the first cases take, and why they fail."""

    seconds: float = 0.0
    failures: tuple[str, ...] = ()


def _case(one: Sharing) -> Measured:
    found = models(one.source) if one.key is not None else None
    shared, looked = prepared(one.scene, one.source, found), one.tasks[-1].checked
    some = next(looked.parts(TRIED if looked.joins else 1))
    rows(some, shared, False)  # compiles
    started = perf_counter()
    done = rows(some, shared, False)
    seconds = (perf_counter() - started) / len(some.group.cases)
    return Measured(
        seconds, tuple(told for part in done for told in part.columns["message"] if told)
    )


def _memory(one: Sharing, n_cases: int) -> float:
    scene = one.scene
    per_case = scene.output.samples * (len(scene.output.spheres) + 1)
    return SIZE * 3 * per_case * (min(n_cases, (AT_ONCE + 1) * CHUNK) if _joins(one) else 1)
