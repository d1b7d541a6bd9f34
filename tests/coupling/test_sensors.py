"""Sensors on a chain: what a band passes, what a bead measures, what a record holds."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.signal import butter, freqs

from beadwave.coupling.band import Band, filtered
from beadwave.coupling.errors import CouplingError
from beadwave.coupling.sensors import (
    QUANTITIES,
    Sensor,
    echo,
    instants,
    mean_force,
    measured,
    quantised,
    recorded,
    sensed_waves,
    signals,
)
from beadwave.dem import march_to_error, rigid_wall, row_of_spheres
from beadwave.dem.waves.arrivals import Arrival
from beadwave.dem.waves.labels import Label, labels
from beadwave.dem.waves.tracks import wave_tracks

SPEED, COUNT, BEAD = 0.3, 20, 9
BANDS = {
    "lowpass": Band(20e3, None, 4),
    "highpass": Band(None, 3e3, 2),
    "bandpass": Band(50e3, 500.0, 3),
}


@pytest.fixture(scope="module")
def run():
    chain = row_of_spheres(0.0095, 7800.0, 193e9, 0.3, count=COUNT)
    v0 = SPEED * (np.arange(COUNT) == 0)
    result = march_to_error(chain, rigid_wall(), v0, duration=1.6e-3, error=1e-6, n_save=3200)
    return chain, result.trajectory


@pytest.mark.parametrize("kind", BANDS)
def test_a_sine_passes_as_the_analogue_filter_says(kind):
    band, f = BANDS[kind], 10e3
    t = np.arange(20001) * 1e-6
    noted = filtered(band, t, np.sin(2 * np.pi * f * t))
    ends = 2 * np.pi * np.array([end for end in (band.high_pass, band.low_pass) if end])
    b, a = butter(band.order, ends if len(ends) == 2 else ends[0], kind, analog=True)
    H = freqs(b, a, [2 * np.pi * f])[1][0]
    late = t > 15e-3  # what the start has left is gone by exp(-45)
    steady = (H * np.exp(2j * np.pi * f * t)).imag
    # a spline through 100 samples a period is off by (2 pi / 100)^4 / 384 = 4e-8
    assert np.abs(noted - steady)[late].max() < 2e-7


def test_a_band_is_at_rest_before_the_signal():
    t = np.linspace(0.0, 1e-3, 101)
    constant = np.full((101, 2), 3.0)
    assert np.abs(filtered(BANDS["lowpass"], t, constant) - constant).max() < 1e-11
    assert np.abs(filtered(BANDS["bandpass"], t, constant)).max() < 1e-11


def test_the_impulse_of_a_bead_is_the_momentum_ahead_of_its_middle(run):
    chain, trajectory = run
    force = mean_force(trajectory.contact_force, BEAD)
    gone = int(force[: force.size // 2].argmax() + 120)  # 60 us after its crest, before the wall
    impulse = np.trapezoid(force[:gone], trajectory.t[:gone])
    v = trajectory.v[gone - 1]
    momentum = chain.mass[0] * (0.5 * v[BEAD] + v[BEAD + 1 :].sum())
    assert momentum > chain.mass[0] * SPEED  # the striker recoils
    assert impulse == pytest.approx(momentum, rel=1e-4)


def test_a_force_rate_is_the_slope_of_the_force_and_the_velocity_that_of_the_displacement(run):
    t, x, v, F = run[1][:4]
    rate, way, speed = (Sensor(BEAD, q) for q in ("force-rate", "displacement", "velocity"))
    result = measured((rate, way, speed), t, x + 1e-3, v, F)  # wherever it rests
    assert result[0, 1] == 0.0
    inside = slice(2, -2)
    slope = np.gradient(mean_force(F, BEAD), t)
    assert np.abs(result[:, 0] - slope)[inside].max() < 5e-3 * np.abs(slope).max()
    assert np.abs(np.gradient(result[:, 1], t) - result[:, 2])[inside].max() < 1e-4 * SPEED


def test_signals_are_linear_in_the_run(run):
    t, x, v, F = run[1][:4]
    sensors = (Sensor(BEAD, "force", 2e-3, Band(50e3)), Sensor(3, "velocity", 1.0, Band(None, 1e3)))
    at = instants(t, 2e6)
    rng = np.random.default_rng(0)
    other = tuple(part * rng.uniform(0.5, 1.5, part.shape[1:]) for part in (x, v, F))

    def noted(*parts):
        return signals(sensors, t, measured(sensors, t, *parts), at)

    both = noted(*(a + 2.0 * b for a, b in zip((x, v, F), other, strict=True)))
    assert np.abs(both - noted(x, v, F) - 2.0 * noted(*other)).max() < 1e-12 * np.abs(both).max()
    stacked = noted(*(np.stack([a, b], axis=-1) for a, b in zip((x, v, F), other, strict=True)))
    assert np.abs(stacked[..., 1] - noted(*other)).max() < 1e-12 * np.abs(stacked).max()
    assert at.size == 3201 and stacked.shape == (3201, 2, 2)


def test_a_record_holds_steps_of_its_range_and_its_noise():
    rng = np.random.default_rng(1)
    y = rng.uniform(-1.0, 1.0, (20000, 1))
    coarse = quantised(y, 8, np.array([2.0]))
    assert np.abs(coarse - y).max() <= 0.5 * 2.0 / 2**7 * (1 + 1e-12)
    assert np.allclose(coarse * 2**7 / 2.0, np.round(coarse * 2**7 / 2.0), atol=1e-12)
    assert quantised(y, 8, np.array([0.5])).max() == 0.5 * (1 - 2**-7)
    fitting = recorded((Sensor(0, "force"),), y, bits=8)
    assert np.abs(fitting - y).max() <= 0.5 * np.abs(y).max() / (2**7 - 1) * (1 + 1e-12)
    noisy = recorded((Sensor(0, "force", noise=0.05),), y, seed=3)
    # the rms of 20000 draws is known to 1 / sqrt(40000)
    assert np.std(noisy - y) == pytest.approx(0.05 * np.abs(y).max(), rel=0.025)
    assert np.array_equal(noisy, recorded((Sensor(0, "force", noise=0.05),), y, seed=3))


@pytest.mark.parametrize("gain", [3e-3, -3e-3])
def test_waves_are_found_in_every_quantity_behind_a_coarse_instrument(run, gain):
    chain, trajectory = run
    t, x, v, F = trajectory[:4]
    sensors = [Sensor(BEAD, q, gain) for q in QUANTITIES]
    at = instants(t, 2e6)
    y = recorded(sensors, signals(sensors, t, measured(sensors, t, x, v, F), at), bits=12)
    tracks = wave_tracks(t, v, F, chain.mass, chain.A)
    named = labels(tracks, t, v[:, BEAD], BEAD + 1)
    for i, sensor in enumerate(sensors):
        delay, ratio = echo(sensed_waves(sensor, at, y[:, i], named))
        assert delay == pytest.approx(delay_of(named), abs=1e-6)
        assert ratio == pytest.approx(1.0, abs=0.05)


def delay_of(named):
    return named[1].arrival.time - named[0].arrival.time


# --- crests of synthetic waves -------------------------------------------------------------------

STEP, WIDTH = 1e-6, 40e-6
AT = 2e-4 + STEP * np.arange(500)
TIMES = (3.1e-4, 4.47e-4, 5.6e-4)
HEIGHTS = (1.0, -0.7, 0.4)


def named(times=TIMES, width=WIDTH, speeds=HEIGHTS):
    names = ("incident", "reflected 1", "incident 2")
    each = zip(names, times, speeds, strict=False)
    return [Label("", 1, name, Arrival(t, v, width), True) for name, t, v in each]


def parabolas(times=TIMES, heights=HEIGHTS, half=35e-6):
    """Of their own crests and zero beyond half their length."""
    crests = [h * np.maximum(1 - ((AT - t) / half) ** 2, 0.0)
              for t, h in zip(times, heights, strict=True)]  # fmt: skip
    return np.sum(crests, axis=0)


@pytest.mark.parametrize("late", [0.0, 2.3e-6, -5.1e-6])
@pytest.mark.parametrize("quantity", ["force", "velocity"])
@pytest.mark.parametrize("gain", [1.0, -4.0])
def test_a_wave_is_the_top_of_the_parabola_through_it(quantity, late, gain):
    """Time and height are exact where the crest is a parabola; forces press on either way."""
    heights = np.abs(HEIGHTS) if quantity == "force" else HEIGHTS
    shown = gain * parabolas(np.array(TIMES) + late, heights)
    result = sensed_waves(Sensor(0, quantity, gain), AT, shown, named())
    assert [wave.name for wave in result] == ["incident", "reflected 1", "incident 2"]
    for wave, time, height in zip(result, TIMES, heights, strict=True):
        assert wave.time == pytest.approx(time + late, abs=1e-12)
        assert wave.height == pytest.approx(abs(gain) * height, rel=1e-9)
    delay, ratio = echo(result)
    assert (delay, ratio) == (result[1].time - result[0].time, pytest.approx(0.7, rel=1e-9))
    assert echo(result[:1]) == echo(result[1:]) == echo(()) == (None, None)


def test_a_force_is_summed_from_its_rate_and_a_velocity_is_the_slope_of_a_displacement():
    """By trapezoids, and over as many samples as a crest has to both sides: 6 of 40."""
    force = parabolas(heights=np.abs(HEIGHTS))
    rate = np.gradient(force, STEP)
    result = sensed_waves(Sensor(0, "force-rate"), AT, rate, named())
    mean = np.r_[0, np.cumsum((rate[1:] + rate[:-1]) / 2) * STEP]
    # sums of 500 terms of at most one: 500 eps
    np.testing.assert_allclose(
        QUANTITIES["force-rate"].crested(rate, STEP, 6), mean, rtol=1e-12, atol=1e-13
    )
    for wave, time, height in zip(result, TIMES, np.abs(HEIGHTS), strict=True):
        assert wave.time == pytest.approx(time, abs=2e-7)
        assert wave.height == pytest.approx(height, rel=5e-3)
    way = np.r_[0, np.cumsum(parabolas())] * STEP
    slopes = QUANTITIES["displacement"].crested(way[:-1], STEP, 6)
    inside = (way[12:-1] - way[:-13]) / (12 * STEP)
    np.testing.assert_allclose(slopes[6:-6], inside, rtol=1e-12)
    first = [(way[i + 6] - way[0]) / (12 * STEP) for i in range(6)]
    np.testing.assert_allclose(slopes[:6], first, rtol=1e-12, atol=1e-12)
    result = sensed_waves(Sensor(0, "displacement"), AT, way[:-1], named())
    assert [np.sign(wave.height) for wave in result] == [1, -1, 1]
    assert result[0].time == pytest.approx(TIMES[0] + STEP / 2, abs=3e-7)


def test_a_wave_is_sought_within_its_own_time_alone():
    """From 0.7 widths before to 1.3 after; not at the ends of that, nor nearer to another wave."""
    sensor = Sensor(0, "force")

    def result(at, times=TIMES[:1], half=20e-6, **others):
        noted = sensed_waves(sensor, AT, parabolas((at,), (1.0,), half), named(times, **others))
        return [wave.name for wave in noted]

    reach = 6e-6  # samples of the parabola must lie inside
    early, late = TIMES[0] - 0.7 * WIDTH + reach, TIMES[0] + 1.3 * WIDTH - reach
    for inside, outside in ((early + 2e-6, early - 2e-6), (late - 2e-6, late + 2e-6)):
        assert result(inside) == ["incident"] and result(outside) == []
    close = (TIMES[0], TIMES[0] + 0.8 * WIDTH)
    border = TIMES[0] + 0.4 * WIDTH
    assert result(border - reach - 2e-6, close, half=9e-6) == ["incident"]
    assert result(border + reach + 2e-6, close, half=9e-6) == ["reflected 1"]
    assert result(TIMES[0], (TIMES[0] - 2e-7, TIMES[0], TIMES[0] + 2e-7), half=9e-6) == []
    assert result(TIMES[0], width=np.nan) == [] and result(TIMES[0], ()) == []
    assert sensed_waves(sensor, AT, np.zeros(500), named()) == ()
    assert sensed_waves(sensor, AT, -parabolas(heights=np.abs(HEIGHTS)) - 1e-3, named()) == ()


WHOLE = np.arange(200.0)  # [s]: the limits of a wave of 20 s are whole numbers


def complete(noted, quantity="force", at=100.0, width=20.0, gain=1.0):
    label = Label("", 1, "incident", Arrival(at, 1.0, width), True)
    return sensed_waves(Sensor(0, quantity, gain), WHOLE, noted, [label])


@pytest.mark.parametrize(("crest", "shown"), [(90, False), (91, True), (121, True), (122, False)])
def test_a_crest_and_what_lies_3_samples_beside_it_must_lie_within_the_limits(crest, shown):
    """From 0.7 widths before to 1.3 after, limits excluded, nor may the first and last be used."""
    result = complete(np.maximum(1 - ((WHOLE - crest) / 9) ** 2, 0.0))
    assert [wave.time for wave in result] == [pytest.approx(crest)] * shown
    assert [wave.height for wave in result] == [pytest.approx(1.0)] * shown


def test_the_parabola_is_that_of_least_squares_through_3_samples_to_both_sides():
    """Of a crest that is none, in seconds: sum of y, y u and y u^2 over -3 <= u <= 3."""
    u = np.arange(-3, 4)
    noted = np.exp(-(((WHOLE - 101.1) / 4) ** 2)) * (1 + 0.03 * (WHOLE - 100))
    y = noted[101 + u]
    assert noted.argmax() == 101
    a = (y @ u**2 - 4 * y.sum()) / 84  # of a u^2 + b u + c
    b, c = y @ u / 28, (7 * y.sum() - y @ u**2) / 21
    (result,) = complete(-2.5 * noted, gain=-1.0)
    assert result.time == pytest.approx(101 - b / (2 * a), rel=1e-9)
    assert result.height == pytest.approx(2.5 * (c - b**2 / (4 * a)), rel=1e-9)


def test_a_narrow_wave_has_a_sample_to_both_sides():
    noted = np.maximum(1 - ((WHOLE - 100) / 3) ** 2, 0.0)
    (result,) = complete(noted, width=3.0)
    assert (result.time, result.height) == (pytest.approx(100.0), pytest.approx(1.0))


def test_what_presses_nowhere_or_is_hollow_is_no_crest():
    bump = np.maximum(1 - ((WHOLE - 100) / 9) ** 2, 0.0)
    assert complete(bump - 1.0) == () and len(complete(bump - 0.9)) == 1
    hollow = 0.001 * (WHOLE - 100) ** 2 * (np.abs(WHOLE - 100) < 4)
    hollow[100] = 0.02  # above its 0.009 at the ends, and all of it opens upwards
    assert complete(hollow) == ()


# --- instruments ---------------------------------------------------------------------------------


def test_a_sphere_feels_the_mean_of_its_two_contacts_beyond_that_at_the_start():
    F = np.random.default_rng(2).uniform(1.0, 2.0, (5, 3))
    for sphere, exact in enumerate((F[:, 0], F[:, 0] + F[:, 1], F[:, 1] + F[:, 2], F[:, 2])):
        np.testing.assert_allclose(mean_force(F, sphere), (exact - exact[0]) / 2, atol=1e-15)


def test_sensors_measure_what_their_spheres_do_from_the_first_instant():
    """x less that at the start, v as it is, half of both forces, and the slope of their spline."""
    t = np.array([1.0, 1.5, 2.0, 2.5, 3.0])
    x, v, F = np.random.default_rng(4).uniform(1.0, 2.0, (3, 5, 4))
    force = ((F[:, 1] + F[:, 2]) - (F[0, 1] + F[0, 2])) / 2
    kinds = (("displacement", 3), ("velocity", 1), ("force", 2), ("force-rate", 2))
    result = measured([Sensor(i, kind, 7.0) for kind, i in kinds], t, x, v, F)
    slope = CubicSpline(t, force).derivative()(t)
    exact = np.column_stack([x[:, 3] - x[0, 3], v[:, 1], force, slope])
    np.testing.assert_allclose(result, exact, rtol=1e-12, atol=1e-14)


def test_instants_are_as_many_as_a_run_holds():
    for end, count in ((1.0, 11), (0.9999, 10), (1.0001, 11)):
        t = 5.0 + np.linspace(0, end, 7)
        result = instants(t, 10.0)
        np.testing.assert_allclose(result, 5.0 + 0.1 * np.arange(count), rtol=1e-14)


def test_bits_reach_from_minus_the_range_to_one_step_below_it():
    y = np.array([[-9.0, -1.0, 0.26, 0.24, 0.9, 9.0]]).T
    result = quantised(y, 3, np.array([1.0]))
    np.testing.assert_allclose(result[:, 0], [-1.0, -1.0, 0.25, 0.25, 0.75, 0.75])
    assert not quantised(0 * y, 3, np.zeros(1)).any()
    sensors = (Sensor(0, "force", range=2.0), Sensor(1, "force"))
    both = recorded(sensors, np.hstack([y, y]) / 9.0, bits=3)
    np.testing.assert_allclose(both[:, 0], quantised(y / 9.0, 3, np.array([2.0]))[:, 0])
    top = 1 / (1 - 2.0**-2)
    np.testing.assert_allclose(both[:, 1], quantised(y / 9.0, 3, np.array([top]))[:, 0])
    assert both[-1, 1] == pytest.approx(1.0)


def test_a_sensor_of_an_unknown_quantity_is_refused():
    still = np.zeros((4, 2))
    with pytest.raises(
        CouplingError, match=f"'force_rate' is unknown; take one of {', '.join(QUANTITIES)}"
    ):
        measured([Sensor(0, "force_rate")], np.arange(4.0), still, still, still)
