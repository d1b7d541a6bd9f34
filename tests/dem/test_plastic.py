"""Elastic-plastic contacts after C. Thornton, J. Appl. Mech. 64 (1997) 383."""

import numpy as np
import pytest

from beadwave.dem import (
    Chain,
    InvalidChain,
    StepSearch,
    UnstableStep,
    Wall,
    march,
    march_to_error,
    rigid_wall,
)
from beadwave.dem.spheres import contact_modulus, hertz_coefficient, max_pressure, yield_overlap

pytestmark = pytest.mark.usefixtures("kernels")


def speeds(n):
    return np.eye(n)[0]


@pytest.mark.parametrize("ratio", [0.9, 0.5, 0.1, 0.01])
def test_restitution_is_thorntons(ratio):
    m, A, limit = 2.0, 3.0, 0.1
    speed = np.sqrt(0.8 * A * limit**2.5 / m) / ratio
    chain = Chain(np.full(1, m), np.ones(1), np.full(1, A), yield_overlap=np.full(1, limit))
    run = march(chain, rigid_wall(), np.full(1, speed), duration=8.0, dt=0.02)
    softer = ratio / (ratio + 2.0 * np.sqrt(1.2 - 0.2 * ratio**2))
    exact = np.sqrt(6 * np.sqrt(3) / 5) * np.sqrt(1.0 - ratio**2 / 6.0) * softer**0.25
    assert -run.v[-1, 0] / speed == pytest.approx(exact, abs=1e-6)
    assert run.energy_error < 2e-6


def test_below_yield_nothing_changes():
    hertz = Chain(np.ones(6), np.ones(6), np.ones(6))
    plastic = hertz._replace(yield_overlap=np.full(6, 2.0))
    options = dict(duration=20.0, dt=0.05, n_save=40, scheme="suzuki4")
    elastic = march(hertz, rigid_wall(), speeds(6), **options)
    two = march(plastic, rigid_wall(), speeds(6), **options)
    assert two.v == pytest.approx(elastic.v, abs=1e-13)
    assert two.dissipated_contact.max() == 0.0


def test_first_loading_is_softer_and_second_hertzian():
    chain = Chain(np.ones(1), np.ones(1), np.ones(1), yield_overlap=np.full(1, 0.2))
    first = march(chain, rigid_wall(), np.ones(1), duration=6.0, dt=0.02, n_save=300)
    depth, force = first.x[:, 0], first.contact_force[:, 0]
    loading = slice(0, depth.argmax())
    elastic = np.maximum(depth[loading], 0.0) ** 1.5
    # equal but for rounding until it yields
    assert (force[loading] <= elastic + 1e-12).all()
    again = first.final._replace(v=-first.final.v)
    second = march(chain, rigid_wall(), None, duration=12.0, dt=0.02, n_save=300, state=again)
    assert -second.v[-1, 0] == pytest.approx(second.v[0, 0], rel=1e-6)
    # of the step: 7e-10, and 2e-11 with half of it
    assert second.dissipated_contact[-1] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("residual", [0.0, 0.1, -0.1])
def test_ledger_closes_on_a_moving_wall(residual):
    wall = Wall(np.array([0.5, 2.0]), np.array([0.0, 0.1]), np.array([0.3, 0.2]), residual)
    chain = Chain(np.ones(9), np.ones(9), np.ones(9), yield_overlap=np.full(9, 0.3))
    run = march_to_error(chain, wall, speeds(9), duration=40.0, error=1e-4, n_save=40).trajectory
    assert run.energy_error < 1e-6
    assert run.dissipated_contact[-1] > 0.1
    assert np.diff(run.dissipated_contact).min() >= 0.0


def test_a_contact_that_a_negative_spring_would_let_leap_back_is_refused():
    chain = Chain(np.ones(3), np.ones(3), np.ones(3), yield_overlap=np.full(3, 0.3))
    wall = rigid_wall()._replace(residual_compliance=-0.6 / (1.5 * 0.3**0.5))
    with pytest.raises(UnstableStep, match="less negative"):
        march(chain, wall, speeds(3), duration=10.0, dt=0.01)
    with pytest.raises(UnstableStep, match="4 marches did not stay finite"):
        march_to_error(chain, wall, speeds(3), duration=10.0, error=1e-3)


def test_yield_overlap_is_where_the_pressure_is_reached():
    R, E_star, stress = 0.0127, contact_modulus(210e9, 0.3), 2.4e9
    limit = yield_overlap(R, E_star, stress)
    force = hertz_coefficient(R, 210e9, 0.3) * limit**1.5
    assert max_pressure(force, R, E_star) == pytest.approx(stress)


def test_plastic_rest_is_refused():
    chain = Chain(np.ones(1), np.ones(1), np.ones(1), preload=1.0, yield_overlap=np.full(1, 0.2))
    with pytest.raises(InvalidChain, match="beyond its yield overlap"):
        march(chain, rigid_wall(), np.zeros(1), duration=1.0, dt=0.1)


@pytest.mark.parametrize(
    "how",
    [{"dt": 0.05, "scheme": "energy4"}, {"error": 1e-3, "search": StepSearch("energy4")}],
)
def test_an_implicit_scheme_is_refused(how):
    """Its march does not know of yield: no step would close the energy."""
    chain = Chain(np.ones(2), np.ones(2), np.ones(2), yield_overlap=np.full(2, 0.2))
    run = march if "dt" in how else march_to_error
    with pytest.raises(InvalidChain, match="'energy4' takes no plastic contacts"):
        run(chain, rigid_wall(), speeds(2), duration=5.0, n_save=10, **how)
