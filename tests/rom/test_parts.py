"""Parts of reductions: factors, pencils, bases, bounds, each against dense algebra."""

import contextlib
import tracemalloc

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.linalg import eigh

from beadwave.rom import (
    LOSS,
    ReductionError,
    Selection,
    craig_bampton,
    effective_mass,
    free_modes,
    full_order,
    health,
    is_indefinite,
    modal,
    superlu,
    tall,
)
from beadwave.rom.contact_modes import (
    _bound,
    _ranked,
    _residual_errors,
    contact_modes,
    finer_space,
    krylov_space,
    static_shapes,
)
from beadwave.rom.contact_space import KrylovOptions
from beadwave.rom.factorisation import Pencil, frequency_scale, noise, solutions, symmetric
from beadwave.rom.fixed_interface import fixed_interface, whole_pencil
from beadwave.rom.floating import is_held, pencil
from beadwave.rom.health import fixed_interface_hz, require_faithful, require_static_response
from beadwave.rom.lanczos import (
    EigenPairs,
    LanczosOptions,
    known_modes,
    lowest_modes,
    modes_below,
    modes_until,
    no_modes,
    with_columns,
)
from beadwave.rom.residual_vector import attachment_modes, residual_vector, static_response
from beadwave.rom.truncation import Moments, frequencies, rms, size, tail_errors

N = 12
W = np.r_[np.zeros(N - 2), 0.4, 0.6]


def structure(held=True, n=N):
    link = np.diff(np.eye(n), axis=0)
    K = link.T @ np.diag(np.linspace(1e3, 3e3, n)[1:]) @ link
    K[0, 0] += 1e3 if held else 0.0
    return sp.csc_array(K), sp.csc_array(np.diag(np.linspace(1.0, 2.0, n)))


def exact_modes(K, M):
    squared, phi = eigh(K.toarray(), M.toarray())
    return np.sqrt(np.maximum(squared, 0)), phi


def responses(K, M, w, hz):
    s = 2 * np.pi * np.atleast_1d(hz)
    dense = K.toarray() * (1 + 1j * LOSS)
    return np.array([w @ np.linalg.solve(dense - x**2 * M.toarray(), w) for x in s])


# --- factors -------------------------------------------------------------------------------------


def test_matrices_are_asked_to_be_square_finite_and_symmetric():
    K = structure()[0].toarray()
    np.testing.assert_array_equal(symmetric(K, "K").toarray(), K)
    K[0, 1] *= 1 + 0.9e-9 * K.max() / abs(K[0, 1])
    symmetric(K, "K")
    symmetric(-K, "K")
    for broken, sentence in (
        (K[:, 1:], "12 x 11"), (np.where(K == K.max(), np.inf, K), "not finite"),
        (K + 1.1e-9 * K.max() * np.eye(N, k=1), "not symmetric"),
        (K + 1.1e-9 * K.max() * np.eye(N, k=N - 1), "not symmetric"),  # one entry
    ):  # fmt: skip
        with pytest.raises(ReductionError, match=sentence):
            symmetric(broken, "K")


def test_the_scale_of_frequencies_leaves_out_one_stiff_spring_in_a_hundred():
    """And dofs without mass; a zero eigenvalue is told by 200 roundings of it."""
    k = np.r_[np.full(150, 2.0), np.full(49, 8.0), 1e12, 1e15]
    m = np.r_[np.ones(199), 1.0, 0.0]
    K, M = sp.diags_array(k).tocsc(), sp.diags_array(m).tocsc()
    assert frequency_scale(K, M) == 8.0
    assert noise(K, M) / (200 * np.finfo(float).eps * 8.0) == pytest.approx(1.0)
    assert frequency_scale(K[:1, :1], M[:1, :1]) == 2.0
    assert frequency_scale(K, 0 * M) == 0.0


def test_many_right_hand_sides_are_solved_in_blocks():
    K, _ = structure()
    B = np.random.default_rng(0).standard_normal((N, 150))
    for given in (B, sp.csc_array(B)):
        np.testing.assert_allclose(K @ solutions(superlu(K), given), B, atol=1e-9)


def test_a_factor_keeps_its_pivots_on_the_diagonal_of_a_symmetric_matrix():
    """However small beside the rest of its column: rows that change places would cost fill."""
    K = np.array([[1.0, -2.0, 0], [-2, 5, -4], [0, -4, 17]])
    factor = superlu(sp.csc_array(K))
    np.testing.assert_array_equal(factor.perm_r, factor.perm_c)
    np.testing.assert_allclose(factor.solve(K), np.eye(3), atol=1e-13)


@pytest.mark.parametrize("sigma", [-1e-8, -1.0, -300.0])
def test_inertia_relief_by_a_shifted_factor_is_the_sum_over_elastic_modes(sigma):
    K, M = structure(held=False)
    omega, phi = exact_modes(K, M)
    problem = Pencil(K, M, superlu(K - sigma * M), sigma)
    result = static_response(problem, W, phi[:, :1])
    exact = phi[:, 1:] @ (phi[:, 1:].T @ W / omega[1:] ** 2)
    np.testing.assert_allclose(result, exact, atol=1e-10 * np.abs(exact).max())
    of_two = attachment_modes(problem, np.column_stack([W, -3 * W]), phi[:, :1])
    np.testing.assert_allclose(of_two, np.outer(exact, [1, -3]), atol=1e-9 * np.abs(exact).max())
    K, M = structure()
    plain = Pencil(K, M, superlu(K - sigma * M), sigma)
    held = static_response(plain, W, np.zeros((N, 0)))
    np.testing.assert_allclose(held, np.linalg.solve(K.toarray(), W), rtol=1e-9)
    assert not static_response(plain, 0 * W, np.zeros((N, 0))).any()


