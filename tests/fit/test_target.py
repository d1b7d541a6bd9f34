"""The density that a posterior is drawn from, the first wave's impulse, scans and growing windows:
each beside its formula, on models with known answers."""

from types import SimpleNamespace

import numpy as np
import pytest

from beadwave.dem import InvalidChain
from beadwave.workflows.fit.least_squares import Solution
from beadwave.workflows.fit.parameter import Parameter
from beadwave.workflows.fit.posterior import LogPosterior, covariance_root
from beadwave.workflows.fit.scaling import incident_impulse
from beadwave.workflows.fit.uncertainty import noise_along
from beadwave.workflows.fit.windows import (
    BETTER_SWAP,
    IMPOSSIBLE,
    N_SWAPS_TRIED,
    SWAP_ROUNDS,
    WORSE_GUESS,
    GrowingWindows,
    local_minima,
    scanned,
)

K, M = 60, 2
RNG = np.random.default_rng(11)
J = RNG.standard_normal((K, M, 3)).cumsum(axis=0) / 8
SPREAD = np.array([0.1, 0.3])
SCALE = np.array([0.1, 0.5, 2.0])
ANSWER = np.array([0.4, -0.2, 0.7])


class Bent:
    """J theta and a little of its square, and as much again by longer steps; none above 0.9."""

    def __init__(self, bias=0.0):
        self.bias, self.signals = bias, SimpleNamespace(spread=SPREAD)

    def with_steps(self, steps):
        assert steps > 1
        return Bent(0.05)

    def velocities(self, theta):
        if max(theta) > 0.9:
            raise InvalidChain("above 0.9")
        linear = J @ theta
        return linear + 0.03 * linear**2 + self.bias * np.cos(np.arange(K))[:, None]

    def velocities_and_sensitivities(self, theta):
        linear = (J @ theta)[..., None]
        return self.velocities(theta), J * (1 + 0.06 * linear)


def a_fit(noise=0.2):
    model = Bent().velocities(ANSWER)
    residual = noise * np.convolve(RNG.standard_normal(2 * K + 4), np.ones(5) / 5, mode="valid")
    data = model - residual.reshape(K, M)
    parameters = [
        Parameter(f"p{i}", "damping", 0.0, -1.0, 1.0 + i, s, "", i) for i, s in enumerate(SCALE)
    ]
    return SimpleNamespace(parameters=parameters, value=ANSWER, model=model, data=data)


def weighting(fit):
    """U, U^T R U and W (samples, samples) by their definitions."""
    weight = np.sqrt(np.mean(SPREAD**2)) / SPREAD
    slopes = Bent().velocities_and_sensitivities(ANSWER)[1] * weight[:, None] * SCALE
    U = np.linalg.svd(slopes.reshape(-1, 3), full_matrices=False)[0]
    noise = noise_along(U.reshape(K, M, 3), (fit.model - fit.data) * weight)
    across = np.eye(K * M) - U @ U.T
    W = U @ np.linalg.inv(noise) @ U.T + across / (np.trace(noise) / 3)
    return weight, slopes.reshape(-1, 3), U, noise, W


def test_the_log_probability_is_half_the_square_by_the_noise():
    """-1/2 r^T W r above that at the answer; by longer steps only the change from there counts."""
    fit = a_fit()
    target, (weight, *_, W) = LogPosterior(Bent(), fit), weighting(fit)
    at_answer = ((fit.model - fit.data) * weight).ravel()
    assert target.log_probability(ANSWER) == pytest.approx(0.0, abs=1e-9)
    for theta in ANSWER + 0.3 * RNG.standard_normal((6, 3)) * [0.3, 0.5, 0.3]:
        moved = (Bent().velocities(theta) - Bent().velocities(ANSWER)) * weight
        r = at_answer + moved.ravel()
        exact = -0.5 * (r @ W @ r - at_answer @ W @ at_answer)
        assert target.log_probability(theta) / exact == pytest.approx(1.0, rel=1e-8)


