"""Friction and spin of spheres in space: rolling, oblique impacts, energy, DOP853."""

import numpy as np
import pytest

from beadwave.dem import space

from packing_reference import random_network, rubbing_reference

R, RHO, E, NU, G = 6e-3, 7800.0, 210e9, 0.3, 9.80665
FLOOR = np.array([0.0, -1.0, 0.0])


def sphere_on_floor(coefficient, overlap=0.0, **fields):
    floor = space.Plane(np.array([0]), FLOOR, np.array([overlap]))
    packing = space.packing_of(
        np.zeros((1, 3)), R, RHO, E, NU, pairs=np.zeros((0, 2)), planes=[floor], **fields
    )
    return packing._replace(friction=np.array([coefficient]))


def two_spheres(coefficient, radii=(R, R)):
    packing = space.packing_of(
        [[0.0, 0.0, 0.0], [0.0, sum(radii), 0.0]], radii, RHO, E, NU, pairs=[[0, 1]]
    )
    return packing._replace(friction=np.array([coefficient]))


def test_a_sliding_sphere_rolls_from_two_sevenths_on():
    """It rolls from t = 2 v0 / (7 mu g) on at 5/7 v0; friction takes 2/7 of its energy."""
    mu, speed = 0.3, 0.05
    loose = sphere_on_floor(mu)
    weight = np.array([[0.0, -loose.mass[0] * G, 0.0]])
    packing = sphere_on_floor(mu, (loose.mass[0] * G / loose.A[0]) ** (2 / 3))
    packing = packing._replace(weight=weight, load=weight)
    rolls = 2 * speed / (7 * mu * G)
    v0 = np.array([[speed, 0.0, 0.0]])
    run = space.march(packing, None, v0, duration=3 * rolls, dt=4e-7, n_save=3000)
    before = run.t < 0.98 * rolls
    np.testing.assert_allclose(
        run.velocity[before, 0, 0], speed - mu * G * run.t[before], atol=1e-4 * speed
    )
    # behind that the springs of the contact, stretched by mu m g, swing by 0.2 %
    after = run.t > 1.05 * rolls
    assert run.velocity[after, 0, 0].mean() == pytest.approx(5 / 7 * speed, rel=2e-4)
    rolling = -run.angular_velocity[after, 0, 2] * R
    assert rolling.mean() == pytest.approx(5 / 7 * speed, rel=2e-4)
    lost = run.dissipated_friction[-1] / run.energy_kinetic[0]
    assert lost == pytest.approx(2 / 7, rel=1e-4)
    assert run.energy_error < 1e-8


@pytest.mark.parametrize("spin", [0.0, 200.0, -300.0])
def test_an_impact_that_slips_throughout_changes_motion_as_rigid_spheres_do(spin):
    """Chung and Ooi (2011), tests 4 to 6, elastic: v_t' = v_t - 2 mu v_n, R w' = R w - 5 mu v_n."""
    mu, normal, across = 0.1, 0.2, 1.0
    packing = sphere_on_floor(mu)
    packing_run = {"duration": 1.2e-4, "dt": 1e-7, "n_save": 120}
    v0 = np.array([[across, -normal, 0.0]])
    run = spun(packing, v0, [[0.0, 0.0, spin]], **packing_run)
    sign = np.sign(across + R * spin)  # of the surface over the floor
    v, w = run.velocity[-1, 0], run.angular_velocity[-1, 0]
    assert v[1] == pytest.approx(normal, rel=1e-5)
    assert v[0] == pytest.approx(across - sign * 2 * mu * normal, rel=1e-5)
    # the arm is shorter by the overlap, 4e-4 of it
    assert R * w[2] == pytest.approx(R * spin - sign * 5 * mu * normal, rel=1e-3)


def spun(packing, v0, spin, **run):
    """A march whose spheres spin at the start."""
    return space.march(packing, None, np.hstack([v0, spin]), **run)


