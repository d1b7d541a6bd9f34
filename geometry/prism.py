"""Bodies that are one outline, extruded: boxes, plates with holes, tubes, in any direction.

top    =======          a body is one when all its faces are two caps, equal planes across an
sides  |  ||  |         axis, and sides along it, planes or cylinders; its volume is then the
base   =======          area of a cap times the height
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import gmsh
import numpy as np
from numpy.typing import NDArray

from geometry.imprint import Region
from geometry.solids import SAME, Body, Face, Vector, parallel

EXACT = 1e-9  # relative, of areas and volumes
UPRIGHT = 1e-6  # of a side's normal along the axis


class Prism(NamedTuple):
    axis: Vector  # from base to top
    height: float  # m
    base: tuple[Face, ...]
    top: tuple[Face, ...]
    sides: tuple[Face, ...]

    def heights(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Of points (..., 3) above the base [m]."""
        return (points - self.base[0].centre) @ self.axis

    def foot(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (..., 3) moved along the axis onto the base."""
        return points - self.heights(points)[..., None] * self.axis


class SidePatch(NamedTuple):
    """A part of a side between two heights and two lines along the axis."""

    region: Region
    lower: float  # m
    upper: float
    feet: NDArray[np.float64]  # (n, 3) where those lines stand on the base


class Imprints(NamedTuple):
    """What is to be seen in the mesh of a prism."""

    base: dict[int, Region]  # by tag, on the base or the top
    sides: dict[int, SidePatch]

    @property
    def sharp(self) -> list[SidePatch]:
        """Parts of sides with a singular rim."""
        return [patch for patch in self.sides.values() if patch.region.sharp]


def prisms(body: Body) -> Iterator[Prism]:
    """Every way to see a body as an extrusion, the lowest first."""
    found = []
    normals = [face.normal for face in body.faces if face.normal is not None]
    for i, axis in enumerate(normals):
        if not any(parallel(axis, other) for other in normals[:i]):
            found += _along(body, axis)
    yield from sorted(found, key=lambda prism: prism.height)


def _along(body: Body, axis: Vector) -> list[Prism]:
    caps = [f for f in body.faces if f.normal is not None and parallel(f.normal, axis)]
    sides = tuple(f for f in body.faces if not any(f is cap for cap in caps))
    top = tuple(f for f in caps if f.normal @ axis > 0)
    base = tuple(f for f in caps if f.normal @ axis < 0)
    if not (top and base and all(_upright(f, axis) for f in sides)):
        return []
    levels = [[f.centre @ axis for f in faces] for faces in (base, top)]
    height = levels[1][0] - levels[0][0]
    areas = [sum(f.area for f in faces) for faces in (base, top)]
    one = max(np.ptp(levels[0]), np.ptp(levels[1])) < SAME
    equal = np.allclose([areas[1] * height, areas[0] * height], body.volume, rtol=EXACT, atol=0)
    whole = all(_as_high(f, axis, height) for f in sides)
    return [Prism(axis, height, base, top, sides)] if one and equal and whole else []


def _upright(face: Face, axis: Vector) -> bool:
    if face.normal is not None:
        return abs(face.normal @ axis) < UPRIGHT
    return face.axis is not None and parallel(face.axis, axis)


def _as_high(face: Face, axis: Vector, height: float) -> bool:
    """Whether a side reaches from cap to cap all along."""
    ends = [gmsh.model.getValue(0, tag, []) @ axis for tag in corners_of(face.tag)]
    return bool(np.ptp(ends) > height - SAME and np.all(_at_either(ends)))


def _at_either(values: Sequence[float]) -> NDArray[np.bool_]:
    lowest, highest = min(values), max(values)
    return np.minimum(np.abs(np.subtract(values, lowest)), np.abs(np.subtract(values, highest))) < (
        SAME
    )


def corners_of(face: int) -> list[int]:
    """Tags of the points at the corners of a face."""
    points = gmsh.model.getBoundary([(2, face)], combined=False, oriented=False, recursive=True)
    return [tag for dimension, tag in points if dimension == 0]


def imprints(prism: Prism, wanted: Mapping[str, Sequence[Region]]) -> Imprints | None:
    """What can be extruded of what is wanted; None when a part on a side cannot."""
    caps = {face.tag for face in prism.base + prism.top}
    base, sides = {}, {}
    for region in (r for parts in wanted.values() for r in parts):
        if region.on in caps:
            base[region.tag] = region
            continue
        patch = _side_patch(prism, region)
        if patch is None:
            return None
        sides[region.tag] = patch
    return Imprints(base, sides)


def _side_patch(prism: Prism, region: Region) -> SidePatch | None:
    levels, feet = [], []
    for _, curve in gmsh.model.getBoundary([(2, region.tag)], oriented=False):
        (first,), (last,) = gmsh.model.getParametrizationBounds(1, curve)
        points = gmsh.model.getValue(1, curve, np.linspace(first, last, 5)).reshape(-1, 3)
        heights, below = prism.heights(points), prism.foot(points)
        if np.ptp(heights) < SAME:
            levels.append(heights[0])
        elif np.ptp(below, axis=0).max() < SAME:
            feet.append(below[0])
        else:
            return None
    if len(levels) < 2 or not np.all(_at_either(levels)):
        return None
    return SidePatch(region, min(levels), max(levels), np.reshape(feet, (-1, 3)))
