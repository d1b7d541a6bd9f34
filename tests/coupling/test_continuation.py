"""Periodic states from their neighbours' and at every phase."""

import numpy as np
import pytest

from beadwave.coupling.continuation import (
    before_striker,
    cold_state,
    later,
    neighbouring_state,
    struck,
)
from beadwave.coupling.period_map import USUAL_PERIODIC_SEARCH
from beadwave.coupling.periodic_state import period_of
from beadwave.coupling.spatial_march import body_of
from beadwave.dem.shakers import ShakerForces

from spatial_contact import last, random_wall, row

ERROR = 1e-4


def shaken_body(force=100.0, coefficient=1.0):
    """One sphere on a random wall of four modes under a shaker; the coefficient as a factor."""
    chain, rng = row(preload=20.0), np.random.default_rng(1)
    wall = random_wall(1, load=rng.normal(size=(4, 1)))._replace(zeta=np.full(4, 0.1))
    sphere = last(chain, arm_stiffness=np.array([2e6, 3e6]), arm_rotation=300.0)
    law = sphere.law._replace(bound=coefficient * sphere.law.bound)
    shakers = ShakerForces(np.array([force]), np.array([1000.0]), np.array([0.4]))
    return body_of(chain, wall, [0.0], sphere._replace(law=law), shakers)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("force", "coefficient", "near_enough"),
    [(110.0, 1.0, False), (100.0, 0.9, True), (160.0, 1.0, False)],
)
def test_the_state_from_a_neighbours_is_the_one_from_rest(force, coefficient, near_enough):
    """Up to ten errors: what the contact keeps of the neighbour moves the mean force alone. Where
    the neighbour's is not near enough, the state says that it was looked for from rest."""
    body = shaken_body(force, coefficient)
    before = before_striker(body, [0.0])
    wanted = {"error": ERROR, "speed": 0.0}
    near = cold_state(shaken_body(), before, **wanted)
    cold = cold_state(body, before, **wanted)
    warm = neighbouring_state(body, before, near, **wanted)
    assert warm.energy == pytest.approx(cold.energy, rel=10 * ERROR)
    assert warm.friction == pytest.approx(cold.friction, rel=10 * ERROR)
    assert warm.slip == pytest.approx(cold.slip, rel=10 * ERROR)
    assert warm.cold is not near_enough and cold.cold
    # by twice as many steps from the neighbour's too, if it was near enough
    finer = near._replace(n_steps=2 * near.n_steps)
    beside = neighbouring_state(body, before, finer, **wanted)
    assert abs(warm.slip / beside.slip - 1.0) < warm.error < 1e-2
    assert abs(near.energy - cold.energy) > 100 * ERROR * cold.energy


@pytest.mark.slow
def test_a_periodic_state_holds_every_phase():
    body = shaken_body()
    before = before_striker(body, [0.0])
    state = cold_state(body, before, error=ERROR, speed=0.0)
    turned, moving = later(body, before, state, 0.3)
    assert turned.shakers.phase[0] == pytest.approx(0.4 + 0.6 * np.pi, abs=2 * np.pi / 256)
    period = period_of(turned, before, state.n_steps, USUAL_PERIODIC_SEARCH)
    z = period.z_of(moving)
    saved = period.march(moving)
    assert np.abs(period.z_of(moving) - z).max() < 10 * ERROR * np.abs(z).max()
    assert saved.energy[-1, 2] - saved.energy[0, 2] == pytest.approx(state.energy, rel=10 * ERROR)
    # a period later is the state itself
    _, again = later(body, before, state, 1.0)
    np.testing.assert_array_equal(again.motion.p, state.moving.motion.p)


def test_a_striker_is_not_there_before_it_touches():
    chain, wall = row(3, preload=20.0), random_wall(1)
    body = body_of(chain, wall, [0.1, 0.0, 0.0], last(chain))
    before = before_striker(body, [0.1, 0.0, 0.0])
    assert before.n_absent == 1 and before.held.tolist() == [True, False, False]
    moving = body.at_rest()
    struck(moving, before, [0.1, 0.0, 0.0])
    assert moving.motion.x[0] == moving.motion.x[1] and moving.motion.v[0] == 0.1
    assert before_striker(body, np.zeros(3), upstream_held=True).held.tolist() == [
        True,
        True,
        False,
    ]
