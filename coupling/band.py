"""The band of an analogue instrument: Butterworth filters, causal, exact for a cubic spline.

    H(s) = d + sum r_i / (s - p_i),   y_i' = p_i y_i + u,   y = d u + sum r_i y_i

Over a step h a pole answers u = sum c_j tau^j with sum c_j j! h^(j+1) phi_(j+1)(p h) in addition to
exp(p h) y_i, phi_(j+1)(z) = (phi_j(z) - 1/j!) / z, phi_0 = exp. S. M. Cox, P. C. Matthews,
J. Comput. Phys. 176 (2002) 430.
"""

from math import factorial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline


class Band(NamedTuple):
    """Corner frequencies [Hz] of the low-pass and the high-pass filter, None for no such filter,
    and their order."""

    low_pass: float | None = None
    high_pass: float | None = None
    order: int = 4


def filtered(band: Band, t: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Output (k, ...) of the filters for a signal y (k, ...) at equally spaced times t (k,) [s], in
    the steady state of y[0] before; y itself for a band without corners. Causal: a low-pass delays
    what it shows."""
    from scipy.signal import butter, lfilter

    # corner frequencies [rad/s]: below the first and above the last nothing passes
    corners = [2 * np.pi * end for end in (band.high_pass, band.low_pass) if end is not None]
    if not corners:
        return y

    # H(s) = d + sum r_i / (s - p_i), the poles of a Butterworth filter being simple; in units of
    # the last corner, for products of numbers near 1
    kind = "bandpass" if len(corners) == 2 else "lowpass" if band.low_pass else "highpass"
    unit = corners[-1]
    z, p, k = butter(
        band.order, np.squeeze(np.array(corners) / unit), kind, analog=True, output="zpk"
    )
    distances = p[:, None] - p + np.eye(len(p))
    residues = unit * (k * np.prod(p[:, None] - z, axis=1) / np.prod(distances, axis=1))
    direct = k if len(z) == len(p) else 0.0

    # y_i over each step of the cubic spline u, exactly; before the first one y_i = -u(0) / p_i
    h = t[1] - t[0]
    pieces = CubicSpline(t, y).c[::-1]  # (4, k - 1, ...) of powers 0 to 3
    signal = direct * y
    for r, pole in zip(residues, unit * p, strict=True):
        weights = [factorial(j) * h ** (j + 1) * phi(j + 1, pole * h) for j in range(4)]
        forcing = np.concatenate([[-y[0] / pole], np.tensordot(weights, pieces, 1)])
        response = lfilter([1.0], [1.0, -np.exp(pole * h)], forcing, axis=0)
        signal = signal + (r * response).real
    return signal


def phi(j: int, z: complex) -> complex:
    """phi_j, (exp(z) less its first j terms) / z^j.

    >>> phi(1, 0.0), float(round(phi(2, 1.0), 12))
    (1.0, 0.718281828459)
    """
    if abs(z) < 1.0:  # the recurrence would lose digits, the series has them
        return sum(z**i / factorial(i + j) for i in range(20))
    value = np.exp(z)
    for i in range(j):
        value = (value - 1.0 / factorial(i)) / z
    return value
