"""Difference at the contact between a few modes with a residual vector and all modes.

Every error stated of a reduction is that of the receptance H with the loss factor LOSS, relative,
rms over even frequencies up to to_hz:

    H(s) = w^T (K (1 + i LOSS) - s^2 M)^-1 w

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

LOSS = 0.01  # loss factor of the stiffness: half of it is the damping ratio of a mode


def frequencies(to_hz: float, n: int = 400) -> np.ndarray:
    """Frequencies at which an error is averaged, (n,) [Hz], evenly up to to_hz."""
    return to_hz * np.arange(1, n + 1) / n


class Moments(NamedTuple):
    """sum phi_j^2 / omega_j^(2 i) over the modes left out, i = 1, 2, 3: [m/N], [m s^2/N], ..."""

    first: float
    second: float
    third: float


def tail_errors(omega: np.ndarray, phi: np.ndarray, tail: Moments, to_hz: float) -> np.ndarray:
    """Relative rms error of the receptance up to to_hz after the first 0, 1, .. k modes, (k + 1,).

    omega (k,) [rad/s] ascending, phi (k,) [kg^-1/2], tail of what lies beyond the k-th. Infinite
    while the next mode lies below to_hz; the one after the k-th is taken for as low as that.
    """
    s = 2 * np.pi * frequencies(to_hz)
    squared = np.where(omega > 0, omega, np.inf) ** 2
    # summed from the top: from the bottom the first mode would swallow all others
    beyond = [
        m + np.append(np.cumsum((phi**2 / squared**i)[::-1])[::-1], 0)
        for i, m in enumerate(tail, start=1)
    ]
    following = np.append(omega, omega.max(initial=0.0))
    scale = size(tail.first + receptances(omega, phi, s).sum(axis=1))
    missing = []
    for first, second, third, next_omega in zip(*beyond, following, strict=True):
        if next_omega <= s[-1] or first <= 0:
            missing.append(np.inf)
            continue
        remainder = max(third - second**2 / first, 0.0)
        missing.append(remainder * rms(s**4 / (1 - (s / next_omega) ** 2) ** 3))
    return np.where(beyond[0] < 1e-12 * beyond[0][0], 0.0, np.array(missing) / scale)


def receptances(omega: np.ndarray, phi: np.ndarray, s: np.ndarray) -> np.ndarray:
    """H (f, k) [m/N] of each of the modes omega (k,) [rad/s], phi (k,) [kg^-1/2] at s (f,) [rad/s],
    with the loss factor LOSS of a stated error; of a rigid motion -phi^2 / s^2."""
    return phi**2 / (omega**2 * (1 + 1j * LOSS) - s[:, None] ** 2)


def size(H: np.ndarray) -> float:
    """The size of a receptance H (f,), real or complex, that its errors are relative to.

    A root mean square, of every eighth frequency, the smallest of the eight: one frequency that
    happens to meet a lightly damped peak would dominate that of all, and any error next to it would
    look small.
    """
    return min(rms(H[i::8]) for i in range(8))


def rms(values: np.ndarray) -> float:
    """Root mean square of real or complex values (...), of any shape."""
    return float(np.sqrt(np.mean(np.abs(values) ** 2)))


def first_cutoff_hz(error: float, to_hz: float) -> float:
    """Cutoff [Hz] with which the search for the cutoff that meets an error begins: near that one
    for a solid, too low for parts on joints.

    A rig on elements of 12 mm still misses 8e-3 up to 9 kHz with all modes to 1.3 times that, and
    2.6e-3 with those to 2.8 times: the error itself has to be computed and ends the search.
    """
    return to_hz * max(1.05, 1.3 * (1e-3 / error) ** 0.23)
