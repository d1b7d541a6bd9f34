"""A structure in three directions against a chain with friction: beside a plain integrator written
from the formulas, limits that are known, energy, symmetries."""

import numpy as np
import pytest

import dem
from coupling.errors import CouplingError
from coupling.spatial_march import SpatialSearch, march_space
from coupling.spatial_wall import (
    half_space,
    require_one_solution,
    spatial_wall_of_modes,
)
from dem.friction import tangential_law, tangential_modulus
from dem.lateral import LastSphere, march_lateral

R, E, NU, RHO, MU = 0.0127, 210e9, 0.3, 7800.0, 0.2
STEEL = dem.Flat(E, NU)
E_STAR, G_STAR = E / (1 - NU**2) / 2, tangential_modulus(E, NU, E, NU)


def row(count=1, **fields):
    return dem.row_of_spheres(R, RHO, E, NU, count=count, flat=STEEL, **fields)


def last(chain, velocity=(0.0, 0.0), **arm):
    law = tangential_law(MU, R, E, NU, np.inf, E, NU)
    mass = 4 / 3 * np.pi * R**3 * RHO
    return LastSphere(law, 0.4 * mass * R**2, np.array(velocity, float), **arm)


def random_wall(seed, n_modes=4, **columns):
    """Modes of 200 Hz to 6 kHz whose shapes point anywhere, of 0.3 to 3 kg at the contact."""
    rng = np.random.default_rng(seed)
    omega = 2 * np.pi * np.exp(rng.uniform(np.log(200), np.log(6000), n_modes))
    phi = rng.normal(size=(n_modes, 3)) / np.sqrt(rng.uniform(1, 10, n_modes))[:, None]
    return spatial_wall_of_modes(omega, rng.uniform(0.0, 0.05, n_modes), phi, **columns)


def plain_march(
    chain, wall, v0, body, *, duration, dt, deepest, y=None, shaker=None, n_bristles=1200, start=0.0
):
    """Runge and Kutta's method of order 4 over spheres, arm and modes; the contact is a row of
    bristles that a step moves as a whole, each back to its circle. Returns y and the bristles.

    y = x, v, u, u', psi, psi', q, q', slip; shaker = (force, circular frequency, phase).
    """
    n, k, m = chain.mass.size, wall.omega.size, np.asarray(chain.mass)
    gamma = np.zeros(n) if chain.gamma is None else np.asarray(chain.gamma)
    leaf, anchor = chain.springs
    arm, S = np.asarray(body.arm_stiffness), wall.residual_compliance
    free = np.isfinite(arm)
    arm = np.where(free, arm, 0.0)
    # more bristles at the edge of the largest contact: x = a sin(theta)
    edges = np.sqrt(deepest * R) * np.sin(np.linspace(0, np.pi / 2, n_bristles + 1))
    x_b, width = 0.5 * (edges[1:] + edges[:-1]), 2.0 * np.diff(edges)

    def contact(gap, q_pressure, b, slip, F):
        """Force on the wall (3,), bristles; S F by fixed point."""
        for _ in range(200):
            near = gap - S @ (F - [F0, 0, 0])
            d = max(near[0] - S[0, 0] * F0, 0.0)
            trial = np.where((d > x_b**2 / R)[:, None], b + (near[1:] - slip), 0.0)
            bound = MU * q_pressure * E_STAR / G_STAR * np.maximum(d - x_b**2 / R, 0.0)
            size = np.hypot(*trial.T)
            trial *= (np.minimum(bound, size) / np.where(size > 0, size, 1.0))[:, None]
            new = np.array([chain.A[-1] * d**1.5, *(G_STAR * width @ trial)])
            if np.abs(new - F).max() <= 1e-12 * np.abs(new).max() or not S.any():
                break
            F = new
        return new, trial, near[1:]

    static = dem.equilibrium(
        chain, dem.Wall(wall.omega, wall.zeta, wall.phi[:, 0].copy(), float(S[0, 0]))
    )
    F0 = static.force[-1]
    if y is None:
        y = np.concatenate([static.x, v0, [0, 0], body.velocity, np.zeros(4 + 2 * k)])
    ends = np.cumsum([n, n, 2, 2, 2, 2, k])
    offset = wall.phi[:, 0] @ static.q
    bristles, slip, F = np.zeros((n_bristles, 2)), np.zeros(2), np.array([F0, 0.0, 0.0])

    def rate(t, y):
        x, v, u, uv, psi, spin, q, p = np.split(y, ends)
        U, V = wall.phi.T @ q, wall.phi.T @ p
        gap = np.array([x[-1] - offset - U[0], *(u + R * psi - U[1:])])
        w = v[-1] - V[0]
        force, b, s = contact(gap, max(1 + gamma[-1] * w, 0.0), bristles, slip, F)
        f = np.append(chain.A[:-1] * np.maximum(x[:-1] - x[1:], 0) ** 1.5, force[0])
        approach = np.append(v[:-1] - v[1:], w)
        f = f * np.maximum(1 + gamma * approach, 0.0)
        net = np.append(0.0, f[:-1]) - f - leaf * (x - anchor) + chain.steady
        T = force[1:]
        push = wall.phi @ [f[-1] - F0, *T]
        if shaker is not None:
            push = push + wall.load[:, 0] * shaker[0] * np.cos(shaker[1] * t + shaker[2])
        a = push - 2 * wall.zeta * wall.omega * p - wall.omega**2 * q
        kappa = body.arm_rotation
        turn = (-R * T - kappa * psi) / body.inertia if np.isfinite(kappa) else np.zeros(2)
        across = np.where(free, -(T + arm * u) / m[-1], 0.0)
        return np.concatenate([v, net / m, uv, across, spin, turn, p, a]), (b, s, force)

    history = []
    for i in range(round(duration / dt)):
        t = start + i * dt
        k1, _ = rate(t, y)
        k2, _ = rate(t + dt / 2, y + dt / 2 * k1)
        k3, _ = rate(t + dt / 2, y + dt / 2 * k2)
        k4, _ = rate(t + dt, y + dt * k3)
        y = y + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        _, (bristles, slip, F) = rate(t + dt, y)
        history.append([*F, *slip])
    return np.split(y, ends), np.array(history)


