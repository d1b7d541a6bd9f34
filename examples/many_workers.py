"""Limits of a sweep on many workers: the scheduler's time for a task, and a worker's memory.

You will see, for 10 and 100 workers: milliseconds, of the clock and of the processor, that a task
takes which computes nothing, the share of their time that workers are busy with tasks of one second
and with longer ones, handed over as a sweep does, four ahead for each worker, and what each adds to
the memory of the scheduler; then what a process that has marched chains takes, and how long the
tasks are that keep 1000 workers busy.

    busy workers <= seconds of a task / processor's seconds that Dask spends on it

Workers are Dask's own, many in one process beside this one, and wait in place of computing. Only
this process is measured, which has the scheduler and the client: what workers cost is on hosts of
their own elsewhere.

Run it: python examples/many_workers.py            some minutes
        python examples/many_workers.py 10 1000    other numbers of workers
"""

import os
import resource
import subprocess
import sys
from asyncio import sleep
from collections.abc import Iterator
from contextlib import contextmanager
from json import dumps
from math import ceil
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, process_time
from typing import NamedTuple

from beadwave.workflows.sweep.cluster import TASKS_AHEAD

MB = 1e-6
EXTRAPOLATED = 1000  # workers for which the length of a task is told
EMPTY_TASKS = 1000  # at least, to time a task that computes nothing
TASKS_EACH = 3  # waiting tasks for each worker
FILES_EACH = 10  # files that a process opens for each worker, and as many for itself
WITHOUT_MONITORS = {  # many workers in one process would do nothing but watch themselves
    "DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False",
    "DASK_DISTRIBUTED__ADMIN__SYSTEM_MONITOR__INTERVAL": "60s",
    "DASK_DISTRIBUTED__ADMIN__SYSTEM_MONITOR__GIL__ENABLED": "False",
    "DASK_DISTRIBUTED__ADMIN__TICK__INTERVAL": "60s",
    "DASK_LOGGING__DISTRIBUTED": "critical",
    "PYTHONWARNINGS": "ignore",
}


def main(counts: tuple[int, ...] = (10, 100)) -> None:
    print("workers  start s  ms a task  processor's ms  busy with 1 s  with longer tasks  MB each")
    for n in counts:
        memory_without, launch = memory(), perf_counter()
        with waiting_workers(n) as client:
            start = perf_counter() - launch
            memory_each = MB * (memory() - memory_without) / n
            empty = seconds_of_a_task(client, 0.0, max(2 * n, EMPTY_TASKS))
            long = 1 + ceil(2 * n * empty.clock)
            busy = [busy_with(client, n, length) for length in (1, long)]
        print(
            f"{n:7d} {start:8.1f} {1e3 * empty.clock:10.2f} {1e3 * empty.processor:15.2f} "
            f"{busy[0]:14.0%} {busy[1]:9.0%} of {long:2d} s {memory_each:9.2f}",
            flush=True,
        )
    print(
        f"{EXTRAPOLATED} workers are busy with tasks of "
        f"{EXTRAPOLATED * empty.processor:.1f} s or more"
    )
    print(f"a process that has marched chains takes {MB * memory_of_a_worker():.0f} MB")


def busy_with(client, n: int, length: int) -> float:
    """Share of their time that n workers are busy with tasks of a length [s]."""
    return length / seconds_of_a_task(client, length, TASKS_EACH * n).clock / n


@contextmanager
def waiting_workers(n: int) -> Iterator:
    """A client of so many workers that share a process."""
    from distributed import Client, LocalCluster

    require_files(n)
    options = {"nthreads": 1, "memory_limit": 0, "dashboard": False}
    spec = {str(i): {"cls": "distributed.Worker", "opts": options} for i in range(n)}
    with (
        TemporaryDirectory() as folder,
        LocalCluster(n_workers=0, dashboard_address="127.0.0.1:0", silence_logs=60) as cluster,
        Client(cluster) as client,
    ):
        path = f"{folder}/spec.json"
        Path(path).write_text(dumps(spec))
        words = ("distributed.cli.dask_spec", cluster.scheduler_address, "--spec-file", path)
        workers = subprocess.Popen(
            [sys.executable, "-m", *words],
            env=os.environ | WITHOUT_MONITORS | {"DASK_TEMPORARY_DIRECTORY": folder},
        )
        try:
            client.wait_for_workers(n)
            seconds_of_a_task(client, 0.0, n)
            yield client
        finally:
            workers.terminate()
            workers.wait()


def require_files(n: int) -> None:
    """As many open files as the system allows; ends where they are too few for n workers."""
    allowed, needed = resource.getrlimit(resource.RLIMIT_NOFILE)[1], FILES_EACH * (n + 1)
    if allowed != resource.RLIM_INFINITY and allowed < needed:
        sys.exit(
            f"{n} workers open {needed} files, this system allows {allowed}; take fewer workers."
        )
    resource.setrlimit(resource.RLIMIT_NOFILE, (allowed, allowed))


class SecondsOfATask(NamedTuple):
    """Seconds of a sweep of tasks over their number, all workers together."""

    clock: float
    processor: float  # of this process: scheduler and client


def seconds_of_a_task(client, length: float, tasks: int) -> SecondsOfATask:
    """Of tasks that wait for a length [s], handed over as a sweep does."""
    from distributed import as_completed

    in_flight, finished, running = TASKS_AHEAD * len(client.nthreads()), as_completed([]), 0
    clock, processor = perf_counter(), process_time()
    for _ in range(tasks):
        finished.add(client.submit(sleep, length, pure=False))
        running += 1
        if running >= in_flight:
            next(finished).result()
            running -= 1
    for _ in range(running):
        next(finished).result()
    clock, processor = perf_counter() - clock, process_time() - processor
    return SecondsOfATask(clock / tasks, processor / tasks)


def memory() -> int:
    """Resident memory of this process [bytes]."""
    import psutil

    return psutil.Process().memory_info().rss


def memory_of_a_worker() -> int:
    """Resident memory of a process of its own that has marched a chain [bytes]."""
    from distributed import Client, LocalCluster

    with (
        LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        return client.submit(marched, pure=False).result()


def marched() -> int:
    """Marches the chains of a task; the memory of the process after it."""
    from beadwave.workflows.sweep.cases import base_of
    from beadwave.workflows.sweep.design_words import grid
    from beadwave.workflows.sweep.marched_group import rows
    from beadwave.workflows.sweep.models import SharedWall
    from beadwave.workflows.sweep.tasks import CHUNK, sharings

    base = base_of("rig-rigid", ())
    cases = grid((f"striker.velocity=0.1:1:{CHUNK}",), base.number)
    for sharing in sharings(base, cases, list(range(CHUNK)), False):
        for task in sharing.tasks:
            rows(task.checked, SharedWall(), task.signals)
    return memory()


def counts(words: list[str]) -> tuple[int, ...]:
    """Numbers of workers; ends with a sentence for a word that is not one."""
    for word in words:
        if not (word.isdecimal() and int(word) > 0):
            print(
                f"{word!r} is not a number of workers; give 10 100, for example.", file=sys.stderr
            )
            sys.exit(2)
    return tuple(map(int, words)) or (10, 100)


if __name__ == "__main__":
    try:
        main(counts(sys.argv[1:]))
    except ModuleNotFoundError as missing:
        print(f"{missing.name} is not installed; ./install.sh sweep installs it.", file=sys.stderr)
        sys.exit(2)
