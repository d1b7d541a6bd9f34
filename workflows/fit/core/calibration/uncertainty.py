"""How well a fit is determined: covariance from the Jacobian, and what the data cannot tell apart.

    cov = H^-1 (sum J^T R J) H^-1,   H = J^T J

R is the Toeplitz autocovariance of what the fit leaves, sphere by sphere: a band-limited instrument
makes noise that is correlated from sample to sample, and bars that ignore it are too short. It
holds the misfit of a wrong model as well. W. K. Newey, K. D. West, Econometrica 55 (1987) 703.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from workflows.fit.core.calibration.parameters import Parameter, scales

LEAST_SHARE = 0.3  # of a parameter in a combination, from which on the text names it
LEAST_SPECTRUM = 0.2  # of the noise that a fit is taken to leave at any frequency, at least
LAGS = 10  # of the autocovariance that count, in correlation lengths


class Combination(NamedTuple):
    """A direction in the space of the parameters, in their scales, and its two-sigma bar there."""

    direction: np.ndarray  # (p,) of length 1
    two_sigma: float

    def text(self, parameters: Sequence[Parameter]) -> str:
        """Up to four of its largest components, as in "0.8 contact 6 - 0.6 contact 7"."""
        order = np.argsort(-np.abs(self.direction))
        large = [i for i in order if abs(self.direction[i]) >= LEAST_SHARE][:4] or [order[0]]
        sign = np.sign(self.direction[large[0]])
        terms = [f"{sign * self.direction[i]:+.2f} {parameters[i].name}" for i in large]
        return " ".join(terms).removeprefix("+").replace(" -", " - ").replace(" +", " + ")


class Uncertainty(NamedTuple):
    """Covariance and identifiability; rows of parameters that were fixed at a bound are zero."""

    covariance: np.ndarray  # (p, p) in SI units
    two_sigma: np.ndarray  # (p,) inf where the data says nothing
    singular: np.ndarray  # singular values of the Jacobian in the parameters' scales [m/s], falling
    combinations: tuple[Combination, ...]  # from the worst to the best determined

    @property
    def correlation(self) -> np.ndarray:
        """Correlation coefficients (p, p)."""
        sigma = np.sqrt(np.diag(self.covariance))
        divisor = np.where(sigma > 0, sigma, 1.0)
        return self.covariance / np.outer(divisor, divisor)


def uncertainty(
    parameters: Sequence[Parameter],
    residual: np.ndarray,
    J: np.ndarray,
    fixed: np.ndarray,
    prior: np.ndarray | None = None,
) -> Uncertainty:
    """Of a fit with the residual (k, m) and the Jacobian J (k, m, p); parameters that are `fixed`
    (p,) have no part in it.

    `prior` (p, p) is the information in scales that is known besides the data, one over a variance:
    with it every parameter is determined.
    """
    scale = scales(parameters)
    free = ~np.asarray(fixed)
    J_free = (J * scale)[:, :, free]
    p = J_free.shape[2]

    # J = U s V^T, so H^-1 J^T R J H^-1 = (V / s) (U^T R U) (V / s)^T on what the data determines
    U, s, Vt = np.linalg.svd(J_free.reshape(residual.size, p), full_matrices=False)
    determined = s > 1e-12 * s.max(initial=0.0)
    U = U[:, determined].reshape(*residual.shape, -1)
    root = Vt[determined].T / s[determined]
    covariance = root @ noise_along(U, residual) @ root.T
    if prior is not None:
        information = np.linalg.pinv(covariance, hermitian=True) + prior[np.ix_(free, free)]
        covariance, determined = np.linalg.pinv(information, hermitian=True), np.ones(p, bool)

    full = np.zeros((len(scale), len(scale)))
    full[np.ix_(free, free)] = covariance
    two_sigma = 2.0 * np.sqrt(np.diag(full)) * scale

    # a parameter with any component along a direction that the data does not determine has no bar
    blind = np.sqrt((Vt[~determined] ** 2).sum(axis=0)) > 1e-6
    two_sigma[np.flatnonzero(free)[blind]] = np.inf
    in_units = full * np.outer(scale, scale)
    return Uncertainty(in_units, two_sigma, s, combinations(full, Vt[~determined], free))


def noise_along(U: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """U^T R U (p, p), R the Toeplitz autocovariance of the noise behind a residual (k, m), sphere
    by sphere; U (k, m, p) orthonormal.

    A fit takes the share sum |U(f)|^2 / k of the noise with it, most where waves have their
    frequencies; the spectrum is divided by what it leaves. The product with R is a convolution:
    twice as many samples keep its ends apart.
    """
    k, m = residual.shape
    size = 2 * k
    products = []
    for i in range(m):
        U_f = np.fft.rfft(U[:, i], size, axis=0)
        absorbed = np.sum(np.abs(U_f) ** 2, axis=1) / k
        power = np.abs(np.fft.rfft(residual[:, i], size)) ** 2
        power = power / np.maximum(1.0 - absorbed, LEAST_SPECTRUM)

        # autocovariance r at the lags that count, as an even sequence; its spectrum is that of R,
        # at least 0, which the cut at the last lag may violate
        r = np.fft.irfft(power, size)[:k] / k
        lags = lags_that_count(r)
        kernel = np.zeros(size)
        kernel[: lags + 1] = r[: lags + 1]
        kernel[size - lags :] = r[lags:0:-1]
        spectrum = np.maximum(np.fft.rfft(kernel).real, 0.0)
        RU = np.fft.irfft(spectrum[:, None] * U_f, size, axis=0)[:k]
        products.append(U[:, i].T @ RU)
    return sum(products)


def lags_that_count(r: np.ndarray) -> int:
    """Number of lags of an autocovariance r (k,): LAGS times the first at which it has fallen to a
    tenth, at most a quarter of all."""
    fallen = np.flatnonzero(np.abs(r) < 0.1 * r[0])
    first = int(fallen[0]) if fallen.size else len(r) // 4
    return min(LAGS * max(first, 1), len(r) // 4)


def combinations(
    covariance: np.ndarray, blind: np.ndarray, free: np.ndarray
) -> tuple[Combination, ...]:
    """Principal directions of the covariance (p, p) in scales; first the directions (.., n_free)
    that the data does not determine. Only `free` (p,) parameters have components."""
    places = np.flatnonzero(free)
    values, vectors = np.linalg.eigh(covariance[np.ix_(free, free)])
    bars = [np.inf] * len(blind)
    components = list(blind)
    for value, vector in zip(values[::-1], vectors.T[::-1], strict=True):
        if value > 0:
            bars.append(2.0 * float(np.sqrt(value)))
            components.append(vector)
    directions = np.zeros((len(bars), len(free)))
    for direction, component in zip(directions, components, strict=True):
        direction[places] = component
    return tuple(map(Combination, directions, bars))
