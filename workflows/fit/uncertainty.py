"""Uncertainty of a fit: bars by its residual, before it is made, and along its valley.

    cov = H^-1 (sum J^T R J) H^-1,   H = J^T J

R is the Toeplitz autocovariance of what the fit leaves, sphere by sphere: a band-limited instrument
makes noise that is correlated from sample to sample, and bars that ignore it are too short. It
holds the misfit of a wrong model as well. W. K. Newey, K. D. West, Econometrica 55 (1987) 703.

Before any record is made, Fisher's information says how well it would determine numbers:

    cov = (sum_i J_i^T J_i + B)^-1,   J = d signal / d theta over the noise

B is what the bounds say, one over the variance of a number that lies anywhere between them, so that
a bar is never longer than the bounds. Numbers of no interest (triggers, gains, velocities) are
among theta and lengthen the bars of the others.

Where the valley of the misfit is no parabola, its profile over each number makes the bar longer:

    t:  min_v |r(theta + t u + v)|^2 - |r(theta)|^2  =  |r + J u|^2 - |r|^2,   v_i = 0

u moves number i by two standard deviations and the others along with it; the bounds' information
counts in all squares. t is 1 in a parabola and above where the misfit rises more slowly on either
side, as at a number for which a wave only just comes into the record: the bar is made so many times
as long. D. J. Venzon, S. H. Moolgavkar, Appl. Stat. 37 (1988) 87.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.workflows.fit.least_squares import RecordFit
from beadwave.workflows.fit.parameter import UNIFORM, Parameter, scales

LEAST_SHARE = 0.3  # of a parameter in a combination, from which on the text names it


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
        # a fit is taken to leave at least 0.2 of the noise at any frequency
        power = power / np.maximum(1.0 - absorbed, 0.2)

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
    # lags of the autocovariance count up to 10 correlation lengths
    return min(10 * max(first, 1), len(r) // 4)


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


def bounds_information(parameters: Sequence[Parameter]) -> NDArray[np.float64]:
    """B (p, p) of numbers in scales; infinite bounds say nothing."""
    return np.diag([UNIFORM * (p.scale / (p.high - p.low)) ** 2 for p in parameters])


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


def determining_sample(
    slopes: NDArray[np.float64], width: NDArray[np.float64], share: float
) -> NDArray[np.int64]:
    """(p,) samples after which a number alone, all others known, has a two-sigma bar of a share of
    its bounds' width (p,) [scales]; the number of samples where it never has.

    2 / sqrt(sum of squared slopes) <= share width, summed over records and sensors.
    """
    squares = np.cumsum(np.sum(slopes**2, axis=(0, 2)), axis=0)
    determined = squares >= (2.0 / (share * width)) ** 2
    return np.where(determined.any(axis=0), determined.argmax(axis=0), len(determined))


class Valley(NamedTuple):
    """The bottom of a valley at theta (p,), with J (n, p) of the residual there, in scales."""

    fit: RecordFit
    theta: NDArray[np.float64]
    J: NDArray[np.float64]

    @property
    def parabola(self) -> NDArray[np.float64]:
        """J^T J + B (p, p): squares of data and bounds together rise as u^T (..) u."""
        return self.J.T @ self.J + np.diag(self._pull**2)

    @property
    def _pull(self) -> NDArray[np.float64]:
        """(p,) one over the standard deviation that the bounds leave, in scales."""
        return self.fit.unknowns.pull * self.fit.unknowns.scale

    def residual(self, step: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n + p,) residual of the data and of the bounds, a step (p,) in scales away; the step
        ends at the bounds."""
        low, high = self.fit.unknowns.ends()
        theta = np.clip(self.theta + step * self.fit.unknowns.scale, low, high)
        off = (theta - self.fit.unknowns.centre) / self.fit.unknowns.scale
        return np.concatenate([self.fit.residual(theta), self._pull * off])

    def rise(self, step: NDArray[np.float64], i: int) -> float:
        """Rise of the squares where number i has moved by a step (p,) and the others follow.

        The others begin where the step puts them and where they were, and from both take one
        Gauss-Newton step with number i fixed; the profile is the least of these four sums.
        """
        others = np.delete(np.eye(len(step)), i, axis=1)  # (p, p - 1) directions of the others
        J = np.vstack([self.J, np.diag(self._pull)])
        gauss_newton = others @ np.linalg.solve(
            others.T @ self.parabola @ others, (J @ others).T
        )  # (p, n + p)
        bottom = np.sum(self.residual(0.0 * step) ** 2)
        squares = []
        for begin in (step, np.where(np.arange(len(step)) == i, step, 0.0)):
            r = self.residual(begin)
            squares.append(min(np.sum(r**2), np.sum(self.residual(begin - gauss_newton @ r) ** 2)))
        return float(min(squares) - bottom)

    def steps_to_bound(self, step: NDArray[np.float64], i: int) -> float:
        """Number of such steps (p,) within the bounds of number i, from theta on."""
        low, high = self.fit.unknowns.ends()
        end = high[i] if step[i] > 0 else low[i]
        return float((end - self.theta[i]) / (step[i] * self.fit.unknowns.scale[i]))


def profile_likelihood_bars(
    fit: RecordFit,
    theta: NDArray[np.float64],
    J: NDArray[np.float64],
    bars: Uncertainty,
    n_shared: int,
) -> tuple[Uncertainty, float]:
    """The uncertainty of theta (p,), gains behind it, with the bars of the first n_shared numbers
    as long as the misfit says, and the largest t. J (n, p) of the fit's residual in scales."""
    p, valley = len(theta), Valley(fit, theta, J)
    scale = np.ones(len(bars.two_sigma))
    scale[:p] = fit.unknowns.scale
    covariance = bars.covariance / np.outer(scale, scale)
    sigma = np.sqrt(np.diag(covariance))

    # number i by two sigma, the others by what goes along with it: u = 2 cov_i / sigma_i
    factors = []
    for i in range(n_shared):
        u = 2.0 * covariance[:p, i] / sigma[i]
        factors.append(max(profile_factor(valley, way * u, i) for way in (1, -1)))
    if max(factors) == 1.0:
        return bars, 1.0
    # variances grow and covariances stay, which leaves the matrix positive definite
    for i, factor in enumerate(factors):
        covariance[i, i] *= factor**2
    longer = bars._replace(
        covariance=covariance * np.outer(scale, scale),
        two_sigma=2.0 * np.sqrt(np.diag(covariance)) * scale,
        combinations=combinations(covariance, covariance[:0], np.ones(len(scale), bool)),
    )
    return longer, max(factors)


def profile_factor(valley: Valley, step: NDArray[np.float64], i: int) -> float:
    """t: how many steps (p,) raise the misfit as much as one raises the parabola, at least one; as
    many as the bounds leave where those are fewer."""
    available = valley.steps_to_bound(step, i)
    if available <= 1.0:
        return 1.0
    enough = step @ valley.parabola @ step
    t, t_before, rise_before, rise = 1.0, 0.0, 0.0, valley.rise(step, i)
    while rise < enough and t < available:
        t_before, rise_before = t, rise
        # 1.5: factor from one trial of t to the next, until the misfit has risen enough
        t = min(1.5 * t, available)
        rise = valley.rise(t * step, i)
    if rise < enough:
        return t
    return max(1.0, float(np.interp(enough, (rise_before, rise), (t_before, t))))
