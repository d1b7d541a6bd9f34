"""Cholesky's factors of large sparse matrices, domain by domain of a nested dissection.

Each domain is a dense front: its own unknowns, eliminated here, and those of its ancestors that it
touches, to which it leaves an update,

    L11 L11^T = F11,    L21 = F21 L11^-T,    U = F22 - L21 L21^T

(Liu, SIAM Review 34 (1992) 82). All work is that of dense BLAS; L alone is kept, half of what LU
needs, its triangles packed in rectangles (Gustavson et al., ACM TOMS 37 (2010) 18).
"""

from contextlib import nullcontext
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigvalsh
from scipy.linalg.blas import dsyrk, dtrsm
from scipy.linalg.lapack import dpotrf, dtfsm, dtrttf
from scipy.sparse import csc_matrix, csr_matrix, tril

from beadwave.fem.modes.solver.grouping import Groups
from beadwave.fem.modes.solver.nested_dissection import edges, nested_dissection
from beadwave.fem.modes.solver.threads import one_thread

NEITHER = "the stiffness is singular: a part is neither held nor joined; hold it, or shift."


THREADS_FROM_FLOPS = 1e9  # multiplications and additions of an update that threads share
BLOCK_COLUMNS = 64  # of a child's update that are added at once
SINGULAR_SHARE = 1e-9  # of a front's largest eigenvalue: a smaller negative one is rounding


class NotPositiveDefinite(ValueError):
    """Some eigenvalue is negative: Cholesky's factors do not exist."""


class Singular(ValueError):
    """Some eigenvalue is zero but for rounding."""


class Front(NamedTuple):
    """Positions, in the order of elimination, of the unknowns of a dense block."""

    first: int  # those eliminated here: from the first ...
    end: int  # ... up to the end
    boundary: NDArray[np.int64]  # (b,) those of ancestors that it touches, ascending
    children: tuple[int, ...]  # positions in the list of fronts

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


class Elimination(NamedTuple):
    """The order of elimination, and its fronts."""

    order: NDArray[np.int64]  # (n,) unknown at each position
    fronts: list[Front]

    @property
    def bytes(self) -> int:
        """Memory [bytes] that the factor will take."""
        return 8 * sum(front.stored for front in self.fronts)


