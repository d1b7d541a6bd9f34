"""A computed hammer test beside direct solutions, and resonances told as modes."""

import numpy as np
import pytest
from scipy.linalg import eigh

from beadwave.fem.identification.hammer_test import accelerances, nearest_modes, with_noise
from beadwave.workflows.files.response_files import of_mat

RIG = {1: 51.0, 2: 269.0, 3: 907.0, 4: 8425.0}


def test_accelerances_are_those_of_the_damped_matrices():
    """C = M V diag(2 zeta omega) V^T M leaves the modes V uncoupled; hit at the first of three."""
    K, M = 1e6 * np.array([[3.0, -1, 0], [-1, 2, -1], [0, -1, 1]]), np.diag([1.0, 2.0, 0.5])
    squared, V = eigh(K, M)
    omega, zeta, f = np.sqrt(squared), np.array([0.01, 0.02, 0.05]), np.array([20.0, 150.0, 290.0])
    C = M @ V @ np.diag(2 * zeta * omega) @ V.T @ M
    s = 2 * np.pi * f
    direct = [-(w**2) * np.linalg.solve(K + 1j * w * C - w**2 * M, np.eye(3)[0]) for w in s]
    np.testing.assert_allclose(
        accelerances(V, V[0], omega, zeta, f), np.transpose(direct), rtol=1e-10
    )


def test_noise_has_the_size_asked_for():
    """Of 20 000 samples the rms is known to 0.4 %."""
    H = np.full((2, 10_000), 3.0 + 4.0j)
    noise = with_noise(H, 0.01, np.random.default_rng(1)) - H
    assert np.sqrt(np.mean(np.abs(noise) ** 2)) == pytest.approx(0.05, rel=0.02)


def test_pairs_are_the_nearest_and_no_mode_is_used_twice():
    found = nearest_modes([48.0, 53.0, 700.0, 880.0, 3000.0], RIG)
    assert found == {0: 1, 3: 3} or found == {1: 1, 3: 3}
    assert nearest_modes([3000.0], RIG) == {}
    # a mode beyond the measured band moves no pair
    assert nearest_modes([269.0, 724.0, 870.0, 907.0], RIG) == {0: 2, 3: 3}


def test_a_mat_file_may_say_what_its_responses_are():
    variables = {"frequency_hz": np.array([1.0, 2.0]), "H": np.ones((1, 2), complex)}
    assert of_mat(variables, "test").quantity == ""
    assert (
        of_mat(variables | {"quantity": np.array(["velocities"])}, "test").quantity == "velocities"
    )
    with pytest.raises(ValueError, match="quantity is 'speeds', none of accelerations, displacem"):
        of_mat(variables | {"quantity": np.array(["speeds"])}, "test")
