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

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from skfem import MeshHex

from geometry.assembly import (
    Assembly,
    Box,
    boxes,
    corner_squares,
    screw_cells,
    screw_z,
    sheets,
    washer_z_range,
)
from geometry.grid_lines import Coordinates, Stop, graded, lines_through, refined
from geometry.naming import named

EDGE = 1 / 16  # of the elements' size, at the edge of an imprint on a part below
SHEETS_ON = {"block": "head", "sheets_support": "foot"}  # part below a sheet's overlap
EDGE_GROWTH = 3.0  # of neighbouring elements away from it
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
    a = assembly
    pieces = {}
    for name in boxes(a):
        size = block_seed if name == "block" else support_seed
        stops = box_stops(
            a, name, size, contact_seed=contact_seed, contact_point=contact_point, glued=glued
        )
        pieces[name] = MeshHex.init_tensor(*(lines_through(along, size) for along in stops))
    flat = _sheet_quadrilaterals(a, seed)
    for name, y in sheets(a).items():
        pieces[name] = _extruded(*flat, y, np.sign(y) * a.sheet_thickness)
    return _joined(assembly, pieces)


def _even(lower: float, upper: float, size: float) -> Coordinates:
    return lines_through([Stop(lower), Stop(upper)], size)


def box_stops(
    a: Assembly,
    name: str,
    size: float,
    *,
    contact_seed: float | None = None,
    contact_point: tuple[float, float] = (0.0, 0.0),
    glued: bool = False,
) -> list[list[Stop]]:
    """What the grid of a box with elements of `size` must pass, along x, y and z."""
    box = boxes(a)[name]
    edges = _outline_of_sheets(a, name) if glued else [[], [], []]
    squares = [[], [], []]
    contact = squares
    if name != "block":
        edges = [one + other for one, other in zip(edges, _edges(a), strict=True)]
        squares = _squares(a)
    elif contact_seed is not None:
        centre = (box.upper[0], contact_point[0], a.block_z / 2 + contact_point[1])
        contact = [[refined(at, contact_seed)] for at in centre]
    return [
        _within(
            float(box.lower[i]),
            float(box.upper[i]),
            [*contact[i], *(refined(at, EDGE * size, EDGE_GROWTH) for at in edges[i])]
            + [Stop(at) for at in squares[i]],
        )
        for i in range(3)
    ]


def _outline_of_sheets(a: Assembly, name: str) -> list[list[float]]:
    """The edges of the sheets' faces on the part that they are glued to: x, y, z."""
    if not sheets(a) or name not in SHEETS_ON:
        return [[], [], []]
    x = a.sheet_width / 2
    return [[-x, x], [*sheets(a).values()], [*washer_z_range(a, SHEETS_ON[name])]]


def _edges(a: Assembly) -> list[list[float]]:
    """Where parts below end on each other, and where they meet."""
    pairs = list(pairwise(_stack(a).values()))
    across = [
        [max(u.lower[i], v.lower[i]) for u, v in pairs]
        + [min(u.upper[i], v.upper[i]) for u, v in pairs]
        for i in range(2)
    ]
    return [*across, [u.lower[2] for u, _ in pairs]]


def _squares(a: Assembly) -> list[list[float]]:
    """The sides of the squares at the corners of all parts below: neighbours' grids match."""
    found = [[], [], []]
    for name, box in _stack(a).items():
        for _, *span in corner_squares(a, name).values():
            for i in range(2):
                found[i] += [at for d in span for at in (box.lower[i] + d, box.upper[i] - d)]
    return found


def _stack(a: Assembly) -> dict[str, Box]:
    return {name: box for name, box in boxes(a).items() if name != "block"}


def _within(lower: float, upper: float, stops: list[Stop]) -> list[Stop]:
    """The stops from end to end in ascending order, of those at one place the first."""
    inside = [stop for stop in stops if lower - 1e-9 < stop.at < upper + 1e-9]
    places = {round(stop.at, 9): stop for stop in [Stop(lower), Stop(upper), *reversed(inside)]}
    return [places[at] for at in sorted(places)]


