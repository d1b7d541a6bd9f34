"""The curves of the accuracy studies: error over run time, run time over size."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from beadwave import dem
from beadwave.workflows.evidence.accuracy import peers
from beadwave.workflows.evidence.accuracy.growth import at_one_setting
from beadwave.workflows.evidence.accuracy.row import AccuracyRow
from beadwave.workflows.evidence.accuracy.runs import CONTROLLED
from beadwave.workflows.files.run_folder import Picture
from beadwave.workflows.report.plots import Line, Panel, panels

TARGETS = (1e-4, 1e-6)
SOLVE_IVP = ("RK45", "DOP853", "LSODA", "Radau")
DRAWN = ("verlet", "rkn4", "rkn6", "rkn6a", "suzuki4", "energy4", CONTROLLED)


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


def picture(name: str, rows: Iterable[AccuracyRow], title: str) -> Picture:
    """Error over run time: a curve for each method of DRAWN, for those that are the fastest at
    an error, and for others' integrators."""
    rows = list(rows)
    ours = tuple(dict.fromkeys((*DRAWN, *(ratio.ours.method for ratio in ratios(rows)))))
    lines = []
    for method in (*ours, *peers.peers()):
        runs = sorted((row for row in rows if row.method == method), key=lambda row: -row.setting)
        if runs:
            milliseconds, errors = np.transpose([(1e3 * row.seconds, row.error) for row in runs])
            lines.append(Line(method, milliseconds, errors, *_look(method, ours)))
    panel = Panel(
        title, "run time, warm [ms]", "velocity error, relative to the fastest sphere at the start",
        lines, "xy", (None, 1.0), legend="aside",
    )  # fmt: skip
    return Picture(name, panels([panel], size=(8, 5.2)))


def over_size(name: str, rows: tuple[AccuracyRow, ...], size: str) -> Picture:
    """Times of the methods that were run at all sizes."""
    methods = dict.fromkeys(row.method for row in rows)
    runs = {method: at_one_setting(rows, method) for method in methods}
    n_sizes = max(map(len, runs.values()))
    lines = []
    for method, same in runs.items():
        if len(same) < n_sizes:
            continue
        first = same[0].setting
        ours = method in dem.SCHEMES
        setting = f"step {1e6 * first:.2g} µs" if ours else f"tolerance {first:.0e}"
        sizes = np.array([max(row.parameter, 0.5) for row in same])  # a rigid wall has 0 modes
        milliseconds = np.array([1e3 * row.seconds for row in same])
        lines.append(Line(f"{method}, {setting}", sizes, milliseconds, *_look(method, DRAWN)))
    panel = Panel("", f"number of {size}", "run time, warm [ms]", lines, "xy", legend="aside")
    return Picture(name, panels([panel], size=(8, 5.2)))


def _look(method: str, ours: tuple[str, ...]) -> tuple[str, int | str]:
    """Style and colour of a method's curve: ours full, in colour; others dashed, in greys."""
    if method in ours:
        return "o-", ours.index(method)
    others = list(peers.peers())
    return "o--", str(0.25 + 0.45 * others.index(method) / max(len(others) - 1, 1))
