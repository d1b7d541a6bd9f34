"""Error against run time of the chain's schemes and of general-purpose integrators.

Errors are the largest difference of the observed velocities to a reference, over all saved times
and relative to the largest initial speed. The reference is a symmetric splitting with a small step;
DOP853 at the limit of its tolerances, its steps held small, must agree with it.
"""

from collections.abc import Callable, Iterable, Iterator
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from beadwave import dem
from beadwave.workflows.evidence.accuracy import peers
from beadwave.workflows.evidence.accuracy.peers import Solver
from beadwave.workflows.evidence.accuracy.problems import Problem
from beadwave.workflows.report.tables import Table

TOLERANCES = tuple(10.0**-k for k in range(3, 12))
ASKED = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)  # errors that march_to_error is given
CONTROLLED = "march_to_error"
FIXED = "rkn6"  # the scheme that is run at one step for all sizes of a chain or a wall
HEADING = ("study", "method", "parameter", "setting", "error", "energy", "steps", "evaluations",
           "warm [ms]", "cold [ms]")  # fmt: skip


class AccuracyRow(NamedTuple):
    """One run: its cost and its error; None where it does not apply."""

    study: str
    method: str
    parameter: float | str  # step [s], tolerance, spheres, wall modes
    error: float | None  # largest velocity error over the largest initial speed
    seconds: float  # warm, the smallest of some repeats
    energy_error: float | None = None  # largest change over the kinetic energy at the start
    steps: int | None = None
    evaluations: int | None = None  # of all contact forces
    seconds_cold: float | None = None  # the first call in this process
    setting: float | None = None  # step [s] or tolerance where `parameter` is a size


def table_of(rows: tuple[AccuracyRow, ...], *, printed: bool = True) -> Table:
    """The table `accuracy`; not `printed` where another one shows the same to a person."""
    lines = [HEADING] if printed else []
    for row in rows if printed else ():
        cold = None if row.seconds_cold is None else 1e3 * row.seconds_cold
        lines.append((
            row.study, row.method, row.parameter, row.setting, row.error, row.energy_error,
            row.steps, row.evaluations, 1e3 * row.seconds, cold,
        ))  # fmt: skip
    return Table("accuracy", AccuracyRow._fields, rows, tuple(lines))


class Timed(NamedTuple):
    """A result, the seconds of its first call, and of the quickest of some later ones."""

    result: Any
    warm: float  # [s]
    cold: float  # [s]


def timed(call: Callable[[], Any], *, budget: float = 0.1, repeats: int = 30) -> Timed:
    """Call once, which may compile, then again while the budget [s] lasts."""
    seconds: list[float] = []
    while len(seconds) <= 1 or (len(seconds) <= repeats and sum(seconds[1:]) < budget):
        started = perf_counter()
        result = call()
        seconds.append(perf_counter() - started)
    return Timed(result, min(seconds[1:]), seconds[0])


class ReferenceRun(NamedTuple):
    """Velocities of the observed spheres, and how well two methods agree on them."""

    v: np.ndarray  # (k, n_observed) [m/s], by `scheme`
    difference: float  # largest difference of the two, over the largest initial speed
    checked_by: str
    scheme: str = "rkn6a"


def reference(problem: Problem, *, finer: float = 512.0, independent: bool = True) -> ReferenceRun:
    """A march with the stability limit over `finer` as step, and its difference to DOP853, or to
    another splitting where DOP853 would take too long.

    Kicks that depend on velocities (dampers, a dashpot) cost schemes of Nystrom's kind their order:
    such problems take splittings that bear them.
    """
    dashpot = problem.wall is not None and problem.wall.mobility > 0.0
    lossy = problem.chain.dissipation != "none" or dashpot
    scheme, checked_by = ("kahan-li8", "suzuki4") if lossy else ("rkn6a", "kahan-li8")
    truth = observed(problem, marched(problem, scheme, limit(problem, scheme) / finer).v)
    if independent:
        checked_by, v = "DOP853", velocities(problem, peers.reference(problem).y)
    else:
        v = marched(problem, checked_by, limit(problem, checked_by) / finer).v
    return ReferenceRun(truth, relative_error(problem, v, truth), checked_by, scheme)


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
    """Columns (k, n_observed) of the observed spheres, out of v (k, n)."""
    return v[:, problem.observed]


