"""Craig-Bampton and free modes + residual on chains of masses and springs with known answers."""

from itertools import pairwise

import numpy as np
import pytest
import scipy.sparse as sp

from beadwave.rom import (
    LOSS,
    ReductionError,
    Selection,
    craig_bampton,
    effective_mass,
    fixed_interface_hz,
    free_modes,
    full_order,
    health,
    modal,
    receptance,
    static_compliance,
    superlu,
)
from beadwave.rom.truncation import frequencies, rms, size

N = 600  # above the size where modes are computed densely
STIFFNESS, MASS = 3.0e8, 0.02


def spring_chain(n, held=True):
    """n masses, springs between them and, where held, from the first one to the ground."""
    diagonal = np.full(n, 2.0)
    diagonal[-1] = 1
    diagonal[0] = 2 if held else 1
    K = STIFFNESS * sp.diags_array([-np.ones(n - 1), diagonal, -np.ones(n - 1)], offsets=[-1, 0, 1])
    return K.tocsc(), MASS * sp.eye_array(n, format="csc")


def end_patch(n, size=5):
    w = np.zeros(n)
    w[-size:] = 1 / size
    return w


def end_boundary(n, size=5):
    return np.arange(n - size, n)


def reduced_end(kind, K, M, n_modes):
    w = end_patch(K.shape[0])
    if kind == "free-modes":
        return free_modes(K, M, w, Selection(n_modes=n_modes))
    return craig_bampton(K, M, w, end_boundary(len(w)), Selection(n_modes=n_modes))


KINDS = pytest.mark.parametrize("kind", ["free-modes", "craig-bampton"])


def test_published_four_mass_chain_reduces_to_its_published_matrices():
    # JuliaFEM ModelReduction.jl, README
    K = np.array([[2, -1, 0, 0], [-1, 2, -1, 0], [0, -1, 2, -1], [0, 0, -1, 1.0]])
    reduced = craig_bampton(K, np.diag([2.0, 2, 2, 1]), [0, 0, 0, 1.0], [3], Selection(n_modes=1))
    np.testing.assert_allclose(reduced.K, [[0.25, 0], [0, 0.292893]], atol=5e-7)
    np.testing.assert_allclose(np.abs(reduced.M), [[2.75, 1.20711], [1.20711, 1]], atol=5e-6)


@KINDS
@pytest.mark.parametrize("n_modes", [0, 1, 12])
def test_static_response_at_the_contact_is_exact_for_any_number_of_modes(kind, n_modes):
    K, M = spring_chain(N)
    w = end_patch(N)
    reduced = reduced_end(kind, K, M, n_modes)
    exact = superlu(K).solve(w)
    assert static_compliance(reduced) == pytest.approx(w @ exact, rel=1e-9, abs=0.0)
    q = np.linalg.solve(reduced.K, reduced.w)
    np.testing.assert_allclose(reduced.T @ q, exact, rtol=1e-8)


def test_free_modes_of_a_held_chain_have_its_closed_form_frequencies():
    # omega_j = 2 sqrt(k/m) sin((2 j - 1) pi / (4 n + 2)), fixed - free
    K, M = spring_chain(N)
    j = np.arange(1, 13)
    exact = 2 * np.sqrt(STIFFNESS / MASS) * np.sin((2 * j - 1) * np.pi / (4 * N + 2))
    reduced = free_modes(K, M, end_patch(N), Selection(n_modes=12))
    np.testing.assert_allclose(modal(reduced).omega[:12], exact, rtol=1e-9)


def test_craig_bampton_frequencies_fall_to_the_exact_ones_from_above():
    K, M = spring_chain(N)
    exact = modal(free_modes(K, M, end_patch(N), Selection(n_modes=4))).omega[:4]
    ratio = [modal(reduced_end("craig-bampton", K, M, k)).omega[:4] / exact for k in (4, 8, 16)]
    assert (np.array(ratio) >= 1 - 1e-10).all()
    assert (np.diff(ratio, axis=0) < 0).all()
    np.testing.assert_allclose(ratio[-1], 1, atol=3e-4)  # 1.8e-4 measured


