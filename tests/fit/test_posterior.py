"""Samples of a posterior: where its law is known they have its quantiles."""

import numpy as np
import pytest
from scipy.stats import norm

from beadwave.workflows.fit.aligned_signals import Signals
from beadwave.workflows.fit.chain_fit import calibrate
from beadwave.workflows.fit.forward import NO_FILTER, ChainForward
from beadwave.workflows.fit.marched_system import Rig
from beadwave.workflows.fit.parameter import Parameter
from beadwave.workflows.fit.posterior import SAMPLER, LogPosterior, posterior, sampled
from beadwave.workflows.fit.windows import Options

pytest.importorskip("dynesty", reason="the posterior is optional (the extra `posterior`)")

T = np.arange(400) * 1e-3
J = np.stack([np.cos(3 * T), T**2, np.sin(40 * T)], axis=1)[:, None, :]
TRUTH = np.array([0.5, -0.3, 0.1])
SHARES = norm.cdf([-2.0, 0.0, 2.0])


class Linear(ChainForward):
    """J theta instead of a chain."""

    def __init__(self, parameters, signals):
        self.parameters, self.signals = tuple(parameters), signals
        self.filters = NO_FILTER
        self.rig, self.start = Rig(None, None, None), np.zeros(len(parameters))
        self.time_scale, self.dt = 1e-2, T[1]

    def velocities(self, theta, first=None):
        return (J @ theta)[:first]

    def velocities_and_sensitivities(self, theta, first=None):
        return self.velocities(theta, first), J[:first]

    def with_steps(self, steps):
        return self

    def of_velocities(self):
        return self

    def coarser(self, steps):
        return self

    def needed(self, windows):
        return len(windows)


def fitted(monkeypatch, *, low=-10.0):
    """Data with noise that goes together over some five samples, and its fit."""
    noise = np.convolve(np.random.default_rng(0).standard_normal(len(T) + 4), np.ones(5) / 5)
    v = J @ TRUTH + 0.05 * noise[4 : len(T) + 4, None]
    signals = Signals(T, v, (0,), np.array([np.nan]))
    parameters = [Parameter(f"p{i}", "damping", 0.0, low, 10.0, 0.1, "", i) for i in range(3)]
    forward = Linear(parameters, signals)
    monkeypatch.setattr("beadwave.workflows.fit.chain_fit.ChainForward", lambda *_: forward)
    options = Options(staged=False, starts=1)
    return forward, calibrate(forward.rig, parameters, signals, options=options)


def test_quantiles_of_a_linear_model_are_the_bars(monkeypatch):
    """Correlated noise included. Of some 7000 effective samples a quantile at two sigma is known to
    sqrt(0.023 * 0.977 / 7000) / 0.054 = 0.03 sigma; four times that is asked for."""
    forward, fit = fitted(monkeypatch)
    result = posterior(forward, fit, seed=1)
    assert result.believable and result.effective > 5000 and result.masses == (pytest.approx(1.0),)
    sigma = 0.5 * fit.uncertainty.two_sigma
    off = (result.quantiles(tuple(SHARES)) - fit.value) / sigma
    np.testing.assert_allclose(off, np.array([-2.0, 0.0, 2.0])[:, None] * np.ones(3), atol=0.13)
    white = 0.05 / np.sqrt(5) * np.sqrt(np.diag(np.linalg.inv(J[:, 0].T @ J[:, 0])))
    assert np.all(sigma[:2] > 1.5 * white[:2])


def test_the_same_seed_gives_the_same_samples(monkeypatch):
    forward, fit = fitted(monkeypatch)
    few = SAMPLER._replace(live=50, drawn=512)
    first, same, second = (posterior(forward, fit, seed=s, options=few).samples for s in (1, 1, 2))
    np.testing.assert_array_equal(first, same)
    assert not np.array_equal(first[:100], second[:100])


def test_a_bound_cuts_the_posterior_off():
    """A Gaussian that bounds halve: its quantiles are those of |N(0, 1)|."""
    result = sampled(
        lambda y: -0.5 * float(y @ y) if np.all(y >= 0.0) else -np.inf,
        np.zeros(2), np.eye(2), seed=0,
    )  # fmt: skip
    exact = norm.ppf(0.5 + 0.5 * np.array([0.25, 0.5, 0.977]))
    assert result.believable and result.samples.min() >= 0.0
    np.testing.assert_allclose(result.quantiles((0.25, 0.5, 0.977)).T, [exact] * 2, atol=0.1)


def test_two_peaks_are_told_with_their_shares():
    """Gaussians of a fifth of the bar, one deviation to either side; 3 : 1."""

    def log_probability(y):
        squares = 12.5 * (y[0] - np.array([1.0, -1.0])) ** 2
        return float(np.logaddexp(*(np.log([0.75, 0.25]) - squares)) - 0.5 * y[1] ** 2)

    result = sampled(
        log_probability, np.zeros(2), np.eye(2), seed=0,
    )  # fmt: skip
    np.testing.assert_allclose(result.masses, [0.75, 0.25], atol=0.02)


def test_a_sampler_that_was_stopped_says_so():
    """Of a ridge that is bent, which no Gaussian follows, for 3000 model runs."""
    result = sampled(
        lambda y: -0.5 * float(y[0] ** 2 / 100 + 1e4 * (y[1] - y[0] ** 2) ** 2),
        np.zeros(2), np.eye(2), seed=0, options=SAMPLER._replace(runs=3000, drawn=100),
    )  # fmt: skip
    assert not result.believable and 3000 <= result.model_runs <= 3600


def test_samples_keep_within_the_bounds_of_what_they_are_samples_of(monkeypatch):
    """A bound a sigma below the answer, and the density that the samples are said to have."""
    forward, fit = fitted(monkeypatch)
    low = fit.value[1] - 0.5 * fit.uncertainty.two_sigma[1]
    parameters = tuple(
        p._replace(low=low if i == 1 else -9.0) for i, p in enumerate(fit.parameters)
    )
    fit = fit._replace(parameters=parameters)
    result = posterior(forward, fit, seed=2)
    assert low <= result.samples[:, 1].min() < low + 0.1 * (fit.value[1] - low)
    assert result.samples[:, 1].max() > fit.value[1] + 2 * (fit.value[1] - low)
    expected = LogPosterior(forward, fit)
    for i in (0, 7, 99):
        exact = expected.log_probability(result.samples[i])
        assert result.log_probability[i] == pytest.approx(exact, rel=1e-9, abs=1e-9)
