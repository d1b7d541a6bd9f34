"""The curves of the accuracy studies: error over run time, run time over size."""

from collections.abc import Iterable

import numpy as np

import dem
from workflows.evidence.accuracy import peers
from workflows.evidence.accuracy.growth import at_one_setting
from workflows.evidence.accuracy.ratios import ratios
from workflows.evidence.accuracy.row import Row
from workflows.evidence.accuracy.runs import CONTROLLED
from workflows.files.run_folder import Picture
from workflows.report.plots import Line, Panel, panels

DRAWN = ("verlet", "rkn4", "rkn6", "rkn6a", "suzuki4", "energy4", CONTROLLED)


def picture(name: str, rows: Iterable[Row], title: str) -> Picture:
    """Error over run time: a curve for each method of DRAWN, for those that are the fastest at
    an error, and for others' integrators."""
    rows = list(rows)
    ours = tuple(dict.fromkeys((*DRAWN, *(ratio.ours.method for ratio in ratios(rows)))))
    lines = [_line(rows, method, ours) for method in (*ours, *peers.peers())]
    panel = Panel(
        title, "run time, warm [ms]", "velocity error, relative to the fastest sphere at the start",
        [line for line in lines if len(line.x)], "xy", (None, 1.0), legend="aside",
    )  # fmt: skip
    return Picture(name, panels([panel], size=(8, 5.2)))


def _line(rows: list[Row], method: str, ours: tuple[str, ...]) -> Line:
    runs = sorted((row for row in rows if row.method == method), key=lambda row: -row.setting)
    points = np.array([(1e3 * row.seconds, row.error) for row in runs])
    return Line(method, *points.reshape(-1, 2).T, *_look(method, ours))


def _look(method: str, ours: tuple[str, ...]) -> tuple[str, int | str]:
    """Style and colour of a method's curve: ours full, in colour; others dashed, in greys."""
    if method in ours:
        return "o-", ours.index(method)
    others = list(peers.peers())
    return "o--", str(0.25 + 0.45 * others.index(method) / max(len(others) - 1, 1))


def over_size(name: str, rows: tuple[Row, ...], size: str) -> Picture:
    """Times of the methods that were run at all sizes."""
    methods = dict.fromkeys(row.method for row in rows)
    runs = {method: at_one_setting(rows, method) for method in methods}
    longest = max(map(len, runs.values()))
    lines = [
        Line(
            f"{method}, {_setting(found[0])}",
            np.array([max(row.parameter, 0.5) for row in found]),
            np.array([1e3 * row.seconds for row in found]),
            *_look(method, DRAWN),
        )
        for method, found in runs.items()
        if len(found) == longest
    ]
    panel = Panel("", f"number of {size}", "run time, warm [ms]", lines, "xy", legend="aside")
    return Picture(name, panels([panel], size=(8, 5.2)))


def _setting(row: Row) -> str:
    if row.method in dem.SCHEMES:
        return f"step {1e6 * row.setting:.2g} µs"
    return f"tolerance {row.setting:.0e}"
