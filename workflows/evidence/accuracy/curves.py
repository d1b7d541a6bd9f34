"""Conclusions and pictures of the accuracy studies: error over run time, run time over size."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from beadwave import dem
from beadwave.workflows.evidence.accuracy import peers
from beadwave.workflows.evidence.accuracy.runs import CONTROLLED, AccuracyRow
from beadwave.workflows.files.run_folder import Picture
from beadwave.workflows.report.plots import Line, Panel, panels

TARGETS = (1e-4, 1e-6)  # errors at which run times are compared
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


def fastest(rows: Iterable[AccuracyRow], methods: Iterable[str], error: float) -> tuple[str, float]:
    """The method among these that reaches the error in the least time, and this time [s]."""
    rows = list(rows)
    times = {
        method: seconds_at((row for row in rows if row.method == method), error)
        for method in methods
    }
    return min(times.items(), key=lambda pair: pair[1])


def ratios(rows: tuple[AccuracyRow, ...], scene: str) -> list[str]:
    """Sentences on the fastest of our schemes at each error, and on the fastest of each kind of
    other methods: solve_ivp, older codes and SUNDIALS; a kind of which none reaches the error is
    left out."""
    older = [name for name in peers.SCIPY if name not in SOLVE_IVP]
    sentences = []
    for error in TARGETS:
        ours, seconds = fastest(rows, dem.SCHEMES, error)
        words = f"{scene}, velocity error {error:g}: {ours} takes {1e3 * seconds:.3g} ms"
        for kind in (SOLVE_IVP, older, peers.SUNDIALS):
            method, theirs = fastest(rows, kind, error)
            if np.isfinite(theirs):
                times = f"{theirs / seconds:.0f} times as long"
                words += f", {method} {1e3 * theirs:.3g} ms ({times})"
        sentences.append(words + ".")
    return sentences


class TimeGrowth(NamedTuple):
    """seconds = fixed + each * size, and the exponent with which seconds - fixed grows."""

    fixed: float  # [s]
    each: float  # [s] for one sphere or mode more
    exponent: float


def growth(size: Iterable[float], seconds: Iterable[float]) -> TimeGrowth:
    """The straight line nearest in relative error, through 0 or above; the exponent is of the sizes
    whose time is well above the fixed one, nan where fewer than two are."""
    size, seconds = np.array(list(size), float), np.array(list(seconds))
    terms = np.column_stack([1.0 / seconds, size / seconds])
    fixed, each = nnls(terms, np.ones(size.size))[0]
    above = seconds > 1.3 * fixed
    exponent = slope(size[above], seconds[above] - fixed) if above.sum() > 1 else np.nan
    return TimeGrowth(float(fixed), float(each), exponent)


def slope(x: Iterable[float], y: Iterable[float]) -> float:
    """Slope of log y over log x by least squares."""
    return float(np.polyfit(np.log(list(x)), np.log(list(y)), 1)[0])


def at_one_setting(rows: Iterable[AccuracyRow], method: str) -> list[AccuracyRow]:
    """One row for each size, the first: the same setting for all."""
    first = {}
    for row in rows:
        if row.method == method:
            first.setdefault(row.parameter, row)
    return [first[size] for size in sorted(first)]


def picture(name: str, rows: Iterable[AccuracyRow], title: str) -> Picture:
    """Error over run time: a curve for each method of DRAWN, for those that are the fastest at
    an error, and for others' integrators."""
    rows = list(rows)
    ours = tuple(dict.fromkeys((*DRAWN, *(fastest(rows, dem.SCHEMES, e)[0] for e in TARGETS))))
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
