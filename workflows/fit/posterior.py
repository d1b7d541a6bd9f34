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

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import NamedTuple

import numpy as np

from beadwave.dem import InvalidChain, NoEquilibrium
from beadwave.system import adding
from beadwave.workflows.fit.chain_fit import CalibrationResult
from beadwave.workflows.fit.forward import ChainForward
from beadwave.workflows.fit.least_squares import weights
from beadwave.workflows.fit.parameter import ends, scales
from beadwave.workflows.fit.uncertainty import noise_along
from beadwave.workflows.scene import InvalidScene


class Sampling(NamedTuple):
    """Options of the sampler. `enough` is emcee's advice; the others have not been varied
    systematically."""

    steps: float = 2.5  # of the model, in usual ones: only its change from the answer on is needed
    independent: float = 0.75  # share of the proposals that do not depend on the walkers
    block: int = 100  # steps between two looks at the autocorrelation
    discarded: float = 0.2  # share of the steps that still remember where the walkers started
    enough: float = 50.0  # autocorrelation times in a chain that can be shown
    runs: int = 150_000  # of the model, at most


SAMPLING = Sampling()
FREEDOM = 20.0  # degrees of freedom of the Student distribution: tails heavier than the Gaussian's


class Posterior(NamedTuple):
    """Samples and how far to believe them; times are in steps of the walkers."""

    samples: np.ndarray  # (walkers * kept, p) in SI units
    log_probability: np.ndarray  # (walkers * kept,) relative to the answer
    autocorrelation: np.ndarray  # (p,) integrated times
    kept: int  # steps of each walker among the samples
    discarded: int  # steps of each walker before them
    walkers: int
    acceptance: float  # share of the proposals
    model_runs: int
    enough: float = SAMPLING.enough  # autocorrelation times that a chain must have

    @property
    def long_enough(self) -> bool:
        """True if the chain is many autocorrelation times long, of every parameter."""
        return bool(np.all(self.enough * self.autocorrelation <= self.kept))

    @property
    def effective(self) -> float:
        """Independent samples of the parameter that mixes worst."""
        return self.walkers * self.kept / float(np.max(self.autocorrelation))

    def quantiles(self, shares: tuple[float, ...]) -> np.ndarray:
        """(shares, p) values below which these shares of the samples lie."""
        return np.quantile(self.samples, shares, axis=0)


class LogPosterior:
    """The posterior of a fit around its answer; raises nothing where a run is impossible, its
    probability is 0.

    `answer` (p,), `low` and `high` (p,) are parameters in SI units; `shape` (p, p) is a root of the
    covariance there: theta = answer + shape y with y about standard normal.
    """

    def __init__(
        self, forward: ChainForward, fit: CalibrationResult, steps: float = SAMPLING.steps
    ) -> None:
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
    forward: ChainForward, fit: CalibrationResult, *, seed: int, options: Sampling = SAMPLING
) -> Posterior:
    """The posterior of a fit by the model `forward`, the same for the same seed.

    Stops when the chain is long enough, or before it would take more than `options.runs` of the
    model: then `long_enough` is False and the samples are not to be believed. Needs emcee.
    """
    target = LogPosterior(forward, fit, options.steps)
    return sampled(
        lambda y: target.log_probability(target.answer + target.shape @ y),
        target.answer,
        target.shape,
        (target.low, target.high),
        seed=seed,
        options=options,
    )


def sampled(
    log_probability: Callable[[np.ndarray], float],
    answer: np.ndarray,
    shape: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray],
    *,
    seed: int,
    options: Sampling = SAMPLING,
) -> Posterior:
    """Samples of theta = answer + shape y, y (p,) about normal; log_probability takes y.

    answer (p,) and bounds (p,), (p,) are in SI units, shape (p, p) is regular. In y the posterior
    is about round, whatever units and correlations theta has, which is where independent proposals
    are accepted.
    """
    import emcee

    p, rng = len(answer), np.random.RandomState(seed)
    walkers = max(24, 2 * p + 2)
    moves = [
        (emcee.moves.MHMove(student_proposals), options.independent),
        (emcee.moves.DEMove(), 1.0 - options.independent),
    ]
    ensemble = emcee.EnsembleSampler(walkers, p, log_probability, moves=moves)

    # walkers start where the Gaussian of the bars says, reflected into the bounds
    start = reflected(answer + rng.standard_normal((walkers, p)) @ shape.T, bounds)
    y = np.linalg.solve(shape, (start - answer).T).T
    state = emcee.State(y, random_state=rng.get_state())
    while True:
        state = ensemble.run_mcmc(state, options.block)

        # without the first steps; a parameter that never moves has no autocorrelation time
        steps = ensemble.iteration
        discarded = int(options.discarded * steps)
        chain = answer + ensemble.get_chain(discard=discarded) @ shape.T
        with np.errstate(invalid="ignore"):
            tau = emcee.autocorr.integrated_time(chain, tol=0)
        samples = Posterior(
            chain.reshape(-1, p),
            ensemble.get_log_prob(discard=discarded, flat=True),
            np.where(np.isfinite(tau), np.maximum(tau, 1.0), np.inf),
            steps - discarded,
            discarded,
            walkers,
            float(ensemble.acceptance_fraction.mean()),
            (steps + 1) * walkers,
            options.enough,
        )
        if samples.long_enough or samples.model_runs + walkers * options.block > options.runs:
            return samples


def student_proposals(y: np.ndarray, rng: np.random.RandomState) -> tuple[np.ndarray, np.ndarray]:
    """Proposals (walkers, p) from Student's distribution of FREEDOM degrees of freedom, whatever
    the walkers' y (walkers, p) are, and log q(y) / q(proposal) (walkers,)."""
    walkers, p = y.shape
    share = rng.chisquare(FREEDOM, walkers) / FREEDOM
    proposal = rng.standard_normal((walkers, p)) / np.sqrt(share)[:, None]
    tail_proposal, tail_y = (np.log1p(np.sum(x**2, axis=1) / FREEDOM) for x in (proposal, y))
    return proposal, 0.5 * (FREEDOM + p) * (tail_proposal - tail_y)


def reflected(theta: np.ndarray, bounds: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """theta (.., p) reflected at the bounds (p,) as often as needed to lie between them."""
    low, high = bounds
    period = 2.0 * (high - low)
    along = np.mod(theta - low, period)
    return low + np.minimum(along, period - along)


def require_sampler() -> None:
    """Raise InvalidScene where the sampler is not installed."""
    if find_spec("emcee") is None:
        raise InvalidScene(f"--posterior needs emcee; {adding('posterior')} adds it.")
