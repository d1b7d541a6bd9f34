"""The last sphere across the chain: oblique impacts, arms, damping, errors and energy."""

import numpy as np
import pytest

from beadwave import dem
from beadwave.coupling.lateral_march import LateralSearch, WallMotion, march_lateral
from beadwave.coupling.period_map import PeriodicSearch
from beadwave.coupling.spatial_march import SpatialSearch
from beadwave.dem.friction import contact_of_load, gross_slip, stick_stiffness, tangential_law
from beadwave.dem.lateral import LastSphere

R, E, NU, RHO = 0.0127, 210e9, 0.3, 7800.0
STEEL = dem.Flat(E, NU)


def sphere(**fields):
    return dem.row_of_spheres(R, RHO, E, NU, count=1, flat=STEEL, **fields)


def last(chain, velocity, mu=0.2, **arm):
    law = tangential_law(mu, R, E, NU, np.inf, E, NU)
    return LastSphere(law, 0.4 * 4 / 3 * np.pi * R**3 * RHO * R**2, np.array(velocity), **arm)


def oblique(velocity, vn=0.1, *, error=1e-5, mu=0.2, chain=None, duration=2e-4, n_save=1000, **arm):
    """Lateral march of one sphere at a half-space, and the march along the chain."""
    chain = sphere() if chain is None else chain
    along = dem.march_to_error(
        chain, dem.rigid_wall(), [vn], duration=duration, error=error, n_save=n_save
    ).trajectory
    body = last(chain, velocity, mu, **arm)
    return march_lateral(chain, dem.rigid_wall(), [vn], along, body, error=error), along


def surface(run, row=-1):
    """Velocity of the sphere's surface at the contact, (2,)."""
    turn = R * np.array([run.sphere_spin[row, 1], -run.sphere_spin[row, 0]])
    return run.sphere_t_v[row] + turn


def speed_at(psi, mu=0.2, vn=0.1):
    """Speed across of the dimensionless angle of incidence psi of Maw, Barber and Fawcett."""
    return psi * mu * (2.0 - NU) * vn / (2.0 * (1.0 - NU))


@pytest.mark.parametrize(("psi", "ratio"), [(1.0, -0.0597), (3.0, -0.4599)])
def test_a_sphere_leaves_a_half_space_as_maw_barber_and_fawcett_found(psi, ratio):
    """N. Maw, J. R. Barber, J. N. Fawcett, Wear 38 (1976) 101; four digits are known."""
    run, _ = oblique([speed_at(psi), 0.0])
    assert surface(run)[0] / speed_at(psi) == pytest.approx(ratio, abs=1e-4)


@pytest.mark.parametrize("psi", [4.77, 5.0, 8.0])
def test_a_sphere_that_slips_throughout_loses_coulombs_impulse(psi):
    """From psi = 4.765 on: exactly 1 - 7 mu v_n / v_t of a solid sphere."""
    v = speed_at(psi)
    run, _ = oblique([v, 0.0])
    assert surface(run)[0] / v == pytest.approx(1.0 - 7.0 * 0.2 * 0.1 / v, abs=1e-7)
    assert run.stick_share.max() == 0.0


def test_impulse_turns_the_sphere_by_its_lever():
    """I omega = R times m dv, about -t2 for a push along -t1."""
    run, _ = oblique([speed_at(2.0), 0.0])
    m = 4 / 3 * np.pi * R**3 * RHO
    impulse = m * (run.sphere_t_v[0, 0] - run.sphere_t_v[:, 0])
    np.testing.assert_allclose(0.4 * m * R * run.sphere_spin[:, 1], -impulse, atol=1e-12)
    assert not run.sphere_spin[:, 0].any()


def test_errors_fall_with_the_square_of_the_step():
    """Order 2 within 0.3, as moments at which slip begins lie anywhere in a step."""
    chain = sphere()
    along = dem.march_to_error(
        chain, dem.rigid_wall(), [0.1], duration=2e-4, error=1e-9, n_save=100
    ).trajectory
    body = last(chain, [speed_at(2.0), 0.0])
    runs = [
        march_lateral(
            chain,
            dem.rigid_wall(),
            [0.1],
            along,
            body,
            search=LateralSearch(SpatialSearch(dt=dt)),
        )
        for dt in (4e-7, 2e-7, 1e-7, 1.25e-8)
    ]
    exact = surface(runs[-1])[0]
    errors = np.array([abs(surface(run)[0] - exact) for run in runs[:-1]])
    orders = np.log2(errors[:-1] / errors[1:])
    assert np.all(orders > 1.7), orders
    assert errors[-1] < 1e-6 * speed_at(2.0)


