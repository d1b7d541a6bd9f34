"""Products of matrices V (n, k) of far more rows than columns, a share of the rows or columns at a
time: no second matrix of their size is held in memory."""

from collections.abc import Iterator

import numpy as np
import scipy.sparse as sp

ROWS, COLUMNS = 16384, 16  # of a share: a few MB of a basis of a hundred vectors


def shares(n: int, length: int = COLUMNS) -> Iterator[slice]:
    """Consecutive slices of 0 .. n - 1, of `length` each but the last."""
    return (slice(start, min(start + length, n)) for start in range(0, n, length))


def eighths(n: int) -> Iterator[slice]:
    """Slices of 0 .. n - 1, eight at most: a matrix taken by these needs an eighth of its room."""
    return shares(n, n // 8 + 1)


def gram(V: np.ndarray, A: sp.csc_array) -> np.ndarray:
    """V^T A V (k, k) of a symmetric A (n, n)."""
    G = np.empty((V.shape[1],) * 2)
    for c in shares(V.shape[1]):
        G[:, c] = V.T @ (A @ V[:, c])
    return G


def squares(V: np.ndarray, A: sp.csc_array) -> np.ndarray:
    """v_j^T A v_j (k,) of the columns v_j of V (n, k)."""
    sums = [np.einsum("ij,ij->j", V[:, c], A @ V[:, c]) for c in shares(V.shape[1])]
    return np.concatenate([np.zeros(0), *sums])


def turned(V: np.ndarray, U: np.ndarray) -> np.ndarray:
    """V U (n, j) of U (k, j), j <= k, written over V (n, k)."""
    for rows in shares(len(V), ROWS):
        V[rows, : U.shape[1]] = V[rows] @ U
    return V[:, : U.shape[1]]