def test_a_rod_of_finite_elements_shows_the_rods_frequencies():
    # fixed - free steel rod, f_j = (2 j - 1) c / (4 L); consistent mass: error (k h)^2 / 24
    E, rho, length, n = 210e9, 7850.0, 0.5, 400
    h = length / n
    K = (
        E
        / h
        * sp.diags_array(
            [-np.ones(n - 1), np.r_[np.full(n - 1, 2), 1], -np.ones(n - 1)], offsets=[-1, 0, 1]
        )
    )
    M = (
        rho
        * h
        / 6
        * sp.diags_array(
            [np.ones(n - 1), np.r_[np.full(n - 1, 4), 2], np.ones(n - 1)], offsets=[-1, 0, 1]
        )
    )
    w = np.eye(n)[-1]
    reduced = craig_bampton(K, M, w, [n - 1], Selection(cutoff_hz=120e3))
    j = np.arange(1, 5)
    exact = (2 * j - 1) / 4 / length * np.sqrt(E / rho)
    np.testing.assert_allclose(modal(reduced).omega[:4] / 2 / np.pi, exact, rtol=1e-4)
    assert static_compliance(reduced) == pytest.approx(length / E, rel=1e-9, abs=0.0)


@KINDS
def test_a_free_structure_keeps_its_mass_and_is_not_grounded(kind):
    K, M = spring_chain(N, held=False)
    reduced = reduced_end(kind, K, M, 10)
    q = np.linalg.solve(reduced.M, reduced.T.T @ (M @ np.ones(N)))
    assert q @ reduced.M @ q == pytest.approx(N * MASS, rel=1e-10)
    stiffness = np.linalg.norm(reduced.K, 2) * np.linalg.norm(q)
    assert np.linalg.norm(reduced.K @ q) < 1e-10 * stiffness
    assert modal(reduced).omega[0] == 0
    assert effective_mass(reduced, M, np.ones(N)).captured == pytest.approx(1, rel=1e-10)


def test_inertia_relief_of_a_free_chain_is_the_sum_over_its_elastic_modes():
    K, M = spring_chain(N, held=False)
    w = end_patch(N)
    reference = modal(full_order(K, M, w))
    elastic = reference.omega > 0
    exact = np.sum((reference.phi[elastic] / reference.omega[elastic]) ** 2)
    for n_modes in (1, 10):
        reduced = free_modes(K, M, w, Selection(n_modes=n_modes))
        assert static_compliance(reduced) == pytest.approx(exact, rel=1e-8, abs=0.0)


def test_a_given_shift_leaves_the_answer_as_it_is():
    K, M = spring_chain(N)
    w = end_patch(N)
    plain = free_modes(K, M, w, Selection(n_modes=8))
    shifted = free_modes(K, M, w, Selection(n_modes=8), shift=-((modal(plain).omega[0] / 10) ** 2))
    np.testing.assert_allclose(modal(shifted).omega, modal(plain).omega, rtol=1e-8)
    assert static_compliance(shifted) == pytest.approx(static_compliance(plain), rel=1e-9, abs=0.0)


def test_modes_that_are_there_already_are_used():
    K, M = spring_chain(N)
    w = end_patch(N)
    plain = free_modes(K, M, w, Selection(n_modes=9))
    again = free_modes(
        K, M, w, Selection(modes=(np.sqrt(np.diag(plain.K))[:9], plain.T[:, :9]), cutoff_hz=400.0)
    )
    assert 0 < again.K.shape[0] - 1 < 9
    assert static_compliance(again) == pytest.approx(static_compliance(plain), rel=1e-9, abs=0.0)


@KINDS
def test_receptance_error_falls_monotonically_with_the_number_of_modes(kind):
    K, M = spring_chain(300)
    frequency = np.linspace(50, 3000, 60)
    exact = receptance(full_order(K, M, end_patch(300)), None, frequency, loss=LOSS)
    errors = [
        np.linalg.norm(receptance(reduced_end(kind, K, M, k), None, frequency, loss=LOSS) - exact)
        / np.linalg.norm(exact)
        for k in (20, 30, 45, 70)
    ]
    assert (np.diff(errors) < 0).all()
    assert errors[-1] < 1e-4