def test_the_ledger_closes_with_frictions_heat():
    for psi in (0.3, 1.0, 3.0, 6.0):
        run, _ = oblique([speed_at(psi), 0.0])
        assert np.all(np.diff(run.dissipated_friction) >= 0.0)
        off = np.abs(run.energy - run.energy[0]).max()
        assert off < 5e-6 * run.energy[0]


def test_friction_turned_in_the_plane_is_the_same():
    a, _ = oblique([speed_at(2.0), 0.0])
    c, s = np.cos(0.7), np.sin(0.7)
    b, _ = oblique([speed_at(2.0) * c, speed_at(2.0) * s])
    np.testing.assert_allclose(surface(b), surface(a)[0] * np.array([c, s]), rtol=1e-9)


def test_cells_in_two_directions_agree_with_the_row():
    """An arm so soft that it does nothing, softer along t2, asks for two directions; 256 cells
    leave 2e-4 of the speed."""
    v = np.array([speed_at(2.0) * 0.8, speed_at(2.0) * 0.6])
    a, _ = oblique(v)
    b, _ = oblique(v, error=1e-4, arm_stiffness=np.array([1e-3, 2e-3]))
    assert np.abs(surface(b) - surface(a)).max() < 2e-4 * np.hypot(*v)


def test_a_sphere_on_its_arm_swings_where_nothing_touches():
    """Away from the wall: u = v / omega sin(omega t), to rounding."""
    chain = sphere()
    k = 1e5
    run, along = oblique(
        [0.05, 0.0], vn=-0.1, arm_stiffness=np.array([k, k]), duration=2e-3, chain=chain
    )
    omega = np.sqrt(k / chain.mass[0])
    np.testing.assert_allclose(
        run.sphere_t[:, 0], 0.05 / omega * np.sin(omega * along.t), atol=1e-12
    )
    assert not run.friction_force.any()


def test_a_clamped_arm_holds_the_sphere_and_only_its_turn_is_left():
    run, _ = oblique([0.02, 0.0], vn=0.1, arm_stiffness=np.array([0.0, 0.0]), arm_rotation=np.inf)
    assert not run.sphere_spin.any()
    # a sphere that cannot turn slides to v - 2 mu v_n where it slips throughout
    run, _ = oblique([0.2, 0.0], arm_rotation=np.inf)
    assert run.sphere_t_v[-1, 0] == pytest.approx(0.2 - 2.0 * 0.2 * 0.1, abs=1e-7)


def test_a_damped_contact_slips_at_mu_times_its_whole_force():
    """Hunt and Crossley's damping carries friction as well."""
    chain = sphere(dissipation="hunt-crossley", gamma=2.0)
    run, along = oblique([1.0, 0.0], chain=chain, n_save=400)
    force = along.contact_force[:, -1]
    off = np.abs(run.friction_force[:, 0] - 0.2 * force)
    assert off.max() < 2e-5 * force.max()
    impulse = chain.mass[0] * (along.v[0, 0] - along.v[-1, 0])
    lost = chain.mass[0] * (run.sphere_t_v[0, 0] - run.sphere_t_v[-1, 0])
    assert lost == pytest.approx(0.2 * impulse, rel=1e-5)


def test_a_pressed_sphere_swings_on_its_contact_as_mindlin_says():
    """Small motion of a sphere that cannot turn, pressed on the wall: the frequency is that of
    2 a G*, beside an arm as stiff; slip of the rim lowers it by less than 1e-3."""
    chain = sphere(preload=100.0)
    wall = dem.rigid_wall()
    law = tangential_law(0.5, R, E, NU, np.inf, E, NU)
    along = dem.march(chain, wall, [0.0], duration=4e-4, dt=2e-7, n_save=2000)
    d = (100.0 / chain.A[-1]) ** (2.0 / 3.0)
    k = float(stick_stiffness(law, np.sqrt(R * d)))
    body = last(
        chain, [1e-6, 0.0], 0.5, arm_stiffness=np.array([k, k]), arm_rotation=np.inf
    )._replace(law=law)
    run = march_lateral(chain, wall, [0.0], along, body, error=1e-6)
    u = run.sphere_t[:, 0]
    crossings = along.t[1:][np.diff(np.sign(u)) != 0]
    period = 2.0 * np.diff(crossings).mean()
    assert 2.0 * np.pi / period == pytest.approx(np.sqrt(2.0 * k / chain.mass[0]), rel=2e-3)


