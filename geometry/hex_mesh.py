"""Graded hexahedra: boxes as tensor grids, sheets as quadrilaterals around the screws, extruded.

Each sheet is one layer of elements, meant for quadratic shape functions. Around a screw the
quadrilaterals form an O-grid: hole -> washer -> the screw's rectangle of the overlap.

    +-----------------+
    | \\      |      / |
    |   \\ .-----. /   |      ring 1: hole to washer
    |----(  hole  )---|      ring 2: washer to the rectangle
    |   / '-----' \\   |
    | /      |      \\ |
    +-----------------+  <- clamp line
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.assembly import (
    Assembly,
    boxes,
    corner_squares,
    screw_cells,
    screw_z,
    sheets,
    washer_z_range,
)
from geometry.grid_lines import Coordinates, Stop, lines_through, refined
from geometry.naming import named

if TYPE_CHECKING:  # half a second, which a scene that is only read does not pay
    from skfem import MeshHex


class EdgeRefinement(NamedTuple):
    """Elements at the edge of an imprint on a part below, where stresses are singular. With them,
    and elements that match across interfaces, the mesh error of rig-rom fell from 4.4 to 0.7 % of
    the striker's speed; other values are not on record."""

    size: float = 1 / 16  # size of the first element over that of the part's elements
    growth: float = 3.0  # size of an element over that of its neighbour nearer to the edge


class ClampRefinement(NamedTuple):
    """Elements of a sheet on either side of a line where it is clamped: it bends there within some
    thicknesses. One row of a tenth of the seed in place of these left twice the error in the waves
    of rig-rom, at the same number of unknowns."""

    size: float = 1 / 30  # of the elements' size, of the first row
    growth: float = 2.0  # of neighbouring rows away from the line; 2.5 and 3 left more error
    reach: float = 0.4  # of the elements' size: the rows between the line and the rings of screws


EDGE = EdgeRefinement()
# of the parts below, whose elements are large. Of rig-rom with 60 mm there 1.5 mm and a growth of 5
# left an error of 1.1 % in the waves (38 000 unknowns), 2 mm and 6 left 1.6 % (37 000), 0.6 mm and
# 9 left 1.4 % (43 000)
EDGE_BELOW = EdgeRefinement(1 / 40, 5.0)
CLAMP = ClampRefinement()
SHEETS_ON = {"block": "head", "sheets_support": "foot"}  # part below a sheet's overlap
# skfem's order of the corners of a hexahedron, from the quadrilateral (0..3) and its copy (4..7)
EXTRUDED = [0, 4, 3, 1, 7, 5, 2, 6]


def hex_mesh(
    assembly: Assembly,
    *,
    seed: float,
    block_seed: float,
    support_seed: float,
    contact_seed: float | None = None,
    contact_point: tuple[float, float] = (0.0, 0.0),
    glued: bool = False,
) -> MeshHex:
    """Every part meshed on its own, coincident faces unmerged, bodies and faces named.

    Element sizes in metres: `seed` in the sheets, `block_seed` in the block, `support_seed` in the
    parts below, `contact_seed` at `contact_point` (y, z from the middle of the block's +x face);
    without a contact seed the block is meshed evenly.
    """
    from skfem import MeshHex

    a = assembly
    pieces = {}
    for name in boxes(a):
        size = block_seed if name == "block" else support_seed
        stops = box_stops(
            a, name, size, contact_seed=contact_seed, contact_point=contact_point, glued=glued
        )
        pieces[name] = MeshHex.init_tensor(*(lines_through(along, size) for along in stops))

    # sheets: their quadrilaterals in the plane, extruded away from the block
    p, quads = _sheet_quadrilaterals(a, seed)
    n = p.shape[1]
    for name, y in sheets(a).items():
        # anticlockwise in (x, z) looks along -y: that way up the hexahedra are right-handed
        levels = sorted((y, y + np.sign(y) * a.sheet_thickness), reverse=True)
        layers = [np.array([p[0], np.full(n, level), p[1]]) for level in levels]
        corners = np.concatenate([quads, quads + n])[EXTRUDED]
        pieces[name] = MeshHex(np.concatenate(layers, axis=1), np.ascontiguousarray(corners))

    offset = np.cumsum([0, *(m.p.shape[1] for m in pieces.values())])
    first = np.cumsum([0, *(m.t.shape[1] for m in pieces.values())])
    points = np.concatenate([m.p for m in pieces.values()], axis=1)
    t = np.concatenate([m.t + o for m, o in zip(pieces.values(), offset, strict=False)], axis=1)
    body = {name: np.arange(*first[i : i + 2]) for i, name in enumerate(pieces)}
    return named(MeshHex(points, t), assembly, body)