def velocities(problem: Problem, y: np.ndarray) -> np.ndarray:
    """Velocities of all spheres (k, n) out of states y (k, size)."""
    n = problem.v0.size
    return y[:, n : 2 * n]


def relative_error(problem: Problem, v: np.ndarray, truth: np.ndarray) -> float:
    """Largest difference of v (k, n) to the truth (k, n_observed) over the largest initial
    speed."""
    return float(np.abs(observed(problem, v) - truth).max() / np.abs(problem.v0).max())


def scheme_rows(
    study: str,
    problem: Problem,
    truth: ReferenceRun,
    schemes: Iterable[str],
    *,
    parameter: float | None = None,
    halvings: int = 11,
    until: float = 1e-9,
    slow: float = 0.1,
) -> Iterator[AccuracyRow]:
    """Each scheme with its stability limit halved again and again, until the error `until` is
    reached or a run takes `slow` seconds.

    Steps end at the saves: of those much longer than the time between two saves, which would all
    be cut to it, none is tried.
    """
    between_saves = problem.duration / problem.n_save
    for scheme in schemes:
        largest = limit(problem, scheme)
        for dt in (largest / 2.0**k for k in range(1, halvings)):
            if dt > 2.0 * between_saves:
                continue
            try:
                row = scheme_row(study, problem, truth, scheme, dt, parameter)
            except dem.UnstableStep:
                continue  # a refused step has no error to show
            yield row
            if row.error < until or row.seconds > slow:
                break


def scheme_row(
    study: str,
    problem: Problem,
    truth: ReferenceRun,
    scheme: str,
    dt: float,
    parameter: float | str | None = None,
) -> AccuracyRow:
    """One scheme at one step."""
    trajectory, warm, cold = timed(lambda: marched(problem, scheme, dt))
    return AccuracyRow(
        study, scheme, trajectory.dt if parameter is None else parameter,
        relative_error(problem, trajectory.v, truth.v), warm, trajectory.energy_error,
        trajectory.n_steps, trajectory.n_steps * dem.SCHEMES[scheme].evaluations, cold,
        trajectory.dt,
    )  # fmt: skip


def controlled_rows(study: str, problem: Problem, truth: ReferenceRun) -> Iterator[AccuracyRow]:
    """An error is asked for instead of a step; the time holds the search for the step."""
    for error in ASKED:
        (trajectory, report), warm, cold = timed(
            lambda error=error: dem.march_to_error(
                problem.chain,
                problem.wall,
                problem.v0,
                duration=problem.duration,
                error=error,
                observed=problem.observed,
                n_save=problem.n_save,
            )
        )
        yield AccuracyRow(
            study, CONTROLLED, error, relative_error(problem, trajectory.v, truth.v), warm,
            trajectory.energy_error, trajectory.n_steps, report.evaluations, cold,
            trajectory.dt,
        )  # fmt: skip


def peer_rows(
    study: str,
    problem: Problem,
    truth: ReferenceRun,
    solvers: dict[str, Solver],
    *,
    parameter: float | None = None,
    tolerances: tuple[float, ...] = TOLERANCES,
    slow: float = 0.5,
) -> Iterator[AccuracyRow]:
    """Each solver over tolerances, up to the first that takes `slow` seconds or gives up before
    the end."""
    for name, solver in solvers.items():
        for tolerance in tolerances:
            solution, warm, cold = timed(
                lambda solver=solver, tolerance=tolerance: solver(problem, tolerance)
            )
            if len(solution.y) <= problem.n_save:
                break
            yield AccuracyRow(
                study, name, tolerance if parameter is None else parameter,
                relative_error(problem, velocities(problem, solution.y), truth.v), warm,
                peers.energy_error(problem, solution.y), solution.steps, solution.evaluations,
                cold, tolerance,
            )  # fmt: skip
            if warm > slow:
                break