@pytest.mark.parametrize("seed", range(12))
def test_random_impacts_are_off_by_less_than_their_stated_error(seed):
    rng = np.random.default_rng(seed)
    mu, psi = rng.uniform(0.05, 0.9), rng.uniform(0.1, 6.0)
    gamma = rng.choice([0.0, 1.0])
    chain = sphere(dissipation="hunt-crossley", gamma=gamma) if gamma else sphere()
    arm = {"arm_rotation": float(rng.choice([0.0, 50.0]))}
    k = float(10.0 ** rng.uniform(4, 7))
    arm["arm_stiffness"] = np.array([k, k])
    v = [speed_at(psi, mu), 0.0]
    error = 10.0 ** rng.uniform(-5, -3.5)
    run, along = oblique(v, error=error, mu=mu, chain=chain, n_save=200, **arm)
    exact, _ = oblique(v, error=3e-8, mu=mu, chain=chain, n_save=200, **arm)
    speed = max(0.1, v[0])
    off = np.abs(run.sphere_t_v - exact.sphere_t_v).max()
    off = max(off, R * np.abs(run.sphere_spin - exact.sphere_spin).max()) / speed
    assert off < run.error_estimate + along_error(along, error)
    assert run.error_estimate <= error


def along_error(along, error):
    """The stated error of the march along the chain, never more than asked for."""
    stated = along.error_estimate if along.error_estimate is not None else error
    assert stated <= error
    return stated


@pytest.mark.parametrize(
    ("chain", "arm", "sentence"),
    [
        (sphere(yield_overlap=1e-5), {}, "elastic"),
        (sphere(dissipation="linear", gamma=1.0), {}, "elastic"),
        (sphere(), {"arm_stiffness": np.array([np.inf, 0.0])}, "clamps"),
        (sphere(), {"arm_stiffness": np.array([-1.0, 0.0])}, "arm_stiffness"),
        (sphere(), {"arm_rotation": -1.0}, "arm_rotation"),
    ],
)
def test_what_has_no_tangential_law_is_refused(chain, arm, sentence):
    along = dem.march(sphere(), dem.rigid_wall(), [0.1], duration=1e-4, dt=1e-6)
    body = last(sphere(), [0.1, 0.0], **arm)
    with pytest.raises(dem.InvalidChain, match=sentence):
        march_lateral(chain, dem.rigid_wall(), [0.1], along, body, error=1e-4)


# --- a wall that moves ----------------------------------------------------------------------------


def shaken(amplitude, frequency, *, mu=0.2, load=100.0, error=1e-5, duration=None, **arm):
    """A sphere pressed on a wall that moves, and nothing that strikes."""
    amplitude, frequency = np.atleast_2d(amplitude), np.atleast_1d(frequency)
    motion = WallMotion(amplitude, frequency, np.zeros(frequency.size))
    chain = sphere(preload=load)
    duration = motion.period if duration is None else duration
    along = dem.march(chain, dem.rigid_wall(), [0.0], duration=duration, dt=2e-5, n_save=256)
    body = last(chain, [0.0, 0.0], mu, **{"arm_rotation": np.inf} | arm)
    run = march_lateral(chain, dem.rigid_wall(), [0.0], along, body, motion=motion, error=error)
    return run, chain, body


def test_a_contact_that_sticks_makes_the_sphere_a_linear_oscillator():
    """u = k_t / (k + k_t - m omega^2) w for so much friction that nothing slips."""
    k = 2e6
    for frequency in (100.0, 1500.0, 6000.0):
        run, chain, body = shaken([1e-7, 0.0], frequency, mu=1e4, arm_stiffness=np.full(2, k))
        d = (100.0 / chain.A[0]) ** (2.0 / 3.0)
        k_t = float(stick_stiffness(body.law, np.sqrt(R * d)))
        gain = k_t / (k + k_t - chain.mass[0] * (2.0 * np.pi * frequency) ** 2)
        u = run.cycle.sphere_t[:, 0]
        expected = 1e-7 * gain * np.cos(2.0 * np.pi * frequency * run.cycle.t)
        np.testing.assert_allclose(u, expected, atol=2e-5 * np.abs(expected).max())
        # the rim slips, as 1 over the coefficient
        assert run.cycle.energy < 1e-6 * k_t * np.ptp(run.cycle.slip) ** 2