def test_two_spheres_that_spin_alike_throw_each_other_sideways():
    """Chung and Ooi (2011), test 7: both surfaces slip, v_t = +- mu v_n, R dw = 5/2 mu dv_n."""
    mu, normal, spin = 0.2, 0.1, 500.0
    packing = two_spheres(mu)
    v0 = np.array([[0.0, normal, 0.0], [0.0, -normal, 0.0]])
    spins = [[0.0, 0.0, spin]] * 2
    run = spun(packing, v0, spins, duration=1.2e-4, dt=1e-7, n_save=120)
    v, w = run.velocity[-1], run.angular_velocity[-1]
    np.testing.assert_allclose(v[:, 1], [-normal, normal], rtol=2e-3)  # the line turns a little
    np.testing.assert_allclose(np.abs(v[:, 0]), 2 * mu * normal, rtol=2e-3)
    assert v[0, 0] == pytest.approx(-v[1, 0], rel=1e-9)
    np.testing.assert_allclose(R * (spin - w[:, 2]), 5 * mu * normal, rtol=2e-3)


def test_spheres_of_two_sizes_keep_the_angular_momentum():
    packing = two_spheres(0.3, (R, 0.6 * R))
    v0 = np.array([[0.02, 0.1, 0.01], [-0.03, -0.1, 0.0]])
    run = spun(packing, v0, [[3.0, 20.0, 5.0], [0.0, -9.0, 4.0]],
               duration=1e-4, dt=5e-8, n_save=100)  # fmt: skip
    place = packing.rest + run.displacement
    m, inertia = packing.mass, packing.inertia
    about = np.einsum("s,ksx->kx", m, np.cross(place, run.velocity))
    about += np.einsum("s,ksx->kx", inertia, run.angular_velocity)
    assert np.abs(about - about[0]).max() < 1e-10 * np.abs(about[0]).max()
    momentum = np.einsum("s,ksx->kx", m, run.velocity)
    assert np.abs(momentum - momentum[0]).max() < 1e-12 * np.abs(momentum).max()


def rubbing_network(seed):
    """A random network with friction, without guides and dampers."""
    packing, v0 = random_network(seed)
    packing = packing._replace(guides=None, dissipation="none", gamma=None)
    rng = np.random.default_rng(seed)
    return packing._replace(friction=rng.uniform(0.05, 0.6, len(packing.A))), v0


# of others the switch from stick to slip stops DOP853, which takes it for stiff
@pytest.mark.parametrize("seed", [0, 1, pytest.param(3, marks=pytest.mark.slow)])
def test_rubbing_networks_meet_dop853(seed):
    packing, v0 = rubbing_network(seed)
    speed = np.linalg.norm(v0, axis=1).max()
    run = space.march_to_error(packing, None, v0, duration=1.5e-4, error=1e-4, n_save=75)
    # with steps of 2e-7 s at most it differs by 2e-13
    _, v, spin = rubbing_reference(packing, v0, run.t, longest=1e-6)
    true = np.linalg.norm(run.velocity - v, axis=2).max() / speed
    assert true <= run.error_estimate <= 1e-4
    whirl = np.linalg.norm((run.angular_velocity - spin) * packing.radius[:, None], axis=2).max()
    assert whirl <= 4e-4 * speed


@pytest.mark.parametrize("seed", range(12))
def test_friction_never_makes_energy(seed):
    """Heat only grows, and with it the ledger closes: so the rest of the energy only falls."""
    packing, v0 = rubbing_network(100 + seed)
    run = space.march_to_error(packing, None, v0, duration=2e-4, error=1e-4, n_save=200)
    assert np.all(np.diff(run.dissipated_friction) >= 0.0)
    assert run.energy_error < 1e-6
    held = run.energy_total - run.dissipated_friction
    assert np.all(np.diff(held) <= 1e-6 * run.energy_kinetic[0])


def test_tractions_stay_within_their_bound():
    lattice = space.lattice("hexagonal", (5, 6))
    pairs, arm = space.touching(lattice.centre, lattice.period, 1.0 + space.CLOSE)
    packing = space.packing_of(2 * R * lattice.centre, R, RHO, E, NU, pairs=pairs, arm=2 * R * arm)
    packing = packing._replace(friction=np.full(len(pairs), 0.1))
    v0 = np.zeros((30, 3))
    v0[2, 1] = 0.3
    run = space.march_to_error(packing, None, v0, duration=3e-4, error=1e-4, n_save=300)
    strength = np.linalg.norm(run.pair_friction, axis=2)
    assert np.all(strength <= 0.1 * run.pair_force * (1 + 1e-12))
    slips = strength > 0.0999 * run.pair_force
    assert 0.05 < slips[run.pair_force > 1.0].mean() < 0.95
    # in the plane spheres spin about its normal alone
    assert np.abs(run.angular_velocity[..., :2]).max() == 0.0
    assert np.abs(run.angular_velocity[..., 2]).max() > 0.1
