"""Named volumes and surfaces of any mesh file, by the reader of its suffix.

.msh and .med are read by gmsh, which gets files of these suffixes alone: it runs what it does not
know as a script. Decks of Abaqus and Nastran and universal files have readers of ours, since those
of meshio and gmsh lose names or mix blocks; all others are read by meshio.
"""

from collections.abc import Callable
from contextlib import redirect_stdout
from importlib import import_module
from io import StringIO
from pathlib import Path

import numpy as np

from beadwave.geometry.own_mesh.cell_groups import CORNERS, CellGroup, MeshFile, Origin

READERS = {
    ".msh": "gmsh_file", ".med": "gmsh_file", ".inp": "abaqus_deck", ".bdf": "nastran_deck",
    ".nas": "nastran_deck", ".unv": "universal_file",
}  # fmt: skip
DIMENSION = {"tetra": 3, "hexahedron": 3, "pyramid": 3, "wedge": 3, "triangle": 2, "quad": 2}
# cell data by which formats of meshio number their volumes
NUMBERS = (
    "medit:ref", "gmsh:physical", "avsucd:material", "tetgen:ref", "su2:tag", "cell_tags",
    "CellEntityIds", "MaterialIDs", "MaterialIds", "material",
)  # fmt: skip


def mesh_file(path: Path) -> MeshFile:
    """Points, which are taken in metres unless the file states its unit, and the groups of cells.

    A damaged file may raise anything that meshio raises, those of other readers InvalidGeometry or
    ValueError.
    """
    module = READERS.get(path.suffix.lower())
    read: Callable[[Path], MeshFile] = (
        import_module(f"beadwave.geometry.own_mesh.{module}").read if module else _by_meshio
    )
    return read(path)


def _by_meshio(path: Path) -> MeshFile:
    import meshio
    from skfem.io.meshio import HEX_MAPPING, from_meshio

    with redirect_stdout(StringIO()):
        file = meshio.read(path)

    # what scikit-fem wrote: tags, its own order of corners
    if any(name.startswith("skfem:") for name in file.cell_data):
        mesh = from_meshio(file)
        t = mesh.t if len(mesh.t) == 4 else mesh.t[HEX_MAPPING[:8]]
        groups = [CellGroup(n, 3, t[:, cells].T) for n, cells in (mesh.subdomains or {}).items()]
        for name, facets in (mesh.boundaries or {}).items():
            groups.append(CellGroup(name, 2, mesh.facets[:, facets].T))
        return MeshFile(mesh.p.T[: mesh.nvertices], groups)

    # sets carry the names; without any, the numbers that formats give to cells
    blocks = []
    for number, block in enumerate(file.cells):
        kind = next((k for k in DIMENSION if block.type.startswith(k)), None)
        if kind and (DIMENSION[kind], block.data.shape[1]) in CORNERS:
            blocks.append((number, DIMENSION[kind], block.data))
    groups = []
    for name, members in file.cell_sets.items():
        for number, dimension, nodes in blocks:
            chosen = members[number]
            if chosen is not None and len(chosen):
                groups.append(CellGroup(name, dimension, nodes[chosen]))
    numbers = next((file.cell_data[key] for key in NUMBERS if key in file.cell_data), None)
    for number, dimension, nodes in blocks:
        tags = np.ones(len(nodes), int) if numbers is None else np.ravel(numbers[number])
        for tag in np.unique(tags) if dimension == 3 else ():
            groups.append(CellGroup(f"{tag}", 3, nodes[tags == tag], Origin.NUMBER))
    points = np.asarray(file.points, float)
    if points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points))])
    return MeshFile(points, groups)