def test_receptance_elsewhere_reads_the_reconstructed_field():
    K, M = spring_chain(300)
    reading = np.eye(300)[100]
    exact = receptance(full_order(K, M, end_patch(300)), reading, [0.0, 900.0], zeta=0.01)
    reduced = free_modes(K, M, end_patch(300), Selection(n_modes=60))
    close = receptance(reduced, reading, [0.0, 900.0], zeta=np.full(61, 0.01))
    np.testing.assert_allclose(close, exact, rtol=2e-3)


@KINDS
def test_every_mode_kept_is_the_full_model(kind):
    K, M = spring_chain(40)
    n_modes = 40 if kind == "free-modes" else 35
    reduced = reduced_end(kind, K, M, n_modes)
    exact = modal(full_order(K, M, end_patch(40))).omega
    np.testing.assert_allclose(modal(reduced).omega, exact, rtol=1e-9)


def test_damping_is_projected_like_mass_and_stiffness():
    K, M = spring_chain(N)
    C = 3.0 * M + 1e-7 * K
    for reduced in (
        free_modes(K, M, end_patch(N), Selection(n_modes=6), C=C),
        craig_bampton(K, M, end_patch(N), end_boundary(N), Selection(n_modes=6), C=C),
    ):
        np.testing.assert_allclose(
            reduced.C, 3.0 * reduced.M + 1e-7 * reduced.K, atol=1e-9 * np.abs(reduced.C).max()
        )


def test_a_factorisation_can_be_handed_in_and_is_made_once():
    shapes = []

    def counting(A):
        shapes.append(A.shape)
        return superlu(A)

    K, M = spring_chain(N)
    free_modes(K, M, end_patch(N), Selection(n_modes=5), factorise=counting)
    craig_bampton(K, M, end_patch(N), end_boundary(N), Selection(n_modes=5), factorise=counting)
    assert shapes == [(N, N), (N - 5, N - 5)]


@pytest.mark.parametrize("choice", ["lowest", "contact"])
@KINDS
def test_the_factor_of_a_held_structure_serves_both_reductions(kind, choice):
    K, M = spring_chain(N)
    w, to_hz = end_patch(N), 2000.0
    selection = Selection(n_modes=20, to_hz=to_hz, choice=choice)
    place = () if kind == "free-modes" else (end_boundary(N),)
    reduction = free_modes if kind == "free-modes" else craig_bampton

    def never(A):
        raise AssertionError("factorised again")

    separate = reduction(K, M, w, *place, selection)
    shared = reduction(K, M, w, *place, selection, factorise=never, factor=superlu(K))
    f = np.linspace(1.0, to_hz, 20)
    answers = [receptance(one, None, f, loss=0.01) for one in (separate, shared)]
    np.testing.assert_allclose(answers[1] / answers[0], 1.0, rtol=0, atol=1e-10)


@pytest.mark.parametrize("size", [1, 2, 5, 20])
@pytest.mark.parametrize("share", [1e-3, 1e-6, 1e-7])
def test_a_shared_factor_costs_a_soft_structure_no_digits(share, size):
    """Softly held to the ground, all of the patch moves alike, so that constraint modes are told
    by differences of nearly equal displacements."""
    K, M = spring_chain(N)
    K[0, 0] = share * STIFFNESS + STIFFNESS
    soft = K[0, 0] - STIFFNESS  # as it is rounded
    reduced = craig_bampton(
        K, M, end_patch(N, size), end_boundary(N, size), Selection(n_modes=5), factor=superlu(K)
    )
    exact = 1 / soft + (N - size + sum((i / size) ** 2 for i in range(1, size))) / STIFFNESS
    # rounding of each of the N diagonal entries is a spring to the ground of up to eps of it, and
    # as often a negative one: sqrt(N) eps of the stiffness against the share of it. Up to 0.4 of
    # this is found with the kernels of Haswell, Skylake and Prescott; one correction left 150 of it
    bound = 4 * np.sqrt(N) * np.finfo(float).eps / share
    assert abs(static_compliance(reduced) / exact - 1) < bound


