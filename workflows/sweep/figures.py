"""Pictures of an output over the keys of a sweep: a curve, a map, or points."""

import numpy as np

from workflows.files.run_folder import Picture
from workflows.report.plots import Line, Panel, heat_map, outlined_map, panels, png, subplots
from workflows.scene import InvalidScene

ENDINGS = (("_m_s", "m/s", 1.0), ("_s", "\N{MICRO SIGN}s", 1e6), ("_N", "N", 1.0))
FEW = 8  # curves in one plot
COLUMNS = 3  # of panels
Array = np.ndarray


def picture(name: str, y: Array, keys: dict[str, Array]) -> Picture:
    """An output y (n_cases,) over one or more keys, each with a value per case.

    Raises InvalidScene where no case has the output.
    """
    there = np.isfinite(y)
    if not there.any():
        raise InvalidScene(f"no case has a {name}; choose another output.")
    title, scale = _label(name)
    y, keys = scale * y[there], {key: values[there] for key, values in keys.items()}
    numeric = [key for key in keys if keys[key].dtype.kind in "fiu"]
    if len(keys) == 1 and numeric:
        return Picture(name, panels([_curve(title, y, *keys.items())]))
    if len(keys) == 2 and _is_grid(*keys.values()):
        return Picture(name, _grid(title, y, keys, numeric))
    shown = [_points(title, y, key, keys[key]) for key in keys]
    return Picture(name, panels(shown, columns=min(COLUMNS, len(shown)), size=(4, 3)))


def face_map(name: str, y: Array, columns: dict[str, Array], face: dict) -> Picture:
    """An output at the points of a face, on a picture of the face; points without it stay blank.

    Raises InvalidScene where no point has the output.
    """
    title, scale = _label(name)
    if not np.isfinite(y).any():
        raise InvalidScene(f"no point has a {name}; choose another output.")
    edges = 1e3 * np.array(face["edges"])
    ends = np.stack([edges.min(axis=(0, 1)), edges.max(axis=(0, 1))])
    across = (1e3 * np.unique(columns[axis]) for axis in face["axes"])
    borders = [_borders(x, *limits) for x, limits in zip(across, ends.T, strict=True)]
    values = scale * y.reshape(len(borders[0]) - 1, len(borders[1]) - 1)
    names = (f"{title}, {face['name']}", *(f"{axis} from the middle [mm]" for axis in face["axes"]))
    return Picture(name, outlined_map(borders, values, edges, names, title))


def _borders(values: Array, low: float, high: float) -> Array:
    """Of tiles around values between two ends, half-way from one to the next."""
    return np.concatenate([[low], (values[1:] + values[:-1]) / 2, [high]])


def _label(name: str) -> tuple[str, float]:
    """An output as a person reads it, and the factor to the unit there."""
    quantity, unit, scale = name, "", 1.0
    for ending, shown, factor in ENDINGS:
        if name.endswith(ending):
            quantity, unit, scale = name.removesuffix(ending), f" [{shown}]", factor
            break
    of, _, rest = quantity.removeprefix("sphere_").partition("_")
    if name.startswith("sphere_"):
        words = {"tof": "TOF", "arr": "ARR", "incident": "incident wave"}
        quantity = f"{words.get(rest, f'{rest} wave')} at sphere {of}"
    return f"{quantity.replace('_', ' ')}{unit}", scale


def _curve(name, y, item) -> Panel:
    key, x = item
    order = np.argsort(x, kind="stable")
    return Panel("", key, name, [Line(None, x[order], y[order], "o-")], _spacing(x))


def _points(name, y, key, x) -> Panel:
    if x.dtype.kind not in "fiu":
        x = np.unique(x, return_inverse=True)[1].astype(float)
    return Panel("", key, name, [Line(None, x, y, "o", width=0.0)], _spacing(x))


def _spacing(x: Array) -> str:
    """A logarithmic axis for values whose middle one is nearer to where it is on such an axis."""
    x = np.unique(x)
    if x.size < 3 or x[0] <= 0 or x[-1] / x[0] <= 30:
        return ""
    between = np.sqrt(np.sqrt(x[0] * x[-1]) * (x[0] + x[-1]) / 2)
    return "x" if np.median(x) < between else ""


def _is_grid(a: Array, b: Array) -> bool:
    pairs = len(set(zip(a.tolist(), b.tolist(), strict=True)))
    return pairs == len(np.unique(a)) * len(np.unique(b)) == len(a)


def _grid(name, y, keys, numeric) -> bytes:
    (one, a), (two, b) = keys.items()
    rows, columns = np.unique(a), np.unique(b)
    few = two in numeric and len(rows) <= FEW
    values = np.full((len(rows), len(columns)), np.nan)
    values[np.searchsorted(rows, a), np.searchsorted(columns, b)] = y
    if few:
        lines = [Line(_valued(one, r), columns, line) for r, line in zip(rows, values, strict=True)]
        return panels([Panel("", two, name, lines, _spacing(columns), legend="aside")])
    figure, (axis,) = subplots(1, 1, (8, 5))
    labels = [
        [_short(v) if i in _labelled(len(each)) else "" for i, v in enumerate(each)]
        for each in (rows, columns)
    ]
    heat_map(axis, values[::-1], (labels[0][::-1], labels[1]), name, cmap="viridis")
    axis.set_ylabel(one)
    axis.set_xlabel(two)
    return png(figure)


def _labelled(n: int) -> set[int]:
    return set(np.linspace(0, n - 1, min(n, 8)).round().astype(int).tolist())


def _valued(key: str, value) -> str:
    name, _, unit = key.partition(" [")
    return f"{name} = {_short(value)} {unit.removesuffix(']')}".rstrip()


def _short(value) -> str:
    return value if isinstance(value, str) else f"{value:.4g}"
