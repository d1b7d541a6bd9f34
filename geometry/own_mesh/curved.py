"""Curved quadratic cells: nodes in the middles of edges that are off the straight cell.

A tetrahedron of 10 nodes is scikit-fem's MeshTet2; a hexahedron of 20 nodes becomes its MeshHex2 of
27 exactly, x(X) = sum_i N_i(X) x_i by the serendipity functions N_i, at the middle of a face and of
the cell (O. C. Zienkiewicz and R. L. Taylor, The Finite Element Method, volume 1 (2000), 8.6):

    face = 1/2 sum of its 4 edges' nodes - 1/4 sum of its 4 corners
    cell = 1/4 sum of the 12 edges' nodes - 1/4 sum of the 8 corners

A mesh whose nodes lie in the middles of straight edges stays one of its corners, which is faster.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # see `lined`
    from skfem import Mesh

# corners of each edge in VTK's order of a cell's nodes, by the number of corners
EDGES = {
    4: [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)],
    8: [
        (0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4),
        (0, 4), (1, 5), (2, 6), (3, 7),
    ],
}  # fmt: skip
# distance of a node from the middle of its edge, over the edge: less is rounding of a file
STRAIGHT = 1e-4
INSIDE = 1e-6  # barycentric coordinate below 0 that is rounding
POINTS_AT_ONCE = 400_000  # pairs of a point and a cell, 80 MB


def curved(mesh: Mesh, corners: NDArray[np.int64], middles: NDArray[np.float64]) -> Mesh:
    """The mesh with these middles (cells, edges, 3) [m] of its cells' edges, in VTK's order of the
    corners (cells, 4 or 8), numbers of its vertices; the mesh itself where all edges are straight.
    NaN stands for a straight edge."""
    from skfem import MeshHex2, MeshTet2

    ends = mesh.p.T[corners[:, EDGES[corners.shape[1]]]]  # (cells, edges, 2, 3)
    chord, length = ends.mean(axis=2), np.linalg.norm(ends[:, :, 0] - ends[:, :, 1], axis=2)
    off = np.nan_to_num(middles - chord)
    if not (np.linalg.norm(off, axis=2) > STRAIGHT * length).any():
        return mesh

    # the node of each edge of the mesh, which cells have in common
    pairs = np.sort(corners[:, EDGES[corners.shape[1]]], axis=2).reshape(-1, 2)
    n = mesh.nvertices
    keys = np.sort(mesh.edges, axis=0).astype(np.int64)
    order = np.argsort(keys[0] * n + keys[1])
    edge = order[np.searchsorted((keys[0] * n + keys[1])[order], pairs[:, 0] * n + pairs[:, 1])]
    on_edge = mesh.p[:, mesh.edges].mean(axis=1)
    on_edge[:, edge] += off.reshape(-1, 3).T

    kind = MeshHex2 if corners.shape[1] == 8 else MeshTet2
    fine = kind.from_mesh(mesh)
    dofs, doflocs = fine.dofs, fine.doflocs.copy()
    doflocs[:, dofs.edge_dofs[0]] = on_edge
    if kind is MeshHex2:
        # edges of each face: of a cell's those whose two ends are in it
        at_corners, at_edges = mesh.p[:, mesh.facets].sum(axis=1), np.zeros((3, mesh.nfacets))
        cell = mesh.f2t[0]
        inside = (
            (mesh.edges[:, mesh.t2e[:, cell]][:, :, None] == mesh.facets[None, None])
            .any(axis=2)
            .all(axis=0)
        )
        for i, is_of_face in enumerate(inside):
            at_edges += on_edge[:, mesh.t2e[i, cell]] * is_of_face
        doflocs[:, dofs.facet_dofs[0]] = at_edges / 2 - at_corners / 4
        of_cells = on_edge[:, mesh.t2e].sum(axis=1) - mesh.p[:, mesh.t].sum(axis=1)
        doflocs[:, dofs.interior_dofs[0]] = of_cells / 4
    return kind(doflocs, fine.t, _boundaries=mesh.boundaries)


def is_curved(mesh: Mesh) -> bool:
    """True if cells have nodes besides their corners."""
    return mesh.doflocs.shape[1] > mesh.nvertices


def straight(mesh: Mesh) -> Mesh:
    """The mesh of the corners, with the same boundaries; a mesh that has no others itself."""
    from skfem import MeshHex, MeshTet

    if not is_curved(mesh):
        return mesh

    kind = MeshTet if isinstance(mesh, MeshTet) else MeshHex
    corners = kind(mesh.p[:, : mesh.nvertices], mesh.t)
    return corners.with_boundaries(mesh.boundaries or {})


def split(mesh: Mesh, fine: Mesh) -> Mesh:
    """The cells of a curved mesh in eight each, as the straight cells of `fine` divide those of the
    mesh of its corners; nodes lie where the mapping of the mesh has them."""
    from skfem import MeshHex, MeshHex2, MeshTet2

    # the cell that each small one is of: scikit-fem has hexahedra in turn, tetrahedra in an order
    # that depends on their diagonals
    coarse, hexes = straight(mesh), isinstance(mesh, MeshHex)
    parent = np.arange(fine.nelements) % mesh.nelements
    if not hexes:
        parent = _holding(coarse, fine.p[:, fine.t].mean(axis=1))

    # corners of the small cells in the coordinates X of the large ones: multiples of a half, those
    # whose straight image is nearest
    grid = np.stack(np.meshgrid(*[[0, 0.5, 1]] * 3, indexing="ij")).reshape(3, -1)
    lattice = grid if hexes else grid[:, grid.sum(axis=0) <= 1]
    images = coarse.mapping().F(lattice)  # (3, n, points)
    X = np.empty((3, len(fine.t), fine.nelements))
    for i, corner in enumerate(fine.t):
        off = np.linalg.norm(images[:, parent] - fine.p[:, corner, None], axis=0)
        X[:, i] = lattice[:, off.argmin(axis=1)]

    # all nodes of the small cells in X, by the straight map of each, then in space
    curved_fine = (MeshHex2 if hexes else MeshTet2).from_mesh(fine)
    linear, nodes = coarse.elem(), curved_fine.elem().doflocs.T
    N = np.array([linear.lbasis(nodes, i)[0] * np.ones(nodes.shape[1]) for i in range(len(fine.t))])
    places = np.einsum("ip,dic->dcp", N, X)
    x = mesh.mapping().F(places, tind=parent)
    doflocs = curved_fine.doflocs.copy()
    doflocs[:, curved_fine.dofs.element_dofs.T] = x
    return (MeshHex2 if hexes else MeshTet2)(doflocs, curved_fine.t, _boundaries=fine.boundaries)


def _holding(mesh: Mesh, points: NDArray[np.float64]) -> NDArray[np.int64]:
    """The tetrahedron (n,) of a straight mesh in which each of the points (3, n) [m] lies.

    scikit-fem's own finder asks all cells at once where one of the nearest does not hold every
    point, 24 GB of 90 000 points in 11 000 cells.
    """
    from scipy.spatial import cKDTree  # a kept run, which needs none, would wait for it

    # barycentric coordinates are linear: of a point the cell has it whose least one is largest
    of_corners = np.vstack([np.ones((1, 4, mesh.nelements)), mesh.p[:, mesh.t]])
    inverse = np.linalg.inv(of_corners.transpose(2, 0, 1))
    tree = cKDTree(mesh.p[:, mesh.t].mean(axis=1).T)
    cell, least = np.zeros(points.shape[1], int), np.full(points.shape[1], -np.inf)
    k, open_points = 8, np.arange(points.shape[1])
    while len(open_points):
        k = min(k, mesh.nelements)
        at_once = max(1, POINTS_AT_ONCE // k)
        for some in np.array_split(open_points, -(-len(open_points) // at_once)):
            near = tree.query(points[:, some].T, k=k)[1].reshape(len(some), k)
            x = np.vstack([np.ones(len(some)), points[:, some]])
            inside = np.einsum("pkij,jp->pki", inverse[near], x).min(axis=2)
            best = inside.argmax(axis=1)
            rows = np.arange(len(some))
            cell[some], least[some] = near[rows, best], inside[rows, best]
        open_points = open_points[least[open_points] < -INSIDE]
        if k == mesh.nelements:
            break
        k *= 8
    return cell


def facet_nodes(mesh: Mesh, facets: NDArray[np.int64]) -> NDArray[np.float64]:
    """Nodes (n, 6 or 9, 3) [m] of facets of a curved mesh: corners, the middles of the edges from
    each to the next, and of a quadrilateral its middle."""
    corners = mesh.facets[:, facets]
    n = mesh.nvertices
    keys = np.sort(mesh.edges, axis=0).astype(np.int64)
    keys = keys[0] * n + keys[1]
    order = np.argsort(keys)
    ends = np.sort(np.stack([corners, np.roll(corners, -1, axis=0)]), axis=0).astype(np.int64)
    edge = order[np.searchsorted(keys[order], ends[0] * n + ends[1])]
    nodes = [*corners, *mesh.dofs.edge_dofs[0][edge]]
    if len(corners) == 4:
        nodes.append(mesh.dofs.facet_dofs[0][facets])
    return mesh.doflocs.T[np.array(nodes)].transpose(1, 0, 2)


def facet_areas(nodes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Area vectors (n, points, 3) [m^2] of curved facets by their `facet_nodes`, at points of a
    rule whose weights are in them; their sum is the facet's."""
    from skfem import ElementQuad2, ElementTriP2
    from skfem.quadrature import get_quadrature

    # scikit-fem has the nodes of a quadrilateral and of a triangle in this order too
    element = ElementTriP2() if nodes.shape[1] == 6 else ElementQuad2()
    X, W = get_quadrature(element, 6)
    slopes = np.array([element.lbasis(X, i)[1] for i in range(nodes.shape[1])])  # (node, 2, point)
    tangents = np.einsum("cid,iap->acpd", nodes, slopes)
    return np.cross(*tangents) * W[:, None]


def edge_normals(nodes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Normals (n, edges, 3) of curved facets in the middles of the edges from each corner to the
    next, by their `facet_nodes`; all on the side of the first corner's turn to the next."""
    n = 3 if nodes.shape[1] == 6 else 4
    corners, middles = nodes[:, :n], nodes[:, n : 2 * n]
    ahead = np.roll(corners, -1, axis=1) - corners
    # slope inwards of the parabola from the middle of an edge through the facet: to the opposite
    # edge of a quadrilateral, to the corner of a triangle
    if n == 4:
        inner, last = nodes[:, 8:], np.roll(middles, -2, axis=1)
    else:
        last = np.roll(corners, -2, axis=1)
        others = np.roll(middles, -1, axis=1) + np.roll(middles, -2, axis=1)
        inner = others / 2 + middles / 4 - (corners + np.roll(corners, -1, axis=1)) / 8
    inwards = 4 * inner - 3 * middles - last
    normal = np.cross(ahead, inwards)
    return normal / np.linalg.norm(normal, axis=2, keepdims=True)
