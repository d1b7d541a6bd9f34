"""The two CSV files of a network of spheres.

sphere, x [m], y [m], z [m], radius [m], guide_x, guide_y, guide_z
first, second
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from beadwave.dem.kernels.arguments import Array
from beadwave.workflows.files.signal_table import signal_table
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.scene.named_files import require_file

NODES = ("sphere", "x", "y", "z", "radius", "guide_x", "guide_y", "guide_z")
LINKS = ("first", "second")


class Network(NamedTuple):
    """Spheres and pairs of a network."""

    number: np.ndarray  # (s,) of each sphere in its file
    centre: Array  # (s, 3) [m]
    radius: Array  # (s,) [m]
    guide: Array  # (s, 3) direction; 0 where all motions are free
    pairs: np.ndarray  # (c, 2) rows of the spheres


def network(nodes: str, links: str) -> Network:
    """The network of two files.

    Raises InvalidScene for columns that are others, a number that is no sphere's, radii that are
    not above 0, and a pair that is there twice.
    """
    table = _columns("nodes", nodes, NODES)
    number = table[:, 0].astype(np.int64)
    if np.any(number != table[:, 0]) or len(set(number.tolist())) < len(number):
        raise InvalidScene(
            f"crystal.nodes = {nodes!r} must have a whole number of its own for each sphere; "
            "correct the column sphere."
        )
    if not np.all(table[:, 4] > 0.0):
        row = int(np.argmin(table[:, 4] > 0.0))
        raise InvalidScene(
            f"crystal.nodes = {nodes!r}: the radius of sphere {number[row]} is {table[row, 4]:g} m "
            "and must be above 0; correct it."
        )

    ends = _columns("links", links, LINKS)
    row_of = {n: row for row, n in enumerate(number.tolist())}
    pairs = []
    for first, second in ends.tolist():
        for end in (first, second):
            if end not in row_of:
                raise InvalidScene(
                    f"crystal.links = {links!r} names the sphere {end:g}, which crystal.nodes does "
                    "not have; correct one of them."
                )
        pairs.append(tuple(sorted((row_of[first], row_of[second]))))
    twice = {pair for pair in pairs if pairs.count(pair) > 1 or pair[0] == pair[1]}
    if twice:
        i, j = min(twice)
        raise InvalidScene(
            f"crystal.links = {links!r} joins the spheres {number[i]} and {number[j]} twice, or "
            "one with itself; keep each pair of two spheres once."
        )
    return Network(number, table[:, 1:4], table[:, 4], table[:, 5:8], np.array(sorted(pairs)))


def _columns(key: str, file: str, names: tuple[str, ...]) -> Array:
    """The numbers of a CSV whose columns bear these names, units behind them aside."""
    path = require_file(file, "give a CSV", key=f"crystal.{key} = ")
    try:
        table = signal_table(Path(path))
        table.require_columns()
    except ValueError as error:
        raise InvalidScene(f"crystal.{key} = {file!r}: {error}; correct it.") from None
    found = tuple(name.partition("[")[0].strip() for name in table.header)
    if found != names:
        raise InvalidScene(
            f"crystal.{key} = {file!r} has the columns {', '.join(found)}; they must be "
            f"{', '.join(names)}."
        )
    return table.values
