"""Sensors on a chain: what a band passes, what a bead measures, what a record holds."""

import numpy as np
import pytest
from scipy.signal import butter, freqs

from coupling.band import Band, filtered
from coupling.sensed_waves import flight, sensed_waves
from coupling.sensors import (
    Sensor,
    instants,
    mean_force,
    measured,
    quantised,
    recorded,
    signals,
)
from dem import march_to_error, rigid_wall, row_of_spheres
from dem.waves.labels import labels
from dem.waves.tracks import wave_tracks

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
    found = march_to_error(chain, rigid_wall(), v0, duration=1.6e-3, error=1e-6, n_save=3200)
    return chain, found.trajectory


@pytest.mark.parametrize("kind", BANDS)
def test_a_sine_passes_as_the_analogue_filter_says(kind):
    band, f = BANDS[kind], 10e3
    t = np.arange(20001) * 1e-6
    seen = filtered(band, t, np.sin(2 * np.pi * f * t))
    ends = 2 * np.pi * np.array([end for end in (band.high_pass, band.low_pass) if end])
    b, a = butter(band.order, ends if len(ends) == 2 else ends[0], kind, analog=True)
    H = freqs(b, a, [2 * np.pi * f])[1][0]
    late = t > 15e-3  # what the start has left is gone by exp(-45)
    steady = (H * np.exp(2j * np.pi * f * t)).imag
    # a spline through 100 samples a period is off by (2 pi / 100)^4 / 384 = 4e-8
    assert np.abs(seen - steady)[late].max() < 2e-7


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


def test_a_force_rate_is_the_slope_of_the_force_and_a_displacement_that_of_nothing(run):
    t, x, v, F = run[1][:4]
    rate, way, speed = (Sensor(BEAD, q) for q in ("force-rate", "displacement", "velocity"))
    found = measured((rate, way, speed), t, x + 1e-3, v, F)  # wherever it rests
    assert found[0, 1] == 0.0
    inside = slice(2, -2)
    slope = np.gradient(mean_force(F, BEAD), t)
    assert np.abs(found[:, 0] - slope)[inside].max() < 5e-3 * np.abs(slope).max()
    assert np.abs(np.gradient(found[:, 1], t) - found[:, 2])[inside].max() < 1e-4 * SPEED


def test_signals_are_linear_in_the_run(run):
    t, x, v, F = run[1][:4]
    sensors = (Sensor(BEAD, "force", 2e-3, Band(50e3)), Sensor(3, "velocity", 1.0, Band(None, 1e3)))
    at = instants(t, 2e6)
    rng = np.random.default_rng(0)
    other = tuple(part * rng.uniform(0.5, 1.5, part.shape[1:]) for part in (x, v, F))

    def seen(*parts):
        return signals(sensors, t, measured(sensors, t, *parts), at)

    both = seen(*(a + 2.0 * b for a, b in zip((x, v, F), other, strict=True)))
    assert np.abs(both - seen(x, v, F) - 2.0 * seen(*other)).max() < 1e-12 * np.abs(both).max()
    stacked = seen(*(np.stack([a, b], axis=-1) for a, b in zip((x, v, F), other, strict=True)))
    assert np.abs(stacked[..., 1] - seen(*other)).max() < 1e-12 * np.abs(stacked).max()
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
    sensors = [Sensor(BEAD, q, gain) for q in ("force", "force-rate", "velocity", "displacement")]
    at = instants(t, 2e6)
    y = recorded(sensors, signals(sensors, t, measured(sensors, t, x, v, F), at), bits=12)
    tracks = wave_tracks(t, v, F, chain.mass, chain.A)
    named = labels(tracks, t, v[:, BEAD], BEAD + 1)
    for i, sensor in enumerate(sensors):
        tof, arr = flight(sensed_waves(sensor, at, y[:, i], named))
        assert tof == pytest.approx(flight_of(named), abs=1e-6)
        assert arr == pytest.approx(1.0, abs=0.05)


def flight_of(named):
    return named[1].arrival.time - named[0].arrival.time
