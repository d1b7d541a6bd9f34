"""Unknowns that are eliminated together, and the work of their elimination by minimum degree.

Successive unknowns that are coupled to the same ones, as x, y and z of a node are, are one vertex
of a graph a third as large. SuperLU finds the fill of its own order on that graph in a fraction of
the time that the matrix would take.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix, csr_matrix, diags_array, eye_array
from scipy.sparse.linalg import SuperLU, splu


class Groups(NamedTuple):
    """Groups of unknowns, and what is coupled."""

    graph: csr_matrix  # (m, m) symmetric, with its diagonal
    group: NDArray[np.int64]  # (n,) of every unknown

    @property
    def weight(self) -> NDArray[np.int64]:
        """Unknowns (m,) in each."""
        return np.bincount(self.group)


def grouped(A: csc_matrix, *, alike: float = 0.7) -> Groups:
    """The groups of a symmetric matrix.

    Neighbours that share more than `alike` of the unknowns that either is coupled to are one group:
    those of a node share 0.8 and more, less where a regular mesh makes exact zeros; those of
    different nodes up to 0.6.
    """
    n = A.shape[0]
    pattern = csr_matrix((np.ones(A.nnz, np.float32), A.indices, A.indptr), shape=A.shape)
    count = np.diff(A.indptr)
    common = np.ravel(pattern[:-1].multiply(pattern[1:]).sum(axis=1))
    together = common > alike * (count[:-1] + count[1:] - common)
    group = np.append(0, np.cumsum(~together))
    member = csr_matrix((np.ones(n, np.float32), (np.arange(n), group)))
    graph = member.T @ (pattern @ member)
    return Groups(csr_matrix(graph + eye_array(graph.shape[0], dtype=np.float32)), group)


def minimum_degree(A: csc_matrix) -> SuperLU:
    """A factor of SuperLU in the order of minimum degree on A + A^T, pivots from the diagonal.

    3 to 12 times faster than SuperLU's default on symmetric matrices. Raises RuntimeError for a
    singular matrix.
    """
    options = {"SymmetricMode": True}
    return splu(A, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)


def minimum_degree_work(groups: Groups) -> float:
    """Multiplications and additions of SuperLU's elimination, within a factor of 1.5: the sum over
    all unknowns of the square of their column's height in the factor, group by group."""
    graph = groups.graph
    # any matrix of this pattern that can be factorised will do
    neighbours = np.diff(graph.indptr)
    laplacian = diags_array(neighbours + 1.0) - csr_matrix(
        (np.ones(graph.nnz), graph.indices, graph.indptr)
    )
    factor = minimum_degree(csc_matrix(laplacian))
    weight = np.empty(len(neighbours))
    weight[factor.perm_c] = groups.weight
    columns = factor.L
    height = np.add.reduceat(weight[columns.indices], columns.indptr[:-1])
    return float(weight @ height**2)