def test_a_pencil_is_shifted_where_it_floats_and_as_asked():
    K, M = structure()
    assert pencil(K, M, superlu).sigma == 0.0
    given = pencil(K, M, superlu, shift=-7.0)
    assert given.sigma == -7.0
    np.testing.assert_allclose((K + 7 * M) @ given.factor.solve(W), W, atol=1e-12)
    K, M = structure(held=False)
    free = pencil(K, M, superlu)
    first = exact_modes(K, M)[0][1]
    assert 1e-2 < -free.sigma / (first / 10) ** 2 < 1e2
    np.testing.assert_allclose((K - free.sigma * M) @ free.factor.solve(W), W, atol=1e-10)


def two_chains(link):
    """Two stiff chains on a soft link, free."""
    K, M = (A.tolil() for A in structure(held=False))
    K[5:7, 5:7] += (link - 1) * -K[5, 6] * np.array([[1, -1], [-1, 1]])
    return K.tocsc(), M.tocsc()


def long_chain(n):
    """A free chain, whose first mode is pi / n of its highest."""
    K = sp.diags_array([-np.ones(n - 1), np.r_[1, 2 * np.ones(n - 2), 1], -np.ones(n - 1)],
                       offsets=[-1, 0, 1]).tocsc()  # fmt: skip
    return K, sp.eye_array(n).tocsc()


@pytest.mark.parametrize(
    ("chain", "n_factors"),
    [(long_chain(2000), 2), (two_chains(1e-6), 3), (two_chains(1e-3), 3), (two_chains(1.0), 3)],
)
def test_a_shift_of_a_billionth_of_the_scale_serves_where_the_first_mode_lies_near(
    chain, n_factors
):
    """K itself is tried before, the right shift after it; on a soft link the mode of that is as
    good as rigid, and the next one chooses the shift."""
    (K, M), factors = chain, []

    def counted(A):
        factors.append(A)
        return superlu(A)

    result = pencil(K, M, counted)
    assert len(factors) == n_factors
    if n_factors == 2:
        assert result.sigma / (-1e-9 * frequency_scale(K, M)) == pytest.approx(1.0, rel=1e-12)
    W = np.linspace(1, -1, K.shape[0])
    u = result.factor.solve(W)
    np.testing.assert_allclose(K @ u - result.sigma * (M @ u), W, atol=1e-4)


@pytest.mark.parametrize(("k", "is_shifted"), [(1e-9, True), (1e-2, False)])
def test_a_structure_on_soft_springs_is_shifted_as_one_that_floats(k, is_shifted):
    """A chain whose first end hangs on k of its own stiffness; the next mode chooses the shift."""
    K, M = structure(held=False)
    K = (K + sp.csc_array(([k * K.diagonal().max()], ([0], [0])), shape=K.shape)).tocsc()
    omega = exact_modes(K, M)[0]
    result = pencil(K, M, superlu)
    assert result.sigma == (pytest.approx(-((omega[1] / 10) ** 2), rel=1e-6) if is_shifted else 0)


@pytest.mark.parametrize("k", [1e-6, 1e-9, 1e-11])
def test_a_space_beside_the_mode_of_a_soft_suspension_keeps_all_digits(k):
    """The static response is 1 / k of the suspension and 20 of the rest, by all modes of LAPACK."""
    K, M = long_chain(60)
    K, w = (K + sp.csc_array(([k], ([0], [0])), shape=K.shape)).tocsc(), np.eye(60)[-1]
    omega, phi = exact_modes(K, M)
    suspension = EigenPairs(omega[:1], phi[:, :1])
    pairs = krylov_space(Pencil(K, M, superlu(K)), w, suspension, 1e-8, 0.1, 20).pairs
    off = pairs.phi.T @ (K @ pairs.phi) - np.diag(pairs.omega**2)
    assert np.abs(off).max() < 1e-11
    exact, static = (np.sum(((f.T @ w) / o)[1:] ** 2) for o, f in ((omega, phi), pairs))
    assert static == pytest.approx(exact, rel=1e-11)


@pytest.mark.parametrize("n_chains", [6, 8, 20])
def test_the_first_elastic_mode_is_looked_for_behind_all_rigid_ones(n_chains):
    """n loose chains have n rigid motions, and as many equal first modes behind them."""
    K, M = (sp.block_diag([A] * n_chains, format="csc") for A in structure(held=False))
    first = exact_modes(*structure(held=False))[0][1]
    assert 1e-2 < -pencil(K, M, superlu).sigma / (first / 10) ** 2 < 1e2
    n_rigid = LanczosOptions().most_rigid
    more = [sp.block_diag([A] * n_rigid, format="csc") for A in structure(held=False)]
    with pytest.raises(ReductionError, match=f"at least {n_rigid} rigid-body modes"):
        pencil(*more, superlu)


@pytest.mark.parametrize("heavier", [1e-9, 1.0, 1e9])
def test_a_structure_is_held_where_its_lowest_mode_stands_above_rounding(heavier):
    K, M = structure(held=False)
    M = heavier * M
    for stiffness, held in ((1e-13, False), (1e-6, True)):
        soft = K + sp.csc_array(np.diag(np.r_[stiffness * 3e3, np.zeros(N - 1)]))
        assert is_held(Pencil(soft, M, superlu(soft))) == held


