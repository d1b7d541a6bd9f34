"""The parts of a calibration on models with known answers: lines, sines, noise."""

from itertools import permutations

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from scipy.signal import freqz_sos, sosfilt

from beadwave import dem
from beadwave.coupling.errors import CouplingError
from beadwave.dem import sensitivities
from beadwave.workflows.fit import aligned_signals as laid
from beadwave.workflows.fit.aligned_signals import Filter, Signals, aligned, lag_of, noise_of_mean
from beadwave.workflows.fit.forward import NO_FILTER, ChainForward, refined
from beadwave.workflows.fit.least_squares import (
    CLOSE,
    IMPOSSIBLE_RESIDUAL,
    PRIOR,
    WindowFit,
    rms,
    three_cycles,
    weights,
)
from beadwave.workflows.fit.marched_system import Rig
from beadwave.workflows.fit.parameter import (
    Parameter,
    coordinates,
    directions,
    rig_at,
    slopes,
    values,
)
from beadwave.workflows.fit.uncertainty import lags_that_count, noise_along, uncertainty

KINDS = (
    "contact", "preload", "dissipation", "striker", "trigger", "frequency", "mass", "damping",
)  # fmt: skip
T = np.arange(400) * 1e-3
J = np.stack([np.cos(3 * T), T**2, np.sin(40 * T)], axis=1)[:, None, :]


def a_rig():
    chain = dem.row_of_spheres(0.01, 7800.0, 2e11, 0.3, count=3, preload=2.0)
    wall = dem.one_dof_wall(900.0, 0.5, 0.05)
    return Rig(chain, wall, np.array([0.3, 0.01, 0.0]), np.array([[0.7]]), 1e-5)


def every_kind():
    starts = (1.1, 2.0, 0.02, 0.31, 2e-5, 900.0, 0.5, 0.05)
    return tuple(
        Parameter(
            kind, kind, start, 0.1 * start, 9 * start, 0.3 * start, "", int(kind == "contact")
        )
        for kind, start in zip(KINDS, starts, strict=True)
    )


# --- parameters ----------------------------------------------------------------------------------


def test_coordinates_are_in_scales_and_invertible():
    """A step of one is a scale; of what goes by factors, the factor exp(scale / start)."""
    parameters = every_kind()
    theta = np.array([1.3 * p.start for p in parameters])
    z = coordinates(parameters, theta)
    # two or three roundings, 4e-16
    np.testing.assert_allclose(values(parameters, z), theta, rtol=1e-14)
    by_factors = np.exp(0.3) * theta
    moved = np.where([p.kind in ("dissipation", "trigger", "damping") for p in parameters],
                     theta + [p.scale for p in parameters], by_factors)  # fmt: skip
    np.testing.assert_allclose(values(parameters, z + 1), moved, rtol=1e-12)
    h = 1e-6
    numeric = (values(parameters, z + h) - values(parameters, z - h)) / (2 * h)
    # rounding leaves eps / h = 2e-10 of a value, which is up to ten times its slope
    np.testing.assert_allclose(slopes(parameters, theta), numeric, rtol=1e-8)


def test_a_rig_has_its_parameters_and_their_directions():
    """Each direction against the difference of two rigs."""
    rig, parameters = a_rig(), every_kind()
    theta = np.array([1.2, 3.0, 0.05, 0.4, 3e-5, 700.0, 0.8, 0.06])

    def numbers(theta):
        at = rig_at(rig, parameters, theta)
        chain, wall = at.chain, at.wall
        return (chain.A, chain.gamma, at.v0, [chain.preload], wall.phi, wall.omega, wall.zeta)

    at = rig_at(rig, parameters, theta)
    assert at.trigger == 3e-5 and at.chain.dissipation == "hunt-crossley"
    np.testing.assert_allclose(at.chain.A / rig.chain.A, [1.0, 1.2, 1.0], rtol=1e-14)
    np.testing.assert_allclose(at.v0, [0.4, 0.01, 0.0])
    np.testing.assert_allclose(at.wall.omega, 2 * np.pi * 700.0)
    np.testing.assert_allclose(at.wall.phi**-2, 0.8)
    np.testing.assert_allclose(at.wall.zeta, 0.05 + 0.7 * 0.01)
    given = directions(rig, parameters, theta)
    assert given.parameters is None  # Hertz' law has none
    for j, p in enumerate(parameters):
        h = 1e-5 * p.start * np.eye(len(parameters))[j]
        pairs = zip(numbers(theta + h), numbers(theta - h), strict=True)
        numeric = [(np.asarray(b) - a) / (2 * h[j]) for b, a in pairs]
        for result, exact in zip(given[: len(numeric)], numeric, strict=True):
            np.testing.assert_allclose(result.reshape(-1, 8)[:, j], exact, rtol=1e-7, atol=1e-9)


def test_a_chain_without_a_wall_has_no_directions_of_one():
    free = a_rig()._replace(wall=None)
    given = directions(free, every_kind()[:5], np.ones(5))
    assert given.omega.shape == given.phi.shape == given.zeta.shape == (0, 5)


def test_a_damping_ratio_ends_at_zero():
    damping = every_kind()[-1:]
    assert rig_at(a_rig(), damping, [-0.9]).wall.zeta[0] == 0.0


# --- fits ----------------------------------------------------------------------------------------


