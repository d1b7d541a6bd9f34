"""The parts of an inspection on models with known answers: lines through numbers and gains."""

from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from beadwave.coupling.errors import CouplingError
from beadwave.workflows.fit.candidates import (
    distinct,
    is_noise,
    narrower_bounds,
    posterior_root,
    with_draws,
    with_triggers,
)
from beadwave.workflows.fit.forward import MeasuredRecord, StructureForward, durations, unknowns
from beadwave.workflows.fit.inversion import (
    Inversion,
    RecordPart,
    inverted,
    memory,
    residual_parts,
    sensors_side_by_side,
    widened,
)
from beadwave.workflows.fit.least_squares import HUGE, RecordFit, Solution
from beadwave.workflows.fit.model_errors import BetterModel
from beadwave.workflows.fit.parameter import Parameter, at_bound
from beadwave.workflows.fit.reliability import InspectionAnswer
from beadwave.workflows.fit.uncertainty import (
    Valley,
    bars_over_time,
    bounds_information,
    determining_sample,
    profile_factor,
    profile_likelihood_bars,
    uncertainty,
)

T = np.arange(0.0, 240.0)
SHARED = (
    Parameter("a", "shared", 1.1, 0.5, 2.5, 0.1),
    Parameter("b", "shared", -0.4, -2.0, 2.0, 0.02),
)
OWN = [[Parameter(f"own {s}", "own", 0.3, 0.1, 0.9, 0.05)] for s in range(2)]
TRIGGERS = [Parameter(f"trigger {s}", "trigger", 1.0 + s, -40.0, 60.0, 2.0) for s in range(2)]
SOUGHT = unknowns(SHARED, OWN, TRIGGERS)
TRUTH = np.array([1.3, 0.2, 0.35, 0.0, 0.25, 0.0])
NOISE = np.array([0.02, 0.05])
SHAPES = np.random.default_rng(5).standard_normal((2, 240, 2, 6)).cumsum(axis=1) / 8
for s in range(2):  # a record knows its own numbers and those of all
    SHAPES[s][..., [i for i in range(2, 6) if i not in (2 + 2 * s, 3 + 2 * s)]] = 0.0


class Linear:
    """1 + J theta of two records and two sensors; nothing beyond a = 2.4."""

    within, shapes = None, SHAPES

    def signals(self, unknowns, theta, shots):
        if theta[0] > 2.4:
            raise CouplingError("beyond")
        samples = len(shots[0].t)
        return 1.0 + self.shapes[: len(shots), :samples] @ theta

    def jacobian(self, unknowns, theta, shots):
        slopes = self.shapes[: len(shots), : len(shots[0].t)] * unknowns.scale
        return self.signals(unknowns, theta, shots), slopes

    def with_steps(self, factor):
        return self


def a_fit(gain=(-1, -1), noise=1.0, truth=TRUTH, factor=1.0):
    y = factor * Linear().signals(SOUGHT, truth, [MeasuredRecord(T, T, T)] * 2)
    y = y + noise * NOISE * np.random.default_rng(1).standard_normal(y.shape)
    return RecordFit(
        Linear(), SOUGHT, tuple(MeasuredRecord(T, item, NOISE) for item in y), np.array(gain)
    )


def whole_line(fit):
    """J (n, p) over the noise, and what the bounds add (p, p), in scales."""
    J = (SHAPES * SOUGHT.scale / NOISE[:, None]).reshape(-1, 6)
    return J, np.diag(SOUGHT.pull * SOUGHT.scale)


class Shifted(Linear):
    """The linear model whose numbers are moved by what stands in place of its system."""

    def __init__(self, shift=0.0):
        self.shift = shift

    def with_system(self, system):
        return Shifted(system)

    def signals(self, unknowns, theta, shots):
        return super().signals(unknowns, theta + self.shift, shots)


