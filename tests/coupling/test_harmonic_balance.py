"""The cycle that shakers keep up, by harmonic balance: closed forms, marches from it, energy."""

import numpy as np
import pytest

from beadwave.coupling.harmonic_balance import (
    answer,
    balance,
    cut_at_contacts,
    cycle_of,
)
from beadwave.coupling.period_map import USUAL_PERIODIC_SEARCH
from beadwave.coupling.periodic_state import (
    balanced,
    period_of,
    periodic_state,
    still,
    still_modes,
    with_still,
    without_still,
)
from beadwave.coupling.spatial_march import Before, SpatialSearch, body_of
from beadwave.coupling.spatial_wall import spatial_wall_of_modes
from beadwave.dem import UnstableStep
from beadwave.dem.friction import gross_slip, tangential_law
from beadwave.dem.kernels.lateral import Springs, press_round
from beadwave.dem.shakers import ShakerForces
from beadwave.dem.spheres import hertz_overlap

from closed_loops import loop_amplitude, loop_energy
from spatial_contact import last, random_wall, row

ARM = {"arm_stiffness": np.array([2e6, 3e6]), "arm_rotation": 300.0}


def shaken(force, frequency, *, seed=1, n=1, S=0.0, n_cells=256, **fields):
    """A chain on a random wall under one shaker, partly slipping, and nothing that strikes."""
    wall = random_wall(seed, load=np.random.default_rng(seed).normal(size=(4, 1)))._replace(
        zeta=np.full(4, 0.05),
        residual_compliance=S * np.array([[1.0, 0.3, -0.2], [0.3, 1.2, 0.4], [-0.2, 0.4, 0.8]]),
        load_residual=1e-9 * np.array([[0.3], [1.0], [-0.5]]),
    )  # fmt: skip
    chain = row(n, preload=40.0, leaf_stiffness=1e5 if n > 1 else None, **fields)
    shakers = ShakerForces(np.array([force]), np.array([frequency]), np.array([0.4]))
    search = SpatialSearch(n_cells=n_cells)
    return body_of(chain, wall, np.zeros(n), last(chain, **ARM), shakers, search)


def at_rest_before(body):
    return Before(np.zeros(body.prepared.chain.mass.size, bool), 0)


@pytest.mark.parametrize(("natural", "zeta"), [(500.0, 0.03), (800.0, 0.0), (799.9999999, 0.0)])
def test_a_sphere_that_sticks_and_a_mode_are_two_linear_oscillators(natural, zeta):
    """Arm and mode along t1, the contact's stiffness between them, friction without bound: the
    receptance of both in closed form, also of a mode without damping at the shaker's frequency."""
    chain, frequency, force = row(preload=100.0), 800.0, 5.0
    body = last(chain, arm_stiffness=np.full(2, 2e6), arm_rotation=np.inf)
    R, E, nu = 0.0127, 210e9, 0.3
    body = body._replace(law=tangential_law(1e5, R, E, nu, np.inf, E, nu))
    wall = spatial_wall_of_modes([2 * np.pi * natural], [zeta], [[0.0, 0.8, 0.0]], load=[[0.6]])
    shakers = ShakerForces(np.array([force]), np.array([frequency]), np.array([0.3]))
    marched = body_of(chain, wall, [0.0], body, shakers)
    cycle = balance(marched, at_rest_before(marched), 512, 1e-10, 1e-10)

    w, k_t, m = 2 * np.pi * frequency, 3.840868e7, float(chain.mass[0])
    omega = 2 * np.pi * natural
    # sphere u on arm and contact; mode q, its point at 0.8 q
    D = np.array([
        [2e6 + k_t - m * w**2, -0.8 * k_t],
        [-0.8 * k_t, omega**2 + 0.64 * k_t - w**2 + 2j * zeta * omega * w],
    ])  # fmt: skip
    u, q = np.linalg.solve(D, [0.0, 0.6 * force * np.exp(0.3j)])
    t = np.arange(512) / 512 / frequency
    expected = np.real((u - 0.8 * q) * np.exp(1j * w * t))
    np.testing.assert_allclose(cycle.y[:, 1], expected, atol=2e-5 * np.abs(expected).max())
    moving, _ = cycle_of(marched, cycle, 256)
    np.testing.assert_allclose(moving.motion.q, np.real(q), atol=1e-4 * abs(q))