class Linear(ChainForward):
    """J theta instead of a chain; impossible beyond 50."""

    def __init__(self, signals, kind="damping"):
        self.parameters = tuple(
            Parameter(f"p{i}", kind, 1.0, 0.1, 60.0, s, "", i) for i, s in enumerate((0.1, 0.5, 2))
        )
        self.signals, self.filters = signals, NO_FILTER

    def velocities(self, theta, first=None):
        if max(theta) > 50:
            raise dem.InvalidChain("beyond 50")
        return np.repeat(J @ theta, self.signals.v.shape[1], axis=1)[:first]

    def velocities_and_sensitivities(self, theta, first=None):
        return self.velocities(theta, first), np.repeat(J, self.signals.v.shape[1], axis=1)[:first]


TRUTH = np.array([1.5, 2.0, 0.7])


def a_fit(kind="damping", spread=(np.nan,), noise=0.0):
    v = np.repeat(J @ TRUTH, len(spread), axis=1)
    v += noise * np.random.default_rng(2).standard_normal(v.shape)
    return WindowFit(Linear(Signals(T, v, (0,) * len(spread), np.array(spread)), kind))


EVERYTHING = np.ones((len(T), 1), bool)


@pytest.mark.parametrize("kind", ["damping", "contact"])
def test_a_fit_of_a_linear_model_is_its_least_squares(kind):
    """Linear or by factors; parameters that are not free stay, and a window ends where it does."""
    fit, window = a_fit(kind, noise=0.1), EVERYTHING.copy()
    window[300:] = False
    start = coordinates(fit.parameters, [1.0, 1.0, 0.7])
    free = np.array([True, True, False])
    result = fit.solved(start, free, window)
    A, b = J[:300, 0], fit.data[:300, 0]
    exact = np.linalg.lstsq(A[:, :2], b - 0.7 * A[:, 2], rcond=None)[0]
    # the fit ends where its misfit falls by 1e-10: 1e-8 of parameters, as a misfit is flat there
    np.testing.assert_allclose(values(fit.parameters, result.point), [*exact, 0.7], rtol=1e-7)
    residual = A @ values(fit.parameters, result.point) - b
    assert result.misfit == pytest.approx(np.sqrt(np.mean(residual**2)), rel=1e-9)
    assert result.converged and result.evaluations > 0
    assert not fit.solved(start, free, window, max_runs=1).converged
    none = fit.solved(start, np.zeros(3, bool), window)
    assert (none.misfit, none.evaluations, none.converged) == (fit.misfit(start, window), 0, True)


def test_a_fit_with_a_prior_is_held_by_weak_springs():
    """PRIOR of the fastest sphere per scale, over the rms of the window."""
    fit = a_fit(noise=0.1)
    start = coordinates(fit.parameters, [1.0, 1.0, 1.0])
    result = fit.solved(start, np.ones(3, bool), EVERYTHING, prior=True)
    scales = np.array([p.scale for p in fit.parameters])
    spring = PRIOR * np.abs(fit.data).max() * np.sqrt(len(T))
    A = np.vstack([J[:, 0] * scales, spring * np.eye(3)])
    b = np.concatenate([fit.data[:, 0], spring * start])
    # the fit ends where its misfit falls by 1e-10, here 1e-9 from the solution
    np.testing.assert_allclose(result.point, np.linalg.lstsq(A, b, rcond=None)[0], rtol=1e-8)
    free = fit.solved(start, np.ones(3, bool), EVERYTHING)
    assert np.abs(result.point - free.point).max() > 1e-7


def test_a_fit_begins_within_its_bounds():
    fit = a_fit()
    true = coordinates(fit.parameters, TRUTH)
    fit.low, fit.high = true - 3, true + 3
    for start in (fit.low, fit.low - 1, fit.high, fit.high + 1):
        result = fit.solved(start, np.ones(3, bool), EVERYTHING)
        np.testing.assert_allclose(result.point, true, rtol=1e-6)


def test_a_fit_ends_at_its_bounds():
    fit = a_fit()
    fit.high = coordinates(fit.parameters, [1.2, 60.0, 60.0])
    result = fit.solved(coordinates(fit.parameters, [1.0, 1.0, 1.0]), np.ones(3, bool), EVERYTHING)
    bounds = ([0.1] * 3, [1.2, 60, 60])
    exact = lsq_linear(J[:, 0], fit.data[:, 0], bounds).x
    np.testing.assert_allclose(values(fit.parameters, result.point), exact, rtol=1e-4)


def test_the_jacobian_is_that_of_the_residual():
    fit = a_fit("contact", spread=(0.1, 0.4))
    window = np.repeat(EVERYTHING, 2, axis=1)
    window[::3, 1] = False
    z, h = coordinates(fit.parameters, [1.1, 1.3, 0.9]), 1e-5
    steps = h * np.eye(3)
    numeric = [(fit.residual(z + s, window) - fit.residual(z - s, window)) / (2 * h) for s in steps]
    # rounding leaves eps / h = 2e-11 of a difference, a fiftieth of atol
    np.testing.assert_allclose(fit.jacobian(z, window), np.transpose(numeric), rtol=1e-7, atol=1e-9)