def test_a_model_error_that_looks_like_a_change_of_numbers_joins_their_bars_by_that_change():
    """Of a linear model the bias is exact but for the pull of the bounds, less than 1e-3 of it;
    causes add up in squares, the covariance has them along their direction."""
    fit = a_fit()._replace(forward=Shifted())
    inversion = inverted(fit, n_shared=2, begin=TRUTH)
    shift = np.array([0.02, -0.01, 0.0, 0.0, 0.0, 0.0])
    wide = widened(fit, inversion, {"theory": [BetterModel(2 * shift, 0.5)]})
    np.testing.assert_allclose(wide.causes["theory"], np.abs(shift), atol=1e-3 * 0.02)
    np.testing.assert_allclose(wide.causes["noise"], inversion.uncertainty.two_sigma)
    squares = inversion.uncertainty.two_sigma**2 + wide.causes["theory"] ** 2
    np.testing.assert_allclose(wide.uncertainty.two_sigma**2, squares)
    added = wide.uncertainty.covariance - inversion.uncertainty.covariance
    assert added[0, 1] == pytest.approx(-0.02 * 0.01 / 4, rel=2e-3)
    # all of it is a change of numbers
    assert max(part.misfit for part in wide.model_error_parts) < 1e-2
    np.testing.assert_allclose(wide.value, inversion.value)


class Louder(Linear):
    """The linear model, each sensor's signal enlarged by a share that stands for its system."""

    def __init__(self, share=0.0):
        self.share = share

    def with_system(self, system):
        return Louder(system)

    def signals(self, unknowns, theta, shots):
        return super().signals(unknowns, theta, shots) * (1.0 + self.share)


def test_a_model_error_of_each_sensors_size_joins_the_bar_of_its_gain():
    """Of a sensor each, the gains take up all of it: the numbers stay."""
    fit = a_fit(gain=(0, 1))._replace(forward=Louder())
    inversion = inverted(fit, n_shared=2, begin=TRUTH, gains=["one", "two"])
    share = np.array([0.02, -0.05])
    wide = widened(fit, inversion, {"theory": [BetterModel(share, 0.5)]})
    moved = 0.5 * np.abs(share) * inversion.value[6:]
    np.testing.assert_allclose(wide.causes["theory"], np.r_[np.zeros(6), moved], atol=1e-4)


def test_without_a_better_model_bars_are_those_of_the_noise():
    fit = a_fit()
    inversion = inverted(fit, n_shared=2, begin=TRUTH)
    same = widened(fit, inversion, {})
    np.testing.assert_allclose(same.uncertainty.two_sigma, inversion.uncertainty.two_sigma)
    assert same.explained == inversion.explained
    assert all(part.misfit == 0.0 for part in same.model_error_parts)


# --- numbers -------------------------------------------------------------------------------------


def test_numbers_of_all_records_come_first_then_those_of_each_with_its_trigger():
    names = [p.name for p in SOUGHT.parameters]
    assert names == ["a", "b", "own 0", "trigger 0", "own 1", "trigger 1"]
    assert SOUGHT.of_system.tolist() == [[0, 1, 2], [0, 1, 4]]
    assert SOUGHT.trigger.tolist() == [3, 5]
    np.testing.assert_allclose(SOUGHT.centre, [1.5, 0.0, 0.3, 1.0, 0.3, 2.0])
    deviation = np.array([2.0, 4.0, 0.8, np.inf, 0.8, np.inf]) / np.sqrt(12)
    np.testing.assert_allclose(SOUGHT.pull, 1 / deviation)
    second = SOUGHT.only([1])
    assert second.of_system.tolist() == [[0, 1, 4]] and second.trigger.tolist() == [5]


def test_a_run_lasts_to_the_end_of_its_record_from_the_earliest_trigger_on():
    shots = [MeasuredRecord(T, T, T), MeasuredRecord(T[:101], T, T)]
    assert durations(SOUGHT, shots).tolist() == [239.0 + 40.0, 100.0 + 40.0]
    late = SOUGHT._replace(parameters=tuple(p._replace(low=100.0) for p in SOUGHT.parameters))
    with pytest.raises(CouplingError, match="ends before the first touch"):
        durations(late, shots)


