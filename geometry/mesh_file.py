"""Named volumes and surfaces of any mesh file, corners only; what gmsh wrote is read by gmsh.

Of what meshio reads, sets of cells carry the names (Abaqus, CalculiX, ...), or the tags that
scikit-fem writes.
"""

from collections.abc import Iterator
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
    """Points (n, 3) and groups; a damaged file may raise anything."""
    if path.suffix.lower() == ".msh":
        from geometry.gmsh_file import cell_groups as by_gmsh

        return by_gmsh(path)
    with redirect_stdout(StringIO()):
        whole = meshio.read(path)
    if any(name.startswith("skfem:") for name in whole.cell_data):
        mesh = from_meshio(whole)
        return mesh.p.T, list(_tagged(mesh))
    return np.asarray(whole.points, float), list(_in_sets(whole))


def _in_sets(whole: meshio.Mesh) -> Iterator[CellGroup]:
    for name, members in whole.cell_sets.items():
        for block, chosen in zip(whole.cells, members, strict=True):
            kind = next((k for k in CORNERS if block.type.startswith(k)), None)
            if kind and chosen is not None and len(chosen):
                n_corners, dimension = CORNERS[kind]
                yield CellGroup(name, dimension, block.data[chosen][:, :n_corners])


def _tagged(mesh) -> Iterator[CellGroup]:
    t = mesh.t if len(mesh.t) == 4 else mesh.t[HEX_MAPPING[:8]]
    for name, cells in (mesh.subdomains or {}).items():
        yield CellGroup(name, 3, t[:, cells].T)
    for name, facets in (mesh.boundaries or {}).items():
        yield CellGroup(name, 2, mesh.facets[:, facets].T)
