"""Sensors on a structure against a plain integrator of the full equations, and at rest."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from beadwave.coupling import ModalDamping
from beadwave.coupling.spatial_wall import spatial_wall_of_modes
from beadwave.coupling.structure_sensors import sensed_in_march, sensed_in_run
from beadwave.rom import Columns, ReducedModel, modal

ZETA = 0.02


def pulse(t):
    """A force [N] that rises and falls smoothly within 0.2 ms, on top of a steady 5 N."""
    x = np.clip(t / 2e-4, 0.0, 1.0)
    return 5.0 + 100.0 * np.sin(np.pi * x) ** 4


def structure(n_rigid=0):
    """A random structure of six coordinates with two sensors, and its modes."""
    rng = np.random.default_rng(4)
    V = rng.standard_normal((6, 6))
    omega = 2 * np.pi * np.array([300.0, 900.0, 2e3, 4e3, 9e3, 17e3])
    omega[:n_rigid] = 0.0
    inverse = np.linalg.inv(V)
    K, M = inverse.T @ np.diag(omega**2) @ inverse, inverse.T @ inverse
    sense = rng.standard_normal((6, 2))
    columns = Columns(sense=sense, sense_names=("a", "b"))
    return ReducedModel(
        K, M, None, rng.standard_normal(6), None, "imported", 0, {}, columns=columns
    )


@pytest.mark.parametrize("n_rigid", [0, 1])
@pytest.mark.parametrize("zeta", [0.0, 0.02, 1.0, 1.4])
def test_what_a_run_moves_is_that_of_a_plain_integrator(n_rigid, zeta):
    reduced = structure(n_rigid)
    wall = modal(reduced)
    damping = np.where(wall.omega > 0, 2 * zeta * wall.omega, 0.0)

    def rates(t, state):
        q, p = np.split(state, 2)
        return np.append(p, wall.phi * (pulse(t) - 5.0) - damping * p - wall.omega**2 * q)

    t = np.linspace(0.0, 1e-3, 1001)
    exact = solve_ivp(rates, (0, t[-1]), np.zeros(12), "DOP853", t, rtol=1e-10, atol=1e-16)
    q, p = np.split(exact.y.T, 2, axis=1)
    a = np.array([rates(ti, y)[6:] for ti, y in zip(t, exact.y.T, strict=True)])
    of_sensors = wall.vectors.T @ reduced.columns.sense
    result = sensed_in_run(reduced, t, pulse(t), damping=ModalDamping(zeta))
    # the force is linear over a quarter of 1 us: (2 pi 17 kHz h)^2 / 12, 6e-5 of the fastest mode
    for field, y in zip(result, (q, p, a), strict=True):
        scale = np.abs(y @ of_sensors).max(axis=0)
        assert (np.abs(field - y @ of_sensors).max(axis=0) < 4e-5 * scale).all()


def test_a_steady_force_shows_nothing():
    result = sensed_in_run(structure(), np.linspace(0.0, 1e-3, 50), np.full(50, 7.0))
    assert all(not np.any(field) for field in result)


def test_a_march_is_read_by_newtons_law():
    """Modes that move by given q(t) under the forces that this takes."""
    rng = np.random.default_rng(1)
    omega, zeta = np.array([2e3, 5e3, 9e3]), np.full(3, ZETA)
    phi, load, sense = (rng.standard_normal((3, m)) for m in (3, 1, 2))
    wall = spatial_wall_of_modes(omega, zeta, phi, load=load, sense=sense)
    residual = 1e-9 * rng.standard_normal((2, 3))
    wall = wall._replace(sense_residual=residual)
    t = np.linspace(0.0, 1e-2, 200)
    q = np.sin(np.outer(t, [700.0, 1100.0, 1900.0]))
    p = np.array([700.0, 1100.0, 1900.0]) * np.cos(np.outer(t, [700.0, 1100.0, 1900.0]))
    a = -(np.array([700.0, 1100.0, 1900.0]) ** 2) * q
    shaker = np.cos(300.0 * t)[:, None]
    needed = a + 2 * zeta * omega * p + omega**2 * q - shaker @ load.T
    force = needed @ np.linalg.inv(phi.T)
    result = sensed_in_march(wall, q, p, force, shaker)
    moved = q @ sense + force @ residual.T
    np.testing.assert_allclose(result.displacement, moved - moved[0], atol=1e-12)
    np.testing.assert_allclose(result.velocity, p @ sense)
    np.testing.assert_allclose(result.acceleration, a @ sense, atol=1e-8 * np.abs(a).max())
