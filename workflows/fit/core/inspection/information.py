"""How well records would determine numbers before any is made: Fisher's information.

    cov = (sum_i J_i^T J_i + B)^-1,   J = d signal / d theta over the noise

B is what the bounds say, one over the variance of a number that lies anywhere between them, so that
a bar is never longer than the bounds. Numbers of no interest (triggers, gains, velocities) are
among theta and lengthen the bars of the others.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from workflows.fit.core.calibration.parameters import Parameter

UNIFORM = 12.0  # the variance of a uniform distribution is its width squared over this


def bounds_information(parameters: Sequence[Parameter]) -> NDArray[np.float64]:
    """B (p, p) of numbers in scales; infinite bounds say nothing."""
    return np.diag([UNIFORM * (p.scale / (p.high - p.low)) ** 2 for p in parameters])


def covariance(slopes: NDArray[np.float64], B: NDArray[np.float64]) -> NDArray[np.float64]:
    """Covariance (p, p) of numbers in scales by slopes (..., p) over the noise."""
    J = slopes.reshape(-1, slopes.shape[-1])
    return np.linalg.pinv(J.T @ J + B, hermitian=True)


def bars_over_time(
    slopes: NDArray[np.float64], B: NDArray[np.float64], ends: NDArray[np.int64]
) -> NDArray[np.float64]:
    """(len(ends), p) two-sigma bars in scales by the first `ends` samples only of slopes
    (S, k, m, p) over the noise; the ends rise."""
    bars, information, last = [], np.zeros_like(B), 0
    for end in ends:
        J = slopes[:, last:end].reshape(-1, slopes.shape[-1])
        information, last = information + J.T @ J, end
        cov = np.linalg.pinv(information + B, hermitian=True)
        bars.append(2.0 * np.sqrt(np.diag(cov)))
    return np.array(bars)


def felt_from(
    slopes: NDArray[np.float64], width: NDArray[np.float64], share: float
) -> NDArray[np.int64]:
    """(p,) samples after which a number alone, all others known, has a two-sigma bar of a share of
    its bounds' width (p,) [scales]; the number of samples where it never has.

    2 / sqrt(sum of squared slopes) <= share width, summed over records and sensors.
    """
    squares = np.cumsum(np.sum(slopes**2, axis=(0, 2)), axis=0)
    determined = squares >= (2.0 / (share * width)) ** 2
    return np.where(determined.any(axis=0), determined.argmax(axis=0), len(determined))