class Cholesky:
    """The factor of a symmetric positive definite matrix."""

    def __init__(self, A: csc_matrix, groups: Groups) -> None:
        """groups are those of A; raises NotPositiveDefinite or Singular."""
        self._order, self._fronts = plan(groups)
        A, fronts = tril(A[self._order][:, self._order], format="csc"), self._fronts
        # one array: thousands would leave holes in memory that no system gets back
        ends = np.cumsum([front.stored for front in fronts])
        numbers = np.split(np.empty(ends[-1]), ends[:-1])
        self.blocks = [f.blocks(stored) for f, stored in zip(fronts, numbers, strict=True)]

        updates: dict[int, NDArray] = {}
        for i, (front, (L11, L21)) in enumerate(zip(fronts, self.blocks, strict=True)):
            # what the matrix itself has in F11 (its lower triangle) and in F21, which becomes L21
            k = front.end - front.first
            F11, F21 = np.zeros((k, k), order="F"), L21
            F21[:] = 0.0
            entries = slice(A.indptr[front.first], A.indptr[front.end])
            rows, values = A.indices[entries], A.data[entries]
            columns = np.repeat(np.arange(k), np.diff(A.indptr[front.first : front.end + 1]))
            inside, below = (rows >= front.first) & (rows < front.end), rows >= front.end
            F11[rows[inside] - front.first, columns[inside]] = values[inside]
            F21[np.searchsorted(front.boundary, rows[below]), columns[below]] = values[below]

            # the updates of the children, each freed once it is added
            F22 = np.zeros((len(front.boundary),) * 2, order="F")
            for child in front.children:
                boundary, at_once = fronts[child].boundary, BLOCK_COLUMNS
                extend_add(front, (F11, F21, F22), boundary, updates.pop(child), at_once)

            # L11 L11^T = F11; two halves that nothing joins have no unknowns between them
            updates[i] = F22
            if k == 0:
                continue
            with one_thread():
                factor, failed = dpotrf(F11, lower=1, clean=0)
            if failed:
                values = eigvalsh(F11, lower=True)
                if values[0] < -SINGULAR_SHARE * np.abs(values).max():
                    raise NotPositiveDefinite("the matrix has negative eigenvalues.")
                raise Singular(NEITHER)

            # L21 = F21 L11^-T and U = F22 - L21 L21^T, both in place
            if len(F21):
                is_large = F21.size * len(F21) > THREADS_FROM_FLOPS
                with nullcontext() if is_large else one_thread():
                    dtrsm(1.0, factor, F21, side=1, lower=1, trans_a=1, overwrite_b=1)
                    dsyrk(-1.0, F21, beta=1.0, c=F22, lower=1, overwrite_c=1)
            L11[:] = dtrttf(factor, uplo="L")[0]
            del factor  # else it is in memory while the next front is assembled

    def solve(self, b: NDArray[np.float64]) -> NDArray[np.float64]:
        """x of A x = b, (n,) or (n, k); k may be 0."""
        if not b.size:  # refused by LAPACK
            return np.zeros(b.shape)
        y = b[self._order].reshape(len(b), -1).astype(float, copy=False)
        self._substitute(y)
        x = np.empty_like(y)
        x[self._order] = y
        return x.reshape(b.shape)

    def compliance(self, C: csr_matrix) -> NDArray[np.float64]:
        """C A^-1 C^T = Y^T Y (r, r) of rows C (r, n), with L Y = C^T.

        A front needs the columns of Y alone whose rows of C read unknowns that are eliminated in it
        or below it (Gilbert and Peierls, SIAM J. Sci. Stat. Comput. 9 (1988) 862); what they leave
        to its boundary goes to its parent, as in the elimination. Substituting back as well took
        seven times as long for 3432 rows of 53 136 unknowns.
        """
        C, r = csr_matrix(C[:, self._order]), C.shape[0]
        # rows in the order of the fronts that they reach first, so that those of a front are close
        reads = np.split(C.indices, C.indptr[1:-1])
        sequence = np.argsort([at.min(initial=C.shape[1]) for at in reads], kind="stable")
        C, W = csc_matrix(C[sequence]), np.zeros((r, r), order="F")
        updates: dict[int, tuple[NDArray[np.int64], NDArray[np.float64]]] = {}
        for i, (front, (L11, L21)) in enumerate(zip(self._fronts, self.blocks, strict=True)):
            # unknowns of the front, own and boundary, under the rows that reach it
            k, entries = front.end - front.first, C.indptr[front.first : front.end + 1]
            reading = C.indices[entries[0] : entries[-1]]
            below = [updates.pop(child) for child in front.children]
            columns = np.unique(np.concatenate([reading, *(own for own, _ in below)]))
            y = np.zeros((k + len(front.boundary), len(columns)))
            unknown = np.repeat(np.arange(k), np.diff(entries))
            y[unknown, np.searchsorted(columns, reading)] = C.data[entries[0] : entries[-1]]
            for child, (own, left) in zip(front.children, below, strict=True):
                boundary = self._fronts[child].boundary
                n = int(np.searchsorted(boundary, front.end))
                later = k + np.searchsorted(front.boundary, boundary[n:])
                at = np.append(boundary[:n] - front.first, later)
                y[np.ix_(at, np.searchsorted(columns, own))] += left
            updates[i] = columns, y[k:]
            if k == 0 or not len(columns):
                continue

            is_large = y.size * len(columns) > THREADS_FROM_FLOPS
            with nullcontext() if is_large else one_thread():
                solved = dtfsm(1.0, L11, y[:k], uplo="L")
                y[k:] -= L21 @ solved
                _add(W, columns, columns, solved.T @ solved, BLOCK_COLUMNS)

        # the other triangle
        for first in range(0, r, BLOCK_COLUMNS):
            block, below = slice(first, first + BLOCK_COLUMNS), slice(first + BLOCK_COLUMNS, None)
            W[block, block] = np.tril(W[block, block]) + np.tril(W[block, block], -1).T
            W[block, below] = W[below, block].T
        place = np.argsort(sequence)
        return W[np.ix_(place, place)]

    def _substitute(self, y: NDArray[np.float64]) -> None:
        """Solve L L^T x = y (n, k) in place."""
        with one_thread():
            # L y = b, children before their parents
            for front, (L11, L21) in zip(self._fronts, self.blocks, strict=True):
                if not len(L11):
                    continue
                y_1 = dtfsm(1.0, L11, y[front.first : front.end], uplo="L")
                y[front.first : front.end] = y_1
                y[front.boundary] -= L21 @ y_1
            # L^T x = y, parents before their children
            for front, (L11, L21) in zip(self._fronts[::-1], self.blocks[::-1], strict=True):
                if not len(L11):
                    continue
                x_1 = y[front.first : front.end] - L21.T @ y[front.boundary]
                y[front.first : front.end] = dtfsm(1.0, L11, x_1, uplo="L", trans="T")


