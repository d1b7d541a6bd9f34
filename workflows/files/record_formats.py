"""Recorded signals from the content of CSV, MATLAB's .mat and UFF58 files.

CSV: lines that start with # are a title; then a header with units and one line per sample:

    time [ms], sphere 1 [mm/s], sphere 4 [mm/s], sphere 1 [mm/s], ...

Semicolons or tabs may stand for the commas; decimals take a point. A sphere that comes twice has
two repeats. A .mat file holds t (k,), v (k, m) or (k, m, repeats), spheres (m,), and the strings
time_unit and velocity_unit. In UFF58 (function type 1) the response node is the sphere, sets of the
same node are repeats, and the labels of the axes are the units. All raise ValueError for content
that cannot be used.
"""

from collections.abc import Callable, Sequence
from re import fullmatch
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

TIME_RESPONSE = 1  # UFF58's function type
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6}
METRES = {"m/s": 1.0, "mm/s": 1e-3, "um/s": 1e-6, "µm/s": 1e-6, "μm/s": 1e-6}

Column = Callable[[str], tuple[Any, float]]  # of a heading: what it holds, and its unit


class Found(NamedTuple):
    """Times (k,) [s], each column's key with its values (k,), and a title that may be empty."""

    t: NDArray[np.float64]
    columns: list[tuple[Any, NDArray[np.float64]]]
    title: str


def of_csv(text: str, column: Column) -> Found:
    """Content of a CSV file; `column` turns a heading into its kind and unit. Raises ValueError; if
    a line is at fault, it names that line by the number that an editor shows."""
    lines = text.splitlines()
    title = " ".join(line.lstrip("# ").strip() for line in lines if line.startswith("#"))
    # lines by their number in the file, as an editor shows it
    numbered = [(n, s) for n, s in enumerate(lines, 1) if s.strip() and not s.startswith("#")]
    if len(numbered) < 2:
        raise ValueError("no samples below a header line")

    # the header: time first, then what `column` reads, all in units that are factors to SI
    (_, first), *samples = numbered
    between = next((mark for mark in ";\t" if mark in first), ",")
    header = [name.strip() for name in first.split(between)]
    time = fullmatch(r"time\s*\[(.+)\]", header[0])
    if not time:
        raise ValueError(
            f"the first column is {header[0][:40]!r}, allowed is 'time [s]', [ms] or [us]"
        )
    scale = [_unit(time[1], SECONDS, "time"), *(column(name) for name in header[1:])]

    rows = []
    for n, line in samples:
        cells = line.split(between)
        if len(cells) != len(header):
            raise ValueError(f"line {n} has {len(cells)} cells, the header has {len(header)}")
        try:
            rows.append([float(cell) if cell.strip() else np.nan for cell in cells])
        except ValueError:
            raise ValueError(
                f"line {n} is not numbers with decimal points: {line[:40]!r}"
            ) from None
    table = np.array(rows)
    if not np.isfinite(table).all():
        row, column = np.argwhere(~np.isfinite(table))[0]
        n, line = samples[row]
        raise ValueError(f"line {n} has no number in the column {header[column]!r}: {line[:40]!r}")
    columns = [(n, unit * table[:, i]) for i, (n, unit) in enumerate(scale[1:], 1)]
    return Found(table[:, 0] * scale[0], columns, title)


def sphere_column(name: str) -> tuple[int, float]:
    """The sphere that a heading names and the unit of its velocities [m/s]; raises ValueError for
    another heading, or another unit."""
    heading = fullmatch(r"sphere\s+(\d+)\s*\[(.+)\]", name)
    if not heading:
        raise ValueError(f"a column is {name[:40]!r}, allowed is 'sphere 4 [m/s]', with its unit")
    return int(heading[1]), _unit(heading[2], METRES, f"sphere {heading[1]}")


def velocities_of_mat(variables: dict) -> Found:
    """The velocities of a .mat file's variables."""
    metre = _unit(text_of(variables, "velocity_unit"), METRES, "v")
    t, columns, title = of_mat(variables, "v")
    return Found(t, [(n, metre * values) for n, values in columns], title)


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


def require_variables(variables: dict, needed: tuple[str, ...]) -> dict:
    """The variables; raises ValueError where one is not there."""
    for name in needed:
        if name not in variables:
            raise ValueError(f"there is no variable {name}, which states what is in the file")
    return variables


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


def of_data_sets(sets: Sequence[dict], column: Column, *, named: bool) -> Found:
    """Content of data sets 58; `column` is given sphere and unit as in a CSV, where they are
    `named` with the quantity that the ordinate's label may say. Raises ValueError without time
    responses, for different time bases and for complex signals."""
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
        # as in a CSV, with the quantity that the ordinate's label may say
        quantity = _label(s, "ordinate_axis_lab").lower() if named else ""
        unit = _label(s, "ordinate_axis_units_lab")
        words = f"sphere {s['rsp_node']}", quantity, f"[{unit}]"
        key, scale = column(" ".join(filter(None, words)))
        columns.append((key, scale * np.asarray(s["data"], float)))
    return Found(second * t, columns, str(sets[0]["id1"]).strip())


def _label(data_set: dict, key: str) -> str:
    text = str(data_set.get(key, "")).strip()
    return "" if text.upper() == "NONE" else text
