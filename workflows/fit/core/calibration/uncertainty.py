"""How well a fit is determined: covariance from the Jacobian, and what the data cannot tell apart.

    cov = H^-1 (sum J^T R J) H^-1,   H = J^T J

R is the Toeplitz autocovariance of what the fit leaves, sphere by sphere: a band-limited instrument
makes noise that is correlated from sample to sample, and bars that ignore it are too short. It
holds the misfit of a wrong model as well. W. K. Newey, K. D. West, Econometrica 55 (1987) 703.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from workflows.fit.core.calibration.parameters import Parameter

LEAST_SHARE = 0.3  # of a parameter in a combination that is worth its name
LEAST_SPECTRUM = 0.2  # of the noise by a fit, at any frequency
LAGS = 10  # of the autocovariance, at most, in correlation lengths


class Combination(NamedTuple):
    """A direction in the space of the parameters, in their scales, and its two-sigma bar there."""

    direction: np.ndarray  # (p,) of length 1
    two_sigma: float

    def text(self, parameters: Sequence[Parameter]) -> str:
        """The largest shares, as in "0.8 contact 6 - 0.6 contact 7"."""
        order = np.argsort(-np.abs(self.direction))
        most = [i for i in order if abs(self.direction[i]) >= LEAST_SHARE][:4] or [order[0]]
        sign = np.sign(self.direction[most[0]])
        parts = [f"{sign * self.direction[i]:+.2f} {parameters[i].name}" for i in most]
        return " ".join(parts).removeprefix("+").replace(" -", " - ").replace(" +", " + ")


class Uncertainty(NamedTuple):
    """Covariance and identifiability; rows of parameters that were held at a bound are zero."""

    covariance: np.ndarray  # (p, p)
    two_sigma: np.ndarray  # (p,) inf where the data says nothing
    singular: np.ndarray  # singular values of the Jacobian in the parameters' scales [m/s], falling
    combinations: tuple[Combination, ...]  # from the worst to the best determined

    @property
    def correlation(self) -> np.ndarray:
        """(p, p)"""
        sigma = np.sqrt(np.diag(self.covariance))
        safe = np.where(sigma > 0, sigma, 1.0)
        return self.covariance / np.outer(safe, safe)


def uncertainty(
    parameters: Sequence[Parameter],
    residual: np.ndarray,
    J: np.ndarray,
    held: np.ndarray,
    prior: np.ndarray | None = None,
) -> Uncertainty:
    """Of a fit with the residual (k, m) and the Jacobian J (k, m, p); `prior` (p, p) is what is
    known besides, one over the covariance in scales: all is determined then."""
    scale = np.array([p.scale for p in parameters])
    free = ~np.asarray(held)
    scaled = (J * scale)[:, :, free]
    p = scaled.shape[2]
    U, s, Vt = np.linalg.svd(scaled.reshape(residual.size, p), full_matrices=False)
    seen = s > 1e-12 * s.max(initial=0.0)
    U = U[:, seen].reshape(*residual.shape, -1)
    middle = noise_along(U, residual)
    spread = Vt[seen].T / s[seen]
    covariance = spread @ middle @ spread.T
    if prior is not None:
        known = np.linalg.pinv(covariance, hermitian=True) + prior[np.ix_(free, free)]
        covariance, seen = np.linalg.pinv(known, hermitian=True), np.ones(p, bool)
    whole = np.zeros((len(scale), len(scale)))
    whole[np.ix_(free, free)] = covariance
    two_sigma = 2.0 * np.sqrt(np.diag(whole)) * scale
    blind = np.sqrt((Vt[~seen] ** 2).sum(axis=0)) > 1e-6
    two_sigma[np.flatnonzero(free)[blind]] = np.inf
    return Uncertainty(
        whole * np.outer(scale, scale), two_sigma, s, combinations(whole, Vt[~seen], free)
    )


def noise_along(U: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """U^T R U (p, p) of the noise behind a residual (k, m), U (k, m, p) orthonormal."""
    return sum(_noise_product(U[:, i], residual[:, i]) for i in range(residual.shape[1]))


def _noise_product(U: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """U^T R U (p, p), R the Toeplitz autocovariance of the noise behind a residual (k,), U (k, p).

    A fit takes the share sum |U(f)|^2 / k of the noise with it, most where waves have their
    frequencies; the spectrum is divided by what it leaves.
    """
    k = len(residual)
    size = 2 * k
    taken = np.sum(np.abs(np.fft.rfft(U, size, axis=0)) ** 2, axis=1) / k
    power = np.abs(np.fft.rfft(residual, size)) ** 2 / np.maximum(1.0 - taken, LEAST_SPECTRUM)
    r = np.fft.irfft(power, size)[:k] / k
    lags = _cut(r)
    kernel = np.zeros(size)
    kernel[: lags + 1] = r[: lags + 1]
    kernel[size - lags :] = r[lags:0:-1]
    spectrum = np.maximum(np.fft.rfft(kernel).real, 0.0)
    RU = np.fft.irfft(spectrum[:, None] * np.fft.rfft(U, size, axis=0), size, axis=0)[:k]
    return U.T @ RU


def _cut(r: np.ndarray) -> int:
    """Lags that count: up to LAGS times the first at which the autocovariance has died."""
    died = np.flatnonzero(np.abs(r) < 0.1 * r[0])
    first = int(died[0]) if died.size else len(r) // 4
    return min(LAGS * max(first, 1), len(r) // 4)


def combinations(covariance, blind, free) -> tuple[Combination, ...]:
    """Principal directions of the covariance in scales, those that the data does not see first."""
    at = np.flatnonzero(free)
    unseen = []
    for row in blind:
        direction = np.zeros(len(free))
        direction[at] = row
        unseen.append(Combination(direction, np.inf))
    values, vectors = np.linalg.eigh(covariance[np.ix_(free, free)])
    found = []
    for value, vector in zip(values[::-1], vectors.T[::-1], strict=True):
        if value > 0:
            direction = np.zeros(len(free))
            direction[at] = vector
            found.append(Combination(direction, 2.0 * float(np.sqrt(value))))
    return (*unseen, *found)
