"""Measured velocities in and out: CSV, MATLAB's .mat, and UFF58 through pyuff.

CSV: lines that start with # are a title; then a header with units and one line per sample:

    time [ms], sphere 1 [mm/s], sphere 4 [mm/s], sphere 1 [mm/s], ...

Semicolons or tabs may stand for the commas; decimals take a point. A sphere that comes twice has
two repeats. A .mat file holds t (k,), v (k, m) or (k, m, repeats), spheres (m,), and the strings
time_unit and velocity_unit. In UFF58 (function type 1) the response node is the sphere, sets of the
same node are repeats, and the labels of the axes are the units.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from re import fullmatch
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflows.files.foreign import arrays
from workflows.files.uff import data_sets
from workflows.scene import InvalidScene
from workflows.scene.named_files import require_file

SYNTHETIC = "SYNTHETIC: computed, not measured"
TIME_RESPONSE = 1  # UFF58's function type
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6}
METRES = {"m/s": 1.0, "mm/s": 1e-3, "um/s": 1e-6, "µm/s": 1e-6, "μm/s": 1e-6}
LEAST_SAMPLES = 50
ROUNDING = 0.3  # of a step: what a time base may be off by printing it with few digits


class Record(NamedTuple):
    """Velocities of m spheres, positive towards the wall, in r repeats over k equal times."""

    t: NDArray[np.float64]  # (k,) [s]
    v: NDArray[np.float64]  # (r, k, m) [m/s]
    spheres: tuple[int, ...]  # (m,) counted from 1, ascending
    title: str
    channels: tuple[Any, ...] | None = None  # what v holds where that is no velocities [SI]


def record(path: Path) -> Record:
    """The velocities of a file; raises InvalidScene where it holds none that can be used."""
    read = {".csv": _csv, ".mat": _mat, ".uff": _uff, ".unv": _uff}.get(path.suffix.lower())
    if read is None:
        raise InvalidScene(f"{path} must end in .csv, .mat, .uff or .unv.")
    require_file(path, "give measured velocities as .csv, .mat or .uff")
    with told_of(path):
        t, columns, title = read(path)
        t = equidistant(t)
        spheres, v = stacked(t, columns)
        return Record(t, v, spheres, title)


def read_csv(path: Path, column: Callable[[str], tuple[Any, float]]):
    """t (k,) [s], what m columns hold, their values (r, k, m), and the title of a CSV file.

    `column` makes of a heading what it holds and its unit. Raises InvalidScene.
    """
    if path.suffix.lower() != ".csv":
        raise InvalidScene(f"{path} must end in .csv.")
    require_file(path, "give a record as .csv")
    with told_of(path):
        t, columns, title = _csv(path, column)
        return equidistant(t), *stacked(t, columns), title


@contextmanager
def told_of(path: Path) -> Iterator[None]:
    """What is wrong with a file raised as InvalidScene."""
    try:
        yield
    except InvalidScene:
        raise
    except UnicodeDecodeError:
        raise InvalidScene(f"{path} is no text in UTF-8; save it as such.") from None
    except (ValueError, KeyError, IndexError, TypeError, OSError) as error:
        raise InvalidScene(f"{path}: {str(error).rstrip('.')}; correct the file.") from None


Columns = list[tuple[int, NDArray[np.float64]]]


def _csv(path: Path, column: Callable | None = None) -> tuple[NDArray[np.float64], Columns, str]:
    lines = path.read_text(encoding="utf-8-sig").splitlines()
    title = " ".join(line.lstrip("# ").strip() for line in lines if line.startswith("#"))
    lines = [line for line in lines if line.strip() and not line.startswith("#")]
    if len(lines) < 2:
        raise ValueError("no samples below a header line")
    between = next((mark for mark in ";\t" if mark in lines[0]), ",")
    header = [name.strip() for name in lines[0].split(between)]
    scale = [_time_column(header[0]), *((column or _sphere_column)(name) for name in header[1:])]
    rows = (line.split(between) for line in lines[1:])
    table = np.array([_numbers(i, cells, len(header)) for i, cells in enumerate(rows, 1)])
    columns = [(n, unit * table[:, i]) for i, (n, unit) in enumerate(scale[1:], 1)]
    return table[:, 0] * scale[0], columns, title or path.stem


def _numbers(i: int, cells: list[str], width: int) -> list[float]:
    if len(cells) != width:
        raise ValueError(f"sample {i} has {len(cells)} cells, the header has {width}")
    try:
        return [float(cell) if cell.strip() else np.nan for cell in cells]
    except ValueError:
        found = ";".join(cells)[:40]
        raise ValueError(f"sample {i} is not numbers with decimal points: {found!r}") from None


def _time_column(name: str) -> float:
    found = fullmatch(r"time\s*\[(.+)\]", name)
    if not found:
        raise ValueError(f"the first column is {name[:40]!r}, allowed is 'time [s]', [ms] or [us]")
    return _unit(found[1], SECONDS, "time")


def _sphere_column(name: str) -> tuple[int, float]:
    found = fullmatch(r"sphere\s+(\d+)\s*\[(.+)\]", name)
    if not found:
        raise ValueError(f"a column is {name[:40]!r}, allowed is 'sphere 4 [m/s]', with its unit")
    return int(found[1]), _unit(found[2], METRES, f"sphere {found[1]}")


def _unit(text: str, known: dict[str, float], what: str) -> float:
    text = text.strip()
    if text not in known:
        raise ValueError(f"the unit of {what} is {text!r}, allowed are {', '.join(known)}")
    return known[text]


def _mat(path: Path) -> tuple[NDArray[np.float64], Columns, str]:
    held = _matlab(path, ("t", "v", "spheres", "time_unit", "velocity_unit"))
    metre = _unit(text_of(held, "velocity_unit"), METRES, "v")
    t, columns, title = mat_columns(path, held, "v")
    return t, [(n, metre * values) for n, values in columns], title


def mat_columns(path: Path, held: dict, name: str) -> tuple[NDArray[np.float64], Columns, str]:
    """t (k,) [s], what each sphere has in the variable of this name, and the title."""
    second = _unit(text_of(held, "time_unit"), SECONDS, "t")
    t, v = np.ravel(_numeric(held, "t")), _numeric(held, name)
    spheres = np.ravel(_numeric(held, "spheres"))
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
    return second * t, columns, text_of(held, "title") or path.stem


def _matlab(path: Path, needed: tuple[str, ...]) -> dict:
    """The variables of a .mat file that are asked for."""
    return require_variables(arrays("matlab", path, *needed, "title"), needed)


def require_variables(held: dict, needed: tuple[str, ...]) -> dict:
    """The variables; raises ValueError where one is not there."""
    for name in needed:
        if name not in held:
            raise ValueError(f"there is no variable {name}, which states what is in the file")
    return held


def _numeric(held: dict, name: str) -> NDArray[np.float64]:
    value = held[name]
    if value.dtype.kind not in "fiub":
        raise ValueError(f"{name} is no array of real numbers; cells and structs are not read")
    return value.astype(float)


def text_of(held: dict, name: str) -> str:
    """A variable that is a text; empty where it is none."""
    value = held.get(name)
    is_text = value is not None and value.dtype.kind == "U" and value.size == 1
    return str(value.ravel()[0]) if is_text else ""


def read_uff(path: Path, column: Callable[[str], tuple[Any, float]]):
    """The same of a universal file: a heading is made of node, label and unit of each data set."""
    require_file(path, "give a record as .uff")
    with told_of(path):
        t, columns, title = _uff(path, column)
        return equidistant(t), *stacked(t, columns), title


def _uff(path: Path, column: Callable | None = None) -> tuple[NDArray[np.float64], Columns, str]:
    raw = path.read_bytes()
    if b"58b" not in raw and sum(line.strip() == b"-1" for line in raw.splitlines()) % 2:
        raise ValueError("its last data set has no end, the file is cut off")
    sets = data_sets(path, 58)
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
        key, scale = (column or _sphere_column)(_heading(s, named=column is not None))
        columns.append((key, scale * np.asarray(s["data"], float)))
    return second * t, columns, str(sets[0]["id1"]).strip()


def _heading(data_set: dict, *, named: bool) -> str:
    """As in a CSV, with the quantity that the ordinate's label may say."""
    quantity = _label(data_set, "ordinate_axis_lab").lower() if named else ""
    unit = _label(data_set, "ordinate_axis_units_lab")
    words = f"sphere {data_set['rsp_node']}", quantity, f"[{unit}]"
    return " ".join(filter(None, words))


