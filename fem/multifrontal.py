"""Cholesky's factors of large sparse matrices, domain by domain of a nested dissection.

Each domain is a dense front: its own unknowns, eliminated here, and those of its ancestors that it
touches, to which it leaves an update,

    L11 L11^T = F11,    L21 = F21 L11^-T,    U = F22 - L21 L21^T

(Liu, SIAM Review 34 (1992) 82). All work is that of dense BLAS; L alone is kept, half of what LU
needs, its triangles packed in rectangles (Gustavson et al., ACM TOMS 37 (2010) 18).
"""

from collections.abc import Sequence
from contextlib import nullcontext
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigvalsh
from scipy.linalg.blas import dsyrk, dtrsm
from scipy.linalg.lapack import dpotrf, dtfsm, dtrttf
from scipy.sparse import csc_matrix, csr_matrix, tril

from fem.grouping import Groups
from fem.nested_dissection import Domain, edges, nested_dissection
from fem.threads import one_thread

NEITHER = "the stiffness is singular: a part is neither held nor joined; hold it, or shift."
WORTH_THREADS = 1e9  # multiplications and additions of one update
COLUMNS = 64  # of a front that are added at once
SINGULAR = 1e-9  # of a front's largest eigenvalue: a negative one below this is rounding


class NotPositiveDefinite(ValueError):
    """Some eigenvalue is negative: Cholesky's factors do not exist."""


class Singular(ValueError):
    """Some eigenvalue is zero but for rounding."""


