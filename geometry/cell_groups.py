"""A named group of cells of a mesh file: the cells of one volume or of one surface."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class CellGroup(NamedTuple):
    """A volume's cells have 4 (tetrahedra) to 8 corners, a surface's 3 or 4."""

    name: str
    dimension: int
    corners: NDArray[np.int64]  # (n, corners of a cell) into points; as gmsh and VTK order them
