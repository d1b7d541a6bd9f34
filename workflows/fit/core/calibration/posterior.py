"""Samples of the parameters' posterior around the answer of a calibration.

    log p(theta | data) = -1/2 r^T W r,   r = model(theta) - data,   low <= theta <= high

    W = U (U^T R U)^-1 U^T + (I - U U^T) / s^2,   s^2 = tr(U^T R U) / p

U (samples, p) spans what the parameters change in the signals at the answer, R is the
autocovariance of the noise as the two-sigma bars take it. So the noise counts with its correlation
wherever the data speaks of the parameters, and with its mean there in all other directions; R^-1
itself would trust frequencies that the instrument has not passed. Where the model is linear and no
bound is near, the posterior is the Gaussian of the bars. The prior is flat between the bounds.

The sampler is emcee (D. Foreman-Mackey et al., PASP 125 (2013) 306): ensemble moves of C. J. F. ter
Braak, Stat. Comput. 16 (2006) 239, mixed with independent proposals from a Student distribution of
the Gaussian around the answer.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from dem import InvalidChain, NoEquilibrium
from workflows.fit.core.calibration.calibration import CalibrationResult
from workflows.fit.core.calibration.fitting import weights
from workflows.fit.core.calibration.forward import ChainForward
from workflows.fit.core.calibration.uncertainty import noise_along

STEPS = 2.5  # of the model, in usual ones: only its change from the answer on is needed
INDEPENDENT = 0.75  # share of the proposals that do not look at the walkers
FREEDOM = 20.0  # degrees of freedom of these
BLOCK = 100  # steps between two looks at the autocorrelation
DISCARDED = 0.2  # of the steps: what the walkers started from
ENOUGH = 50.0  # autocorrelation times in a chain that can be shown: emcee's advice
RUNS = 150_000  # of the model, at most


class Posterior(NamedTuple):
    """Samples and how far to believe them; times are in steps of the walkers."""

    samples: np.ndarray  # (walkers * kept, p)
    log_probability: np.ndarray  # (walkers * kept,) relative to the answer
    autocorrelation: np.ndarray  # (p,) integrated times
    kept: int
    discarded: int
    walkers: int
    acceptance: float
    model_runs: int

    @property
    def long_enough(self) -> bool:
        """Whether every parameter's autocorrelation time goes often enough into the chain."""
        return bool(np.all(ENOUGH * self.autocorrelation <= self.kept))

    @property
    def effective(self) -> float:
        """Independent samples of the parameter that mixes worst."""
        return self.walkers * self.kept / float(np.max(self.autocorrelation))

    def quantiles(self, shares: tuple[float, ...]) -> np.ndarray:
        """(shares, p)"""
        return np.quantile(self.samples, shares, axis=0)


class LogPosterior:
    """The posterior of a fit; raises nothing where a run is impossible, its probability is 0."""

    def __init__(self, forward: ChainForward, fit: CalibrationResult) -> None:
        self.forward, self.answer = forward.with_steps(STEPS), fit.value
        self.low, self.high = (
            np.array([getattr(p, end) for p in fit.parameters]) for end in ("low", "high")
        )
        self.weights = weights(forward.signals.spread)
        residual = (fit.model - fit.data) * self.weights
        self.offset = residual - self._seen(fit.value)
        scale = np.array([p.scale for p in fit.parameters])
        J = forward.velocities_and_sensitivities(fit.value)[1] * self.weights[:, None] * scale
        self.U, s, Vt = np.linalg.svd(J.reshape(residual.size, -1), full_matrices=False)
        noise = noise_along(self.U.reshape(*residual.shape, -1), residual)
        self.mean_noise = np.trace(noise) / len(scale)
        self.along = np.linalg.inv(noise) - np.eye(len(scale)) / self.mean_noise
        self.shape = scale[:, None] * _square_root(Vt.T * s, noise, (self.high - self.low) / scale)
        self.best = self._weighted(residual)

    def log_probability(self, theta: np.ndarray) -> float:
        """Relative to the answer, of theta (p,)."""
        if np.any(theta < self.low) or np.any(theta > self.high):
            return -np.inf
        try:
            residual = self.offset + self._seen(theta)
        except (InvalidChain, NoEquilibrium):
            return -np.inf
        return 0.5 * (self.best - self._weighted(residual))

    def _seen(self, theta: np.ndarray) -> np.ndarray:
        return self.forward.velocities(theta) * self.weights

    def _weighted(self, residual: np.ndarray) -> float:
        """r^T W r"""
        along = residual.ravel() @ self.U
        return float(along @ self.along @ along + np.sum(residual**2) / self.mean_noise)


