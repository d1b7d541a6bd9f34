"""The face of a body that is struck at a point: a plane, a cylinder or a sphere."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.geometry.cad.solids import SAME, Body, Face, off_axis, parallel

if TYPE_CHECKING:  # loads gmsh
    from beadwave.geometry.cad.selectors import FaceSelection


class Struck(NamedTuple):
    """The face that the chain strikes, and the point struck; of a round face its centre, radius and
    axis, of a plane one its normal."""

    face: FaceSelection
    point: NDArray[np.float64]  # (3,) [m]
    centre: NDArray[np.float64] | None = None  # (3,) [m] on a cylinder's axis, or a sphere's
    radius: float | None = None  # [m] < 0 of a hollow
    axis: NDArray[np.float64] | None = None  # (3,) of a cylinder
    normal: NDArray[np.float64] | None = None  # (3,) of a plane

    @property
    def radii(self) -> tuple[float, float]:
        """Principal radii of curvature [m], < 0 where hollow, inf where straight: (inf, inf) of a
        plane, (inf, R) of a cylinder, along its axis and around it, (R, R) of a sphere."""
        radius = np.inf if self.radius is None else self.radius
        return (radius if self.axis is None else np.inf, radius)

    @property
    def away(self) -> NDArray[np.float64]:
        """Vector (3,) [m] to the point from the centre of a sphere or the axis of a cylinder."""
        away = self.point - self.centre
        return away if self.axis is None else away - (away @ self.axis) * self.axis

    @property
    def outward(self) -> NDArray[np.float64]:
        """Outward normal (3,) of the face at the point, not of length 1."""
        return self.away if self.normal is None else self.normal

    @property
    def foot(self) -> NDArray[np.float64]:
        """The point (3,) [m] moved along the normal onto a round surface; it must not lie on the
        axis or in the centre, where there is no normal."""
        distance = np.linalg.norm(self.away)
        return self.point + (abs(self.radius) / distance - 1) * self.away


def nearest(faces: Sequence[Face], body: Body, point: Sequence[float]) -> Face:
    """The face nearest to a point (3,) [m]."""
    return min(faces, key=lambda face: body.distance(point, face.tag))


def struck_at(body: Body, faces: Sequence[Face], first: Face, point: Sequence[float]) -> Struck:
    """The face `first` and all other faces of the same plane, cylinder or sphere, struck near a
    point (3,) [m], which is not moved onto a round face."""
    from beadwave.geometry.cad.selectors import FaceSelection  # loads gmsh

    # faces of one surface: a split cylinder or plane is struck as a whole
    tags = []
    for face in (face for face in faces if face.kind == first.kind):
        if first.normal is not None:
            level = abs((first.centre - face.centre) @ first.normal)
            if parallel(first.normal, face.normal) and level < SAME:
                tags.append(face.tag)
            continue
        off = face.on_axis - first.on_axis
        if first.axis is not None:
            if not parallel(first.axis, face.axis):
                continue
            off = off_axis(face.on_axis, first.on_axis, first.axis)
        if max(np.linalg.norm(off), abs(first.radius - face.radius)) < SAME:
            tags.append(face.tag)
    surface = FaceSelection(body.name, tuple(tags))

    if first.normal is not None:
        height = (first.centre - point) @ first.normal
        return Struck(surface, point + height * first.normal, normal=first.normal)
    radius = -first.radius if first.hollow else first.radius
    return Struck(surface, np.array(point), first.on_axis, radius, first.axis)
