"""Error against run time of the chain's schemes and of general-purpose integrators.

Errors are the largest difference of the observed velocities to a reference, over all saved times
and relative to the largest initial speed. The reference is a symmetric splitting with a small step;
DOP853 at the limit of its tolerances, its steps held small, must agree with it.
"""

from collections.abc import Callable, Iterable, Iterator
from time import perf_counter, process_time
from typing import Any, NamedTuple

import numpy as np

import dem
from workflows.evidence.accuracy import peers
from workflows.evidence.accuracy.peers import Problem, Solver
from workflows.evidence.accuracy.row import Row

TOLERANCES = tuple(10.0**-k for k in range(3, 12))
ASKED = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
CONTROLLED = "march_to_error"
SLOW = 0.5  # [s], beyond which a method's tolerance is not tightened further


class Timed(NamedTuple):
    """A result, the least time of some calls and that of the first."""

    result: Any
    warm: float
    cold: float


class Reference(NamedTuple):
    """Velocities of the observed spheres (k, n_observed) and how well two methods agree on them."""

    v: np.ndarray
    difference: float
    other: str
    one: str = "rkn6a"


def timed(call: Callable[[], Any], *, budget: float = 0.1, repeats: int = 30) -> Timed:
    """Call once, which may compile, then again while the budget [s] lasts."""
    result, cold = _clocked(call)
    times: list[float] = []
    while len(times) < repeats and sum(times) < budget:
        times.append(_clocked(call)[1])
    return Timed(result, min(times), cold)


def _clocked(call: Callable[[], Any]) -> tuple[Any, float]:
    started = perf_counter()
    result = call()
    return result, perf_counter() - started


def reference(problem: Problem, *, finer: float = 512.0, independent: bool = True) -> Reference:
    """The finest march; its difference to DOP853, or to another splitting for very long chains."""
    name, other = ("kahan-li8", "suzuki4") if lossy(problem) else ("rkn6a", "kahan-li8")
    one = observed(problem, marched(problem, name, limit(problem, name) / finer).v)
    if independent:
        other, v = "DOP853", velocities(problem, peers.reference(problem).y)
    else:
        v = marched(problem, other, limit(problem, other) / finer).v
    return Reference(one, relative_error(problem, v, one), other, name)


def lossy(problem: Problem) -> bool:
    """Whether kicks depend on velocities, which schemes of Nystrom's kind lose their order to."""
    dashpot = problem.wall is not None and problem.wall.mobility > 0.0
    return problem.chain.dissipation != "none" or dashpot


def limit(problem: Problem, scheme: str) -> float:
    """Largest stable step [s]; the implicit schemes are given that of velocity Verlet."""
    scheme = "verlet" if dem.SCHEMES[scheme].kind == "implicit" else scheme
    return dem.stability_limit(problem.chain, problem.wall, problem.v0, scheme=scheme)


def marched(problem: Problem, scheme: str, dt: float) -> dem.Trajectory:
    """The problem with a given scheme and step."""
    return dem.march(
        problem.chain,
        problem.wall,
        problem.v0,
        duration=problem.duration,
        dt=dt,
        scheme=scheme,
        n_save=problem.n_save,
    )


def observed(problem: Problem, v: np.ndarray) -> np.ndarray:
    """Columns of the observed spheres."""
    return v[:, problem.observed]


def velocities(problem: Problem, y: np.ndarray) -> np.ndarray:
    """Velocities of all spheres (k, n) out of states y."""
    n = problem.v0.size
    return y[:, n : 2 * n]


def relative_error(problem: Problem, v: np.ndarray, truth: np.ndarray) -> float:
    """Largest difference over the largest initial speed."""
    return float(np.abs(observed(problem, v) - truth).max() / np.abs(problem.v0).max())


def scheme_rows(
    study: str,
    problem: Problem,
    truth: Reference,
    schemes: Iterable[str],
    *,
    parameter: float | None = None,
    halvings: int = 11,
    until: float = 1e-9,
) -> Iterator[Row]:
    """Each scheme with its stability limit halved again and again, until the error is reached.

    Steps end at the saves, so that of the longest only one is tried.
    """
    longest = problem.duration / problem.n_save
    for scheme in schemes:
        largest = limit(problem, scheme)
        for dt in (largest / 2.0**k for k in range(1, halvings)):
            if dt > 2.0 * longest:
                continue
            try:
                row = scheme_row(study, problem, truth, scheme, dt, parameter)
            except dem.UnstableStep:
                continue  # what it refuses has no error to show
            yield row
            if row.error < until or row.seconds > 0.1:
                break


def scheme_row(
    study: str,
    problem: Problem,
    truth: Reference,
    scheme: str,
    dt: float,
    parameter: float | None = None,
) -> Row:
    """One scheme at one step."""
    run = timed(lambda: marched(problem, scheme, dt))
    found = run.result
    return Row(
        study, scheme, found.dt if parameter is None else parameter,
        relative_error(problem, found.v, truth.v), run.warm, found.energy_error,
        found.n_steps, found.n_steps * dem.SCHEMES[scheme].evaluations, run.cold, found.dt,
    )  # fmt: skip


def controlled_rows(study: str, problem: Problem, truth: Reference) -> Iterator[Row]:
    """Error asked for instead of a step; the time holds the search for it."""
    for asked in ASKED:
        run = timed(lambda asked=asked: _controlled(problem, asked))
        found, report = run.result
        yield Row(
            study, CONTROLLED, asked, relative_error(problem, found.v, truth.v), run.warm,
            found.energy_error, found.n_steps, report.evaluations, run.cold, found.dt,
        )  # fmt: skip


def _controlled(problem: Problem, error: float) -> dem.Controlled:
    return dem.march_to_error(
        problem.chain,
        problem.wall,
        problem.v0,
        duration=problem.duration,
        error=error,
        observed=problem.observed,
        n_save=problem.n_save,
    )


def peer_rows(
    study: str,
    problem: Problem,
    truth: Reference,
    solvers: dict[str, Solver],
    *,
    parameter: float | None = None,
    tolerances: tuple[float, ...] = TOLERANCES,
) -> Iterator[Row]:
    """Each solver over tolerances, up to the first that is slow or gives up on the way."""
    for name, solver in solvers.items():
        for tolerance in tolerances:
            run = timed(lambda solver=solver, tolerance=tolerance: solver(problem, tolerance))
            if len(run.result.y) <= problem.n_save:
                break
            yield _peer_row(study, problem, truth, name, tolerance, parameter, run)
            if run.warm > SLOW:
                break


def _peer_row(
    study: str,
    problem: Problem,
    truth: Reference,
    name: str,
    tolerance: float,
    parameter: float | None,
    run: Timed,
) -> Row:
    found = run.result
    return Row(
        study, name, tolerance if parameter is None else parameter,
        relative_error(problem, velocities(problem, found.y), truth.v), run.warm,
        peers.energy_error(problem, found.y), found.steps, found.evaluations, run.cold, tolerance,
    )  # fmt: skip


def least_seconds(calls: tuple[Callable[[], object], ...], repeats: int) -> list[float]:
    """Processor seconds of the quickest of some runs of every call, the calls in turns."""
    best = [np.inf] * len(calls)
    for _ in range(repeats):
        for i, call in enumerate(calls):
            started = process_time()
            call()
            best[i] = min(best[i], process_time() - started)
    return best
