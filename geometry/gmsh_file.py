"""Meshes that gmsh wrote, read by gmsh itself: named groups of cells, corners only.

Files may have any version of the format, elements of any order, groups that overlap, and cells in
no group.
"""

from collections import defaultdict
from pathlib import Path

import gmsh
import numpy as np
from numpy.typing import NDArray

from geometry.cell_groups import CellGroup
from geometry.errors import InvalidGeometry
from geometry.gmsh_session import session

HEAD, END = b"$MeshFormat", b"$EndElements"


def cell_groups(path: Path) -> tuple[NDArray[np.float64], list[CellGroup]]:
    """Points (n, 3) and the named volumes and surfaces of a .msh file.

    Raises InvalidGeometry for a file that is no mesh of gmsh or is cut off, ValueError for what
    gmsh cannot read.
    """
    content = path.read_bytes()
    # gmsh would run a file without this head as a script
    if not content.removeprefix(b"\xef\xbb\xbf").startswith((HEAD, b"$Comments")):
        raise InvalidGeometry("it does not begin with $MeshFormat")
    if END not in content:
        raise InvalidGeometry("it is cut off before $EndElements")

    # cells by name, dimension and number of corners, over all entities of a physical group; number
    # (tags,) is the row of each node, since tags have gaps
    groups: dict = defaultdict(list)
    with session("gmsh could not read it"):
        gmsh.merge(str(path))
        tags, points, _ = gmsh.model.mesh.getNodes()
        number = np.full(int(tags.max(initial=0)) + 1, -1)
        number[tags.astype(np.int64)] = np.arange(len(tags))
        entities = (
            (dimension, gmsh.model.getPhysicalName(dimension, group), entity)
            for dimension in (2, 3)
            for _, group in gmsh.model.getPhysicalGroups(dimension)
            for entity in gmsh.model.getEntitiesForPhysicalGroup(dimension, group)
        )
        for dimension, name, entity in entities:
            kinds, _, nodes = gmsh.model.mesh.getElements(dimension, entity)
            # of elements of any order the first nodes are the corners
            for kind, flat in zip(kinds, nodes, strict=True):
                *_, n_nodes, _, n_corners = gmsh.model.mesh.getElementProperties(kind)
                corners = flat.astype(np.int64).reshape(-1, n_nodes)[:, :n_corners]
                groups[name, dimension, n_corners].append(number[corners])
    cells = {key: np.concatenate(corners) for key, corners in groups.items()}
    named = [CellGroup(name, dimension, c) for (name, dimension, _), c in cells.items() if name]
    return points.reshape(-1, 3), named
