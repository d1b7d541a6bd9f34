"""Hexahedra between prescribed grid lines: boxes, and plates with rings around their holes.

Lines are given along the body's own axes (`geometry.cad.shapes`): stops that they must pass, with
the size of the elements there and how it grows away from them (`geometry.meshing.grid_lines`). A
hole fills a rectangle between lines with two rings of quadrilaterals, hole -> washer -> rectangle:

    +-----------------+
    | \\      |      / |
    |   \\ .-----. /   |      ring 1: hole to washer
    |----(  hole  )---|      ring 2: washer to the rectangle
    |   / '-----' \\   |
    | /      |      \\ |
    +-----------------+

Nothing is imprinted on such a mesh: what touches it, holds it or strikes it takes the facets whose
middles it covers (`geometry.own_mesh.mesh_bodies`), so that lines belong where these end.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.geometry.cad.shapes import Box, Shape, Slab, in_place
from beadwave.geometry.errors import InvalidGeometry
from beadwave.geometry.meshing.grid_lines import Coordinates, Stop, lines_through
from beadwave.geometry.own_mesh.facets import EXTRUDED

if TYPE_CHECKING:  # half a second, which a scene that is only read does not pay
    from skfem import MeshHex

SAME = 1e-9  # m, lines closer than this are one


class HoleRing(NamedTuple):
    """The rectangle around a hole that its rings fill."""

    washer: float  # m, radius of the circle between the rings
    lower: tuple[float, float]  # its corners [m] in the plate's plane, on lines
    upper: tuple[float, float]


class Lines(NamedTuple):
    """Positions that the grid lines of a body pass, along its own axes; its ends need not be among
    them."""

    x: Sequence[Stop] = ()
    y: Sequence[Stop] = ()
    z: Sequence[Stop] = ()
    rings: Sequence[HoleRing] = ()  # one for every hole of a plate, in their order


class _Rectangle(NamedTuple):
    """A hole's ring, and which lines along x and y are the sides of its rectangle."""

    ring: HoleRing
    i: tuple[int, int]
    j: tuple[int, int]


def lined_meshes(
    shapes: Mapping[str, Shape], lines: Mapping[str, Lines], seeds: Mapping[str, float]
) -> dict[str, MeshHex]:
    """A mesh of every body that has lines, by its seed [m]; raises InvalidGeometry."""
    meshes = {}
    for name, of_body in lines.items():
        try:
            meshes[name] = lined_mesh(shapes[name], of_body, seeds[name])
        except InvalidGeometry as error:
            raise InvalidGeometry(f"bodies.{name}: {error}") from None
    return meshes


def lined_mesh(shape: Shape, lines: Lines, seed: float) -> MeshHex:
    """The body in hexahedra with elements up to `seed` [m]; raises InvalidGeometry for a shape that
    is no box and no rectangular plate, for holes without rings between lines, and for holes that do
    not go through. Nodes lie in the shape's place, `shape.at` and `shape.turn`."""
    from skfem import MeshHex

    x, y, z = (lines_through(stops, seed) for stops in stops_of(shape, lines))
    rectangles = _rectangles(shape, lines, x, y)

    # the grid in the plane, less the rectangles, whose quadrilaterals go around their holes
    whole = np.ones((len(x) - 1, len(y) - 1), dtype=bool)
    patches = []
    for hole, (ring, (i, k), (j, m)) in zip(_holes(shape), rectangles, strict=True):
        whole[i:k, j:m] = False
        sides = x[i : k + 1], y[j : m + 1]
        patches += _around(*sides, np.array(hole.at), hole.diameter / 2, ring.washer, seed)
    ix = np.arange(len(x) * len(y)).reshape(len(x), len(y))
    corners = [ix[:-1, :-1], ix[1:, :-1], ix[1:, 1:], ix[:-1, 1:]]
    quads = [np.array([c[whole] for c in corners])]
    points = [np.array(np.meshgrid(x, y, indexing="ij")).reshape(2, -1)]
    offset = ix.size
    for patch in patches:
        ix = offset + np.arange(patch[0].size).reshape(patch[0].shape)
        corners = [ix[:-1, :-1], ix[:-1, 1:], ix[1:, 1:], ix[1:, :-1]]
        quads.append(np.array([c.ravel() for c in corners]))
        points.append(patch.reshape(2, -1))
        offset += patch[0].size

    # coincident points become one, those inside of rectangles go; then copies above each other
    p, t = np.concatenate(points, axis=1), np.concatenate(quads, axis=1)
    _, first, inverse = np.unique(np.round(p, 10), axis=1, return_index=True, return_inverse=True)
    used, t = np.unique(inverse.ravel()[t], return_inverse=True)
    p, t = p[:, first[used]], t.reshape(4, -1)
    n, layers = p.shape[1], len(z) - 1
    solid = np.concatenate([np.vstack([p, np.full(n, level)]) for level in z], axis=1)
    base = (t[:, None] + n * np.arange(layers)[:, None]).reshape(4, -1)
    t = np.concatenate([base, base + n])[EXTRUDED]
    return MeshHex(np.ascontiguousarray(in_place(solid.T, shape).T), np.ascontiguousarray(t))


