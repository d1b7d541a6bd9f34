"""Studies of the engine: many chains at once, and what each optional part of a scene costs."""

from collections.abc import Callable
from os import cpu_count
from time import perf_counter
from typing import NamedTuple

import numpy as np

import dem
from workflows.accuracy.accuracy import Row, Study
from workflows.accuracy.chain import modal_wall, problem
from workflows.accuracy.peers import Problem
from workflows.accuracy.work_precision import limit, marched, observed, relative_error, timed
from workflows.scene import Scene
from workflows.stages import Watch

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
            case.chain._replace(A=self.A[:n_chains]),
            case.wall,
            case.v0,
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


def batch(scene: Scene, watch: Watch) -> Study:
    """Runs per second of a population at a median error of 1e-4, and what bounds them."""
    many = population(problem(scene, watch)._replace(n_save=50))
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
    return Study(rows, batch_sentences(many, rows))


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


def batch_sentences(many: Population, rows: tuple[Row, ...]) -> tuple[str, ...]:
    """Runs per second, how they grow with threads, and how near the arithmetic is to its limit."""
    single, best = rows[0], min(rows, key=lambda row: row.seconds)
    contacts = best.evaluations * many.A.shape[1]
    root = seconds_of_a_root()
    saved = 8 * many.case.n_save * (many.case.observed.size + 1) / best.seconds
    return (
        f"batch: {1 / best.seconds:,.0f} runs a second ({best.method}, median error "
        f"{best.error:.2g}, step {1e6 * best.parameter:.3g} µs), "
        f"{single.seconds / best.seconds:.2f} times one thread.",
        f"bound by arithmetic: {1e9 * single.seconds / contacts:.2f} ns a contact force on one "
        f"thread, of which the square root alone takes {1e9 * root:.2f} ns; "
        f"what is saved leaves at {saved / 1e6:.0f} MB/s, far below the memory's rate.",
    )


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


def parts(scene: Scene, watch: Watch) -> Study:
    """The same step and scheme with one part more at a time."""
    case = problem(scene, watch)
    case = case._replace(wall=modal_wall(None, 0), chain=_bare(case.chain))
    rows = tuple(
        _part_row(name, one, scheme)
        for scheme in ("verlet", "suzuki4")
        for name, one in with_parts(case).items()
    )
    return Study(rows, tuple(_part_sentence(rows, s) for s in ("verlet", "suzuki4")))


def _bare(chain: dem.Chain) -> dem.Chain:
    return dem.Chain(chain.mass, chain.radius, chain.A)


def with_parts(case: Problem) -> dict[str, Problem]:
    """The bare case and the case with each part."""
    chain, n = case.chain, case.chain.mass.size
    contacts = np.ones(chain.A.size)
    yields = 1e-3 * chain.radius[0] * contacts
    chains = {
        "bare": chain,
        "leaf springs": chain._replace(leaf_stiffness=np.full(n, 1e3)),
        "preload": chain._replace(preload=10.0),
        "linear-clipped": chain._replace(dissipation="linear-clipped", gamma=10.0 * contacts),
        "hunt-crossley": chain._replace(dissipation="hunt-crossley", gamma=0.1 * contacts),
        "plastic contacts": chain._replace(yield_overlap=yields),
    }
    walls = {
        "residual spring": case.wall._replace(residual_compliance=1e-9),
        "1 wall mode": modal_wall(None, 1),
        "40 wall modes": modal_wall(None, 40),
        "dashpot wall": dem.dashpot_wall(1e4),
    }
    return {name: case._replace(chain=one) for name, one in chains.items()} | {
        name: case._replace(wall=one) for name, one in walls.items()
    }


def _part_row(name: str, case: Problem, scheme: str) -> Row:
    dt = case.duration / 20000
    run = timed(lambda: marched(case, scheme, dt))
    finer = observed(case, marched(case, scheme, dt / 2).v)
    error = relative_error(case, run.result.v, finer)
    steps = run.result.n_steps
    return Row(
        "parts", f"{scheme}, {name}", name, error, run.warm, run.result.energy_error, steps,
        steps * dem.SCHEMES[scheme].evaluations, run.cold, run.result.dt,
    )  # fmt: skip


def _part_sentence(rows: tuple[Row, ...], scheme: str) -> str:
    found = [row for row in rows if row.method.startswith(f"{scheme},")]
    bare = found[0].seconds
    said = (f"{row.parameter} {row.seconds / bare:.2f}" for row in found[1:])
    return f"{scheme}, time over that of the bare chain at the same step: " + ", ".join(said)