@pytest.mark.parametrize("answer", [np.nan, np.inf, 0.0])
def test_a_structure_whose_factor_answers_no_number_is_not_held(answer):
    class Singular:
        def solve(self, b):
            return np.full_like(b, answer)

    assert not is_held(Pencil(*structure(), Singular()))


# --- modes ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [30, 500])
def test_lowest_modes_are_those_of_dense_algebra(n):
    """Above 400 unknowns by Lanczos."""
    K, M = structure(n=n)
    omega, phi = exact_modes(K, M)
    problem = pencil(K, M, superlu)
    for result, k in ((lowest_modes(problem, 9), 9), (modes_below(problem, omega[13] / 6.3), 13)):
        assert len(result.omega) == (9 if k == 9 else np.sum(omega < 2 * np.pi * omega[13] / 6.3))
        k = len(result.omega)
        np.testing.assert_allclose(result.omega, omega[:k], rtol=1e-9)
        np.testing.assert_allclose(result.phi.T @ (M @ result.phi), np.eye(k), atol=1e-10)
        alike = np.abs(np.einsum("ij,ij->j", result.phi, M @ phi[:, :k]))
        np.testing.assert_allclose(alike, 1.0, rtol=1e-8)
    assert lowest_modes(problem, 0).phi.shape == (n, 0)
    with pytest.raises(ReductionError, match=f"{n + 1} modes were asked"):
        lowest_modes(problem, n + 1)


def test_a_search_is_shown_converged_modes_from_the_lowest_on():
    K, M = structure(n=500)
    omega, phi = exact_modes(K, M)
    counts = []

    def enough(result, shapes):
        k = len(result)
        np.testing.assert_allclose(result, omega[:k], rtol=1e-8)
        alike = np.abs(np.einsum("ij,ij->j", shapes(), M @ phi[:, :k]))
        np.testing.assert_allclose(alike / np.linalg.norm(shapes().T @ (M @ phi), axis=1), 1.0)
        counts.append(k)
        return k >= 40

    modes_until(pencil(K, M, superlu), enough)
    assert counts == sorted(counts) and 40 <= counts[-1] < 80


