"""Cases of a sweep a second, and the gain of more processes.

You will see cases a second on one core and on all: chains alone, before a mass on a spring, before
a reduced model that all share; then walls that differ, each with a mesh and a reduced model of its
own, by one process and by two; and what a task takes that computes nothing, from 10 workers.

    seconds of a sweep = cases / rate + models * seconds of a model / processes

Run it: python examples/sweep_rates.py          some minutes
        python examples/sweep_rates.py 1000     and with so many workers that compute nothing
"""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from tempfile import TemporaryDirectory
from time import perf_counter

import beadwave

BLOCK = {
    "name": "block",
    "chain": {"count": 17, "radius": 0.0127, "density": 7800.0, "young": 210e9, "poisson": 0.3},
    "striker": {"velocity": 0.31},
    "contact": {"dissipation": "none"},
    "wall": {"kind": "rom"},
    "damping": {"kind": "modal", "ratio": 0.005},
    "output": {"spheres": [4, 14]},
    "materials": {"steel": {"young": 210e9, "poisson": 0.3, "density": 7850.0}},
    "strike": {"on": "block:+z"},
    "assembly": {"held": ["block:-z"], "material": "steel"},
    "bodies": {"block": {"box": [0.1, 0.1, 0.05], "seed": 0.01}},
}
RANGES = ("chain.young=150e9:250e9", "preload.force=1:50", "striker.velocity=0.1:1")
WALLS = {"chains alone": "rig-rigid", "mass on a spring": "rig-1dof", "reduced model": BLOCK}


def main(cases: int = 10_000, models: int = 8, idle: tuple[int, ...] = (10,)) -> None:
    for name, scene in WALLS.items():
        seconds_of_a_sweep(scene, cases)  # compiles
        rates = [cases / seconds_of_a_sweep(scene, cases, cores) for cores in (1, os.cpu_count())]
        print(f"{name}: {rates[0]:,.0f} cases a second on one core, {rates[1]:,.0f} on all")
    one, two = (seconds_on_processes(n, models) for n in (1, 2))
    print(f"walls that differ: {one / models:.2f} s a wall, two processes do {one / two:.2f} times")
    for n in idle:
        print(f"{n} idle workers: {1e3 * seconds_of_a_task(n):.2f} ms a task")


def seconds_of_a_sweep(scene, cases: int, cores: int | None = None) -> float:
    """Seconds of a sweep in this process, its table and pictures included."""
    sampled = beadwave.Cases(RANGES, sample=f"lhs:{cases}")
    with TemporaryDirectory() as folder, on_cores(cores):
        start = perf_counter()
        beadwave.sweep(scene, cases=sampled, out=f"{folder}/out")
        return perf_counter() - start


def seconds_on_processes(n_workers: int, models: int) -> float:
    """Seconds of a sweep of walls with meshes of their own, on processes that run already."""
    from distributed import LocalCluster

    seeds = [0.01 * (1 - 0.01 * i) for i in range(models)]
    with (
        TemporaryDirectory() as folder,
        LocalCluster(n_workers=n_workers, threads_per_worker=1, dashboard_address=None) as cluster,
    ):
        # the first sweep lets every process import and compile; the second is timed
        for i, sizes in enumerate(([0.02 + 0.001 * j for j in range(n_workers)], seeds)):
            os.environ["BEADWAVE_CACHE_DIR"] = f"{folder}/cache-{i}"
            start = perf_counter()
            cases = {"bodies.block.seed": sizes}
            beadwave.sweep(
                BLOCK, cases=cases, out=f"{folder}/out-{i}", on=cluster.scheduler_address
            )
        return perf_counter() - start


def seconds_of_a_task(n_workers: int, tasks_each: int = 20) -> float:
    """Seconds of a task that computes nothing: what bounds many workers."""
    from distributed import Client, LocalCluster

    with (
        LocalCluster(
            n_workers=n_workers, processes=False, dashboard_address=None, memory_limit=0
        ) as cluster,
        Client(cluster) as client,
    ):
        client.wait_for_workers(n_workers)
        client.gather(client.map(str, range(n_workers), pure=False))
        start = perf_counter()
        client.gather(client.map(str, range(tasks_each * n_workers), pure=False))
        return (perf_counter() - start) / (tasks_each * n_workers)


@contextmanager
def on_cores(n: int | None) -> Iterator[None]:
    """This process and its threads on so many cores, where the system lets it."""
    if n is None or not hasattr(os, "sched_setaffinity"):
        yield
        return
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, set(sorted(cores)[:n]))
    try:
        yield
    finally:
        os.sched_setaffinity(0, cores)


if __name__ == "__main__":
    try:
        main(idle=(10, *map(int, sys.argv[1:])))
    except beadwave.InvalidScene as missing:  # pyarrow, for the table
        print(missing, file=sys.stderr)
        sys.exit(2)
