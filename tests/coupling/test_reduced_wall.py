"""The wall seen from the contact: statics, half-space, damping, refusals."""

from functools import partial
from itertools import pairwise

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.integrate import quad

from beadwave import dem
from beadwave.coupling import (
    CouplingError,
    ModalDamping,
    RayleighDamping,
    damping_ratios,
    impact,
    largest_monotone_force,
    predicted_peak_force,
    rayleigh,
    verdict,
)
from beadwave.coupling.reduced_wall import (
    coupled_wall,
    damping_matrix,
    moving_mask,
    moving_modes,
    residual_compliance,
    wall_from_reduced,
)
from beadwave.rom import Selection, craig_bampton, free_modes, full_order, modal, static_compliance

from known_models import steel_bar

E, NU, RHO = 210e9, 0.3, 7850.0
HZ = 2 * np.pi
CHAIN = dem.row_of_spheres(0.0127, 7800.0, E, NU, count=5, flat=dem.Flat(E, NU))
V0 = np.r_[0.31, np.zeros(4)]


bar = partial(steel_bar, 1.6e-3)  # m^2


def spring_wall(reduced, half_space=0.0, cutoff_hz=None):
    """The wall whose other modes are a massless spring, not an oscillator."""
    modes = modal(reduced)
    moving = moving_modes(modes, moving_mask(modes, reduced, cutoff_hz))
    s = residual_compliance(reduced, modes, moving, half_space)
    return dem.Wall(moving.omega, np.zeros(len(moving.omega)), moving.phi, s)


def one_spring(compliance):
    return full_order(np.array([[1 / compliance]]), np.array([[1e-3]]), np.ones(1))


def static_wall(wall):
    return wall.residual_compliance + np.sum((wall.phi / wall.omega) ** 2)


def hankel_hertz(z):
    return 3 / (2 * np.pi) * ((np.sin(z) - z * np.cos(z)) / z**3 if z > 1e-2 else 1 / 3 - z**2 / 30)


def layer_compliance(b, thickness):
    """w^T G w of an elastic layer on a smooth rigid base under a Hertz patch of radius b.

    Hankel transform, kernel (cosh 2a - 1) / (sinh 2a + 2a), a = k H (Sneddon 1951, sec. 10).
    """

    def integrand(z):
        a = min(z / b * thickness, 300.0)
        return hankel_hertz(z) ** 2 * (np.cosh(2 * a) - 1) / (np.sinh(2 * a) + 2 * a)

    edges = [1e-9, b / thickness, 10 * b / thickness, 3.0, 30.0, 300.0]
    return (
        4
        * np.pi
        * (1 - NU**2)
        / (E * b)
        * sum(
            quad(integrand, low, high, limit=400, epsabs=0, epsrel=1e-9)[0]
            for low, high in pairwise(edges)
        )
    )


def test_static_compliance_without_the_half_space_does_not_depend_on_the_patch():
    thickness = 0.05
    left = []
    for b in (0.3e-3, 0.6e-3, 1.2e-3):
        reduced = one_spring(layer_compliance(b, thickness))
        half_space = 0.6 * (1 - NU**2) / (E * b)  # under a Hertz pressure
        left.append(static_wall(wall_from_reduced(reduced, half_space=half_space, cutoff_hz=1.0)))
        assert abs(left[-1]) < 0.05 * half_space
    np.testing.assert_allclose(left, left[0], rtol=2e-3)


@pytest.mark.parametrize("cutoff_hz", [None, 1.0, 4e3, 20e3, 1e9])
@pytest.mark.parametrize("half_space", [0.0, 1.0e-10])
def test_moving_modes_residual_and_half_space_add_up_to_the_static_compliance(
    cutoff_hz, half_space
):
    K, M, w = bar()
    reduced = free_modes(K, M, w, Selection(n_modes=12))
    wall = wall_from_reduced(reduced, half_space=half_space, cutoff_hz=cutoff_hz)
    assert static_wall(wall) + half_space == pytest.approx(0.5 / (E * 1.6e-3), rel=1e-9, abs=0.0)


