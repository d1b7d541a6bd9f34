"""Chains under gravity: rest, motion against an independent integration, energy, friction."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from beadwave import coupling, dem
from beadwave.coupling.coupled_march import with_coupled_error
from beadwave.coupling.coupled_wall import CoupledWall
from beadwave.dem.sensitivities import Directions, march_with_sensitivities

G, SPEED, N = 9.80665, 0.3, 9
V0 = SPEED * (np.arange(N) == 0)
RUN = {"duration": 1.2e-3, "error": 1e-8, "n_save": 240}


def column(n=N, **fields):
    """Spheres of two sizes that stand on a steel flat, the first one in flight."""
    radius = np.where(np.arange(n) % 2, 0.0095, 0.008)
    given = {"gravity": G, "n_falling": 1, "flat": dem.Flat(210e9, 0.3)} | fields
    return dem.row_of_spheres(radius, 7800.0, 193e9, 0.3, **given)


MODES = dem.Wall(
    2 * np.pi * np.array([300.0, 2100.0, 9000.0]), np.array([0.01, 0.02, 0.0]),
    np.array([0.9, -1.4, 2.5]), 4e-9,
)  # fmt: skip
WALLS = {
    "rigid": dem.rigid_wall(),
    "one mass": dem.one_dof_wall(800.0, 0.3, 0.02),
    "modes and residual": MODES,
    "negative residual": MODES._replace(residual_compliance=-3e-9),
}


def indentation(gap, A, s):
    """delta of delta + s A delta^1.5 = gap by bisection, below the fold of a negative s."""
    low, high = 0.0, max(gap, 0.0) if s >= 0 else min(4 * max(gap, 0.0), (2 / (3 * s * A)) ** 2)
    for _ in range(70):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if middle + s * A * middle**1.5 < gap else (low, middle)
    return 0.5 * (low + high)


def at_rest(chain, wall):
    """x and q of a column that carries what is above, from the formulas."""
    weight = chain.mass * chain.gravity
    weight[: chain.n_falling] = 0.0
    carried = np.cumsum(weight)
    q = wall.phi * carried[-1] / wall.omega**2
    gap = (carried / chain.A) ** (2 / 3)
    gap[-1] += wall.phi @ q + wall.residual_compliance * carried[-1]
    return np.cumsum(gap[::-1])[::-1], q


def independent(chain, wall, v0, t):
    """(k, n) velocities by Newton's equations written out, DOP853 in pieces of a microsecond."""
    n, k, weight = chain.mass.size, wall.omega.size, chain.mass * chain.gravity

    def rate(_, y):
        x, v, q, p = np.split(y, [n, 2 * n, 2 * n + k])
        delta = np.append(np.maximum(x[:-1] - x[1:], 0.0), 0.0)
        delta[-1] = indentation(x[-1] - wall.phi @ q, chain.A[-1], wall.residual_compliance)
        force = chain.A * delta**1.5
        net = weight - force + np.append(0.0, force[:-1])
        damped = -2 * wall.zeta * wall.omega * p - wall.omega**2 * q + wall.phi * force[-1]
        return np.concatenate([v, net / chain.mass, p, damped])

    x, q = at_rest(chain, wall)
    start = np.concatenate([x, v0, q, np.zeros(k)])
    solution = solve_ivp(
        rate, t[[0, -1]], start, "DOP853", t, rtol=1e-11, atol=1e-15, max_step=2e-6
    )
    return solution.y.T[:, n : 2 * n]


@pytest.mark.parametrize("name", WALLS)
def test_a_column_rests_as_the_weight_above_says(name):
    chain, wall = column(), WALLS[name]
    x, q = at_rest(chain, wall)
    static = dem.equilibrium(chain, wall)
    carried = np.append(0.0, np.cumsum(G * chain.mass[1:]))
    assert np.abs(static.force / carried[-1] - carried / carried[-1]).max() < 1e-9
    assert np.abs(static.x - x).max() < 1e-9 * x.max()
    assert np.allclose(static.q / q, 1.0, rtol=1e-9) if q.size else static.q.size == 0
    assert static.x[0] == static.x[1]  # in flight, just touching