OBLIQUE = {
    "coupled modes": (1, {}, {}, 0.0),
    "arm": (2, {"arm_stiffness": np.array([2e6, 5e6]), "arm_rotation": 300.0}, {}, 0.0),
    "clamped": (3, {"arm_rotation": np.inf}, {}, 0.0),
    "damped": (4, {}, {"dissipation": "hunt-crossley", "gamma": 1.0}, 0.0),
    "residual": (5, {}, {}, 4e-9),
}


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
        chain, wall, [0.1], body, duration=1.5e-4, dt=1e-7, deepest=5e-6, n_bristles=600
    )
    assert run.trajectory.v[-1, 0] == pytest.approx(y[1][0], abs=3e-6)
    np.testing.assert_allclose(run.lateral.sphere_t_v[-1], y[3], atol=3e-6)
    turned = np.array([-y[5][1], y[5][0]])
    np.testing.assert_allclose(R * run.lateral.sphere_spin[-1], R * turned, atol=6e-6)
    np.testing.assert_allclose(run.wall_p[-1], y[7], atol=6e-5 * np.abs(y[7]).max())
    assert run.trajectory.contact_force[-1, -1] == 0.0  # it has left the wall
    assert run.trajectory.energy_error < 1e-5


def test_a_wall_that_moves_along_its_normal_alone_is_that_of_the_march_with_friction_across():
    """March along the chain by another scheme, across behind it: velocities to the errors asked."""
    chain, simple = row(), dem.one_dof_wall(900.0, 0.5, 0.01)
    body = last(chain, (0.243, 0.0))
    along = dem.march_to_error(chain, simple, [0.1], duration=2e-4, error=1e-6).trajectory
    across = march_lateral(chain, simple, [0.1], along, body, error=1e-6)
    none = np.zeros_like(simple.phi)
    wall = spatial_wall_of_modes(
        simple.omega, simple.zeta, np.column_stack([simple.phi, none, none])
    )
    run = march_space(chain, wall, [0.1], body, duration=2e-4, error=1e-6)
    np.testing.assert_allclose(run.trajectory.v, along.v, atol=2e-7)
    np.testing.assert_allclose(run.lateral.sphere_t_v, across.sphere_t_v, atol=4e-7)
    np.testing.assert_allclose(run.lateral.friction_force, across.friction_force, atol=1e-3)
    assert run.lateral.dissipated_friction[-1] == pytest.approx(
        across.dissipated_friction[-1], rel=1e-5
    )


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