def test_the_probability_is_zero_beyond_the_bounds_and_of_impossible_runs():
    target = LogPosterior(Bent(), a_fit())
    for i in range(3):
        for end in (-1.0, 1.0 + i):
            at = np.where(np.arange(3) == i, end, 0.0)
            outside = at + np.sign(end) * 1e-9 * (np.arange(3) == i)
            assert target.log_probability(outside) == -np.inf
            assert np.isfinite(target.log_probability(at)) == (end < 0)  # above 0.9 nothing runs


def test_the_covariance_is_that_of_the_jacobian_and_of_the_bounds():
    """The square of a flat law between bounds has a twelfth of their distance's."""
    fit = a_fit()
    target, (_, slopes, U, noise, _) = LogPosterior(Bent(), fit), weighting(fit)
    by_scale = slopes.T @ U
    reach = np.array([2.0, 3.0, 4.0]) / SCALE
    precision = by_scale @ np.linalg.inv(noise) @ by_scale.T + np.diag(12 / reach**2)
    exact = np.linalg.inv(precision) * np.outer(SCALE, SCALE)
    np.testing.assert_allclose(target.shape @ target.shape.T, exact, rtol=1e-8)
    blind = covariance_root(np.zeros((2, 2)), np.eye(2), np.array([1.0, 6.0]))
    np.testing.assert_allclose(blind @ blind.T, np.diag([1, 36]) / 12, rtol=1e-12)


# --- the impulse of the first wave ---------------------------------------------------------------

T = np.arange(400) * 1e-6


def half_sines(*waves):
    """(from, to, height) in samples."""
    force = np.zeros(400)
    for begin, end, height in waves:
        at = np.arange(begin, end + 1)
        force[at] += height * np.sin(np.pi * (at - begin) / (end - begin))
    return force


def test_the_impulse_of_a_wave_is_its_area_until_it_has_passed():
    """2 F w / pi of a half sine; a further wave and a faint one before it do not count."""
    alone = incident_impulse(T, half_sines((50, 150, 40.0)))
    assert alone.impulse == pytest.approx(2 / np.pi * 40.0 * 100e-6, rel=2e-3)
    gone = 150 - 100 * np.arcsin(0.02) / np.pi
    assert T[alone.samples - 1] == alone.end and 0 <= alone.end * 1e6 - gone < 1
    exact = np.trapezoid(half_sines((50, 150, 40.0))[: alone.samples], dx=1e-6)
    assert alone.impulse == pytest.approx(exact, rel=1e-12)
    both = incident_impulse(T, half_sines((10, 30, 11.9), (50, 150, 40.0), (200, 300, 38.0)))
    assert both.end == alone.end and both.impulse > alone.impulse
    first = incident_impulse(T, half_sines((10, 30, 12.1), (50, 150, 40.0)))
    assert first.samples == 31


@pytest.mark.parametrize(("floor", "told"), [(3.9, True), (4.1, False)])
def test_waves_that_overlap_by_more_than_a_tenth_have_no_impulse(floor, told):
    """Between their crests the force does not fall below a floor; its least is the end then."""
    force = np.maximum(half_sines((50, 150, 40.0), (160, 260, 44.0)), floor)
    force[:50], force[155] = 0.0, floor - 0.05
    result = incident_impulse(T, force)
    assert (result is not None) == told
    if told:
        assert result.samples == 156
    assert incident_impulse(T, 0 * T) is None


# --- scans ---------------------------------------------------------------------------------------


def test_valleys_of_a_scan_are_its_local_minima_the_least_first():
    misfit = np.array([3.0, 4, 2, 2, 5, 1, 6, 5])
    assert local_minima(misfit).tolist() == [5, 2, 3, 0, 7]
    assert local_minima(np.array([1.0])).tolist() == [0]


