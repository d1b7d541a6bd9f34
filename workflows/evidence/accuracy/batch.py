"""Many chains at once: runs per second, and what bounds them."""

from os import cpu_count
from time import perf_counter
from typing import NamedTuple

import numpy as np

from beadwave import dem
from beadwave.workflows.evidence.accuracy.cost import timed
from beadwave.workflows.evidence.accuracy.peers import Problem
from beadwave.workflows.evidence.accuracy.problems import problem
from beadwave.workflows.evidence.accuracy.row import AccuracyRow, table_of
from beadwave.workflows.evidence.accuracy.runs import limit
from beadwave.workflows.evidence.study import rendered
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.progress import Progress

SCENE = "rig-rigid"
POPULATION = 8192  # chains
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


def batch(scene: Scene, progress: Progress) -> Finding:
    """Runs per second of a population of chains at a median error of 1e-4."""
    many = population(problem(scene, progress)._replace(n_save=50), POPULATION)
    dt, error = step_of_median(many, 1e-4)
    rows = []
    for n in sorted({1, cpu_count() or 1}):
        run, warm, cold = timed(lambda n=n: many.marched(dt, threads=n), budget=2.0)
        rows.append(AccuracyRow(
            "batch", f"{SCHEME}, {n} threads", run.dt, error, warm.clock / POPULATION,
            float(np.median(run.energy_error)), run.n_steps,
            run.n_steps * dem.SCHEMES[SCHEME].evaluations, cold.clock / POPULATION,
        ))  # fmt: skip
    single, best = rows[0], min(rows, key=lambda row: row.seconds)

    # what bounds it: a contact force beside its square root alone, of many that stay in the first
    # cache, and the rate [bytes/s] at which velocities of observed spheres and times are saved
    values = np.linspace(0.1, 1.0, 2048)
    roots, root_seconds = np.empty_like(values), np.inf
    for _ in range(2000):
        started = perf_counter()
        np.sqrt(values, out=roots)
        root_seconds = min(root_seconds, perf_counter() - started)
    saved = 8 * many.case.n_save * (many.case.observed.size + 1)
    sentences = rendered(
        __file__, single=single, best=best,
        force_seconds=single.seconds / (best.evaluations * many.A.shape[1]),
        root_seconds=root_seconds / values.size, saved_rate=saved / best.seconds,
    )  # fmt: skip
    return Finding((table_of(tuple(rows)),), sentences)


def population(case: Problem, count: int) -> Population:
    """Contacts scattered by 5 % (lognormal, a fixed seed)."""
    rng = np.random.default_rng(5)
    factors = rng.lognormal(0.0, 0.05, (count, case.chain.A.size))
    return Population(case, case.chain.A * factors)


def step_of_median(many: Population, error: float) -> tuple[float, float]:
    """Largest step [s] whose median error stays below `error`, and that median.

    Errors are those of up to 512 chains beside a step of 1/64 of the stability limit; 24 steps
    from 0.9 to 0.05 of it are tried. Raises UnstableStep where none of them will do.
    """
    n_chains = min(512, len(many.A))
    largest = limit(many.case, SCHEME)
    truth = many.marched(largest / 64, n_chains=n_chains).v
    speed = np.abs(many.case.v0).max()
    for share in np.geomspace(0.9, 0.05, 24):
        try:
            run = many.marched(share * largest, n_chains=n_chains)
        except dem.UnstableStep:
            continue
        median = float(np.median(np.abs(run.v - truth).max(axis=(1, 2)))) / speed
        if median <= error:
            return run.dt, median
    raise dem.UnstableStep(f"no step leaves the median error below {error:g}; ask for a larger one")
