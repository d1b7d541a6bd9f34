"""A named group of cells of a mesh file: the cells of one volume or of one surface."""

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

CORNERS = {  # of a cell by its dimension and its number of nodes
    (3, 4): 4, (3, 10): 4, (3, 8): 8, (3, 20): 8, (3, 27): 8,
    (3, 5): 5, (3, 13): 5, (3, 14): 5, (3, 6): 6, (3, 15): 6, (3, 18): 6,
    (2, 3): 3, (2, 6): 3, (2, 7): 3, (2, 4): 4, (2, 8): 4, (2, 9): 4,
}  # fmt: skip


class Origin(IntEnum):
    """Source of the name of a group; of two groups of one content the smaller one names the
    body."""

    NAME = 0  # a group that somebody named
    BLOCK = 1  # a block of elements that carries a name
    NUMBER = 2  # no name: the number of a property or of a volume; used if nothing has a name


class CellGroup(NamedTuple):
    """A volume's cells have 4 (tetrahedra) to 8 corners, a surface's 3 or 4."""

    name: str
    dimension: int
    # (n, nodes of a cell) into points, ordered as VTK does: corners, then the middles of edges; -1
    # in place of a middle that the file leaves out
    nodes: NDArray[np.int64]
    origin: Origin = Origin.NAME

    @property
    def corners(self) -> NDArray[np.int64]:
        """Corners (n, corners of a cell)."""
        return self.nodes[:, : CORNERS[self.dimension, self.nodes.shape[1]]]


class MeshFile(NamedTuple):
    """Points and groups of cells of a file; groups may overlap."""

    points: NDArray[np.float64]  # (n, 3) [m]
    groups: list[CellGroup]
