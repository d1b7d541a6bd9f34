"""A structure in three directions against a chain with friction: beside a plain integrator written
from the formulas, limits that are known, energy, symmetries."""

from itertools import pairwise

import numpy as np
import pytest

from beadwave import dem
from beadwave.coupling.errors import CouplingError
from beadwave.coupling.spatial_march import SpatialSearch, body_of, march_space
from beadwave.coupling.spatial_wall import (
    half_space,
    require_one_solution,
    spatial_wall_of_modes,
)
from beadwave.dem.checks import InvalidChain
from beadwave.dem.friction import tangential_law
from beadwave.dem.kernels.arguments import Steps

from bristles import Bristles, plain_march
from spatial_contact import MU, NU, E, R, last, random_wall, row

OBLIQUE = {
    "coupled modes": (1, {}, {}, 0.0),
    "arm": (2, {"arm_stiffness": np.array([2e6, 5e6]), "arm_rotation": 300.0}, {}, 0.0),
    "clamped": (3, {"arm_rotation": np.inf}, {}, 0.0),
    "damped": (4, {}, {"dissipation": "hunt-crossley", "gamma": 1.0}, 0.0),
    "residual": (5, {}, {}, 4e-9),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", OBLIQUE)
def test_an_oblique_impact_on_coupled_modes_is_that_of_a_plain_integrator(name):
    """Velocities to 3e-5 of the speed, twice what the step and the bristles of the plain one leave;
    walls of four modes, one sphere at 0.1 m/s and 0.08 m/s across."""
    seed, arm, fields, s = OBLIQUE[name]
    chain, wall = row(**fields), random_wall(seed)
    rng = np.random.default_rng(seed)
    S = s * rng.normal(size=(3, 3))
    wall = wall._replace(residual_compliance=0.5 * (S + S.T))
    body = last(chain, (0.06, 0.05), **arm)
    run = march_space(chain, wall, [0.1], body, duration=1.5e-4, error=1e-5, n_save=100)
    y, _ = plain_march(
        chain, wall, [0.1], body, duration=1.5e-4, dt=1e-7, bristles=Bristles(5e-6, 600)
    )
    assert run.trajectory.v[-1, 0] == pytest.approx(y[1][0], abs=3e-6)
    np.testing.assert_allclose(run.lateral.sphere_t_v[-1], y[3], atol=3e-6)
    turned = np.array([-y[5][1], y[5][0]])
    np.testing.assert_allclose(R * run.lateral.sphere_spin[-1], R * turned, atol=6e-6)
    np.testing.assert_allclose(run.wall_p[-1], y[7], atol=6e-5 * np.abs(y[7]).max())
    assert run.trajectory.contact_force[-1, -1] == 0.0  # it has left the wall
    assert run.trajectory.energy_error < 1e-5


def test_friction_leaves_the_motion_along_the_chain_alone():
    """A wall that moves along its normal alone; march along the chain by another scheme."""
    chain, simple = row(), dem.one_dof_wall(900.0, 0.5, 0.01)
    along = dem.march_to_error(chain, simple, [0.1], duration=2e-4, error=1e-6).trajectory
    none = np.zeros_like(simple.phi)
    wall = spatial_wall_of_modes(
        simple.omega, simple.zeta, np.column_stack([simple.phi, none, none])
    )
    run = march_space(chain, wall, [0.1], last(chain, (0.243, 0.0)), duration=2e-4, error=1e-6)
    np.testing.assert_allclose(run.trajectory.v, along.v, atol=2e-7)
    assert np.abs(run.lateral.friction_force).max() > 0.1 * along.contact_force.max()


PRESSED = {"count": 2, "preload": 40.0}
RUBS = tangential_law(0.3, R, E, NU, R, E, NU)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["coupled modes", "damped", "residual"])
def test_two_rubbing_contacts_on_coupled_modes_are_those_of_a_plain_integrator(name):
    """Velocities to 3e-5 of the speed, as above; the spheres pressed together."""
    seed, _, fields, s = OBLIQUE[name]
    chain, wall = row(**PRESSED, **fields), random_wall(seed)
    rng = np.random.default_rng(seed)
    S = s * rng.normal(size=(3, 3))
    wall = wall._replace(residual_compliance=0.5 * (S + S.T))
    body = last(chain, (0.05, 0.03))._replace(before=RUBS)
    options = {"duration": 1e-4}
    run = march_space(chain, wall, [0.1, 0.0], body, error=1e-5, n_save=100, **options)
    y, _ = plain_march(
        chain, wall, [0.1, 0.0], body, dt=1e-7, bristles=Bristles(8e-6, 600), **options
    )
    np.testing.assert_allclose(run.trajectory.v[-1], y[1], atol=3e-6)
    np.testing.assert_allclose(run.lateral.sphere_t_v[-1], y[3], atol=3e-6)
    turned = np.array([-y[5][1], y[5][0]])
    np.testing.assert_allclose(R * run.lateral.sphere_spin[-1], R * turned, atol=6e-6)
    free = march_space(
        chain, wall, [0.1, 0.0], body._replace(before=None), error=1e-4, n_save=100, **options
    )
    moved = np.abs(free.lateral.sphere_t_v[-1] - run.lateral.sphere_t_v[-1]).max()
    assert moved > 1e-3  # the sphere before holds it
    assert run.lateral.energy_error < 1e-5


