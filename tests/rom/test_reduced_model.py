"""A reduced model's own laws, each beside an independent computation in its coordinates."""

import numpy as np
import pytest

from beadwave.rom import (
    ReductionError,
    Selection,
    free_modes,
    full_order,
    modal,
    modal_compliance,
    modes_alone,
    receptance,
    static_compliance,
)
from beadwave.rom.reduced_model import of_modes
from beadwave.rom.truncation import rms

N = 7
W = np.linspace(1.0, -0.4, N)
HZ = np.array([0.0, 3.0, 11.0, 25.0, 60.0])


def structure(held=True):
    """Masses of 1 to 4 kg in a row on springs of 1 to 2 kN/m."""
    k = np.linspace(1e3, 2e3, N)
    link = np.diff(np.eye(N), axis=0)
    K = link.T @ np.diag(k[1:]) @ link
    K[0, 0] += k[0] if held else 0.0
    return K, np.diag(np.linspace(1.0, 4.0, N))


def dashpots():
    """One between two masses, one to the ground: they leave no mode alone."""
    D = np.zeros((N, N))
    D[2:4, 2:4] = 9.0 * np.array([[1, -1], [-1, 1]])
    D[6, 6] = 4.0
    return D


def dynamic_flexibility(K, M, C, loss=0.0):
    s = 2 * np.pi * HZ
    return [np.linalg.inv(K * (1 + 1j * loss) - x**2 * M + 1j * x * C) for x in s]


def test_rms_of_a_sine_and_of_a_turning_pointer():
    turn = np.exp(2j * np.pi * np.arange(100) / 100)
    assert rms(3 * turn.real) == pytest.approx(3 / np.sqrt(2), rel=1e-12)
    assert rms(3 * turn) == pytest.approx(3.0, rel=1e-12)


@pytest.mark.parametrize("loss", [0.0, 0.03])
def test_a_receptance_with_dashpots_inside_is_that_of_the_matrices(loss):
    K, M = structure()
    C, out = dashpots(), np.eye(N)[2]
    reduced = full_order(K, M, W, C=C)
    flexibility = dynamic_flexibility(K, M, C, loss)
    for reading, row in ((None, W), (out, out)):
        exact = [row @ one @ W for one in flexibility]
        np.testing.assert_allclose(
            receptance(reduced, reading, HZ, loss=loss), exact, rtol=1e-9, atol=0
        )


@pytest.mark.parametrize("C", [None, 1e-30 * np.eye(N)])
def test_modal_ratios_and_a_loss_factor_damp_as_their_matrices_do(C):
    """C = M V diag(2 zeta omega) V^T M, whether or not the model has a C of its own."""
    K, M = structure()
    reduced = full_order(K, M, W, C=C)
    wall, zeta = modal(reduced), np.linspace(0.01, 0.07, N)
    MV = M @ wall.vectors
    matrix = MV @ np.diag(2 * zeta * wall.omega) @ MV.T
    exact = [W @ one @ W for one in dynamic_flexibility(K, M, matrix, 0.02)]
    result = receptance(reduced, None, HZ, zeta=zeta, loss=0.02)
    np.testing.assert_allclose(result, exact, rtol=1e-9, atol=0)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("held", [True, False])
def test_units_of_the_coordinates_change_no_mode(held):
    """Coordinates in 1e-6 to 1e6 of their units: what is measured at the contact stays, and nothing
    is called ill-conditioned."""
    K, M = structure(held)
    unit = np.logspace(-6, 6, N)
    plain = modal(full_order(K, M, W))
    scaled = full_order(K * np.outer(unit, unit), M * np.outer(unit, unit), W * unit)
    other = modal(scaled)
    np.testing.assert_allclose(other.omega, plain.omega, rtol=1e-10, atol=0)
    np.testing.assert_allclose(np.abs(other.phi), np.abs(plain.phi), rtol=1e-8, atol=0)
    assert (plain.omega[0] == 0) is not held
    ratio = static_compliance(scaled) / static_compliance(full_order(K, M, W))
    assert abs(ratio - 1) < 1e-10


@pytest.mark.parametrize("held", [True, False])
def test_modes_are_orthonormal_in_mass_and_diagonal_in_stiffness(held):
    K, M = structure(held)
    wall = modal(full_order(K, M, W, C=dashpots()))
    V = wall.vectors
    np.testing.assert_allclose(V.T @ M @ V, np.eye(N), atol=1e-12)
    np.testing.assert_allclose(V.T @ K @ V, np.diag(wall.omega**2), atol=1e-10 * K.max())
    np.testing.assert_allclose(wall.damping, V.T @ dashpots() @ V, atol=1e-12)
    np.testing.assert_allclose(wall.phi, W @ V, atol=1e-12)


def test_the_static_compliance_is_that_of_the_stiffness_and_of_all_modes():
    K, M = structure()
    reduced = full_order(K, M, W)
    exact = W @ np.linalg.solve(K, W)
    for result in (static_compliance(reduced), modal_compliance(modal(reduced))):
        assert abs(result / exact - 1) < 1e-12
    assert abs(receptance(reduced, None, 0.0)[0] / exact - 1) < 1e-12