def test_steps_of_a_derivative_stay_within_the_bounds():
    low, high = SOUGHT.ends()
    forward = StructureForward(None, (), 1.0)
    np.testing.assert_allclose(forward.difference_steps(SOUGHT, low), 1e-5 * SOUGHT.scale)
    np.testing.assert_allclose(forward.difference_steps(SOUGHT, high), -1e-5 * SOUGHT.scale)
    assert forward.with_steps(3.0).dt == 3.0


# --- fits ----------------------------------------------------------------------------------------


def test_gains_are_least_squares_over_the_noise_of_all_sensors_that_share_one():
    fit = a_fit(gain=(0, 0), factor=0.2)
    signals = fit.forward.signals(SOUGHT, TRUTH, fit.shots)
    model, data = ((x / NOISE).ravel() for x in (signals, fit.data))
    np.testing.assert_allclose(fit.gains(signals), np.full(2, model @ data / (model @ model)))
    separate = fit._replace(gain=np.array([1, 0])).gains(signals)
    row = np.sum(signals * fit.data, axis=(0, 1)) / np.sum(signals**2, axis=(0, 1))
    np.testing.assert_allclose(separate, row)
    np.testing.assert_allclose(fit._replace(gain=np.array([-1, 0])).gains(signals), [1.0, row[1]])


@pytest.mark.parametrize("gain", [(-1, -1), (0, 0), (0, 1), (-1, 0)])
def test_the_jacobian_is_that_of_the_residual_where_nothing_is_left(gain):
    fit = a_fit(gain, noise=0.0)
    h, J = 1e-5, fit.jacobian(TRUTH)
    for j, step in enumerate(h * SOUGHT.scale * np.eye(6)):
        central = (fit.residual(TRUTH + step) - fit.residual(TRUTH - step)) / (2 * h)
        np.testing.assert_allclose(J[:, j], central, atol=1e-6 * np.abs(central).max())


def test_a_fit_ends_at_the_least_squares_of_records_and_bounds():
    fit = a_fit(noise=30.0)
    J, pull = whole_line(fit)
    base = ((1.0 - fit.data) / NOISE).ravel()
    for about in (None, SOUGHT.centre + 0.3 * SOUGHT.scale):
        centre = (SOUGHT.centre if about is None else about) / SOUGHT.scale
        A, b = np.vstack([J, pull]), np.concatenate([-base, pull @ centre])
        exact = np.linalg.lstsq(A, b, rcond=None)[0] * SOUGHT.scale
        result = fit.solved(SOUGHT.centre, about=about)
        np.testing.assert_allclose(result.point, exact, atol=1e-5 * SOUGHT.scale.min())
        residual = J @ (exact / SOUGHT.scale) + base
        assert result.misfit == pytest.approx(np.sqrt(np.mean(residual**2)), rel=1e-9)
        assert result.converged and fit.misfit(result.point) == pytest.approx(result.misfit)


def test_a_fit_that_is_stopped_says_so():
    fit = a_fit(noise=30.0)
    result = fit.solved(SOUGHT.centre, max_runs=1)
    assert (result.evaluations, result.converged) == (1, False)


def test_a_fit_ends_at_its_bounds():
    """a at most 1.2, b at least 0.3: the others follow."""
    changed = (SHARED[0]._replace(high=1.2), SHARED[1]._replace(low=0.3))
    fit = a_fit()
    fit = fit._replace(unknowns=SOUGHT._replace(parameters=(*changed, *SOUGHT.parameters[2:])))
    sought = fit.unknowns
    A = np.vstack([whole_line(fit)[0], np.diag(sought.pull * sought.scale)])
    base = ((1.0 - fit.data) / NOISE).ravel()
    b = np.concatenate([-base, sought.pull * sought.centre])
    bounds = [end / sought.scale for end in sought.ends()]
    exact = lsq_linear(A, b, bounds, tol=1e-14).x
    result = fit.solved(np.array([1.0, 0.5, 0.3, 0.0, 0.3, 0.0])).point / sought.scale
    np.testing.assert_allclose(result[:2], [12.0, 15.0], rtol=1e-6)
    np.testing.assert_allclose(result, exact, atol=1e-4)


