"""Checks of a reduced model: each passes a sound model and fires on a broken one."""

import numpy as np
import pytest
import scipy.sparse as sp

from beadwave.rom import (
    Selection,
    craig_bampton,
    fixed_interface_hz,
    full_order,
    health,
)

N, HELD = 40, 5
STIFFNESS, MASS = 3.0e8, 0.02


def free_chain(to_ground=0.0):
    """Masses and springs in a row, the first on a spring of its own to the ground."""
    diagonal = np.r_[1.0, np.full(N - 2, 2.0), 1.0]
    K = sp.diags_array([-np.ones(N - 1), diagonal, -np.ones(N - 1)], offsets=[-1, 0, 1]).tolil()
    K[0, 0] += to_ground
    return STIFFNESS * K.tocsc(), MASS * sp.eye_array(N, format="csc")


def test_fixed_interface_frequencies_are_those_of_the_part_between_its_boundaries():
    """N - 5 masses with one end held by the boundary, the other free: a closed form, and all modes
    kept."""
    K, M = free_chain()
    n = N - HELD
    w = np.eye(N)[-1]
    reduced = craig_bampton(K, M, w, np.arange(n, N), Selection(n_modes=n))
    j = np.arange(1, n + 1)
    omega = 2 * np.sqrt(STIFFNESS / MASS) * np.sin((2 * j - 1) * np.pi / (2 * (2 * n + 1)))
    np.testing.assert_allclose(health(reduced).fixed_interface_hz, omega / (2 * np.pi), rtol=1e-9)
    assert fixed_interface_hz(full_order(K, M, w)) == ()


@pytest.mark.filterwarnings("error")
def test_a_model_without_mass_is_reported():
    K, M = free_chain()
    massless = full_order(K, M, np.eye(N)[-1])._replace(M=np.zeros((N, N)))
    assert "M is not positive definite" in health(massless).findings[0]


def test_the_extreme_eigenvalues_of_a_large_wall_are_those_of_the_chain_it_is():
    """K of n equal masses and springs between two walls: 2 - 2 cos(pi j / (n + 1)), j = 1 .. n."""
    n = 700
    K = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    result = health(full_order(K, np.eye(n), np.eye(n)[0]))
    ends = 2 - 2 * np.cos(np.pi * np.array([1, n]) / (n + 1))
    assert result.lowest_stiffness == pytest.approx(ends[0] / ends[1], rel=2e-3)
    assert result.lowest_mass == pytest.approx(1.0)


@pytest.mark.parametrize(("k", "least"), [(3.0e8, 1.0), (0.0, 0.0), (-3.0e8, 0.0)])
def test_one_mass_on_one_spring_has_one_stiffness_which_is_none_where_it_holds_nothing(k, least):
    one = full_order([[1.0]], [[MASS]], [1.0])._replace(K=np.array([[k]]))
    result = health(one)
    assert (result.lowest_mass, result.lowest_stiffness) == (1.0, least)
    assert result.n_rigid == (k == 0)


def test_a_coordinate_without_mass_of_its_own_is_measured_as_it_stands():
    """[[1, b], [b, 0]] has the eigenvalues (1 -+ sqrt(1 + 4 b^2)) / 2."""
    b = 0.3
    two = full_order(np.eye(2), np.eye(2), [1.0, 0.0])._replace(M=np.array([[1.0, b], [b, 0.0]]))
    root = np.sqrt(1 + 4 * b**2)
    assert health(two).lowest_mass / ((1 - root) / (1 + root)) == pytest.approx(1.0, rel=1e-12)


def test_units_of_the_coordinates_change_no_measure():
    K, M = free_chain(STIFFNESS)
    plain = full_order(K, M, np.eye(N)[-1])
    S = np.diag(10.0 ** np.random.default_rng(1).uniform(-9, 3, N))
    scaled = plain._replace(K=S @ plain.K @ S, M=S @ plain.M @ S, w=S @ plain.w)
    one, other = health(plain), health(scaled)
    for measure in ("lowest_mass", "lowest_stiffness", "static_compliance"):
        assert getattr(other, measure) / getattr(one, measure) == pytest.approx(1.0, rel=1e-9)