def _label(data_set: dict, key: str) -> str:
    text = str(data_set.get(key, "")).strip()
    return "" if text.upper() == "NONE" else text


def equidistant(t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Times on an even grid; raises ValueError where they leave it."""
    if not np.isfinite(t).all():
        raise ValueError(f"the time of sample {int(np.argmin(np.isfinite(t))) + 1} is no number")
    if len(t) < LEAST_SAMPLES:
        raise ValueError(f"{len(t)} samples are too few, at least {LEAST_SAMPLES} are needed")
    steps = np.diff(t)
    if not (steps > 0).all():
        raise ValueError(f"time does not grow at sample {int(np.argmin(steps > 0)) + 2}")
    usual = np.median(steps)
    even = np.linspace(t[0], t[-1], len(t))
    if steps.max() > 1.5 * usual:
        i = int(steps.argmax())
        raise ValueError(
            f"a gap of {steps[i] / usual:.3g} steps follows sample {i + 1}, at {t[i]:.6g} s"
        )
    if np.abs(t - even).max() > ROUNDING * usual:
        raise ValueError(
            f"time is not equidistant, steps are {steps.min():.3g} to {steps.max():.3g} s; "
            "resample it"
        )
    return even


def stacked(t: NDArray[np.float64], columns) -> tuple[tuple, NDArray[np.float64]]:
    """What the columns hold, in order, and their values (r, k, m)."""
    each: dict[Any, list] = {}
    for key, values in columns:
        if not np.isfinite(values).all():
            i = int(np.argmin(np.isfinite(values)))
            raise ValueError(f"{_told(key)} has no number at sample {i + 1}, at {t[i]:.6g} s")
        each.setdefault(key, []).append(values)
    if not each:
        raise ValueError("there is no column of a sphere")
    repeats = {key: len(found) for key, found in each.items()}
    if len(set(repeats.values())) > 1:
        told = ", ".join(f"{_told(key)}: {k}" for key, k in repeats.items())
        raise ValueError(f"spheres differ in repeats ({told}), each needs as many")
    keys = tuple(sorted(each))
    return keys, np.array([each[key] for key in keys]).transpose(1, 2, 0)


def _told(key: Any) -> str:
    return getattr(key, "name", f"sphere {key}")


def csv_text(measured: Record) -> str:
    """The record as CSV; `record` reads it back."""
    r, k, m = measured.v.shape
    names = [f"sphere {n} [m/s]" for _ in range(r) for n in measured.spheres]
    table = np.column_stack([measured.t, measured.v.transpose(1, 0, 2).reshape(k, r * m)])
    lines = [",".join([f"{row[0]:.9g}", *(f"{x:.9g}" for x in row[1:])]) for row in table]
    return "\n".join([f"# {measured.title}", ", ".join(["time [s]", *names]), *lines, ""])
