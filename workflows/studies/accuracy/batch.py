"""Many chains at once: runs per second, and what bounds them."""

from collections.abc import Callable
from os import cpu_count
from time import perf_counter
from typing import NamedTuple

import numpy as np

import dem
from coupling.peers import Problem
from workflows.pipeline.pipeline import Progress
from workflows.scene import Scene
from workflows.studies.accuracy.problems import problem
from workflows.studies.accuracy.rows import Row, table_of
from workflows.studies.accuracy.work_precision import limit, timed
from workflows.studies.finding import Finding
from workflows.studies.prose import rendered

SCENE = "rig-rigid"
POPULATION, SCATTER, ERROR = 8192, 0.05, 1e-4
SAMPLED = 512  # chains whose error is measured
SCHEME = "rkn6"


class Population(NamedTuple):
    """A case with scattered contacts, and how it is marched."""

    case: Problem
    A: np.ndarray  # (n_chains, n_contacts) [N/m^1.5]

    def marched(self, dt: float, *, threads: int | None = None, n_chains: int | None = None):
        """The first n_chains, or all."""
        case = self.case
        return dem.march_batch(
            dem.Chains(case.chain._replace(A=self.A[:n_chains]), case.wall, case.v0),
            duration=case.duration,
            dt=dt,
            observed=case.observed,
            scheme=SCHEME,
            n_save=case.n_save,
            threads=threads,
        )


def population(case: Problem, count: int = POPULATION) -> Population:
    """Contacts scattered by 5 % (lognormal, a fixed seed)."""
    rng = np.random.default_rng(5)
    factors = rng.lognormal(0.0, SCATTER, (count, case.chain.A.size))
    return Population(case, case.chain.A * factors)


def batch(scene: Scene, progress: Progress) -> Finding:
    """Runs per second of a population of chains at a median error of 1e-4."""
    many = population(problem(scene, progress)._replace(n_save=50))
    dt, error = step_of_median(many, ERROR)
    threads = cpu_count() or 1
    runs = {n: timed(lambda n=n: many.marched(dt, threads=n), budget=2.0) for n in {1, threads}}
    rows = tuple(
        Row(
            "batch", f"{SCHEME}, {n} threads", run.result.dt, error, run.warm / POPULATION,
            float(np.median(run.result.energy_error)), run.result.n_steps,
            run.result.n_steps * dem.SCHEMES[SCHEME].evaluations, run.cold / POPULATION,
        )
        for n, run in sorted(runs.items())
    )  # fmt: skip
    single, best = rows[0], min(rows, key=lambda row: row.seconds)
    sentences = rendered(__file__, single=single, best=best, **_limits(many, single, best))
    return Finding((table_of(rows),), sentences)


def step_of_median(many: Population, error: float) -> tuple[float, float]:
    """Largest step [s] that leaves the median error below the one asked for, and that median."""
    n_chains = min(SAMPLED, len(many.A))
    largest = limit(many.case, SCHEME)
    truth = many.marched(largest / 64, n_chains=n_chains).v
    scale = np.abs(many.case.v0).max()
    for share in np.geomspace(0.9, 0.05, 24):
        try:
            found = many.marched(share * largest, n_chains=n_chains)
        except dem.UnstableStep:
            continue
        median = float(np.median(np.abs(found.v - truth).max(axis=(1, 2)))) / scale
        if median <= error:
            return found.dt, median
    raise dem.UnstableStep(f"no step leaves the median error below {error:g}; ask for a larger one")


def _limits(many: Population, single: Row, best: Row) -> dict[str, float]:
    """How near the arithmetic is to its limit, and what is saved [bytes/s]."""
    contacts = best.evaluations * many.A.shape[1]
    saved = 8 * many.case.n_save * (many.case.observed.size + 1)
    return {
        "force_seconds": single.seconds / contacts,
        "root_seconds": seconds_of_a_root(),
        "saved_rate": saved / best.seconds,
    }


def seconds_of_a_root() -> float:
    """Time of one square root among many that stay in the first cache."""
    values = np.linspace(0.1, 1.0, 2048)
    out = np.empty_like(values)
    return _least(lambda: np.sqrt(values, out=out), 2000) / values.size


def _least(call: Callable[[], object], repeats: int) -> float:
    best = np.inf
    for _ in range(repeats):
        started = perf_counter()
        call()
        best = min(best, perf_counter() - started)
    return best