def test_a_wall_turned_about_its_normal_turns_the_answer():
    """By 90 degrees, t1 to t2 and t2 to -t1; to 1e-9."""
    chain, wall = row(), random_wall(6)
    turn = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
    S = 3e-9 * np.array([[1.0, 0.3, -0.2], [0.3, 1.2, 0.4], [-0.2, 0.4, 0.8]])
    wall = wall._replace(residual_compliance=S)
    turned = wall._replace(phi=wall.phi @ turn.T, residual_compliance=turn @ S @ turn.T)
    options = {"duration": 1.5e-4, "n_save": 50, "search": SpatialSearch(dt=2e-7)}
    a = march_space(chain, wall, [0.1], last(chain, (0.06, 0.05)), **options)
    b = march_space(chain, turned, [0.1], last(chain, (-0.05, 0.06)), **options)
    np.testing.assert_allclose(
        b.lateral.sphere_t_v, a.lateral.sphere_t_v @ turn[1:, 1:].T, atol=1e-10
    )
    np.testing.assert_allclose(b.contact_force, a.contact_force @ turn.T, atol=1e-7)
    np.testing.assert_allclose(b.trajectory.v, a.trajectory.v, atol=1e-10)


def test_a_mirrored_wall_mirrors_the_answer():
    chain, wall = row(), random_wall(7)
    mirror = np.diag([1.0, 1.0, -1.0])
    options = {"duration": 1.5e-4, "n_save": 50, "search": SpatialSearch(dt=2e-7)}
    a = march_space(chain, wall, [0.1], last(chain, (0.06, 0.05)), **options)
    mirrored = wall._replace(phi=wall.phi @ mirror)
    b = march_space(chain, mirrored, [0.1], last(chain, (0.06, -0.05)), **options)
    np.testing.assert_allclose(b.contact_force, a.contact_force @ mirror, atol=1e-8)


@pytest.mark.slow
def test_a_residual_compliance_stands_for_modes_that_are_fast():
    """Six modes of 3 MHz of the same static compliance; they swing by themselves, to 2e-3."""
    chain, slow = row(), random_wall(8)
    S = 4e-9 * np.array([[1.0, 0.3, -0.2], [0.3, 1.2, 0.4], [-0.2, 0.4, 0.8]])
    values, vectors = np.linalg.eigh(S)
    omega = 2 * np.pi * 3e6
    fast = spatial_wall_of_modes(
        np.append(slow.omega, np.full(3, omega)),
        np.append(slow.zeta, np.full(3, 0.7)),
        np.vstack([slow.phi, omega * (vectors * np.sqrt(values)).T]),
    )
    options = {"duration": 1.5e-4, "n_save": 50}
    body = last(chain, (0.06, 0.05))
    a = march_space(chain, slow._replace(residual_compliance=S), [0.1], body, error=1e-5, **options)
    b = march_space(chain, fast, [0.1], body, search=SpatialSearch(dt=2e-9), **options)
    np.testing.assert_allclose(b.lateral.sphere_t_v[-1], a.lateral.sphere_t_v[-1], atol=2e-4)
    assert b.trajectory.v[-1, 0] == pytest.approx(a.trajectory.v[-1, 0], abs=2e-4)