def test_an_impossible_run_has_a_huge_residual():
    fit = a_fit()
    z = coordinates(fit.parameters, [1.0, 55.0, 1.0])
    worst = IMPOSSIBLE_RESIDUAL * np.abs(fit.data).max()
    np.testing.assert_array_equal(fit.residual(z, EVERYTHING), np.full(len(T), worst))
    assert fit.misfit(z, EVERYTHING) == pytest.approx(worst)


def test_weights_are_one_over_the_noise_and_unit_in_the_rms():
    """A sphere of a tenth of the largest noise and less counts no more than that."""
    spread = np.array([0.1, 0.2, 0.4])
    np.testing.assert_allclose(weights(spread) * spread, np.sqrt(np.mean(spread**2)), rtol=1e-14)
    np.testing.assert_array_equal(weights(np.array([0.1, np.nan])), [1.0, 1.0])
    np.testing.assert_array_equal(weights(np.array([0.1, 0.0])), [1.0, 1.0])
    still = np.array([1e-9, 1.0])
    np.testing.assert_allclose(weights(still)[0] / weights(still)[1], 10.0, rtol=1e-12)
    assert rms(np.array([3.0, -4.0])) == pytest.approx(np.sqrt(12.5)) and rms(np.zeros(0)) == 0.0


def test_swaps_are_ranked_by_their_residual_outside_the_span_of_the_jacobian():
    """Two contacts in each other's place, put back, leave nothing; the rest as far as linear."""
    fit = a_fit("contact")
    wrong = coordinates(fit.parameters, TRUTH[[1, 0, 2]])
    true = coordinates(fit.parameters, TRUTH)
    wrong[[0, 1]] = true[[1, 0]]
    free = np.array([True, True, False])
    ((misfit, z),) = fit.swapped(wrong, free, EVERYTHING)
    np.testing.assert_allclose(z, true)
    assert misfit < 1e-12
    result = fit.swapped(wrong, np.ones(3, bool), EVERYTHING)
    assert [m for m, _ in result] == sorted(m for m, _ in result) and len(result) == 3
    A = J[:, 0] * slopes(fit.parameters, values(fit.parameters, wrong))
    for guess, second in result:
        r = fit.residual(second, EVERYTHING)
        residual = r - A @ np.linalg.lstsq(A, r, rcond=None)[0]
        assert guess == pytest.approx(np.sqrt(np.mean(residual**2)), rel=1e-6, abs=1e-12)
    nearby = true.copy()
    nearby[1] = nearby[0] + 0.09
    selected = {tuple(z) for _, z in fit.swapped(nearby, np.ones(3, bool), EVERYTHING)}
    assert len(selected) == 2  # the two that are alike are not worth it


def test_cycles_are_both_of_any_three_contacts_that_lie_close():
    contacts = [0, 1, 3, 4, 9]
    close = {c for c in permutations(contacts, 3) if c[0] == min(c) and max(c) - min(c) <= CLOSE}
    assert set(three_cycles(contacts)) == close and len(close) == 8
    fit = a_fit("contact")
    z = coordinates(fit.parameters, TRUTH)
    turned = sorted(tuple(z[list(o)]) for o in ((1, 2, 0), (2, 0, 1)))
    result = fit.swapped(z, np.ones(3, bool), EVERYTHING, cycles=True)
    assert sorted(tuple(item) for _, item in result) == turned


# --- bars ----------------------------------------------------------------------------------------


def parameters_of(scales):
    return [Parameter(f"p{i}", "contact", 1.0, 0.1, 9.0, s, "", i) for i, s in enumerate(scales)]


def toeplitz(residual, taken):
    """R of a residual (k,) whose spectrum is divided by what a fit leaves of it."""
    k = len(residual)
    power = np.abs(np.fft.rfft(residual, 2 * k)) ** 2 / np.clip(1 - taken, 0.2, 1)
    r = np.fft.irfft(power, 2 * k)[:k] / k
    lags = lags_that_count(r)
    i = np.abs(np.subtract.outer(np.arange(k), np.arange(k)))
    spectrum = np.fft.rfft(np.r_[r[: lags + 1], np.zeros(2 * k - 2 * lags - 1), r[lags:0:-1]]).real
    kernel = np.fft.irfft(np.maximum(spectrum, 0), 2 * k)
    return kernel[i]


def test_noise_along_a_fit_is_the_product_with_its_autocovariance():
    rng = np.random.default_rng(3)
    U = np.linalg.qr(rng.standard_normal((240, 3)).cumsum(axis=0))[0].reshape(120, 2, 3)
    residual = sosfilt(laid.low_pass(0.1, 1.0)[0], rng.standard_normal((120, 2)), axis=0)
    exact = 0
    for i in range(2):
        absorbed = np.sum(np.abs(np.fft.rfft(U[:, i], 240, axis=0)) ** 2, axis=1) / 120
        exact = exact + U[:, i].T @ toeplitz(residual[:, i], absorbed) @ U[:, i]
    np.testing.assert_allclose(noise_along(U, residual), exact, rtol=1e-10)


def test_lags_end_at_ten_correlation_lengths():
    r = np.r_[1.0, 0.5, 0.11, 0.09, np.zeros(96)]
    assert (
        lags_that_count(7 * r) == lags_that_count(0.01 * r) == 25
        and lags_that_count(np.r_[r, np.zeros(100)]) == 30
    )
    assert lags_that_count(np.ones(100)) == 25 and lags_that_count(np.r_[1.0, np.zeros(99)]) == 10