def test_all_beyond_the_cutoff_is_one_oscillator_or_a_spring():
    reduced = free_modes(*bar(), Selection(n_modes=12))
    modes = modal(reduced)
    for cutoff_hz, n_modes in ((None, 12), (20e3, 4), (1.0, 0), (1e9, 13)):
        wall = wall_from_reduced(reduced, half_space=0, cutoff_hz=cutoff_hz)
        spring = spring_wall(reduced, cutoff_hz=cutoff_hz)
        assert len(spring.omega) == n_modes
        assert len(wall.omega) == min(n_modes + 1, 13)
        assert wall.residual_compliance == 0
        for moment in (2, 4):
            beyond = np.sum(modes.phi[n_modes:] ** 2 / modes.omega[n_modes:] ** moment)
            theirs = np.sum(wall.phi[n_modes:] ** 2 / wall.omega[n_modes:] ** moment)
            assert theirs == pytest.approx(beyond, rel=1e-9, abs=0.0)
        assert spring.residual_compliance == pytest.approx(
            np.sum((modes.phi[n_modes:] / modes.omega[n_modes:]) ** 2), rel=1e-9, abs=1e-20
        )


def test_an_oscillator_for_the_rest_answers_far_better_than_a_spring():
    exact, reduced = full_order(*bar()), free_modes(*bar(), Selection(n_modes=12))
    omega = HZ * np.linspace(100, 20e3, 77)
    modes = modal(exact)
    right = modes.phi**2 @ (1 / (modes.omega[:, None] ** 2 - omega**2))
    error = {}
    walls = {"oscillator": wall_from_reduced(reduced, half_space=0), "spring": spring_wall(reduced)}
    for remainder, wall in walls.items():
        H = wall.phi**2 @ (1 / (wall.omega[:, None] ** 2 - omega**2)) + wall.residual_compliance
        error[remainder] = np.abs(H - right).max() / np.sqrt(np.mean(right**2))
    assert error["oscillator"] < 0.1 * error["spring"] < 1e-3


def test_both_reductions_give_the_same_wall_below_the_cutoff():
    K, M, w = bar()
    free = wall_from_reduced(
        free_modes(K, M, w, Selection(n_modes=20)), half_space=0, cutoff_hz=20e3
    )
    fixed = craig_bampton(K, M, w, [119], Selection(n_modes=40))
    held = wall_from_reduced(fixed, half_space=0, cutoff_hz=20e3)
    np.testing.assert_allclose(held.omega, free.omega, rtol=1e-3)
    np.testing.assert_allclose(np.abs(held.phi), np.abs(free.phi), rtol=1e-3)


def test_constraint_modes_are_no_modes_of_the_wall():
    K, M, w = bar()
    fixed = craig_bampton(K, M, w, np.arange(100, 120), Selection(n_modes=10))
    wall = spring_wall(fixed)
    assert 10 <= len(wall.omega) <= 12 < len(fixed.w)


def test_a_preloaded_chain_rests_on_the_whole_static_compliance():
    K, M, w = bar()
    chain = dem.row_of_spheres(0.0127, 7800.0, E, NU, count=2, flat=dem.Flat(E, NU), preload=50.0)
    for cutoff in (1.0, 20e3, 1e9):
        wall = wall_from_reduced(
            free_modes(K, M, w, Selection(n_modes=9)), half_space=0, cutoff_hz=cutoff
        )
        rest = dem.equilibrium(chain, wall)
        hertz = (50.0 / chain.A[-1]) ** (2 / 3)
        assert rest.x[-1] == pytest.approx(hertz + 50 * 0.5 / (E * 1.6e-3), rel=1e-9, abs=0.0)


def test_series_law_turns_over_where_its_formula_says():
    A, s = 1.7e10, -2e-9
    limit = largest_monotone_force(s, A)
    F = np.linspace(0.5, 1.5, 20001) * limit
    delta = (F / A) ** (2 / 3) + s * F
    assert F[delta.argmax()] == pytest.approx(limit, rel=1e-3)
    assert largest_monotone_force(0.0, A) == np.inf


