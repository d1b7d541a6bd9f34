"""Nested dissection: an order of elimination that keeps factors of solids sparse.

A separator, the thin set of vertices between two halves, is eliminated after both; each half is
cut in the same way (George, SIAM J. Numer. Anal. 10 (1973) 345). A first cut follows from
coordinates, which the graph itself gives: distances to a few landmarks, scaled to few dimensions
(landmark MDS; de Silva and Tenenbaum, NIPS 15 (2003) 721). Along every axis the separator at every
position is counted and the best one is the first cut. Of all separators close to it the smallest is
what a maximum flow from one half to the other fills (Menger; Sanders and Schulz, ESA 2011, LNCS
6942, 469).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags_array
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

MIDDLE = 2  # label of the separator; 0 and 1 are the halves


N_LANDMARKS = 24  # vertices to which distances are measured
N_DIMENSIONS = 6  # of the coordinates: bodies that are joined overlap in three
N_SMOOTHINGS = 10  # of the coordinates, which are whole numbers of edges at first
ALL_AXES_FROM = 300  # vertices from which on a cut is tried along every axis, not only the first
FLOW_FROM = 200  # vertices from which on the separator is made smallest by a flow
FLOW_BAND = 0.08  # share of the vertices, on either side of a cut, that the flow may choose
MIN_HALF = 0.25  # share of the unknowns that either half has at least
LEAF_SIZE = 24  # vertices that are eliminated together without a further cut


class Domain(NamedTuple):
    """Vertices that are eliminated together, after its children."""

    vertices: NDArray[np.int64]
    children: tuple[int, ...]  # positions in the list of domains, all before this one


class Subgraph(NamedTuple):
    """Some vertices of a graph and the edges between them."""

    vertices: NDArray[np.int64]  # (n,) numbers in the graph itself
    graph: csr_matrix  # (n, n) symmetric, with its diagonal
    weight: NDArray[np.int64]  # (n,) unknowns of each
    X: NDArray[np.float64]  # (n, dimensions) coordinates

    def only(self, chosen: NDArray[np.int64]) -> "Subgraph":
        """The subgraph of the vertices `chosen` (m,), numbered as in this one."""
        number = np.full(len(self.vertices), -1)
        number[chosen] = np.arange(len(chosen))
        start, end = (number[ends] for ends in edges(self.graph, chosen))
        inside = end >= 0
        indptr = np.append(0, np.cumsum(np.bincount(start[inside], minlength=len(chosen))))
        ones = np.ones(indptr[-1], np.float32)
        graph = csr_matrix((ones, end[inside], indptr), (len(chosen),) * 2)
        return Subgraph(self.vertices[chosen], graph, self.weight[chosen], self.X[chosen])


class Separator(NamedTuple):
    """A separator and how bad it is: its unknowns over the product of those of the halves."""

    side: NDArray[np.int8]  # (n,) 0, 1 or MIDDLE
    score: float


def nested_dissection(graph: csr_matrix, weight: NDArray[np.int64]) -> list[Domain]:
    """Domains of a symmetric graph (n, n) with its diagonal, children before their parents.

    weight (n,) are the unknowns that each vertex stands for.
    """
    domains: list[Domain] = []

    def dissect(sub: Subgraph) -> int:
        """Append the domains of a subgraph, and return the position of the last, their parent."""
        if len(sub.vertices) <= LEAF_SIZE:
            domains.append(Domain(sub.vertices, ()))
            return len(domains) - 1

        # a first cut across the axis, of the principal ones, that gives the smallest separator
        X = sub.X - sub.X.mean(axis=0)
        axes = np.linalg.eigh(X.T @ X)[1][:, ::-1].T
        axes = axes if len(X) > ALL_AXES_FROM else axes[:1]
        cuts = (_swept_cut(sub, X @ axis, MIN_HALF) for axis in axes)
        side = min(cuts, key=lambda cut: cut.score).side
        if len(X) > FLOW_FROM:
            side = _least_separator(sub, side, FLOW_BAND)

        # the larger half first: its update is kept in memory while the smaller half is eliminated,
        # which takes less memory than the other way round
        halves = sorted((np.flatnonzero(side == half) for half in (0, 1)), key=len, reverse=True)
        if not len(halves[1]):
            domains.append(Domain(sub.vertices, ()))
            return len(domains) - 1
        children = tuple(dissect(sub.only(half)) for half in halves)
        domains.append(Domain(sub.vertices[side == MIDDLE], children))
        return len(domains) - 1

    coordinates = _landmark_coordinates(graph)
    dissect(Subgraph(np.arange(graph.shape[0]), graph, weight, coordinates))
    return domains


def _swept_cut(sub: Subgraph, along: NDArray[np.float64], smallest: float) -> Separator:
    """The best cut across an axis, of those that leave this share of the unknowns in each half.

    along (n,) are the positions of the vertices on the axis, in whose order all n + 1 cuts are
    counted, with the separator taken below the cut or above it.
    """
    n, graph, weight = len(along), sub.graph, sub.weight
    order = np.argsort(along, kind="stable")
    rank = np.empty(n, dtype=np.int64)
    rank[order] = np.arange(n)
    last = np.maximum.reduceat(rank[graph.indices], graph.indptr[:-1])
    first = np.minimum.reduceat(rank[graph.indices], graph.indptr[:-1])
    below_cut = np.append(0, np.cumsum(weight[order]))  # unknowns below the cut at rank 0, 1, .. n

    def spanning(low: NDArray, high: NDArray) -> NDArray[np.int64]:
        """Unknowns (n + 1,) of vertices with low < cut <= high, (n,) each, at cuts 0, 1, .. n: by
        the cumulative sum of those that begin and end at each, all cuts at once."""
        change = np.bincount(low + 1, weight, n + 2) - np.bincount(high + 1, weight, n + 2)
        return np.cumsum(change)[: n + 1].astype(np.int64)

    # a vertex is in the separator while the cut is between it and its farthest neighbour
    below, above, total = spanning(rank, last), spanning(first, rank), below_cut[-1]
    scores = []
    for size, halves in (
        (below, (below_cut - below, total - below_cut)),
        (above, (below_cut, total - below_cut - above)),
    ):
        score = (size + 1) / np.maximum(halves[0] * halves[1], 1)
        is_even = np.minimum(*halves) >= smallest * (total - size)
        scores.append(np.where(is_even, score, np.inf))
    is_above, cut = divmod(int(np.argmin(scores)), n + 1)
    side = (rank >= cut).astype(np.int8)
    crossing = (side == 1) & (first < cut) if is_above else (side == 0) & (last >= cut)
    side[crossing] = MIDDLE
    return Separator(side, np.min(scores))


def edges(graph: csr_matrix, rows: NDArray) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Both ends (e,) of all entries in some rows (m,) of a graph (n, n), its diagonal included, in
    the order of the rows."""
    begin, count = graph.indptr[rows], np.diff(graph.indptr)[rows]
    first = np.concatenate([[0], np.cumsum(count)[:-1]]) if len(rows) else count
    position = np.arange(count.sum()) + np.repeat(begin - first, count)
    return np.repeat(rows, count), graph.indices[position]


