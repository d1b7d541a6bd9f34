"""Derivatives, alignment and bars of a calibration; and that it finds a known rig."""

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from beadwave import dem
from beadwave.workflows.fit.aligned_signals import (
    Filter,
    Signals,
    aligned,
    first_waves_end,
    noise_between_waves,
)
from beadwave.workflows.fit.chain_fit import calibrate, widened
from beadwave.workflows.fit.forward import ChainForward
from beadwave.workflows.fit.marched_system import Rig
from beadwave.workflows.fit.model_errors import BetterModel
from beadwave.workflows.fit.parameter import Parameter
from beadwave.workflows.fit.uncertainty import uncertainty
from beadwave.workflows.fit.windows import CoarseToFine, Options

N = 6
T = np.arange(0, 6e-4, 1e-6)


def rig(wall_hz=900.0):
    chain = dem.row_of_spheres(
        0.0127, 7800.0, 210e9, 0.3, count=N, preload=5.0, dissipation="hunt-crossley", gamma=0.02
    )
    wall = dem.one_dof_wall(wall_hz, 0.5, 0.05)
    v0 = np.array([0.31] + [0.0] * (N - 1))
    return Rig(chain, wall, v0, np.ones((1, 1)))


def contact(i):
    return Parameter(f"contact {i + 1}", "contact", 1.0, 0.2, 5.0, 0.1, "", i)


def named(kind, start, scale):
    return Parameter(kind, kind, start, start - 5 * scale, start + 5 * scale, scale)


EVERY = (
    contact(1), contact(N - 1), named("preload", 5.0, 0.5), named("dissipation", 0.02, 0.003),
    named("striker", 0.31, 0.03), named("trigger", 2e-5, 3e-6), named("frequency", 900.0, 90.0),
    named("mass", 0.5, 0.05), named("damping", 0.05, 0.009),
)  # fmt: skip


def blank(spheres=(0, 3)):
    m = len(spheres)
    return Signals(T, np.zeros((len(T), m)), spheres, np.full(m, np.nan))


@pytest.mark.slow
def test_derivatives_hold_through_trigger_and_filters():
    """Central differences of order 4 over 1e-4 of a scale: 1e-16 / 1e-4 of rounding, and what a
    contact that opens has in its second derivative; 1e-6 is asked for."""
    filters = Filter(band=120e3, instrument=80e3)
    forward = ChainForward(rig(), EVERY, blank(), filters)
    theta = forward.start
    _, exact = forward.velocities_and_sensitivities(theta)
    for j, p in enumerate(EVERY):
        h = 1e-4 * p.scale * np.eye(len(EVERY))[j]
        v = {s: forward.velocities(theta + s * h) for s in (-2, -1, 1, 2)}
        difference = (8 * (v[1] - v[-1]) - (v[2] - v[-2])) / (12 * h[j])
        size = np.abs(exact[:, :, j]).max()
        kinks = np.abs(difference - exact[:, :, j]) / size
        assert np.quantile(kinks, 0.98) <= 1e-6, p.name
        assert kinks.max() <= 1e-3, p.name


@pytest.mark.slow
def test_repeats_are_moved_onto_each_other():
    """Noise of 1e-3 m/s on slopes of 4e3 m/s^2 over 200 samples leaves 20 ns each."""
    rng, late = np.random.default_rng(0), np.array([0.0, 7.3e-6, -12.1e-6, 2.4e-6])
    forward = ChainForward(rig(), (), blank(), Filter())
    v = [forward.velocities(np.zeros(0)) for forward in (
        ChainForward(rig()._replace(trigger=8e-5 + s), (), blank()) for s in late)]  # fmt: skip
    noisy = np.array(v) + 1e-3 * rng.standard_normal((4, *v[0].shape))
    result = aligned(T, noisy, (0, 3))
    np.testing.assert_allclose(np.diff(result.shift), np.diff(late), rtol=0, atol=1e-7)
    np.testing.assert_allclose(result.signals.spread, 1e-3, rtol=0.1)
    assert result.outliers == () and forward.signals.repeats == 1


