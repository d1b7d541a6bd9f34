"""Runs a second of a population of chains, and the operation that bounds them.

You will see the seconds of a run in a population of 8192 chains whose contacts are scattered by 5 %
(lognormal), marched side by side by one thread and by all, with the longest step whose median error
is at most 1e-4 of the striker's speed; then the time of a contact force beside that of its square
root alone, and the rate at which results are written.

Run it: python benchmarks/batch.py        half a minute
"""

from os import cpu_count
from time import perf_counter

import numpy as np

from beadwave import dem
from beadwave.workflows.evidence.accuracy.problems import Problem, problem
from beadwave.workflows.evidence.accuracy.runs import limit, timed
from beadwave.workflows.files.scene import scene
from beadwave.workflows.report.tables import Table, text
from beadwave.workflows.stages.engine.progress import quiet

SCHEME = "rkn6"
ERROR = 1e-4  # median velocity error over the striker's speed
COLUMNS = ("threads", "us a run", "runs a second", "first call [us a run]", "error", "step [us]")


def main(count: int = 8192, changes: tuple[str, ...] = (), budget: float = 2.0) -> list[tuple]:
    """Print the table of `count` chains of rig-rigid with these changes; returns its rows."""
    case = problem(scene("rig-rigid", changes), quiet)._replace(n_save=50)
    rng = np.random.default_rng(5)
    A = case.chain.A * rng.lognormal(0.0, 0.05, (count, case.chain.A.size))
    dt, error = step_of_median(case, A, ERROR)

    rows = []
    for n in sorted({1, cpu_count() or 1}):
        run, warm, cold = timed(lambda n=n: marched(case, A, dt, threads=n), budget=budget)
        rows.append((n, 1e6 * warm / count, count / warm, 1e6 * cold / count, error, 1e6 * run.dt))
    print(text(Table("batch", COLUMNS, tuple(rows))))

    # a contact force beside its square root, of values that stay in the first cache
    values, roots, root = np.linspace(0.1, 1.0, 2048), np.empty(2048), np.inf
    for _ in range(2000):
        started = perf_counter()
        np.sqrt(values, out=roots)
        root = min(root, perf_counter() - started)
    evaluations = run.n_steps * dem.SCHEMES[SCHEME].evaluations * A.shape[1]
    saved = 8 * case.n_save * (case.observed.size + 1)  # bytes of a run: velocities and times
    print(
        f"\na contact force: {1e3 * rows[0][1] / evaluations:.2f} ns on one thread, its square "
        f"root alone {1e9 * root / values.size:.2f} ns\n"
        f"results: {1e-6 * saved * max(row[2] for row in rows):.0f} MB/s"
    )
    return rows


def marched(case: Problem, A: np.ndarray, dt: float, threads: int | None = None):
    """Chains with contacts A (n_chains, n_contacts) [N/m^1.5], side by side."""
    chains = dem.Chains(case.chain._replace(A=A), case.wall, case.v0)
    return dem.march_batch(
        chains, duration=case.duration, dt=dt, observed=case.observed, scheme=SCHEME,
        n_save=case.n_save, threads=threads,
    )  # fmt: skip


def step_of_median(case: Problem, A: np.ndarray, error: float) -> tuple[float, float]:
    """Largest step [s] whose median error is at most `error`, and that median.

    Errors are those of up to 512 chains beside a step of 1/64 of the stability limit; 24 steps
    from 0.9 to 0.05 of it are tried. Raises UnstableStep where none of them will do.
    """
    few, largest, speed = A[:512], limit(case, SCHEME), np.abs(case.v0).max()
    truth = marched(case, few, largest / 64).v
    for share in np.geomspace(0.9, 0.05, 24):
        try:
            run = marched(case, few, share * largest)
        except dem.UnstableStep:
            continue
        median = float(np.median(np.abs(run.v - truth).max(axis=(1, 2)))) / speed
        if median <= error:
            return run.dt, median
    raise dem.UnstableStep(f"no step leaves the median error below {error:g}; ask for a larger one")


if __name__ == "__main__":
    main()