@pytest.mark.parametrize("prior", [False, True])
def test_the_covariance_of_a_fit_is_the_sandwich_of_its_jacobian(prior):
    """H^-1 (J^T R J) H^-1 in scales, with what is known besides added to its inverse; parameters
    that are held have none."""
    rng = np.random.default_rng(5)
    parameters = parameters_of((0.3, 2.0, 1.0, 0.1))
    scale, J = np.array([p.scale for p in parameters]), rng.standard_normal((150, 2, 4))
    residual, fixed = rng.standard_normal((150, 2)), np.array([False, False, True, False])
    prior_information = np.diag([3.0, 0.0, 7.0, 50.0]) if prior else None
    result = uncertainty(parameters, residual, J, fixed, prior_information)
    A = (J * scale)[:, :, ~fixed]
    U, s, Vt = np.linalg.svd(A.reshape(-1, 3), full_matrices=False)
    middle = noise_along(U.reshape(150, 2, 3), residual)
    cov = (Vt.T / s) @ middle @ (Vt.T / s).T
    if prior:
        cov = np.linalg.inv(np.linalg.inv(cov) + prior_information[np.ix_(~fixed, ~fixed)])
    full = np.zeros((4, 4))
    full[np.ix_(~fixed, ~fixed)] = cov
    np.testing.assert_allclose(result.covariance, full * np.outer(scale, scale), rtol=1e-8)
    np.testing.assert_allclose(result.two_sigma, 2 * np.sqrt(np.diag(full)) * scale, rtol=1e-8)
    np.testing.assert_allclose(result.singular, s, rtol=1e-10)
    sigma = np.sqrt(np.diag(cov))
    free = np.ix_(~fixed, ~fixed)
    np.testing.assert_allclose(result.correlation[free], cov / np.outer(sigma, sigma), rtol=1e-8)
    assert not result.correlation[2].any()
    bars = [c.two_sigma for c in result.combinations]
    np.testing.assert_allclose(bars, 2 * np.sqrt(np.linalg.eigvalsh(cov)[::-1]), rtol=1e-7)
    for item in result.combinations:
        assert np.linalg.norm(item.direction) == pytest.approx(1.0) and item.direction[2] == 0
        square = item.direction @ full @ item.direction
        assert 2 * np.sqrt(square) == pytest.approx(item.two_sigma, rel=1e-7)


def test_undetermined_parameters_have_infinite_bars():
    """Two numbers that act as their sum, in scales of 3 and 1, one alone, and one of no effect."""
    rng = np.random.default_rng(6)
    parameters, a = parameters_of((3.0, 1.0, 0.2, 0.1)), rng.standard_normal((80, 1))
    J = np.stack([a / 3.0, a, rng.standard_normal((80, 1)), 0 * a], axis=2)
    result = uncertainty(parameters, rng.standard_normal((80, 1)), J, np.zeros(4, bool))
    assert np.isinf(result.two_sigma).tolist() == [True, True, False, True]
    *unseen, first, second = result.combinations[:4]
    assert [c.two_sigma for c in unseen] == [np.inf, np.inf]
    plane = np.array([c.direction for c in unseen])
    exact = np.array([[0.5, -0.5, 0, 0], [-0.5, 0.5, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1]])
    np.testing.assert_allclose(plane.T @ plane, exact, atol=1e-12)
    assert 0 < second.two_sigma <= first.two_sigma < np.inf
    assert np.abs(plane @ np.transpose([first.direction, second.direction])).max() < 1e-9


def test_bars_scale_with_the_noise_and_inversely_with_the_jacobian():
    """However small both are; of no noise there are none."""
    rng = np.random.default_rng(8)
    parameters, J = parameters_of((3.0, 1.0)), rng.standard_normal((80, 1, 2))
    residual, none = rng.standard_normal((80, 1)), np.zeros(2, bool)
    bars = uncertainty(parameters, residual, J, none).two_sigma
    for slope, noise in ((1e-20, 1.0), (1.0, 1e-9), (1e9, 1e-9)):
        result = uncertainty(parameters, noise * residual, slope * J, none)
        np.testing.assert_allclose(result.two_sigma * slope / noise, bars, rtol=1e-9)
    still = uncertainty(parameters, 0 * residual, J, none)
    assert still.combinations == () and not still.two_sigma.any()
    fixed = uncertainty(parameters, residual, J, ~none)
    assert fixed.combinations == () and not fixed.covariance.any() and not fixed.singular.size
    assert not fixed.two_sigma.any()


@pytest.mark.parametrize("k", [2, 3])
def test_noise_of_a_few_samples_has_no_lags(k):
    U, residual = np.eye(k)[:, None, :1], np.arange(1.0, k + 1)[:, None]
    power = np.abs(np.fft.rfft(residual[:, 0], 2 * k)) ** 2
    r = np.fft.irfft(power / np.maximum(1 - 1 / k, 0.2), 2 * k) / k
    assert noise_along(U, residual)[0, 0] == pytest.approx(r[0], rel=1e-12)


def test_a_combination_is_named_by_its_largest_components():
    from beadwave.workflows.fit.uncertainty import Combination

    item = Combination(np.array([-0.6, 0.1, 0.5, 0.0, -0.3]), 1.0)
    assert item.text(parameters_of((1,) * 5)) == "0.60 p0 - 0.50 p2 + 0.30 p4"
    flat = Combination(np.full(25, 0.2), 1.0)
    assert flat.text(parameters_of((1,) * 25)) == "0.20 p0"
    many = Combination(np.array([0.4, 0.41, 0.42, 0.43, 0.44]), 1.0)
    assert many.text(parameters_of((1,) * 5)).count("p") == 4


