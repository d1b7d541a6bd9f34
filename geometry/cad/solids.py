"""Bodies and their faces as numbers, which can be used without the CAD kernel.

Lengths in metres, in global axes. Faces carry the tag that the CAD model knows them by.
"""

from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.geometry.errors import InvalidGeometry

ALIGNED = 1e-6  # 1 - cosine of the angle between directions that count as equal
SAME = 1e-6  # m, lengths and places closer than this count as equal

Vector = NDArray[np.float64]  # (3,)


MAX_SIZE = 30.0  # m: structures of millimetres read as metres are larger
# size of the assembly over that of its median face: units do not change it, a stray point does
MAX_SIZE_RATIO = 500


class Face(NamedTuple):
    """A face of a body; lengths in m."""

    tag: int
    kind: str  # "plane", "cylinder", "cone", "sphere", "torus", "other"
    area: float
    centre: Vector  # of the area
    normal: Vector | None  # of a plane, outward
    axis: Vector | None  # of a cylinder, a unit vector
    on_axis: Vector | None  # of a cylinder, a point of its axis; of a sphere its centre
    radius: float | None  # of a cylinder or a sphere
    hollow: bool  # a bore: the normal points to the axis or the centre
    along: tuple[float, float]  # of a cylinder, from where to where along its axis past on_axis
    lower: Vector  # box around it
    upper: Vector
    name: str  # in the CAD, or ""


class Body(NamedTuple):
    """One solid."""

    name: str
    tag: int
    volume: float  # [m^3]
    centroid: Vector
    inertia: NDArray[np.float64]  # (3, 3) about the centroid, of unit density [m^5]
    lower: Vector  # box around it
    upper: Vector
    faces: tuple[Face, ...]
    distance: Callable[[Vector, int], float]  # of a point from a face by its tag [m]

    @property
    def area(self) -> float:
        """Of all faces together [m^2], bores and cavities included."""
        return sum(face.area for face in self.faces)

    @property
    def extent(self) -> float:
        """Diagonal [m] of a box with this volume and inertia; unlike that of the bounding box, it
        does not change when the body is turned."""
        return float(np.sqrt(6 * np.trace(self.inertia) / self.volume))

    def face(self, tag: int) -> Face:
        """The face with a tag; raises StopIteration where the body has none."""
        return next(face for face in self.faces if face.tag == tag)


def parallel(u: Vector, v: Vector) -> bool:
    """True if two unit vectors point along one line, in the same or in opposite directions."""
    return bool(abs(u @ v) > 1 - ALIGNED)


def of_one_cylinder(faces: Iterable[Face], within: float) -> list[list[Face]]:
    """Round faces in groups of one axis and one radius, which may be off by up to `within` [m]."""
    groups: list[list[Face]] = []
    for face in (face for face in faces if face.axis is not None):
        own_group = [
            group
            for group in groups
            if parallel(group[0].axis, face.axis)
            and abs(group[0].radius - face.radius) <= within
            and off_axis(face.on_axis, group[0].on_axis, group[0].axis) <= within
        ]
        own_group[0].append(face) if own_group else groups.append([face])
    return groups


def off_axis(
    points: NDArray[np.float64], on_axis: Vector, axis: Vector
) -> NDArray[np.float64] | np.float64:
    """Distances (...) [m] of points (..., 3) from the line through `on_axis` (3,) along the unit
    vector `axis` (3,): |(p - p_0) x a|."""
    return np.linalg.norm(np.cross(points - on_axis, axis), axis=-1)


def described(face: Face) -> str:
    """A face in words: its kind, its place and its direction."""
    at = "[{:.6g}, {:.6g}, {:.6g}] m".format(*(face.centre + 0.0))
    if face.normal is not None:
        return "a plane with its middle at {}, normal [{:.3g}, {:.3g}, {:.3g}]".format(
            at, *(face.normal.round(9) + 0.0)
        )
    if face.radius is not None:
        what = "bore" if face.hollow and face.kind == "cylinder" else face.kind
        return f"a {what} of diameter {2e3 * face.radius:.6g} mm with its middle at {at}"
    return f"a face ({face.kind}) with its middle at {at}"


def require_size(bodies: Mapping[str, Body], *, of_file: bool) -> None:
    """Raise InvalidGeometry for an assembly so large that its file's units are wrong, or that a
    damaged file has a stray point; one that is not `of_file` is drawn by its own dimensions."""
    sides = np.max([b.upper for b in bodies.values()], axis=0)
    sides = sides - np.min([b.lower for b in bodies.values()], axis=0)
    if sides.max() > MAX_SIZE:
        size = " x ".join(f"{side:.4g}" for side in sides)
        usual = np.median([np.max(f.upper - f.lower) for b in bodies.values() for f in b.faces])
        if sides.max() > MAX_SIZE_RATIO * usual:
            raise InvalidGeometry(
                f"the assembly is {size} m, while half of its faces are smaller than {usual:.3g} m:"
                " its file is damaged; export it again."
            )
        if not of_file:
            raise InvalidGeometry(
                f"the assembly is {size} m, allowed are {MAX_SIZE:g} m: its bodies "
                'are drawn in metres; write "80 mm" or 0.08 for 80 mm.'
            )
        raise InvalidGeometry(
            f"the assembly is {size} m, allowed are {MAX_SIZE:g} m: its file is in "
            "other units than it says, or a mesh not in metres; write it anew."
        )
