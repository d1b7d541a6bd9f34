"""Recorded signals of chains in CSV, MATLAB's .mat and UFF58 files, column by column.

CSV: a table of signals with time first and a quantity of a sphere in each other column. A .mat file
holds t (k,), y or v (k, m) or (k, m, repeats), spheres (m,), and the strings time_unit and unit, or
velocity_unit. In UFF58 (function type 1) the response node is the sphere, sets of the same node are
repeats, and the labels of the axes are the units. All raise ValueError for content that cannot be
used.
"""

from collections.abc import Callable, Sequence
from re import fullmatch
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.workflows.files.signal_table import SECONDS, TIME_RESPONSE, SignalTable

Column = Callable[[str], tuple[Any, float]]  # of a heading: what it holds, and its unit


class Found(NamedTuple):
    """Times (k,) [s], each column's key with its values (k,), and a title that may be empty."""

    t: NDArray[np.float64]
    columns: list[tuple[Any, NDArray[np.float64]]]
    title: str


def of_table(table: SignalTable, column: Column) -> Found:
    """Content of a CSV file; `column` turns a heading into its key and its unit."""
    table.require_columns()
    first, *names = table.header
    time = fullmatch(r"time\s*\[(.+)\]", first)
    if not time:
        raise ValueError(f"the first column is {first[:40]!r}, allowed is 'time [s]', [ms] or [us]")
    second = _unit(time[1], SECONDS, "time")
    columns = []
    for name, values in zip(names, table.values.T[1:], strict=True):
        key, unit = column(name)
        columns.append((key, unit * values))
    return Found(second * table.values[:, 0], columns, table.title)


def of_mat(variables: dict, name: str) -> Found:
    """t (k,) [s], what each sphere has in the variable of this name, (k, m) or (k, m, repeats), and
    the title; raises ValueError where shapes do not fit each other."""
    second = _unit(text_of(variables, "time_unit"), SECONDS, "t")
    t, v = np.ravel(_numeric(variables, "t")), _numeric(variables, name)
    spheres = np.ravel(_numeric(variables, "spheres"))
    if np.any(spheres != np.round(spheres)):
        raise ValueError(f"spheres are {spheres.tolist()}, whole numbers are needed")
    wanted = len(t), len(spheres)
    if v.shape == (1, len(t)) and len(spheres) == 1:
        v = v.T
    if v.ndim not in (2, 3) or v.shape[:2] != wanted:
        raise ValueError(
            f"{name} is {v.shape}, {wanted[0]} times of {wanted[1]} spheres are {wanted}"
        )
    v = v.reshape(*wanted, -1)
    repeats = range(v.shape[2])
    columns = [(int(n), v[:, i, r]) for r in repeats for i, n in enumerate(spheres)]
    return Found(second * t, columns, text_of(variables, "title"))


def _numeric(variables: dict, name: str) -> NDArray[np.float64]:
    """A variable as real numbers, in its shape; raises ValueError for cells and structs."""
    value = variables[name]
    if value.dtype.kind not in "fiub":
        raise ValueError(f"{name} is no array of real numbers; cells and structs are not read")
    return value.astype(float)


def _unit(text: str, units: dict[str, float], what: str) -> float:
    """The unit in SI units; raises ValueError for another one than these."""
    text = text.strip()
    if text not in units:
        raise ValueError(f"the unit of {what} is {text!r}, allowed are {', '.join(units)}")
    return units[text]


def text_of(variables: dict, name: str) -> str:
    """A variable that is a text; empty where it is none."""
    value = variables.get(name)
    is_text = value is not None and value.dtype.kind == "U" and value.size == 1
    return str(value.ravel()[0]) if is_text else ""


def require_whole(raw: bytes) -> None:
    """Raise ValueError for a universal file that is cut off."""
    if b"58b" not in raw and sum(line.strip() == b"-1" for line in raw.splitlines()) % 2:
        raise ValueError("its last data set has no end, the file is cut off")


def of_data_sets(sets: Sequence[dict], column: Column) -> Found:
    """Content of data sets 58; `column` is given sphere, quantity and unit as in a CSV, the
    quantity by the ordinate's label. Raises ValueError without time responses, for different time
    bases and for complex signals."""
    sets = [s for s in sets if s["func_type"] == TIME_RESPONSE]
    if not sets:
        raise ValueError("no data set 58 that can be read has a time response (function type 1)")
    t = np.asarray(sets[0]["x"], float)
    if any(len(s["x"]) != len(t) or np.ptp(s["x"] - t) > 1e-9 for s in sets):
        raise ValueError("its signals have different time bases")
    second = _unit(_label(sets[0], "abscissa_axis_units_lab") or "s", SECONDS, "time")
    columns = []
    for s in sets:
        if np.iscomplexobj(s["data"]):
            raise ValueError(f"the signal of node {s['rsp_node']} is complex, real ones are needed")
        quantity = _label(s, "ordinate_axis_lab").lower()
        unit = _label(s, "ordinate_axis_units_lab")
        words = f"sphere {s['rsp_node']}", quantity, f"[{unit}]"
        key, scale = column(" ".join(filter(None, words)))
        columns.append((key, scale * np.asarray(s["data"], float)))
    return Found(second * t, columns, str(sets[0]["id1"]).strip())


def _label(data_set: dict, key: str) -> str:
    text = str(data_set.get(key, "")).strip()
    return "" if text.upper() == "NONE" else text
