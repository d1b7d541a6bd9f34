"""Shapes to draw a body of: a box, an extruded outline with round holes, a cylinder or a tube.

Each is drawn in axes of its own, turned about them, then moved: turn = (a, b, c) degrees turns it
by a about the global x, then by b about y, then by c about z.

    Box        middle at the origin
    Slab       outline in the plane x-y at z = 0, thickness along z
    Cylinder   axis along z, middle at the origin
"""

from dataclasses import dataclass
from itertools import combinations
from math import isfinite, pi

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InvalidGeometry

Point = tuple[float, float, float]
PlanePoint = tuple[float, float]
NOWHERE: Point = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Box:
    """Sides along x, y and z [m]; raises InvalidGeometry for a side that is not positive."""

    sides: Point
    at: Point = NOWHERE
    turn: Point = NOWHERE

    def __post_init__(self) -> None:
        for letter, side in zip("xyz", self.sides, strict=True):
            _positive(f"box, side along {letter}", side)
        _require_place(self)


@dataclass(frozen=True)
class Hole:
    """A round hole through a plate [m]."""

    diameter: float
    at: PlanePoint


@dataclass(frozen=True)
class Slab:
    """An outline of straight edges [m], extruded; raises InvalidGeometry for one that crosses
    itself, for a thickness of zero, and for holes that meet the edge or each other."""

    outline: tuple[PlanePoint, ...]
    thickness: float
    holes: tuple[Hole, ...] = ()
    at: Point = NOWHERE
    turn: Point = NOWHERE

    def __post_init__(self) -> None:
        _positive("thickness", self.thickness)
        _require_place(self)
        _check_plate(np.array(self.outline, dtype=float), self.holes)


@dataclass(frozen=True)
class Cylinder:
    """A cylinder or, with a bore, a tube; both are radii [m]."""

    radius: float
    length: float
    bore: float = 0.0
    at: Point = NOWHERE
    turn: Point = NOWHERE

    def __post_init__(self) -> None:
        _positive("radius", self.radius)
        _positive("length", self.length)
        _require_place(self)
        if not 0 <= self.bore < self.radius:
            raise InvalidGeometry(
                f"bore = {self.bore} m, a radius, must lie between 0 and the tube's "
                f"radius = {self.radius} m."
            )


Shape = Box | Slab | Cylinder


def volume(shape: Shape) -> float:
    """Volume of a shape [m^3]."""
    if isinstance(shape, Box):
        return float(np.prod(shape.sides))
    if isinstance(shape, Cylinder):
        return pi * (shape.radius**2 - shape.bore**2) * shape.length
    solid = abs(_signed_area(np.array(shape.outline)))
    return (solid - sum(pi / 4 * hole.diameter**2 for hole in shape.holes)) * shape.thickness


def in_place(points: NDArray[np.float64], shape: Shape) -> NDArray[np.float64]:
    """Points (n, 3) [m] in the shape's own axes, turned about x, y, z in turn and moved."""
    for axis, degrees in enumerate(shape.turn):
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        i, j = (axis + 1) % 3, (axis + 2) % 3
        turned = points.copy()
        turned[:, i] = c * points[:, i] - s * points[:, j]
        turned[:, j] = s * points[:, i] + c * points[:, j]
        points = turned
    return points + np.array(shape.at)


def _positive(name: str, value: float) -> None:
    if not (isfinite(value) and value > 0):
        raise InvalidGeometry(f"{name} = {value} m must be a positive finite length.")


def _require_place(shape: Shape) -> None:
    for name, values in (("at", shape.at), ("turn", shape.turn)):
        if len(values) != 3 or not np.all(np.isfinite(values)):
            raise InvalidGeometry(f"{name} = {list(values)} must be three finite numbers.")


def _signed_area(outline: NDArray[np.float64]) -> float:
    x, y = outline.T
    return float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) / 2)


def _check_plate(outline: NDArray[np.float64], holes: tuple[Hole, ...]) -> None:
    """Raises InvalidGeometry for an outline that cannot be extruded, and for holes that cannot be
    drilled into it."""
    if outline.ndim != 2 or outline.shape[1] != 2 or len(outline) < 3:
        raise InvalidGeometry(
            f"outline = {outline.tolist()} must list at least three points [x, y]."
        )
    if not np.all(np.isfinite(outline)):
        raise InvalidGeometry(f"outline = {outline.tolist()} must be finite numbers.")
    edges = list(zip(outline, np.roll(outline, -1, axis=0), strict=True))
    n = len(edges)
    for i, j in combinations(range(n), 2):
        adjacent = (i + 1) % n == j or (j + 1) % n == i
        if not adjacent and _distance_of_edges(edges[i], edges[j]) == 0:
            raise InvalidGeometry(
                f"outline crosses or touches itself: its edges {i + 1} and {j + 1} meet; "
                "list its corners once around."
            )
    if _signed_area(outline) == 0 or min(np.linalg.norm(b - a) for a, b in edges) == 0:
        raise InvalidGeometry(f"outline = {outline.tolist()} has an edge of no length or no area.")

    for i, hole in enumerate(holes):
        _positive("hole's diameter", hole.diameter)
        centre, radius = np.array(hole.at, dtype=float), hole.diameter / 2
        to_edge = min(_distance(centre, *edge) for edge in edges)
        # inside: a ray along x crosses the outline an odd number of times
        crossings = [
            (a[1] > centre[1]) != (b[1] > centre[1])
            and centre[0] < a[0] + (centre[1] - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
            for a, b in edges
        ]
        if sum(crossings) % 2 != 1 or to_edge <= radius:
            raise InvalidGeometry(
                f"hole of {hole.diameter} m at {list(hole.at)} is not inside the outline: its "
                f"centre must lie inside, more than {radius} m from every edge."
            )
        for earlier in holes[:i]:
            distance = float(np.linalg.norm(centre - earlier.at))
            if distance <= radius + earlier.diameter / 2:
                raise InvalidGeometry(
                    f"holes at {list(earlier.at)} and {list(hole.at)} overlap: their centres are "
                    f"{distance:.6g} m apart, which must exceed "
                    f"{radius + earlier.diameter / 2:.6g} m."
                )


def _distance(point, a, b) -> float:
    """Of a point from the edge a-b."""
    along = b - a
    s = np.clip((point - a) @ along / (along @ along), 0, 1) if along @ along else 0.0
    return float(np.linalg.norm(point - a - s * along))


def _distance_of_edges(first: tuple, second: tuple) -> float:
    """0 where they cross, else of the nearest end."""
    (a, b), (c, d) = first, second

    def side(a, b, point) -> float:
        """> 0 to the left of the line from a to b."""
        return (b[0] - a[0]) * (point[1] - a[1]) - (b[1] - a[1]) * (point[0] - a[0])

    if side(a, b, c) * side(a, b, d) < 0 and side(c, d, a) * side(c, d, b) < 0:
        return 0.0
    return min(_distance(c, a, b), _distance(d, a, b), _distance(a, c, d), _distance(b, c, d))