@pytest.mark.slow
@pytest.mark.parametrize("name", WALLS)
def test_a_column_moves_as_an_independent_integration_says(name):
    chain, wall = column(), WALLS[name]
    run = dem.march_to_error(chain, wall, V0, **RUN).trajectory
    difference = np.abs(run.v - independent(chain, wall, V0, run.t)).max()
    assert difference < 1e-6 * SPEED
    weightless = dem.march_to_error(chain._replace(gravity=0.0), wall, V0, **RUN).trajectory
    assert np.abs(run.v - weightless.v).max() > 1e-3 * SPEED  # what the test would miss
    assert run.energy_error < 1e-8
    fallen = G * (run.x - run.x[0]) @ chain.mass
    assert np.abs(run.work_gravity - fallen).max() < 1e-12 * np.abs(fallen).max()


SCHEMES = {"implicit": "energy4", "composed": "kahan-li6", "exact": "split6"}


@pytest.mark.slow
@pytest.mark.parametrize("kind", SCHEMES)
def test_every_kind_of_scheme_takes_gravity(kind):
    chain, wall = column(), MODES
    rkn = dem.march_to_error(chain, wall, V0, **RUN).trajectory
    search = dem.StepSearch(SCHEMES[kind])
    run = dem.march_to_error(chain, wall, V0, **(RUN | {"error": 1e-6}), search=search).trajectory
    assert run.scheme == SCHEMES[kind]
    assert np.abs(run.v - rkn.v).max() < 1e-6 * SPEED
    assert run.energy_error < 1e-7


def test_a_coupled_wall_and_sensitivities_take_gravity():
    chain, wall = column(), MODES._replace(residual_compliance=0.0)
    usual = dem.march_to_error(chain, wall, V0, **RUN).trajectory
    D = np.diag(2 * wall.zeta * wall.omega)
    coupled = CoupledWall(wall.omega, D, wall.phi, wall.phi, 0.0)
    # its tolerance is of a step: touches and partings leave more, 1e-7 to 2e-6 by the processor
    found = coupling.march_coupled(chain, coupled, V0, duration=1.2e-3, error=1e-11, n_save=240)
    found = with_coupled_error(chain, coupled, V0, found, error=1e-11)
    assert np.abs(found.v - usual.v).max() < found.error_estimate * SPEED
    assert found.error_estimate < 1e-4 and found.energy_error < found.error_estimate
    run = march_with_sensitivities(chain, wall, V0, duration=1.2e-3, dt=0.5e-6, observed=range(N))
    assert np.abs(run.v[::10] - usual.v).max() < 1e-5 * SPEED


@pytest.mark.slow
@pytest.mark.parametrize("damped", [False, True])
def test_a_batch_takes_gravity_as_single_marches_do(damped):
    gravity = np.array([0.0, 3.0, G])
    chain = column(gravity=0.0)
    if damped:
        chain = chain._replace(dissipation="hunt-crossley", gamma=np.full(N, 0.1))
    wall = MODES._replace(residual_compliance=0.0)
    chains = dem.Chains(chain._replace(gravity=gravity), wall, V0)
    batch = dem.march_batch(chains, duration=1.2e-3, dt=1e-6, n_save=240, threads=1)
    assert batch.energy_error.max() < 1e-6
    for i, g in enumerate(gravity):
        single = dem.march(
            chain._replace(gravity=g), wall, V0, duration=1.2e-3, dt=1e-6, n_save=240
        )
        assert np.abs(batch.v[i] - single.v).max() < 1e-10 * SPEED


def test_a_dropped_sphere_bounces_back_to_where_it_fell_from():
    ball = dem.row_of_spheres(0.01, 7800.0, 210e9, 0.3, count=1, gravity=G, n_falling=1)
    height = 0.5e-3
    v0 = [np.sqrt(2 * G * height)]
    run = dem.march_to_error(
        ball, dem.rigid_wall(), v0, duration=15e-3, error=1e-6, n_save=15000
    ).trajectory
    # the contact, a ten thousandth of the height deep, is where the fall ends
    assert -run.x.min() == pytest.approx(height, rel=1e-3)


def test_what_holds_no_weight_is_refused():
    with pytest.raises(dem.NoEquilibrium, match=r"nothing supports a weight of [0-9.]* N;"):
        dem.equilibrium(column(flat=None), None)
    with pytest.raises(dem.NoEquilibrium, match="nothing supports a weight of"):
        dem.equilibrium(column(), dem.dashpot_wall(100.0))
    with pytest.raises(dem.NoEquilibrium, match=r"weight of .* pulls the spheres off the wall"):
        dem.equilibrium(column(gravity=-G), dem.rigid_wall())
    with pytest.raises(dem.InvalidChain, match="n_falling = 10"):
        dem.equilibrium(column(n_falling=10), dem.rigid_wall())


