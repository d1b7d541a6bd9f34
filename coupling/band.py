"""The band of an analogue instrument: Butterworth filters, causal, exact for a cubic spline.

    H(s) = d + sum r_i / (s - p_i),   y_i' = p_i y_i + u,   y = d u + sum r_i y_i

Over a step h a pole answers u = sum c_j tau^j with sum c_j j! h^(j+1) phi_(j+1)(p h) beside
exp(p h) y_i, phi_(j+1)(z) = (phi_j(z) - 1/j!) / z, phi_0 = exp. S. M. Cox, P. C. Matthews,
J. Comput. Phys. 176 (2002) 430.
"""

from math import factorial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import butter, lfilter

CUBIC = 3
NEAR_0 = 1.0  # of phi's argument: below, the recurrence loses digits and the series has them


class Band(NamedTuple):
    """What passes: below low_pass, above high_pass [Hz], None for no end; filters of `order`."""

    low_pass: float | None = None
    high_pass: float | None = None
    order: int = 4


def filtered(band: Band, t: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """y (k, ...) at equal times t (k,) behind the band, at rest at y[0] before."""
    if band.low_pass is None and band.high_pass is None:
        return y
    direct, residues, poles = _fractions(band)
    h = t[1] - t[0]
    pieces = CubicSpline(t, y).c[::-1]  # (4, k - 1, ...) of powers 0 to 3
    shown = direct * y
    for r, p in zip(residues, poles, strict=True):
        weights = [factorial(j) * h ** (j + 1) * phi(j + 1, p * h) for j in range(CUBIC + 1)]
        pushed = np.tensordot(weights, pieces, 1)
        answer = np.concatenate([[-y[0] / p], pushed])
        shown = shown + (r * lfilter([1.0], [1.0, -np.exp(p * h)], answer, axis=0)).real
    return shown


def _fractions(band: Band) -> tuple[float, NDArray, NDArray]:
    """d, r_i and p_i [rad/s] of a band; its poles are simple."""
    ends = [2 * np.pi * end for end in (band.high_pass, band.low_pass) if end is not None]
    kind = "bandpass" if len(ends) == 2 else "lowpass" if band.low_pass else "highpass"
    unit = ends[-1]
    z, p, k = butter(band.order, np.squeeze(np.array(ends) / unit), kind, analog=True, output="zpk")
    apart = p[:, None] - p + np.eye(len(p))
    residues = k * np.prod(p[:, None] - z, axis=1) / np.prod(apart, axis=1)
    return (k if len(z) == len(p) else 0.0), unit * residues, unit * p


def phi(j: int, z: complex) -> complex:
    """phi_j, (exp(z) less its first j terms) / z^j.

    >>> phi(1, 0.0), round(phi(2, 1.0), 12)
    (1.0, 0.718281828459)
    """
    if abs(z) < NEAR_0:
        return sum(z**i / factorial(i + j) for i in range(20))
    found = np.exp(z)
    for i in range(j):
        found = (found - 1.0 / factorial(i)) / z
    return found
