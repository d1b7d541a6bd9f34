"""What a reduced model must still be true of: each check passes a sound model and fires on a broken
one."""

import numpy as np
import pytest
import scipy.sparse as sp

from rom import (
    ReductionError,
    craig_bampton,
    fixed_interface_hz,
    free_modes,
    full_order,
    health,
    require_rigid_motion,
)

N, HELD = 40, 5
STIFFNESS, MASS = 3.0e8, 0.02


def free_chain(to_ground=0.0):
    """Masses and springs in a row, the first on a spring of its own to the ground."""
    diagonal = np.r_[1.0, np.full(N - 2, 2.0), 1.0]
    K = sp.diags_array([-np.ones(N - 1), diagonal, -np.ones(N - 1)], offsets=[-1, 0, 1]).tolil()
    K[0, 0] += to_ground
    return STIFFNESS * K.tocsc(), MASS * sp.eye_array(N, format="csc")


def reduced_end(kind, K, M):
    w = np.r_[np.zeros(N - HELD), np.full(HELD, 1 / HELD)]
    if kind == "free-modes":
        return free_modes(K, M, w, n_modes=8)
    return craig_bampton(K, M, w, np.arange(N - HELD, N), n_modes=8)


@pytest.mark.parametrize("kind", ["free-modes", "craig-bampton"])
def test_a_reduced_model_of_a_free_structure_keeps_its_rigid_motion(kind):
    K, M = free_chain()
    require_rigid_motion(reduced_end(kind, K, M), K, M, np.ones((N, 1)))


@pytest.mark.parametrize("kind", ["free-modes", "craig-bampton"])
def test_a_spring_to_the_ground_a_millionth_as_stiff_is_noticed(kind):
    K, M = free_chain(to_ground=1e-6)
    with pytest.raises(ReductionError, match="forces to the ground"):
        require_rigid_motion(reduced_end(kind, K, M), K, M, np.ones((N, 1)))


def test_a_rigid_motion_that_was_left_out_is_noticed():
    K, M = free_chain()
    whole = reduced_end("free-modes", K, M)
    keep = slice(1, None)
    without = whole._replace(
        K=whole.K[keep, keep], M=whole.M[keep, keep], w=whole.w[keep], T=whole.T[:, keep]
    )
    with pytest.raises(ReductionError, match="misses the mass"):
        require_rigid_motion(without, K, M, np.ones((N, 1)))


def test_fixed_interface_frequencies_are_those_of_the_part_between_its_boundaries():
    """N - 5 masses with one end held by the boundary, the other free: a closed form, and all modes
    kept."""
    K, M = free_chain()
    n = N - HELD
    w = np.eye(N)[-1]
    reduced = craig_bampton(K, M, w, np.arange(n, N), n_modes=n)
    j = np.arange(1, n + 1)
    omega = 2 * np.sqrt(STIFFNESS / MASS) * np.sin((2 * j - 1) * np.pi / (2 * (2 * n + 1)))
    np.testing.assert_allclose(health(reduced).fixed_interface_hz, omega / (2 * np.pi), rtol=1e-9)
    assert fixed_interface_hz(full_order(K, M, w)) == ()


@pytest.mark.filterwarnings("error")
def test_a_model_without_mass_is_told_in_a_sentence():
    K, M = free_chain()
    massless = full_order(K, M, np.eye(N)[-1])._replace(M=np.zeros((N, N)))
    assert "M is not positive definite" in health(massless).findings[0]
