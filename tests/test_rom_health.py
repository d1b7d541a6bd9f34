"""What a reduced model must still be true of: each check passes a sound model and fires on a broken
one."""

import numpy as np
import pytest
import scipy.sparse as sp

from rom import (
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
    found = health(full_order(K, np.eye(n), np.eye(n)[0]))
    ends = 2 - 2 * np.cos(np.pi * np.array([1, n]) / (n + 1))
    assert found.lowest_stiffness == pytest.approx(ends[0] / ends[1], rel=2e-3)
    assert found.lowest_mass == pytest.approx(1.0)
