"""Lattices of equal spheres: square and hexagonal in the plane, sc, bcc, fcc, hcp in space, and the
Y of a stem and two branches.

Rows follow each other along the axis of the impact: y in the plane, z in space, where a row is a
layer. Spheres are numbered row by row, the struck row first. Close-packed layers lie across [111]
of fcc, in the order ABC, and in the order AB of hcp; layers of bcc lie across [001].
"""

from itertools import product
from typing import NamedTuple

import numpy as np

from beadwave.dem.checks import InvalidChain
from beadwave.dem.kernels.arguments import Array
from beadwave.dem.space.kernel import Numbers

ROOT3 = np.sqrt(3.0)
CLOSE = 1e-6  # of a diameter: centres so near to it touch


class Lattice(NamedTuple):
    """Centres of touching spheres of diameter 1, and what lies beyond the sides."""

    centre: Array  # (s, 3)
    place: Numbers  # (s, d) place of each sphere: column, row; or column, column, layer
    period: Array  # (n_periods, 3) over which sides repeat, none of free sides
    axis: int  # of the impact
    guide: Array | None = None  # (s, 3) direction of a line guide


# shifts of the rows in turn, spacing of the rows, spacing of columns; in diameters
_THIRD = (0.5, 0.5 / ROOT3)  # of the next close-packed layer
LAYERS = {
    "square": ([(0.0, 0.0)], 1.0, 1.0),
    "hexagonal": ([(0.0, 0.0), (0.5, 0.0)], ROOT3 / 2.0, 1.0),
    "sc": ([(0.0, 0.0)], 1.0, 1.0),
    "bcc": ([(0.0, 0.0), (1.0 / ROOT3, 1.0 / ROOT3)], 1.0 / ROOT3, 2.0 / ROOT3),
    "fcc": ([(0.0, 0.0), _THIRD, (0.0, 1.0 / ROOT3)], np.sqrt(2.0 / 3.0), 1.0),
    "hcp": ([(0.0, 0.0), _THIRD], np.sqrt(2.0 / 3.0), 1.0),
}
PLANAR = ("square", "hexagonal")
CLOSE_PACKED = ("fcc", "hcp")


def lattice(name: str, size: tuple[int, ...], *, periodic: bool = False) -> Lattice:
    """The lattice of a name with `size` (columns, rows), in space (columns, columns, layers).

    Raises InvalidChain for a period that does not fit: close-packed layers repeat across an even
    number of columns along y.
    """
    shifts, height, width = LAYERS[name]
    if name in PLANAR:
        columns, rows = size
        place = np.array([(i, j) for j in range(rows) for i in range(columns)])
        shift = np.array(shifts)[place[:, 1] % len(shifts), 0]
        centre = np.column_stack(
            [width * place[:, 0] + shift, height * place[:, 1], np.zeros(len(place))]
        )
        period = np.array([[width * columns, 0.0, 0.0]])
        return Lattice(centre, place, period if periodic else period[:0], 1)

    nx, ny, layers = size
    close = name in CLOSE_PACKED
    if periodic and close and ny % 2:
        raise InvalidChain(
            f"size = {list(size)} has {ny} columns along y, which do not repeat in {name}; take an "
            "even number"
        )
    place = np.array([(i, j, k) for k, j, i in product(range(layers), range(ny), range(nx))])
    i, j, k = place.T
    shift = np.array(shifts)[k % len(shifts)]
    across = ROOT3 / 2.0 if close else width
    x = width * i + shift[:, 0] + (0.5 * (j % 2) if close else 0.0)
    centre = np.column_stack([x, across * j + shift[:, 1], height * k])
    period = np.array([[width * nx, 0.0, 0.0], [0.0, across * ny, 0.0]])
    return Lattice(centre, place, period if periodic else period[:0], 2)


