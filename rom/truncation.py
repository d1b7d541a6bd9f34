"""How far a few modes and a residual vector answer at the contact like all modes do.

The residual vector r, what the static response K^-1 w has beyond the first k modes, knows the
moments of all modes that were never computed,
    m_1 = w^T r = sum_{j>k} phi_j^2 / omega_j^2,   m_2 = r^T M r,   m_3 = r^T M K^-1 M r,
and as a coordinate it is one oscillator with the right m_1 and m_2. What is then missing in the
receptance is bounded:
    0 <= H - H_k <= omega^4 (m_3 - m_2^2 / m_1) / (1 - omega^2 / omega_{k+1}^2)^3,
a one-point Gauss quadrature and its remainder. Golub and Meurant, Matrices, Moments and Quadrature
(2010), ch. 6.
"""

from typing import NamedTuple

import numpy as np

GRID = 400  # frequencies at which the error is averaged
DAMPING = 0.01  # modal damping of the receptance that the error is compared with


def frequencies(to_hz: float, n: int = GRID) -> np.ndarray:
    """(n,) [Hz], evenly up to to_hz."""
    return to_hz * np.arange(1, n + 1) / n


class Moments(NamedTuple):
    """sum phi_j^2 / omega_j^(2 i) over the modes left out, i = 1, 2, 3: [m/N], [m s^2/N], ..."""

    first: float
    second: float
    third: float


def tail_errors(omega: np.ndarray, phi: np.ndarray, tail: Moments, to_hz: float) -> np.ndarray:
    """Relative rms error of the receptance up to to_hz after the first 0, 1, .. k modes, (k + 1,).

    omega (k,) [rad/s] ascending, phi (k,) [kg^-1/2], tail of what lies beyond the k-th. Infinite
    while the next mode lies below to_hz.
    """
    s = 2 * np.pi * frequencies(to_hz)
    squared = np.where(omega > 0, omega, np.inf) ** 2
    # summed from the top: from the bottom the first mode would swallow all others
    left = [
        m + np.append(np.cumsum((phi**2 / squared**i)[::-1])[::-1], 0)
        for i, m in enumerate(tail, start=1)
    ]
    following = np.append(omega, omega[-1:] if len(omega) else 2 * s[-1])
    scale = rms(_receptance(omega, phi, left[0][0], s))
    missing = np.array([_missing(*parts, s) for parts in zip(*left, following, strict=True)])
    return np.where(left[0] < 1e-12 * left[0][0], 0.0, missing / scale)


def _missing(first: float, second: float, third: float, following: float, s: np.ndarray) -> float:
    if following <= s[-1] or first <= 0:
        return np.inf
    remainder = max(third - second**2 / first, 0.0)
    return remainder * rms(s**4 / (1 - (s / following) ** 2) ** 3)


def _receptance(omega: np.ndarray, phi: np.ndarray, compliance: float, s: np.ndarray) -> np.ndarray:
    elastic = omega > 0
    static = compliance - np.sum((phi[elastic] / omega[elastic]) ** 2)
    dynamic = omega**2 - s[:, None] ** 2 + 2j * DAMPING * omega * s[:, None]
    return static + (phi**2 / dynamic).sum(axis=1)


def rms(values: np.ndarray) -> float:
    """Root mean square of real or complex values."""
    return float(np.sqrt(np.mean(np.abs(values) ** 2)))


def likely_cutoff_hz(error: float, to_hz: float) -> float:
    """Where the modes of a solid usually suffice: 1.3 to_hz for 1e-3, 2.2 to_hz for 1e-4."""
    return to_hz * max(1.05, 1.3 * (1e-3 / error) ** 0.23)
