"""A structure that shakers move below a contact with friction: periodic states, marches."""

import numpy as np
import pytest

from beadwave.coupling.shaken_march import march_shaken
from beadwave.coupling.spatial_march import body_of
from beadwave.coupling.spatial_wall import spatial_wall_of_modes
from beadwave.dem.checks import InvalidChain
from beadwave.dem.friction import tangential_law
from beadwave.dem.shakers import ShakerForces

from bristles import Bristles, ShakenStart, plain_march
from closed_loops import loop_amplitude, loop_energy
from spatial_contact import NU, E, R, last, random_wall, row


def shaken(seed, *, force, frequency, preload, arm=None, n_modes=4, n=1, error=1e-4, **run):
    """A random wall under one shaker, its chain from rest or struck."""
    rng = np.random.default_rng(1000 + seed)
    wall = random_wall(seed, n_modes)
    wall = wall._replace(
        zeta=np.maximum(wall.zeta, 0.02),
        load=rng.normal(size=(n_modes, 1)),
        load_residual=1e-9 * rng.normal(size=(3, 1)),
    )
    chain = row(n, preload=preload, leaf_stiffness=1e5 if n > 1 else None)
    arm = arm or {"arm_stiffness": np.array([2e6, 3e6]), "arm_rotation": 300.0}
    shakers = ShakerForces(np.array([force]), np.array([frequency]), np.array([0.4]))
    v0 = np.zeros(n)
    v0[0] = run.pop("velocity", 0.0)
    options = {"duration": 2e-4, "n_save": 50, "error": error} | run
    return (
        march_shaken(body_of(chain, wall, v0, last(chain, **arm), shakers), v0, **options),
        wall,
        chain,
    )


@pytest.mark.slow
@pytest.mark.parametrize(("force", "S"), [(150.0, 0.0), (100.0, 3e-9)])
def test_a_plain_integrator_goes_round_in_the_cycle(force, S):
    """From the state at t = 0 on for a period, partly and wholly slipping in two directions, with
    and without a residual compliance: amplitudes, loop energy and the state at its end."""
    chain, rng = row(preload=20.0), np.random.default_rng(1)
    wall = random_wall(1, load=rng.normal(size=(4, 1)))._replace(
        zeta=np.full(4, 0.1),
        residual_compliance=S * np.array([[1.0, 0.3, -0.2], [0.3, 1.2, 0.4], [-0.2, 0.4, 0.8]]),
    )  # fmt: skip
    body = last(chain, arm_stiffness=np.array([2e6, 3e6]), arm_rotation=300.0)
    shakers = ShakerForces(np.array([force]), np.array([1000.0]), np.array([0.4]))
    before = march_shaken(
        body_of(chain, wall, [0.0], body, shakers), [0.0], duration=1e-5, n_save=2, error=1e-4
    ).before
    y, history = plain_march(
        chain, wall, [0.0], body, duration=1e-3, dt=1e-6,
        bristles=Bristles(2.5e-6, 600),
        shaken=ShakenStart(before.moving, force, 2 * np.pi * 1000.0, 0.4),
    )  # fmt: skip
    T, slip = history[:, 1:3], history[:, 3:]
    mine = before.cycle.friction_force
    np.testing.assert_allclose(np.ptp(mine, axis=0), np.ptp(T, axis=0), rtol=5e-4)
    heat = float(np.sum(0.5 * (T[1:] + T[:-1]) * np.diff(slip, axis=0)))
    assert before.heat == pytest.approx(heat, rel=5e-4)
    np.testing.assert_allclose(y[7], before.moving.motion.p, atol=2e-4 * np.abs(y[7]).max())


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_shakers_work_is_friction_and_damping_in_random_cycles(seed):
    """To the error asked; from stick to slip all over."""
    rng = np.random.default_rng(seed)
    result, _, _ = shaken(
        seed, force=np.exp(rng.uniform(np.log(1), np.log(60))),
        frequency=np.exp(rng.uniform(np.log(100), np.log(1000))), preload=rng.uniform(10, 60),
        duration=1e-5, n_save=2,
    )  # fmt: skip
    before = result.before
    assert before.balance < 1e-4
    assert before.cycle.unbalanced == pytest.approx(before.balance * abs(before.work), rel=1e-6)
    assert before.heat >= 0.0
    assert before.lost_in_wall >= 0.0


@pytest.mark.slow
def test_a_slow_cycle_is_mindlins_loop():
    """Sphere clamped, wall moved at 10 Hz along t1 against a contact under 100 N, at half of gross
    slip's force: amplitude and energy of the closed forms, to 1e-4."""
    chain = row(preload=100.0)
    omega = 2 * np.pi * 3000.0
    wall = spatial_wall_of_modes([omega], [0.1], [[0.0, 1.0, 0.0]], load=[[1.0]])
    body = last(chain, arm_stiffness=np.full(2, np.inf), arm_rotation=np.inf)
    k_t = 3.840868e7
    X = loop_amplitude(body.law, 20.0, 10.0, 202.1028e-6)
    force = 10.0 + X * omega**2
    shakers = ShakerForces(np.array([force]), np.array([10.0]), np.array([0.0]))
    before = march_shaken(
        body_of(chain, wall, [0.0], body, shakers), [0.0], duration=1e-4, n_save=2, error=1e-3
    ).before
    Q = 0.5 * np.ptp(before.cycle.friction_force[:, 0])
    assert Q == pytest.approx(10.0, rel=2e-3)
    assert before.heat == pytest.approx(loop_energy(body.law, 20.0, Q, 202.1028e-6), rel=2e-4)
    slip = 0.5 * np.ptp(before.cycle.slip[:, 0])
    assert slip == pytest.approx(loop_amplitude(body.law, 20.0, Q, 202.1028e-6), rel=1e-4)
    assert Q / slip < k_t
    assert len(before.moving.contacts.row.u)  # one direction, exact