def test_numbers_of_other_records_stay_and_samples_can_be_left_out():
    fit = a_fit()
    first = fit.of_shots([0], stride=3)
    np.testing.assert_array_equal(first.shots[0].y, fit.shots[0].y[::3])
    np.testing.assert_array_equal(first.shots[0].t, T[::3])
    early = fit.of_shots([0]).until(70)
    assert early.data.shape == (1, 70, 2) and len(early.shots[0].t) == 70
    begin = SOUGHT.centre + 0.1 * SOUGHT.scale
    result = early.solved(begin).point
    np.testing.assert_array_equal(result[4:], begin[4:])
    assert (result[:4] != begin[:4]).all()


def test_an_impossible_run_has_a_huge_residual():
    fit = a_fit()
    np.testing.assert_array_equal(fit.residual(TRUTH + [1.2, 0, 0, 0, 0, 0]), np.full(960, HUGE))


@pytest.mark.parametrize("sigma", [0.0, 0.1, 0.4])
def test_rounding_adds_to_the_square_what_the_steadiest_record_shows(sigma):
    """2 D^2 / 12 exp(-(2 pi sigma / D)^2 / 2) of steps D, sigma the noise before them."""
    D = 0.3
    rms = np.hypot(sigma * D, D / np.sqrt(12.0))
    shots = [
        MeasuredRecord(T, T, np.array([more * rms]), np.array([D / np.sqrt(12.0)]))
        for more in (2, 1)
    ]
    fit = a_fit()._replace(shots=(*shots, MeasuredRecord(T, T, NOISE)))
    exact = D**2 / 6.0 * np.exp(-((2 * np.pi * sigma) ** 2) / 2)
    assert fit.rounded * rms**2 / exact == pytest.approx(1.0)
    assert a_fit().rounded < 1e-300


# --- what records tell ---------------------------------------------------------------------------


def test_bars_over_time_are_those_of_all_samples_so_far_and_of_the_bounds():
    slopes = np.random.default_rng(2).standard_normal((2, 50, 3, 6))
    B = bounds_information(SOUGHT.parameters)
    width = np.array([(p.high - p.low) / p.scale for p in SOUGHT.parameters])
    np.testing.assert_allclose(np.diag(B), 12.0 / width**2)
    assert np.count_nonzero(B) == 6
    ends = np.array([0, 1, 17, 50])
    for end, bars in zip(ends, bars_over_time(slopes, B, ends), strict=True):
        J = slopes[:, :end].reshape(-1, 6)
        exact = np.linalg.inv(J.T @ J + B)
        np.testing.assert_allclose(bars, 2 * np.sqrt(np.diag(exact)), rtol=1e-9)


def test_a_number_is_felt_once_its_lone_bar_is_a_share_of_its_bounds():
    """2 / sqrt(sum of squares) = share width: squares of 4, 2 and 0 a sample."""
    slopes = np.zeros((2, 40, 1, 3))
    slopes[0, :, 0] = [-2.0, 1.0, 0.0]
    slopes[1, :, 0] = [0.0, -1.0, 0.0]
    width = np.full(3, 20.0 / np.sqrt(12.0))  # a sum of 12 is needed
    assert determining_sample(slopes, width, 0.1 * 1.0001).tolist() == [2, 5, 40]


# --- bars along a valley -------------------------------------------------------------------------


