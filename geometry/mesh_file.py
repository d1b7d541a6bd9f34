"""Named volumes and surfaces of any mesh file, corners of cells only; gmsh reads its own files.

Of what meshio reads, sets of cells carry the names (Abaqus, CalculiX, ...), or the tags that
scikit-fem writes.
"""

from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import meshio
import numpy as np
from numpy.typing import NDArray
from skfem.io.meshio import HEX_MAPPING, from_meshio

from geometry.cell_groups import CellGroup

CORNERS = {  # of cells whose type begins so, whatever their order, and the dimensions they fill
    "tetra": (4, 3), "hexahedron": (8, 3), "pyramid": (5, 3), "wedge": (6, 3),
    "triangle": (3, 2), "quad": (4, 2),
}  # fmt: skip


def cell_groups(path: Path) -> tuple[NDArray[np.float64], list[CellGroup]]:
    """Points (n, 3), which are taken in metres, and the named groups of cells by their corners.

    Cells without a name, and kinds that are not in CORNERS, are left out. A damaged file may raise
    anything that meshio raises; gmsh's files raise as `geometry.gmsh_file.cell_groups`.
    """
    if path.suffix.lower() == ".msh":
        from geometry.gmsh_file import cell_groups as by_gmsh

        return by_gmsh(path)
    with redirect_stdout(StringIO()):
        file = meshio.read(path)

    # what scikit-fem wrote: tags, its own order of corners
    if any(name.startswith("skfem:") for name in file.cell_data):
        mesh = from_meshio(file)
        t = mesh.t if len(mesh.t) == 4 else mesh.t[HEX_MAPPING[:8]]
        groups = [CellGroup(n, 3, t[:, cells].T) for n, cells in (mesh.subdomains or {}).items()]
        for name, facets in (mesh.boundaries or {}).items():
            groups.append(CellGroup(name, 2, mesh.facets[:, facets].T))
        return mesh.p.T, groups

    groups = []
    for name, members in file.cell_sets.items():
        for block, chosen in zip(file.cells, members, strict=True):
            kind = next((k for k in CORNERS if block.type.startswith(k)), None)
            if kind and chosen is not None and len(chosen):
                n_corners, dimension = CORNERS[kind]
                groups.append(CellGroup(name, dimension, block.data[chosen][:, :n_corners]))
    return np.asarray(file.points, float), groups
