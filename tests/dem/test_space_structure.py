"""Packings with friction on the points of a structure: DOP853, the ledger, what is refused."""

import numpy as np
import pytest

from beadwave import dem
from beadwave.dem import space

from packing_reference import rubbing_reference

R, RHO, E, NU = 6e-3, 7800.0, 210e9, 0.3
D = 2 * R


def hexagonal(columns, rows, coefficient):
    """A packing whose last row touches a point of its own each."""
    lattice = space.lattice("hexagonal", (columns, rows))
    pairs, arm = space.touching(lattice.centre, lattice.period, 1.0 + space.CLOSE)
    last = np.flatnonzero(lattice.place[:, 1] == rows - 1)
    face = space.Plane(
        last, np.array([0.0, 1.0, 0.0]), np.zeros(columns), 210e9, 0.3, point=np.arange(columns)
    )
    packing = space.packing_of(
        D * lattice.centre, R, RHO, E, NU, pairs=pairs, arm=D * arm, planes=[face]
    )
    return packing._replace(friction=np.full(len(packing.A), coefficient))


def structure(points, seed=3):
    """Modes from 2 to 60 kHz that move points along all directions."""
    rng = np.random.default_rng(seed)
    omega = 2 * np.pi * np.geomspace(2e3, 60e3, 6)
    directions = np.tile(np.eye(3)[[1, 0, 2]], (points, 1))
    return space.Structure(
        omega, np.full(6, 0.01), rng.normal(size=(3 * points, 6)), np.repeat(np.arange(points), 3),
        directions, np.tile([-6e-10, -5e-10], (points, 1)),
    )  # fmt: skip


def struck(packing, sphere, velocity):
    v0 = np.zeros((len(packing.mass), 3))
    v0[sphere] = velocity
    return v0


def test_a_hexagonal_packing_with_friction_on_a_structure_meets_dop853():
    packing, behind = hexagonal(3, 2, 0.3), structure(3)
    v0 = struck(packing, 1, [0.05, 0.3, 0.02])
    run = space.march_to_error(packing, behind, v0, duration=5e-5, error=1e-4, n_save=50)
    # its own errors are below 1e-6: with tolerances of 1e-7 and 1e-8 both differ by as much
    _, v, spin = rubbing_reference(packing, v0, run.t, behind, tolerance=1e-7, longest=1e-6)
    speed = np.linalg.norm(v0)
    true = np.linalg.norm(run.velocity - v, axis=2).max() / speed
    assert true <= run.error_estimate <= 1e-4
    whirl = np.linalg.norm((run.angular_velocity - spin) * R, axis=2).max()
    assert whirl <= 4e-4 * speed
    assert run.energy_error <= 1e-6
    # contacts do slip and rub, at the structure too, and push it across
    last = run.pairs[:, 1] < 0
    assert run.dissipated_friction[-1] > 1e-3 * run.energy_kinetic[0]
    assert np.linalg.norm(run.pair_friction[:, last], axis=2).max() > 1.0
    assert np.abs(run.wall_force[:, 1::3]).max() > 0.5


def test_what_the_structure_gets_across_is_what_friction_gives():
    """The forces on its points are the contacts', along the normal and across."""
    packing, behind = hexagonal(4, 4, 0.2), structure(4)
    run = space.march_to_error(
        packing, behind, struck(packing, 1, [0.0, 0.3, 0.0]), duration=3e-4, error=1e-4, n_save=200
    )
    last = np.flatnonzero(run.pairs[:, 1] < 0)
    assert run.pairs[last, 1].tolist() == [-2, -3, -4, -5]
    np.testing.assert_allclose(run.wall_force[:, ::3], run.pair_force[:, last], atol=1e-9)
    for k, axis in ((1, 0), (2, 2)):
        np.testing.assert_allclose(
            run.wall_force[:, k::3], run.pair_friction[:, last, axis], atol=1e-9
        )
    assert run.energy_error < 1e-6
    assert np.all(np.diff(run.dissipated_friction) >= 0.0)


def test_the_way_across_a_swinging_structure_has_order_two():
    """The mean velocity of a point over a step: with that at its end the ledger, which counts the
    way of friction, would close to order one."""
    packing, behind = hexagonal(3, 3, 0.3), structure(3)
    v0 = struck(packing, 1, [0.0, 0.3, 0.0])
    coarse, fine = (
        space.march(packing, behind, v0, duration=1.5e-4, dt=dt, n_save=30) for dt in (1e-7, 2.5e-8)
    )
    assert coarse.energy_error > 8.0 * fine.energy_error


@pytest.mark.usefixtures("kernels")
def test_points_that_a_structure_has_not_are_refused():
    packing, v0 = hexagonal(3, 2, 0.1), np.zeros((6, 3))
    with pytest.raises(dem.InvalidChain, match="the point 2 of a structure that has 2"):
        space.march(packing, structure(2), v0, duration=1e-4, dt=1e-7)


def test_contacts_that_yield_before_a_structure_close_the_ledger():
    """Contacts at the structure share their approach with its residual compliance."""
    packing, behind = hexagonal(3, 2, 0.0), structure(3)
    packing = packing._replace(yield_overlap=np.full(len(packing.A), 1e-6), friction=None)
    v0 = struck(packing, 1, [0.0, 0.3, 0.0])
    run = space.march_to_error(packing, behind, v0, duration=1.5e-4, error=1e-5, n_save=30)
    assert run.energy_error < 1e-7
    assert run.dissipated_contact[-1] > 0.1 * run.energy_kinetic[0]
    at_structure = run.pairs[:, 1] <= space.MOVING
    assert run.pair_force[:, at_structure].max() > packing.A[-1] * 1e-6**1.5