def test_leaf_springs_share_the_weight():
    k = 1e6 * column().mass
    chain = column(n_falling=0, leaf_stiffness=k, gravity=-G)  # hangs below the wall
    rest = dem.equilibrium(chain, dem.rigid_wall())
    assert np.abs(rest.x + 1e-6 * G).max() < 1e-9 * 1e-6 * G  # each on its own spring
    stood = chain._replace(gravity=G)
    static = dem.equilibrium(stood, dem.rigid_wall())
    net = G * chain.mass - k * static.x + np.append(0.0, static.force[:-1]) - static.force
    assert np.abs(net).max() < 1e-8 * G * chain.mass.sum()


# --- friction ----------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("pull", [0.0, 0.02])
def test_a_sphere_in_guides_slides_to_rest_as_coulomb_says_and_stays(pull):
    friction, speed = 0.05, 0.02
    ball = dem.row_of_spheres(
        0.01, 7800.0, 210e9, 0.3, count=2, flat=None, friction=[friction, 0.0], n_falling=2
    )
    m = ball.mass[0]
    ball = ball._replace(gravity=pull / m)
    run = dem.march(ball, None, [-speed, 0.3], duration=30e-3, dt=1e-5, n_save=300)  # apart
    t, rate = run.t, (friction + pull) / m  # the weight slows it down as well
    stops = speed / rate
    way = np.where(t < stops, -speed * t + 0.5 * rate * t**2, -0.5 * speed * stops)
    assert stops < t[-1]
    # drifts between kicks: one step of second order where it stops
    assert np.abs(run.x[:, 0] - way).max() < speed * run.dt
    assert np.all(run.v[t > stops + run.dt, 0] == 0.0)
    assert run.dissipated_guides[-1] == pytest.approx(friction * 0.5 * speed * stops, rel=1e-4)
    assert run.energy_error < 1e-6


@pytest.mark.usefixtures("kernels")
def test_a_weight_changes_what_a_contact_does_to_the_velocities():
    chain, wall = column(), MODES._replace(residual_compliance=0.0)
    n, k = N, wall.omega.size
    towards = Directions(np.zeros((n, 1)), np.zeros((n, 1)), np.zeros((n, 1)), np.zeros(1),
                         *np.zeros((3, k, 1)))  # fmt: skip
    towards.A[4, 0] = chain.A[4]
    run = {"duration": 0.5e-3, "dt": 0.5e-6, "observed": range(n)}
    sensitivities = march_with_sensitivities(chain, wall, V0, towards, **run)

    def moved(share):
        A = chain.A * (1.0 + share * (np.arange(n) == 4))
        return march_with_sensitivities(chain._replace(A=A), wall, V0, **run).v

    slope = (moved(1e-5) - moved(-1e-5)) / 2e-5
    # before the wave comes only the static state has changed
    assert np.abs(sensitivities.dv[..., 0] - slope).max() < 1e-5 * np.abs(slope).max()


@pytest.mark.slow
def test_a_column_sticks_in_its_guides_and_its_ledger_closes():
    friction = 0.3 * G * column().mass
    chain = column(friction=friction)
    run = dem.march_to_error(chain, MODES, V0, duration=1.2e-3, error=1e-4, n_save=240).trajectory
    free = dem.march_to_error(column(), MODES, V0, duration=1.2e-3, error=1e-4).trajectory
    assert run.scheme == "verlet"
    assert run.dissipated_guides[-1] > 1e-3 * run.energy_kinetic[0]
    assert np.all(np.diff(run.dissipated_guides) >= 0.0)
    assert run.energy_error < 1e-5
    assert np.any(run.v[:, -1] == 0.0)
    assert free.dissipated_guides.max() == 0.0
    finer = dem.march_to_error(chain, MODES, V0, duration=1.2e-3, error=1e-5, n_save=240).trajectory
    assert np.abs(finer.v - run.v).max() < 1e-4 * SPEED


def test_friction_needs_a_scheme_that_never_goes_back():
    chain = column(friction=0.1)
    for scheme in ("rkn6", "energy2", "suzuki4"):
        with pytest.raises(dem.InvalidChain, match="takes no friction; take verlet or leapfrog"):
            dem.march(chain, MODES, V0, duration=1e-4, dt=1e-7, scheme=scheme)
    with pytest.raises(dem.InvalidChain, match="touches no guides"):
        column(friction=0.1, leaf_stiffness=10.0, n_falling=0)
    with pytest.raises(dem.InvalidChain, match="no sensitivities"):
        march_with_sensitivities(chain, MODES, V0, duration=1e-4, dt=1e-6, observed=[0])
