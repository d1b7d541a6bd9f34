"""A chain against beams and plates of one size after the other: time of flight, amplitude ratio.

The first reflected wave leaves when the contact ends. What lies so far away that bending waves
come back later does not change it.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflows.evidence.counted import counted
from workflows.evidence.thesis import bent
from workflows.files.run_folder import Picture
from workflows.report.plots import Line, Panel, panels
from workflows.report.tables import Table
from workflows.scene import Scene
from workflows.stages.progress import Progress

COLUMNS = ("mm", "first_mode_hz", "contact_us", "tof_us", "arr", "peak_N")


class StructuresOptions(NamedTuple):
    """What the studies of one size vary, and what they tell apart."""

    # of the scene's own value, ascending, 1 among them
    factors: NDArray[np.float64] = 2.0 ** np.arange(-2, 2.5, 0.5)
    arr_known: float = 0.01  # relative, to which an instrument tells ARR
    tof_known: float = 0.5e-6  # [s] to which it tells TOF: a sample at 2 MHz
    unchanged: float = 0.01  # relative change of ARR that is none


class StructureCase(NamedTuple):
    """A structure by the value that changes, and what the waves say of it."""

    value: float  # [m]
    first_mode: float  # [Hz]
    contact: float  # [s]
    tof: float  # [s]
    arr: float
    peak: float  # [N]


class Compared(NamedTuple):
    """Scenes that differ in one quantity: their table and picture, and the template's numbers."""

    table: Table
    picture: Picture
    numbers: dict


def compared(
    name: str,
    quantity: str,
    scenes: Sequence[Scene],
    values: Sequence[float],
    progress: Progress,
    options: StructuresOptions,
) -> Compared:
    """Of the study of a name: its scenes by the values [m] of a quantity."""
    cases = []
    for scene, value in counted(
        zip(scenes, values, strict=True),
        progress,
        lambda pair: f"{quantity} {1e3 * pair[1]:.3g} mm",
    ):
        run = bent.run(scene, bent.wall(scene))
        seconds = run.contact.contact_time.seconds
        peak = float(run.trajectory.contact_force[:, -1].max())
        measures = bent.tof_and_arr(run.contact)
        cases.append(StructureCase(value, bent.first_mode(scene), seconds, *measures, peak))
    rows = tuple(
        (1e3 * c.value, c.first_mode, 1e6 * c.contact, 1e6 * c.tof, c.arr, c.peak) for c in cases
    )
    value, contact, tof, arr = (
        np.array([getattr(case, field) for case in cases])
        for field in ("value", "contact", "tof", "arr")
    )

    # slopes d ln y / d ln x at the scene's own value, between its neighbours: what an instrument
    # tells of it
    usual = int(np.argmin(np.abs(np.log(value / value[-1] * options.factors[-1]))))
    x = np.log(value)
    slopes = [
        float((y[usual + 1] - y[usual - 1]) / (x[usual + 1] - x[usual - 1]))
        for y in (np.log(arr), np.log(tof))
    ]

    # the value from which on ARR no longer changes
    same = np.abs(arr / arr[-1] - 1) < options.unchanged
    first_same = len(same) - int(np.argmin(same[::-1])) if not same.all() else 0
    numbers = {
        "quantity": quantity,
        "own": 1e3 * value[usual],
        "arr": arr,
        "tof": 1e6 * tof,
        "arr_known": options.arr_known,
        "tof_known": 1e6 * options.tof_known,
        "by_arr": options.arr_known / abs(slopes[0]) if slopes[0] else float("inf"),
        "by_tof": options.tof_known / tof[usual] / abs(slopes[1]) if slopes[1] else float("inf"),
        "slopes": slopes,
        "same": options.unchanged,
        "unfelt": 1e3 * value[first_same] if first_same < len(value) - 1 else None,
    }

    # what hardly changes stays level: its axis reaches a tenth of the mean to either side
    figure = []
    for title, unit, y in (
        ("amplitude ratio", "ARR [-]", arr),
        ("time of flight", "TOF [µs]", 1e6 * tof),
        ("contact time", "T_c [µs]", 1e6 * contact),
    ):
        mean = float(np.nanmean(y))
        limits = (0.9 * mean, 1.1 * mean) if np.ptp(y) < 0.1 * mean / 4 else None
        line = Line(None, 1e3 * value, y, "o-")
        figure.append(Panel(title, f"{quantity} [mm]", unit, [line], "x", y_limits=limits))
    picture = Picture(f"study_{name.replace('-', '_')}", panels(figure, columns=3, size=(4.2, 3.0)))
    return Compared(Table(name, COLUMNS, rows), picture, numbers)
