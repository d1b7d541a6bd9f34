"""Many chains at once: runs per second, and what bounds them."""

from os import cpu_count

import numpy as np

import dem
from workflows.evidence.accuracy.population import (
    SCHEME,
    Population,
    population,
    seconds_of_a_root,
    step_of_median,
)
from workflows.evidence.accuracy.problems import problem
from workflows.evidence.accuracy.row import Row
from workflows.evidence.accuracy.rows import table_of
from workflows.evidence.accuracy.runs import timed
from workflows.evidence.prose import rendered
from workflows.report.finding import Finding
from workflows.scene import Scene
from workflows.stages.pipeline import Progress

SCENE = "rig-rigid"
POPULATION, ERROR = 8192, 1e-4


def batch(scene: Scene, progress: Progress) -> Finding:
    """Runs per second of a population of chains at a median error of 1e-4."""
    many = population(problem(scene, progress)._replace(n_save=50), POPULATION)
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


def _limits(many: Population, single: Row, best: Row) -> dict[str, float]:
    """How near the arithmetic is to its limit, and what is saved [bytes/s]."""
    contacts = best.evaluations * many.A.shape[1]
    saved = 8 * many.case.n_save * (many.case.observed.size + 1)
    return {
        "force_seconds": single.seconds / contacts,
        "root_seconds": seconds_of_a_root(),
        "saved_rate": saved / best.seconds,
    }
