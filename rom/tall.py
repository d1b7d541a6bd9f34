"""Products of matrices (n, k) of far more rows than columns, a share of them at a time, so that
no second one of their size is held."""

from collections.abc import Iterator

import numpy as np
import scipy.sparse as sp

ROWS, COLUMNS = 16384, 16  # of a share


def shares(n: int, each: int = COLUMNS) -> Iterator[slice]:
    """Consecutive slices of 0 .. n - 1."""
    return (slice(first, min(first + each, n)) for first in range(0, n, each))


def gram(V: np.ndarray, A: sp.csc_array) -> np.ndarray:
    """V^T A V (k, k) of a symmetric A (n, n)."""
    G = np.empty((V.shape[1],) * 2)
    for some in shares(V.shape[1]):
        G[:, some] = V.T @ (A @ V[:, some])
    return G


def squares(V: np.ndarray, A: sp.csc_array) -> np.ndarray:
    """v_j^T A v_j (k,) of the columns."""
    found = [np.einsum("ij,ij->j", V[:, c], A @ V[:, c]) for c in shares(V.shape[1])]
    return np.concatenate([np.zeros(0), *found])


def turned(V: np.ndarray, U: np.ndarray) -> np.ndarray:
    """V U (n, j), j <= k, written over V (n, k)."""
    for some in shares(len(V), ROWS):
        V[some, : U.shape[1]] = V[some] @ U
    return V[:, : U.shape[1]]