@pytest.mark.slow
def test_a_stated_error_is_above_the_true_one_in_random_impacts():
    """Chains of one to three spheres; the ledger closes, and friction's heat never falls."""
    for seed in range(6):
        rng = np.random.default_rng(100 + seed)
        n = int(rng.integers(1, 4))
        chain = row(n, dissipation="hunt-crossley", gamma=rng.uniform(0, 2)) if seed % 2 else row(n)
        wall, v0 = random_wall(seed), np.append(rng.uniform(0.05, 0.3), np.zeros(n - 1))
        body = last(chain, rng.uniform(-0.1, 0.1, 2) if n == 1 else (0.0, 0.0))
        options = {"duration": 1.5e-4 * n, "n_save": 40}
        run = march_space(chain, wall, v0, body, error=1e-4, **options)
        fine = march_space(chain, wall, v0, body, error=2e-6, **options)
        true = np.abs(run.trajectory.v - fine.trajectory.v).max() / np.abs(v0).max()
        assert true < run.trajectory.error_estimate
        assert run.trajectory.energy_error < 1e-4
        assert np.all(np.diff(run.lateral.dissipated_friction) >= 0.0)
        assert np.all(np.diff(run.trajectory.dissipated_wall) > -1e-12)


def test_a_residual_compliance_that_leaves_no_unique_force_is_refused():
    """1/k + S turns indefinite along n, along t, or by the coupling of both where all slips."""
    k = (4.66e7, 3.84e7)
    require_one_solution(-np.diag([0.9 / k[0], 0.9 / k[1], 0.9 / k[1]]), k, MU)
    coupling = np.zeros((3, 3))
    coupling[0, 1] = coupling[1, 0] = 6.0 / k[0]
    for S in (
        -np.diag([1.1 / k[0], 0, 0]), -np.diag([0, 0, 1.1 / k[1]]), coupling
    ):  # fmt: skip
        with pytest.raises(CouplingError, match="no unique force"):
            require_one_solution(S, k, MU)
    chain, wall = row(), random_wall(1)._replace(residual_compliance=-half_space(E, NU, 2e-5))
    with pytest.raises(CouplingError, match="no unique force"):
        march_space(chain, wall, [0.1], last(chain), duration=1e-4, error=1e-4)


def test_the_half_spaces_ratio_is_mindlins():
    """(2 - nu) / (2 (1 - nu)) of the tangential over the normal compliance."""
    C = half_space(E, NU, 1e-3)
    assert C[1, 1] / C[0, 0] == pytest.approx((2 - NU) / (2 * (1 - NU)), rel=1e-12)
    assert not (C - np.diag(np.diag(C))).any()


@pytest.mark.parametrize(
    ("arm", "velocity", "sentence"),
    [
        ({"arm_stiffness": np.array([np.inf, 0.0])}, (0.1, 0.0), "clamps"),
        ({"arm_stiffness": np.array([-1.0, 0.0])}, (0.0, 0.0), "arm_stiffness"),
        ({"arm_rotation": -1.0}, (0.0, 0.0), "arm_rotation"),
        ({"arm_rotation": np.nan}, (0.0, 0.0), "arm_rotation"),
        ({"inertia": 0.0}, (0.0, 0.0), "inertia"),
    ],
)
def test_a_sphere_that_cannot_be_is_refused(arm, velocity, sentence):
    chain = row()
    inertia = arm.pop("inertia", None)
    body = last(chain, velocity, **arm)
    body = body if inertia is None else body._replace(inertia=inertia)
    with pytest.raises(InvalidChain, match=sentence):
        march_space(chain, random_wall(1), [0.1], body, duration=1e-4, error=1e-4)


@pytest.mark.slow
def test_two_directions_before_a_residual_compliance_are_of_order_two():
    """An error of 1e-6 takes 12,000 steps; springs returned along the radius took 1.2 million."""
    S = 4e-9 * np.array([[1.0, 0.3, -0.2], [0.3, 1.2, 0.4], [-0.2, 0.4, 0.8]])
    chain, wall = row(), random_wall(6)._replace(residual_compliance=S)
    options = {"duration": 1e-3, "n_save": 100}
    run = march_space(chain, wall, [0.1], last(chain, (0.06, 0.05)), error=1e-6, **options)
    assert run.trajectory.n_steps < 40_000
    rough = march_space(chain, wall, [0.1], last(chain, (0.06, 0.05)), error=1e-4, **options)
    true = np.abs(rough.lateral.sphere_t_v - run.lateral.sphere_t_v).max() / 0.1
    assert true < rough.lateral.error_estimate


