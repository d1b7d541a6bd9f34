"""Linear constraints by elimination: slave dofs written in others, U = T u, K -> T^T K T.

A constraint states U[slaves] = A U; with an empty A it holds them still. Slaves may depend on dofs
that are slaves of another constraint (a bracket on a beam that itself stands on a plate): chains
are followed until only free dofs remain. Of two constraints on one dof the first one applies.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix, csr_matrix, eye_array


class Constraint(NamedTuple):
    """U[slaves] = A @ U."""

    slaves: NDArray[np.int64]  # (n,)
    A: csr_matrix  # (n, n_total)
    name: str  # what a user knows it by


class ConstraintReduction(NamedTuple):
    """U = T @ u over the dofs that stay free."""

    T: csr_matrix  # (n_total, n)
    free: NDArray[np.int64]  # (n,) where the free dofs stand among all


class Overconstrained(NamedTuple):
    """Dofs that two constraints would hold, by the names of these."""

    slaves: NDArray[np.int64]  # (n,)
    dropped: str
    kept: str


def fixed(slaves: NDArray[np.int64], n_total: int, name: str) -> Constraint:
    """The constraint that holds dofs (n,) still."""
    return Constraint(slaves, csr_matrix((len(slaves), n_total)), name)


def claimed(
    n_total: int, constraints: Sequence[Constraint]
) -> tuple[list[Constraint], list[Overconstrained]]:
    """The constraints without the dofs that an earlier one holds, and which dofs these were.

    Of n_total dofs each is slave once then, as `eliminated` needs; the order of constraints says
    which of two applies.
    """
    owner, reduced, overconstrained = np.full(n_total, -1), [], []
    for i, c in enumerate(constraints):
        earlier = owner[c.slaves]
        for j in np.unique(earlier[earlier >= 0]):
            dofs = c.slaves[earlier == j]
            overconstrained.append(Overconstrained(dofs, c.name, constraints[j].name))
        new = earlier < 0
        owner[c.slaves[new]] = i
        reduced.append(c if new.all() else c._replace(slaves=c.slaves[new], A=c.A[new]))
    return reduced, overconstrained


def eliminated(
    n_total: int, constraints: Sequence[Constraint], *, n_doublings: int = 10
) -> ConstraintReduction:
    """T and the free dofs under `constraints`; chains of up to 2^n_doublings slaves are followed.

    Raises ValueError when a dof is slave twice or constraints form a circle.
    """
    slaves = np.concatenate([np.empty(0, np.int64), *(c.slaves for c in constraints)])
    if len(np.unique(slaves)) != len(slaves):
        raise ValueError("a degree of freedom is the slave of two constraints; remove one.")
    free = np.ones(n_total, dtype=bool)
    free[slaves] = False

    # one step of all chains: the identity on free dofs, A on the rows of slaves
    identity = eye_array(n_total, format="csr")
    identity.data[:] = free
    T = csr_matrix(identity)
    for c in constraints:
        shape = (n_total, len(c.slaves))
        rows = csr_matrix((np.ones(len(c.slaves)), (c.slaves, np.arange(len(c.slaves)))), shape)
        T = T + rows @ c.A
    T.eliminate_zeros()

    # T @ T takes twice as many steps, until no slave leans on another
    for _ in range(n_doublings):
        if T[:, ~free].nnz == 0:
            return ConstraintReduction(T[:, free].tocsr(), np.flatnonzero(free))
        T = T @ T
        T.eliminate_zeros()
    raise ValueError("constraints form a circle: a face is the master of its own slaves.")


def congruent(T: csr_matrix, A: csr_matrix) -> csc_matrix:
    """T^T A T (n, n) of a symmetric A (n_total, n_total) and T (n_total, n), symmetric to the last
    bit: factorisations read one triangle, products both."""
    product = (T.T @ (A @ T)).tocsc()
    return ((product + product.T) / 2).tocsc()
