"""Meshes read by gmsh itself: its own files of every version, and MED files of Salome.

Elements may have order 1 or 2, or a higher one if they are straight; groups may overlap.
"""

from collections import defaultdict
from pathlib import Path
from tempfile import TemporaryDirectory

import gmsh
import numpy as np
from numpy.typing import NDArray

from beadwave.geometry.errors import InvalidGeometry
from beadwave.geometry.meshing.gmsh_session import session
from beadwave.geometry.own_mesh.cell_groups import CORNERS, CellGroup, MeshFile, Origin
from beadwave.system import link_or_copy

HEAD, END = b"$MeshFormat", b"$EndElements"
HDF = b"\x89HDF\r\n\x1a\n"

# VTK's order of the nodes of a cell by their places in it: corners, then middles of edges (pairs
# of corners), faces (fours) and the whole
EDGES = {
    (2, 3): [(0, 1), (1, 2), (2, 0)],
    (2, 4): [(0, 1), (1, 2), (2, 3), (3, 0)],
    (3, 4): [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)],
    (3, 8): [
        (0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4),
        (0, 4), (1, 5), (2, 6), (3, 7),
    ],
}  # fmt: skip
FACES = [(0, 3, 7, 4), (1, 2, 6, 5), (0, 1, 5, 4), (3, 2, 6, 7), (0, 1, 2, 3), (4, 5, 6, 7)]


def read(path: Path) -> MeshFile:
    """Points (n, 3) and the volumes and surfaces of a .msh or .med file.

    Raises InvalidGeometry for a file that has not the format of its suffix or is cut off, and for
    curved elements of a higher order; ValueError for what gmsh cannot read.
    """
    suffix, content = path.suffix.lower(), path.read_bytes()
    if suffix == ".med":
        if not content.startswith(HDF):
            raise InvalidGeometry("it is no MED file, which begins as HDF 5 does")
    # gmsh would run a file without this head as a script
    elif not content.removeprefix(b"\xef\xbb\xbf").startswith((HEAD, b"$Comments")):
        raise InvalidGeometry("it does not begin with $MeshFormat")
    elif END not in content:
        raise InvalidGeometry("it is cut off before $EndElements")

    # cells by name, dimension, number of nodes and origin, over all entities of a physical group;
    # number (tags,) is the row of each node, since tags have gaps
    groups: dict = defaultdict(list)
    with TemporaryDirectory() as folder, session("gmsh could not read it"):
        # gmsh knows a format by the suffix in small letters
        link = Path(folder) / f"mesh{suffix}"
        link_or_copy(path, link)
        gmsh.merge(str(link))
        tags, flat_points, _ = gmsh.model.mesh.getNodes()
        points = flat_points.reshape(-1, 3)
        number = np.full(int(tags.max(initial=0)) + 1, -1)
        number[tags.astype(np.int64)] = np.arange(len(tags))
        entities = []
        for dimension in (2, 3):
            for _, group in gmsh.model.getPhysicalGroups(dimension):
                # MED pads names to 80 letters
                name = gmsh.model.getPhysicalName(dimension, group).strip(" \0")
                key = (name, Origin.NAME) if name else (f"{group}", Origin.NUMBER)
                members = gmsh.model.getEntitiesForPhysicalGroup(dimension, group)
                entities += [(dimension, key, entity) for entity in members]
        if not any(dimension == 3 for dimension, *_ in entities):
            entities += [(3, (f"{e}", Origin.NUMBER), e) for _, e in gmsh.model.getEntities(3)]
        for dimension, key, entity in entities:
            kinds, _, nodes = gmsh.model.mesh.getElements(dimension, entity)
            for kind, flat in zip(kinds, nodes, strict=True):
                _, _, order, n_nodes, places, n_corners = gmsh.model.mesh.getElementProperties(kind)
                cells = number[flat.astype(np.int64).reshape(-1, n_nodes)]
                places = np.reshape(places, (n_nodes, -1))
                if order > 2:
                    _require_straight(points, cells, places, n_corners, order)
                    cells = cells[:, :n_corners]
                elif (dimension, n_corners) in EDGES and order == 2:
                    cells = cells[:, _as_vtk(places, dimension, n_corners)]
                if (dimension, cells.shape[1]) not in CORNERS:
                    cells = cells[:, :n_corners]
                groups[key, dimension, cells.shape[1]].append(cells)
    return MeshFile(
        points,
        [
            CellGroup(name, dimension, np.concatenate(cells), origin)
            for ((name, origin), dimension, _), cells in groups.items()
        ],
    )


def _as_vtk(places: NDArray[np.float64], dimension: int, n_corners: int) -> NDArray[np.int64]:
    """Columns (k,) of gmsh's nodes in VTK's order; places (k, dimension) are theirs in the
    reference cell."""
    means = [(i,) for i in range(n_corners)] + EDGES[dimension, n_corners]
    if len(places) > len(means):
        means = means + ([*FACES, tuple(range(8))] if n_corners == 8 else [tuple(range(n_corners))])
    wanted = np.array([places[list(ends)].mean(axis=0) for ends in means[: len(places)]])
    off = np.linalg.norm(wanted[:, None] - places, axis=-1)
    return off.argmin(axis=1)


def _require_straight(
    points: NDArray[np.float64],
    cells: NDArray[np.int64],
    places: NDArray[np.float64],
    n_corners: int,
    order: int,
) -> None:
    """Raise InvalidGeometry for cells of a higher order whose nodes are not where those of straight
    cells are: they are taken by their corners."""
    # affine map of the first corners: enough to tell curved from straight
    corners = points[cells[:, : places.shape[1] + 1]]
    if n_corners != places.shape[1] + 1:
        curved = True
    else:
        straight = corners[:, :1] + np.einsum(
            "kd,nde->nke", places, corners[:, 1:] - corners[:, :1]
        )
        off = np.abs(points[cells] - straight).max()
        curved = off > 1e-6 * np.ptp(corners, axis=1).max()
    if curved:
        raise InvalidGeometry(f"it has curved elements of order {order}; write order 1 or 2")