def stops_of(shape: Shape, lines: Lines) -> list[list[Stop]]:
    """Stops along x, y and z from end to end of the body, in its own axes [m]; of several at one
    place the first. Those outside of the body are left out; raises InvalidGeometry for a shape that
    is no box and no rectangular plate."""
    if isinstance(shape, Box):
        spans = [(-side / 2, side / 2) for side in shape.sides]
    elif isinstance(shape, Slab) and len(shape.outline) == 4:
        corners = np.array(shape.outline)
        spans = [*zip(corners.min(axis=0), corners.max(axis=0), strict=True), (0, shape.thickness)]
        if not np.all(np.isin(corners, [span[:2] for span in np.transpose(spans[:2])])):
            raise InvalidGeometry("lines belong to a box or to a plate with a rectangular outline.")
    else:
        raise InvalidGeometry("lines belong to a box or to a plate with a rectangular outline.")
    stops = []
    for (lower, upper), prescribed in zip(spans, (lines.x, lines.y, lines.z), strict=True):
        inside = [stop for stop in prescribed if lower - SAME < stop.at < upper + SAME]
        ends = Stop(float(lower)), Stop(float(upper))
        places = {round(stop.at, 9): stop for stop in [*ends, *reversed(inside)]}
        stops.append([places[at] for at in sorted(places)])
    return stops


def _holes(shape: Shape):
    return shape.holes if isinstance(shape, Slab) else ()


def _rectangles(shape: Shape, lines: Lines, x: Coordinates, y: Coordinates) -> list[_Rectangle]:
    """The rings of the holes with the numbers of the lines around them."""
    holes = _holes(shape)
    if len(holes) != len(lines.rings):
        raise InvalidGeometry(
            f"lines has {len(lines.rings)} rings for {len(holes)} holes; give each hole one."
        )

    # along x and y: the lines nearest to both ends of the ring's rectangle, which must be there,
    # with hole < washer < rectangle, or a ring of quadrilaterals would have no width
    rectangles = []
    for hole, ring in zip(holes, lines.rings, strict=True):
        if hole.depth is not None:
            raise InvalidGeometry(
                f"depth = {hole.depth} m of the hole at {list(hole.at)} m: between lines holes go "
                "through; drop its depth, or the lines."
            )
        numbers = []
        for axis, along in enumerate((x, y)):
            ends = [int(np.argmin(abs(along - e[axis]))) for e in (ring.lower, ring.upper)]
            off = max(
                abs(along[i] - e[axis]) for i, e in zip(ends, (ring.lower, ring.upper), strict=True)
            )
            to_side = min(hole.at[axis] - ring.lower[axis], ring.upper[axis] - hole.at[axis])
            if off > SAME or not hole.diameter / 2 < ring.washer < to_side:
                raise InvalidGeometry(
                    f"the ring of the hole at {list(hole.at)} m from {list(ring.lower)} to "
                    f"{list(ring.upper)} m must end on lines and hold a washer of {ring.washer} m, "
                    "wider than the hole; change lines or rings."
                )
            numbers.append((ends[0], ends[1]))
        rectangles.append(_Rectangle(ring, *numbers))
    return rectangles


def _around(
    x: Coordinates,
    y: Coordinates,
    centre: NDArray[np.float64],
    hole: float,
    washer: float,
    seed: float,
) -> list[NDArray[np.float64]]:
    """Two rings of quadrilaterals, each (2, n_radial + 1, n_around + 1), around one hole; radii and
    seed in m."""
    # the closed outline (2, n) of the rectangle, anticlockwise from the lower left corner
    bottom = np.array([x, np.full_like(x, y[0])])
    right = np.array([np.full_like(y, x[-1]), y])
    top = np.array([x[::-1], np.full_like(x, y[-1])])
    left = np.array([np.full_like(y, x[0]), y[::-1]])
    rim = np.concatenate([bottom, right[:, 1:], top[:, 1:], left[:, 1:]], axis=1)
    angle = np.arctan2(rim[1] - centre[1], rim[0] - centre[0])

    # equal-area polygons: the chords would otherwise make the hole and the washer too small
    n = len(angle) - 1
    turn = np.diff(np.unwrap(angle))
    inflate = np.sqrt(2 * np.pi / np.sum(np.sin(turn)))
    direction = np.array([np.cos(angle), np.sin(angle)])
    inner, middle = (centre[:, None] + r * inflate * direction for r in (hole, washer))

    # two elements or more across either ring, about as long as around the washer, or as the seed;
    # blended linearly from the outer to the inner curve, along rays from the centre
    across = (washer - hole) / max(2 * np.pi * washer / n, seed / 2)
    gap = float(np.mean(np.hypot(*(rim - middle))))
    rings = []
    for outer, inside, n_radial in (
        (middle, inner, max(2, round(across))),
        (rim, middle, max(2, round(gap / seed))),
    ):
        s = np.linspace(0, 1, n_radial + 1)[None, :, None]
        rings.append(outer[:, None] * (1 - s) + inside[:, None] * s)
    return rings
