"""Nested dissection: an order of elimination that keeps factors of solids sparse.

A separator, the thin set of vertices between two halves, is eliminated after both; each half is
cut in the same way (George, SIAM J. Numer. Anal. 10 (1973) 345). The halves are told by
coordinates, which the graph itself gives: distances to a few landmarks, scaled to few dimensions
(landmark MDS; de Silva and Tenenbaum, NIPS 15 (2003) 721), and the separator is what lies at the
cut on the side where that is less.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags_array

LANDMARKS = 24
DIMENSIONS = 6  # bodies that are joined lie on top of each other in three
SMOOTHINGS = 10  # of coordinates that are whole numbers of edges
LARGE = 300  # vertices that are cut along every axis, to take the thinnest cut
LEAF = 32  # vertices that are eliminated as one


class Domain(NamedTuple):
    """Vertices that are eliminated together, after its children."""

    vertices: NDArray[np.int64]
    children: tuple[int, ...]  # positions in the list of domains, all before this one


def nested_dissection(graph: csr_matrix) -> list[Domain]:
    """Domains of a symmetric graph (n, n), children before their parents."""
    cuts = _Cuts(graph, _coordinates(graph))
    domains: list[Domain] = []
    _dissect(cuts, np.arange(graph.shape[0]), domains)
    return domains


def _dissect(cuts: "_Cuts", vertices: NDArray[np.int64], domains: list[Domain]) -> int:
    """Append the domains of these vertices, and return the position of the last, their parent."""
    children: tuple[int, ...] = ()
    if len(vertices) > LEAF:
        halves, separator = cuts.halved(vertices)
        if min(map(len, halves)) > 0:
            children = tuple(_dissect(cuts, half, domains) for half in halves)
            vertices = separator
    domains.append(Domain(vertices, children))
    return len(domains) - 1


class _Cuts:
    """Cuts of parts of a graph by its coordinates X (n, DIMENSIONS)."""

    def __init__(self, graph: csr_matrix, X: NDArray[np.float64]) -> None:
        self._graph, self._X = graph, X
        self._side = np.zeros(graph.shape[0], dtype=np.int8)

    def halved(self, vertices: NDArray[np.int64]):
        """Two parts of a set of vertices and the separator between them."""
        X = self._X[vertices]
        X = X - X.mean(axis=0)
        axes = np.linalg.eigh(X.T @ X)[1][:, ::-1]
        tried = axes.T if len(vertices) > LARGE else axes.T[:1]
        cuts = [self._cut(vertices, X @ axis) for axis in tried]
        return min(cuts, key=lambda cut: len(cut[1]))

    def _cut(self, vertices: NDArray[np.int64], along: NDArray[np.float64]):
        order = np.argsort(along, kind="stable")
        one, other = vertices[order[: len(order) // 2]], vertices[order[len(order) // 2 :]]
        separator = self._between(one, other)
        self._side[separator] = 1
        halves = tuple(half[self._side[half] == 0] for half in (one, other))
        self._side[separator] = 0
        return halves, separator

    def _between(self, one: NDArray[np.int64], other: NDArray[np.int64]) -> NDArray[np.int64]:
        self._side[other] = 1
        start, end = edges(self._graph, one)
        crossing = self._side[end] == 1
        self._side[other] = 0
        sides = np.unique(start[crossing]), np.unique(end[crossing])
        return min(sides, key=len)


def edges(graph: csr_matrix, rows: NDArray) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Both ends of all entries in some rows."""
    begin, count = graph.indptr[rows], np.diff(graph.indptr)[rows]
    first = np.concatenate([[0], np.cumsum(count)[:-1]]) if len(rows) else count
    at = np.arange(count.sum()) + np.repeat(begin - first, count)
    return np.repeat(rows, count), graph.indices[at]


def _coordinates(graph: csr_matrix) -> NDArray[np.float64]:
    """X (n, DIMENSIONS) with distances like those along the graph's edges."""
    squared = _landmark_distances(graph) ** 2
    at = squared.argmin(axis=1)
    between = squared[:, at]
    mean = between.mean(axis=0)
    centred = -(between - mean - mean[:, None] + mean.mean()) / 2
    values, vectors = np.linalg.eigh(centred)
    kept = slice(-1, -DIMENSIONS - 1, -1)
    scaled = vectors[:, kept] / np.sqrt(np.maximum(values[kept], 1e-12 * max(values[-1], 1e-12)))
    X = -(squared - mean[:, None]).T @ scaled / 2
    shares = diags_array(1 / np.maximum(np.diff(graph.indptr), 1)) @ graph
    for _ in range(SMOOTHINGS):
        X = shares @ X
    return X


def _landmark_distances(graph: csr_matrix) -> NDArray[np.float64]:
    """Numbers of edges to landmarks (LANDMARKS, n), each the farthest from those before it."""
    found, start = [], int(_levels(graph, 0).argmax())
    for _ in range(LANDMARKS):
        found.append(_levels(graph, start))
        start = int(np.min(found, axis=0).argmax())
    return np.array(found, dtype=float)


def _levels(graph: csr_matrix, start: int) -> NDArray[np.int64]:
    """Numbers of edges (n,) from a vertex; other pieces of the graph lie behind the farthest."""
    level = np.full(graph.shape[0], -1)
    front, depth = np.array([start]), 0
    while len(front):
        level[front] = depth
        depth += 1
        met = edges(graph, front)[1]
        met = met[level[met] < 0]
        level[met] = depth
        front = np.flatnonzero(level == depth) if len(met) > len(level) // 50 else np.unique(met)
    level[level < 0] = 2 * depth
    return level
