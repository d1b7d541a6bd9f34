"""Shapes to draw a body of: a box, an outline extruded and drilled, a cylinder or a tube, drilled.

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

from beadwave.geometry.errors import InvalidGeometry

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
    """A round hole along z [m], from the upper face as deep as `depth`; None: through the body."""

    diameter: float
    at: PlanePoint
    depth: float | None = None


@dataclass(frozen=True)
class RadialHole:
    """A round hole towards the axis of a cylinder, as deep as `depth` below its round face; None:
    through the body."""

    diameter: float
    angle: float  # [degrees] about z, from x
    height: float  # [m] on z
    depth: float | None = None


@dataclass(frozen=True)
class Slab:
    """An outline of straight edges [m], extruded; raises InvalidGeometry for one that crosses
    itself, for a thickness of zero, and for holes that meet the edge or each other or are as deep
    as the plate."""

    outline: tuple[PlanePoint, ...]
    thickness: float
    holes: tuple[Hole, ...] = ()
    at: Point = NOWHERE
    turn: Point = NOWHERE

    def __post_init__(self) -> None:
        _positive("thickness", self.thickness)
        _require_place(self)
        _check_plate(np.array(self.outline, dtype=float), self.holes)
        _check_depths(self.holes, self.thickness, "the plate is thick")


@dataclass(frozen=True)
class Cylinder:
    """A cylinder or, with a bore, a tube; both are radii [m].

    Raises InvalidGeometry for a bore as wide as the cylinder, for holes that meet the edge of the
    face that they are drilled into, the bore or each other there, and for holes too deep. Inside of
    the body holes may meet.
    """

    radius: float
    length: float
    bore: float = 0.0
    holes: tuple[Hole, ...] = ()
    radial_holes: tuple[RadialHole, ...] = ()
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
        _check_ends(self)
        _check_round_face(self)


Shape = Box | Slab | Cylinder


def volume(shape: Shape) -> float:
    """Volume of a shape [m^3]; what holes that meet share is taken off twice."""
    if isinstance(shape, Box):
        return float(np.prod(shape.sides))
    if isinstance(shape, Cylinder):
        solid, height = pi * (shape.radius**2 - shape.bore**2), shape.length
    else:
        solid, height = abs(_signed_area(np.array(shape.outline))), shape.thickness
    drilled = sum(pi / 4 * h.diameter**2 * (h.depth or height) for h in shape.holes)
    if isinstance(shape, Cylinder):
        drilled += sum(_volume(hole, shape) for hole in shape.radial_holes)
    return solid * height - drilled


def _volume(hole: RadialHole, cylinder: Cylinder) -> float:
    """Volume [m^3] that a radial hole takes from a cylinder: chords along the hole, next to its
    middle by s = r sin a, less what lies in the bore, summed over equal steps of a; within 1e-6 of
    the body where the hole is wider than the bore, else nearer."""
    a = (np.arange(-1000, 1000) + 0.5) * pi / 2000
    s = hole.diameter / 2 * np.sin(a)
    outer = np.sqrt(cylinder.radius**2 - s**2)
    inner = np.sqrt(np.maximum(cylinder.bore**2 - s**2, 0))
    tip = -np.inf if hole.depth is None else cylinder.radius - hole.depth
    near = np.maximum(outer - np.maximum(inner, tip), 0)
    far = np.maximum(-inner - np.maximum(-outer, tip), 0)
    width = hole.diameter / 2 * np.cos(a)  # half of it, and ds / da
    return float(2 * width**2 @ (near + far) * pi / 2000)


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
    """Area [m^2] of a polygon (n, 2) [m] by its corners (Gauss), > 0 where they run
    anticlockwise."""
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

    # a closed line that neither crosses nor touches itself, and encloses an area
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

    # holes whole inside of it, and apart from each other
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
        _check_apart(hole, holes[:i])


def _check_apart(hole: Hole, others: tuple[Hole, ...]) -> None:
    for other in others:
        distance = float(np.linalg.norm(np.subtract(hole.at, other.at)))
        least = (hole.diameter + other.diameter) / 2
        if distance <= least:
            raise InvalidGeometry(
                f"holes at {list(other.at)} and {list(hole.at)} overlap: their centres are "
                f"{distance:.6g} m apart, which must exceed {least:.6g} m."
            )


def _check_depths(holes: tuple[Hole, ...], height: float, words: str) -> None:
    """Raises InvalidGeometry for holes that are no less deep than the body's height [m], which
    `words` name: they would go through, and must say so by having no depth."""
    for hole in holes:
        if hole.depth is None:
            continue
        _positive("hole's depth", hole.depth)
        if hole.depth >= height:
            raise InvalidGeometry(
                f"depth = {hole.depth} m of the hole at {list(hole.at)} must be less than {words}, "
                f"{height} m; without depth it goes through."
            )


def _check_ends(cylinder: Cylinder) -> None:
    """Raises InvalidGeometry for holes that cannot be drilled into the ends of a cylinder."""
    for i, hole in enumerate(cylinder.holes):
        _positive("hole's diameter", hole.diameter)
        off, r = float(np.linalg.norm(hole.at)), hole.diameter / 2
        least = cylinder.bore + r if cylinder.bore else 0.0
        if not (off + r < cylinder.radius and (off > least or not cylinder.bore)):
            beyond = f"more than {least:.6g} m and " if cylinder.bore else ""
            raise InvalidGeometry(
                f"hole of {hole.diameter} m at {list(hole.at)} is not inside the end of the "
                f"cylinder: its centre must be {beyond}less than {cylinder.radius - r:.6g} m from "
                "the axis."
            )
        _check_apart(hole, cylinder.holes[:i])
    _check_depths(cylinder.holes, cylinder.length, "the cylinder is long")


def _check_round_face(cylinder: Cylinder) -> None:
    """Raises InvalidGeometry for holes that cannot be drilled into the round face of a cylinder."""
    R, half = cylinder.radius, cylinder.length / 2
    mouths: list[tuple[RadialHole, float]] = []  # holes with the angles at which they open [rad]
    for hole in cylinder.radial_holes:
        _positive("hole's diameter", hole.diameter)
        r, place = hole.diameter / 2, [hole.angle, hole.height]
        if not (np.all(np.isfinite(place)) and r < R and abs(hole.height) + r < half):
            raise InvalidGeometry(
                f"hole of {hole.diameter} m around the cylinder at {place} is not inside its round "
                f"face: its diameter must be less than {2 * R:.6g} m, and its height lie between "
                f"{r - half:.6g} m and {half - r:.6g} m."
            )
        if hole.depth is not None:
            _positive("hole's depth", hole.depth)
            words = f"depth = {hole.depth} m of the hole around the cylinder at {place} must be "
            # beyond it the flat bottom cuts the round face on the far side
            deepest = R + np.sqrt(R**2 - r**2)
            if hole.depth >= deepest:
                raise InvalidGeometry(
                    f"{words}less than {deepest:.6g} m; without depth it goes through."
                )
            # between them the flat bottom leaves a skin on the bore that thins out to nothing
            grazes, opens = R - cylinder.bore, R - np.sqrt(max(cylinder.bore**2 - r**2, 0))
            if cylinder.bore and grazes <= hole.depth <= opens:
                raise InvalidGeometry(
                    f"{words}less than {grazes:.6g} m, to end before the bore, or more than "
                    f"{opens:.6g} m, to open into it."
                )
        angles = [hole.angle] if hole.depth else [hole.angle, hole.angle + 180]
        for angle in np.radians(angles):
            for other, at in mouths:
                apart = abs((angle - at + pi) % (2 * pi) - pi)
                clear = np.arcsin(r / R) + np.arcsin(other.diameter / 2 / R)
                if apart <= clear and abs(hole.height - other.height) <= r + other.diameter / 2:
                    raise InvalidGeometry(
                        f"holes around the cylinder at {[other.angle, other.height]} and {place} "
                        "meet in its round face; move one, or give one that ends inside its depth."
                    )
        mouths += [(hole, angle) for angle in np.radians(angles)]


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
