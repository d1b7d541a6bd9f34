"""Meshes of bodies from files of named cells.

Volumes are named as the bodies, in gmsh as physical groups; a named surface is a face of its own.
Touching parts must not share nodes: each body is a mesh of its own.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from skfem import Mesh, MeshHex, MeshTet
from skfem.io.meshio import INV_HEX_MAPPING

from beadwave.geometry.errors import InvalidGeometry
from beadwave.geometry.own_mesh.cell_groups import CellGroup, MeshFile, Origin
from beadwave.geometry.own_mesh.cover import CellSet, bodies_of
from beadwave.geometry.own_mesh.curved import curved
from beadwave.geometry.own_mesh.mesh_faults import merged, require_sound

KINDS = {4: MeshTet, 8: MeshHex}  # by the corners of a cell
CELLS = {4: "tetrahedra", 5: "pyramids", 6: "prisms", 8: "hexahedra"}


class OwnVolumes(NamedTuple):
    """Bodies of a mesh file, and sentences on what of the file is left out."""

    meshes: dict[str, Mesh]
    remarks: tuple[str, ...]


def volumes(
    file: MeshFile, source: str, *, chosen: Sequence[str] = (), merge: float | None = None
) -> OwnVolumes:
    """Every body as a mesh of its own, with the named surfaces on its outside as its boundaries.

    Bodies are the sets that are `chosen`, or the smallest family in which each cell is once. Nodes
    of a body nearer than `merge` [m] are merged; by 0 a body may be in pieces. `source` is the
    file's name for messages. Raises InvalidGeometry where there are none, for cells that are
    neither tetrahedra nor hexahedra or both, for cells in two bodies, for a choice that is not in
    the file, and for the faults of `geometry.own_mesh.mesh_faults`.
    """
    solid_groups = [group for group in file.groups if group.dimension == 3]
    if not solid_groups:
        raise InvalidGeometry(
            f"{source} has no volumes: no tetrahedra and no hexahedra; fill the bodies with cells."
        )
    sets = _sets(solid_groups)
    if missing := [name for name in chosen if name not in sets]:
        raise InvalidGeometry(
            f"{source} has no volume {missing[0]!r} of assembly.volumes; there are "
            f"{', '.join(map(repr, list(sets)[:20]))}."
        )
    names = list(chosen) or bodies_of(sets, source)
    meshes = {name: _body(file, name, source, merge) for name in names}
    cells = [sets[name].cells for name in names]
    numbers, counts = np.unique(np.concatenate(cells), return_counts=True)
    if twice := int((counts > 1).sum()):
        raise InvalidGeometry(
            f"the mesh {source!r} has {twice} cells in two volumes of assembly.volumes; name sets "
            "that have no cell in common."
        )
    remarks = []
    everything = np.unique(np.concatenate([one.cells for one in sets.values()]))
    if n := len(np.setdiff1d(everything, numbers)):
        remarks.append(f"{n} cells of {source} are in no body that has a name and are left out.")
    others = [n for n, one in sets.items() if n not in names and one.origin != Origin.NUMBER]
    if others and not chosen:
        listed = ", ".join(map(repr, others[:10])) + (", ..." if len(others) > 10 else "")
        remarks.append(
            f"Sets of {source} that are no bodies: {listed}; assembly.volumes chooses others."
        )
    return OwnVolumes(meshes, tuple(remarks))


def _sets(groups: Sequence[CellGroup]) -> dict[str, CellSet]:
    """The sets of cells by name; a cell is known by its corners, so that one that is listed in two
    sets is the same."""
    # corners of all cells in rows of eight; the first is repeated in cells of fewer
    rows = [np.sort(g.corners, axis=1) for g in groups]
    rows = [np.pad(r, ((0, 0), (0, 8 - r.shape[1])), constant_values=-1) for r in rows]
    _, number = np.unique(np.concatenate(rows), axis=0, return_inverse=True)
    ends = np.cumsum([0, *map(len, rows)])
    sets: dict[str, CellSet] = {}
    for i, group in enumerate(groups):
        cells = number.ravel()[ends[i] : ends[i + 1]]
        old = sets.get(group.name)
        if old:
            cells = np.union1d(old.cells, cells)
        origin = min(group.origin, old.origin) if old else group.origin
        sets[group.name] = CellSet(group.name, origin, np.unique(cells))
    return sets


def _body(file: MeshFile, name: str, source: str, merge: float | None) -> Mesh:
    """The mesh of a volume with its boundaries; raises as `volumes`."""
    t = _corners(file.groups, name, source)
    doubled = (np.diff(np.sort(t, axis=1)) == 0).any(axis=1)
    if doubled.any():
        raise InvalidGeometry(
            f"the mesh {source!r} has {doubled.sum()} cells in {name!r} that name a node twice; "
            "mesh them as what they are, or with tetrahedra."
        )
    if twice := len(t) - len(np.unique(np.sort(t, axis=1), axis=0)):
        raise InvalidGeometry(f"the mesh {source!r} lists {twice} cells of {name!r} twice.")

    # nodes that cells use, renumbered: node (n_points,) of each point of the file, -1 where the
    # body has none; the file's order of a hexahedron's corners turned into scikit-fem's, in which
    # the mapping has a positive determinant
    used = np.unique(t)
    node = np.full(len(file.points), -1)
    if merge:
        inside = np.searchsorted(used, t)
        kept, node[used] = np.unique(
            used[merged(file.points[used], inside, merge, name)], return_inverse=True
        )
        used = kept
    else:
        node[used] = np.arange(len(used))
    order = INV_HEX_MAPPING[:8] if t.shape[1] == 8 else slice(None)
    mesh = KINDS[t.shape[1]](
        np.ascontiguousarray(file.points[used].T), np.ascontiguousarray(node[t].T[order])
    )
    middles = _middles(file, name, t.shape[1])
    if middles is not None:
        mesh = curved(mesh, node[t], middles)
    require_sound(mesh, name, source, as_it_is=merge == 0)
    return mesh.with_boundaries(_facets(mesh, node, file.groups))


def _corners(groups: Sequence[CellGroup], body: str, source: str) -> NDArray[np.int64]:
    """Corners (n, 4 or 8) of a body's cells; raises InvalidGeometry for cells that are neither
    tetrahedra nor hexahedra."""
    of_body = [group for group in groups if (group.name, group.dimension) == (body, 3)]
    kinds = sorted({group.corners.shape[1] for group in of_body})
    if len(kinds) > 1 or kinds[0] not in KINDS:
        mixture = " and ".join(CELLS[kind] for kind in kinds)
        raise InvalidGeometry(
            f"the mesh {source!r} fills the volume {body!r} with {mixture}; give tetrahedra alone "
            "or hexahedra alone."
        )
    return np.concatenate([group.corners for group in of_body])


def _middles(file: MeshFile, body: str, n_corners: int) -> NDArray[np.float64] | None:
    """Nodes (n, edges, 3) [m] in the middles of the edges of a body's cells, NaN where there is
    none; None where no cell has one."""
    n = {4: 10, 8: 20}[n_corners]
    of_body = [g.nodes for g in file.groups if (g.name, g.dimension) == (body, 3)]
    if all(nodes.shape[1] == n_corners for nodes in of_body):
        return None
    filled = [np.pad(a, ((0, 0), (0, max(0, n - a.shape[1]))), constant_values=-1) for a in of_body]
    nodes = np.concatenate([a[:, n_corners:n] for a in filled])
    return np.where(nodes[..., None] < 0, np.nan, file.points[nodes])


def _facets(
    mesh: Mesh, node: NDArray[np.int64], groups: Sequence[CellGroup]
) -> dict[str, NDArray[np.int64]]:
    """Facets on the boundary of the mesh, by the name of the surface that they belong to."""
    # facets are equal where their sorted corners are; those of a surface inside of the body, or
    # that another body owns, fall away
    outer = mesh.boundary_facets()
    corners_of_outer = np.sort(mesh.facets[:, outer], axis=0).T
    n = len(corners_of_outer)
    facets: dict[str, NDArray[np.int64]] = {}
    for group in groups:
        if group.dimension == 2 and group.corners.shape[1] == corners_of_outer.shape[1]:
            in_mesh = np.sort(node[group.corners], axis=1)
            both = np.concatenate([corners_of_outer, in_mesh])
            _, row = np.unique(both, axis=0, return_inverse=True)
            common = outer[np.isin(row[:n], row[n:])]
            facets[group.name] = np.union1d(facets.get(group.name, common), common)
    return {name: numbers for name, numbers in facets.items() if len(numbers)}