def test_a_parabola_rises_as_its_matrix_says_and_its_bars_stay():
    fit = a_fit(noise=0.3)
    result = inverted(fit, n_shared=2, begin=SOUGHT.centre)
    theta, J = result.value, fit.jacobian(result.value)
    valley = Valley(fit, theta, J)
    H = whole_line(fit)[0].T @ whole_line(fit)[0] + whole_line(fit)[1] ** 2
    np.testing.assert_allclose(valley.parabola, H, rtol=1e-9, atol=1e-9 * H.max())
    for i in range(2):
        along = np.linalg.inv(H)[i] / np.linalg.inv(H)[i, i]  # the others follow
        assert valley.rise(0.3 * along, i) / (0.09 * along @ H @ along) == pytest.approx(1, 1e-5)
        lone = 0.3 * np.eye(6)[i]
        assert valley.rise(lone, i) / (0.09 * along @ H @ along) == pytest.approx(1, 1e-5)
        low, high = SOUGHT.ends()
        available = (high[i] - theta[i]) / SOUGHT.scale[i], (theta[i] - low[i]) / SOUGHT.scale[i]
        steps = [valley.steps_to_bound(way * 2 * lone, i) for way in (1, -1)]
        assert steps == pytest.approx([distance / 0.6 for distance in available])
    exact = np.linalg.inv(H) * np.outer(SOUGHT.scale, SOUGHT.scale)
    bars = result.uncertainty._replace(covariance=exact)
    assert profile_likelihood_bars(fit, theta, J, bars, 2)[1] == pytest.approx(1.0, abs=1e-6)


class Ground(NamedTuple):
    """Of one number whose parabola rises by 1/4 in a step of 1/2, but which itself rises by `slope`
    of that in each; the bounds leave `end` steps."""

    slope: float
    end: float
    parabola = np.eye(1)

    def steps_to_bound(self, _step, _i):
        return self.end

    def rise(self, step, _i):
        return self.slope * abs(step[0]) / 2


@pytest.mark.parametrize(
    ("slope", "end", "steps"),
    [
        (0.25, 9.0, 4.0),  # t / 4 = 1
        (0.25, 3.0, 3.0),  # as far as the bounds
        (0.8, 1.1, 1.1),
        (0.2, 0.9, 1.0),
        (2.0, 9.0, 1.0),
    ],
)
def test_a_bar_is_lengthened_until_the_misfit_rises_as_the_parabola_or_to_the_bounds(
    slope, end, steps
):
    assert profile_factor(Ground(slope, end), np.full(1, 0.5), 0) == pytest.approx(steps)


class Saturating(Linear):
    """The first number counts as x = (1 - exp(-4 (a - 0.5))) / 4, ever less; or the mirror image of
    that in the middle of the bounds, ever more."""

    def __init__(self, way):
        self.way = way

    def _bent(self, theta):
        return np.append(self.way * (1 - self._slope(theta)) / 4, theta[1:])

    def _slope(self, theta):
        return np.exp(-4 * (1.0 + self.way * (theta[0] - 1.5)))

    def signals(self, unknowns, theta, shots):
        return super().signals(unknowns, self._bent(theta), shots)

    def jacobian(self, unknowns, theta, shots):
        signals, slopes = super().jacobian(unknowns, theta, shots)
        return signals, slopes * np.append(self._slope(theta), np.ones(5))


@pytest.mark.parametrize("way", [1, -1])
def test_a_bar_of_a_saturating_number_ends_where_the_misfit_is_that_of_the_parabola(way):
    """Squares of 1 - exp(-t q) against those of q, the others following: q = 1 - exp(-t q)."""
    model, truth = Saturating(way), np.append(1.5 + 0.3 * way, TRUTH[1:])
    fit = a_fit(truth=model._bent(truth), noise=way)._replace(forward=model)
    result = inverted(fit, n_shared=2, begin=truth)
    J = fit.jacobian(result.value)
    H = J.T @ J + whole_line(fit)[1] ** 2
    cov = np.linalg.inv(H) * np.outer(SOUGHT.scale, SOUGHT.scale)
    two_sigma = 2 * np.sqrt(np.diag(cov))
    plain = result.uncertainty._replace(covariance=cov, two_sigma=two_sigma)
    longer, lengthening = profile_likelihood_bars(fit, result.value, J, plain, 2)
    factors, q = longer.two_sigma / two_sigma, 4 * two_sigma[0]
    assert 0.4 < q < 0.7
    assert lengthening / (-np.log(1 - q) / q) == pytest.approx(1.0, rel=0.02)
    np.testing.assert_allclose(factors, [lengthening, *np.ones(5)], rtol=1e-3)
    np.testing.assert_allclose(2 * np.sqrt(np.diag(longer.covariance)), longer.two_sigma)
    deepest = max(item.two_sigma for item in longer.combinations)
    sizes = np.linalg.eigvalsh(longer.covariance / np.outer(SOUGHT.scale, SOUGHT.scale))
    assert deepest == pytest.approx(2 * np.sqrt(sizes[-1]))


