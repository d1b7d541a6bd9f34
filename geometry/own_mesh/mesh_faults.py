"""Faults of a body's mesh that would give wrong numbers without a word, found when it is read.

Cells of no volume or turned inside out, bodies in several pieces, nodes at one place that cells do
not share.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from skfem import Mesh
from skfem.quadrature import get_quadrature

from beadwave.geometry.errors import InvalidGeometry

NO_VOLUME = 1e-9  # volume of a cell over the cube of its longest side
# distance of two nodes at one place, over the mean edge: files with six digits round to less
ONE_PLACE = 1e-4


def merged(
    points: NDArray[np.float64], t: NDArray[np.int64], within: float, name: str
) -> NDArray[np.int64]:
    """For each point (n, 3) [m] the number of the one that it is merged with, its own for most;
    raises InvalidGeometry where cells t (cells, corners) would collapse."""
    pairs = cKDTree(points).query_pairs(within, output_type="ndarray")
    ones = np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])
    _, group = connected_components(coo_matrix(ones, shape=(len(points),) * 2), directed=False)
    _, first = np.unique(group, return_index=True)
    number = first[group]
    collapsed = np.flatnonzero((np.diff(np.sort(number[t], axis=1)) == 0).any(axis=1))
    if len(collapsed):
        raise InvalidGeometry(
            f"assembly.merge = {within:g} m merges nodes of one cell of {name!r}, "
            f"{len(collapsed)} cells in all; take less than their shortest edge."
        )
    return number


def jacobian(mesh: Mesh, X: NDArray[np.float64]) -> NDArray[np.float64]:
    """Determinant (cells, points) [m^3] of the mapping of the reference cell at points X (3, n);
    that of scikit-fem raises where it is zero."""
    element, nodes = mesh.elem(), mesh.dofs.element_dofs
    J = sum(
        mesh.doflocs[:, nodes[i]].T[:, :, None, None] * element.lbasis(X, i)[1][None, None]
        for i in range(len(nodes))
    )  # (cells, 3, 3, points)
    return np.linalg.det(J.transpose(0, 3, 1, 2))


def require_sound(mesh: Mesh, name: str, source: str, *, as_it_is: bool = False) -> None:
    """Raise InvalidGeometry for a fault of a body's mesh; pieces and nodes at one place pass where
    it is taken `as_it_is`."""
    body = f"the body {name!r} of the mesh {source!r}"
    corners = mesh.p.T[mesh.t.T]  # (cells, corners, 3)
    middles = corners.mean(axis=1)

    # the determinant of the mapping at points of integration: of one sign in a cell
    X, _ = get_quadrature(mesh.elem, 4)
    det = jacobian(mesh, X)
    sides = np.linalg.norm(np.ptp(corners, axis=1), axis=1)
    volume = np.abs(det).max(axis=1)
    twisted = (np.sign(det) != np.sign(det[:, :1])).any(axis=1)
    for wrong, what in (
        (volume <= NO_VOLUME * sides**3, "of no volume"),
        (twisted, "turned inside out: their nodes are in a wrong order or out of place"),
    ):
        if wrong.any():
            raise InvalidGeometry(
                f"{body} has {wrong.sum()} of {len(wrong)} cells {what}, the first at "
                f"{_place(middles[wrong.argmax()])} m; repair them."
            )
    if as_it_is:
        return

    # pieces: cells joined by facets
    inner = mesh.f2t[1] >= 0
    ones = np.ones(inner.sum()), (mesh.f2t[0, inner], mesh.f2t[1, inner])
    graph = coo_matrix(ones, shape=(mesh.nelements,) * 2)
    n, piece = connected_components(graph, directed=False)
    if n > 1:
        first = np.unique(mesh.t[:, piece == 0])
        others = np.unique(mesh.t[:, piece != 0])
        away, _ = cKDTree(mesh.p.T[others]).query(mesh.p.T[first])
        nearest = away.argmin()
        places = ", ".join(_place(middles[piece == i].mean(axis=0)) for i in range(min(n, 3)))
        common = np.intersect1d(first, others)
        joined = "that nothing joins"
        if len(common):
            joined = f"that have nodes in common ({len(common)} of the first) but no face"
        raise InvalidGeometry(
            f"{body} is {n} pieces {joined}, with their middles at {places}"
            f"{', ...' if n > 3 else ''} m; the nearest nodes of two are "
            f"{1e3 * away[nearest]:.4g} mm apart, at {_place(mesh.p.T[first[nearest]])} m. Mesh it "
            "as one, name each piece as a body (assembly.volumes chooses the sets that are "
            "bodies), merge nodes by assembly.merge = "
            f"{max(2 * away[nearest], 1e-6):.1g}, or take it as it is by merge = 0."
        )

    # a crack: nodes of the outside at one place
    edges = mesh.p[:, mesh.edges]
    edge = np.linalg.norm(edges[:, 0] - edges[:, 1], axis=0).mean()
    outer = np.unique(mesh.facets[:, mesh.boundary_facets()])
    pairs = cKDTree(mesh.p.T[outer]).query_pairs(ONE_PLACE * edge, output_type="ndarray")
    if len(pairs):
        i, j = outer[pairs[0]]
        apart = np.linalg.norm(mesh.p[:, i] - mesh.p[:, j])
        raise InvalidGeometry(
            f"{body} has {len(pairs)} pairs of nodes at one place that its cells do not share, the "
            f"first {1e3 * apart:.4g} mm apart at {_place(mesh.p[:, i])} m: a crack. Merge them by "
            f"assembly.merge = {max(2 * ONE_PLACE * edge, 1e-9):.1g}, or keep it by merge = 0."
        )


def _place(point: NDArray[np.float64]) -> str:
    return "[{:.4g}, {:.4g}, {:.4g}]".format(*(np.round(point, 9) + 0.0))