def test_a_repeat_unlike_the_others_is_left_out():
    forward = ChainForward(rig(), (), blank())
    v = np.array([forward.velocities(np.zeros(0))] * 4)
    v[2] = -v[2]
    assert aligned(T, v, (0, 3), move=False).outliers == (2,)


def test_bars_are_those_of_linear_least_squares_where_noise_is_white():
    """An autocovariance of 6000 samples and some 100 lags is known to about 13 %."""
    rng = np.random.default_rng(1)
    J = rng.standard_normal((3000, 2, 3)).cumsum(axis=0) / 30
    parameters = [contact(i)._replace(scale=s) for i, s in enumerate((1.0, 0.1, 3.0))]
    residual = 0.2 * rng.standard_normal((3000, 2))
    result = uncertainty(parameters, residual, J, np.zeros(3, bool))
    flat = J.reshape(-1, 3)
    exact = 2 * 0.2 * np.sqrt(np.diag(np.linalg.inv(flat.T @ flat)))
    np.testing.assert_allclose(result.two_sigma, exact, rtol=0.25)


def test_bars_grow_with_the_correlation_of_the_noise():
    """Noise through a low-pass weighs on slow columns as its spectrum at zero does: the bars agree
    with the scatter of 200 draws, itself known to 5 %."""
    rng, sos = np.random.default_rng(2), butter(4, 0.1, output="sos")
    t = np.linspace(0, 1, 2000)[:, None, None]
    J = np.concatenate([np.cos(3 * t), np.sin(5 * t)], axis=2)
    parameters = [contact(0), contact(1)]
    flat = J.reshape(-1, 2)
    draws = sosfilt(sos, rng.standard_normal((200, 2000)), axis=1)
    scatter = 2 * np.linalg.lstsq(flat, draws.T, rcond=None)[0].std(axis=1)
    bars = [
        uncertainty(parameters, draw[:, None], J, np.zeros(2, bool)).two_sigma
        for draw in draws[:20]
    ]
    np.testing.assert_allclose(np.mean(bars, axis=0), scatter, rtol=0.25)


def test_undetermined_combinations_are_named():
    J = np.random.default_rng(3).standard_normal((500, 1, 3))
    J[:, :, 2] = J[:, :, 1]
    residual = 0.1 * np.random.default_rng(4).standard_normal((500, 1))
    result = uncertainty([contact(i) for i in range(3)], residual, J, np.zeros(3, bool))
    assert np.isfinite(result.two_sigma[0]) and np.isinf(result.two_sigma[1:]).all()
    worst = result.combinations[0]
    assert np.isinf(worst.two_sigma)
    assert worst.text([contact(i) for i in range(3)]) in (
        "0.71 contact 2 - 0.71 contact 3", "0.71 contact 3 - 0.71 contact 2",
    )  # fmt: skip


@pytest.mark.parametrize("noise", [1e-4, 1e-3])
def test_noise_of_one_record_shows_between_its_waves(noise):
    """Some 390 calm samples of two spheres, each noise of its own: 4 % of ten records are 1 %, and
    the tails of waves leave 2e-6 m/s. Where no sample is calm nothing is told."""
    forward = ChainForward(rig()._replace(trigger=1e-4), (), blank())
    rng, clean = np.random.default_rng(0), forward.velocities(np.zeros(0))
    result = [
        noise_between_waves(T, clean + noise * rng.standard_normal(clean.shape), forward.time_scale)
        for _ in range(10)
    ]
    assert np.mean(result) == pytest.approx(noise, rel=0.05)
    assert noise_between_waves(T, clean + 0.1 * rng.standard_normal(clean.shape), 1e-5) is None


def test_the_first_waves_end_before_the_second_reflection():
    forward = ChainForward(rig(), (), blank((0, 2)))
    ends = first_waves_end(T, forward.velocities(np.zeros(0)), 1e-5)
    assert 3e-4 < ends[1] < ends[0] < 6e-4


def made(truth, hz, spheres, *, duration, count=N):
    """Data by the engine's own scheme, not by the model that is fitted."""
    reference = rig(hz)
    chain = reference.chain._replace(A=reference.chain.A * truth)
    t = np.arange(0, duration, 1e-6)
    run = dem.march(chain, reference.wall, reference.v0, duration=t[-1], dt=1e-7, n_save=len(t) - 1)
    return Signals(t, run.v[:, spheres], tuple(spheres), np.full(len(spheres), np.nan))