# --- answers -------------------------------------------------------------------------------------


def test_an_answer_is_the_fit_with_its_gains_and_bars_in_order():
    fit = a_fit(gain=(0, 0), factor=0.2)
    result = inverted(fit, n_shared=2, begin=SOUGHT.centre, gains=["gain"])
    theta = result.value[:6]
    np.testing.assert_allclose(theta, fit.solved(SOUGHT.centre).point)
    signals = fit.forward.signals(SOUGHT, theta, fit.shots)
    gain = fit.gains(signals)[0]
    assert result.value[6] == gain == result.parameters[6].start
    assert result.parameters[6].scale == pytest.approx(0.1 * gain)
    np.testing.assert_allclose(result.model, gain * signals)
    residual = (gain * signals - fit.data) / NOISE
    np.testing.assert_allclose(result.misfit, np.sqrt(np.mean(residual**2, axis=1)))
    by_gain = (gain * signals)[..., None] / NOISE[:, None] * 0.1
    by_numbers = gain * SHAPES * SOUGHT.scale / NOISE[:, None]
    np.testing.assert_allclose(result.slopes, np.concatenate([by_numbers, by_gain], axis=-1))
    scale = np.array([p.scale for p in result.parameters])
    exact = uncertainty(
        result.parameters, sensors_side_by_side(residual),
        sensors_side_by_side(result.slopes) / scale, np.zeros(7, bool),
        bounds_information(result.parameters),
    )  # fmt: skip
    np.testing.assert_allclose(result.uncertainty.two_sigma, exact.two_sigma, rtol=1e-6)
    assert result.whole_misfit == pytest.approx(np.sqrt(np.mean(residual**2)))
    assert result.search.starts == len(result.search.ends) == 1
    assert result.explained and result.step_error == 0.0 and not result.at_bound.any()
    with pytest.raises(CouplingError, match="4 samples do not determine 6 numbers"):
        inverted(fit.of_shots([0]).until(2), n_shared=2)


def test_every_sensor_of_every_record_is_a_column():
    values = np.random.default_rng(0).standard_normal((2, 5, 3, 4))
    result = sensors_side_by_side(values)
    assert result.shape == (5, 6, 4)
    np.testing.assert_array_equal(result[:, :3], values[0])
    np.testing.assert_array_equal(result[:, 3:], values[1])


def test_memory_is_one_of_white_noise_and_that_of_an_autoregressive_process():
    """x_i = rho x_i-1 + e: half the variance of the steps is 1 - rho of its own."""
    e = np.random.default_rng(3).standard_normal((1, 40000, 1))
    assert memory(e) == pytest.approx(1.0, rel=0.02)
    x = np.zeros_like(e)
    for i in range(1, 40000):
        x[0, i] = 0.8 * x[0, i - 1] + e[0, i]
    assert memory(x) == pytest.approx(1 / (1 - 0.8), rel=0.05)
    assert memory(np.ones((1, 9, 1))) == np.inf


def test_residual_parts_cover_every_record():
    fit, residual = a_fit(), np.random.default_rng(0).standard_normal((2, 240, 2))
    parts = residual_parts(fit, residual)
    assert [piece.record for piece in parts] == [0] * 50 + [1] * 50
    sizes = np.array([piece.end - piece.begin + 1 for piece in parts])
    assert sizes.min() >= 4 and sizes.max() <= 5 and sizes.sum() == 480
    squares = sum(size * piece.misfit**2 for size, piece in zip(sizes, parts, strict=True))
    assert squares == pytest.approx(np.sum(residual**2) / 2)
    assert len(residual_parts(fit.until(7), residual[:, :7])) == 14