def test_an_inaccurate_factorisation_is_noticed():
    class Sloppy:
        def __init__(self, A):
            self.factor = superlu(A)

        def solve(self, b):
            return self.factor.solve(b) * (
                1 + 1e-4 * np.arange(len(b)).reshape(-1, *[1] * (b.ndim - 1))
            )

    K, M = spring_chain(N)
    with pytest.raises(ReductionError, match=r"constraint modes|not T\^T"):
        craig_bampton(K, M, end_patch(N), end_boundary(N), Selection(n_modes=0), factorise=Sloppy)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (
            lambda K, M, w: (K + sp.csc_array(np.triu(np.full((40, 40), 1e3), 1)), M, w),
            "K is not symmetric",
        ),
        (lambda K, M, w: (-K, M, w), "indefinite|not positive"),
        (lambda K, M, w: (K, -M, w), "not positive"),
        (lambda K, M, w: (K * np.nan, M, w), "not finite"),
        (lambda K, M, w: (K, M, 0 * w), "w is zero"),
        (lambda K, M, w: (K, M, w[1:]), "w has shape"),
    ],
)
def test_unsound_matrices_are_refused_in_one_sentence(change, sentence):
    K, M, w = change(*spring_chain(40), end_patch(40))
    with pytest.raises(ReductionError, match=sentence) as refusal:
        free_modes(K, M, w, Selection(n_modes=3))
    assert str(refusal.value).count("\n") == 0


@pytest.mark.parametrize(
    ("boundary", "sentence"),
    [
        ([36, 37, 38, 39], "w loads 1 interior"),
        ([35, 36, 37, 38, 39, 39], "twice"),
        ([40], "from 0 to 39"),
        ([], "at least one"),
    ],
)
def test_a_boundary_that_cannot_work_is_refused(boundary, sentence):
    K, M = spring_chain(40)
    with pytest.raises(ReductionError, match=sentence):
        craig_bampton(K, M, end_patch(40), boundary, Selection(n_modes=3))


def test_a_part_that_floats_inside_is_refused():
    K, M = spring_chain(40)
    loose = sp.block_diag([K, K * 0], format="csc")
    both = sp.block_diag([M, M], format="csc")
    w = np.concatenate([end_patch(40), np.zeros(40)])
    with pytest.raises(ReductionError, match=r"floats|rigid-body"):
        craig_bampton(loose, both, w, np.arange(35, 40), Selection(n_modes=3))


def test_rigid_motions_fewer_than_a_lanczos_block_hide_no_elastic_mode():
    """Six short loose chains: after one solution 8 vectors lie in 6 directions but for 1e-7."""
    chain = spring_chain(10, held=False)
    grounded = STIFFNESS * sp.diags_array(np.linspace(1, 2, 400))
    K, M = (sp.block_diag([A] * 6, format="csc") for A in chain)
    K = sp.block_diag([grounded, K], format="csc")
    M = sp.block_diag([MASS * sp.eye_array(400), M], format="csc")
    reduced = free_modes(K, M, end_patch(460), Selection(n_modes=12))
    omega = 2 * np.sqrt(STIFFNESS / MASS) * np.sin(np.pi / 20)  # of every chain
    np.testing.assert_allclose(modal(reduced).omega[:12], [0.0] * 6 + [omega] * 6, rtol=1e-9)


def test_health_finds_what_is_wrong_with_a_foreign_model():
    K, M = spring_chain(40)
    sound = reduced_end("craig-bampton", K, M, 4)
    assert health(sound).findings == ()
    assert "not symmetric" in health(sound._replace(K=np.triu(sound.K))).findings[0]
    assert "M is not positive" in health(sound._replace(M=-sound.M)).findings[0]
    assert "indefinite" in health(sound._replace(K=sound.K - 1e9 * sound.M)).findings[0]
    assert "feed energy" in health(sound._replace(C=-sound.M)).findings[0]


