"""A sweep from its design to its table: what is shared once, every missing case once."""

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

from workflows.files.run_folder import RunFolder
from workflows.scene import InvalidScene, Scene
from workflows.sweep.cases import Base
from workflows.sweep.core.design import Design
from workflows.sweep.core.rows import Rows
from workflows.sweep.inputs import Inputs, files_of_cases
from workflows.sweep.march import rows
from workflows.sweep.models import Prepared, models, prepared
from workflows.sweep.store import Store
from workflows.sweep.tasks import Sharing, Task, sharings

AT_ONCE = 2  # tasks of cases side by side
FIXED = ("name", "output.", "unusual")  # keys that the table's columns depend on
Engine = Callable[[Iterator[Sharing]], Iterator[list[Rows]]]
Told = Callable[[int, int], None]  # cases done, cases in all


def require_keys(base: Base, design: Design, signals: bool) -> None:
    """Raise InvalidScene for keys that cannot vary, or that no scene has."""
    for key in design.keys:
        if key.startswith(FIXED) or (signals and key.startswith("time.")):
            raise InvalidScene(
                f"{key} cannot vary in a sweep{' with --signals' if signals else ''}: all cases "
                "share the columns of one table; set it for all by --set."
            )
    first = design.case(0)
    for key in design.keys:
        try:
            base.with_values({key: first[key]})
        except InvalidScene as reason:
            if "unknown key" in str(reason):
                raise InvalidScene(str(reason)) from None


def sweep(
    base: Base, design: Design, folder: RunFolder, engine: Engine | None, *, signals: bool,
    told: Told, again: bool,
) -> tuple[str, ...]:  # fmt: skip
    """Fill the folder with the table of all cases; those whose rows are there are not computed
    again, unless asked for and without a result. What the user is to know, in sentences."""
    inputs = Inputs(files_of_cases(base, design), __name__)
    store = Store(folder, design, _typical(base, design), signals, inputs)
    notes = store.notes()
    if again:
        store.reopen()
    elif store.whole():
        store.keep()
        told(design.n_cases, design.n_cases)
        return _failed_before(store.failed())
    if not again:
        notes += _failed_before(store.failed())
    missing = store.missing()
    done = design.n_cases - len(missing)
    told(done, design.n_cases)
    tasks = sharings(base, design, missing, signals)
    for found in (engine or _here)(tasks):
        for part in found:
            store.add(part)
            done += len(part.cases)
        told(done, design.n_cases)
    store.finish()
    return notes


def _failed_before(n: int) -> tuple[str, ...]:
    said = f"{n} cases failed before and are kept so; --again computes them again"
    return (said,) if n else ()


def _typical(base: Base, design: Design) -> Scene:
    """The scene of the first case, or the one that is swept where that case is refused."""
    try:
        return base.with_values(design.case(0))
    except InvalidScene:
        return base.with_values({})


def _here(work: Iterator[Sharing]) -> Iterator[list[Rows]]:
    """Rows task by task in this process; of cases side by side two tasks at a time, as the table
    and the search for a step keep one core busy."""
    running: deque[Future[list[Rows]]] = deque()
    with ThreadPoolExecutor(AT_ONCE) as pool:
        for task, shared in _with_shared(work):
            what = task.checked, shared, task.signals
            if task.checked.scene is None or not task.checked.joins:
                yield rows(*what)
                continue
            running.append(pool.submit(rows, *what))
            if len(running) > AT_ONCE:
                yield running.popleft().result()
        while running:
            yield running.popleft().result()


def _with_shared(work: Iterator[Sharing]) -> Iterator[tuple[Task, Prepared]]:
    """Tasks with what they share; models of scenes that share them are there once."""
    kept: dict[str, Any] = {}
    for one in work:
        if one.key is not None and one.key not in kept:
            kept = {one.key: models(one.source)}
        shared = prepared(one.scene, one.source, kept.get(one.key)) if one.scene else Prepared()
        for task in one.tasks:
            yield task, shared