def test_a_floating_structure_gives_way_by_what_is_no_rigid_motion():
    """Inertia relief: the force less what accelerates the whole, its response without a drift."""
    K, M = structure(held=False)
    mass, ones = M.sum(), np.ones(N)
    P = np.eye(N) - np.outer(M @ ones, ones) / mass
    exact = P @ W @ np.linalg.pinv(K) @ P @ W
    assert abs(static_compliance(full_order(K, M, W)) / exact - 1) < 1e-10


def test_the_lowest_modes_alone_answer_as_their_share_of_the_sum():
    reduced = full_order(*structure(), W, C=dashpots())
    alone, wall = modes_alone(reduced, 3), modal(reduced)
    s = 2 * np.pi * HZ[:, None]
    share = np.sum(wall.phi[:3] ** 2 / (wall.omega[:3] ** 2 - s**2), axis=1)
    np.testing.assert_allclose(receptance(alone, None, HZ), share, rtol=1e-10, atol=0)
    assert (alone.n_boundary, alone.n_residual, alone.kind) == (0, 0, "free-modes")

    # at any other place as well: the basis belongs to the modes that are kept
    end = np.eye(N)[-1]
    at_end = (end @ wall.vectors)[:3]
    share = np.sum(wall.phi[:3] * at_end / (wall.omega[:3] ** 2 - s**2), axis=1)
    np.testing.assert_allclose(receptance(alone, end, HZ), share, rtol=1e-9, atol=0)


def test_modes_in_any_order_make_one_model_with_the_highest_static():
    wall = modal(full_order(*structure(), W, C=dashpots()))
    mixed = np.array([3, 0, 6, 1, 5, 2, 4])
    model = of_modes(wall.omega[mixed], wall.vectors[:, mixed], None, W, dashpots())
    np.testing.assert_allclose(np.sqrt(np.diag(model.K)), wall.omega, rtol=1e-12)
    np.testing.assert_allclose(model.w, wall.phi, atol=1e-12)
    np.testing.assert_allclose(model.C, wall.damping, atol=1e-12)
    np.testing.assert_array_equal(model.M, np.eye(N))
    assert (model.n_residual, model.n_boundary) == (1, 0)


def test_a_full_model_is_the_matrices_with_every_coordinate_its_own():
    K, M = structure()
    reduced = full_order(K, M, W, C=dashpots())
    for actual, given in zip(reduced[:5], (K, M, dashpots(), W, np.eye(N)), strict=True):
        np.testing.assert_array_equal(actual, given)
    assert (reduced.n_boundary, reduced.n_residual) == (0, 0)


def test_a_mass_that_only_moves_with_others_against_it_is_refused():
    """diag(M) > 0, and yet M is indefinite."""
    K, M = structure()
    M[0, 1] = M[1, 0] = 2.0
    with pytest.raises(ReductionError, match="not positive definite"):
        modal(full_order(K, M, W))


@pytest.mark.parametrize("mass", [0.0, -1.0])
def test_a_coordinate_without_mass_is_refused(mass):
    K, M = structure()
    M[3, 3] = mass
    with pytest.raises(ReductionError, match=f"a diagonal value of {mass:.3g}; all must be > 0"):
        modal(full_order(K, M, W))


def test_the_lowest_mode_beside_a_stiff_one_keeps_its_digits():
    """(1 - c^2) x^2 - (a + b) x + a b = 0, a and b eleven decades apart."""
    a, b, c = 1e-3, 1e8, 0.5
    wall = modal(full_order(np.diag([b, a]), [[1.0, c], [c, 1.0]], [1.0, 0.0]))
    high = (a + b + np.sqrt((a + b) ** 2 - 4 * (1 - c**2) * a * b)) / 2
    np.testing.assert_allclose(wall.omega**2, [a * b / high, high / (1 - c**2)], rtol=1e-12)


@pytest.mark.parametrize("slower", [1.0, 1e9])
def test_what_rounding_makes_of_rigid_motion_is_zero_and_less_is_indefinite(slower):
    K, M = structure(held=False)
    K = K / slower**2
    top = modal(full_order(K, M, W)).omega[-1] ** 2
    eps = np.finfo(float).eps

    def lowered(by):
        return full_order(K - by * eps * top * M, M, W)

    np.testing.assert_array_equal(modal(lowered(8)).omega > 0, np.arange(N) > 0)
    with pytest.raises(ReductionError, match="indefinite"):
        modal(lowered(60))


@pytest.mark.parametrize("n_known", [1, 2, 3])
@pytest.mark.parametrize("held", [True, False])
def test_modes_handed_in_are_found_once_among_those_of_the_contact(held, n_known):
    """All modes of a small structure are asked for; a rigid one that is handed in is not doubled,
    and what rounding leaves when no direction is left is no further mode."""
    wall = modal(full_order(*structure(held), W))
    given = (wall.omega[:n_known], wall.vectors[:, :n_known])
    selection = Selection(n_modes=N, to_hz=1.0, choice="contact", modes=given)
    result = modal(free_modes(*structure(held), W, selection)).omega
    np.testing.assert_allclose(result, wall.omega, rtol=1e-7, atol=0)
