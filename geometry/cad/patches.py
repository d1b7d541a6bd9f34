"""Parts of faces that something acts on: under a washer, a bolt's share, a thread, pads.

On a CAD model they are imprinted (`geometry.cad.imprint`), on a mesh they are the facets whose
middles lie in them (`geometry.own_mesh.faceted_touching`).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.geometry.cad.selectors import FaceSelection
from beadwave.geometry.cad.solids import Vector


class Disc(NamedTuple):
    """A round patch on plane faces of a body: under a washer, or where the chain strikes."""

    on: FaceSelection
    centre: Vector  # (3,) [m]
    normal: Vector  # (3,) unit vector, along the outward normal of the faces or opposite to it
    radius: float  # m


class CurvedDisc(NamedTuple):
    """The part of curved faces of a body within a radius of an axis, on the side of a point of it:
    under a bolt that presses them."""

    on: FaceSelection
    centre: Vector  # (3,) where the axis meets the faces [m]
    normal: Vector  # (3,) unit vector along the axis
    radius: float  # m

    def hold(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """True for points (p, 3) [m] of the faces that lie in it."""
        off = points - self.centre
        along = np.abs(off @ self.normal)
        return (along <= self.radius) & (
            np.linalg.norm(np.cross(off, self.normal), axis=1) <= self.radius
        )


class Share(NamedTuple):
    """The part of the common face of two bodies that is nearer to one bolt than to the others."""

    on: FaceSelection
    regions: tuple[int, ...]  # tags of the common face's surfaces in the CAD model
    centre: Vector  # (3,) of the bolt [m]
    others: Sequence[Vector]  # (3,) each, of the other bolts [m]
    pair: str  # the two bodies, "a|b"


class ThreadBand(NamedTuple):
    """The part of a cylinder's faces between two planes normal to its axis, along which a thread
    engages."""

    on: FaceSelection
    centre: Vector  # (3,) on the axis, half-way between the planes [m]
    axis: Vector  # (3,) unit vector
    length: float  # m, between the planes


class Spots(NamedTuple):
    """Discs or rectangles on plane faces of a body, taken together: pads, or what several screws
    press on."""

    on: FaceSelection
    centres: NDArray[np.float64]  # (n, 3) [m], moved onto the plane of the faces
    normal: Vector  # (3,) of the faces
    radius: float | None = None  # m
    sides: tuple[float, float] | None = None  # m, of rectangles, along the axes that span the faces

    @property
    def axes(self) -> NDArray[np.float64]:
        """The two global axes (2, 3) that span the plane."""
        return np.delete(np.eye(3), np.argmax(np.abs(self.normal)), axis=0)

    def hold(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """True for points (p, 3) [m] of the faces that lie in one of them."""
        off = points[:, None] - self.centres  # (p, n, 3)
        if self.radius is not None:
            inside = np.linalg.norm(np.cross(off, self.normal), axis=2) <= self.radius
        else:
            inside = np.all(np.abs(off @ self.axes.T) <= np.array(self.sides) / 2, axis=2)
        return np.any(inside, axis=1)


Patch = Disc | CurvedDisc | Share | ThreadBand | Spots
