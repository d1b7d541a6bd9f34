"""Surfaces with fewer nodes, for drawing: one node stays of those in a cell of a grid.

Vertex clustering (Rossignac, Borrel, Multi-resolution 3D approximations, 1993) along the mesh:
nodes of a cell are merged where edges between them join two flat places, or run along the same
sharp edge, so that both sides of a thin sheet, its rims and its corners stay.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

CELL_GROWTH = 1.3  # of the cells, until there are few enough nodes; not varied
# largest eigenvalue of the mean of n n^T, of normals n, at a flat place: a crease of 45 degrees
# has 0.85
FLAT_EIGENVALUE = 0.85
CREASE_EIGENVALUE = 0.1  # smallest eigenvalue: the normals at a sharp edge lie in a plane


class ThinnedMesh(NamedTuple):
    """Nodes that stay, and faces around them."""

    nodes: NDArray[np.int64]  # (m,) into the nodes of the surface
    faces: NDArray[np.int64]  # (k, 3 or 4) into `nodes`; a triangle among quads repeats its last


def thinned(
    points: NDArray[np.float64],
    faces: NDArray[np.integer],
    most: int,
) -> ThinnedMesh:
    """At most `most` of the nodes at points (n, 3) [m], and the faces (k, 3 or 4), nodes around
    each, between them; more nodes where the surface is rough everywhere, since rough places are not
    merged. For pictures: the surface moves by up to the size of a cell."""
    from scipy.sparse import coo_matrix  # a quarter of a second, see `lined`
    from scipy.sparse.csgraph import connected_components

    n, width = len(points), faces.shape[1]

    # means of n n^T over the faces at each node and along each edge
    a, b, c = (points[faces[:, i]] for i in (0, 1, 2))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = normal / np.where(length > 0, length, 1.0)
    squared = np.repeat(normal[:, :, None] * normal[:, None, :], width, axis=0)
    at_node = _eigenvalues_of_mean(squared, faces.ravel(), n)
    ends = np.sort(np.stack([faces.ravel(), np.roll(faces, -1, axis=1).ravel()]), axis=0)
    edge, number = np.unique(ends, axis=1, return_inverse=True)
    at_edge = _eigenvalues_of_mean(squared, number.ravel(), edge.shape[1])

    # nodes may be merged along an edge (2, k) between two flat places, or along a sharp edge
    flat = at_node[:, 2] >= FLAT_EIGENVALUE
    crease = ~flat & (at_node[:, 0] < CREASE_EIGENVALUE)
    sharp = at_edge[:, 2] < FLAT_EIGENVALUE
    edges = edge[:, np.where(sharp, crease[edge].all(axis=0), flat[edge].all(axis=0))]

    # clusters: nodes that such edges join within one cell of a grid, which grows
    low, extent = points.min(axis=0), np.ptp(points, axis=0).max()
    size, cluster = extent / np.sqrt(most), np.arange(n)
    while cluster.max() >= most and size < 2 * extent:
        cell = np.floor((points - low) / size)
        inside = edges[:, (cell[edges[0]] == cell[edges[1]]).all(axis=1)]
        graph = coo_matrix((np.ones(inside.shape[1]), tuple(inside)), shape=2 * cluster.shape)
        cluster = connected_components(graph, directed=False)[1]
        size *= CELL_GROWTH

    # of each cluster the node nearest to its mean
    count = np.bincount(cluster)
    mean = np.column_stack([np.bincount(cluster, x) / count for x in points.T])
    order = np.lexsort((np.linalg.norm(points - mean[cluster], axis=1), cluster))
    nodes = order[np.unique(cluster[order], return_index=True)[1]]

    # faces with three corners or more, each once, a corner that repeats last
    merged = cluster[faces]
    last = width - 1
    for i in range(last):
        again = merged[:, i] == merged[:, i + 1]
        merged[again, i:last] = merged[again, i + 1 :]
    closed = merged[:, -1] == merged[:, 0]
    merged[closed, -1] = merged[closed, -2]
    _, first = np.unique(np.sort(merged, axis=1), axis=0, return_index=True)
    merged = merged[np.sort(first)]
    a, b, c = merged[:, 0], merged[:, 1], merged[:, 2]
    return ThinnedMesh(nodes, merged[(a != b) & (b != c) & (a != c) & (merged[:, -1] != b)])


def _eigenvalues_of_mean(squared: NDArray, place: NDArray, n: int) -> NDArray[np.float64]:
    """Eigenvalues (n, 3) of the means of n n^T (., 3, 3) at each place: 0, 0, 1 where it is
    flat."""
    total, count = np.zeros((n, 3, 3)), np.bincount(place, minlength=n)
    np.add.at(total, place, squared)
    return np.linalg.eigvalsh(total / np.maximum(count, 1)[:, None, None])
