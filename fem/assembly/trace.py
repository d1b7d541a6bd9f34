"""Points on named faces of a mesh: where they lie, and the displacements there.

A face is named by its body and its name there, "body:face".
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from skfem import Basis, Mesh, MeshHex, MeshTet

from beadwave.fem.assembly.chord_height import area_vectors
from beadwave.fem.assembly.elasticity import Structure
from beadwave.fem.assembly.facet_rule import facet_rule

# of a facet's size, up to which a point is on it: the CAD kernel draws one rectangle on two bodies
# up to 2e-7 of it apart
ON_FACE = 1e-5


class OffFace(ValueError):
    """A point lies off the face that it should be on."""


def face_nodes(structure: Structure, face: str) -> NDArray[np.int64]:
    """The displacement dofs of every node on a face, (n_nodes, 3).

    Raises ValueError for a face that the mesh does not have, or not a facet of.
    """
    body, facets = structure.facets(face)
    on_face = structure.basis[body].get_dofs(facets)
    dofs = np.column_stack([on_face.all([f"u^{i}"]) for i in (1, 2, 3)])
    return structure.first[body] + dofs


class FaceMean(NamedTuple):
    """The mean over a face: the mean displacement is sum_n share_n u_n of its nodes' u_n."""

    node: NDArray[np.int64]  # (m,) of the structure
    share: NDArray[np.float64]  # (m,) sum 1
    centre: NDArray[np.float64]  # (3,) [m]
    normal: NDArray[np.float64]  # (3,) mean of the outward normals, of length 1 where it is plane