def test_dampers_before_a_residual_compliance_are_of_order_two():
    """Marches by 100 to 6400 steps, each halving within 0.1 of 2: by the contact's force of a step
    before in the damper's share, the last one fell to 1.34."""
    S = 4e-9 * np.array([[1.0, 0.3, -0.2], [0.3, 1.2, 0.4], [-0.2, 0.4, 0.8]])
    chain, wall = (
        row(dissipation="hunt-crossley", gamma=1.0),
        random_wall(6)._replace(residual_compliance=S),
    )
    body = body_of(chain, wall, [0.1], last(chain, (0.06, 0.05)))
    speeds = []
    for n in 100 * 2 ** np.arange(7):
        start, h = body.at_rest(), 1.5e-4 / n
        start.motion.v[:], start.motion.u_v[:] = 0.1, [0.06, 0.05]
        system = body.stepped(h)
        body.settle(start, system, 0.0)
        saved = body.march(start, system, 0.0, Steps(h, 20, n // 20))
        turning = R * saved.across[:, 3]
        speeds.append(np.concatenate([saved.v, saved.across[:, 1], turning], axis=1))
    changes = np.array([np.abs(b - a).max() for a, b in pairwise(speeds)])
    np.testing.assert_allclose(np.log2(changes[:-1] / changes[1:]), 2.0, atol=0.1)


def test_what_nothing_moves_stays_at_rest():
    """No speed, and no force at the wall: the contact has no rate, and a step is none the less
    found. Marches that are alike state a thirtieth of the error asked."""
    chain = row()
    run = march_space(chain, random_wall(1), [0.0], last(chain), duration=1e-4, error=1e-4)
    assert not run.trajectory.v.any()
    assert not run.lateral.friction_force.any()
    assert run.lateral.error_estimate == pytest.approx(1e-4 / 30)


def test_few_cells_are_in_the_stated_error_and_more_are_taken_to_an_error():
    """Against 2048 cells, by the same steps: eight cells err by more than their steps do."""
    chain, wall = row(), random_wall(1)
    body = last(chain, (0.06, 0.05))
    options = {"duration": 1.5e-4, "n_save": 40}
    runs = [
        march_space(
            chain, wall, [0.1], body, **options, search=SpatialSearch(dt=1e-7, n_cells=n)
        ) for n in (8, 2048)
    ]  # fmt: skip
    off = np.abs(runs[0].lateral.sphere_t_v - runs[1].lateral.sphere_t_v).max() / 0.1
    assert off < runs[0].lateral.error_estimate
    search = SpatialSearch(n_cells=8)
    run = march_space(chain, wall, [0.1], body, **options, error=1e-3, search=search)
    assert run.lateral.n_cells > 8
    assert np.abs(run.lateral.sphere_t_v - runs[1].lateral.sphere_t_v).max() < 1e-3 * 0.1


@pytest.mark.parametrize("detuned", [-0.13, -0.2])
def test_a_mode_whose_period_is_near_the_first_step_does_not_blow_up(detuned):
    """Pressed for 2 ms against a fast mode of 2e-9 m/N: kicked once in every period less a
    fiftieth, it left no finite state."""
    chain, wall = row(preload=40.0), random_wall(1)
    body = last(chain, arm_stiffness=np.full(2, 2e6), arm_rotation=np.inf)
    omega = (2 * np.pi + detuned) / 5e-6  # 0.3 over the contact's rate, in a hundredth of 2 ms
    stiff = wall._replace(
        omega=np.append(wall.omega, omega),
        zeta=np.append(wall.zeta, 0.005),
        phi=np.vstack([wall.phi, omega * np.array([4e-5, 2e-5, 1e-5])]),
        load=np.zeros((5, 0)),
        sense=np.zeros((5, 0)),
    )
    options = {"duration": 2e-3, "n_save": 100}
    run = march_space(chain, stiff, [0.05], body, **options, error=1e-2)
    fine = march_space(chain, stiff, [0.05], body, **options, error=1e-3)
    true = np.abs(run.lateral.sphere_t_v - fine.lateral.sphere_t_v).max() / 0.05
    assert true < run.lateral.error_estimate <= 1e-2
    assert run.lateral.energy_error < 1e-2 and fine.lateral.energy_error < 1e-3