class Front(NamedTuple):
    """Positions in the order of elimination."""

    first: int  # own ones: from the first ...
    end: int  # ... up to the end
    boundary: NDArray[np.int64]  # (b,) of ancestors, ascending
    children: tuple[int, ...]

    @property
    def work(self) -> float:
        """Multiplications and additions of its elimination."""
        k, b = self.end - self.first, len(self.boundary)
        return k**3 / 3 + k * k * b + float(k) * b * b

    @property
    def stored(self) -> int:
        """Numbers in L11 and L21."""
        k = self.end - self.first
        return k * (k + 1) // 2 + k * len(self.boundary)

    def blocks(self, numbers: NDArray[np.float64]) -> tuple[NDArray, NDArray]:
        """L11, packed, and L21 in the numbers (stored,) that hold them."""
        k = self.end - self.first
        L11, L21 = np.split(numbers, [k * (k + 1) // 2])
        return L11, L21.reshape((len(self.boundary), k), order="F")


class Plan(NamedTuple):
    """What is eliminated when."""

    order: NDArray[np.int64]  # (n,) unknown at each position
    fronts: list[Front]

    @property
    def bytes(self) -> int:
        """That the factor will take."""
        return 8 * sum(front.stored for front in self.fronts)


class Cholesky:
    """The factor of a symmetric positive definite matrix."""

    def __init__(self, A: csc_matrix, groups: Groups) -> None:
        """groups are those of A; raises NotPositiveDefinite or Singular."""
        self._order, self._fronts = plan(groups)
        self.blocks = _factors(tril(A[self._order][:, self._order], format="csc"), self._fronts)

    def solve(self, b: NDArray[np.float64]) -> NDArray[np.float64]:
        """x of A x = b, (n,) or (n, k)."""
        with one_thread():
            return self._solved(b)

    def _solved(self, b: NDArray[np.float64]) -> NDArray[np.float64]:
        y = b[self._order].reshape(len(b), -1).astype(float, copy=False)
        # two halves that nothing joins have nothing between them
        pairs = [pair for pair in zip(self._fronts, self.blocks, strict=True) if len(pair[1][0])]
        for front, (L11, L21) in pairs:
            own = dtfsm(1.0, L11, y[front.first : front.end], uplo="L")
            y[front.first : front.end] = own
            y[front.boundary] -= L21 @ own
        for front, (L11, L21) in reversed(pairs):
            rest = y[front.first : front.end] - L21.T @ y[front.boundary]
            y[front.first : front.end] = dtfsm(1.0, L11, rest, uplo="L", trans="T")
        x = np.empty_like(y)
        x[self._order] = y
        return x.reshape(b.shape)


def plan(groups: Groups) -> Plan:
    """The order of elimination of a symmetric matrix's unknowns, and its fronts."""
    (graph, group), weight = groups, groups.weight
    domains = nested_dissection(graph, weight)
    sequence = np.concatenate([d.vertices for d in domains])
    rank = np.empty(len(sequence), dtype=np.int64)
    rank[sequence] = np.arange(len(sequence))
    order = np.argsort(rank[group], kind="stable")
    ends = np.append(0, np.cumsum(weight[sequence]))
    return Plan(order, _fronts(graph, domains, rank, ends))


def _fronts(graph: csr_matrix, domains: Sequence[Domain], rank, ends) -> list[Front]:
    """Of groups with their positions `rank` and first unknowns `ends`."""
    fronts: list[Front] = []
    touched: list[NDArray[np.int64]] = []  # ranks of the ancestors of each domain
    first = 0
    for vertices, children in domains:
        last = first + len(vertices)
        met = [rank[edges(graph, vertices)[1]], *(touched[child] for child in children)]
        ancestors = np.unique(np.concatenate(met))
        ancestors = ancestors[ancestors >= last]
        counts = ends[ancestors + 1] - ends[ancestors]
        boundary = np.repeat(ends[ancestors], counts) + _within(counts)
        fronts.append(Front(int(ends[first]), int(ends[last]), boundary, children))
        touched.append(ancestors)
        first = last
    return fronts


def _within(counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """0, 1, ... within each of consecutive groups of these sizes."""
    starts = np.cumsum(counts) - counts
    return np.arange(counts.sum()) - np.repeat(starts, counts)


def _factors(A: csc_matrix, fronts: Sequence[Front]) -> list[tuple[NDArray, NDArray]]:
    """L11 and L21 of every front of the ordered matrix, of which the lower triangle is enough."""
    ends = np.cumsum([front.stored for front in fronts])
    # one array: thousands would leave holes in memory that no system gets back
    L, updates = np.empty(ends[-1]), {}
    parts = np.split(L, ends[:-1])
    blocks = [front.blocks(part) for front, part in zip(fronts, parts, strict=True)]
    for i, (front, (L11, L21)) in enumerate(zip(fronts, blocks, strict=True)):
        F11 = _assembled(A, front, L21)
        F22 = np.zeros((len(front.boundary),) * 2, order="F")
        for child in front.children:
            _extend(front, fronts[child].boundary, updates.pop(child), (F11, L21, F22))
        if len(F11):
            L11[:] = _eliminated(F11, L21, F22)
        updates[i] = F22
    return blocks


def _eliminated(F11: NDArray, F21: NDArray, F22: NDArray) -> NDArray:
    """L11 in LAPACK's packed format; F21 and F22 become L21 and the update, in place.

    Raises NotPositiveDefinite or Singular.
    """
    with one_thread():
        L11, failed = dpotrf(F11, lower=1, clean=0)
    if failed:
        values = eigvalsh(F11, lower=True)
        if values[0] < -SINGULAR * np.abs(values).max():
            raise NotPositiveDefinite("the matrix has negative eigenvalues.")
        raise Singular(NEITHER)
    if len(F21):
        with one_thread():
            dtrsm(1.0, L11, F21, side=1, lower=1, trans_a=1, overwrite_b=1)
        with nullcontext() if F21.size * len(F21) > WORTH_THREADS else one_thread():
            dsyrk(-1.0, F21, beta=1.0, c=F22, lower=1, overwrite_c=1)
    return dtrttf(L11, uplo="L")[0]


def _assembled(A: csc_matrix, front: Front, F21: NDArray[np.float64]) -> NDArray[np.float64]:
    """What the matrix itself has in F11; the same in F21, in place."""
    k = front.end - front.first
    entries = slice(A.indptr[front.first], A.indptr[front.end])
    rows, values = A.indices[entries], A.data[entries]
    columns = np.repeat(np.arange(k), np.diff(A.indptr[front.first : front.end + 1]))
    own = (rows >= front.first) & (rows < front.end)
    F11, F21[:] = np.zeros((k, k), order="F"), 0.0
    F11[rows[own] - front.first, columns[own]] = values[own]
    below = rows >= front.end
    F21[np.searchsorted(front.boundary, rows[below]), columns[below]] = values[below]
    return F11


def _extend(front: Front, rows: NDArray[np.int64], U: NDArray, blocks: tuple) -> None:
    """Add a child's update U on these rows to the three blocks, in place; lower triangles only."""
    n_own = int(np.searchsorted(rows, front.end))
    own, rest = rows[:n_own] - front.first, np.searchsorted(front.boundary, rows[n_own:])
    F11, F21, F22 = blocks
    _add(F11, own, own, U[:n_own, :n_own])
    _add(F21, rest, own, U[n_own:, :n_own])
    _add(F22, rest, rest, U[n_own:, n_own:])


def _add(F: NDArray, rows: NDArray[np.int64], columns: NDArray[np.int64], U: NDArray) -> None:
    """Add U to these rows and columns of F, in place; of equal ones the lower triangle."""
    flat = F.T.reshape(-1)  # F is stored by columns
    for first in range(0, len(columns), COLUMNS):
        some = columns[first : first + COLUMNS]
        below = first if rows is columns else 0
        at = (some[:, None] * len(F) + rows[below:]).ravel()
        flat[at] += U.T[first : first + COLUMNS, below:].ravel()
