"""The synthetic experiment of examples/twin.py, and its instrument on signals that are known."""

import numpy as np
import pytest

import beadwave
import twin
from beadwave import dem
from beadwave.workflows.fit import aligned_signals as laid
from beadwave.workflows.fit.aligned_signals import lag_of
from twin import OVERSAMPLED, Clean, Twin, clean_signals, measured, shown


def test_a_calibration_finds_the_known_rig_that_made_its_records(own_folder, capsys):
    """Four spheres: two of the first contacts and the trigger are found within five sigma."""
    few = {"chain.count": 4, "output.spheres": [2, 3], "time.duration": 6e-4}
    free = "contact.1,contact.2,trigger"
    found, true = twin.main(2, few, Twin(scatter=0.0, frequency=907.0, seed=2), free=free, starts=1)
    rows = found.report.parameters
    assert [row.name for row in rows] == ["contact 1", "contact 2", "trigger"]
    for row in rows:
        assert abs(row.found - true[row.name]) <= 2.5 * row.two_sigma, row.name
    printed = capsys.readouterr().out
    assert printed.startswith("SYNTHETIC") and "in 2 repeats" in printed
    assert found.report.synthetic and found.plot("parameters").png[:4] == b"\x89PNG"
    assert found.data.measured.dims == ("time", "sphere") and list(found.data.sphere) == [2, 3]
    with pytest.raises(beadwave.InvalidScene, match="--starts 0 must be between 1 and 1000"):
        beadwave.calibrate("rig-1dof", "twin.csv", starts=0)


def bumps(t):
    """Two waves of two spheres."""
    wave = [np.exp(-(((t - c) / 3e-5) ** 2)) for c in (3e-4, 6e-4)]
    return np.column_stack([wave[0] - 0.5 * wave[1], 0.8 * wave[1]])


def repeated(*arguments, **options):
    """Times (k,) and velocities (repeats, k, m) of a record."""
    record = measured(*arguments, **options)
    return record.t, record.v


def test_an_instrument_shows_a_slow_motion_in_its_time_and_a_fast_one_less():
    """Of 100 kHz: 2 kHz pass, at the clock that its lag sets right; 400 kHz do not."""
    setting = Twin(before=1e-4)
    t = np.arange(8000) / (OVERSAMPLED * setting.sampling)
    v = np.column_stack([1 - np.cos(2 * np.pi * 2e3 * t), np.sin(2 * np.pi * 4e5 * t)])
    observed = shown(v, v[0], setting, (0, 3))
    late = observed.t - setting.before
    inside = (late > 2e-4) & (late < t[-1])
    assert observed.t[0] < 1e-5 and len(observed.t) == 8000 + 400 and observed.spheres == (0, 3)
    at = late[inside] - (1 / (2 * np.pi * 1e5)) * laid.DELAY  # the instrument's own delay
    np.testing.assert_allclose(observed.v[inside, 0], 1 - np.cos(2 * np.pi * 2e3 * at), atol=2e-3)
    assert np.abs(observed.v[inside, 1]).max() < 1e-2 and not observed.v[:300].any()


def test_a_steady_rise_is_shown_later_by_the_delay_of_the_low_pass_alone():
    """-B'(0) / B(0) of its poles: the sampled filter has less, the clock makes up for the rest."""
    setting = Twin(before=1e-4)
    rise = np.arange(8000.0)[:, None] / (OVERSAMPLED * setting.sampling)
    observed = shown(rise, np.zeros(1), setting, (0,))
    later = (observed.t - setting.before - observed.v[:, 0])[-2000:]
    np.testing.assert_allclose(later * 2 * np.pi * setting.instrument / laid.DELAY, 1.0, rtol=1e-6)


def test_repeats_differ_by_jitter_and_noise_of_the_size_asked_for():
    setting = Twin(repeats=6, jitter=3e-6, noise=2e-3)
    fine = np.arange(0, 4e-3, 1 / (OVERSAMPLED * setting.sampling))
    data = Clean(fine, bumps(fine), (0, 1))
    t, v = repeated(data, setting)
    assert v.shape == (6, len(t), 2) and t[1] == pytest.approx(1e-6)
    left = data.t[-1] - t[-1] - 4 * setting.jitter
    assert -1e-12 < left < 2e-6  # no repeat ends before the record
    quiet = v[:, 2000:]
    assert quiet.std() == pytest.approx(2e-3, rel=0.05)
    late = [lag_of(t[:1000], item[:1000], bumps(t)[:1000]) for item in v]
    assert np.mean(late) == pytest.approx(0, abs=2e-7) and 1e-6 < np.std(late, ddof=1) < 6e-6
    power = np.mean(np.abs(np.fft.rfft(quiet[:, :1024, 0])) ** 2, axis=0)
    assert power[300:].mean() < 1e-2 * power[5:60].mean()  # nothing above 100 kHz
    again = repeated(data, setting)[1]
    np.testing.assert_array_equal(v, again)
    assert not np.array_equal(repeated(data, setting, run=1)[1], v)
    few = repeated(data, setting._replace(repeats=2, noise=0.0))
    np.testing.assert_array_equal(few[0], t)
    assert few[1].shape == (2, len(t), 2) and not np.allclose(*few[1], atol=1e-3)
    late = repeated(Clean(fine + 3e-6, data.v, (0, 1)), setting)
    np.testing.assert_array_equal(late[0], t)
    np.testing.assert_allclose(late[1][:, 3:], v[:, :-3], atol=1e-2)  # noise is where it was
    still = repeated(data, setting._replace(repeats=1, noise=0.0))
    np.testing.assert_allclose(still[1][0], bumps(still[0]), atol=1e-6)
    assert len(still[0]) == len(fine[::OVERSAMPLED])


def test_the_clean_signals_of_a_rig_are_its_march_as_the_instrument_shows_it():
    """By sixteen steps to a sample of the oversampled record; four samples after the filter."""
    setting = Twin(sampling=2e5, instrument=2e4)
    row = dem.row_of_spheres(0.01, 7800.0, 2e11, 0.3, count=3, preload=2.0)
    wall, v0 = dem.one_dof_wall(900.0, 0.5, 0.05), np.array([0.3, 0.01, 0.0])
    result = clean_signals(row, wall, v0, setting, (1, 3), 2.9e-4)
    n = round(2.9e-4 * 8e5)
    fine = dem.march(row, wall, v0, duration=n / 8e5, dt=1 / 8e5 / 16, n_save=n)
    exact = shown(fine.v[:, [0, 2]], v0[[0, 2]], setting, (1, 3))
    np.testing.assert_array_equal(result.t, exact.t)
    np.testing.assert_allclose(result.v, exact.v, rtol=0, atol=1e-6 * 0.3)
    assert result.spheres == (1, 3) and np.ptp(result.v, axis=0).min() > 0.05