@pytest.mark.parametrize("harmonic", [1, 2])
def test_a_mode_without_damping_at_a_harmonic_is_the_limit_of_those_beside(harmonic):
    """Of a contact that slips in part: forces, losses and modes as 1e-8 beside, which changes them
    by 6e-5 at most."""
    cycles = []
    for beside in (1.0, 1.0 + 1e-8):
        body = shaken(0.3 if harmonic == 1 else 60.0, 500.0)
        omega, zeta = body.wall.omega.copy(), body.wall.zeta.copy()
        omega[1], zeta[1] = 2.0 * np.pi * 500.0 * harmonic * beside, 0.0
        wall = body.wall._replace(omega=omega, zeta=zeta)
        body = body_of(body.prepared.chain, wall, [0.0], body.last, body.shakers, body.search)
        cycle = balance(body, at_rest_before(body), 512, 1e-8, 1e-6)
        assert cycle.change < 1e-8
        cycles.append(cycle_of(body, cycle, 256))
    (moving, saved), (near, by) = cycles
    assert saved.energy[-1, 2] == pytest.approx(by.energy[-1, 2], rel=1e-4)
    np.testing.assert_allclose(saved.force, by.force, atol=1e-4 * np.abs(by.force).max())
    np.testing.assert_allclose(moving.motion.q, near.motion.q, rtol=1e-3)


def test_a_mode_without_damping_that_is_shaken_and_not_held_is_refused():
    body = shaken(2.0, 500.0)
    omega, zeta, phi = body.wall.omega.copy(), body.wall.zeta.copy(), body.wall.phi.copy()
    omega[1], zeta[1], phi[1] = 2.0 * np.pi * 500.0, 0.0, 0.0
    wall = body.wall._replace(omega=omega, zeta=zeta, phi=phi)
    body = body_of(body.prepared.chain, wall, [0.0], body.last, body.shakers, body.search)
    with pytest.raises(UnstableStep, match="without damping at its own 500 Hz, which no contact"):
        periodic_state(body, at_rest_before(body), error=1e-3)


@pytest.mark.parametrize(
    ("n", "S", "fields"),
    [(1, 0.0, {}), (1, 3e-9, {}), (3, 0.0, {"dissipation": "hunt-crossley", "gamma": 0.5})],
)
def test_periods_marched_from_a_cycle_come_back_to_it_as_the_square_of_the_step(n, S, fields):
    """Forces over the period after, by two steps: what a fourth of the difference leaves is below
    1e-4 of the largest, where shear forgotten over many periods and the samples leave 3e-5."""
    body = shaken(60.0, 500.0, n=n, S=S, **fields)
    before, cycle = at_rest_before(body), None
    for n_samples in (512, 2048):
        cycle = balance(body, before, n_samples, 1e-8, 1e-6, start=cycle)
    assert cycle.change < 1e-8
    assert cycle.answer.creep <= 1e-6
    assert 0.05 < cycle.answer.stick.min() < 0.95
    moving, saved = cycle_of(body, cycle, 256)
    off = []
    for n_steps in (4096, 8192):
        period = period_of(body, before, n_steps, USUAL_PERIODIC_SEARCH)
        start = moving.copied()
        body.settle(start, period.system, 0.0)
        marched = period.march(start)
        off.append((marched.force - saved.force)[:, 1:] / np.abs(saved.force[:, 1:]).max())
    assert np.abs(off[0]).max() < 3e-3
    assert np.abs((4.0 * off[1] - off[0]) / 3.0).max() < 1e-4
    gained = marched.energy[-1] - marched.energy[0]
    assert saved.energy[-1, 2] == pytest.approx(gained[2], rel=2e-3)
    assert np.sum(saved.energy[-1, 6:8]) == pytest.approx(np.sum(gained[6:8]), rel=2e-3)
    assert saved.energy[-1, 4] == pytest.approx(gained[4], rel=2e-2, abs=1e-15)


