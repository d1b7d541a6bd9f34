"""Error against run time of the chain's schemes and of general-purpose integrators.

Errors are the largest difference of the observed velocities to a reference, over all saved times
and relative to the largest initial speed. The reference is a symmetric splitting with a small step;
DOP853 at the limit of its tolerances, its steps held small, must agree with it.
"""

from collections.abc import Callable, Iterable, Iterator
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

import dem
from coupling import peers
from coupling.peers import Problem, Solver
from workflows.files.run_folder import Picture
from workflows.results.plots import Line, Panel, panels
from workflows.studies.accuracy.rows import Row

TARGETS = (1e-4, 1e-6)
TOLERANCES = tuple(10.0**-k for k in range(3, 12))
ASKED = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
CONTROLLED = "march_to_error"
DRAWN = ("verlet", "rkn4", "rkn6", "rkn6a", "suzuki4", "energy4", CONTROLLED)
FIXED = "rkn6"  # what sizes are compared with, at one step for all
PEER_TOLERANCE = 1e-8
SOLVE_IVP = ("RK45", "DOP853", "LSODA", "Radau")
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


def seconds_at(rows: Iterable[Row], error: float) -> float:
    """Time at an error, between two runs on a log-log line; inf where none is as exact."""
    before = None
    for row in _front(rows):
        if row.error <= error:
            return row.seconds if before is None else _between(before, row, error)
        before = row
    return np.inf


def _front(rows: Iterable[Row]) -> Iterator[Row]:
    """Runs that none is faster and more exact than, fastest first."""
    best = np.inf
    for row in sorted(rows, key=lambda row: row.seconds):
        if row.error < best:
            best = row.error
            yield row


def _between(coarse: Row, fine: Row, error: float) -> float:
    if fine.error <= 0.0:
        return fine.seconds
    share = np.log(coarse.error / error) / np.log(coarse.error / fine.error)
    return float(coarse.seconds * (fine.seconds / coarse.seconds) ** share)


class Fastest(NamedTuple):
    """The method that reaches an error first."""

    method: str
    seconds: float


def fastest(rows: Iterable[Row], methods: Iterable[str], error: float) -> Fastest:
    """The method among these that reaches the error in the least time."""
    runs = {method: [] for method in methods}
    for row in rows:
        if row.method in runs:
            runs[row.method].append(row)
    times = [Fastest(method, seconds_at(found, error)) for method, found in runs.items()]
    return min(times, key=lambda one: one.seconds)


class Ratio(NamedTuple):
    """The fastest of our schemes at an error, and the fastest of each kind of other methods."""

    error: float
    ours: Fastest
    others: tuple[Fastest, ...]


def ratios(rows: tuple[Row, ...]) -> tuple[Ratio, ...]:
    """Who reaches each of the errors in the least time, solve_ivp, older codes and SUNDIALS apart;
    a kind of which none reaches it is left out."""
    older = [name for name in peers.SCIPY if name not in SOLVE_IVP]
    return tuple(_ratio(rows, (SOLVE_IVP, older, peers.SUNDIALS), error) for error in TARGETS)


def _ratio(rows: tuple[Row, ...], kinds: tuple[Iterable[str], ...], error: float) -> Ratio:
    others = (fastest(rows, methods, error) for methods in kinds)
    reached = tuple(one for one in others if np.isfinite(one.seconds))
    return Ratio(error, fastest(rows, dem.SCHEMES, error), reached)


def growth_exponent(size: Iterable[float], seconds: Iterable[float]) -> float:
    """Slope of log seconds over log size by least squares."""
    return float(np.polyfit(np.log(list(size)), np.log(list(seconds)), 1)[0])


def picture(name: str, rows: Iterable[Row], title: str) -> Picture:
    """Error over run time, a curve for each method."""
    rows = list(rows)
    methods = [*DRAWN, *peers.peers()]
    lines = [_line(rows, method) for method in methods]
    panel = Panel(
        title, "run time, warm [ms]", "velocity error, relative to the fastest sphere at the start",
        [line for line in lines if len(line.x)], "xy", (None, 1.0), legend="aside",
    )  # fmt: skip
    return Picture(name, panels([panel], size=(8, 5.2)))


def _line(rows: list[Row], method: str) -> Line:
    runs = sorted((row for row in rows if row.method == method), key=lambda row: -row.setting)
    points = np.array([(1e3 * row.seconds, row.error) for row in runs])
    return Line(method, *points.reshape(-1, 2).T, *look(method))


def look(method: str) -> tuple[str, int | str]:
    """Style and colour of a method's curve: ours full, in colour; others dashed, in greys."""
    if method in DRAWN:
        return "o-", DRAWN.index(method)
    others = list(peers.peers())
    return "o--", str(0.25 + 0.45 * others.index(method) / max(len(others) - 1, 1))
