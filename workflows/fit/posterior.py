"""Samples of the parameters' posterior around the answer of a calibration.

    log p(theta | data) = -1/2 r^T W r,   r = model(theta) - data,   low <= theta <= high

    W = U (U^T R U)^-1 U^T + (I - U U^T) / s^2,   s^2 = tr(U^T R U) / p

U (samples, p) spans what the parameters change in the signals at the answer, R is the
autocovariance of the noise as the two-sigma bars take it. So the noise counts with its correlation
wherever the data speaks of the parameters, and with its mean there in all other directions; R^-1
itself would trust frequencies that the instrument has not passed. Where the model is linear and no
bound is near, the posterior is the Gaussian of the bars. The prior is flat between the bounds.

Samples are drawn by nested sampling (`workflows.fit.nested`) in y, theta = answer + shape y, where
the posterior is about standard normal, under a normal prior of PRIOR_WIDTH that the likelihood
divides out again: from the wide bounds on, twenty parameters would take millions of runs.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from beadwave.dem import InvalidChain, NoEquilibrium
from beadwave.workflows.fit.chain_fit import CalibrationResult
from beadwave.workflows.fit.forward import ChainForward
from beadwave.workflows.fit.least_squares import weights
from beadwave.workflows.fit.nested import NestedOptions, nested_posterior, normal, quantiles
from beadwave.workflows.fit.parameter import ends, scales
from beadwave.workflows.fit.uncertainty import noise_along

STEPS = 2.5  # of the model, in usual ones: only its change from the answer on is needed
# deviations of the normal prior in y. Of Gaussians of 2 and 20 parameters this sampler took 9 and
# 24 thousand runs, and the worst quantile at two sigma was off by 0.02 and 0.08 sigma; of a prior
# of 2.0, and live points down to 1 % of the evidence, 20 parameters took 62 thousand, off by 0.14
PRIOR_WIDTH = 1.5
ENOUGH = 1000.0  # effective samples from which on they can be shown
SAMPLER = NestedOptions(live=100, remaining=0.5, drawn=8192, runs=150_000)


class Posterior(NamedTuple):
    """Weighted samples, and how far to believe them."""

    samples: np.ndarray  # (s, p) in SI units
    weights: np.ndarray  # (s,) of sum 1
    log_probability: np.ndarray  # (s,) relative to the answer
    effective: float  # independent samples
    masses: tuple[float, ...]  # shares of the separate peaks, the largest first
    model_runs: int
    complete: bool  # False: stopped by the largest number of runs

    @property
    def believable(self) -> bool:
        """True if the sampler came to its end and there are enough samples."""
        return self.complete and self.effective >= ENOUGH

    def quantiles(self, shares: tuple[float, ...]) -> np.ndarray:
        """(shares, p) values below which these shares of the posterior lie."""
        return np.array([quantiles(x, self.weights, shares) for x in self.samples.T]).T


class LogPosterior:
    """The posterior of a fit around its answer; raises nothing where a run is impossible, its
    probability is 0.

    `answer` (p,), `low` and `high` (p,) are parameters in SI units; `shape` (p, p) is a root of the
    covariance there: theta = answer + shape y with y about standard normal.
    """

    def __init__(self, forward: ChainForward, fit: CalibrationResult, steps: float = STEPS) -> None:
        self.forward, self.answer = forward.with_steps(steps), fit.value
        self.low, self.high = ends(fit.parameters)
        self.weights = weights(forward.signals.spread)

        # by longer steps: the model's own error at the answer is taken off
        residual = (fit.model - fit.data) * self.weights
        self.offset = residual - self._weighted_velocities(fit.value)

        # J = U s V^T in scales; W = U (along) U^T + I / mean_noise
        scale = scales(fit.parameters)
        J = forward.velocities_and_sensitivities(fit.value)[1] * self.weights[:, None] * scale
        self.U, s, Vt = np.linalg.svd(J.reshape(residual.size, -1), full_matrices=False)
        noise = noise_along(self.U.reshape(*residual.shape, -1), residual)
        self.mean_noise = np.trace(noise) / len(scale)
        self.along = np.linalg.inv(noise) - np.eye(len(scale)) / self.mean_noise
        root = covariance_root(Vt.T * s, noise, (self.high - self.low) / scale)
        self.shape = scale[:, None] * root
        self.best = self._square(residual)

    def log_probability(self, theta: np.ndarray) -> float:
        """Relative to the answer, of theta (p,)."""
        if np.any(theta < self.low) or np.any(theta > self.high):
            return -np.inf
        try:
            residual = self.offset + self._weighted_velocities(theta)
        except (InvalidChain, NoEquilibrium):
            return -np.inf
        return 0.5 * (self.best - self._square(residual))

    def _weighted_velocities(self, theta: np.ndarray) -> np.ndarray:
        """(k, m) [m/s] at theta (p,), each sphere by its weight."""
        return self.forward.velocities(theta) * self.weights

    def _square(self, residual: np.ndarray) -> float:
        """r^T W r of a residual (k, m), W in the two parts of the module's docstring."""
        along = residual.ravel() @ self.U
        return float(along @ self.along @ along + np.sum(residual**2) / self.mean_noise)


def covariance_root(by_scale: np.ndarray, noise: np.ndarray, width: np.ndarray) -> np.ndarray:
    """L (p, p) with covariance L L^T in scales, of a Gaussian as wide as the bounds' where the data
    says nothing.

    by_scale (p, p) is V s of the Jacobian's U s V^T, noise U^T R U; width (p,) of the bounds in
    scales, whose uniform distribution has the variance width^2 / 12.
    """
    precision = by_scale @ np.linalg.solve(noise, by_scale.T) + np.diag(12.0 / width**2)
    values, vectors = np.linalg.eigh(precision)
    return vectors / np.sqrt(values)


def posterior(
    forward: ChainForward, fit: CalibrationResult, *, seed: int, options: NestedOptions = SAMPLER
) -> Posterior:
    """The posterior of a fit by the model `forward`, the same for the same seed. Raises
    InvalidScene without dynesty."""
    target = LogPosterior(forward, fit)
    return sampled(
        lambda y: target.log_probability(target.answer + target.shape @ y),
        target.answer,
        target.shape,
        seed=seed,
        options=options,
    )


def sampled(
    log_probability: Callable[[np.ndarray], float],
    answer: np.ndarray,
    shape: np.ndarray,
    *,
    seed: int,
    options: NestedOptions = SAMPLER,
) -> Posterior:
    """Samples of theta = answer + shape y, y (p,) about standard normal; log_probability takes y.

    answer (p,) is in SI units, shape (p, p) is regular.
    """
    p = len(answer)
    result = nested_posterior(
        lambda y: log_probability(y) + 0.5 * float(y @ y) / PRIOR_WIDTH**2,
        [normal(f"y{i}", 0.0, PRIOR_WIDTH) for i in range(1, p + 1)],
        seed=seed,
        options=options._replace(live=max(options.live, 5 * p)),
    )
    possible = result.weights > 0.0
    y = result.samples[possible]
    by_prior = 0.5 * np.sum(y**2, axis=1) / PRIOR_WIDTH**2
    return Posterior(
        samples=answer + y @ shape.T,
        weights=result.weights[possible],
        log_probability=result.log_likelihood[possible] - by_prior,
        effective=result.effective,
        masses=tuple(lobe.mass for lobe in result.lobes),
        model_runs=result.evaluations,
        complete=result.complete,
    )