# --- signals -------------------------------------------------------------------------------------

FINE = np.arange(0, 1e-3, 1e-6)


def bumps(t, late=0.0):
    """Two waves of two spheres."""
    s = t - late
    wave = [np.exp(-(((s - c) / 3e-5) ** 2)) for c in (3e-4, 6e-4)]
    return np.column_stack([wave[0] - 0.5 * wave[1], 0.8 * wave[1]])


@pytest.mark.parametrize("late", [0.0, 2.3e-6, -37.6e-6])
def test_a_lag_is_found_to_a_fraction_of_a_sample(late):
    assert lag_of(FINE, bumps(FINE, late), bumps(FINE)) == pytest.approx(late, abs=3e-9)
    later = FINE + 0.25  # on another clock
    assert lag_of(later, bumps(FINE, late), bumps(FINE)) == pytest.approx(late, abs=3e-9)


@pytest.mark.parametrize("lag", [-60, 0, 45])
def test_a_lag_by_samples_is_the_best_correlation(lag):
    v = bumps(FINE)
    result = laid.shift_to_a_sample(FINE, v, np.roll(v, lag, axis=0) + 5.0)
    assert result == pytest.approx(lag * 1e-6, abs=1e-12)


def test_repeats_are_averaged_where_they_lie_over_each_other():
    late = np.array([3.2e-6, -5.1e-6, 1.9e-6])
    v = np.array([bumps(FINE, s) for s in late])
    result = aligned(FINE, v, (0, 1))
    np.testing.assert_allclose(result.shift, late - late.mean(), atol=2e-9)
    np.testing.assert_allclose(result.signals.v, bumps(FINE, late.mean()), atol=1e-4)
    assert result.signals.repeats == 3 and result.outliers == ()
    still = aligned(FINE, v, (0, 1), move=False)
    assert not still.shift.any()
    np.testing.assert_allclose(still.signals.v, v.mean(axis=0))
    spread = np.sqrt(np.mean(np.var(v, axis=0, ddof=1), axis=0))
    np.testing.assert_allclose(still.signals.spread, spread)
    two = aligned(FINE, v[:2], (0, 1), move=False).signals
    np.testing.assert_allclose(two.v, v[:2].mean(axis=0))
    np.testing.assert_allclose(two.spread, rms_of(v[1] - v[0]) / np.sqrt(2))
    item = aligned(FINE, v[:1], (0, 1))
    assert np.isnan(item.signals.spread).all() and item.signals.repeats == len(item.shift) == 1


def rms_of(v):
    return np.sqrt(np.mean(v**2, axis=0))


@pytest.mark.parametrize("shift", [40e-6, -40e-6])
def test_a_record_is_held_constant_beyond_its_ends(shift):
    """A line read later or earlier, as far as it goes."""
    line = 3.0 * FINE[:, None]
    result = laid.shifted(FINE, line[None], np.array([shift]))[0]
    exact = 3.0 * np.clip(FINE + shift, FINE[0], FINE[-1])
    np.testing.assert_allclose(result[:, 0], exact, rtol=0, atol=1e-15)


def test_repeats_that_are_all_unlike_are_all_kept():
    v = np.random.default_rng(0).standard_normal((3, 500, 1))
    result = aligned(FINE[:500], v, (0,), move=False)
    assert result.outliers == () and result.signals.repeats == 3


def test_an_analogue_low_pass_of_order_four_is_later_by_its_delay():
    """At low frequency the phase of H(s) = 1 / B(s / omega) is -DELAY s / omega; the digital filter
    has less, lag() is the rest."""
    filters, dt = Filter(instrument=50e3), 1e-6
    sos = laid.low_pass(50e3, filters.refinement(dt) / dt)[0]
    f = 100.0
    digital = -np.angle(freqz_sos(sos, [f], fs=filters.refinement(dt) / dt)[1][0]) / (2 * np.pi * f)
    s = 1j * f / 50e3
    poles = np.exp(1j * np.pi * (np.array([5, 7, 9, 11]) / 8))
    analogue = -np.angle(np.prod(-poles / (s - poles))) / (2 * np.pi * f)
    assert filters.lag(dt) == pytest.approx(analogue - digital, rel=1e-3)
    assert filters.refinement(dt) == 1 and filters.refinement(4.1e-6) == 3
    assert Filter().lag(dt) == 0.0 and Filter().refinement(dt) == 1


def test_data_is_filtered_without_phase_and_the_model_as_the_instrument_does():
    t = np.arange(4000) * 1e-6
    wave = np.sin(2 * np.pi * 20e3 * t)[:, None] * np.ones(2)
    gain = 1 / (1 + (np.tan(np.pi * 0.02) / np.tan(np.pi * 0.03)) ** 8)
    result = Filter(band=30e3).of_data(wave, 1e-6)
    np.testing.assert_allclose(result[1000:3000], gain * wave[1000:3000], atol=1e-3)
    filters = Filter(instrument=29e3)
    fine = filters.refinement(1e-5)
    assert fine == 3
    model = np.sin(2 * np.pi * 8e3 * np.arange(1200) * 1e-5 / 3)[:, None]
    H = freqz_sos(laid.low_pass(29e3, 3e5)[0], [8e3], fs=3e5)[1][0]
    exact = np.imag(H * np.exp(2j * np.pi * 8e3 * np.arange(400) * 1e-5))
    np.testing.assert_allclose(filters.of_model(model, 1e-5)[100:, 0], exact[100:], atol=1e-6)
    steady = np.full((90, 2), 0.7)
    np.testing.assert_allclose(filters.of_model(steady, 1e-5), 0.7, rtol=1e-12)
    assert Filter().of_data(wave, 1e-6) is wave