@pytest.mark.slow
def test_a_known_chain_is_found_again_without_noise():
    """0.1 % is asked for; the model's step leaves 1e-6 in the velocities and 1e-4 here."""
    truth = np.random.default_rng(5).uniform(0.9, 1.1, N)
    signals = made(truth, 700.0, [0, 3], duration=1.2e-3)
    parameters = (*map(contact, range(N)), named("frequency", 900.0, 90.0))
    parameters = (*parameters[:-1], parameters[-1]._replace(low=50.0, high=5000.0))
    options = Options(scan=(200.0, 2000.0, 12), starts=2)
    result = calibrate(rig(), parameters, signals, Filter(), options)
    np.testing.assert_allclose(result.value[:N], truth, rtol=1e-3)
    assert result.value[N] == pytest.approx(700.0, rel=1e-3)
    assert not result.at_bound.any() and all(stage.converged for stage in result.stages)


def test_a_chain_that_leaves_more_than_the_noise_is_given_up_for_another_start(monkeypatch):
    truth = np.random.default_rng(5).uniform(0.9, 1.1, N)
    signals = made(truth, 900.0, [0, 3], duration=6e-4)
    first, begins = CoarseToFine.chain_from_first_waves, []

    def astray(search, z):
        begins.append(z)
        chain, residual = first(search, z)
        return (chain, 0.1) if len(begins) == 1 else (chain, residual)

    monkeypatch.setattr(CoarseToFine, "chain_from_first_waves", astray)
    result = calibrate(rig(), tuple(map(contact, range(N))), signals)
    assert result.starts == 2 and not np.array_equal(*begins)
    np.testing.assert_allclose(result.value, truth, rtol=1e-3)


def test_bars_of_a_calibration_hold_what_a_better_wall_would_have_found():
    """Data of a wall of 900.9 Hz fitted with 900 Hz held: what the other parameters have moved by
    is the part of the wall in their bars, to first order; a share of half counts half.
    Differences of second order are below 2 %, the step's part a twentieth."""
    parameters, filters = (contact(1), named("striker", 0.31, 0.03)), Filter()
    forward = ChainForward(rig(900.9), parameters, blank(), filters)
    signals = blank()._replace(v=forward.velocities(forward.start))
    fit = calibrate(rig(), parameters, signals, filters, Options(local=True))
    model = ChainForward(rig(), parameters, signals, filters)
    own, half = (
        widened(fit, model, {"wall": [BetterModel(rig(900.9), share, beside)]})
        for share, beside in ((1.0, None), (0.5, rig()))
    )
    moved = np.abs(fit.value - forward.start)
    np.testing.assert_allclose(own.causes["wall"], moved, rtol=0.02)
    np.testing.assert_allclose(half.causes["wall"], moved / 2, rtol=0.02)
    squares = sum(part**2 for part in own.causes.values())
    np.testing.assert_allclose(own.uncertainty.two_sigma**2, squares)
    assert (own.causes["time"] < 0.1 * moved).all()
    assert (own.uncertainty.two_sigma >= moved).all()


def test_a_parameter_at_its_bound_takes_no_part_of_a_model_error():
    start = contact(1)._replace(low=1.0, start=1.0 + 1e-9)
    parameters = (start, named("striker", 0.31, 0.03))
    forward = ChainForward(rig(900.9), parameters, blank(), Filter())
    signals = blank()._replace(v=forward.velocities(np.array([0.999, 0.31])))
    fit = calibrate(rig(), parameters, signals, Filter(), Options(local=True))
    assert fit.at_bound.tolist() == [True, False]
    model = ChainForward(rig(), parameters, signals, Filter())
    wide = widened(fit, model, {"wall": [BetterModel(rig(900.9), 1.0)]})
    assert wide.causes["wall"][0] == 0.0 < wide.causes["wall"][1]
    assert len(wide.uncertainty.combinations) == 1
