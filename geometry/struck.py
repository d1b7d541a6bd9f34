"""The face of a body that is struck at a point: a plane, a cylinder or a sphere."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.solids import SAME, Body, Face, off_axis, parallel


class Struck(NamedTuple):
    """The face that the chain leans on, and the point struck; of a round one its middle, radius and
    axis."""

    face: tuple  # geometry.selectors.Selected
    point: NDArray[np.float64]  # (3,) [m]
    centre: NDArray[np.float64] | None = None  # (3,) [m] on a cylinder's axis, or a sphere's
    radius: float | None = None  # [m] < 0 of a hollow
    axis: NDArray[np.float64] | None = None  # (3,) of a cylinder
    normal: NDArray[np.float64] | None = None  # (3,) of a plane

    @property
    def radii(self) -> tuple[float, float]:
        """Principal radii of curvature [m]."""
        one = np.inf if self.radius is None else self.radius
        return (one if self.axis is None else np.inf, one)

    @property
    def away(self) -> NDArray[np.float64]:
        """From the middle or the axis of a round face to the point, (3,) [m]."""
        away = self.point - self.centre
        return away if self.axis is None else away - (away @ self.axis) * self.axis

    @property
    def outward(self) -> NDArray[np.float64]:
        """A normal of the face there, (3,) of any length."""
        return self.away if self.normal is None else self.normal

    @property
    def foot(self) -> NDArray[np.float64]:
        """The point moved onto a round surface."""
        beside = np.linalg.norm(self.away)
        return self.point + (abs(self.radius) / beside - 1) * self.away


def nearest(faces: Sequence[Face], body: Body, near: Sequence[float]) -> Face:
    """The face nearest to a point (3,) [m]."""
    return min(faces, key=lambda face: body.distance(near, face.tag))


def struck_at(body: Body, faces: Sequence[Face], first: Face, near: Sequence[float]) -> Struck:
    """The surface of a plane or round face, with those that go on in it, struck near a point; of a
    round one the point is not moved onto it."""
    from geometry.selectors import Selected  # loads gmsh

    own = Selected(body.name, tuple(f.tag for f in faces if _one_surface(first, f)))
    if first.normal is not None:
        off = (first.centre - near) @ first.normal
        return Struck(own, near + off * first.normal, normal=first.normal)
    radius = -first.radius if first.hollow else first.radius
    return Struck(own, np.array(near), first.on_axis, radius, first.axis)


def _one_surface(one: Face, other: Face) -> bool:
    if one.kind != other.kind:
        return False
    if one.normal is not None:
        return (
            parallel(one.normal, other.normal)
            and abs((one.centre - other.centre) @ one.normal) < SAME
        )
    apart = other.on_axis - one.on_axis
    beside = off_axis(other.on_axis, one.on_axis, one.axis) if one.axis is not None else apart
    turned = one.axis is not None and not parallel(one.axis, other.axis)
    return not turned and max(np.linalg.norm(beside), abs(one.radius - other.radius)) < SAME