@pytest.mark.parametrize(("share", "possible"), [(0.97, True), (1.03, False)])
def test_a_wall_that_makes_the_contact_give_way_is_refused(share, possible):
    """Just below and above the residual compliance that turns over at the predicted force."""
    A = CHAIN.A[-1]
    steep = (2 / 3) * A ** (-2 / 3) * predicted_peak_force(CHAIN, V0, A) ** (-1 / 3)
    reduced = free_modes(*bar(), Selection(n_modes=5))
    half_space = static_compliance(reduced) + share * steep
    wall = spring_wall(reduced, half_space, cutoff_hz=1.0)
    assert verdict(CHAIN, wall, V0).possible == possible
    if not possible:
        with pytest.raises(CouplingError, match="becomes unstable"):
            impact(CHAIN, wall, V0, duration=1e-3, error=1e-3)


def test_rayleigh_ratios_of_the_thesis_are_what_its_coefficients_imply():
    # alpha = 514.53, beta = 1.72e-8: 80 % at 51 Hz, 15 % at 269, 4.5 % at 907, 0.53 % at 8425
    omega = HZ * np.array([51.0, 269.0, 907.0, 8425.0])
    zeta = damping_ratios(RayleighDamping(514.53, 1.72e-8), omega)
    np.testing.assert_allclose(zeta, [0.80, 0.15, 0.045, 0.0053], rtol=0.02)
    again = rayleigh(51.0, zeta[0], 8425.0, zeta[3])
    np.testing.assert_allclose(again, (514.53, 1.72e-8), rtol=1e-9)


def test_rayleigh_that_would_drive_other_modes_is_refused():
    with pytest.raises(CouplingError, match="feeds energy into other modes"):
        rayleigh(50.0, 0.001, 5000.0, 0.5)
    with pytest.raises(CouplingError, match="feeds energy into other modes"):
        rayleigh(50.0, 0.5, 5000.0, 0.001)


def test_a_damping_table_is_interpolated_or_paired_with_the_nearest():
    omega = HZ * np.array([10.0, 100.0, 150.0, 200.0, 900.0])
    table = {"ratio": [0.01, 0.03], "frequency_hz": [100.0, 200.0]}
    np.testing.assert_allclose(
        damping_ratios(ModalDamping(**table), omega), [0.01, 0.01, 0.02, 0.03, 0.03]
    )
    nearest = damping_ratios(ModalDamping(**table, pairing="nearest"), omega)
    np.testing.assert_allclose(nearest, [0.01, 0.01, 0.03, 0.03, 0.03])


@pytest.mark.parametrize(
    ("damping", "sentence"),
    [
        (ModalDamping(-0.01), "ratios >= 0"),
        (ModalDamping([0.1, 0.2]), "2 damping ratios"),
        (ModalDamping([0.1, 0.2], [200.0, 100.0]), "ascending"),
        (ModalDamping([0.1], [100.0], "closest"), "interpolate"),
        (RayleighDamping(-500.0, 0.0), "ratios >= 0"),
        (ModalDamping(np.nan), "ratios >= 0"),
    ],
)
def test_damping_that_cannot_be_is_refused(damping, sentence):
    K, M, w = bar()
    with pytest.raises(CouplingError, match=sentence):
        wall_from_reduced(free_modes(K, M, w, Selection(n_modes=5)), half_space=0, damping=damping)


def test_mass_proportional_damping_of_a_floating_wall_is_refused():
    K, M, w = bar(held=False)
    reduced = free_modes(K, M, w, Selection(n_modes=5))
    assert wall_from_reduced(reduced, half_space=0).omega[0] == 0
    with pytest.raises(CouplingError, match="free-floating"):
        wall_from_reduced(reduced, half_space=0, damping=RayleighDamping(3.0, 0.0))


@pytest.mark.parametrize("kind", ["free-modes", "craig-bampton"])
def test_a_proportional_matrix_gives_the_same_ratios_as_its_coefficients(kind):
    K, M, w = bar()
    C = 20.0 * M + 3e-8 * K
    reduced = (
        free_modes(K, M, w, Selection(n_modes=20), C=C)
        if kind == "free-modes"
        else craig_bampton(K, M, w, [119], Selection(n_modes=20), C=C)
    )
    by_matrix = wall_from_reduced(reduced, half_space=0, cutoff_hz=40e3)
    by_coefficients = wall_from_reduced(
        reduced._replace(C=None), half_space=0, cutoff_hz=40e3, damping=RayleighDamping(20.0, 3e-8)
    )
    np.testing.assert_allclose(by_matrix.zeta, by_coefficients.zeta, rtol=1e-7)


