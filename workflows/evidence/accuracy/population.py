"""Many chains at once: a population with scattered contacts, the step of a median error."""

from collections.abc import Callable
from time import perf_counter
from typing import NamedTuple

import numpy as np

import dem
from workflows.evidence.accuracy.peers import Problem
from workflows.evidence.accuracy.runs import limit

SAMPLED = 512  # chains whose error is measured
SCHEME, SCATTER = "rkn6", 0.05


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


def population(case: Problem, count: int) -> Population:
    """Contacts scattered by 5 % (lognormal, a fixed seed)."""
    rng = np.random.default_rng(5)
    factors = rng.lognormal(0.0, SCATTER, (count, case.chain.A.size))
    return Population(case, case.chain.A * factors)


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
