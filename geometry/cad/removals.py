"""Features that meshes leave out, and places where none may be."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.geometry.cad.solids import Vector


class Removal(NamedTuple):
    """A feature that the mesh of a body leaves out."""

    body: str
    faces: tuple[str, ...]  # "body@x,y,z" [m] of each face
    size: float  # [m] diameter of a hole, radius of a rounding, diagonal of small faces
    volume: float  # [m^3] filled and taken away together
    factor: float  # of the strain energy of this volume, see `geometry.cad.simplified`
    places: NDArray[np.float64]  # (n, 3) [m] on its faces


class Zone(NamedTuple):
    """A ball in which all faces stay."""

    body: str
    centre: Vector  # (3,) [m]
    radius: float  # m
