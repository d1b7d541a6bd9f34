"""What bounds a sweep on many workers: the scheduler's time for a task, and a worker's memory.

You will see, for 10 and 50 workers: milliseconds, of the clock and of the processor, that a
task takes which computes nothing, the share of their time that workers are busy with tasks of one
second, handed over as a sweep does, four ahead for each worker, and what each adds to the memory
of the process; then what a process that has marched chains takes, and how long the tasks are that
keep 1000 workers busy.

    busy workers <= seconds of a task / processor's seconds that Dask spends on it

Workers are threads here that sleep, in the process of the scheduler and of the client: they cost no
cores and little memory, what Dask does for them is all there. On hosts of their own the scheduler
has a core for itself.

Run it: python examples/many_workers.py            some minutes
        python examples/many_workers.py 10 200     other numbers of workers
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter, process_time, sleep
from typing import NamedTuple

from workflows.sweep.cluster import AHEAD

MB = 1e-6
MANY = 1000  # workers
NOTHING = 1000  # tasks that compute nothing, in all


def main(counts: tuple[int, ...] = (10, 50)) -> None:
    print("workers  start s  ms a task  processor's ms  busy with 1 s  MB each")
    for n in counts:
        before, began = memory(), perf_counter()
        with light(n) as client:
            start = perf_counter() - began
            each = MB * (memory() - before) / n
            nothing, second = spent(client, 0.0, max(n, NOTHING)), spent(client, 1.0, 3 * n)
        print(
            f"{n:7d} {start:8.1f} {1e3 * nothing.clock:10.2f} {1e3 * nothing.processor:15.2f} "
            f"{1.0 / second.clock / n:14.0%} {each:8.1f}",
            flush=True,
        )
    print(f"{MANY} workers are busy with tasks of {MANY * nothing.processor:.1f} s or more")
    print(f"a process that has marched chains takes {MB * of_a_worker():.0f} MB")


@contextmanager
def light(n: int) -> Iterator:
    """A client of so many workers that are threads."""
    from distributed import Client, LocalCluster

    with (
        LocalCluster(
            n_workers=n, threads_per_worker=1, processes=False, dashboard_address=None,
            memory_limit=0,
        ) as cluster,
        Client(cluster) as client,
    ):  # fmt: skip
        client.wait_for_workers(n)
        spent(client, 0.0, n)
        yield client


class Spent(NamedTuple):
    """Seconds of each task, all workers together."""

    clock: float
    processor: float  # of this process: scheduler, client and workers


def spent(client, length: float, tasks: int) -> Spent:
    """On tasks of a length [s], handed over as in a sweep."""
    from distributed import as_completed

    most, done, running = AHEAD * len(client.nthreads()), as_completed([]), 0
    began = perf_counter(), process_time()
    for i in range(tasks):
        done.add(client.submit(slept, length, i, pure=False))
        running += 1
        if running >= most:
            next(done).result()
            running -= 1
    for _ in range(running):
        next(done).result()
    return Spent((perf_counter() - began[0]) / tasks, (process_time() - began[1]) / tasks)


def slept(length: float, i: int) -> int:
    """A case that computes nothing."""
    sleep(length)
    return i


def memory() -> int:
    """Of this process [bytes]."""
    import psutil

    return psutil.Process().memory_info().rss


def of_a_worker() -> int:
    """Of a process of its own that has marched a chain [bytes]."""
    from distributed import Client, LocalCluster

    with (
        LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        return client.submit(marched, pure=False).result()


def marched() -> int:
    """Marches a built-in scene; the memory of the process after it."""
    import beadwave

    beadwave.impact("rig-rigid")
    return memory()


if __name__ == "__main__":
    main(tuple(map(int, sys.argv[1:])) or (10, 50))
