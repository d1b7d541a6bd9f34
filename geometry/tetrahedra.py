"""Tetrahedra of any body, by gmsh, with its boundaries."""

from collections.abc import Mapping, Sequence

import gmsh
import numpy as np
from numpy.typing import NDArray
from skfem import MeshTet

from geometry.facets import facets_of
from geometry.imprint import Region, imprinted
from geometry.roundness import enclosing, full_cylinders
from geometry.selectors import Selected
from geometry.sizes import Size, mesh_visible
from geometry.solids import Body

TRIANGLE, TETRAHEDRON = 2, 4  # gmsh's element types


def tetrahedra(
    body: Body,
    wanted: Mapping[str, Sequence[Region]],
    named: Mapping[str, Selected],
    size: Size,
    gap: float,
) -> MeshTet:
    """The body in straight tetrahedra."""
    split = imprinted(body, wanted, named, gap)
    mesh_visible([(3, split.tag)], size)
    p, used, cells = _nodes_and_cells(split.tag)
    cylinders = full_cylinders(split.tag, gap)
    round_faces = [face.tag for cylinder in cylinders for face in cylinder.faces]
    p = enclosing(p, {tag: _corners([tag], used) for tag in round_faces}, cylinders)
    mesh = MeshTet(np.ascontiguousarray(p.T), np.ascontiguousarray(cells.T))
    return mesh.with_boundaries(
        {name: facets_of(mesh, _corners(faces, used)) for name, faces in split.faces.items()}
    )


def _nodes_and_cells(volume: int):
    """Points (n, 3), gmsh's tags of them, and cells (m, 4) into the points."""
    tags, points, _ = gmsh.model.mesh.getNodes()
    _, cells = gmsh.model.mesh.getElementsByType(TETRAHEDRON, volume)
    used, cells = np.unique(cells, return_inverse=True)
    row = np.argsort(tags)
    p = points.reshape(-1, 3)[row[np.searchsorted(tags, used, sorter=row)]]
    return p, used, cells.reshape(-1, 4)


def _corners(faces: Sequence[int], used: NDArray) -> NDArray[np.int64]:
    """(n, 3) node numbers of the triangles on faces."""
    nodes = [gmsh.model.mesh.getElementsByType(TRIANGLE, tag)[1] for tag in faces]
    return np.searchsorted(used, np.concatenate([*nodes, []])).reshape(-1, 3)