@pytest.mark.slow
def test_a_struck_chain_starts_from_the_periodic_state():
    """Without a striker the march goes on in the cycle; with one the ledger closes as well."""
    result, _, _ = shaken(2, force=10.0, frequency=500.0, preload=30.0, duration=2e-3, n_save=256)
    run, cycle = result.run, result.before.cycle
    scale = np.abs(cycle.friction_force).max()
    np.testing.assert_allclose(run.lateral.friction_force, cycle.friction_force, atol=2e-3 * scale)
    struck, _, _ = shaken(
        2, n=3, force=10.0, frequency=500.0, preload=30.0, velocity=0.2, duration=4e-4
    )
    assert struck.run.trajectory.energy_error < 1e-4
    assert np.all(np.diff(struck.run.lateral.dissipated_friction) >= 0.0)
    assert struck.run.trajectory.contact_force[:, -1].max() > 60.0


def test_the_ledger_is_judged_by_the_energies_that_come_and_go():
    """A striker of 1 um/s in a wall's swing across: its energy alone is next to nothing beside the
    loop of friction, of which the ledger leaves 1e-4 open at most."""
    chain = row(2, preload=100.0, leaf_stiffness=[1e3, 0.0])
    wall = spatial_wall_of_modes([2 * np.pi * 3000.0], [0.1], [[0.0, 1.0, 0.0]], load=[[1.0]])
    body = last(chain, arm_stiffness=np.full(2, np.inf), arm_rotation=np.inf)
    shakers = ShakerForces(np.array([100.0]), np.array([100.0]), np.array([0.0]))
    body = body_of(chain, wall, [1e-6, 0.0], body, shakers)
    run = march_shaken(body, [1e-6, 0.0], duration=1e-2, n_save=50, error=1e-3).run
    assert run.lateral.dissipated_friction[-1] > 1e6 * run.trajectory.energy_kinetic[0]
    assert run.lateral.energy_error < 1e-4


def test_spheres_that_nothing_holds_are_refused_or_held():
    chain, wall = row(3, preload=20.0), random_wall(1, load=np.ones((4, 1)))
    shakers = ShakerForces(np.array([5.0]), np.array([500.0]), np.array([0.0]))
    body = last(chain, arm_stiffness=np.full(2, 2e6), arm_rotation=300.0)
    options = {"duration": 1e-4, "n_save": 20, "error": 1e-3}
    with pytest.raises(InvalidChain, match="held by nothing"):
        march_shaken(body_of(chain, wall, [0.1, 0, 0], body, shakers), [0.1, 0, 0], **options)
    result = march_shaken(
        body_of(chain, wall, [0.1, 0, 0], body, shakers), [0.1, 0, 0], upstream_held=True, **options
    )
    assert result.before.moving.motion.v[1] == 0.0


def test_a_contact_that_opens_in_its_cycle_is_called_impacting():
    """From 215 to 225 N it grazes and comes back to itself; at less damping, or 235 N, rounding
    decides whether it does."""
    chain = row(preload=5.0)
    omega = 2 * np.pi * 400.0
    wall = spatial_wall_of_modes([omega], [0.2], [[0.6, 0.2, 0.0]], load=[[0.5]])
    shakers = ShakerForces(np.array([220.0]), np.array([300.0]), np.array([0.0]))
    body = last(chain, arm_stiffness=np.full(2, 1e6), arm_rotation=np.inf)
    before = march_shaken(
        body_of(chain, wall, [0.0], body, shakers), [0.0], duration=1e-4, n_save=2, error=1e-2
    ).before
    assert before.impacting
    assert before.force[:, 0].min() == 0.0


@pytest.mark.slow
def test_friction_between_spheres_is_in_the_cycle():
    """Harmonic balance, without friction between the spheres, and marches with a coefficient of 0
    give one heat to the error of 1e-3; friction changes it. Shakers put in what is lost."""
    wall = random_wall(0)._replace(zeta=np.full(4, 0.02), load=np.ones((4, 1)))
    wall = wall._replace(load_residual=np.zeros((3, 1)))
    chain = row(2, leaf_stiffness=[1e6, 0.0], leaf_anchor=[40e-6, 0.0])
    arm = {"arm_stiffness": np.array([2e6, 3e6]), "arm_rotation": 300.0}
    shakers, still = ShakerForces(np.full(1, 15.0), np.full(1, 400.0), np.zeros(1)), np.zeros(2)
    cycles = []
    for mu in (None, 0.0, 0.3):
        law = None if mu is None else tangential_law(mu, R, E, NU, R, E, NU)
        body = body_of(chain, wall, still, last(chain, **arm)._replace(before=law), shakers)
        run = march_shaken(body, still, duration=1e-5, n_save=2, error=1e-3)
        cycles.append(run.before)
    absent, smooth, rough = (cycle.heat for cycle in cycles)
    assert smooth == pytest.approx(absent, rel=1e-3)
    assert abs(rough / absent - 1.0) > 0.02
    assert max(cycle.balance for cycle in cycles) < 1e-4
