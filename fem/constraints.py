"""Linear constraints by elimination: slave dofs written in others, U = T u, K -> T^T K T.

A constraint states U[slaves] = A U. Slaves may lean on dofs that are slaves elsewhere (a sheet on
a support that itself stands on a plate); the chain is followed until only free dofs remain.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix, csr_matrix, eye_array

LONGEST_CHAIN = 8


class Constraint(NamedTuple):
    """U[slaves] = A @ U."""

    slaves: NDArray[np.int64]  # (n,)
    A: csr_matrix  # (n, n_total)


class Reduction(NamedTuple):
    """U = T @ u over the dofs that stay free."""

    T: csr_matrix  # (n_total, n)
    free: NDArray[np.int64]  # (n,) where the free dofs stand among all


def eliminated(n_total: int, constraints: list[Constraint], held: NDArray[np.int64]) -> Reduction:
    """Free dofs when `constraints` hold and the dofs `held` are zero.

    Raises ValueError when a dof is slave twice or constraints form a circle.
    """
    slaves = np.concatenate([np.empty(0, np.int64), *(c.slaves for c in constraints)])
    if len(np.unique(slaves)) != len(slaves):
        raise ValueError("a degree of freedom is the slave of two constraints; remove one.")
    is_slave, keep = np.zeros(n_total, dtype=bool), np.ones(n_total, dtype=bool)
    is_slave[slaves], keep[slaves], keep[held] = True, False, False
    S = _step(n_total, constraints, slaves, keep | is_slave)
    T = S
    for _ in range(LONGEST_CHAIN):
        if T[:, is_slave].nnz == 0:
            return Reduction(T[:, keep].tocsr(), np.flatnonzero(keep))
        T = T @ S
        T.eliminate_zeros()
    raise ValueError("constraints form a circle: a face is the master of its own slaves.")


def _step(n_total, constraints, slaves, not_held) -> csr_matrix:
    identity = eye_array(n_total, format="csr")
    identity.data[:] = not_held
    identity.data[slaves] = 0.0
    S = csr_matrix(identity)
    for c in constraints:
        place = csr_matrix(
            (np.ones(len(c.slaves)), (c.slaves, np.arange(len(c.slaves)))),
            shape=(n_total, len(c.slaves)),
        )
        S = S + place @ c.A
    S.eliminate_zeros()
    return S


def congruent(T: csr_matrix, A: csr_matrix) -> csc_matrix:
    """T^T A T, symmetric to the last bit."""
    product = (T.T @ (A @ T)).tocsc()
    return ((product + product.T) / 2).tocsc()