@pytest.mark.parametrize(("n", "n_modes"), [(449, 449), (450, 445), (700, 500)])
def test_every_mode_of_a_chain_can_be_asked_for(n, n_modes):
    K, M = spring_chain(n)
    j = np.arange(1, n_modes + 1)
    exact = 2 * np.sqrt(STIFFNESS / MASS) * np.sin((2 * j - 1) * np.pi / (4 * n + 2))
    reduced = free_modes(K, M, end_patch(n), Selection(n_modes=n_modes))
    np.testing.assert_allclose(modal(reduced).omega[:n_modes], exact, rtol=1e-10)


def test_equal_parts_have_all_their_equal_modes():
    K, M = spring_chain(300)
    copies = 3
    thrice = [sp.block_diag([A] * copies, format="csc") for A in (K, M)]
    reduced = free_modes(*thrice, end_patch(300 * copies), Selection(cutoff_hz=500.0))
    one = modal(free_modes(K, M, end_patch(300), Selection(cutoff_hz=500.0))).omega[:-1]
    np.testing.assert_allclose(modal(reduced).omega[:-1], np.repeat(one, copies), rtol=1e-9)


def receptance_error(reduced, exact, frequency):
    close = receptance(reduced, None, frequency, loss=LOSS)
    return rms(close - exact) / size(exact)


@pytest.mark.parametrize("error", [1e-2, 1e-3, 1e-4])
def test_free_modes_asked_for_an_error_keep_it_with_few_modes_to_spare(error):
    K, M = spring_chain(300)
    w = end_patch(300)
    frequency = frequencies(4e3)
    exact = receptance(full_order(K, M, w), None, frequency, loss=LOSS)
    reduced = free_modes(K, M, w, Selection(error=error, to_hz=4000.0))
    n_modes = len(reduced.w) - 1
    assert reduced.error <= error
    assert receptance_error(reduced, exact, frequency) < error
    fewer = free_modes(K, M, w, Selection(n_modes=n_modes - 2, to_hz=4000.0))
    assert fewer.error > error


@pytest.mark.parametrize("error", [1e-2, 1e-3, 1e-4])
def test_craig_bampton_asked_for_an_error_keeps_it(error):
    K, M = spring_chain(300)
    w = end_patch(300)
    frequency = frequencies(4e3)
    exact = receptance(full_order(K, M, w), None, frequency, loss=LOSS)
    reduced = craig_bampton(K, M, w, end_boundary(300), Selection(error=error, to_hz=4000.0))
    assert reduced.error <= error
    assert receptance_error(reduced, exact, frequency) < error


@pytest.mark.parametrize("error", [1e-2, 1e-3, 1e-4])
def test_craig_bampton_asked_for_an_error_goes_1_4_times_too_high_at_most(error):
    """The fixed-interface modes of that share of the cutoff would not have done."""
    K, M = spring_chain(300)
    selection = Selection(error=error, to_hz=4000.0)
    hz = fixed_interface_hz(held_at_the_end(K, M, end_patch(300), selection))
    fewer = selection._replace(error=None, cutoff_hz=hz[-1] / 1.401)
    assert held_at_the_end(K, M, end_patch(300), fewer).error > error


def test_modes_handed_in_with_wrong_frequencies_are_noticed():
    K, M = spring_chain(300)
    omega, phi = known_pairs(K, M, 9)
    with pytest.raises(ReductionError, match=r"not T\^T K T"):
        free_modes(K, M, end_patch(300), Selection(modes=(1.001 * omega, phi)))


def test_modes_handed_in_that_are_not_normalised_are_noticed():
    K, M = spring_chain(300)
    omega, phi = known_pairs(K, M, 9)
    with pytest.raises(ReductionError, match="not mass-orthonormal"):
        free_modes(K, M, end_patch(300), Selection(modes=(omega, phi + 0.01 * phi[:, ::-1])))


