"""Pictures of an output over the keys of a sweep: a curve, a map, or points."""

import numpy as np

from beadwave.workflows.files.run_folder import Picture
from beadwave.workflows.report.plots import (
    Line,
    Panel,
    heat_map,
    outlined_map,
    panels,
    png,
    subplots,
)
from beadwave.workflows.scene import InvalidScene

ENDINGS = (
    ("_m_s", "m/s", 1.0), ("_s", "\N{MICRO SIGN}s", 1e6), ("_N", "N", 1.0), ("_hz", "Hz", 1.0)
)  # fmt: skip
Array = np.ndarray


def picture(name: str, y: Array, keys: dict[str, Array], others: dict[str, Array]) -> Picture:
    """An output y (n_cases,) over one or more keys, each with a value per case. `others` are the
    keys that vary besides: over one key there is a curve for each of their values.

    Raises InvalidScene where no case has the output.
    """
    finite = np.isfinite(y)
    if not finite.any():
        raise InvalidScene(f"no case has a {name}; choose another output.")
    title, scale = _label(name)
    y, keys = scale * y[finite], {key: values[finite] for key, values in keys.items()}
    others = {key: values[finite] for key, values in others.items()}
    numeric = [key for key in keys if keys[key].dtype.kind in "fiu"]

    # one key of numbers: a curve
    if len(keys) == 1 and numeric:
        ((key, x),) = keys.items()
        lines = curves(y, x, others)
        if lines is None:
            lines = [Line(None, x, y, "o", width=0.0)]
        return Picture(name, panels([Panel("", key, title, lines, _spacing(x), legend="aside")]))

    # two keys with every combination: curves or a map
    if len(keys) == 2:
        a, b = keys.values()
        n_pairs = len(set(zip(a.tolist(), b.tolist(), strict=True)))
        if n_pairs == len(np.unique(a)) * len(np.unique(b)) == len(a):
            return Picture(name, _grid(title, y, keys, numeric))

    # otherwise a cloud of points over each key; words are counted off
    clouds = []
    for key, x in keys.items():
        x = x if key in numeric else np.unique(x, return_inverse=True)[1].astype(float)
        clouds.append(Panel("", key, title, [Line(None, x, y, "o", width=0.0)], _spacing(x)))
    return Picture(name, panels(clouds, columns=min(3, len(clouds)), size=(4, 3)))


def curves(y: Array, x: Array, others: dict[str, Array]) -> list[Line] | None:
    """Outputs y (n,) over x (n,), a line with markers at the cases for each of up to 8 combinations
    of the other keys' values; None of more, of which no lines can be told apart."""
    columns = [np.unique(values, return_inverse=True) for values in others.values()]
    ranks = np.array([rank for _, rank in columns], int).reshape(len(columns), len(x))
    combinations = np.unique(ranks, axis=1).T
    if len(combinations) > 8:
        return None
    lines = []
    for combination in combinations:
        of_line = np.flatnonzero((ranks == combination[:, None]).all(axis=0))
        of_line = of_line[np.argsort(x[of_line], kind="stable")]
        name = ", ".join(
            _named(key, values[rank])
            for key, (values, _), rank in zip(others, columns, combination, strict=True)
        )
        lines.append(Line(name or None, x[of_line], y[of_line], "o-"))
    return lines


def face_map(name: str, y: Array, columns: dict[str, Array], face: dict) -> Picture:
    """An output y (n_points,) at the points of a face, on a picture of the face; points without it
    stay blank.

    The points are an even grid, the second axis varying fastest; `face` has its name, its two axes
    and its edges (m, 2, 2) [m]. Raises InvalidScene where no point has the output.
    """
    title, scale = _label(name)
    if not np.isfinite(y).any():
        raise InvalidScene(f"no point has a {name}; choose another output.")
    edges = 1e3 * np.array(face["edges"])
    ends = np.stack([edges.min(axis=(0, 1)), edges.max(axis=(0, 1))])

    # a tile around each point, its borders half-way to the next one or at the end of the face
    borders = []
    for axis, (low, high) in zip(face["axes"], ends.T, strict=True):
        x = 1e3 * np.unique(columns[axis])
        borders.append(np.concatenate([[low], (x[1:] + x[:-1]) / 2, [high]]))
    values = scale * y.reshape(len(borders[0]) - 1, len(borders[1]) - 1)
    names = (f"{title}, {face['name']}", *(f"{axis} from the middle [mm]" for axis in face["axes"]))
    return Picture(name, outlined_map(borders, values, edges, names, title))


def _label(name: str) -> tuple[str, float]:
    """An output as a person reads it, and the factor to the unit there."""
    quantity, unit, scale = name, "", 1.0
    for ending, symbol, factor in ENDINGS:
        if name.endswith(ending):
            quantity, unit, scale = name.removesuffix(ending), f" [{symbol}]", factor
            break
    if name.startswith("sphere_"):
        sphere, _, wave = quantity.removeprefix("sphere_").partition("_")
        words = {"echo_delay": "echo delay", "echo_ratio": "echo ratio"}
        quantity = f"{words.get(wave, f'{wave} wave')} at sphere {sphere}"
    return f"{quantity.replace('_', ' ')}{unit}", scale


def _spacing(x: Array) -> str:
    """A logarithmic axis for values whose middle one is nearer to where it is on such an axis."""
    x = np.unique(x)
    if x.size < 3 or x[0] <= 0 or x[-1] / x[0] <= 30:
        return ""
    between = np.sqrt(np.sqrt(x[0] * x[-1]) * (x[0] + x[-1]) / 2)
    return "x" if np.median(x) < between else ""


def _grid(title: str, y: Array, keys: dict[str, Array], numeric: list[str]) -> bytes:
    """Every combination of two keys: curves over the second for up to 8 values of the first, or a
    map."""
    (row_key, a), (column_key, b) = keys.items()
    rows, columns = np.unique(a), np.unique(b)
    values = np.full((len(rows), len(columns)), np.nan)
    values[np.searchsorted(rows, a), np.searchsorted(columns, b)] = y
    if column_key in numeric and len(rows) <= 8:
        lines = [
            Line(_named(row_key, row), columns, line, "o-")
            for row, line in zip(rows, values, strict=True)
        ]
        return panels([Panel("", column_key, title, lines, _spacing(columns), legend="aside")])

    # up to 8 labels along each side
    labels = []
    for side in (rows, columns):
        places = np.linspace(0, len(side) - 1, min(len(side), 8)).round().astype(int).tolist()
        labels.append([_short(value) if i in places else "" for i, value in enumerate(side)])
    figure, (axis,) = subplots(1, 1, (8, 5))
    heat_map(axis, values[::-1], (labels[0][::-1], labels[1]), title, cmap="viridis")
    axis.set_ylabel(row_key)
    axis.set_xlabel(column_key)
    return png(figure)


def _named(key: str, value: float | str) -> str:
    """A key with its value as a legend has it: "wall.mass [kg]" and 3.0 as "wall.mass = 3 kg"."""
    name, _, unit = key.partition(" [")
    return f"{name} = {_short(value)} {unit.removesuffix(']')}".rstrip()


def _short(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.4g}"
