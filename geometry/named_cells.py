"""Meshes of bodies from files of named cells.

Volumes are named as the bodies, in gmsh as physical groups; a named surface is a face of its own.
Touching parts must not share nodes. Elements of any order are taken by their corners.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from skfem import Mesh, MeshHex, MeshTet
from skfem.io.meshio import INV_HEX_MAPPING

from geometry.cell_groups import CellGroup
from geometry.errors import InvalidGeometry

KINDS = {4: MeshTet, 8: MeshHex}  # by the corners of a cell
CELLS = {4: "tetrahedra", 5: "pyramids", 6: "prisms", 8: "hexahedra"}


class NamedCells(NamedTuple):
    """What a mesher wrote, and the name of the file for messages."""

    source: str
    points: NDArray[np.float64]  # (n_points, 3) [m]
    groups: list[CellGroup]


def volumes(cells: NamedCells) -> dict[str, Mesh]:
    """Every named volume as a mesh of its own, with the named surfaces on its outside as its
    boundaries; raises InvalidGeometry where there is none, for cells that are neither tetrahedra
    nor hexahedra, for both in one volume, and for cells in two volumes."""
    names = dict.fromkeys(g.name for g in cells.groups if g.dimension == 3)
    corners = {name: _corners(cells, name) for name in names}
    if not corners:
        raise InvalidGeometry(
            f"{cells.source} has no named volumes; name each body, in gmsh as a physical volume, "
            "elsewhere as a set of cells."
        )
    for kind in KINDS:
        of_kind = [t for t in corners.values() if t.shape[1] == kind]
        _require_once(cells, np.concatenate([np.empty((0, kind), np.int64), *of_kind]))
    meshes = {}
    for name, t in corners.items():
        solid = _solid(cells, {name: t})
        meshes[name] = solid.mesh.with_boundaries(_facets(solid, cells.groups))
    return meshes


def _corners(cells: NamedCells, body: str) -> NDArray[np.int64]:
    """Corners (n, 4 or 8) of a body's cells; raises InvalidGeometry for cells that are neither
    tetrahedra nor hexahedra."""
    groups = [g for g in cells.groups if (g.name, g.dimension) == (body, 3)]
    kinds = sorted({g.corners.shape[1] for g in groups})
    if len(kinds) > 1 or kinds[0] not in KINDS:
        mixture = " and ".join(CELLS.get(kind, f"cells of {kind} corners") for kind in kinds)
        raise InvalidGeometry(
            f"the mesh {cells.source!r} fills the volume {body!r} with {mixture}; give tetrahedra "
            "alone or hexahedra alone."
        )
    return np.concatenate([g.corners for g in groups])


class _Solid(NamedTuple):
    """The bodies as one mesh."""

    mesh: Mesh
    body: dict[str, NDArray[np.int64]]  # numbers of each body's cells
    number: NDArray[np.int64]  # (n_points,) node of each point of the file, -1 if no body uses it


def _solid(cells: NamedCells, corners: dict[str, NDArray[np.int64]]) -> _Solid:
    """One mesh of all these bodies; raises InvalidGeometry for both kinds of cells, and for cells
    that are in two bodies."""
    kinds = {t.shape[1]: name for name, t in corners.items()}
    if len(kinds) > 1:
        mixture = " and ".join(f"{name!r} with {CELLS[kind]}" for kind, name in kinds.items())
        raise InvalidGeometry(
            f"the mesh {cells.source!r} fills {mixture}; mesh all volumes with one of the two."
        )

    # nodes that cells use, renumbered; the file's order of a hexahedron's corners turned into
    # scikit-fem's, in which the mapping has a positive determinant
    (n_corners,) = kinds
    used, t = np.unique(np.concatenate(list(corners.values())), return_inverse=True)
    t = t.reshape(-1, n_corners)
    _require_once(cells, t)
    order = INV_HEX_MAPPING[:8] if n_corners == 8 else slice(None)
    mesh = KINDS[n_corners](*map(np.ascontiguousarray, (cells.points[used].T, t.T[order])))
    ends = np.cumsum([0, *map(len, corners.values())])
    number = np.full(len(cells.points), -1)
    number[used] = np.arange(len(used))
    return _Solid(mesh, {n: np.arange(*ends[i : i + 2]) for i, n in enumerate(corners)}, number)


def _require_once(cells: NamedCells, t: NDArray[np.int64]) -> None:
    """Raise InvalidGeometry where volumes overlap: their mass would count twice."""
    twice = len(t) - len(np.unique(np.sort(t, axis=1), axis=0))
    if twice:
        raise InvalidGeometry(
            f"the mesh {cells.source!r} has {twice} cells in two volumes; put each in one."
        )


def _facets(solid: _Solid, groups: list[CellGroup]) -> dict[str, NDArray[np.int64]]:
    """Facets on the boundary of the mesh, by the name of the surface that they belong to."""
    # facets are equal where their sorted corners are; those of a surface inside of the body, or
    # that another body owns, fall away
    outer = solid.mesh.boundary_facets()
    corners_of_outer = np.sort(solid.mesh.facets[:, outer], axis=0).T
    n = len(corners_of_outer)
    facets: dict[str, NDArray[np.int64]] = {}
    for name, dimension, corners in groups:
        if dimension == 2 and corners.shape[1] == corners_of_outer.shape[1]:
            in_mesh = np.sort(solid.number[corners], axis=1)
            both = np.concatenate([corners_of_outer, in_mesh])
            _, row = np.unique(both, axis=0, return_inverse=True)
            common = outer[np.isin(row[:n], row[n:])]
            facets[name] = np.union1d(facets.get(name, common), common)
    return {name: numbers for name, numbers in facets.items() if len(numbers)}
