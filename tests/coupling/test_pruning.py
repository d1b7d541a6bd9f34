"""Wall modes left out, and what that is said to cost."""

import numpy as np
import pytest

from beadwave import dem
from beadwave.coupling import mode_costs, prune
from beadwave.coupling.pruning import oscillation, without
from beadwave.dem.kernels.oscillators import oscillator_propagator

E, NU = 210e9, 0.3
CHAIN = dem.row_of_spheres(0.0127, 7800.0, E, NU, count=4, flat=dem.Flat(E, NU))
V0 = np.r_[0.31, np.zeros(3)]


def wall_of(frequency_hz, mass_kg, residual=0.0):
    omega = 2 * np.pi * np.array(frequency_hz)
    return dem.Wall(omega, np.full(len(omega), 0.01), np.array(mass_kg) ** -0.5, residual)


WALL = wall_of([51.0, 900.0, 8000.0, 40e3, 90e3, 200e3], [5.0, 4.0, 0.4, 0.3, 0.3, 0.2])


def change(wall):
    run = [
        dem.march_to_error(CHAIN, w, V0, duration=1e-3, error=1e-7).trajectory.v
        for w in (WALL, wall)
    ]
    return np.abs(run[1] - run[0]).max() / 0.31


@pytest.mark.parametrize(
    ("omega", "zeta"), [(0.0, 0.0), (300.0, 0.02), (5e4, 0.3), (3e4, 1.0), (2e3, 4.0)]
)
def test_oscillation_under_a_constant_force_is_the_closed_form(omega, zeta):
    h, n = 1e-6, 400
    t = h * np.arange(n)
    q = oscillation(np.ones(n), omega, zeta, h)
    wall = dem.Wall(np.array([omega]), np.array([zeta]), np.ones(1))
    turn = oscillator_propagator(wall.omega[:, None], wall.zeta[:, None], t)
    static = 1 / omega**2 if omega else 0
    exact = static * (1 - turn[0, 0]) if omega else t**2 / 2
    np.testing.assert_allclose(q, exact, rtol=5e-3, atol=1e-3 * np.abs(exact).max())


def test_the_cost_of_each_mode_predicts_what_leaving_it_out_does():
    run = dem.march_to_error(CHAIN, WALL, V0, duration=1e-3, error=1e-5, n_save=20000).trajectory
    for left in mode_costs(CHAIN, WALL, run):
        true = change(without(WALL, [left]))
        assert 0.2 * true < left.cost < 5 * true


def test_slow_modes_are_frozen_and_fast_ones_made_static():
    run = dem.march_to_error(CHAIN, WALL, V0, duration=1e-3, error=1e-5, n_save=20000).trajectory
    how = [left.how for left in mode_costs(CHAIN, WALL, run)]
    assert how[0] == "frozen" and how[-1] == "static"


@pytest.mark.parametrize("error", [1e-1, 1e-2, 1e-3])
def test_pruning_keeps_the_error_it_was_given(error):
    pruned = prune(CHAIN, WALL, V0, duration=1e-3, error=error)
    assert pruned.cost <= error
    assert change(pruned.wall) <= 1.2 * error
    assert len(pruned.wall.omega) + len(pruned.left_out) == 6
    assert f"{len(pruned.left_out)} of 6 wall modes" in pruned.sentences[-1]


def test_a_larger_error_leaves_out_more_modes():
    left_out = [len(prune(CHAIN, WALL, V0, duration=1e-3, error=e).left_out) for e in (0.3, 1e-3)]
    assert left_out[0] > left_out[1]


def test_nothing_is_left_out_for_an_error_that_no_mode_stays_below():
    pruned = prune(CHAIN, wall_of([900.0], [0.2]), V0, duration=1e-3, error=1e-5)
    assert pruned.left_out == () and len(pruned.wall.omega) == 1


def test_a_wall_whose_modes_are_all_frozen_rests_where_its_forces_balance():
    """Only the half-space, taken off, is left of its compliance. From leaf springs anchored 1.5 mm
    inside the wall the search for rest once began where no force answers, and found nothing."""
    n = len(CHAIN.mass)
    leaning = CHAIN._replace(
        preload=15.0, leaf_stiffness=np.full(n, 200.0), leaf_anchor=np.full(n, 1.5e-3)
    )
    frozen = dem.Wall(*np.zeros((3, 0)), residual_compliance=-1e-9)
    rest = dem.equilibrium(leaning, frozen)
    pulled = 15.0 + 200.0 * (1.5e-3 - rest.x).sum()
    assert rest.force[-1] == pytest.approx(pulled, rel=1e-9)
    gap = (rest.force[-1] / CHAIN.A[-1]) ** (2 / 3) - 1e-9 * rest.force[-1]
    assert rest.x[-1] == pytest.approx(gap, rel=1e-9)