def test_rigid_body_modes_handed_in_with_rounding_for_a_frequency_are_rigid():
    K, M = spring_chain(300, held=False)
    omega, phi = known_pairs(K, M, 9)
    omega[0] = 1e-3
    reduced = free_modes(K, M, end_patch(300), Selection(modes=(omega, phi)))
    assert modal(reduced).omega[0] == 0
    exact = static_compliance(full_order(K, M, end_patch(300)))
    assert static_compliance(reduced) == pytest.approx(exact, rel=1e-8, abs=0.0)


def known_pairs(K, M, n_modes):
    wall = modal(full_order(K, M, end_patch(K.shape[0])))
    return wall.omega[:n_modes].copy(), wall.vectors[:, :n_modes]


def frame(n=500, weak=1e-9, seed=3):
    """A held chain of n masses, and beside it n that the contact at its end moves only weakly."""
    K, M = spring_chain(n)
    soft = sp.diags_array(np.linspace(1e-5, 1e-3, n) * STIFFNESS)
    link = weak * STIFFNESS * sp.eye_array(n)
    both = sp.block_array([[K + link, -link], [-link, soft + link]])
    return both.tocsc(), sp.block_diag([M, M], format="csc")


def contact_reduced(kind, K, M, w, **selection):
    selection = Selection(choice="contact", **selection)
    if kind == "free-modes":
        return free_modes(K, M, w, selection)
    return craig_bampton(K, M, w, np.flatnonzero(w), selection)


@KINDS
def test_modes_chosen_by_the_contact_leave_out_what_it_does_not_move(kind):
    """500 oscillators of 60 to 620 Hz hang on by 1e-9 of a spring: most low modes are theirs."""
    K, M = frame()
    w = np.zeros(1000)
    w[495:500] = 0.2
    f = np.linspace(10, 400, 60)
    exact = np.array([w @ superlu(K - (2 * np.pi * x) ** 2 * M).solve(w) for x in f])
    chosen = contact_reduced(kind, K, M, w, n_modes=12, to_hz=400.0)
    lowest = free_modes(K, M, w, Selection(n_modes=12))
    off = [np.linalg.norm(receptance(m, None, f) - exact) for m in (chosen, lowest)]
    assert off[0] < 2e-5 * np.linalg.norm(exact)  # 5e-6 measured
    assert off[1] > 1e-2 * np.linalg.norm(exact)


@KINDS
@pytest.mark.parametrize("error", [1e-2, 1e-4, 1e-6])
def test_modes_chosen_by_the_contact_keep_the_error_asked_for(kind, error):
    K, M = spring_chain(N)
    w, to_hz = end_patch(N), 4000.0
    reduced = contact_reduced(kind, K, M, w, error=error, to_hz=to_hz)
    f = to_hz * np.arange(1, 201) / 200
    D = [K * (1 + 0.01j) - (2 * np.pi * x) ** 2 * M for x in f]
    exact = np.array([w @ superlu_complex(A, w) for A in D])
    off = np.linalg.norm(receptance(reduced, None, f, loss=0.01) - exact) / np.linalg.norm(exact)
    assert off <= reduced.error <= error


@KINDS
@pytest.mark.parametrize("choice", ["lowest", "contact"])
@pytest.mark.parametrize("slower", [1e9, 1e-9])
def test_a_slow_structure_is_reduced_as_a_quick_one(kind, choice, slower):
    """A time of 1e9 s in the place of a second: no frequency is then above 1 rad/s."""
    K, M = spring_chain(N)
    omega, phi = (values[..., [0, 40]] for values in known_pairs(K, M, 41))
    reduce = {"free-modes": free_modes, "craig-bampton": held_at_the_end}[kind]

    def result(c):
        selection = Selection(cutoff_hz=4000.0 / c)
        if choice == "contact":
            selection = Selection(n_modes=12, to_hz=2e3 / c, choice=choice, modes=(omega / c, phi))
        return reduce(K / c**2, M, end_patch(N), selection)

    slow, quick = result(slower), result(1.0)
    np.testing.assert_allclose(modal(slow).omega * slower, modal(quick).omega, rtol=1e-7)
    assert slow.n_residual == quick.n_residual
    assert slow.error is quick.error is None or abs(slow.error / quick.error - 1) < 1e-6


