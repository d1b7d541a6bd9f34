"""Elements that follow the curved faces of the CAD model: quadratic ones of curved edges.

The middle of an edge on a curved face lies on the face, nearest to the middle of the chord; where
two faces meet, on their common curve. A cell that would fold keeps straight edges.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from skfem import Mesh, MeshHex
from skfem.io.meshio import HEX_MAPPING
from skfem.quadrature import get_quadrature

from beadwave.geometry.own_mesh.curved import EDGES, STRAIGHT, curved

# of a chord, by which the middle may leave it: a nearest point farther off is on another part of
# the surface. Of 6 edges around a circle it is 0.13
LARGEST_BULGE = 0.25
# of the volume per reference volume of the straight cell, that is left everywhere in a curved one
LEAST_JACOBIAN = 0.05
# of the quadratures, inside and on facets, at whose points it is judged: at a node where two edges
# of a cell follow one circle it is zero, which frequencies of a pin do not show
ORDER = 4


class EdgeMiddles(NamedTuple):
    """Middles of edges that are not straight."""

    ends: NDArray[np.int64]  # (m, 2) nodes, the smaller number first
    points: NDArray[np.float64]  # (m, 3) [m]


NO_MIDDLES = EdgeMiddles(np.empty((0, 2), np.int64), np.empty((0, 3)))


def edges_around(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Edges (m, 2) of polygons (k, 3 or 4) by their nodes, each once, the smaller number first."""
    ahead = np.stack([cells, np.roll(cells, -1, axis=1)], axis=-1).reshape(-1, 2)
    return np.unique(np.sort(ahead, axis=1), axis=0)


def middles_of(
    p: NDArray[np.float64],
    edges: Sequence[NDArray[np.int64]],
    points: Sequence[NDArray[np.float64]],
) -> EdgeMiddles:
    """Middles (k, 3) [m] of edges (k, 2) of the nodes p (n, 3) [m]; of an edge that comes twice the
    last one. Edges that stay straight are left out."""
    ends, first = np.unique(
        np.concatenate([NO_MIDDLES.ends, *edges])[::-1], axis=0, return_index=True
    )
    middle = np.concatenate([NO_MIDDLES.points, *points])[::-1][first]
    bulge = np.linalg.norm(middle - p[ends].mean(axis=1), axis=1)
    length = np.linalg.norm(p[ends[:, 1]] - p[ends[:, 0]], axis=1)
    kept = (bulge > STRAIGHT * length) & (bulge < LARGEST_BULGE * length)
    return EdgeMiddles(ends[kept], middle[kept])


def judged_at(mesh: Mesh) -> NDArray[np.float64]:
    """Points (3, n) inside a cell and on its facets, in its own coordinates."""
    cell = mesh.elem().refdom
    (a, b), _ = get_quadrature(mesh.brefdom, ORDER)
    N = [(1 - a) * (1 - b), a * (1 - b), a * b, (1 - a) * b]
    if not isinstance(mesh, MeshHex):
        N = [1 - a - b, a, b]
    on_facets = [cell.p[:, corners[: len(N)]] @ np.stack(N) for corners in cell.facets]
    return np.column_stack([get_quadrature(cell, ORDER)[0], *on_facets])


def followed(mesh: Mesh, middles: EdgeMiddles) -> Mesh:
    """The straight mesh with these middles of its edges, but those of cells that would fold."""
    corners = (mesh.t[HEX_MAPPING[:8]] if isinstance(mesh, MeshHex) else mesh.t).T
    n = mesh.nvertices
    pairs = np.sort(corners[:, EDGES[corners.shape[1]]], axis=2).astype(np.int64)
    key_of_cells = pairs[..., 0] * n + pairs[..., 1]
    key = middles.ends[:, 0].astype(np.int64) * n + middles.ends[:, 1]
    order = np.argsort(key)
    key, points = key[order], middles.points[order]
    at = np.minimum(np.searchsorted(key, key_of_cells), max(len(key) - 1, 0))
    bent = key[at] == key_of_cells if len(key) else np.zeros_like(key_of_cells, bool)

    X = judged_at(mesh)
    before = np.abs(mesh.mapping().detDF(X))
    while bent.any():
        of_edges = np.where(bent[..., None], points[at], np.nan)
        whole = curved(mesh, corners, of_edges)
        cells = np.flatnonzero(bent.any(axis=1))
        after = whole.mapping().detDF(X, tind=cells)
        sign = np.sign(whole.mapping().detDF(X[:, :1], tind=cells))
        folded = cells[(sign * after < LEAST_JACOBIAN * before[cells]).any(axis=1)]
        if not len(folded):
            return whole
        bent &= ~np.isin(key_of_cells, key_of_cells[folded][bent[folded]])
    return mesh


def straightened_share(mesh: Mesh, middles: EdgeMiddles) -> float:
    """Share of the edges with these middles that `followed` leaves straight."""
    bent = followed(mesh, middles)
    if bent is mesh:
        return float(len(middles.ends) > 0)
    off = bent.doflocs[:, bent.dofs.edge_dofs[0]] - mesh.p[:, mesh.edges].mean(axis=1)
    length = np.linalg.norm(np.diff(mesh.p[:, mesh.edges], axis=1)[:, 0], axis=0)
    n = np.count_nonzero(np.linalg.norm(off, axis=0) > STRAIGHT / 2 * length)
    return 1 - n / len(middles.ends)