def test_the_work_of_the_wall_in_a_period_is_the_heat_of_friction():
    """Of a sphere on an arm that slips in part; and the march that follows is one period more."""
    run, _, _ = shaken([2e-6, 0.0], 1000.0, arm_stiffness=np.full(2, 1e7))
    heat = run.dissipated_friction[-1]
    assert heat == pytest.approx(run.cycle.energy, rel=1e-5)
    assert run.work_shaker[-1] == pytest.approx(heat, rel=1e-4)
    assert np.abs(run.energy - run.energy[0]).max() < 1e-4 * heat
    assert run.cycle.periodicity_error < 1e-7  # a hundredth of the error


def test_a_sphere_that_nothing_holds_follows_the_wall():
    """It moves as the wall does, but for the contact's give."""
    run, _, _ = shaken([1e-6, 0.0], 100.0)
    motion = 1e-6 * np.cos(2.0 * np.pi * 100.0 * run.cycle.t)
    off = run.cycle.sphere_t[:, 0] - motion
    assert np.ptp(off) < 3e-3 * np.ptp(motion)
    assert run.cycle.drift < 1e-9 * 1e-6


def test_two_frequencies_have_a_period_together_and_a_period_of_its_own_each():
    motion = WallMotion(np.eye(2) * 1e-7, np.array([100.0, 150.0]), np.zeros(2))
    assert motion.period == pytest.approx(0.02)
    run, _, _ = shaken([[1e-7, 0.0], [1e-7, 0.0]], [100.0, 150.0], arm_stiffness=np.full(2, 2e6))
    assert run.cycle.t[0] == pytest.approx(-0.02)
    assert run.cycle.periodicity_error < 1e-7  # a hundredth of the error
    with pytest.raises(dem.InvalidChain, match="no common period"):
        _ = WallMotion(np.eye(2), np.array([100.0, 141.42135]), np.zeros(2)).period


def test_a_circular_motion_rubs_alike_in_both_directions():
    """y and z a quarter of a period apart, clamped sphere: the size of the force is constant where
    all slips, mu P, to what 256 cells leave."""
    amplitude = 1e-5
    motion = WallMotion(amplitude * np.eye(2), np.array([50.0, 50.0]), np.array([0.0, np.pi / 2]))
    chain = sphere(preload=100.0)
    along = dem.march(chain, dem.rigid_wall(), [0.0], duration=0.02, dt=2e-5, n_save=200)
    body = last(chain, [0.0, 0.0], arm_stiffness=np.full(2, np.inf), arm_rotation=np.inf)
    run = march_lateral(chain, dem.rigid_wall(), [0.0], along, body, motion=motion, error=1e-4)
    size = np.hypot(*run.cycle.friction_force.T)
    np.testing.assert_allclose(size, 20.0, rtol=1e-3)
    # the force lags behind the slip by no more than the springs' give
    work = run.cycle.energy
    assert work == pytest.approx(20.0 * 2.0 * np.pi * amplitude, rel=2e-2)


def test_a_loop_off_the_grid_of_steps_keeps_its_energy_to_the_error():
    """Turning points of the wall lie between steps: the energy is that of the closed form."""
    chain, amplitude = sphere(preload=100.0), 2e-6
    motion = WallMotion(np.array([[amplitude, 0.0]]), np.array([10.0]), np.array([0.7026]))
    along = dem.march(chain, dem.rigid_wall(), [0.0], duration=0.1, dt=2e-5, n_save=256)
    body = last(chain, [0.0, 0.0], arm_stiffness=np.full(2, np.inf), arm_rotation=np.inf)
    for error in (1e-3, 1e-6):
        run = march_lateral(chain, dem.rigid_wall(), [0.0], along, body, motion=motion, error=error)
        exact = 12497.175e-9 + 4.0 * 20.0 * (amplitude - 0.781073e-6)
        assert run.cycle.energy == pytest.approx(exact, rel=error)


