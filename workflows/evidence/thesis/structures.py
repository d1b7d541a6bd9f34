"""A chain against beams and plates of one size after the other: time of flight, amplitude ratio.

The first reflected wave leaves when the contact ends. What lies so far away that bending waves
come back later does not change it.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from workflows.evidence.thesis import bent
from workflows.files.run_folder import Picture
from workflows.report.plots import Line, Panel, panels
from workflows.report.tables import Table
from workflows.scene import Scene
from workflows.stages.pipeline import Progress

FACTORS = 2.0 ** np.arange(-2, 2.5, 0.5)  # of the scene's own value, which is the fifth
ARR_KNOWN, TOF_KNOWN = 0.01, 0.5e-6  # relative; [s] a sample at 2 MHz
SAME = 0.01  # relative change of ARR that is none
LEVEL = 0.1  # of a value: an axis at least so wide to either side
COLUMNS = ("mm", "first_mode_hz", "contact_us", "tof_us", "arr", "peak_N")


class Case(NamedTuple):
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
    name: str, quantity: str, scenes: Sequence[Scene], values: Sequence[float], progress: Progress
) -> Compared:
    """Of the study of a name: its scenes by the values [m] of a quantity."""
    cases = []
    for scene, value in zip(scenes, values, strict=True):
        with progress(f"{quantity} {1e3 * value:.3g} mm"):
            cases.append(_case(scene, value))
    rows = tuple(
        (1e3 * c.value, c.first_mode, 1e6 * c.contact, 1e6 * c.tof, c.arr, c.peak) for c in cases
    )
    picture = Picture(f"study_{name.replace('-', '_')}", _picture(quantity, cases))
    return Compared(Table(name, COLUMNS, rows), picture, {"quantity": quantity, **_numbers(cases)})


def _case(scene: Scene, value: float) -> Case:
    run = bent.run(scene, bent.wall(scene))
    seen = run.contact
    peak = float(run.trajectory.contact_force[:, -1].max())
    number = (float("nan") if x is None else x for x in (seen.tof, seen.arr))
    return Case(value, bent.first_mode(scene), seen.contact_time.seconds, *number, peak)


def _numbers(cases: list[Case]) -> dict:
    """What the sentences need: slopes at the scene's own value, and from where nothing changes."""
    values, tof, arr = (np.array([getattr(c, k) for c in cases]) for k in ("value", "tof", "arr"))
    own = int(np.argmin(np.abs(np.log(values / values[-1] * FACTORS[-1]))))
    slopes = [bent.slope(values, y, own) for y in (arr, tof)]
    same = np.abs(arr / arr[-1] - 1) < SAME
    first_same = len(same) - int(np.argmin(same[::-1])) if not same.all() else 0
    return {
        "own": 1e3 * values[own],
        "arr": arr,
        "tof": 1e6 * tof,
        "arr_known": ARR_KNOWN,
        "tof_known": 1e6 * TOF_KNOWN,
        "by_arr": ARR_KNOWN / abs(slopes[0]) if slopes[0] else float("inf"),
        "by_tof": TOF_KNOWN / tof[own] / abs(slopes[1]) if slopes[1] else float("inf"),
        "slopes": slopes,
        "same": SAME,
        "unfelt": 1e3 * values[first_same] if first_same < len(values) - 1 else None,
    }


def _wide(y: list[float]) -> tuple[float, float] | None:
    """Limits that leave what hardly changes level; None where the axis is to show all of it."""
    middle = float(np.nanmean(y))
    return ((1 - LEVEL) * middle, (1 + LEVEL) * middle) if np.ptp(y) < LEVEL * middle / 4 else None


def _picture(quantity: str, cases: list[Case]) -> bytes:
    x, label = 1e3 * np.array([c.value for c in cases]), f"{quantity} [mm]"
    each = (
        ("amplitude ratio", "ARR [-]", [c.arr for c in cases]),
        ("time of flight", "TOF [µs]", [1e6 * c.tof for c in cases]),
        ("contact time", "T_c [µs]", [1e6 * c.contact for c in cases]),
    )
    sets = [Panel(title, label, unit, [Line(None, x, np.array(y), "o-")], "x", y_limits=_wide(y))
            for title, unit, y in each]  # fmt: skip
    return panels(sets, columns=3, size=(4.2, 3.0))