def test_bounds_are_met_within_a_millionth_of_their_distance():
    low, high = SOUGHT.ends()
    for distance, met in ((0.9e-6, True), (1.1e-6, False)):
        for value in (low + distance * (high - low), high - distance * (high - low)):
            assert (at_bound(SOUGHT.parameters, value) == met).all()
    endless = (SHARED[0]._replace(high=np.inf),)
    assert not at_bound(endless, np.array([0.5])).any()


def an_answer(value=0.0, misfit=1.0, memory=1.0, worst=1.0, n=5000):
    bars = uncertainty(SHARED[:1], np.ones((3, 1)), np.ones((3, 1, 1)), np.zeros(1, bool))
    bars = bars._replace(two_sigma=np.array([0.1]))
    parts = (RecordPart(0, 0.0, 1.0, worst), *[RecordPart(0, 0.0, 1.0, 1.0)] * 9)
    return Inversion(
        SHARED[:1], np.array([value]), np.zeros(1, bool), bars, np.ones(1), np.zeros((1, n, 1)),
        np.full((1, 1), misfit), np.zeros((1, n, 1, 1)), memory, parts, 0.0, None,
    )  # fmt: skip


@pytest.mark.parametrize("memory", [0.5, 1.0, 9.0])
def test_records_are_explained_where_the_whole_residual_and_its_parts_may_be_noise(memory):
    """Squares of 1.15 and five deviations sqrt(2 memory / n) of n samples."""
    limits = [1.15 + 5 * np.sqrt(2 * max(memory, 1.0) / n) for n in (5000, 500)]
    for share, explained in ((0.999, True), (1.001, False)):
        full, piece = np.sqrt(share * np.array(limits))
        assert an_answer(misfit=full, memory=memory).explained == explained
        assert an_answer(worst=piece, memory=memory).explained == explained


def test_no_number_is_determined_by_a_model_that_does_not_explain_the_records():
    for misfit, expected in ((1.0, "yes"), (2.0, "not explained")):
        judged = InspectionAnswer(an_answer(misfit=misfit), (), None, 1, True, None, None, ("one",))
        assert judged.identifiable == [expected]
        assert judged._replace(noise_known=False).identifiable == ["yes"]


@pytest.mark.parametrize("misfit", [0.8, 1.3])
def test_rivals_leave_as_little_and_lie_farther_off_than_the_bars(misfit):
    best = an_answer(0.0, misfit)
    within, beyond = (misfit * np.sqrt(1 + share * 16.0 / 5000) for share in (0.999, 1.001))
    nearby, far, lost = an_answer(0.099, misfit), an_answer(0.101, within), an_answer(0.3, beyond)
    again = an_answer(0.15, misfit)
    assert best.rivals([nearby, far, lost, again], 1) == (far,)
    second = an_answer(0.202, misfit)
    assert best.rivals([far, second], 1) == (far, second)
    assert best._replace(memory=2.0).rivals([lost], 1) == (lost,)


def test_a_profile_is_the_least_of_two_starts_and_their_gauss_newton_steps():
    """x / 10 and 3 sin(y - g(x)), g = 2 x / (1 + 4 x^2): the valley bends back from y = 2 x."""

    def residual(theta):
        x, y = theta
        return np.array([0.1 * x, 3 * np.sin(y - 2 * x / (1 + 4 * x**2))])

    ends, ones = (np.full(2, -50.0), np.full(2, 50.0)), np.ones(2)
    unknowns = SimpleNamespace(pull=0 * ones, scale=ones, centre=0 * ones, ends=lambda: ends)
    fit = SimpleNamespace(unknowns=unknowns, residual=residual)
    valley = Valley(fit, np.zeros(2), np.array([[0.1, 0.0], [-6.0, 3.0]]))
    stayed = []
    for x in (0.3, 1.0, -1.4):
        begins = np.array([[x, 2 * x], [x, 0.0]])
        followed = [b - [0, residual(b)[1] / 3] for b in begins]
        smallest = [np.sum(residual(b) ** 2) for b in (*begins, *followed)]
        stayed.append(np.argmin(smallest) % 2 == 1)
        assert valley.rise(np.array([x, 2 * x]), 0) == pytest.approx(min(smallest), rel=1e-9)
    assert stayed == [False, True, True]