@pytest.mark.slow
def test_a_contact_that_slips_in_part_keeps_the_force_of_its_start():
    """A sphere on an arm: the stuck middle keeps what pushes have left in it, as much on either
    side; one that slips as a whole forgets it."""
    for arm in (np.inf, 2e6):
        cycle = shaken([1e-7, 0.0], 10.0, arm_stiffness=np.full(2, arm))[0].cycle
        # one turning point reaches mu P
        largest = 20.0 - 0.5 * np.ptp(cycle.friction_force[:, 0])
        assert cycle.mean_force_range == pytest.approx((-largest, largest), rel=1e-3)
    clamped = {"arm_stiffness": np.full(2, np.inf)}
    assert np.ptp(shaken([2e-6, 0.0], 10.0, **clamped)[0].cycle.mean_force_range) < 1e-9


def rubbing(amplitude, *, mu=0.2, load=100.0, frequency=100.0, turn=np.inf):
    """Two spheres pressed on each other and on a wall without friction of its own to speak of but
    so much that the last one follows the wall, and rubs on the first."""
    chain = dem.row_of_spheres(
        R, RHO, E, NU, count=2, flat=STEEL, leaf_stiffness=[1e5, 0.0], leaf_anchor=[load / 1e5, 0.0]
    )
    motion = WallMotion(np.array([[amplitude, 0.0]]), np.array([frequency]), np.zeros(1))
    along = dem.march(chain, dem.rigid_wall(), [0.0, 0.0], duration=0.01, dt=5e-6, n_save=256)
    body = last(chain, [0.0, 0.0], 1e4, arm_rotation=turn)
    body = body._replace(before=tangential_law(mu, R, E, NU, R, E, NU))
    run = march_lateral(chain, dem.rigid_wall(), [0.0, 0.0], along, body, motion=motion, error=1e-4)
    return run, along, body


@pytest.mark.slow
def test_a_sphere_that_rubs_on_the_one_before_takes_coulombs_work():
    """The wall's friction holds the last sphere, which moves by the wall's amplitude less what both
    contacts give: 4 mu P (Y - gross slip) and the loop at gross slip, of two equal spheres."""
    run, along, body = rubbing(5e-6)
    load = float(along.contact_force[0, 0])
    a, d = contact_of_load(body.before, 0.2, load)
    moved = 0.5 * np.ptp(run.cycle.sphere_t[:, 0])
    slid = float(gross_slip(body.before, d))
    expected = 1.2 * (0.2 * load) ** 2 / float(stick_stiffness(body.before, a))
    expected += 4.0 * 0.2 * load * (moved - slid)
    assert load == pytest.approx(100.0, rel=1e-2)
    assert run.cycle.energy == pytest.approx(expected, rel=1e-3)
    assert run.work_shaker[-1] == pytest.approx(run.dissipated_friction[-1], rel=1e-3)
    assert run.energy_error < 1e-4


@pytest.mark.slow
def test_a_sphere_between_two_contacts_turns_as_a_roller():
    """Free to turn between the sphere before it and the wall, with friction enough at both: it
    rolls, and its centre moves by half of what the wall does."""
    run, _, _ = rubbing(1e-7, mu=1e4, turn=0.0)
    moved = np.ptp(run.cycle.sphere_t[:, 0]) / 2e-7
    assert moved == pytest.approx(0.5, abs=2e-2)
    assert run.cycle.energy < 1e-4 * 100.0 * 1e-7


def test_without_a_periodic_state_the_march_that_shows_it_is_named():
    """A free sphere on a wall that hardly rubs does not settle within a few periods."""
    amplitude, frequency = np.array([[1e-4, 0.0]]), np.array([200.0])
    motion = WallMotion(amplitude, frequency, np.zeros(1))
    chain = sphere(preload=100.0)
    along = dem.march(chain, dem.rigid_wall(), [0.0], duration=5e-3, dt=2e-5, n_save=256)
    body = last(chain, [0.0, 0.0], mu=0.01, arm_rotation=np.inf)
    few = PeriodicSearch(levels=(), settling=1, most_iterations=1, most_periods=6)
    search = LateralSearch(periodic=few)
    with pytest.raises(dem.UnstableStep, match="no periodic state within 6 periods: the force"):
        march_lateral(
            chain, dem.rigid_wall(), [0.0], along, body, motion=motion, error=1e-5, search=search
        )


def test_the_range_of_mean_forces_holds_that_of_the_cycle():
    """Also where all slips, and the range is that of one state."""
    cycle = shaken([2e-6, 0.0], 10.0, arm_stiffness=np.full(2, np.inf), error=1e-3)[0].cycle
    mean = cycle.friction_force[:-1, cycle.axis].mean()
    low, high = cycle.mean_force_range
    assert low <= mean <= high
