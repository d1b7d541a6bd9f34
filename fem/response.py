"""Frequency response of the full model, by one factorisation a frequency."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix

from fem.factorisation import factorised


def receptance(
    K, M, w: NDArray[np.float64], frequency_hz: NDArray[np.float64], *, loss_factor: float = 0.0
) -> NDArray[np.complex128]:
    """H = w^T (K (1 + i eta) - omega^2 M)^-1 w, (k,) [m/N]: displacement at w per force at w.

    Without a loss factor (or on a mode at rest) no bound holds: at a resonance H is as large as
    rounding lets it be, and only its place means anything.
    """
    K = K * (1 + 1j * loss_factor) if loss_factor else K
    H = np.empty(len(frequency_hz), dtype=complex)
    for i, omega in enumerate(2 * np.pi * np.asarray(frequency_hz)):
        dynamic = csc_matrix(K - omega**2 * M)
        H[i] = w @ factorised(dynamic).solve(w.astype(dynamic.dtype))
    return H
