"""Which method reaches an error in the least time."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

import dem
from workflows.evidence.accuracy import peers
from workflows.evidence.accuracy.row import AccuracyRow

TARGETS = (1e-4, 1e-6)
SOLVE_IVP = ("RK45", "DOP853", "LSODA", "Radau")


def seconds_at(rows: Iterable[AccuracyRow], error: float) -> float:
    """Time [s] at which a method reaches an error, by a log-log line between two of its runs; inf
    where none is as exact."""
    best, coarse = np.inf, None
    for fine in sorted(rows, key=lambda row: row.seconds):
        if not fine.error < best:
            continue  # a faster run is as exact
        best = fine.error
        if fine.error > error:
            coarse = fine
            continue
        if coarse is None or fine.error <= 0.0:
            return fine.seconds
        share = np.log(coarse.error / error) / np.log(coarse.error / fine.error)
        return float(coarse.seconds * (fine.seconds / coarse.seconds) ** share)
    return np.inf


class Fastest(NamedTuple):
    """The method that reaches an error in the least time."""

    method: str
    seconds: float


def fastest(rows: Iterable[AccuracyRow], methods: Iterable[str], error: float) -> Fastest:
    """The method among these that reaches the error in the least time."""
    runs = {method: [] for method in methods}
    for row in rows:
        if row.method in runs:
            runs[row.method].append(row)
    times = [Fastest(method, seconds_at(same, error)) for method, same in runs.items()]
    return min(times, key=lambda fastest: fastest.seconds)


class Ratio(NamedTuple):
    """The fastest of our schemes at an error, and the fastest of each kind of other methods."""

    error: float
    ours: Fastest
    others: tuple[Fastest, ...]


def ratios(rows: tuple[AccuracyRow, ...]) -> tuple[Ratio, ...]:
    """Who reaches each of the errors in the least time: solve_ivp, older codes and SUNDIALS are
    kinds of their own, and a kind of which none reaches the error is left out."""
    older = [name for name in peers.SCIPY if name not in SOLVE_IVP]
    by_error = []
    for error in TARGETS:
        others = [fastest(rows, kind, error) for kind in (SOLVE_IVP, older, peers.SUNDIALS)]
        reached = tuple(peer for peer in others if np.isfinite(peer.seconds))
        by_error.append(Ratio(error, fastest(rows, dem.SCHEMES, error), reached))
    return tuple(by_error)