def test_a_scan_tries_frequencies_by_factors_and_leaves_out_what_cannot_run():
    parameters = [
        Parameter("m", "mass", 0.5, 0.1, 2.0, 0.1),
        Parameter("f", "frequency", 200.0, 50.0, 900.0, 20.0),
    ]
    tried = []

    def misfit(z, windows):
        assert windows.shape == (5, 2) and windows.all()
        tried.append(np.exp(z[1] * 0.1))
        hz = tried[-1]
        return 30.0 if hz > 640 else abs(np.sin(hz / 60.0)) + hz / 1e3

    fit = SimpleNamespace(parameters=parameters, data=np.zeros((5, 2)), largest=2.0, misfit=misfit)
    z, scan = scanned(fit, np.array([7.0, 1.0]), 100.0, 800.0, 40)
    np.testing.assert_allclose(tried, np.geomspace(100, 800, 40), rtol=1e-12)
    selected = np.array(tried) < 640
    assert scan.name == "f" and IMPOSSIBLE * 2.0 < 30.0
    np.testing.assert_allclose(scan.value, np.array(tried)[selected])
    assert len(z) == 3 and all(item[0] == 7.0 for item in z)
    result = [np.exp(item[1] * 0.1) for item in z]
    np.testing.assert_allclose(result, np.pi * 60 * np.array([1, 2, 3]), rtol=0.04)


# --- growing windows -----------------------------------------------------------------------------


class Scripted:
    """A fit whose misfits are z[0] of what is asked for; swaps as they are given."""

    def __init__(self, guesses=(), improves=0.5):
        self.guesses, self.improves, self.calls = list(guesses), improves, []

    def solved(self, z, free, window, *, max_runs, prior=False, tolerance):
        self.calls.append((float(z[0]), int(window.sum()), prior))
        return Solution(z, float(z[0]), 3, True)

    def swapped(self, z, free, window, *, cycles):
        self.calls.append(("cycles" if cycles else "pairs", float(z[0])))
        return [(g * z[0], np.array([self.improves * z[0]])) for g in self.guesses]


def windows(fit, budget=10**6, enough=0.1):
    return GrowingWindows(fit, lambda samples: enough, budget)


def test_windows_grow_with_a_prior_on_all_but_the_last():
    fit = Scripted()
    steps = [np.arange(9) < n for n in (2, 5, 9)]
    z, misfit, spent = windows(fit).on_windows(np.array([0.05]), np.ones(1, bool), steps, 0.0)
    assert fit.calls == [(0.05, 2, True), (0.05, 5, True), (0.05, 9, False)]
    assert (z[0], misfit, spent) == (0.05, 0.05, 9)
    windows(fit).on_windows(np.array([0.3]), np.ones(1, bool), steps[:1], 0.3)
    assert "pairs" not in [call[0] for call in fit.calls]  # as good as is asked for at least


def test_swaps_go_on_while_they_help_and_then_by_cycles_of_three():
    """The best SWAPS.tried that are guessed below SWAPS.worse of the misfit, each fitted once."""
    guesses = [0.5] * 3 + [0.99 * WORSE_GUESS] + [1.01 * WORSE_GUESS] * 5
    fit, begin = Scripted(guesses), Solution(np.array([1.0]), 1.0, 1, True)
    search = windows(fit)
    best, spent = search.swapped(best=begin, free=None, window=np.ones(4), enough=0.3)
    assert best.misfit == 0.25 and spent == 2 * (9 + 4 * 3) and search.budget == 10**6 - spent
    kinds = [call for call in fit.calls if call[0] in ("pairs", "cycles")]
    assert kinds == [("pairs", 1.0), ("pairs", 0.5)]
    many = Scripted([0.5] * 9)
    windows(many).swapped(begin, None, np.ones(4), 0.9, rounds=1)
    assert len(many.calls) == 1 + N_SWAPS_TRIED
    for improves, expected in (
        (1.01 * BETTER_SWAP, ["pairs", "cycles"]), (0.99 * BETTER_SWAP, ["pairs"] * SWAP_ROUNDS)
    ):  # fmt: skip
        fit = Scripted([0.5], improves)
        best, _ = windows(fit).swapped(begin, None, np.ones(4), 0.0)
        assert [call[0] for call in fit.calls if call[0] in ("pairs", "cycles")] == expected
        assert best.misfit == pytest.approx(improves ** len(expected))
    fit = Scripted([0.5])
    assert windows(fit, budget=0).swapped(begin, None, np.ones(4), 0.0) == (begin, 0)
    assert windows(fit).swapped(begin, None, np.ones(4), 1.0) == (begin, 0) and not fit.calls
    worse = windows(Scripted([0.5], 1.5)).swapped(begin, None, np.ones(4), 0.0)[0]
    assert worse is begin
