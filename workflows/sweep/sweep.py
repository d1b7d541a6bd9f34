"""A sweep from its design to its table: what is shared once, every missing case once.

design    which cases there are                          (`sweep.design_words`, `sweep.core.design`)
groups    cases that differ only in numbers of the chain  (`sweep.cases`)
models    reduced models and walls that groups share      (`sweep.models`, `sweep.tasks`)
march     of the cases of a group, side by side or alone  (`sweep.marched_group`)
rows      waves, forces and errors of each case           (`sweep.core.case_row`)
store     rows on disk as they come, one table at the end (`sweep.store`)
"""

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor

from beadwave.workflows.files.run_folder import RunFolder
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.sweep.cases import Base
from beadwave.workflows.sweep.core.case_row import Rows
from beadwave.workflows.sweep.core.design import Design
from beadwave.workflows.sweep.inputs import Inputs, files_of_cases
from beadwave.workflows.sweep.marched_group import rows
from beadwave.workflows.sweep.models import Models, SharedWall, models, shared_wall
from beadwave.workflows.sweep.store import Store
from beadwave.workflows.sweep.tasks import Sharing, sharings

# tasks of cases side by side that march at a time: next to one, the table and the search for a step
# keep a core busy
AT_ONCE = 2
FIXED = ("name", "output.", "unusual")  # keys that the table's columns depend on
Engine = Callable[[Iterator[Sharing]], Iterator[list[Rows]]]
Progress = Callable[[int, int], None]  # cases done, cases in all


def require_keys(base: Base, design: Design, signals: bool) -> None:
    """Raise InvalidScene for keys that cannot vary, or that no scene has."""
    if signals and base.with_values({}).chains:
        raise InvalidScene("--signals are of one [chain], not of [[chains]]; drop it.")
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
    progress: Progress, again: bool,
) -> tuple[str, ...]:  # fmt: skip
    """Fill the folder with the table of all cases and return notes for the user, in sentences.

    Cases whose rows are there are not computed again, unless `again` asks for those without a
    result. `engine` computes tasks, by default in this process.
    """
    # units of the keys are those of the first case, or of the scene where that case is refused
    try:
        typical = base.with_values(design.case(0))
    except InvalidScene:
        typical = base.with_values({})
    store = Store(folder, design, typical, signals, Inputs(files_of_cases(base, design)))
    notes = store.notes()

    # a finished table stays as it is, and rows of a stopped sweep count
    if again:
        store.reopen()
    elif n_failed := store.failed():
        notes += (f"{n_failed} cases failed before and are kept so; --again computes them again",)
    if not again and store.finished():
        store.keep()
        progress(design.n_cases, design.n_cases)
        return notes
    missing = store.missing()
    n_done = design.n_cases - len(missing)
    if n_done:
        notes += (f"{n_done} of {design.n_cases} cases were there already",)
    progress(n_done, design.n_cases)

    # cases are grouped and checked as they are reached: a design may have millions
    groups = sharings(base, design, missing, signals, here=engine is None)
    for rows_of_task in (engine or _in_this_process)(groups):
        for piece in rows_of_task:
            store.add(piece)
            n_done += len(piece.cases)
        progress(n_done, design.n_cases)
    store.finish()
    return notes


def _in_this_process(groups: Iterator[Sharing]) -> Iterator[list[Rows]]:
    """Rows task by task of groups that share a wall; those of cases side by side come AT_ONCE tasks
    late, as so many march at a time."""
    running: deque[Future[list[Rows]]] = deque()
    latest: dict[str, Models | str] = {}
    with ThreadPoolExecutor(AT_ONCE) as pool:
        for group in groups:
            # groups of one key follow each other: only the latest models stay in memory
            if group.key is not None and group.key not in latest:
                latest = {group.key: models(group.source)}
            shared = SharedWall()
            if group.scene:
                shared = shared_wall(group.scene, group.source, latest.get(group.key))

            for task in group.tasks:
                if task.checked.scene is None or not task.checked.side_by_side:
                    yield rows(task.checked, shared, task.signals)
                    continue
                running.append(pool.submit(rows, task.checked, shared, task.signals))
                if len(running) > AT_ONCE:
                    yield running.popleft().result()
        while running:
            yield running.popleft().result()
