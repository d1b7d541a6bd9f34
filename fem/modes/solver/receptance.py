"""Frequency response of the full model.

Of a large model by projection on the Krylov space

    V = span {u, S u, S^2 u, ...},    u = (K + s M)^-1 w,    S = (K + s M)^-1 M

which one factorisation spans for all frequencies (Feldmann and Freund, IEEE Trans. CAD 14 (1995)
639); it ends where the residual K u - omega^2 M u - w of the full model is small against w. Of
small models, and where the space does not reach, by a factorisation a frequency.

A basis of the whole model that is known already takes the place of V. Its error is

    H - H_V = r^T (K - omega^2 M)^-1 r,    r = w - (K - omega^2 M) u_V.

It is estimated by r^T K^-1 r. Since r has no part in the modes of the basis, the error is at most
1 / (1 - omega^2 / omega_j^2) times this estimate, with the lowest mode omega_j outside of the
basis.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix

from beadwave.fem.modes.modes import Modes
from beadwave.fem.modes.solver.factorisation import Factor, factorised
from beadwave.fem.modes.solver.threads import one_thread


class KrylovSettings(NamedTuple):
    """Use of a projection; values not varied."""

    smallest: int = 5_000  # unknowns from which on a projection is faster than solving each time
    shift: float = (2 * np.pi * 5.0) ** 2  # s [rad^2/s^2]: K itself may be singular
    residual: float = 1e-6  # of w; the receptance, a quadratic form, is off by its square or so
    vectors: int = 200  # at most
    interval: int = 10  # vectors between two looks at the residual
    missed: float = 1e-7  # of H, r^T K^-1 r: what a basis that is there already may miss


def receptance(
    K,
    M,
    w: NDArray[np.float64],
    frequency_hz: NDArray[np.float64],
    *,
    loss_factor: float = 0.0,
    basis: Modes | None = None,
    factor: Factor | None = None,
    settings: KrylovSettings = KrylovSettings(),
) -> NDArray[np.complex128]:
    """H = w^T (K (1 + i eta) - omega^2 M)^-1 w, (k,) [m/N]: displacement at w per force at w.

    K [N/m] and M [kg] (n, n) sparse, w (n,), frequency_hz (k,) [Hz]. Without a loss factor (or on a
    mode at rest) no bound holds: at a resonance H is as large as rounding lets it be, and only its
    place means anything.
    basis holds omega (m,) and phi (n, m), diagonal in K and M, and the factor is that of K: the
    frequencies at which such a basis misses too much are solved as without it. Raises ValueError
    where K - omega^2 M is singular at a frequency that is solved for by itself.
    """
    omega_squared = (2 * np.pi * np.asarray(frequency_hz, dtype=float)) ** 2
    stiff = 1 + 1j * loss_factor if loss_factor else 1.0
    H = np.full(len(omega_squared), np.nan + 0j)

    # in the basis that is there: phi is diagonal in K and M
    if basis is not None and factor is not None:
        q = basis.phi.T @ w / (stiff * basis.omega**2 - omega_squared[:, None])
        u = basis.phi @ q.T
        residual = w[:, None] - stiff * (K @ u) + (M @ u) * omega_squared
        if loss_factor:
            residual = np.hstack([residual.real, residual.imag])
        missed = np.sum(residual * factor.solve(residual), axis=0)
        missed = missed.reshape(-1, len(H)).sum(axis=0)
        H = np.where(missed < settings.missed * np.abs(w @ u), w @ u + 0j, np.nan)
        if not np.isnan(H).any():
            return H

    # projected, u = V q: the residual of the full equation decides which frequencies are solved
    n_vectors = settings.vectors if len(w) >= settings.smallest else 0
    if n_vectors:
        factor = factorised((K + settings.shift * M).tocsc())
        V, K_V = np.empty((len(w), n_vectors), order="F"), np.empty((n_vectors, n_vectors))
        x = factor.solve(w)
    for j in range(n_vectors):
        # M-orthogonal to the space so far, twice since rounding leaves some
        with one_thread():
            for _ in range(2):
                x = x - V[:, :j] @ (V[:, :j].T @ (M @ x))
        V[:, j] = x / np.sqrt(x @ (M @ x))
        m = j + 1
        K_V[:m, j] = K_V[j, :m] = (K @ V[:, j]) @ V[:, :m]
        if m % settings.interval == 0:
            for i in np.flatnonzero(np.isnan(H)):
                reduced = stiff * K_V[:m, :m] - omega_squared[i] * np.eye(m)
                u = V[:, :m] @ np.linalg.solve(reduced, V[:, :m].T @ w)
                residual = stiff * (K @ u) - omega_squared[i] * (M @ u) - w
                if np.linalg.norm(residual) < settings.residual * np.linalg.norm(w):
                    H[i] = w @ u
            if not np.isnan(H).any():
                break
        x = factor.solve(M @ V[:, j])

    # the others by a factor each
    for i in np.flatnonzero(np.isnan(H)):
        dynamic = csc_matrix(stiff * K - omega_squared[i] * M)
        H[i] = w @ factorised(dynamic).solve(w.astype(dynamic.dtype))
    return H
