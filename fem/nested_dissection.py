"""Nested dissection: an order of elimination that keeps factors of solids sparse.

A separator, the thin set of vertices between two halves, is eliminated after both; each half is
cut in the same way (George, SIAM J. Numer. Anal. 10 (1973) 345). A first cut is told by
coordinates, which the graph itself gives: distances to a few landmarks, scaled to few dimensions
(landmark MDS; de Silva and Tenenbaum, NIPS 15 (2003) 721). Along every axis the separator of every
place is counted and the best taken. Of all separators near that one the least is what a largest
flow from one half to the other fills (Menger; Sanders and Schulz, ESA 2011, LNCS 6942, 469).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags_array
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

LANDMARKS = 24
DIMENSIONS = 6  # bodies that are joined lie on top of each other in three
SMOOTHINGS = 10  # of coordinates that are whole numbers of edges
LARGE = 300  # vertices that are cut along every axis, to take the best cut
WORTH_FLOW = 200  # vertices, of which a share on either side of a cut may be in the least separator
NEAR = 0.08
LEAST = 0.25  # share of the smaller half
LEAF = 24  # vertices that are eliminated as one
MIDDLE = 2  # beside halves 0 and 1
UNBOUNDED = 2**30  # capacity


class Domain(NamedTuple):
    """Vertices that are eliminated together, after its children."""

    vertices: NDArray[np.int64]
    children: tuple[int, ...]  # positions in the list of domains, all before this one


class Part(NamedTuple):
    """Vertices of a graph and what is between them."""

    vertices: NDArray[np.int64]  # (n,) in the whole graph
    graph: csr_matrix  # (n, n) symmetric, with its diagonal
    weight: NDArray[np.int64]  # (n,) unknowns of each
    X: NDArray[np.float64]  # (n, DIMENSIONS)

    def only(self, chosen: NDArray[np.int64]) -> "Part":
        """A part of this one."""
        graph = self.graph[chosen][:, chosen]
        return Part(self.vertices[chosen], graph, self.weight[chosen], self.X[chosen])


class Cut(NamedTuple):
    """A separator and how bad it is: its unknowns over the product of those of the halves."""

    side: NDArray[np.int8]  # (n,) 0, 1 or MIDDLE
    score: float


def nested_dissection(graph: csr_matrix, weight: NDArray[np.int64]) -> list[Domain]:
    """Domains of a symmetric graph (n, n) with its diagonal, children before their parents.

    weight (n,) are the unknowns that each vertex stands for.
    """
    domains: list[Domain] = []
    whole = Part(np.arange(graph.shape[0]), graph, weight, _coordinates(graph))
    _dissect(whole, domains)
    return domains


def _dissect(part: Part, domains: list[Domain]) -> int:
    """Append the domains of a part, and return the position of the last, their parent."""
    children: tuple[int, ...] = ()
    vertices = part.vertices
    if len(vertices) > LEAF:
        side = _cut(part)
        # the larger half first: what it leaves waits for less of the other
        halves = sorted((np.flatnonzero(side == half) for half in (0, 1)), key=len, reverse=True)
        if len(halves[1]):
            children = tuple(_dissect(part.only(half), domains) for half in halves)
            vertices = vertices[side == MIDDLE]
    domains.append(Domain(vertices, children))
    return len(domains) - 1


def _cut(part: Part) -> NDArray[np.int8]:
    """Sides (n,) of a part's vertices."""
    X = part.X - part.X.mean(axis=0)
    axes = np.linalg.eigh(X.T @ X)[1][:, ::-1].T
    tried = axes if len(X) > LARGE else axes[:1]
    side = min((_swept(part, X @ axis) for axis in tried), key=lambda cut: cut.score).side
    return _narrowed(part, side) if len(X) > WORTH_FLOW else side