def test_the_first_wave_has_passed_where_the_acceleration_dies():
    """It turns away at the second bump, whose slope is below 2 % of the largest from 7.1 widths
    on: exp(-x^2) x is 0.02 of its largest at x = 2.36."""
    v = bumps(FINE)
    width, pause = 3e-5, 4e-5
    ends = laid.first_waves_end(FINE, v, pause)
    x = np.linspace(1, 4, 30001)
    shape = x * np.exp(-(x**2))
    factor = 0.5  # of the second bump of the first sphere
    quiet = x[np.flatnonzero(factor * shape < 0.02 * np.exp(-0.5) / np.sqrt(2))[0]]
    assert ends[0] == pytest.approx(6e-4 + quiet * width, abs=1.5e-6)
    assert ends[1] == FINE[-1]  # never turns away


@pytest.mark.parametrize("pause", [0.0, 1e-6, 2e-6, 40e-6, 101e-6, 102e-6, 1.0])
def test_a_wave_has_passed_where_all_samples_of_a_pause_are_quiet(pause):
    """Turned away, slow at first, at rest for a hundred samples, and once more."""
    slope = np.r_[
        [0.0] * 20, [-1.0] * 30, [-0.01] * 2, [-1.0] * 20, [0.0] * 100, [0.5] * 30, [0.0] * 90
    ]
    v = np.cumsum(slope)
    t = 1e-6 * np.arange(len(v))
    quiet = np.abs(np.gradient(v, t)) < 0.02 * np.abs(np.gradient(v, t)).max()
    arrived = next(i for i in range(len(v)) if v[i] < -0.1 * np.abs(v).max())
    width = max(1, round(pause / 1e-6))
    ends = (t[i] for i in range(arrived, len(v) - width + 1) if quiet[i : i + width].all())
    assert laid.first_waves_end(t, v[:, None], pause)[0] == next(ends, t[-1])


def test_all_repeats_are_averaged_where_more_than_half_are_unlike():
    rng, item = np.random.default_rng(0), bumps(FINE)
    unlike = [item + 0.75 * item.std() * rng.standard_normal(item.shape) for _ in range(3)]
    result = aligned(FINE, np.array([item, item, *unlike]), (0, 1), move=False)
    assert result.outliers == ()
    half = aligned(FINE, np.array([item, item, *unlike[:2]]), (0, 1), move=False)
    assert half.outliers == (2, 3)


def test_one_of_three_repeats_that_is_unlike_the_others_is_left_out():
    v = np.array([bumps(FINE)] * 3)
    v[1] *= -1
    result = aligned(FINE, v, (0, 1), move=False)
    assert result.outliers == (1,) and result.signals.repeats == 2
    np.testing.assert_allclose(result.signals.v, v[0])


def test_noise_is_estimated_between_waves():
    rng = np.random.default_rng(1)
    t = np.arange(20000) * 1e-6
    clean = np.column_stack([np.exp(-(((t - 2e-3) / 3e-5) ** 2)), 0 * t + 0.3 * t])
    for noise in (1e-3, 4e-3):
        v = clean + noise * rng.standard_normal(clean.shape)
        result = laid.noise_between_waves(t, v, 1e-5)
        assert result == pytest.approx(noise, rel=0.05)
        assert laid.noise_between_waves(t + 0.25, v, 1e-5) == result  # whatever the clock says
    assert laid.noise_between_waves(t[:30], clean[:30], 1e-5) is None
    single = Signals(t, v, (0, 1), np.full(2, np.nan))
    assert noise_of_mean(single, NO_FILTER, 1e-5) == laid.noise_between_waves(t, v, 1e-5)
    repeats = single._replace(spread=np.array([0.3, 0.4]), repeats=5)
    assert noise_of_mean(repeats, NO_FILTER, 1e-5) == pytest.approx(np.sqrt(0.125 / 5))
    two = repeats._replace(repeats=2)
    assert noise_of_mean(two, NO_FILTER, 1e-5) == pytest.approx(np.sqrt(0.125 / 2))
    band = Filter(band=1e5)
    filtered = laid.noise_between_waves(t, band.of_data(v, 1e-6), 1e-5)
    assert noise_of_mean(single, band, 1e-5) == pytest.approx(filtered, rel=1e-9)
    assert filtered < 0.8 * laid.noise_between_waves(t, v, 1e-5)
    later = single._replace(t=t + 0.25)
    # eps of 0.25 s is 5e-11 of a step of 1e-6 s
    assert noise_of_mean(later, band, 1e-5) == pytest.approx(filtered, rel=1e-9)