def box_stops(
    a: Assembly,
    name: str,
    size: float,
    *,
    contact_seed: float | None = None,
    contact_point: tuple[float, float] = (0.0, 0.0),
    glued: bool = False,
) -> list[list[Stop]]:
    """Coordinates along x, y and z that grid lines of the box `name` must pass, with the element
    sizes around them, for elements of `size` [m] elsewhere."""
    box = boxes(a)[name]
    contact: list[list[Stop]] = [[], [], []]  # where the box is struck
    edges: list[list[float]] = [[], [], []]  # where stresses are singular
    squares: list[list[float]] = [[], [], []]  # sides of the squares that screws hold

    # the edges of the sheets' faces on the part that they are glued to
    if glued and sheets(a) and name in SHEETS_ON:
        x = a.sheet_width / 2
        edges = [[-x, x], [*sheets(a).values()], [*washer_z_range(a, SHEETS_ON[name])]]
    if name != "block":
        # where parts below end on each other, and where they meet; the squares at the corners of
        # all of them: neighbours' grids match
        stack = {part: below for part, below in boxes(a).items() if part != "block"}
        pairs = list(pairwise(stack.values()))
        for i in range(2):
            edges[i] = edges[i] + [max(u.lower[i], v.lower[i]) for u, v in pairs]
            edges[i] += [min(u.upper[i], v.upper[i]) for u, v in pairs]
        edges[2] = edges[2] + [u.lower[2] for u, _ in pairs]
        for part, below in stack.items():
            for _, *span in corner_squares(a, part).values():
                for i in range(2):
                    squares[i] += [
                        at for d in span for at in (below.lower[i] + d, below.upper[i] - d)
                    ]
    elif contact_seed is not None:
        centre = (box.upper[0], contact_point[0], a.block_z / 2 + contact_point[1])
        contact = [[refined(at, contact_seed)] for at in centre]

    # ascending, from end to end; of several stops at one place the first, which has the finest size
    stops = []
    for i in range(3):
        lower, upper = float(box.lower[i]), float(box.upper[i])
        candidates = [*contact[i]]
        edge = EDGE if name == "block" else EDGE_BELOW
        candidates += [refined(at, edge.size * size, edge.growth) for at in edges[i]]
        candidates += [Stop(at) for at in squares[i]]
        inside = [stop for stop in candidates if lower - 1e-9 < stop.at < upper + 1e-9]
        places = {round(stop.at, 9): stop for stop in [Stop(lower), Stop(upper), *reversed(inside)]}
        stops.append([places[at] for at in sorted(places)])
    return stops


