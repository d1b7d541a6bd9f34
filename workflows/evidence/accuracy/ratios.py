"""Which method reaches an error in the least time."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

import dem
from workflows.evidence.accuracy import peers
from workflows.evidence.accuracy.row import Row

TARGETS = (1e-4, 1e-6)
SOLVE_IVP = ("RK45", "DOP853", "LSODA", "Radau")


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
