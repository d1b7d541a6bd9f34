"""Surfaces of fewer nodes, for drawing: nodes of one cell of a grid become one of them.

Vertex clustering (Rossignac, Borrel, Multi-resolution 3D approximations, 1993) along the mesh:
nodes of a cell are merged where edges between them join two flat places, or run along the same
sharp edge. So both sides of a thin sheet, its rims and its corners stay.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

GROWTH = 1.3  # of the cells, until there are few enough
FLAT = 0.85  # largest eigenvalue of the mean of n n^T, of normals n: 45 degrees give 0.85
CREASE = 0.1  # smallest eigenvalue: the normals at a sharp edge lie in a plane


class Thinned(NamedTuple):
    """Nodes that are left, and faces around them."""

    nodes: NDArray[np.int64]  # (m,) into the nodes that there were
    faces: NDArray[np.int64]  # (k, 3 or 4) into `nodes`; a triangle among quads repeats its last


def thinned(points: NDArray[np.float64], faces: NDArray[np.integer], most: int) -> Thinned:
    """At most so many of the nodes at points (n, 3), and of faces (k, 3 or 4) those that are left;
    more where a surface is rough all over."""
    edges = _mergeable(points, faces)
    low, extent = points.min(axis=0), np.ptp(points, axis=0).max()
    size, cluster = extent / np.sqrt(most), np.arange(len(points))
    while cluster.max() >= most and size < 2 * extent:
        cell = np.floor((points - low) / size)
        inside = edges[:, (cell[edges[0]] == cell[edges[1]]).all(axis=1)]
        graph = coo_matrix((np.ones(inside.shape[1]), tuple(inside)), shape=2 * cluster.shape)
        cluster = connected_components(graph, directed=False)[1]
        size *= GROWTH
    return Thinned(_kept(points, cluster), _around(cluster[faces]))


def _mergeable(points: NDArray, faces: NDArray) -> NDArray[np.int64]:
    """Edges (2, k) between two flat places, or along a sharp edge."""
    normal = _normals(points, faces)
    squared = normal[:, :, None] * normal[:, None, :]
    n, width = len(points), faces.shape[1]
    bend = _bend(np.repeat(squared, width, axis=0), faces.ravel(), n)
    ends = np.sort(np.stack([faces.ravel(), np.roll(faces, -1, axis=1).ravel()]), axis=0)
    edge, number = np.unique(ends, axis=1, return_inverse=True)
    sharp = _bend(np.repeat(squared, width, axis=0), number.ravel(), edge.shape[1])[:, 2] < FLAT
    flat = bend[:, 2] >= FLAT
    crease = ~flat & (bend[:, 0] < CREASE)
    both = [kind[edge].all(axis=0) for kind in (flat, crease)]
    return edge[:, np.where(sharp, both[1], both[0])]


def _bend(squared: NDArray, place: NDArray, n: int) -> NDArray[np.float64]:
    """Eigenvalues (n, 3) of the means of n n^T at each place: 0, 0, 1 where it is flat."""
    total, count = np.zeros((n, 3, 3)), np.bincount(place, minlength=n)
    np.add.at(total, place, squared)
    return np.linalg.eigvalsh(total / np.maximum(count, 1)[:, None, None])


def _normals(points: NDArray, faces: NDArray) -> NDArray[np.float64]:
    """Unit normals (k, 3) of faces, to either side."""
    a, b, c = (points[faces[:, i]] for i in (0, 1, 2))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    return normal / np.where(length > 0, length, 1.0)


def _kept(points: NDArray, cluster: NDArray) -> NDArray[np.int64]:
    """Of each cluster the node nearest to its mean."""
    count = np.bincount(cluster)
    mean = np.column_stack([np.bincount(cluster, x) / count for x in points.T])
    order = np.lexsort((np.linalg.norm(points - mean[cluster], axis=1), cluster))
    return order[np.unique(cluster[order], return_index=True)[1]]


def _around(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """Faces with three corners left, each once, a corner that repeats last."""
    last = faces.shape[1] - 1
    for i in range(last):
        again = faces[:, i] == faces[:, i + 1]
        faces[again, i:last] = faces[again, i + 1 :]
    closed = faces[:, -1] == faces[:, 0]
    faces[closed, -1] = faces[closed, -2]
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    faces = faces[np.sort(first)]
    a, b, c = faces[:, 0], faces[:, 1], faces[:, 2]
    return faces[(a != b) & (b != c) & (a != c) & (faces[:, -1] != b)]