def plan(groups: Groups) -> Elimination:
    """The order of elimination of a symmetric matrix's unknowns, and its fronts, children before
    their parents: by the pattern alone, before any number is computed."""
    (graph, group), weight = groups, groups.weight
    domains = nested_dissection(graph, weight)
    sequence = np.concatenate([d.vertices for d in domains])
    rank = np.empty(len(sequence), dtype=np.int64)
    rank[sequence] = np.arange(len(sequence))
    ends = np.append(0, np.cumsum(weight[sequence]))  # first unknown of each group, by rank

    # a front's boundary: the later groups that it or its children are coupled to
    fronts: list[Front] = []
    ancestors: list[NDArray[np.int64]] = []  # ranks of the groups on the boundary of each domain
    first = 0
    for vertices, children in domains:
        end = first + len(vertices)
        coupled = [rank[edges(graph, vertices)[1]], *(ancestors[child] for child in children)]
        later = np.unique(np.concatenate(coupled))
        later = later[later >= end]
        counts = ends[later + 1] - ends[later]
        # 0, 1, ... within each of these groups
        within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        boundary = np.repeat(ends[later], counts) + within
        fronts.append(Front(int(ends[first]), int(ends[end]), boundary, children))
        ancestors.append(later)
        first = end
    return Elimination(np.argsort(rank[group], kind="stable"), fronts)


def extend_add(
    front: Front, blocks: tuple, boundary: NDArray[np.int64], U: NDArray, at_once: int
) -> None:
    """Add a child's update U (b, b), on its boundary (b,), to the `blocks` F11 (k, k), F21 (f, k)
    and F22 (f, f) of its parent `front`, in place; lower triangles only.

    The boundary ascends, so that its first n positions are unknowns eliminated in the parent and
    the others lie on the parent's own boundary, which holds them all.
    """
    F11, F21, F22 = blocks
    n = int(np.searchsorted(boundary, front.end))
    rows_11 = boundary[:n] - front.first
    rows_22 = np.searchsorted(front.boundary, boundary[n:])
    _add(F11, rows_11, rows_11, U[:n, :n], at_once)
    _add(F21, rows_22, rows_11, U[n:, :n], at_once)
    _add(F22, rows_22, rows_22, U[n:, n:], at_once)


def _add(
    F: NDArray, rows: NDArray[np.int64], columns: NDArray[np.int64], U: NDArray, at_once: int
) -> None:
    """Add U to these rows and columns of F, in place; of equal ones the lower triangle."""
    flat = F.T.reshape(-1)  # F is stored by columns
    for first in range(0, len(columns), at_once):
        block = columns[first : first + at_once]
        below = first if rows is columns else 0
        position = (block[:, None] * len(F) + rows[below:]).ravel()
        flat[position] += U.T[first : first + at_once, below:].ravel()
