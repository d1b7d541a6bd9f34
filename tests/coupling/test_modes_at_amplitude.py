"""Modes at the amplitudes of a run: what drives them, where they settle, which wall they change."""

from typing import NamedTuple

import numpy as np
import pytest

from beadwave.coupling import CoupledWall
from beadwave.coupling.modes_at_amplitude import SETTLED, Backbone, amplitudes, moved, settled
from beadwave.dem import Wall

HZ = 300.0
X = np.array([1e-6, 1e-5])
CURVE = Backbone(7, HZ, 2.0, X, HZ * np.array([1.0, 0.9]), np.array([0.001, 0.05]))
WALL = Wall(2 * np.pi * np.array([HZ, 2e3]), np.array([0.01, 0.02]), np.array([1.5, 0.7]), 0.0, 0.0)


class Run(NamedTuple):
    """Times and contact forces of a run."""

    t: np.ndarray
    contact_force: np.ndarray


def pushed(force):
    """A run with a pulse of half a sine of 0.2 ms, over 20 ms."""
    t = np.linspace(0.0, 20e-3, 4001)
    F = force * np.where(t < 2e-4, np.sin(np.pi * t / 2e-4), 0.0)
    return Run(t, np.column_stack([np.zeros(len(t)), F]))


def test_a_backbone_is_linear_without_amplitude_and_keeps_its_last_values():
    none, half, most, more = (CURVE.at(x) for x in (0.0, 0.5e-6, 1e-5, 2e-5))
    assert (none.factor, none.ratio) == (1.0, 0.0)
    assert (half.factor, half.ratio) == (1.0, pytest.approx(0.00025))
    assert (most.factor, most.ratio) == (pytest.approx(0.9), pytest.approx(0.025))
    assert more.beyond and not most.beyond and more[3:5] == most[3:5]


def test_a_pulse_leaves_the_amplitude_of_its_fourier_transform():
    """Undamped, after the pulse: |phi int F e^(i omega t) dt| / omega, constant in time."""
    wall = WALL._replace(zeta=np.zeros(2))
    most, end = amplitudes(wall, pushed(10.0))
    width, omega = 2e-4, wall.omega
    integral = 2 * np.pi * width * np.cos(omega * width / 2) / (np.pi**2 - (omega * width) ** 2)
    exact = np.abs(10.0 * wall.phi * integral) / omega
    # a run has the pulse every 5 us, of which the ends are not smooth: (5 us / 0.2 ms)^2 / 2
    np.testing.assert_allclose(end, exact, rtol=3.2e-4)
    assert np.all(most >= end * (1 - 1e-12))


def test_the_moved_mode_alone_has_another_frequency_and_more_damping():
    mode = CURVE.at(1e-5)
    wall = moved(WALL, [mode])
    np.testing.assert_allclose(wall.omega, WALL.omega * [0.9, 1.0])
    np.testing.assert_allclose(wall.zeta, [0.035, 0.02])
    coupled = CoupledWall(WALL.omega, np.diag(2 * WALL.zeta * WALL.omega), WALL.phi, WALL.phi, 0.0)
    of_coupled = moved(coupled, [mode])
    np.testing.assert_allclose(
        np.diag(of_coupled.D), [2 * (0.01 + 0.025 * 0.9) * WALL.omega[0], 2 * 0.02 * WALL.omega[1]]
    )
    assert moved(WALL, [mode._replace(linear_hz=450.0)]) is not WALL
    np.testing.assert_array_equal(moved(WALL, [mode._replace(linear_hz=450.0)]).omega, WALL.omega)


def test_a_run_settles_at_the_amplitude_that_it_has():
    """The force does not depend on the wall here: at the end the amplitude of the wall that the
    result moves is the one of the result, within a hundredth."""
    result = settled([CURVE], WALL, lambda wall: pushed(20.0))
    (mode,), (end,) = result.largest, result.at_end
    assert result.change < SETTLED and 2 <= result.n_marches <= 4
    most, last = amplitudes(moved(WALL, [mode]), pushed(20.0))
    assert mode.displacement == pytest.approx(2.0 * most[0], rel=SETTLED)
    assert end.displacement == pytest.approx(2.0 * last[0], rel=0.05)
    assert mode.ratio > end.ratio and mode.factor < 1.0


def test_a_mode_that_the_wall_has_not_is_left_out():
    result = settled([CURVE._replace(linear_hz=450.0)], WALL, lambda wall: pushed(20.0))
    assert result.largest == () and result.n_marches == 1