# --- the way there -------------------------------------------------------------------------------


def test_triggers_are_set_so_that_first_waves_rise_together():
    def ramps(late):
        return np.clip((T[:, None] - late) / 20.0, 0.0, 1.0) * [2.0, -1.0]

    class Ramp:
        def signals(self, unknowns, theta, shots):
            return np.array([ramps(30.0 + theta[i]) for i in unknowns.trigger])

    shots = tuple(MeasuredRecord(T, 0.1 * ramps(late), NOISE) for late in (33.5, 200.0))
    fit = RecordFit(Ramp(), SOUGHT, shots, np.array([0, 0]))
    result = with_triggers(fit, SOUGHT.centre)
    np.testing.assert_allclose(result[[3, 5]], [3.5, 60.0], atol=1e-9)  # 60 is a bound
    np.testing.assert_array_equal(result[[0, 1, 2, 4]], SOUGHT.centre[[0, 1, 2, 4]])


def test_candidates_within_a_share_of_the_bounds_are_one():
    fit, width = a_fit(), np.array([2.0, 4.0])

    def at(*shares):
        return Solution(SOUGHT.centre + np.append(shares * width, np.zeros(4)), 1.0, 1, True)

    ends = [at(0.0, 0.0), at(0.0049, -0.0049), at(0.0, 0.0051), at(0.0051, 0.0051)]
    assert distinct(fit, ends, 2, 0.005) == [ends[0], ends[2], ends[3]]
    assert distinct(fit, ends, 1, 0.005) == [ends[0], ends[3]]
    assert distinct(fit, ends, 2, 0.02) == ends[:1]


def test_a_window_is_explained_where_the_whole_and_its_new_samples_are_noise():
    residual = np.ones((1, 1000, 2))
    full, new = (1.06 + 3 * np.sqrt(2 / n) for n in (2000, 400))
    for share, noise in ((0.999, True), (1.001, False)):
        assert is_noise(residual * np.sqrt(share * full), 0) == noise
        late = residual.copy()
        late[:, 800:] *= np.sqrt(share * new)
        assert is_noise(late, 800) == noise


def test_draws_and_narrower_bounds_follow_the_posterior_covariance():
    """(J^T J + B)^-1 of the first record: the second's own numbers stay."""
    item = a_fit().of_shots([0]).until(100)
    J = (SHAPES[0, :100] * SOUGHT.scale / NOISE[:, None]).reshape(-1, 6)
    B = np.diag((SOUGHT.pull * SOUGHT.scale) ** 2)
    spread = posterior_root(item, TRUTH)
    exact = np.linalg.inv((J.T @ J + B)[:4, :4]) * np.outer(SOUGHT.scale[:4], SOUGHT.scale[:4])
    np.testing.assert_allclose((spread @ spread.T)[:4, :4], exact, rtol=1e-6)
    assert not spread[4:].any()
    selected = [Solution(SOUGHT.centre, 1.0, 1, True), Solution(TRUTH, 1.0, 1, True)]
    low, high = narrower_bounds(item, selected, spread, 2)
    reach = np.maximum(4 * np.sqrt(np.diag(exact)[:2]), 0.005 * np.array([2.0, 4.0]))
    ends = np.sort([SOUGHT.centre[:2], TRUTH[:2]], axis=0) + [-reach, reach]
    np.testing.assert_allclose([low, high], ends)
    wide = narrower_bounds(item, selected, 1e6 * spread, 2)
    np.testing.assert_array_equal(wide, [end[:2] for end in SOUGHT.ends()])
    thetas = np.array(with_draws(item, selected, spread, 2000, np.random.default_rng(0)))
    assert len(thetas) == 2000 and (thetas >= SOUGHT.ends()[0]).all()
    off = thetas[2:][np.arange(1998) % 2 == 0] - SOUGHT.centre
    np.testing.assert_allclose(off.std(axis=0)[:3], 1.5 * np.sqrt(np.diag(exact)[:3]), rtol=0.1)