@KINDS
@pytest.mark.parametrize("to_hz", [1e-3, 1e3])
def test_a_model_without_modes_states_no_finite_error(kind, to_hz):
    """Nothing says how low the first one lies that was left out."""
    selection = Selection(n_modes=0, to_hz=to_hz)
    reduce = {"free-modes": free_modes, "craig-bampton": held_at_the_end}[kind]
    assert reduce(*spring_chain(300), end_patch(300), selection).error == np.inf


@KINDS
def test_modes_of_the_contact_far_above_the_band_are_static_shapes(kind):
    K, M = spring_chain(300)
    reduce = {"free-modes": free_modes, "craig-bampton": held_at_the_end}[kind]
    reduced = reduce(K, M, end_patch(300), Selection(n_modes=16, to_hz=100.0, choice="contact"))
    assert reduced.n_residual == np.count_nonzero(modal(reduced).omega > 2 * np.pi * 250.0) > 1


def superlu_complex(A, b):
    return sp.linalg.spsolve(sp.csc_matrix(A), b.astype(complex))


@KINDS
def test_the_error_of_contact_modes_at_growing_loads_falls_with_every_mode(kind):
    """At e^{st}, s real, Galerkin's error is a squared energy norm: nested bases make it fall.

    The vectors of n modes are those of n - 1 and one more, but for the residual, whose share the
    static response bounds; measured here: strictly falling down to rounding.
    """
    K, M = spring_chain(N)
    w, s = end_patch(N), 2 * np.pi * 3000.0
    exact = w @ superlu(K + s**2 * M).solve(w)
    counts = (2, 4, 8, 12, 16)
    models = [contact_reduced(kind, K, M, w, n_modes=n, to_hz=4000.0) for n in counts]
    walls = [modal(model) for model in models]
    missing = [exact - np.sum(wall.phi**2 / (wall.omega**2 + s**2)) for wall in walls]
    noise = 1e-12 * exact
    assert min(missing) > -noise
    assert all(b < 0.9 * a or a < noise for a, b in pairwise(missing))


def test_modes_to_keep_stay_among_those_of_the_contact():
    K, M = spring_chain(N)
    full = modal(full_order(K, M, end_patch(N)))
    retained = (full.omega[[0, 40]], full.vectors[:, [0, 40]])
    for kind in ("free-modes", "craig-bampton"):
        reduced = contact_reduced(kind, K, M, end_patch(N), n_modes=10, to_hz=2e3, modes=retained)
        result = modal(reduced).omega
        for omega in retained[0]:
            assert np.abs(result / omega - 1).min() < 1e-8


def test_a_floating_chain_keeps_its_rigid_motion_among_contact_modes():
    K, M = spring_chain(N, held=False)
    reduced = free_modes(K, M, end_patch(N), Selection(n_modes=10, to_hz=2e3, choice="contact"))
    assert modal(reduced).omega[0] == 0
    assert effective_mass(reduced, M, np.ones(N)).mass[0] == pytest.approx(N * MASS, rel=1e-9)
    with pytest.raises(ReductionError, match="floats freely"):
        craig_bampton(
            K, M, end_patch(N), end_boundary(N), Selection(n_modes=10, to_hz=2e3, choice="contact")
        )


def test_a_choice_by_contact_without_a_frequency_is_refused():
    K, M = spring_chain(N)
    with pytest.raises(ReductionError, match="needs n_modes or error, and to_hz"):
        free_modes(K, M, end_patch(N), Selection(n_modes=4, choice="contact"))
    with pytest.raises(ReductionError, match="can be 'lowest' or 'contact'"):
        free_modes(K, M, end_patch(N), Selection(n_modes=4, choice="best"))


def exact_receptance(K, M, w, frequency):
    D = [K * (1 + 0.01j) - (2 * np.pi * f) ** 2 * M for f in frequency]
    return np.array([w @ superlu_complex(A, w) for A in D])