def y_chain(stem: int, branch: int, half_angle: float) -> Lattice:
    """A stem along y and two branches at the half angle [degrees] to it, all guided along their
    lines; the branches touch the stem's last sphere. Numbered along the stem, then along the branch
    on the side of x < 0, then the other; places are (number in its part, part).

    Raises InvalidChain at 30 degrees and less, where the first spheres of the branches overlap.
    """
    if not 30.0 < half_angle <= 90.0:
        raise InvalidChain(
            f"half_angle = {half_angle:g} degrees must be above 30, where the first spheres of the "
            "branches touch, and at most 90"
        )
    theta = np.radians(half_angle)
    along = np.array([0.0, 1.0, 0.0])
    sides = [np.array([sign * np.sin(theta), np.cos(theta), 0.0]) for sign in (-1.0, 1.0)]
    centre = [n * along for n in range(stem)]
    centre += [(stem - 1) * along + n * side for side in sides for n in range(1, branch + 1)]
    place = [(n, 0) for n in range(stem)]
    place += [(n, part) for part in (1, 2) for n in range(branch)]
    guide = [along] * stem + [side for side in sides for _ in range(branch)]
    return Lattice(np.array(centre), np.array(place), np.zeros((0, 3)), 1, np.array(guide))


def touching(centre: Array, period: Array, reach: float) -> tuple[Numbers, Array]:
    """Pairs (c, 2) of spheres whose centres (s, 3) are within `reach`, each once, in the order of
    their spheres, and the arms (c, 3) between them; images over the `period` (n, 3) included, also
    a sphere's own."""
    from scipy.spatial import cKDTree  # a tenth of a second

    steps = [np.array(step) for step in product(*[(-1, 0, 1)] * len(period))]
    tree, low, high = cKDTree(centre), centre.min(axis=0) - reach, centre.max(axis=0) + reach
    pairs, arms = [], []
    for step in steps:
        # of two opposite images one; without a shift each pair once
        if next((x for x in step if x), 1) < 0:
            continue
        shift = step @ period if len(period) else np.zeros(3)
        images = np.flatnonzero(((centre + shift >= low) & (centre + shift <= high)).all(axis=1))
        if not images.size:
            continue
        near = tree.sparse_distance_matrix(
            cKDTree(centre[images] + shift), reach, output_type="coo_matrix"
        )
        i, j = near.row, images[near.col]
        once = i < j if not step.any() else np.ones(i.size, bool)
        i, j = i[once], j[once]
        pairs.append(np.column_stack([i, j]))
        arms.append(centre[j] + shift - centre[i])
    found, arm = np.concatenate(pairs).astype(np.int64), np.concatenate(arms)
    order = np.lexsort((*arm.T, found[:, 1], found[:, 0]))
    return found[order], arm[order]


def unit_cell(name: str) -> tuple[Array, int]:
    """Vectors (d, 3) of the cell of a lattice, in diameters, and how many kinds of layers it has:
    those of hcp are two."""
    shifts, height, width = LAYERS[name]
    if name in PLANAR:
        across = shifts[-1][0] if len(shifts) > 1 else 0.0
        return np.array([[width, 0.0, 0.0], [across, height, 0.0]]), 1
    side = [0.5, ROOT3 / 2.0, 0.0] if name in CLOSE_PACKED else [0.0, width, 0.0]
    if name == "hcp":
        return np.array([[width, 0.0, 0.0], side, [0.0, 0.0, 2.0 * height]]), 2
    shift = shifts[1] if len(shifts) > 1 else (0.0, 0.0)
    return np.array([[width, 0.0, 0.0], side, [*shift, height]]), 1


def neighbours(name: str) -> Array:
    """Unit vectors (n, 3) to the neighbours of an inner sphere of a lattice."""
    size = (5, 5) if name in PLANAR else (5, 5, 5)
    inner = lattice(name, size)
    pairs, arm = touching(inner.centre, inner.period, 1.0 + CLOSE)
    middle = int(np.flatnonzero((inner.place == 2).all(axis=1))[0])
    return np.concatenate([arm[pairs[:, 0] == middle], -arm[pairs[:, 1] == middle]])