def _sheet_quadrilaterals(a: Assembly, seed: float) -> tuple[Coordinates, NDArray[np.int64]]:
    """The sheet in its plane: points (2, n) as x, z and quadrilaterals (4, m)."""
    cells = screw_cells(a)
    across = [_even(lower, upper, seed) for lower, upper in cells]
    patches = []
    for joint in ("head", "foot"):
        clamp, rows = _overlap_rows(a, joint, seed)
        for x, line in zip(a.screw_x, across, strict=True):
            patches.append(np.array(np.meshgrid(line, clamp)))
            patches += _around_screw(line, rows, (x, screw_z(a)[joint]), a, seed)
    x = np.concatenate([across[0], *(line[1:] for line in across[1:])])
    z = _clamped_at_both_ends(-a.sheet_free_length, 0.0, seed)
    patches.append(np.array(np.meshgrid(x, z)))
    return _merged(patches)


def _overlap_rows(a: Assembly, joint: str, seed: float) -> tuple[Coordinates, Coordinates]:
    """z of a thin row along the clamp line, where stresses are singular, and of the rest."""
    lower, upper = washer_z_range(a, joint)
    z = screw_z(a)[joint]
    if joint == "head":
        clamp = lower + min(seed / 10, (z - a.washer_radius - lower) / 2)
        return np.array([lower, clamp]), _even(clamp, upper, seed)
    clamp = upper - min(seed / 10, (upper - z - a.washer_radius) / 2)
    return np.array([clamp, upper]), _even(lower, clamp, seed)


def _clamped_at_both_ends(lower: float, upper: float, seed: float) -> Coordinates:
    middle = (lower + upper) / 2
    half = graded(lower, middle, lower, seed / 10, seed)
    return np.concatenate([half, (lower + upper - half[::-1])[1:]])


def _around_screw(x: Coordinates, z: Coordinates, centre, a: Assembly, seed: float) -> list:
    """Two rings of quadrilaterals, each (2, n_radial + 1, n_around + 1), around one screw."""
    rim = _rectangle(x, z)
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
    around = 2 * np.pi * a.washer_radius / n
    n_washer = max(2, round((a.washer_radius - a.hole_radius) / max(around, seed / 2)))
    gap = float(np.mean(np.hypot(*(rim - washer))))
    return [_ruled(washer, hole, n_washer), _ruled(rim, washer, max(2, round(gap / seed)))]


def _rectangle(x: Coordinates, z: Coordinates) -> Coordinates:
    """Closed outline (2, n), anticlockwise from the lower left corner."""
    bottom = np.array([x, np.full_like(x, z[0])])
    right = np.array([np.full_like(z, x[-1]), z])
    top = np.array([x[::-1], np.full_like(x, z[-1])])
    left = np.array([np.full_like(z, x[0]), z[::-1]])
    return np.concatenate([bottom, right[:, 1:], top[:, 1:], left[:, 1:]], axis=1)


def _ruled(outer: Coordinates, inner: Coordinates, n: int) -> Coordinates:
    s = np.linspace(0, 1, n + 1)[None, :, None]
    return outer[:, None] * (1 - s) + inner[:, None] * s


def _merged(patches) -> tuple[Coordinates, NDArray[np.int64]]:
    """Structured patches (2, rows, columns) as one mesh; coincident points become one."""
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


def _extruded(p: Coordinates, t: NDArray[np.int64], y: float, thickness: float) -> MeshHex:
    n = p.shape[1]
    # anticlockwise in (x, z) looks along -y: that way up the hexahedra are right-handed
    levels = sorted((y, y + thickness), reverse=True)
    layers = [np.array([p[0], np.full(n, level), p[1]]) for level in levels]
    corners = np.concatenate([t, t + n])
    return MeshHex(np.concatenate(layers, axis=1), np.ascontiguousarray(corners[EXTRUDED]))


def _joined(assembly: Assembly, pieces: dict[str, MeshHex]) -> MeshHex:
    offset = np.cumsum([0, *(m.p.shape[1] for m in pieces.values())])
    first = np.cumsum([0, *(m.t.shape[1] for m in pieces.values())])
    p = np.concatenate([m.p for m in pieces.values()], axis=1)
    t = np.concatenate([m.t + o for m, o in zip(pieces.values(), offset, strict=False)], axis=1)
    body = {name: np.arange(*first[i : i + 2]) for i, name in enumerate(pieces)}
    return named(MeshHex(p, t), assembly, body)
