"""One sparse symmetric factorisation of K - sigma M, and what must hold of the matrices before.

What a factor is handed in as, a Pencil of K and M with it, and the scale of rounding in K.
"""

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike
from scipy.sparse.linalg import splu

from beadwave.rom.tall import eighths, shares

EPS = np.finfo(float).eps


class ReductionError(ValueError):
    """The matrices handed in do not allow the reduction; the sentence says why."""


class Solver(Protocol):
    """A factorisation: ``solve(b)`` for b (n,) or (n, k)."""

    def solve(self, b: np.ndarray) -> np.ndarray:
        """x with A x = b, of the shape of b."""
        ...


Factorise = Callable[[sp.csc_array], Solver]


class Pencil(NamedTuple):
    """K and M (n, n) with one factor of K - sigma M, sigma [rad^2/s^2]."""

    K: sp.csc_array
    M: sp.csc_array
    factor: Solver
    sigma: float = 0.0


def superlu(A: sp.csc_array) -> Solver:
    """Symmetric-mode SuperLU factor of A (n, n): the default where no faster one is handed in.

    Ordered by A^T + A and without row exchanges, which is 3 to 12 times as fast as SuperLU's
    default on stiffness matrices and as accurate as long as A is definite. Raises RuntimeError
    where A is exactly singular; rounding may hide that, see `rom.floating.is_held`.
    """
    return splu(
        sp.csc_array(A),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )


def symmetric(A: ArrayLike | sp.sparray | sp.spmatrix, name: str) -> sp.csc_array:
    """A (n, n) as a sparse array; raises ReductionError unless square, finite and symmetric."""
    A = sp.csc_array(A, dtype=float)
    require_symmetric(A, name)
    return A


def require_symmetric(A: sp.csc_array | np.ndarray, name: str) -> None:
    """Raise ReductionError unless A (n, n) is square, finite and symmetric."""
    if A.shape[0] != A.shape[1]:
        raise ReductionError(f"{name} is {A.shape[0]} x {A.shape[1]}; it must be square.")
    if not np.isfinite(A.data if sp.issparse(A) else A).all():
        raise ReductionError(f"{name} holds a value that is not finite.")
    largest, n = max(A.max(), -A.min(), np.finfo(float).tiny), A.shape[0]
    # (A - A^T) x of a random x shows whether entries differ, for two products in place of a
    # transposed matrix: rounding leaves 1e-16 of a row's sum, and entries of x are at least 0.5
    rng = np.random.default_rng(0)
    x = rng.uniform(0.5, 1.5, n) * rng.choice([-1.0, 1.0], n)
    if np.abs(A @ x - A.T @ x).max(initial=0.0) < 1e-10 * largest:
        return
    # largest |a_ij - a_ji| over the largest |a_ij|; in eighths, for no second matrix of that size
    asymmetry = max(abs(A[rows] - A[:, rows].T).max() for rows in eighths(n)) / largest
    if asymmetry > 1e-9:
        raise ReductionError(
            f"{name} is not symmetric (largest relative difference {asymmetry:.1e}, allowed 1e-9);"
            f" symmetrise it where it is assembled."
        )


def frequency_scale(K: sp.csc_array, M: sp.csc_array) -> float:
    """Largest diagonal ratio K_jj / M_jj [rad^2/s^2] but for one in a hundred.

    A bound of what rounding in K does to its eigenvalues: a few springs of any stiffness stand on
    a diagonal of their own and disturb nothing else.
    """
    k, m = K.diagonal(), M.diagonal()
    ratio = np.sort(k[m > 0] / m[m > 0])
    return float(ratio[max(0, int(np.ceil(0.99 * len(ratio))) - 1)]) if len(ratio) else 0.0


def noise(K: sp.csc_array, M: sp.csc_array) -> float:
    """Size that rounding gives to a zero eigenvalue omega^2 [rad^2/s^2]: 200 roundings of the
    scale."""
    return 200 * EPS * frequency_scale(K, M)


def solutions(factor: Solver, B: sp.csc_array | np.ndarray) -> np.ndarray:
    """X (n, k) with A X = B (n, k), in blocks of columns so that no dense copy of B is made."""
    X = np.empty(B.shape, order="F")
    for c in shares(B.shape[1]):
        columns = B[:, c]
        dense = columns.toarray(order="F") if sp.issparse(B) else np.asfortranarray(columns)
        X[:, c] = factor.solve(dense)
    return X