def test_a_cycle_that_marched_periods_come_back_to_is_proven_by_them():
    """Its mean forces and losses are those of the periods; none is searched for by marches."""
    body = shaken(60.0, 500.0)
    motion, nearby = balanced(body, at_rest_before(body), 0.02, 0.0, USUAL_PERIODIC_SEARCH)
    assert motion is not None and nearby == (None, None)
    period = period_of(body, at_rest_before(body), 4096, USUAL_PERIODIC_SEARCH)
    start = motion.moving.divided(body.search.n_cells)
    body.settle(start, period.system, 0.0)
    force = period.march(start).force[:, 1:]
    assert np.abs(force - motion.saved.force[:, 1:]).max() < 0.02 * np.abs(force).max()


@pytest.mark.parametrize("seed", range(3))
def test_work_is_heat_and_losses_to_far_below_the_error(seed):
    """Of a cycle to 1e-3, work and losses differ by less than 1e-4 of the work: what samples and
    cells leave of the path's area."""
    body = shaken(30.0, 300.0, seed=seed)
    state = periodic_state(body, at_rest_before(body), error=1e-3)
    assert state.cycle.stick_share.min() < 1.0
    assert state.balance < 1e-4


def test_modes_far_above_the_contacts_neither_feed_nor_change_a_march_of_periods():
    """One of 100 times the contact's rate, its period near a step: at rest in its forces it leaves
    the contact's static motion, and the state at t = 0 has its displacement and velocity."""
    body = shaken(30.0, 500.0)
    omega = 100.0 * body.rate
    wall = body.wall
    stiff = wall._replace(
        omega=np.append(wall.omega, omega),
        zeta=np.append(wall.zeta, 0.005),
        phi=np.vstack([wall.phi, omega * np.array([3e-5, 5e-5, 2e-5])]),
        load=np.vstack([wall.load, [[1.0]]]),
        sense=np.zeros((5, 0)),
    )
    body = body_of(
        body.prepared.chain, stiff, [0.0], body.last, body.shakers, SpatialSearch(n_cells=256)
    )
    assert list(still_modes(body)) == [False] * 4 + [True]
    slow = still(body)
    np.testing.assert_allclose(
        slow.wall.residual_compliance, np.outer(stiff.phi[-1], stiff.phi[-1]) / omega**2
    )
    before = at_rest_before(body)
    cycle = balance(body, before, 1024, 1e-8, 1e-5)
    moving, saved = cycle_of(body, cycle, 256)
    rate = (saved.force[1] - saved.force[-2]) * 256 * 500.0 / 2.0
    again = with_still(body, without_still(body, moving), rate).motion
    np.testing.assert_allclose(again.q, moving.motion.q, rtol=1e-3)
    np.testing.assert_allclose(again.p[:4], moving.motion.p[:4])
    period = period_of(slow, before, 4096, USUAL_PERIODIC_SEARCH)
    start = without_still(body, moving).copied()
    slow.settle(start, period.system, 0.0)
    marched = period.march(start)
    off = np.abs(marched.force - saved.force)[:, 1:].max()
    assert off < 3e-3 * np.abs(saved.force[:, 1:]).max()


@pytest.mark.slow
def test_a_stiff_wall_leaves_the_mean_forces_of_pushes_up_to_the_bound():
    """A clamped sphere on a mode of 1.6e12 N/m that is moved by 0.1 um: as on a wall of prescribed
    motion one turning point of the force reaches mu P, from either side."""
    chain, stiffness = row(preload=100.0), (2 * np.pi * 1e5) ** 2 / 0.25
    wall = spatial_wall_of_modes([2 * np.pi * 1e5], [0.01], [[0.0, 0.5, 0.0]], load=[[0.5]])
    shakers = ShakerForces(np.array([stiffness * 1e-7]), np.array([100.0]), np.array([0.0]))
    clamped = last(chain, arm_stiffness=np.full(2, np.inf), arm_rotation=np.inf)
    body = body_of(chain, wall, [0.0], clamped, shakers)
    cycle = periodic_state(body, at_rest_before(body), error=1e-3).cycle
    largest = 20.0 - 0.5 * np.ptp(cycle.friction_force[:, cycle.axis])
    assert 1.0 < largest < 19.0
    assert cycle.mean_force_range == pytest.approx((-largest, largest), rel=2e-3)