def test_given_ratios_add_to_those_of_the_matrix():
    K, M, w = bar()
    reduced = free_modes(K, M, w, Selection(n_modes=6), C=1e-8 * K)
    alone = wall_from_reduced(reduced, half_space=0).zeta
    both = wall_from_reduced(reduced, half_space=0, damping=ModalDamping(0.01)).zeta
    np.testing.assert_allclose(both, alone + 0.01)


def test_a_dashpot_inside_is_refused_by_ratios_and_kept_by_the_coupled_wall():
    K, M, w = bar()
    dashpot = sp.csc_array(([300.0], ([60], [60])), shape=K.shape)
    reduced = free_modes(K, M, w, Selection(n_modes=10), C=dashpot)
    with pytest.raises(CouplingError, match="couples the wall's modes"):
        wall_from_reduced(reduced, half_space=0)
    wall = coupled_wall(reduced, half_space=0)
    assert np.linalg.matrix_rank(wall.D, tol=1e-6 * np.abs(wall.D).max()) == 1


@pytest.mark.slow
def test_verdict_names_wall_modes_and_peak_force():
    K, M, w = bar()
    wall = spring_wall(free_modes(K, M, w, Selection(n_modes=8)))
    judged = verdict(CHAIN, wall, V0)
    assert judged.possible and judged.passive and not judged.findings
    assert judged.n_wall_modes == 8
    run = dem.march(CHAIN, wall, V0, duration=1e-3, dt=2e-7, scheme="leapfrog")
    peak = run.contact_force[:, -1].max()
    assert peak < judged.predicted_peak_force < 1.5 * peak
    assert run.energy_error < 1e-3


@pytest.mark.parametrize(
    "v0", [[0.31] * 5, [0.31, 0, 0, 0, 0], [0, 0, 0, 0, 2.0], [0.3, 0, -0.3, 0, 0]]
)
def test_predicted_peak_force_is_not_exceeded(v0):
    run = dem.march(CHAIN, dem.rigid_wall(), np.array(v0), duration=1e-3, dt=1e-7)
    assert run.contact_force[:, -1].max() < predicted_peak_force(CHAIN, v0, CHAIN.A[-1])


@pytest.mark.parametrize(
    ("change", "possible", "finding"),
    [
        ({"residual_compliance": -1e-7}, False, "becomes unstable"),
        ({"zeta": np.full(8, -0.01)}, False, "generates energy"),
        ({"phi": np.zeros(8)}, True, "No wall mode has participation"),
    ],
)
def test_verdict_finds_walls_that_cannot_work(change, possible, finding):
    K, M, w = bar()
    wall = spring_wall(free_modes(K, M, w, Selection(n_modes=8)))._replace(**change)
    judged = verdict(CHAIN, wall, V0)
    assert judged.possible is possible
    assert finding in judged.findings[0]
    assert judged.findings[0] in judged.sentences


def test_verdict_on_a_free_chain_and_a_rigid_wall_has_nothing_to_say_on_modes():
    free = dem.row_of_spheres(0.0127, 7800.0, E, NU, count=5, flat=None)
    for chain, wall in ((free, None), (CHAIN, dem.rigid_wall())):
        judged = verdict(chain, wall, V0)
        assert judged.possible and judged.n_wall_modes == 0 and len(judged.sentences) == 2


def test_the_matrix_of_rayleigh_damping_is_alpha_m_and_beta_k():
    """Of a model whose coordinates are no modes."""
    K = 3 * (2 * np.eye(6) - np.eye(6, k=1) - np.eye(6, k=-1))
    M = np.diag(np.arange(1.0, 7.0))
    C = damping_matrix(full_order(K, M, np.eye(6)[0]), RayleighDamping(0.4, 0.02))
    np.testing.assert_allclose(C, 0.4 * M + 0.02 * K, atol=1e-12)
