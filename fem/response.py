"""Frequency response of the full model.

Of a large model by projection on the Krylov space

    V = span {u, S u, S^2 u, ...},    u = (K + s M)^-1 w,    S = (K + s M)^-1 M

which one factorisation spans for all frequencies (Feldmann and Freund, IEEE Trans. CAD 14 (1995)
639); it ends where K u - omega^2 M u - w of the full model is nothing beside w. Of small models,
and where the space does not reach, by a factorisation a frequency.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix

from fem.factorisation import factorised
from fem.threads import one_thread

WORTH_PROJECTING = 5_000  # unknowns
SHIFT = (2 * np.pi * 5.0) ** 2  # s: K itself may be singular
RESIDUAL = 1e-6  # of w; the receptance, a quadratic form, is off by its square or so
MOST, BETWEEN = 200, 10  # vectors, and between two looks at the residual


def receptance(
    K, M, w: NDArray[np.float64], frequency_hz: NDArray[np.float64], *, loss_factor: float = 0.0
) -> NDArray[np.complex128]:
    """H = w^T (K (1 + i eta) - omega^2 M)^-1 w, (k,) [m/N]: displacement at w per force at w.

    Without a loss factor (or on a mode at rest) no bound holds: at a resonance H is as large as
    rounding lets it be, and only its place means anything.
    """
    omega_squared = (2 * np.pi * np.asarray(frequency_hz, dtype=float)) ** 2
    stiff = 1 + 1j * loss_factor if loss_factor else 1.0
    H = np.full(len(omega_squared), np.nan + 0j)
    if len(w) >= WORTH_PROJECTING:
        H = _projected(K, M, w, omega_squared, stiff)
    for i in np.flatnonzero(np.isnan(H)):
        dynamic = csc_matrix(stiff * K - omega_squared[i] * M)
        H[i] = w @ factorised(dynamic).solve(w.astype(dynamic.dtype))
    return H


def _projected(
    K, M, w: NDArray[np.float64], omega_squared: NDArray[np.float64], stiff: complex
) -> NDArray[np.complex128]:
    """(k,) NaN where the residual is still too large when the space is full."""
    factor = factorised((K + SHIFT * M).tocsc())
    V, reduced = np.empty((len(w), MOST), order="F"), np.empty((MOST, MOST))
    H = np.full(len(omega_squared), np.nan + 0j)
    x = factor.solve(w)
    for j in range(MOST):
        x = _orthogonal(x, V[:, :j], M)
        V[:, j] = x / np.sqrt(x @ (M @ x))
        reduced[: j + 1, j] = reduced[j, : j + 1] = (K @ V[:, j]) @ V[:, : j + 1]
        if (j + 1) % BETWEEN == 0:
            for i in np.flatnonzero(np.isnan(H)):
                H[i] = _found(K, M, w, omega_squared[i], stiff, V[:, : j + 1], reduced)
            if not np.isnan(H).any():
                break
        x = factor.solve(M @ V[:, j])
    return H


def _orthogonal(x: NDArray[np.float64], V: NDArray[np.float64], M) -> NDArray[np.float64]:
    """x without its part in the M-orthonormal V, twice since rounding leaves some."""
    with one_thread():
        for _ in range(2):
            x = x - V @ (V.T @ (M @ x))
    return x


def _found(
    K, M, w: NDArray[np.float64], omega_squared: float, stiff: complex, V, reduced
) -> complex:
    """w^T u of the projected equation; NaN where u leaves a residual of the full one."""
    m = V.shape[1]
    q = np.linalg.solve(stiff * reduced[:m, :m] - omega_squared * np.eye(m), V.T @ w)
    u = V @ q
    residual = stiff * (K @ u) - omega_squared * (M @ u) - w
    return w @ u if np.linalg.norm(residual) < RESIDUAL * np.linalg.norm(w) else np.nan