def test_mean_forces_of_pushes_are_those_that_a_march_comes_to():
    """Arm and wall give way: marched from the rest that the bound of friction keeps, under a shaker
    whose force grows over a hundred periods."""
    chain, k, f = row(preload=100.0), 2e6, 20.0
    wall = spatial_wall_of_modes([2 * np.pi * 900.0], [0.2], [[0.0, 0.5, 0.0]], load=[[0.5]])
    shakers = ShakerForces(np.array([12.0]), np.array([300.0]), np.array([0.4]))
    held = last(chain, arm_stiffness=np.full(2, k), arm_rotation=np.inf)
    body = body_of(chain, wall, [0.0], held, shakers)
    before, overlap = at_rest_before(body), (100.0 / chain.A[-1]) ** (2.0 / 3.0)
    cycle = periodic_state(body, before, error=1e-3).cycle

    moving = body.at_rest()
    path = np.array([[overlap, 1.0, -1.6e-6], [overlap, 1.0, 1.6e-6]])
    springs = Springs(moving.contacts.row, moving.contacts.room, moving.contacts.cells)
    press_round(body.last.law, 1, path, springs, np.zeros(1), np.zeros((2, 1)), np.zeros(2))
    motion = moving.motion
    motion.u[:], motion.q[:] = f / k, -0.5 * f / body.wall.omega**2
    motion.slip[:] = motion.u - 0.5 * motion.q
    for share in np.append(np.linspace(0.0, 1.0, 100), np.ones(10)):
        grown = shakers._replace(force=share * shakers.force)
        period = period_of(body._replace(shakers=grown), before, 2048, USUAL_PERIODIC_SEARCH)
        period.body.settle(moving, period.system, 0.0)
        saved = period.march(moving)
    mean = float(saved.force[:-1, 1].mean())
    assert abs(mean) == pytest.approx(f, abs=0.5)
    assert cycle.mean_force_range == pytest.approx((mean, -mean), rel=1e-4)


def test_a_contact_that_slips_as_a_whole_has_one_mean_force():
    body = shaken(400.0, 300.0)
    cycle = periodic_state(body, at_rest_before(body), error=1e-2).cycle
    assert cycle.stick_share.min() == 0.0
    assert np.ptp(cycle.mean_force_range) == 0.0


@pytest.mark.parametrize("load", [0.25, 0.5])
def test_a_cycle_across_has_johnsons_loop(load):
    """Johnson 7.57, of the amplitude at which the force is `load` of its bound."""
    wall = spatial_wall_of_modes(
        [2 * np.pi * 100.0], [0.0], [[0.0, 10**-0.5, 0.0]], load=[[10**-0.5]]
    )
    press, chain = 20.0, row(preload=20.0)
    clamped = last(chain, arm_stiffness=np.full(2, np.inf), arm_rotation=np.inf)
    shakers = ShakerForces(np.ones(1), np.array([100.0]), np.zeros(1))
    body, law = body_of(chain, wall, [0.0], clamped, shakers), clamped.law
    overlap, most = hertz_overlap(press, chain.A[-1]), 0.2 * press
    amplitude = float(loop_amplitude(law, most, load * most, float(np.sqrt(law.radius * overlap))))
    cut = cut_at_contacts(body, at_rest_before(body), 512)
    y = np.zeros((512, 2))
    y[:, 1] = amplitude * np.cos(2 * np.pi * np.arange(512) / 512)
    cycle = answer(body, at_rest_before(body), cut, y, None, 2)
    assert np.ptp(cycle.force[:, 1]) / 2 == pytest.approx(load * most, rel=1e-3)
    expected = float(loop_energy(law, most, load * most, float(np.sqrt(law.radius * overlap))))
    assert cycle.heat == pytest.approx(expected, rel=1e-2)
    assert amplitude < gross_slip(law, overlap)
