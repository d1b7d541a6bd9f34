"""What every assembly hands over, whether the thesis' rig or bodies of a scene."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from skfem import Mesh

import fem

STRIKE = "strike"  # name of the face that the chain leans on
GMSH_NEEDS = (
    "apt-get install libgl1 libglu1-mesa libgomp1 libxcursor1 libxft2 libxinerama1 libxrender1"
)


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


class Parts(NamedTuple):
    """Bodies and how they are joined and held, but for the table below."""

    meshes: dict[str, Mesh]
    materials: dict[str, fem.Material | fem.Orthotropic]
    connections: fem.Connections
    struck: Struck | None = None
    load: fem.Load | None = None  # that it bears before it is struck

    @property
    def nodes(self) -> dict[str, float]:
        """Corners and middles of edges, by body."""
        return {name: float(m.nvertices + m.nedges) for name, m in self.meshes.items()}