def _sheet_quadrilaterals(a: Assembly, seed: float) -> tuple[Coordinates, NDArray[np.int64]]:
    """The sheet in its plane: points (2, n) as x, z and quadrilaterals (4, m)."""

    def even(lower: float, upper: float) -> Coordinates:
        return lines_through([Stop(lower), Stop(upper)], seed)

    # structured patches (2, rows, columns): at each joint thin rows along the clamp line, where
    # stresses are singular, and two rings around each screw in the rest of the overlap
    at_clamp = CLAMP.size * seed
    across = [even(lower, upper) for lower, upper in screw_cells(a)]
    patches = []
    for joint in ("head", "foot"):
        lower, upper = washer_z_range(a, joint)
        screw = screw_z(a)[joint]
        if joint == "head":
            end = lower + min(CLAMP.reach * seed, (screw - a.washer_radius - lower) / 2)
            stops = [refined(lower, at_clamp, CLAMP.growth), Stop(end)]
            rest = even(end, upper)
        else:
            end = upper - min(CLAMP.reach * seed, (upper - screw - a.washer_radius) / 2)
            stops = [Stop(end), refined(upper, at_clamp, CLAMP.growth)]
            rest = even(lower, end)
        rows = lines_through(stops, seed)
        for x, line in zip(a.screw_x, across, strict=True):
            patches.append(np.array(np.meshgrid(line, rows)))
            patches += _around_screw(line, rest, (x, screw), a, seed)

    # the free length, graded towards either clamp line
    x = np.concatenate([across[0], *(line[1:] for line in across[1:])])
    lower, upper = -a.sheet_free_length, 0.0
    half = lines_through([refined(lower, at_clamp, CLAMP.growth), Stop((lower + upper) / 2)], seed)
    z = np.concatenate([half, (lower + upper - half[::-1])[1:]])
    patches.append(np.array(np.meshgrid(x, z)))

    # as one mesh: coincident points become one
    points, quads, offset = [], [], 0
    for patch in patches:
        ix = offset + np.arange(patch[0].size).reshape(patch[0].shape)
        corners = [ix[:-1, :-1], ix[:-1, 1:], ix[1:, 1:], ix[1:, :-1]]
        quads.append(np.array([c.ravel() for c in corners]))
        points.append(patch.reshape(2, -1))
        offset += patch[0].size
    p, t = np.concatenate(points, axis=1), np.concatenate(quads, axis=1)
    _, first, inverse = np.unique(np.round(p, 10), axis=1, return_index=True, return_inverse=True)
    return p[:, first], inverse.ravel()[t]


def _around_screw(
    x: Coordinates, z: Coordinates, centre: tuple[float, float], a: Assembly, seed: float
) -> list[Coordinates]:
    """Two rings of quadrilaterals, each (2, n_radial + 1, n_around + 1), around one screw."""
    # the closed outline (2, n) of the screw's rectangle, anticlockwise from the lower left corner
    bottom = np.array([x, np.full_like(x, z[0])])
    right = np.array([np.full_like(z, x[-1]), z])
    top = np.array([x[::-1], np.full_like(x, z[-1])])
    left = np.array([np.full_like(z, x[0]), z[::-1]])
    rim = np.concatenate([bottom, right[:, 1:], top[:, 1:], left[:, 1:]], axis=1)
    angle = np.arctan2(rim[1] - centre[1], rim[0] - centre[0])
    # equal-area polygons: the chords would otherwise make the hole and the washer too small
    n = len(angle) - 1
    turn = np.diff(np.unwrap(angle))
    inflate = np.sqrt(2 * np.pi / np.sum(np.sin(turn)))
    direction = np.array([np.cos(angle), np.sin(angle)])
    hole, washer = (
        np.array(centre)[:, None] + r * inflate * direction
        for r in (a.hole_radius, a.washer_radius)
    )

    # two elements or more across either ring, about as long as around the washer, or as the seed
    around = 2 * np.pi * a.washer_radius / n
    n_washer = max(2, round((a.washer_radius - a.hole_radius) / max(around, seed / 2)))
    gap = float(np.mean(np.hypot(*(rim - washer))))
    rings = []
    for outer, inner, n_radial in (
        (washer, hole, n_washer),
        (rim, washer, max(2, round(gap / seed))),
    ):
        s = np.linspace(0, 1, n_radial + 1)[None, :, None]
        rings.append(outer[:, None] * (1 - s) + inner[:, None] * s)
    return rings
