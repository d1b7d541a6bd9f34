"""What the mesh stage hands to the model, of the thesis' rig and of bodies of a scene alike."""

from typing import NamedTuple

from skfem import Mesh

import fem
from geometry.struck import Struck

STRIKE = "strike"  # name of the face that the chain leans on
GMSH_NEEDS = (
    "apt-get install libgl1 libglu1-mesa libgomp1 libxcursor1 libxft2 libxinerama1 libxrender1"
)


class Parts(NamedTuple):
    """Bodies and how they are joined and held; a swaying table below is added by the model."""

    meshes: dict[str, Mesh]
    materials: dict[str, fem.Material | fem.Orthotropic]
    connections: fem.Connections
    struck: Struck | None = None
    load: fem.Load | None = None  # that it bears before it is struck

    @property
    def nodes(self) -> dict[str, float]:
        """Corners and middles of edges, by body."""
        return {name: float(m.nvertices + m.nedges) for name, m in self.meshes.items()}