@KINDS
@pytest.mark.parametrize("choice", ["lowest", "contact"])
@pytest.mark.parametrize("n_modes", [12, 30])
def test_the_difference_to_the_finer_model_is_the_true_error(kind, choice, n_modes):
    """The finer model's own error is below 1e-8 by its bound: the rest of the digits agree."""
    K, M = spring_chain(300)
    w, frequency = end_patch(300), np.linspace(10, 4000, 100)
    reduce = {"free-modes": free_modes, "craig-bampton": held_at_the_end}[kind]
    selection = Selection(n_modes=n_modes, choice=choice, to_hz=4e3, finer_hz=4e3)
    reduced = reduce(K, M, w, selection)
    exact = exact_receptance(K, M, w, frequency)
    result, finer = (receptance(m, None, frequency, loss=0.01) for m in (reduced, reduced.finer))
    true, stated = np.linalg.norm(result - exact), np.linalg.norm(result - finer)
    assert stated == pytest.approx(true, rel=1e-2, abs=1e-7 * np.linalg.norm(exact))


def held_at_the_end(K, M, w, selection):
    return craig_bampton(K, M, w, np.flatnonzero(w), selection)


@pytest.mark.parametrize("held", [True, False])
@pytest.mark.parametrize("n_modes", [25, 40, 60])
@pytest.mark.parametrize(("reduce", "factor"), [(free_modes, 5), (held_at_the_end, 1.3)])
def test_the_stated_error_bounds_the_true_one_within_a_factor(reduce, factor, n_modes, held):
    """1.24, 1.05 and 1.02 measured of fixed-interface modes: those left out are taken for as low
    as the highest kept."""
    K, M = spring_chain(300, held)
    frequency = frequencies(4e3)
    exact = receptance(full_order(K, M, end_patch(300)), None, frequency, loss=LOSS)
    reduced = reduce(K, M, end_patch(300), Selection(n_modes=n_modes, to_hz=4000.0))
    true = receptance_error(reduced, exact, frequency)
    assert true < reduced.error < factor * true


@KINDS
def test_the_error_up_to_a_frequency_that_no_kept_mode_reaches_is_unbounded(kind):
    """Far below the highest mode it is 2.2e-5 and 0.030, the true one 1.5e-5 and 0.028."""
    K, M = spring_chain(300)
    reduce = {"free-modes": free_modes, "craig-bampton": held_at_the_end}[kind]
    highest = modal(free_modes(K, M, end_patch(300), Selection(n_modes=10))).omega[9] / (2 * np.pi)
    assert reduce(K, M, end_patch(300), Selection(n_modes=10, to_hz=1.93 * highest)).error == np.inf
    assert reduce(K, M, end_patch(300), Selection(n_modes=10, to_hz=0.5 * highest)).error < 0.031


@KINDS
@pytest.mark.parametrize("choice", ["lowest", "contact"])
def test_errors_are_stated_of_one_receptance_whatever_the_kind_and_choice(kind, choice):
    """At the loss factor LOSS. Stated over true is 1.39 and 1.05 of the lowest modes, 1.00 and 1.20
    of those of the contact."""
    K, M = spring_chain(300)
    w, frequency = end_patch(300), frequencies(4e3)
    exact = receptance(full_order(K, M, w), None, frequency, loss=LOSS)
    reduce = {"free-modes": free_modes, "craig-bampton": held_at_the_end}[kind]
    reduced = reduce(K, M, w, Selection(n_modes=40, choice=choice, to_hz=4e3))
    assert 0.98 < reduced.error / receptance_error(reduced, exact, frequency) < 1.5


@KINDS
def test_a_model_of_every_mode_states_no_error(kind):
    K, M = spring_chain(40)
    reduce = {"free-modes": free_modes, "craig-bampton": held_at_the_end}[kind]
    n_modes = 40 if kind == "free-modes" else 35
    assert reduce(K, M, end_patch(40), Selection(n_modes=n_modes, to_hz=3e3)).error == 0.0
