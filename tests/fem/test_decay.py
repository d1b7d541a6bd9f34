"""Damping over the amplitude of a decay beside an exact one."""

import numpy as np
import pytest

from beadwave.fem.identification.decay import over_amplitude, varies

DT = 1 / 4096
T = DT * np.arange(3 * 4096)


def decay(hz, zeta, slip):
    """Amplitude of a' = -omega (zeta + slip a) a from 1 on, and the motion."""
    e = np.exp(-2 * np.pi * hz * zeta * T)
    a = zeta * e / (zeta + slip * (1 - e))
    return a * np.cos(2 * np.pi * hz * T)


@pytest.fixture(scope="module")
def record():
    """Two modes at three sensors, the damping of the first one grows with its amplitude; noise."""
    rng = np.random.default_rng(0)
    phi = rng.normal(size=(3, 2))
    y = np.outer(phi[:, 0], decay(120.0, 0.002, 0.004)) + np.outer(
        phi[:, 1], decay(300.0, 0.003, 0.0)
    )
    return y + 0.002 * rng.normal(size=y.shape), phi.astype(complex)


def test_damping_that_grows_with_amplitude_is_that_of_the_equation_of_motion(record):
    """zeta + slip a at each amplitude, to 5 %; the deviations are 1 to 3 %."""
    y, phi = record
    steps = over_amplitude(y, DT, np.array([120.0, 300.0]), phi, 0)
    assert steps[0].amplitude > 10 * steps[-1].amplitude and varies(steps)
    for step in steps:
        assert step.zeta == pytest.approx(0.002 + 0.004 * step.amplitude, rel=0.05)
        assert step.frequency_hz == pytest.approx(120.0, abs=0.02)


def test_damping_of_a_linear_mode_does_not_vary(record):
    y, phi = record
    steps = over_amplitude(y, DT, np.array([120.0, 300.0]), phi, 1)
    assert len(steps) >= 3 and not varies(steps)
    assert np.median([step.zeta for step in steps]) == pytest.approx(0.003, rel=0.02)


def test_a_mode_in_the_noise_has_no_steps(record):
    _, phi = record
    noise = np.random.default_rng(1).normal(size=(3, len(T)))
    assert over_amplitude(noise, DT, np.array([120.0, 300.0]), phi, 0) == []
    assert not varies([])