def a_noisy_wave(k, noise=1e-3, seed=0):
    """Rising steadily, with a jump in the middle and a drift where it ends."""
    at = np.arange(k)
    drift = 0.02 * np.maximum(at - 0.9 * k, 0.0)
    noise = noise * np.random.default_rng(seed).standard_normal(k)
    return 1e-3 * at + (at > k // 2) + drift + noise


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("q", [1, 3, 8])
def test_noise_is_read_where_six_half_scales_are_calm(q, seed):
    """v_i+q - 2 v_i + v_i-q in the middle of 6 q samples along which the running mean of 2 q,
    that of the first and the last 2 q at the ends, changes by less than a twentieth of its most."""
    k = 300
    v = a_noisy_wave(k, 0.017 * np.sqrt(q), seed)
    mean = [v[max(i - q, 0) : i + q].mean() if q <= i < k - q else np.nan for i in range(k)]
    mean[:q], mean[-q:] = [v[: 2 * q].mean()] * q, [v[-2 * q :].mean()] * q
    change = np.abs([mean[i + q] - mean[i] for i in range(k - q)])
    calm = change < 0.05 * change.max()
    middles = [i + 3 * q for i in range(k - 6 * q + 1) if calm[i : i + 5 * q].all()]
    exact = [v[i + q] - 2 * v[i] + v[i - q] for i in middles]
    assert 20 < len(exact) < k - 6 * q
    np.testing.assert_allclose(laid.calm_second_differences(v, q), exact, rtol=1e-12, atol=1e-15)


def test_noise_is_estimated_from_twenty_calm_half_scales_on():
    q, dt = 4, 1e-6
    expected = {}
    for k in range(8 * q - 3, 60 * q):
        v = a_noisy_wave(k)[:, None]
        result = laid.noise_between_waves(dt * np.arange(k), v, 2 * q * dt)
        parts = laid.calm_second_differences(v[:, 0], q) if k > 8 * q else np.zeros(0)
        expected[len(parts)] = result is not None
        if result is not None:
            assert result / np.sqrt(np.mean(parts**2) / 6) == pytest.approx(1.0)
    assert all(has_noise == (size >= 20 * q) for size, has_noise in expected.items())
    assert {20 * q - 1, 20 * q} <= expected.keys()
    many = np.zeros((8 * q + 1, 30)) + (np.arange(8 * q + 1) == 8 * q)[:, None]
    assert laid.noise_between_waves(dt * np.arange(8 * q), many[1:], 2 * q * dt) is None
    assert laid.noise_between_waves(dt * np.arange(8 * q + 1), many, 2 * q * dt) == 0.0
    t, v = dt * np.arange(200), a_noisy_wave(200)[:, None]
    assert laid.noise_between_waves(t, v, 0.0) == laid.noise_between_waves(t, v, 2 * dt)


def test_signals_of_a_subset_of_spheres():
    full = Signals(T, np.ones((400, 3)) * [1, 2, 3], (4, 6, 9), np.array([0.1, 0.2, 0.3]))
    subset = full.only([2, 0])
    assert subset.spheres == (9, 4) and list(subset.spread) == [0.3, 0.1]
    assert subset.names == ("10", "5")
    assert list(subset.v[0]) == [3, 1] and full.names == ("5", "7", "10")


# --- the model -----------------------------------------------------------------------------------

RECORD = np.arange(0, 2.4e-4, 2e-6)


def a_model(parameters=None, filters=NO_FILTER, record=RECORD, rig=None):
    blank = Signals(record, np.zeros((len(record), 2)), (0, 2), np.full(2, np.nan))
    parameters = every_kind()[:1] + every_kind()[3:6] if parameters is None else parameters
    return ChainForward(
        a_rig()._replace(trigger=1e-5) if rig is None else rig, parameters, blank, filters
    )


def test_a_model_shows_the_march_from_its_trigger_on():
    model = a_model()
    at = rig_at(model.rig, model.parameters, model.start)
    result = model.velocities(model.start)
    assert at.trigger == model.touch == 2e-5
    assert a_model(()).touch == 1e-5
    run = dem.march(at.chain, at.wall, at.v0, duration=RECORD[-1], dt=1e-7, n_save=240)
    late = np.searchsorted(RECORD, 2e-5)
    signals = np.array([np.interp(RECORD - 2e-5, run.t, run.v[:, i]) for i in (0, 2)]).T
    np.testing.assert_allclose(result, signals, atol=1e-4)  # linear between saves
    np.testing.assert_allclose(result[:late], at.v0[[0, 2]] * np.ones((late, 1)), atol=1e-12)
    assert result.shape == (len(RECORD), 2) and np.ptp(result[:, 1]) > 0.01
    np.testing.assert_allclose(model.velocities(model.start, 50), result[:50], atol=1e-6)


@pytest.mark.parametrize("filters", [NO_FILTER, Filter(band=9e4)])
def test_velocities_of_the_model_leave_it_no_misfit_behind_a_filter_of_both(filters):
    plain = a_model()
    v = plain.velocities(plain.start)
    signals = a_model(filters=filters)
    signals.signals = signals.signals._replace(v=v)
    assert max(signals.misfits(plain.start).values()) < 1e-12
    signals.signals = signals.signals._replace(v=v + [0.0, 1e-3])
    np.testing.assert_allclose(list(signals.misfits(plain.start).values()), [0, 1e-3], atol=1e-12)


@pytest.mark.parametrize("filters", [NO_FILTER, Filter(band=9e4), Filter(instrument=6e4)])
def test_sensitivities_of_a_model_are_its_derivatives(filters):
    model = a_model(filters=filters)
    theta = model.start * 1.02
    v, dv = model.velocities_and_sensitivities(theta)
    np.testing.assert_array_equal(v, model.velocities(theta))
    assert v.shape == (len(RECORD), 2) and dv.shape == (len(RECORD), 2, len(theta))
    for j, p in enumerate(model.parameters):
        h = 1e-4 * p.start * np.eye(len(theta))[j]
        numeric = (model.velocities(theta + h) - model.velocities(theta - h)) / (2 * h[j])
        size = np.abs(numeric).max()
        assert np.quantile(np.abs(dv[:, :, j] - numeric), 0.95) < 1e-4 * size, p.name


@pytest.mark.parametrize("filters", [NO_FILTER, Filter(band=9e4, instrument=6e4)])
def test_a_model_is_the_same_on_a_clock_that_started_earlier(filters):
    model = a_model(filters=filters)
    late = [p._replace(low=p.low + 0.25) if p.kind == "trigger" else p for p in model.parameters]
    later = a_model(late, filters, RECORD + 0.25)
    theta = model.start + [0.25 * (p.kind == "trigger") for p in model.parameters]
    first, second = (m.velocities_and_sensitivities(at) for m, at in
                  ((model, model.start), (later, theta)))  # fmt: skip
    assert later.duration == pytest.approx(model.duration, rel=1e-9)
    for these, those in zip(first, second, strict=True):
        size = np.abs(these).max(axis=(0, 1))
        assert np.quantile(np.abs(these - those), 0.98, axis=(0, 1)).max() < 1e-6 * size.max()
    later_misfits, misfits = later.misfits(theta), model.misfits(model.start)
    np.testing.assert_allclose(list(later_misfits.values()), list(misfits.values()), rtol=1e-6)
    for steps in (1.0, 3.0):
        wide = [m.coarser(steps).signals.t for m in (model, later)]
        np.testing.assert_allclose(wide[1] - 0.25, wide[0], atol=1e-12)


@pytest.mark.parametrize(("share", "possible"), [(0.99, False), (1.01, True)])
def test_a_record_goes_on_for_two_steps_after_the_first_touch(share, possible):
    """Four steps with the two that a march goes beyond it."""
    rig = a_rig()._replace(trigger=2e-5)
    t = 2e-5 + share * 2 * a_model(()).dt * np.array([-1.0, 0.0, 1.0])
    if possible:
        assert a_model((), record=t, rig=rig).velocities(np.zeros(0)).shape == (3, 2)
        return
    with pytest.raises(CouplingError, match="ends before the first touch"):
        a_model((), record=t, rig=rig)


def test_refined_times_hold_the_given_ones_and_equal_steps_between():
    fine = refined(RECORD, 3)
    np.testing.assert_allclose(fine[::3], RECORD, rtol=1e-14)
    np.testing.assert_allclose(np.diff(fine), 2e-6 / 3, rtol=1e-9)
    assert refined(RECORD, 1) is RECORD


def test_an_instrument_delays_a_model_by_its_filter_and_its_lag():
    """Slow motion is later by DELAY / omega."""
    slow = a_rig()._replace(trigger=1e-5, v0=np.array([3e-3, 0.0, 0.0]))
    t = np.arange(0, 2e-3, 2e-6)
    plain, signals = (a_model((), f, t, slow) for f in (NO_FILTER, Filter(instrument=3e4)))
    none = np.zeros(0)
    lag = lag_of(t, signals.velocities(none), plain.velocities(none))
    assert lag == pytest.approx(laid.DELAY / (2 * np.pi * 3e4), rel=0.02)


def test_a_model_knows_its_scales_and_what_a_window_needs():
    model = a_model()
    first = rig_at(model.rig, model.parameters, model.start)
    usual = sensitivities.usual_step(first.chain, first.wall, first.v0)
    assert model.dt == usual and model.with_steps(0.5).dt == 0.5 * usual
    assert model.time_scale == sensitivities.STEPS_PER_TIME_SCALE * usual
    lowest = 0.1 * 2e-5
    assert model.duration == pytest.approx(RECORD[-1] - lowest + 2 * usual, rel=1e-12)
    windows = np.zeros((len(RECORD), 2), bool)
    windows[10:40, 1] = windows[5:31, 0] = True
    assert model.needed(windows) == 40
    assert a_model(filters=Filter(band=9e4)).needed(windows) == len(RECORD)
    stride = int(0.15 * model.time_scale / 2e-6)
    fine = a_model(record=np.arange(0, 2.4e-4, 2e-7)).coarser(2.0)
    assert stride <= 1 < fine.signals.t[1] / 2e-7 <= 0.15 * model.time_scale / 2e-7
    assert fine.dt == 2.0 * usual and fine.signals.v.shape == (len(fine.signals.t), 2)
    off = a_model().misfits(model.start)
    rms_of = np.sqrt(np.mean(model.velocities(model.start) ** 2, axis=0))
    assert list(off) == ["1", "3"]
    np.testing.assert_allclose(list(off.values()), rms_of, rtol=1e-12)
    with pytest.raises(CouplingError, match="ends before the first touch"):
        a_model((), record=RECORD[:4], rig=a_rig()._replace(trigger=2e-5))
