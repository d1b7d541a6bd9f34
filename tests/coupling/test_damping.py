"""The damping of a wall's modes, and the wall that is made of a reduced model: exact formulas."""

import numpy as np
import pytest

from beadwave import dem
from beadwave.coupling import (
    CoupledWall,
    CouplingError,
    ModalDamping,
    RayleighDamping,
    damping_ratios,
)
from beadwave.coupling.damping import couples_modes, matrix_ratios, modal_coupling, rayleigh
from beadwave.coupling.reduced_wall import (
    coupled_wall,
    damping_matrix,
    moving_mask,
    moving_modes,
    residual_compliance,
    wall_from_reduced,
    wall_of,
    with_oscillator,
)
from beadwave.rom import Contact, Selection, craig_bampton, free_modes, full_order, modal

N = 9
W = np.eye(N)[-1]
HZ = 2 * np.pi


def structure():
    K = 4e6 * (2 * np.eye(N) - np.eye(N, k=1) - np.eye(N, k=-1))
    return K, np.diag(np.linspace(1.0, 2.0, N))


def dashpot(i, c=300.0):
    D = np.zeros((N, N))
    D[i, i] = c
    return D


def model(**parts):
    return full_order(*structure(), W, **parts)


def wall_receptance(wall, hz):
    """w^T u of the wall's own equations at frequencies [Hz]."""
    coupled = isinstance(wall, CoupledWall)
    D = wall.D if coupled else np.diag(2 * wall.zeta * wall.omega)
    force, reading = (wall.force, wall.reading) if coupled else (wall.phi, wall.phi)
    s = 2j * np.pi * np.asarray(hz)
    moving = [np.linalg.solve(np.diag(wall.omega**2 + x**2) + x * D, force) for x in s]
    return np.array(moving) @ reading + wall.residual_compliance


def test_the_coupling_of_modes_is_the_largest_normalised_product():
    rng = np.random.default_rng(4)
    C = np.eye(4)
    C[np.triu_indices(4, 1)] = share = rng.uniform(-0.6, 0.6, 6)
    C = np.triu(C) + np.triu(C, 1).T
    damping = np.array([1e-3, 2.0, 50.0, 7e3])
    D = C * np.sqrt(np.outer(damping, damping))
    assert modal_coupling(D) == pytest.approx(np.abs(share).max(), rel=1e-12)
    assert modal_coupling(-D) == pytest.approx(np.abs(share).max(), rel=1e-12)
    assert couples_modes(1e-9 * (1 - np.eye(2)))  # and no mode has a damping of its own
    assert modal_coupling(np.diag(damping)) == modal_coupling(np.zeros((3, 3))) == 0.0


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_the_coupling_of_modes_has_no_unit_even_where_one_is_undamped(unit):
    """Coupling to an undamped mode counts as much as to one of the smallest damping told apart."""
    D = unit * np.array([[4.0, 1e-7], [1e-7, 0.0]])
    assert modal_coupling(D) == pytest.approx(1e-7 / 4e-6, rel=1e-9)
    assert couples_modes(D) and not couples_modes(unit * np.diag([4.0, 0.0]))
    assert not couples_modes(None)


@pytest.mark.parametrize(("off", "couples"), [(0.9e-6, False), (1.1e-6, True)])
def test_ratios_are_refused_where_modes_couple_by_more_than_a_millionth(off, couples):
    omega, diagonal = np.array([10.0, 30.0]), np.array([2.0, 8.0])
    D = np.diag(diagonal) + off * 4.0 * (1 - np.eye(2))
    assert couples_modes(D) is couples
    if couples:
        with pytest.raises(CouplingError, match="couples the wall's modes"):
            matrix_ratios(D, omega)
    else:
        np.testing.assert_allclose(matrix_ratios(D, omega), diagonal / (2 * omega), rtol=1e-12)


def test_a_dashpot_to_the_ground_that_brakes_rigid_motion_has_no_ratio():
    omega, D = np.array([0.0, 20.0]), np.diag([1e-8, 3.0])
    np.testing.assert_allclose(matrix_ratios(D, omega), [0.0, 3.0 / 40.0], rtol=1e-12)
    with pytest.raises(CouplingError, match="couples the wall's modes"):
        matrix_ratios(np.diag([1.0, 3.0]), omega)
    np.testing.assert_array_equal(matrix_ratios(None, omega), [0.0, 0.0])
    assert matrix_ratios(np.zeros((0, 0)), omega[:0]).shape == (0,)