def _least_separator(sub: Subgraph, side: NDArray[np.int8], band: float) -> NDArray[np.int8]:
    """Sides (n,) with the smallest separator of all within a band around the one given.

    By Menger's theorem its unknowns are the maximum flow from half 0 to half 1 through vertices
    that let through no more than their weight.
    """
    # the separator and layers of vertices on either side of it, a share `band` of all on each
    in_band = side == MIDDLE
    for half in (0, 1):
        front, allowed = np.flatnonzero(side == MIDDLE), band * len(side)
        while len(front) and allowed > 0:
            front = np.unique(edges(sub.graph, front)[1])
            front = front[(side[front] == half) & ~in_band[front]]
            in_band[front] = True
            allowed -= len(front)
    vertices = np.flatnonzero(in_band)
    n, (start, end) = len(vertices), edges(sub.graph, vertices)
    number = np.full(len(side), -1)
    number[vertices] = np.arange(n)

    # vertices of the band that touch what is left of either half
    rims = [np.unique(number[start[(number[end] < 0) & (side[end] == half)]]) for half in (0, 1)]
    if min(map(len, rims)) == 0:
        return side

    # a vertex is a pipe of its weight, from number to n + number; source 2 n and sink 2 n + 1 are
    # the halves
    inside = (number[end] >= 0) & (start != end)
    unbounded = 2**30  # capacity of an edge that no minimum cut may contain
    pipes = np.concatenate(
        [
            [np.arange(n), n + np.arange(n), sub.weight[vertices]],
            [n + number[start[inside]], number[end[inside]], np.full(inside.sum(), unbounded)],
            [np.full(len(rims[0]), 2 * n), rims[0], np.full(len(rims[0]), unbounded)],
            [n + rims[1], np.full(len(rims[1]), 2 * n + 1), np.full(len(rims[1]), unbounded)],
        ],
        axis=1,
    )
    rows, columns, capacity = pipes.astype(np.int32)
    network = csr_matrix((capacity, (rows, columns)), shape=(2 * n + 2,) * 2)
    residual = network - maximum_flow(network, 2 * n, 2 * n + 1).flow
    residual.eliminate_zeros()

    # the minimum cut runs through pipes whose beginning the source still reaches, but not their end
    reached = np.zeros(2 * n + 2, dtype=bool)
    reached[breadth_first_order(residual, 2 * n, return_predecessors=False)] = True
    begins, ends = reached[:n], reached[n : 2 * n]
    narrowed = np.where(side == MIDDLE, 1, side)
    narrowed[vertices] = np.where(begins, np.where(ends, 0, MIDDLE), 1)
    return narrowed