def _swept(part: Part, along: NDArray[np.float64]) -> Cut:
    """The best cut across an axis, of those that keep LEAST of a part in either half."""
    n, graph, weight = len(along), part.graph, part.weight
    order = np.argsort(along, kind="stable")
    place = np.empty(n, dtype=np.int64)
    place[order] = np.arange(n)
    last = np.maximum.reduceat(place[graph.indices], graph.indptr[:-1])
    first = np.minimum.reduceat(place[graph.indices], graph.indptr[:-1])
    before = np.append(0, np.cumsum(weight[order]))  # of a cut before place 0, 1, .. n
    # a vertex is in the separator while the cut is between it and its farthest neighbour
    below, above = _counted(place, last, weight), _counted(first, place, weight)
    cuts = []
    for size, halves in (
        (below, (before - below, before[-1] - before)),
        (above, (before, before[-1] - before - above)),
    ):
        least = np.minimum(*halves)
        score = (size + 1) / np.maximum(halves[0] * halves[1], 1)
        cuts.append(np.where(least >= LEAST * (before[-1] - size), score, np.inf))
    at = np.argmin(cuts)
    taken_above, cut = divmod(int(at), n + 1)
    side = (place >= cut).astype(np.int8)
    crossing = (side == 1) & (first < cut) if taken_above else (side == 0) & (last >= cut)
    side[crossing] = MIDDLE
    return Cut(side, np.min(cuts))


def _counted(first: NDArray, last: NDArray, weight: NDArray) -> NDArray[np.int64]:
    """Unknowns (n + 1,) with first < cut <= last at cuts 0, 1, .. n."""
    n = len(first)
    changes = np.bincount(first + 1, weight, n + 2) - np.bincount(last + 1, weight, n + 2)
    return np.cumsum(changes)[: n + 1].astype(np.int64)


def edges(graph: csr_matrix, rows: NDArray) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Both ends of all entries in some rows."""
    begin, count = graph.indptr[rows], np.diff(graph.indptr)[rows]
    first = np.concatenate([[0], np.cumsum(count)[:-1]]) if len(rows) else count
    at = np.arange(count.sum()) + np.repeat(begin - first, count)
    return np.repeat(rows, count), graph.indices[at]


def _narrowed(part: Part, side: NDArray[np.int8]) -> NDArray[np.int8]:
    """Sides with the least separator of all that lie near the one given."""
    near = _around(part, side)
    n, (start, end) = len(near), edges(part.graph, near)
    number = np.full(len(side), -1)
    number[near] = np.arange(n)
    ends = [np.unique(number[start[(number[end] < 0) & (side[end] == half)]]) for half in (0, 1)]
    if min(map(len, ends)) == 0:
        return side
    inside = (number[end] >= 0) & (start != end)
    # a vertex is a pipe of its weight, from number to n + number; the halves are 2 n and 2 n + 1
    pipes = np.concatenate(
        [
            [np.arange(n), n + np.arange(n), part.weight[near]],
            [n + number[start[inside]], number[end[inside]], np.full(inside.sum(), UNBOUNDED)],
            [np.full(len(ends[0]), 2 * n), ends[0], np.full(len(ends[0]), UNBOUNDED)],
            [n + ends[1], np.full(len(ends[1]), 2 * n + 1), np.full(len(ends[1]), UNBOUNDED)],
        ],
        axis=1,
    )
    reached = _filled(pipes, n)
    found = np.where(reached[:n], np.where(reached[n:], 0, MIDDLE), 1)
    narrowed = np.where(side == MIDDLE, 1, side)
    narrowed[near] = found
    return narrowed


def _filled(pipes: NDArray[np.int64], n: int) -> NDArray[np.bool_]:
    """Ends (2 n,) of pipes that the source 2 n still reaches at the largest flow to 2 n + 1."""
    rows, columns, capacity = pipes.astype(np.int32)
    network = csr_matrix((capacity, (rows, columns)), shape=(2 * n + 2,) * 2)
    left = network - maximum_flow(network, 2 * n, 2 * n + 1).flow
    left.eliminate_zeros()
    reached = np.zeros(2 * n + 2, dtype=bool)
    reached[breadth_first_order(left, 2 * n, return_predecessors=False)] = True
    return reached[: 2 * n]


def _around(part: Part, side: NDArray[np.int8]) -> NDArray[np.int64]:
    """The separator and layers of vertices on either side of it."""
    found = side == MIDDLE
    for half in (0, 1):
        front, allowed = np.flatnonzero(side == MIDDLE), NEAR * len(side)
        while len(front) and allowed > 0:
            front = np.unique(edges(part.graph, front)[1])
            front = front[(side[front] == half) & ~found[front]]
            found[front] = True
            allowed -= len(front)
    return np.flatnonzero(found)


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