def test_rayleigh_ratios_are_those_of_its_matrix():
    """zeta = (alpha / omega + beta omega) / 2; none for rigid motion, where alpha is 0."""
    omega = np.array([0.0, 5.0, 80.0, 3e3])
    zeta = damping_ratios(RayleighDamping(0.0, 2e-4), omega)
    np.testing.assert_allclose(zeta, 1e-4 * omega, rtol=1e-12)
    zeta = damping_ratios(RayleighDamping(3.0, 2e-4), omega[1:])
    np.testing.assert_allclose(zeta, 1.5 / omega[1:] + 1e-4 * omega[1:], rtol=1e-12)


@pytest.mark.parametrize("hz", [(50.0, 50.0), (0.0, 50.0), (50.0, -1.0)])
def test_rayleigh_wants_two_different_frequencies_above_zero(hz):
    with pytest.raises(CouplingError, match="two different frequencies"):
        rayleigh(hz[0], 0.01, hz[1], 0.02)


def test_rayleigh_of_almost_one_kind_alone_is_allowed():
    """Ratios that fall as 1 / omega need no beta, ratios that rise as omega no alpha."""
    margin = 1e-9
    falling = rayleigh(10.0, 0.02, 40.0, 0.005 * (1 + margin))
    rising = rayleigh(10.0, 0.02, 40.0, 0.08 * (1 - margin))
    np.testing.assert_allclose(falling, (2 * 0.02 * HZ * 10.0, 0.0), rtol=1e-8, atol=1e-11)
    np.testing.assert_allclose(rising, (0.0, 2 * 0.02 / (HZ * 10.0)), rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("zeta", [0.0049, 0.0801])
def test_rayleigh_refuses_either_coefficient_below_zero(zeta):
    """Ratios that fall faster than 1 / omega, or rise faster than omega, from 0.02 at 10 Hz."""
    with pytest.raises(CouplingError, match="a negative one feeds energy"):
        rayleigh(10.0, 0.02, 40.0, zeta)


def test_one_ratio_each_or_one_for_all_and_none_for_rigid_motion():
    omega = np.array([0.0, 5.0, 9.0])
    np.testing.assert_array_equal(damping_ratios(None, omega), np.zeros(3))
    np.testing.assert_array_equal(damping_ratios(ModalDamping(0.03), omega), [0.0, 0.03, 0.03])
    each = damping_ratios(ModalDamping([0.1, 0.2, 0.3]), omega)
    np.testing.assert_array_equal(each, [0.0, 0.2, 0.3])


def test_the_nearest_entry_is_the_nearest_in_octaves():
    """Between 100 and 400 Hz the middle is 200 Hz; far off counts the entry at that end."""
    close = damping_ratios(ModalDamping([0.1, 0.3], [10.0, 10.5]), HZ * np.array([10.25]))
    np.testing.assert_allclose(close, [0.2], rtol=1e-12)
    table = ModalDamping([0.1, 0.4], [100.0, 400.0], "nearest")
    result = damping_ratios(table, HZ * np.array([1e-3, 199.0, 201.0, 1e6]))
    np.testing.assert_array_equal(result, [0.1, 0.1, 0.4, 0.4])


@pytest.mark.parametrize("hz", [[-5.0, 10.0], [0.0, 10.0], [10.0, 10.0], [10.0]])
def test_a_table_wants_as_many_frequencies_ascending_above_zero(hz):
    with pytest.raises(CouplingError, match="damping table"):
        damping_ratios(ModalDamping([0.1, 0.2], hz), np.array([5.0]))


def test_oscillators_unless_the_damping_couples_or_it_is_read_elsewhere():
    assert isinstance(wall_of(model()), dem.Wall)
    bare, patch = model(), model()._replace(contact=model().contact._replace(half_space=1e-9))
    assert wall_of(bare).residual_compliance == wall_from_reduced(bare, half_space=0.0)[3]
    assert wall_of(patch).residual_compliance == wall_from_reduced(patch, half_space=1e-9)[3]
    assert isinstance(wall_of(model(C=1e-4 * structure()[0])), dem.Wall)
    assert isinstance(wall_of(model(C=dashpot(4))), CoupledWall)
    elsewhere = Contact(weights_read=np.eye(N)[-2], half_space=1e-9)
    assert isinstance(wall_of(model()._replace(contact=elsewhere)), CoupledWall)


@pytest.mark.parametrize("elsewhere", [False, True])
@pytest.mark.parametrize("hz", [None, 200.0])
def test_the_wall_of_a_model_takes_all_matrices_where_it_is_read_elsewhere(elsewhere, hz):
    """A cutoff that is given holds; without one only matrices read elsewhere are taken whole."""
    half = 2e-9
    read = np.eye(N)[-2] if elsewhere else None
    small = free_modes(*structure(), W, Selection(n_modes=5))
    read = None if read is None else read @ small.T
    small = small._replace(contact=Contact(half_space=half, weights_read=read))
    wall, wall_modes = wall_of(small, cutoff_hz=hz), modal(small)
    moving = wall_modes.omega < HZ * hz if hz else np.r_[[True] * 5, elsewhere]
    assert len(wall.omega) == moving.sum() + (not elsewhere)
    np.testing.assert_allclose(wall.omega[: moving.sum()], wall_modes.omega[moving], rtol=1e-12)
    reading = wall_modes.phi if read is None else read @ wall_modes.vectors
    static = np.sum(wall_modes.phi * reading / wall_modes.omega**2)
    assert wall_receptance(wall, [0.0])[0] == pytest.approx(static - half, rel=1e-9)


@pytest.mark.parametrize("cutoff_hz", [150.0, 300.0, 1e4])
@pytest.mark.parametrize("elsewhere", [False, True])
def test_the_rest_follows_the_force_in_what_is_read(cutoff_hz, elsewhere):
    """The moving modes as they are, with the residual of the others at rest or as an oscillator."""
    read = np.eye(N)[2] if elsewhere else None
    reduced = model(C=dashpot(4))._replace(contact=Contact(weights_read=read))
    wall = coupled_wall(reduced, half_space=0.0, damping=ModalDamping(0.02), cutoff_hz=cutoff_hz)
    exact = np.linalg.inv(structure()[0])[N - 1, 2 if elsewhere else N - 1]
    assert wall_receptance(wall, [0.0])[0].real == pytest.approx(exact, rel=1e-9)
    wall_modes = modal(reduced)
    retained = wall_modes.omega < HZ * cutoff_hz
    n = retained.sum()
    D = wall_modes.damping + np.diag(0.04 * wall_modes.omega)
    np.testing.assert_allclose(wall.D[:n, :n], D[:n, :n], atol=1e-9)
    assert len(wall.omega) == (n if elsewhere or n == N else n + 1)


@pytest.mark.parametrize("elsewhere", [False, True])
def test_a_wall_knows_no_unit_of_time(elsewhere):
    """Ten million times as slow: frequencies as much lower, compliances as the square higher; a
    rigid motion included, whose oscillator would have none."""
    K, M = structure()
    K[0, 0] /= 2
    K[-1, -1] /= 2  # free at both ends
    contact = Contact(weights_read=np.eye(N)[2] if elsewhere else None)
    walls = [
        coupled_wall(full_order(K * f**2, M, W)._replace(contact=contact), half_space=1e-9 / f**2,
                     cutoff_hz=300.0 * f)
        for f in (1.0, 1e-7)
    ]  # fmt: skip
    np.testing.assert_allclose(walls[1].omega[1:] * 1e7, walls[0].omega[1:], rtol=1e-7)
    assert len(walls[1].omega) == len(walls[0].omega) < N
    np.testing.assert_allclose(np.abs(walls[1].force), np.abs(walls[0].force), rtol=1e-6)
    np.testing.assert_allclose(np.abs(walls[1].reading), np.abs(walls[0].reading), rtol=1e-6)
    one, other = (wall.residual_compliance for wall in walls)
    assert other * 1e-14 == pytest.approx(one, rel=1e-6)


def test_a_wall_with_all_its_modes_answers_as_the_matrices():
    K, M = structure()
    C = dashpot(4) + 1e-5 * K
    hz = np.array([30.0, 120.0, 260.0])
    wall = coupled_wall(model(C=C), half_space=3e-9)
    exact = [np.linalg.inv(K - x**2 * M + 1j * x * C)[-1, -1] - 3e-9 for x in HZ * hz]
    np.testing.assert_allclose(wall_receptance(wall, hz), exact, rtol=1e-9, atol=0)


def test_the_oscillator_of_the_rest_moves_in_their_static_shape():
    """One coordinate along sum phi_j V_j / omega_j^2 of the rest: K, M, C and w projected on it."""
    reduced = model(C=dashpot(4))
    wall_modes = modal(reduced)
    retained = np.arange(N) < 4
    rest = wall_modes.vectors[:, 4:] @ (wall_modes.phi[4:] / wall_modes.omega[4:] ** 2)
    rest /= np.sqrt(rest @ reduced.M @ rest)
    T = np.column_stack([wall_modes.vectors[:, :4], rest])
    result = with_oscillator(wall_modes, retained)
    np.testing.assert_allclose(result.vectors, T, atol=1e-12)
    np.testing.assert_allclose(np.diag(result.omega**2), T.T @ reduced.K @ T, atol=1e-6)
    np.testing.assert_allclose(result.damping, T.T @ reduced.C @ T, atol=1e-9)
    np.testing.assert_allclose(result.phi, W @ T, atol=1e-12)


def test_rest_that_the_force_does_not_move_gets_no_oscillator():
    wall_modes = modal(model())
    silent = wall_modes._replace(phi=np.where(np.arange(N) < 4, wall_modes.phi, 0.0))
    assert len(with_oscillator(silent, np.arange(N) < 4).omega) == 4
    floating = wall_modes._replace(omega=np.r_[0.0, wall_modes.omega[1:]])
    result = with_oscillator(floating, np.arange(N) > 0)
    np.testing.assert_array_equal(result.omega, moving_modes(floating, np.arange(N) > 0).omega)


def test_moving_modes_end_below_residual_vectors_and_boundary_shapes():
    hz = modal(model()).omega / HZ
    free = free_modes(*structure(), W, Selection(n_modes=4))
    assert moving_mask(modal(free), free, None).sum() == 4
    for scale in np.linspace(1.0, 2.0, 300):  # one in sixteen rises by a division by 2 pi
        faster = modal(free)._replace(omega=scale * modal(free).omega)
        assert moving_mask(faster, free, None).sum() == 4
    fixed = craig_bampton(*structure(), W, [N - 1], Selection(n_modes=3))
    inner = np.linalg.eigvals(np.linalg.solve(structure()[1][:-1, :-1], structure()[0][:-1, :-1]))
    highest = np.sqrt(np.sort(inner.real)[2])
    # the cutoff is set 1e-9 above
    shifted = modal(fixed)._replace(omega=highest * np.r_[0.0, 1 - 1e-8, 1 + 1e-8])
    assert moving_mask(shifted, fixed, None).tolist() == [True, True, False]
    assert moving_mask(modal(model()), model(), None).all()
    strict = moving_mask(modal(model()), model(), hz[3])
    assert strict.sum() in (3, 4) and not strict[4:].any()


def test_damping_given_as_a_matrix_is_that_of_the_ratios():
    zeta = np.linspace(0.01, 0.09, N)
    reduced = model()
    wall_modes = modal(reduced._replace(C=damping_matrix(reduced, ModalDamping(zeta))))
    np.testing.assert_allclose(wall_modes.damping, np.diag(2 * zeta * wall_modes.omega), atol=1e-9)
    assert damping_matrix(reduced, None) is None


def test_a_damping_matrix_that_drives_is_refused():
    with pytest.raises(CouplingError, match="indefinite"):
        coupled_wall(model(C=-dashpot(4)), half_space=0.0)


def test_a_wall_whose_modes_miss_a_millionth_of_its_compliance_is_refused():
    reduced = model()
    wall_modes = modal(reduced)
    lost = wall_modes._replace(phi=wall_modes.phi * (1 - 0.55e-6))
    with pytest.raises(CouplingError, match="badly conditioned"):
        wall_from_reduced(reduced, half_space=0.0, modes=lost)
    fine = wall_modes._replace(phi=wall_modes.phi * (1 - 0.45e-6))
    assert len(wall_from_reduced(reduced, half_space=0.0, modes=fine).omega) == N


def test_what_does_not_move_is_left_out_below_a_billionth_of_the_static_compliance():
    reduced = model()
    wall_modes, total = modal(reduced), np.linalg.inv(structure()[0])[-1, -1]
    for share, counts in ((0.9e-9, False), (1.1e-9, True), (0.3, True)):
        moving = wall_modes._replace(phi=wall_modes.phi * np.sqrt(1 - share))
        result = residual_compliance(reduced, wall_modes, moving, 2e-7) + 2e-7
        assert result == pytest.approx(share * total if counts else 0.0, rel=1e-3, abs=1e-17)