def face_mean(structure: Structure, face: str) -> FaceMean:
    """The mean over a face, by the shape functions of its nodes.

    Raises ValueError for a face that the mesh does not have, or not a facet of.
    """
    body, facets = structure.facets(face)
    basis = structure.basis[body]
    scalar, rule = basis.elem.elem, facet_rule(basis.mesh, facets, 4)
    dx, share = np.linalg.norm(rule.area, axis=0), np.zeros(basis.N // 3)
    for i, nodes in enumerate(basis.element_dofs[0::3, rule.cells] // 3):
        np.add.at(share, nodes, (scalar.lbasis(rule.X, i)[0] * dx).sum(axis=1))
    area = dx.sum()
    nodes = np.flatnonzero(np.abs(share) > 1e-12 * area)
    node, share = structure.first[body] // 3 + nodes, share[nodes] / area
    return FaceMean(node, share, share @ structure.points[node], rule.area.sum(axis=(1, 2)) / area)


def face_edges(structure: Structure, face: str) -> NDArray[np.float64]:
    """Ends (m, 2, 3) [m] of the edges where a face ends, at holes too."""
    body, facets = structure.facets(face)
    mesh = structure.basis[body].mesh
    corners = mesh.facets[:, facets]
    n = len(corners)  # numbered around a facet
    edges = np.hstack([corners[[i, (i + 1) % n]] for i in range(n)])
    edges, n_facets = np.unique(np.sort(edges, axis=0), axis=1, return_counts=True)
    return mesh.p[:, edges[:, n_facets == 1]].transpose(2, 1, 0)


class OuterNodes(NamedTuple):
    """Corners of the elements on the outside of all bodies, of curved ones also the middles of
    their edges."""

    points: NDArray[np.float64]  # (m, 3) [m]
    faces: NDArray[np.int64]  # (k, 3 or 4) into the points; a triangle among quads repeats its last
    dofs: NDArray[np.int64]  # (m, 3) their displacements
    body: NDArray[np.int64]  # (m,) which of the structure's bodies each belongs to


def outer_nodes(structure: Structure) -> OuterNodes:
    """The corners of all facets that belong to one element only; a curved facet is three or four
    triangles at its corners and what is left between the middles of its edges."""
    points, faces, dofs, bodies, n = [], [], [], [], 0
    corners = max(basis.mesh.facets.shape[0] for basis in structure.basis.values())
    for i, (body, basis) in enumerate(structure.basis.items()):
        mesh, of_nodes, x = basis.mesh, basis.nodal_dofs, basis.mesh.p
        outer = mesh.boundary_facets()
        facets = mesh.facets[:, outer]
        if mesh.doflocs.shape[1] > mesh.nvertices:
            # the middle of the edge from each corner to the next, numbered behind the vertices
            ends = np.sort(np.stack([facets, np.roll(facets, -1, axis=0)]), axis=0)
            of_cell = mesh.t2e[:, mesh.f2t[0, outer]]  # (edge of the cell, facet)
            its_ends = np.sort(mesh.edges[:, of_cell], axis=0)  # (2, edge of the cell, facet)
            same = (its_ends[:, None] == ends[:, :, None]).all(axis=0)
            edge = np.take_along_axis(of_cell, same.argmax(axis=1), axis=0)
            middles = mesh.nvertices + edge
            before = np.roll(middles, 1, axis=0)
            rims = np.stack([facets, middles, before], axis=1).transpose(0, 2, 1).reshape(-1, 3)
            k = len(facets)
            rims = np.pad(rims, [(0, 0), (0, k - 3)], mode="edge")
            facets = np.concatenate([rims, middles.T]).T
            of_nodes = np.hstack([basis.nodal_dofs, basis.edge_dofs])
            x = basis.doflocs[:, of_nodes[0]]
        used, face = np.unique(facets, return_inverse=True)
        face = n + face.reshape(facets.shape).T
        faces.append(np.pad(face, [(0, 0), (0, corners - face.shape[1])], mode="edge"))
        dofs.append(structure.first[body] + of_nodes[:, used].T)
        points.append(x[:, used].T)
        bodies.append(np.full(len(used), i))
        n += len(used)
    return OuterNodes(*map(np.concatenate, (points, faces, dofs, bodies)))


def face_quadrature(
    structure: Structure, face: str, order: int = 4
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points (n, 3) [m] and weights (n,) [m^2] that integrate polynomials up to `order` over the
    straight facets of a face; the weights sum to its area. Raises ValueError as `face_nodes`."""
    body, facets = structure.facets(face)
    mesh = structure.basis[body].mesh
    rule = facet_rule(mesh, facets, order)
    points = mesh.mapping().F(rule.X, tind=rule.cells)
    return points.reshape(3, -1).T, np.linalg.norm(rule.area, axis=0).ravel()


class LocatedPoints(NamedTuple):
    """Points in the elements at a face."""

    cells: NDArray[np.int64]  # (n,) of the face's body
    X: NDArray[np.float64]  # (3, n) local coordinates there
    # (n,) [m] to the face, less 1e-5 of the facet's size: 0 or less on it, inf far away
    distance: NDArray[np.float64]


def located(
    structure: Structure, face: str, points: NDArray[np.float64], *, gap: float = 0.0
) -> LocatedPoints:
    """The elements at a face in which points (n, 3) lie, or the nearest ones; points farther than
    `gap` [m] from all facets may have none (-1)."""
    body, facets = structure.facets(face)
    basis = structure.basis[body]
    mesh = basis.mesh
    corners = mesh.p[:, mesh.facets[:, facets]]
    size = np.ptp(corners, axis=1).max()

    # pairs (point, facet) where the point is in the facet's bounding box; a curved facet leaves its
    # chord by up to its bulge
    bulge = _bulge(mesh, facets)
    tolerance = max(ON_FACE * size, gap, bulge.max(initial=0.0))
    lower, upper = corners.min(axis=1) - tolerance, corners.max(axis=1) + tolerance
    in_box = np.ones((len(points), len(facets)), dtype=bool)
    for axis in range(3):
        x = points[:, axis, None]
        in_box &= (x >= lower[axis]) & (x <= upper[axis])
    point, facet = np.nonzero(in_box)

    # the cell in which each point lies, or the nearest one: shape functions of the cell's corners
    # are negative outside
    cells = mesh.f2t[0, facets[facet]]
    target = points[point].T[:, :, None]
    X = local_coordinates(basis.mapping, target, cells)
    element = MeshHex.elem() if isinstance(mesh, MeshHex) else MeshTet.elem()
    phi = [element.lbasis(X[:, :, 0], i)[0] for i in range(element.doflocs.shape[0])]
    outside = np.maximum(0.0, -np.array(phi).min(axis=0))
    outside += np.linalg.norm((basis.mapping.F(X, tind=cells) - target)[:, :, 0], axis=0) / size
    best = np.full(len(points), -1)
    falling = np.argsort(outside, kind="stable")[::-1]
    best[point[falling]] = falling  # the last written is the smallest
    near = best >= 0
    cell, X_of_point = np.full(len(points), -1), np.full((3, len(points)), np.nan)
    cell[near], X_of_point[:, near] = cells[best[near]], X[:, best[near], 0]

    # how far each point lies from the nearest facet
    candidates = corners[:, :, facet]
    miss = ON_FACE * np.ptp(candidates, axis=1).max(axis=0) + bulge[facet]
    distance = np.full(len(points), np.inf)
    np.minimum.at(distance, point, facet_distances(candidates, points[point].T) - miss)
    return LocatedPoints(cell, X_of_point, distance)


def _bulge(mesh: Mesh, facets: NDArray[np.int64]) -> NDArray[np.float64]:
    """Distances (n,) [m] by which the nodes of curved facets leave the chords of their corners; 0
    of straight ones."""
    if mesh.doflocs.shape[1] == mesh.nvertices:
        return np.zeros(len(facets))
    # middles of edges and of the facet, as means of corners: by the chords, and by the mapping of
    # the element behind
    corners, cells = mesh.facets[:, facets], mesh.f2t[0, facets]
    n = len(corners)
    means = np.column_stack([(np.eye(n) + np.roll(np.eye(n), 1, axis=0)) / 2, np.full(n, 1 / n)])
    at = (mesh.t[:, cells][:, None] == corners).argmax(axis=0)  # (corner, facet) in the element
    X = np.einsum("vp,dvm->dmp", means, mesh.elem().refdom.p[:, at])
    chord = np.einsum("vp,dvm->dmp", means, mesh.p[:, corners])
    return np.linalg.norm(mesh.mapping().F(X, tind=cells) - chord, axis=0).max(axis=1)


def trace(
    structure: Structure, face: str, points: NDArray[np.float64], *, gap: float = 0.0
) -> csr_matrix:
    """P (3 n, ndof) with P @ u = the displacements at `points` (n, 3) of a face, point by point.

    Off the face, by up to `gap` [m], the field of the nearest element is continued, so that rigid
    motions stay what they are. Raises OffFace when a point lies farther off; 1e-5 of the facet's
    size counts as on it.
    """
    place = located(structure, face, points, gap=gap)
    if np.any(place.distance > gap):
        worst = int(np.argmax(place.distance))
        raise OffFace(
            f"the point {np.round(points[worst], 6).tolist()} m does not lie on the face {face!r}."
        )
    body = structure.facets(face)[0]
    P = interpolation(structure.basis[body], place.X, place.cells)
    return csr_matrix(
        (P.data, P.indices + structure.first[body], P.indptr), (P.shape[0], structure.n_dofs)
    )


def facet_distances(
    corners: NDArray[np.float64], points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Distances (n,) [m] of points (3, n) to plane facets (3, 3 or 4, n): to the plane where the
    point lies above the facet, else to its rim."""
    along, to = np.roll(corners, -1, axis=1) - corners, points[:, None] - corners
    share = np.clip(np.sum(along * to, axis=0) / np.sum(along**2, axis=0), 0.0, 1.0)
    rim = np.linalg.norm(to - share * along, axis=0).min(axis=0)
    normal = area_vectors(corners).T
    normal = normal / np.linalg.norm(normal, axis=0)
    inward = np.sum(np.cross(along, to, axis=0) * normal[:, None], axis=0)
    above = np.all(inward >= 0.0, axis=0)
    return np.where(above, np.abs(np.sum(to[:, 0] * normal, axis=0)), rim)


def local_coordinates(mapping, x, cells, *, n_steps: int = 12) -> NDArray[np.float64]:
    """Local coordinates (3, n, 1) of points x (3, n, 1) [m] in cells (n,), by Newton's method; of
    points outside of their cell they lie outside of 0 to 1, by up to half an element.

    scikit-fem's own inverse clips to the cell and gives up on a point a rounding error outside it.
    Boxes and straight tetrahedra need one step.
    """
    X = np.full(x.shape, 0.5)
    for _ in range(n_steps):
        inverse = mapping.invDF(X, cells)
        step = np.einsum("ijkl,jkl->ikl", inverse, x - mapping.F(X, cells))
        X = np.clip(X + step, -0.5, 1.5)
        # the next step by the inverse that is known: one with its own is then below rounding
        step = np.einsum("ijkl,jkl->ikl", inverse, x - mapping.F(X, cells))
        if np.abs(step).max(initial=0.0) < 1e-8:
            return X + step
    return X


def interpolation(basis: Basis, X, cells) -> csr_matrix:
    """P (3 n, n_dofs) reading the displacements at local coordinates X (3, n) of cells (n,) of a
    body, x, y, z point by point; outside of a cell its shape functions are continued."""
    scalar = basis.elem.elem
    n_points, n_shapes = len(cells), basis.Nbfun // 3
    phi = np.array([np.broadcast_to(scalar.lbasis(X, i)[0], n_points) for i in range(n_shapes)])
    phi[np.abs(phi) < 1e-12] = 0.0
    columns = basis.element_dofs[:, cells].reshape(n_shapes, 3, n_points)
    rows = np.broadcast_to(
        (3 * np.arange(n_points)[None, :] + np.arange(3)[:, None])[None], columns.shape
    )
    entries = np.broadcast_to(phi[:, None], columns.shape)
    P = csr_matrix((entries.ravel(), (rows.ravel(), columns.ravel())), (3 * n_points, basis.N))
    P.eliminate_zeros()
    return P


def at_node(
    structure: Structure, spot: NDArray[np.float64], direction: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The functional (ndof,) that reads the node nearest to a spot (3,) [m] along a direction (3,),
    which is taken as it is: of length 1 for a displacement in m."""
    node = int(np.argmin(np.linalg.norm(structure.points - spot, axis=1)))
    row = np.zeros(structure.n_dofs)
    row[3 * node : 3 * node + 3] = direction
    return row