def test_modes_found_elsewhere_are_normalised_and_their_rounding_is_rigid():
    K, M = structure(held=False)
    omega, phi = exact_modes(K, M)
    omega[0] = 0.5 * np.sqrt(noise(K, M))
    result = known_modes(pencil(K, M, superlu), omega[:3], 2.0 * phi[:, :3])
    np.testing.assert_allclose(result.omega, [0.0, *omega[1:3]], rtol=1e-14)
    np.testing.assert_allclose(result.phi, phi[:, :3], rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize(("share", "fine"), [(0.9e-7, True), (1.1e-7, False)])
def test_modes_found_elsewhere_may_share_a_ten_millionth_of_their_mass(share, fine):
    K, M = structure()
    omega, phi = exact_modes(K, M)
    phi[:, 1] += share * phi[:, 0]
    refused = pytest.raises(ReductionError, match=r"largest product 1\.1e-07, allowed 1e-7")
    with contextlib.nullcontext() if fine else refused:
        known_modes(pencil(K, M, superlu), omega, 3 * phi)


def test_a_mode_that_moves_nothing_is_refused():
    K, M = structure()
    omega, phi = exact_modes(K, M)
    with pytest.raises(ReductionError, match="M is not positive definite on the lowest modes"):
        known_modes(pencil(K, M, superlu), omega, phi * (omega > omega[2]))


def test_columns_are_appended_and_room_is_doubled():
    Q = np.empty((4, 3), order="F")
    Q[:, :2] = 1.0
    more = with_columns(Q, 2, np.full((4, 1), 2.0))
    assert more is Q
    widened = with_columns(Q, 3, np.full((4, 2), 3.0))
    assert widened.shape == (4, 10)
    np.testing.assert_array_equal(widened[0, :5], [1, 1, 2, 3, 3])


def test_products_of_tall_matrices_are_those_of_all_rows_at_once(monkeypatch):
    monkeypatch.setattr(tall, "ROWS", 7)
    V = np.asfortranarray(np.random.default_rng(0).standard_normal((40, 3 * tall.COLUMNS - 1)))
    A = structure(n=40)[0]
    exact = V.T @ (A @ V)
    np.testing.assert_allclose(tall.gram(V, A), exact, rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(tall.squares(V, A), np.diag(exact), rtol=1e-12)
    assert tall.squares(V[:, :0], A).shape == (0,)
    U = np.random.default_rng(1).standard_normal((V.shape[1], 5))
    product = V @ U
    result = tall.turned(V, U)
    np.testing.assert_allclose(result, product, rtol=1e-12, atol=1e-12)
    assert result.shape == (40, 5) and np.shares_memory(result, V)


# --- modes that the contact moves ----------------------------------------------------------------


@pytest.mark.parametrize("n_vectors", [0, 4, 7])
def test_a_krylov_space_keeps_its_bound_and_the_static_response(n_vectors):
    K, M = structure(n=60)
    w = np.r_[np.zeros(58), 0.4, 0.6]
    to_hz = 6.0
    space = krylov_space(pencil(K, M, superlu), w, no_modes(60),
                         1e-2, to_hz, n_vectors)  # fmt: skip
    omega, phi = space.pairs
    np.testing.assert_allclose(phi.T @ (M @ phi), np.eye(len(omega)), atol=1e-10)
    np.testing.assert_allclose(phi.T @ (K @ phi), np.diag(omega**2), atol=1e-7 * omega[-1] ** 2)
    static = w @ np.linalg.solve(K.toarray(), w)
    assert np.sum((phi.T @ w / omega) ** 2) == pytest.approx(static, rel=1e-9)
    hz = frequencies(to_hz)
    exact, s = responses(K, M, w, hz), 2 * np.pi * hz[:, None]
    result = ((phi.T @ w) ** 2 / (omega**2 * (1 + 1j * LOSS) - s**2)).sum(axis=1)
    true = rms(result - exact) / size(exact)
    assert true <= space.bound <= 1e-2


def test_a_space_ends_at_its_largest_number_of_vectors_with_the_error_that_they_leave():
    K, M = structure(n=60)
    w, none = np.r_[np.zeros(58), 0.4, 0.6], no_modes(60)
    with pytest.raises(ReductionError, match=r"^10 vectors leave an error of up to .* up to 6 Hz"):
        krylov_space(pencil(K, M, superlu), w, none, 1e-12, 6.0,
                     options=KrylovOptions(largest=10))  # fmt: skip


def test_the_bound_of_a_space_is_what_its_last_vector_leaves():
    """(s^2 beta |y_k|)^2 / eta, (1 + i eta - s^2 H) y = e_1 |K^-1 w|_K, beside known modes."""
    H = np.diag(np.linspace(0.5, 0.1, 5)) + 0.05 * (np.eye(5, k=1) + np.eye(5, k=-1))
    s, beta, norm = np.linspace(0.3, 3, 50), 0.02, 1.7
    omega, p = np.array([0.7, 9.0]), np.array([0.2, 0.6])
    e = np.eye(5)[0]
    y = np.array([np.linalg.solve((1 + 1j * LOSS) * np.eye(5) - x**2 * H, norm * e) for x in s])
    known = (p**2 / (omega**2 * (1 + 1j * LOSS) - s[:, None] ** 2)).sum(axis=1)
    exact = rms((s**2 * beta * np.abs(y[:, -1])) ** 2) / LOSS / size(norm * y[:, 0] + known)
    theta, S = np.linalg.eigh(H)
    bound = _bound(theta, S, np.array([[beta]]), norm * e[:, None], s, omega, p[:, None])
    assert bound == pytest.approx(exact, rel=1e-10)


def test_chosen_modes_are_those_that_matter_and_state_what_is_left():
    """The error stated is the space's bound and what one oscillator for the rest leaves."""
    K, M = structure(n=60)
    w, to_hz = np.r_[np.zeros(58), 0.4, 0.6], 6.0
    none = no_modes(60)
    selection = Selection(n_modes=9, to_hz=to_hz, choice="contact")
    chosen = contact_modes(pencil(K, M, superlu), w, none, selection)
    (omega, phi), residual = chosen.pairs, chosen.residual
    assert len(omega) == 9 and (np.diff(omega) > 0).all()
    beyond = np.linalg.solve(K.toarray(), w) - phi @ (phi.T @ w / omega**2)
    np.testing.assert_allclose(residual, beyond, atol=1e-9 * np.abs(beyond).max())
    hz = frequencies(to_hz)
    exact, s = responses(K, M, w, hz), 2 * np.pi * hz
    m1, m2 = w @ residual, residual @ (M @ residual)
    one = (m1**2 / m2) / (m1 / m2 * (1 + 1j * LOSS) - s**2)
    of_modes = ((phi.T @ w) ** 2 / (omega**2 * (1 + 1j * LOSS) - s[:, None] ** 2)).sum(axis=1)
    true = rms(of_modes + one - exact) / size(exact)
    assert 0.5 * chosen.error < true < 1.01 * chosen.error
    fewer = contact_modes(
        pencil(K, M, superlu), w, none, Selection(error=3 * true, to_hz=to_hz, choice="contact")
    )
    assert len(fewer.pairs.omega) <= 9 and fewer.error <= 3 * true
    with pytest.raises(ReductionError, match="cannot hold the 3"):
        contact_modes(pencil(K, M, superlu), w, lowest_modes(pencil(K, M, superlu), 3),
                      selection._replace(n_modes=2))  # fmt: skip


def test_a_space_has_one_vector_more_than_modes_are_asked_for_beside_the_known_ones():
    """In fives, and more only where its bound asks for them."""
    K, M = structure(n=60)
    w, problem = np.r_[np.zeros(58), 0.4, 0.6], pencil(K, M, superlu)
    known = lowest_modes(problem, 3)
    for n_modes, n_vectors in ((11, 10), (12, 10), (13, 15)):
        selection = Selection(n_modes=n_modes, to_hz=0.5, choice="contact")
        chosen = contact_modes(problem, w, known, selection)
        assert (len(chosen.pairs.omega), len(chosen.finer.omega)) == (n_modes, 3 + n_vectors)


def test_the_modes_to_keep_may_be_all_that_are_asked_for():
    K, M = structure(n=60)
    w, problem = np.r_[np.zeros(58), 0.4, 0.6], pencil(K, M, superlu)
    known = lowest_modes(problem, 3)
    selection = Selection(n_modes=3, to_hz=0.5, choice="contact")
    np.testing.assert_allclose(contact_modes(problem, w, known, selection).pairs.omega, known.omega)


def test_a_space_of_a_structure_whose_modes_are_all_known_is_these_without_an_error():
    K, M = structure()
    problem = pencil(K, M, superlu)
    space = krylov_space(problem, W, lowest_modes(problem, N), 1e-9, 6.0)
    assert (len(space.pairs.omega), space.bound) == (N, 0.0)


def test_modes_are_ranked_by_what_an_oscillator_with_their_moments_misses():
    """1 / (a - b) - 1 / a - b / a^2 = (b / a)^2 / (a - b), over the band; those to keep first."""
    rng = np.random.default_rng(4)
    omega, phi = np.sort(10 ** rng.uniform(0.5, 2.5, 40)), rng.uniform(0.1, 1, 40)
    s = 2 * np.pi * frequencies(10.0)[:, None]
    H = phi**2 / (omega**2 * (1 + 1j * LOSS) - s**2)
    order = _ranked(omega, phi, np.arange(0), 10.0)
    np.testing.assert_array_equal(order, np.argsort(-np.linalg.norm((s / omega) ** 4 * H, axis=0)))
    ranked = _ranked(omega, phi, np.array([7, 3]), 10.0)
    np.testing.assert_array_equal(ranked, [7, 3, *(i for i in order if i not in (3, 7))])


def test_the_error_of_a_choice_is_what_one_oscillator_for_the_rest_misses():
    """Of its static and quasi-static moments, a rigid motion having none; of the whole receptance,
    whose rigid part counts."""
    omega, phi = np.array([0.0, 90.0, 20.0, 140.0, 60.0]), np.array([0.3, 1.0, 0.7, 0.5, 0.2])
    s = 2 * np.pi * frequencies(4.0)

    def answer(omega, phi):
        return (phi**2 / (omega**2 * (1 + 1j * LOSS) - s[:, None] ** 2)).sum(axis=1)

    exact = []
    for n in range(5):
        rest, p = omega[n:][omega[n:] > 0], phi[n:][omega[n:] > 0]
        m1, m2 = np.sum((p / rest) ** 2), np.sum(p**2 / rest**4)
        one = answer(np.sqrt([m1 / m2]), np.array([m1 / np.sqrt(m2)]))
        exact.append(rms(one - answer(omega[n:], phi[n:])) / size(answer(omega, phi)))
    np.testing.assert_allclose(_residual_errors(omega, phi, 4.0), [*exact, 0.0], rtol=1e-9)


def test_static_shapes_are_above_the_highest_chosen_or_far_above_the_band():
    omega = 2 * np.pi * np.array([1.0, 10.0, 24.9, 25.1, 80.0])
    assert KrylovOptions().reach == 2.5
    assert static_shapes(omega, np.inf, 10.0) == 2
    assert static_shapes(omega, omega[1], 10.0) == 3
    assert static_shapes(omega, omega[-1], 1e3) == 1


@pytest.mark.parametrize("cutoff", [0.999, 1.001])
def test_modes_handed_in_are_cut_at_the_frequency_asked_for(cutoff):
    K, M = structure()
    omega, phi = exact_modes(K, M)
    selection = Selection(modes=(omega[:8], phi[:, :8]), cutoff_hz=cutoff * omega[5] / (2 * np.pi))
    n_below = 5 if cutoff < 1 else 6
    np.testing.assert_allclose(np.diag(free_modes(K, M, W, selection).K)[:-1], omega[:n_below] ** 2)


def test_of_all_modes_of_a_structure_nothing_is_left():
    K, M = structure()
    none = no_modes(N)
    selection = Selection(n_modes=N, to_hz=6.0, choice="contact")
    chosen = contact_modes(pencil(K, M, superlu), W, none, selection)
    assert chosen.error < 1e-9 and not chosen.residual.any()


def test_a_space_for_the_full_model_has_twenty_vectors_more_than_modes_are_kept():
    K, M = structure(n=60)
    w, none = np.r_[np.zeros(58), 0.4, 0.6], no_modes(60)
    result = finer_space(pencil(K, M, superlu), w, none, 0.1, n_vectors=10)
    assert 30 <= len(result.pairs.omega) < 40


def test_a_static_response_that_misses_its_load_is_noticed():
    K, M = structure()
    reduced, none = free_modes(K, M, W, Selection(n_modes=4)), np.zeros((N, 0))
    require_static_response(reduced, K * (1 + 0.9e-6), M, W, none)
    with pytest.raises(ReductionError, match=r"misses the load by 1.1e-06 \(allowed 1.0e-06\)"):
        require_static_response(reduced, K * (1 + 1.1e-6), M, W, none)


def test_a_static_response_may_miss_its_load_by_a_thousand_roundings_of_the_stiffest_part():
    """Of a structure so soft that its inertia at the highest frequency is 1e7 times the load."""
    K, M = structure(held=False)
    K[0, 0] += 1e-4
    reduced, none = free_modes(K, M, W, Selection(n_modes=4)), np.zeros((N, 0))
    inertia = np.linalg.norm(M @ np.linalg.solve(K.toarray(), W)) / np.linalg.norm(W)
    allowed = 1e3 * np.finfo(float).eps * frequency_scale(K, M) * inertia
    assert 1e-5 < allowed < 1e-3
    require_static_response(reduced, K * (1 + 0.9 * allowed), M, W, none)
    with pytest.raises(ReductionError, match="misses the load"):
        require_static_response(reduced, K * (1 + 1.1 * allowed), M, W, none)


@pytest.mark.parametrize("name", ["K", "M"])
def test_a_reduced_matrix_that_is_not_the_projected_one_is_noticed_from_a_millionth_on(name):
    K, M = structure()
    reduced = free_modes(K, M, W, Selection(n_modes=4))

    def off(by):
        return reduced._replace(**{name: getattr(reduced, name) * (1 + by)})

    require_faithful(off(0.9e-6), K, M)
    with pytest.raises(ReductionError, match=rf"{name} is not T\^T {name} T .*1\.1e-06"):
        require_faithful(off(1.1e-6), K, M)


def test_modes_inside_come_with_rising_frequencies():
    K, M = structure(n=60)
    w = np.r_[np.zeros(58), 0.4, 0.6]
    selection = Selection(n_modes=9, to_hz=6.0, choice="contact")
    squared = np.diag(craig_bampton(K, M, w, [58, 59], selection).K)[2:]
    assert len(squared) > 5 and (np.diff(squared) > 0).all()


def test_one_static_shape_stands_for_the_rest_of_modes_chosen_within_the_band():
    K, M = structure(n=60)
    w, to_hz = np.r_[np.zeros(58), 0.4, 0.6], 6.0
    reduced = free_modes(K, M, w, Selection(n_modes=9, to_hz=to_hz, choice="contact"))
    assert modal(reduced).omega[-2] < 2.5 * 2 * np.pi * to_hz
    assert reduced.n_residual == 1


# --- stated errors -------------------------------------------------------------------------------


def test_the_error_of_a_truncation_is_its_moment_bound_and_holds():
    """omega^4 (m_3 - m_2^2 / m_1) / (1 - omega^2 / omega_k+1^2)^3 over the size of all."""
    K, M = structure()
    omega, phi = exact_modes(K, M)
    p, k, to_hz = W @ phi, 8, 2.0
    out = p[k:] ** 2
    tail = Moments(*(np.sum(out / omega[k:] ** (2 * i)) for i in (1, 2, 3)))
    errors = tail_errors(omega[:k], p[:k], tail, to_hz)
    hz = frequencies(to_hz)
    s = 2 * np.pi * hz
    assert len(errors) == k + 1
    scale = size(
        tail.first + (p[:k] ** 2 / (omega[:k] ** 2 * (1 + 1j * LOSS) - s[:, None] ** 2)).sum(1)
    )
    for n in range(k + 1):
        m1, m2, m3 = (np.sum(p[n:] ** 2 / omega[n:] ** (2 * i)) for i in (1, 2, 3))
        following = omega[n] if n < k else omega[k - 1]
        if following <= s[-1]:
            assert errors[n] == np.inf
            continue
        bound = (m3 - m2**2 / m1) * rms(s**4 / (1 - (s / following) ** 2) ** 3) / scale
        assert errors[n] == pytest.approx(bound, rel=1e-6)
        one = m1**2 / m2 / (m1 / m2 - s**2)
        rest = (p[n:] ** 2 / (omega[n:] ** 2 - s[:, None] ** 2)).sum(axis=1)
        assert rms(rest - one) <= bound * scale
    assert np.isfinite(errors[-1]) and errors[0] == np.inf


def test_what_modes_leave_of_a_static_response_is_orthogonal_to_them_to_its_own_rounding():
    """A billionth of the response: one projection would leave a tenth of a millionth of that."""
    K, M = structure()
    _, phi = exact_modes(K, M)
    rest = phi[:, -1]
    beyond = residual_vector(M, phi[:, :-1], phi[:, :-1] @ np.linspace(1, 2, N - 1) + 1e-9 * rest)
    # 1e-9 of eps is 2e-25; 1e-25 is left
    np.testing.assert_allclose(phi[:, :-1].T @ (M @ beyond), 0.0, atol=1e-24)
    np.testing.assert_allclose(beyond, 1e-9 * rest, rtol=1e-5)


@pytest.mark.parametrize("faster", [1e-6, 1.0, 1e6])
def test_the_error_of_a_truncation_knows_no_unit_of_time_and_ends_at_rounding(faster):
    """Nothing is missed where less than 1e-12 of the compliance is, most of it the first mode's."""
    omega, phi = np.array([1.0, 50.0, 60.0]), np.array([1.0, 1e-2, 1e-2])
    for beyond, none in ((0.9e-12, True), (1.1e-12, False)):
        m1 = beyond / faster**2
        tail = Moments(m1, m1 / (70 * faster) ** 2, 2 * m1 / (70 * faster) ** 4)
        error = tail_errors(omega * faster, phi, tail, 2.0 * faster)
        assert (error[-1] == 0) == none and (error[:-1] > 0).all()


@pytest.mark.parametrize(("share", "bounded"), [(0.999, False), (1.001, True)])
def test_a_truncation_is_bounded_from_a_mode_at_the_end_of_the_band_on(share, bounded):
    """Between the last two of the frequencies as well."""
    s = 2 * np.pi * frequencies(2.0)
    assert s[-2] < 0.999 * s[-1]
    errors = tail_errors(share * s[-1:], np.ones(1), Moments(1e-4, 1e-8, 2e-12), 2.0)
    assert np.isfinite(errors).all() == bounded


@pytest.mark.parametrize("slower", [1.0, 1e4])
def test_a_softer_structure_gives_way_by_more_whether_held_or_not(slower):
    for held in (True, False):
        K, M = structure(held)
        soft, stiff = (health(full_order(A, M, W)) for A in (K / slower**2, K))
        assert soft.static_compliance / (slower**2 * stiff.static_compliance) == pytest.approx(1.0)


@pytest.mark.parametrize("slower", [1.0, 1e4])
def test_a_structure_whose_modes_are_all_kept_leaves_no_residual_vector(slower):
    K, M = structure()
    reduced = free_modes(K / slower**2, M, W, Selection(n_modes=N))
    assert (len(reduced.w), reduced.n_residual) == (N, 0)


def test_the_size_of_a_receptance_is_that_of_its_quietest_comb():
    H = np.ones(80)
    H[3::8] = 0.5
    H[40] = 1e6
    assert size(H) == 0.5
    np.testing.assert_allclose(frequencies(10.0, 4), [2.5, 5.0, 7.5, 10.0])


def test_the_stated_error_of_held_modes_bounds_the_true_one():
    K, M = structure(n=60)
    w, boundary, to_hz = np.r_[np.zeros(58), 0.4, 0.6], [58, 59], 3.0
    hz = frequencies(to_hz)
    exact = responses(K, M, w, hz)
    ratios = []
    for n_modes in (20, 30, 40):
        reduced = craig_bampton(K, M, w, boundary, Selection(n_modes=n_modes, to_hz=to_hz))
        small = [sp.csc_array(A) for A in (reduced.K, reduced.M)]
        true = rms(responses(*small, reduced.w, hz) - exact) / size(exact)
        ratios.append(reduced.error / true)
    assert 1 <= min(ratios) and max(ratios) < 1.5


@pytest.mark.parametrize("n_modes", [30, 57])
def test_the_error_of_held_modes_is_the_sum_over_those_left_out(n_modes):
    """s^4 q_b^T G q_b / (1 - s^2 / omega_k^2), G = sum_{j>k} L_j^T L_j / omega_j^2; of the last
    mode too, whose share is a millionth of the sum."""
    K, M = structure(n=60)
    w, boundary, to_hz = np.r_[np.zeros(58), 0.4, 0.6], [58, 59], 3.0
    reduced = craig_bampton(K, M, w, boundary, Selection(n_modes=n_modes, to_hz=to_hz))
    omega, phi = exact_modes(K[:58][:, :58], M[:58][:, :58])
    L = phi.T @ (M @ reduced.T[:, :2])[:58]
    G = (L[n_modes:].T / omega[n_modes:] ** 2) @ L[n_modes:]
    s = 2 * np.pi * frequencies(to_hz)
    D = [reduced.K * (1 + 1j * LOSS) - x**2 * reduced.M for x in s]
    q = np.array([np.linalg.solve(one, reduced.w) for one in D])
    missed = s**4 * np.einsum("ij,jk,ik->i", q[:, :2], G, q[:, :2])
    exact = rms(missed / (1 - (s / omega[n_modes - 1]) ** 2)) / size(q @ reduced.w)
    assert reduced.error / exact == pytest.approx(1.0, rel=1e-9)


# --- the structure held at its boundary ----------------------------------------------------------


@pytest.mark.parametrize(("off", "fine"), [(0.9e-8, True), (1.1e-8, False)])
def test_constraint_modes_are_refused_whose_forces_inside_pass_1e_8(off, fine):
    class Inexact:
        def __init__(self, A):
            self.factor = superlu(A)

        def solve(self, b):
            return (1 + off) * self.factor.solve(b)

    refused = contextlib.nullcontext() if fine else pytest.raises(ReductionError, match=r"1\.1e-08")
    with refused:
        fixed_interface(*structure(), W, [10, 11], Inexact)


@pytest.mark.parametrize(
    ("boundary", "fine"), [([0, 11], True), ([-1, 11], False), ([0, 12], False)]
)
def test_a_boundary_holds_the_first_unknown_to_the_last(boundary, fine):
    w = np.eye(N)[11]
    refused = pytest.raises(ReductionError, match="indices from 0 to 11")
    with contextlib.nullcontext() if fine else refused:
        assert craig_bampton(*structure(), w, boundary, Selection(n_modes=1)).n_boundary == 2


@pytest.mark.parametrize("ground", [3e-13, 1e-6])
def test_what_stands_on_springs_at_rounding_has_no_modes_of_the_contact(ground):
    """With the boundary held it is sound, and its condensed stiffness just positive."""
    K, M = structure(held=False)
    K[0, 0] += ground * 3e3
    fixed = fixed_interface(K, M, W, [10, 11], superlu)
    refused = pytest.raises(ReductionError, match="on springs as soft as that")
    with contextlib.nullcontext() if ground > 1e-9 else refused:
        assert whole_pencil(fixed).sigma == 0


def test_the_factor_inside_serves_the_whole():
    K, M = structure()
    fixed = fixed_interface(K, M, W, np.array([11, 10]), superlu)
    K_ii, K_ib = K.toarray()[:10, :10], K.toarray()[:10][:, [11, 10]]
    np.testing.assert_allclose(fixed.psi[:10], -np.linalg.solve(K_ii, K_ib), atol=1e-12)
    np.testing.assert_array_equal(fixed.psi[10:], [[0, 1], [1, 0]])
    schur = np.linalg.inv(np.linalg.inv(K.toarray())[np.ix_([11, 10], [11, 10])])
    np.testing.assert_allclose(fixed.condensed, schur, rtol=1e-9)
    problem = whole_pencil(fixed)
    np.testing.assert_allclose(problem.factor.solve(W), np.linalg.solve(K.toarray(), W), rtol=1e-9)
    block = np.random.default_rng(0).standard_normal((N, 3))
    np.testing.assert_allclose(K @ problem.factor.solve(block), block, atol=1e-10)


def test_a_held_structure_is_reduced_without_a_copy_of_its_stiffness():
    """With the factor of K nothing of its size is needed; K_ii and M_ii were once copied."""
    n, width = 3000, 150
    A = sp.diags_array(
        [np.full(n, 0.9**k) for k in range(width)], offsets=range(width), shape=(n, n)
    )
    K, M = sp.csc_array(A + A.T), sp.eye_array(n).tocsc()
    w = np.zeros(n)
    w[:4] = 0.25
    selection, factor = Selection(n_modes=8, choice="contact", to_hz=0.03), superlu(K)
    tracemalloc.start()
    craig_bampton(K, M, w, np.arange(4), selection, factor=factor)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 0.8 * (K.data.nbytes + K.indices.nbytes)


def test_a_boundary_may_be_a_mask():
    K, M = structure()
    mask = np.arange(N) >= 10
    one = craig_bampton(K, M, W, mask, Selection(n_modes=3))
    two = craig_bampton(K, M, W, [10, 11], Selection(n_modes=3))
    np.testing.assert_array_equal(one.K, two.K)


# --- health --------------------------------------------------------------------------------------


def test_health_of_a_model_is_in_its_own_numbers():
    K, M = structure(held=False)
    result = health(full_order(K, M, W))
    assert (result.n_rigid, result.findings, result.asymmetry) == (1, (), 0.0)
    d = np.sqrt(K.diagonal())
    ends = np.linalg.eigvalsh(K.toarray() / np.outer(d, d))[[0, -1]]
    assert result.lowest_mass == pytest.approx(1.0)
    assert result.lowest_stiffness == pytest.approx(ends[0] / ends[1], abs=1e-14)
    omega, phi = exact_modes(K, M)
    exact = np.sum((W @ phi[:, 1:] / omega[1:]) ** 2)
    assert result.static_compliance == pytest.approx(exact, rel=1e-9)
    still = full_order(sp.block_diag([K, K]), sp.block_diag([M, M]), np.append(W, 0 * W))
    assert health(still).participation == 0.5
    for by, findings in ((0.9e-9, 0), (1.1e-9, 1)):
        skew = full_order(K, M, W)._replace(K=K.toarray() + by * abs(K).max() * np.eye(N, k=1))
        assert abs(health(skew).asymmetry / by - 1) < 1e-6
        sentences = health(skew).findings
        assert len(sentences) == findings and all("not symmetric" in one for one in sentences)


def test_damping_is_indefinite_below_rounding_of_zero():
    D = np.diag([4.0, 1.0, 0.0])
    assert not is_indefinite(D) and not is_indefinite(np.zeros((3, 3)))
    assert not is_indefinite(D - 3.9e-9 * np.eye(3)) and is_indefinite(D - 4.1e-9 * np.eye(3))


def test_frequencies_of_a_held_boundary_are_those_of_what_is_left():
    K, M = structure()
    reduced = craig_bampton(K, M, W, [10, 11], Selection(n_modes=4))
    exact = exact_modes(K[:10][:, :10], M[:10][:, :10])[0][:4] / (2 * np.pi)
    np.testing.assert_allclose(fixed_interface_hz(reduced), exact, rtol=1e-9)
    assert fixed_interface_hz(reduced._replace(n_boundary=6)) == ()


def test_a_part_that_floats_with_its_boundary_held_has_frequencies_of_zero():
    """Whatever rounding makes of it, and beside slow ones."""
    K = np.diag([1.0, -1e-12, (2 * np.pi * 0.01) ** 2])
    held = full_order(np.eye(3), np.eye(3), [1.0, 0, 0])._replace(K=K, n_boundary=1)
    np.testing.assert_allclose(fixed_interface_hz(held), [0.0, 0.01], rtol=1e-12)


def test_a_wall_that_the_contact_does_not_move_takes_part_with_no_mode():
    K, M = structure()
    assert health(full_order(K, M, W)._replace(w=0 * W)).participation == 0.0


def test_effective_masses_are_squared_momenta_and_sum_to_the_mass():
    K, M = structure()
    e = np.linspace(1, 2, N)
    reduced = full_order(K, M, W)
    result = effective_mass(reduced, M, e)
    omega, phi = exact_modes(K, M)
    np.testing.assert_allclose(result.mass, (phi.T @ (M @ e)) ** 2, rtol=1e-8)
    np.testing.assert_allclose(result.omega, omega, rtol=1e-9)
    assert result.captured == pytest.approx(1.0)
    small = effective_mass(free_modes(K, M, W, Selection(n_modes=3)), M, e)
    assert small.captured == pytest.approx(small.mass.sum() / (e @ (M @ e)))


def test_a_reduction_keeps_its_static_check_and_its_modes():
    """K_r = T^T K T with a diagonal of squares; the residual vector is orthogonal to the modes."""
    K, M = structure()
    reduced = free_modes(K, M, W, Selection(n_modes=4))
    T = reduced.T
    np.testing.assert_allclose(T.T @ (K @ T), reduced.K, atol=1e-8 * K.max())
    np.testing.assert_allclose(T.T @ (M @ T), np.eye(5), atol=1e-10)
    assert reduced.n_residual == 1 and (reduced.n_boundary, reduced.error) == (0, None)
    np.testing.assert_allclose(modal(reduced).omega[:4], exact_modes(K, M)[0][:4], rtol=1e-9)