def _landmark_coordinates(graph: csr_matrix) -> NDArray[np.float64]:
    """X (n, dimensions) with distances like those along the graph's edges, by landmark MDS."""
    # numbers of edges to landmarks, each the farthest from those before it
    distances, start = [], int(_levels(graph, 0).argmax())
    for _ in range(N_LANDMARKS):
        distances.append(_levels(graph, start))
        start = int(np.min(distances, axis=0).argmax())
    squared = np.array(distances, dtype=float) ** 2

    # classical scaling of the landmarks; all others by their distances to these
    landmarks = squared.argmin(axis=1)
    between = squared[:, landmarks]
    mean = between.mean(axis=0)
    centred = -(between - mean - mean[:, None] + mean.mean()) / 2
    values, vectors = np.linalg.eigh(centred)
    largest = slice(-1, -N_DIMENSIONS - 1, -1)
    floor = 1e-12 * max(values[-1], 1e-12)
    scaled = vectors[:, largest] / np.sqrt(np.maximum(values[largest], floor))
    X = -(squared - mean[:, None]).T @ scaled / 2

    # each the mean of itself and its neighbours, several times over
    shares = diags_array(1 / np.maximum(np.diff(graph.indptr), 1)) @ graph
    for _ in range(N_SMOOTHINGS):
        X = shares @ X
    return X


def _levels(graph: csr_matrix, start: int) -> NDArray[np.int64]:
    """Numbers of edges (n,) from a vertex; other pieces of the graph lie behind the farthest."""
    level = np.full(graph.shape[0], -1)
    front, depth = np.array([start]), 0
    while len(front):
        level[front] = depth
        depth += 1
        neighbours = edges(graph, front)[1]
        neighbours = neighbours[level[neighbours] < 0]
        level[neighbours] = depth
        # a wide front is read off the levels, which needs no sorting
        is_wide = len(neighbours) > len(level) // 50
        front = np.flatnonzero(level == depth) if is_wide else np.unique(neighbours)
    level[level < 0] = 2 * depth
    return level