def _square_root(by_scale: np.ndarray, noise: np.ndarray, reach: np.ndarray) -> np.ndarray:
    """L (p, p) with covariance L L^T in scales, of a Gaussian as wide as the bounds' where the data
    says nothing; by_scale (p, p) is V s of the Jacobian's U s V^T."""
    precision = by_scale @ np.linalg.solve(noise, by_scale.T) + np.diag(12.0 / reach**2)
    values, vectors = np.linalg.eigh(precision)
    return vectors / np.sqrt(values)


def posterior(
    forward: ChainForward, fit: CalibrationResult, *, seed: int, most: int = RUNS
) -> Posterior:
    """The posterior of a fit by the model `forward`, the same for the same seed.

    Stops when the chain is long enough, or before it would take more than `most` model runs: then
    `long_enough` is False and the samples are not to be believed. Needs emcee.
    """
    target = LogPosterior(forward, fit)
    return sampled(
        lambda y: target.log_probability(target.answer + target.shape @ y),
        target.answer,
        target.shape,
        (target.low, target.high),
        seed=seed,
        most=most,
    )


def sampled(
    log_probability: Callable[[np.ndarray], float],
    answer: np.ndarray,
    shape: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray],
    *,
    seed: int,
    most: int,
) -> Posterior:
    """Samples of theta = answer + shape y, y (p,) about normal; log_probability takes y."""
    import emcee

    p, rng = len(answer), np.random.RandomState(seed)
    walkers = max(24, 2 * p + 2)
    moves = [(emcee.moves.MHMove(_independent), INDEPENDENT)]
    moves.append((emcee.moves.DEMove(), 1.0 - INDEPENDENT))
    ensemble = emcee.EnsembleSampler(walkers, p, log_probability, moves=moves)
    begin = _inside(answer + rng.standard_normal((walkers, p)) @ shape.T, bounds)
    y = np.linalg.solve(shape, (begin - answer).T).T
    state = emcee.State(y, random_state=rng.get_state())
    while True:
        state = ensemble.run_mcmc(state, BLOCK)
        found = _so_far(emcee, ensemble, answer, shape)
        if found.long_enough or found.model_runs + walkers * BLOCK > most:
            return found


def _independent(y: np.ndarray, rng) -> tuple[np.ndarray, np.ndarray]:
    """Proposals (walkers, p) from Student's distribution, and log q(y) / q(proposal)."""
    walkers, p = y.shape
    share = rng.chisquare(FREEDOM, walkers) / FREEDOM
    other = rng.standard_normal((walkers, p)) / np.sqrt(share)[:, None]
    tails = (np.log1p(np.sum(x**2, axis=1) / FREEDOM) for x in (other, y))
    return other, 0.5 * (FREEDOM + p) * (next(tails) - next(tails))


def _inside(theta: np.ndarray, bounds: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """theta reflected at the bounds."""
    low, high = bounds
    period = 2.0 * (high - low)
    along = np.mod(theta - low, period)
    return low + np.minimum(along, period - along)


def _so_far(emcee, ensemble, answer: np.ndarray, shape: np.ndarray) -> Posterior:
    steps = ensemble.iteration
    discarded = int(DISCARDED * steps)
    chain = answer + ensemble.get_chain(discard=discarded) @ shape.T
    with np.errstate(invalid="ignore"):
        tau = emcee.autocorr.integrated_time(chain, tol=0)
    return Posterior(
        chain.reshape(-1, len(answer)),
        ensemble.get_log_prob(discard=discarded, flat=True),
        np.where(np.isfinite(tau), np.maximum(tau, 1.0), np.inf),
        steps - discarded,
        discarded,
        ensemble.nwalkers,
        float(ensemble.acceptance_fraction.mean()),
        (steps + 1) * ensemble.nwalkers,
    )
