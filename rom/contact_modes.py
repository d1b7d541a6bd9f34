"""The modes that a force at the contact moves, without the others: Ritz pairs of a Krylov space.

    v_1 ~ K^-1 w,   v_{j+1} ~ K^-1 M v_j,   V^T K V = 1,   V^T M V = H tridiagonal

Of all spaces of k vectors this one has most of the receptance's moments at the contact right, 2 k
of them. A mode that the contact does not move never enters; one that it moves comes out to
rounding once k is large enough.

Random loads in addition to w make it a block space, which holds the modes that the contact does not
move as well: one run then gives the lowest modes, the static response and the modes of the contact.
With the block V_j in place of v_j, R the part of K^-1 M V_j that no vector so far has, and
(1 + i eta - s^2 H) y = V^T w, a model of this space misses

    |H(s) - H_k(s)| <= (s^2 |R y_j|)^2 / eta,    y_j the rows of y for the last block,

at any frequency, since the forces left over are s^2 K V_{j+1} R y_j and no mode with the loss
factor eta amplifies its own by more than 1 / eta. A Ritz pair (theta, V s) of H, theta =
1 / omega^2, misses K^-1 M phi = theta phi by |R s_j| in the K-norm.
Wilson, Yuan and Dickens, Earthquake Eng. Struct. Dyn. 10 (1982) 813; Bai, Appl. Numer. Math. 43
(2002) 9; Grimes, Lewis and Simon, SIAM J. Matrix Anal. Appl. 15 (1994) 228.
"""

from functools import partial
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.linalg import solve_triangular
from scipy.optimize import linear_sum_assignment

from beadwave.rom.contact_space import KrylovOptions, Space, converged
from beadwave.rom.factorisation import Pencil, ReductionError
from beadwave.rom.lanczos import EigenPairs, Enough, with_columns
from beadwave.rom.residual_vector import attachment_modes
from beadwave.rom.selection import Selection
from beadwave.rom.tall import ROWS, gram, shares, squares, turned
from beadwave.rom.truncation import LOSS, frequencies, receptances, rms, size


class FinerModes(NamedTuple):
    """Modes omega (j,) [rad/s] of the shapes phi (n, k) @ amplitudes (k, j), or of phi itself where
    that is None; mass-normalised, in any order."""

    omega: np.ndarray
    phi: np.ndarray
    amplitudes: np.ndarray | None = None


class ChosenModes(NamedTuple):
    """Modes chosen by the contact, and what is known of those that were not."""

    pairs: EigenPairs  # omega (k,) [rad/s] ascending, phi (n, k) mass-normalised
    residual: np.ndarray  # (n,) [m/N] static response to a unit contact force beyond these modes
    error: float  # relative rms of the receptance up to to_hz that modes and residual leave
    finer: FinerModes  # what they were chosen from; with finer_hz it stands for the full model


def contact_modes(
    problem: Pencil,
    w: np.ndarray,
    retained: EigenPairs,
    selection: Selection,
    options: KrylovOptions = KrylovOptions(),
) -> ChosenModes:
    """The n_modes that matter most for the receptance at the contact up to to_hz, or the fewest
    that with a residual vector keep it to the relative rms error selected.

    w (n,) is the contact functional; retained are modes to keep in any case, the rigid-body ones
    among them, mass-normalised. The error stated holds for the modes with the residual vector: the
    space's bound and what the choice leaves. With finer_hz all that they are chosen from stands for
    the full model up to that frequency.
    Raises ReductionError where n_modes are fewer than those retained, and where the Krylov space
    does not become accurate enough.
    """
    n_modes, error, to_hz = selection.n_modes, selection.error, selection.to_hz
    space, n_retained = selection.space, len(retained.omega)

    # candidates: Ritz pairs of a space of one vector more than modes are wanted, so that one at
    # least is left to make the residual vector of. Of a wanted error the space takes a share, the
    # choice among its pairs the rest
    n_vectors = 0 if n_modes is None else n_modes + 1 - n_retained
    if selection.finer_hz is None:
        bound, reach_hz = options.converged if error is None else options.share * error, to_hz
    else:
        bound, reach_hz = options.exact, max(to_hz, selection.finer_hz)
        n_vectors += options.extra
    if space is not None and space.bound <= bound and space.to_hz >= reach_hz:
        pairs, bound = space.pairs, space.bound
        # which of the pairs the retained modes are, one to one, by their products in M: of twins
        # the largest product alone could name one pair for both
        overlap = np.abs((problem.M @ retained.phi).T @ pairs.phi)
        retained_at = linear_sum_assignment(overlap, maximize=True)[1]
        finer = condensed(pairs, w, reach_hz, options.exact)
    else:
        pairs, bound, *_ = krylov_space(
            problem, w, retained, bound, reach_hz, n_vectors, options=options
        )
        retained_at, finer = np.arange(n_retained), FinerModes(*pairs)
    participation = pairs.phi.T @ w

    # the choice: the retained ones, then the others by their weight; n is where the error is met
    order = _ranked(pairs.omega, participation, retained_at, to_hz)
    errors = bound + _residual_errors(pairs.omega[order], participation[order], to_hz)
    # the last error is the bound alone, below the one that is wanted: argmax finds a True
    if error is not None:
        n_modes = max(int(np.argmax(errors <= error)), n_retained)
    n = min(n_modes, len(order))
    if n < n_retained:
        raise ReductionError(f"{n} modes cannot hold the {n_retained} to be kept; ask for more.")
    chosen = order[:n][np.argsort(pairs.omega[order[:n]])]

    # residual vector as the sum of the modes left out: the static response less the modes kept
    # would lose digits
    weights = np.zeros(len(order))
    weights[order[n:]] = participation[order[n:]] / pairs.omega[order[n:]] ** 2
    residual = pairs.phi @ weights
    modes = EigenPairs(pairs.omega[chosen], pairs.phi[:, chosen])
    return ChosenModes(modes, residual, float(errors[n]), finer)


def condensed(pairs: EigenPairs, w: np.ndarray, to_hz: float, error: float) -> FinerModes:
    """The fewest pairs of a space, and one for all others, that answer at the contact like all of
    them to the relative rms error up to to_hz [Hz].

    w (n,) is the contact functional. The others' share of the static response,
    r = sum phi_j (phi_j^T w) / omega_j^2, is orthogonal to the rest in K and M and becomes the last
    pair with omega^2 = r^T K r / r^T M r. A space made for the modes of the whole structure has
    three times as many pairs as its contact needs.
    """
    omega, phi = pairs.omega, pairs.phi.T @ w
    order = _ranked(omega, phi, np.empty(0, np.int64), to_hz)
    n = int(np.argmax(_residual_errors(omega[order], phi[order], to_hz) <= error))
    minor = order[n:]
    if not len(minor):
        return FinerModes(*pairs)

    # r by its amplitudes on mass-normalised pairs, so that r^T M r and r^T K r are sums of squares
    amplitude = phi[minor] / omega[minor] ** 2
    mass, stiffness = np.sum(amplitude**2), np.sum((amplitude * omega[minor]) ** 2)
    # their shapes would be a second matrix of the size of the pairs'
    amplitudes = np.zeros((len(omega), n + 1))
    amplitudes[order[:n], np.arange(n)] = 1.0
    amplitudes[minor, n] = amplitude / np.sqrt(mass)
    omega = np.append(omega[order[:n]], np.sqrt(stiffness / mass))
    return FinerModes(omega, pairs.phi, amplitudes)


def static_shapes(
    omega: np.ndarray, highest: float, to_hz: float, options: KrylovOptions = KrylovOptions()
) -> int:
    """Number of the modes omega (k,) [rad/s] that are static shapes, which follow the force without
    inertia: those above `highest` [rad/s], the highest mode that was chosen, or far above to_hz
    [Hz]. At least one, the shape that stands for all modes left out."""
    limit = min(highest, options.reach * 2 * np.pi * to_hz)
    return max(1, int(np.count_nonzero(omega > (1 + 1e-9) * limit)))


def finer_space(
    problem: Pencil,
    w: np.ndarray,
    retained: EigenPairs,
    to_hz: float,
    n_vectors: int = 0,
    options: KrylovOptions = KrylovOptions(),
) -> Space:
    """A space that stands for the full model at the contact w (n,) up to to_hz [Hz], with a
    reduced model of n_vectors coordinates: it has more vectors than that, or it could not judge it.

    retained are the modes to begin with. Raises ReductionError where the space cannot be made so
    accurate.
    """
    n_vectors += options.extra
    return krylov_space(problem, w, retained, options.exact, to_hz, n_vectors, options=options)


def krylov_space(
    problem: Pencil,
    w: np.ndarray,
    retained: EigenPairs,
    error: float,
    to_hz: float,
    n_vectors: int = 0,
    enough: Enough | None = None,
    options: KrylovOptions = KrylovOptions(),
) -> Space:
    """Ritz pairs of n_vectors, or of more until their bound up to to_hz [Hz] is below error.

    w (n,) is the contact functional, or those of p contacts (n, p), of which each is within the
    bound, and the receptance between any two by the product of theirs; error relative, rms. The
    first pairs are the retained ones; the others are orthogonal to them in M. With enough(omega,
    shapes), which is asked about the lowest modes that have converged, the space holds modes that
    the contact does not move as well, and grows until it is True. Of a floating structure the
    retained modes must hold the rigid-body ones, as exact zeros of omega. Raises ReductionError
    where `largest` vectors do not do.
    """
    K, M = problem.K, problem.M
    s = 2 * np.pi * frequencies(to_hz)
    loads = w.reshape(len(w), -1)
    p = loads.shape[1]
    if enough is not None:
        random = np.random.default_rng(0).standard_normal((len(w), options.random))
        loads = np.column_stack([w, M @ random])

    # what K^-1 w (inertia relief where the structure floats) has beyond the retained modes, whose
    # share leaves the loads and, for rounding, the result: on soft cords K^-1 w is a million times
    # as large as the rest, and no digit of that would be left
    elastic, rigid = retained.omega > 0, retained.phi[:, retained.omega == 0]
    participation = retained.phi.T @ loads
    static = attachment_modes(problem, loads - M @ (retained.phi @ participation), rigid)
    static -= retained.phi @ (retained.phi.T @ (M @ static))
    energy = np.sum((participation[elastic] / retained.omega[elastic, None]) ** 2, axis=0)
    compliance = np.sqrt(energy + np.maximum(np.einsum("ij,ij->j", static, K @ static), 0.0))
    block, R = k_orthonormalised(static, static.T @ (K @ static), K, 1e-12 * compliance)
    participation = participation[:, :p]
    if not block.shape[1]:
        return Space(retained, 0.0, to_hz, np.zeros(len(retained.omega)))

    V, H = np.empty((len(w), 2 * options.check), order="F"), np.zeros((0, 0))
    load = R[:, :p]  # V^T w: the first columns of the loads are w, and V^T w = V^T K K^-1 w
    while True:
        # X = K^-1 M V_j beyond the retained modes and the vectors so far. In exact arithmetic the
        # last two blocks would do; all of them, twice, keep V K-orthonormal to rounding
        V, m = with_columns(V, len(H), block), len(H) + block.shape[1]
        last = slice(len(H), m)
        inertia = M @ block
        X = attachment_modes(problem, np.asfortranarray(inertia), rigid)
        forces = inertia  # K X by definition; computed after a projection
        if len(retained.omega):
            X -= retained.phi @ (retained.phi.T @ (M @ X))
            forces = K @ X
        # lengths in K, zero where rounding makes the square negative
        lengths = np.sqrt(np.maximum(np.einsum("ij,ij->j", X, forces), 0.0))
        first = V[:, :m].T @ forces
        X -= V[:, :m] @ first
        forces = K @ X
        second = V[:, :m].T @ forces
        gram_X = X.T @ forces - second.T @ second  # X^T K X after the second projection
        X -= V[:, :m] @ second
        projection = first + second
        H = np.pad(H, (0, block.shape[1]))
        H[:, last], H[last, :] = projection, projection.T

        # K^-1 M V_j = [V_1 .. V_j] H_j + V_{j+1} R: R is what the bound needs of the next block
        block, R = k_orthonormalised(X, gram_X, K, options.exhausted * lengths)
        exhausted = block.shape[1] == 0  # the space holds all that these loads can move
        # the bound is looked at every `check` vectors or so
        if not exhausted and (m < n_vectors or m % options.check >= len(R)):
            continue

        # the bound, and where modes are wanted those that have converged
        load = np.pad(load, ((0, m - len(load)), (0, 0)))
        theta, S = np.linalg.eigh((H + H.T) / 2)
        theta, S = theta[::-1], S[:, ::-1]
        bound = _bound(theta, S, R, load, s, retained.omega, participation)
        is_enough = bound <= error
        if is_enough and enough is not None:
            n = converged(np.linalg.norm(R @ S[last], axis=0) / theta, options.mode)
            is_enough = enough(theta[:n] ** -0.5, partial(_shapes, V[:, :m], S[:, :n], theta[:n]))
        if is_enough or exhausted:
            break
        if m >= max(options.largest, n_vectors):
            raise ReductionError(
                f"{m} vectors leave an error of up to {bound:.1e} up to {to_hz:g} Hz, asked "
                f"was {error:.1e}; ask for a larger error or a lower frequency."
            )

    # Ritz pairs by V^T M V anew, not by H: what the recurrence says holds the errors of the solver.
    # V^T K V = 1, so that an eigenvalue of V^T M V is 1 / omega^2 and the lowest modes have the
    # largest: they come out to rounding
    V = V[:, :m]
    inverse_squared, U = np.linalg.eigh(gram(V, M))
    omega = np.append(retained.omega, 1 / np.sqrt(inverse_squared))
    residual = np.linalg.norm(R @ U[last], axis=0) / inverse_squared
    residual = np.append(np.zeros(len(retained.omega)), residual)
    phi = turned(V, U)
    if len(retained.omega):
        phi = np.column_stack([retained.phi, phi])

    # without what rounding leaves between them in M: Cholesky from the lowest on, which stay as
    # they are, the others give way
    order = np.argsort(omega)
    back = np.argsort(order)
    L = np.linalg.cholesky(gram(phi, M)[order][:, order])
    for rows in shares(len(phi), ROWS):
        phi[rows] = solve_triangular(L, phi[rows][:, order].T, lower=True).T[:, back]
    quotients = np.sqrt(np.maximum(squares(phi, K), 0))
    return Space(EigenPairs(np.where(omega == 0, 0, quotients), phi), float(bound), to_hz, residual)


def k_orthonormalised(
    X: np.ndarray, G: np.ndarray, K: sp.csc_array, smallest: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Q (n, j) with Q^T K Q = 1 and R (j, l) with X = Q R, j the rank of X (n, l); G = X^T K X.

    Columns no longer than `smallest` (l,) in K are rounding and count as zero. By the eigenvectors
    of the Gram matrix with a unit diagonal, G = U diag(size) U^T, which shows the rank where
    Cholesky would fail; columns of very different length then cost no digits.
    """
    R = np.eye(X.shape[1])
    for again in (False, True):  # the first time leaves rounding over the smallest eigenvalue
        if again:
            G, smallest = X.T @ (K @ X), np.zeros(X.shape[1])
        lengths = np.sqrt(np.maximum(np.diag(G), 0.0))
        scale = np.where(lengths > smallest, lengths, np.inf)
        size, U = np.linalg.eigh(G / np.outer(scale, scale))
        size, U = size[size > 1e-12], U[:, size > 1e-12]
        X = X @ (U / scale[:, None] / np.sqrt(size))
        R = (np.sqrt(size)[:, None] * U.T * np.where(np.isinf(scale), 0.0, scale)) @ R
    return X, R


def _shapes(V: np.ndarray, S: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """Mass-normalised shapes (n, k) of Ritz pairs: V^T K V = 1 and V^T M V = H, so that V s has the
    modal mass theta."""
    return V @ (S / np.sqrt(theta))


def _bound(
    theta: np.ndarray,
    S: np.ndarray,
    R: np.ndarray,
    load: np.ndarray,
    s: np.ndarray,
    omega: np.ndarray,
    participation: np.ndarray,
) -> float:
    """Bound of the relative rms error of a space's receptances at s [rad/s], as the module says:
    the largest of p contacts.

    theta (m,) and S (m, m) are the eigenpairs of H, load (m, p) = V^T w, R (l, j) what leaves the
    last block; omega (k,) and participation (k, p) are those of the retained modes.
    """
    leaves = (R @ S[len(S) - R.shape[1] :]).T
    bounds = []
    for weights, phi in zip((S.T @ load).T, participation.T, strict=True):
        dynamic = weights / (1 + 1j * LOSS - s[:, None] ** 2 * theta)
        receptance = dynamic @ weights + receptances(omega, phi, s).sum(axis=1)
        leaving = np.linalg.norm(dynamic @ leaves, axis=1)
        bounds.append(rms((s**2 * leaving) ** 2) / LOSS / size(receptance))
    return max(bounds)


def _ranked(omega: np.ndarray, phi: np.ndarray, kept: np.ndarray, to_hz: float) -> np.ndarray:
    """Indices (k,) of the modes omega (k,) [rad/s], phi (k,) [kg^-1/2]: those kept, then the others
    by what is lost of the receptance where a mode is left out, the largest first.

    A residual vector gives back the first two terms of phi^2 / (omega^2 - s^2) in powers of s^2;
    (s / omega)^4 phi^2 / (omega^2 - s^2) is lost.
    """
    s, others = 2 * np.pi * frequencies(to_hz)[:, None], np.setdiff1d(np.arange(len(omega)), kept)
    squared = omega[others] ** 2
    missed = phi[others] ** 2 * (s / omega[others]) ** 4 / (squared * (1 + 1j * LOSS) - s**2)
    return np.append(kept, others[np.argsort(-np.linalg.norm(missed, axis=0))])


def _residual_errors(omega: np.ndarray, phi: np.ndarray, to_hz: float) -> np.ndarray:
    """Relative rms errors (k + 1,) of the receptance up to to_hz [Hz] after the first 0, 1, .. k
    modes omega (k,) [rad/s], phi (k,) [kg^-1/2], with one oscillator for the rest.

    The residual vector makes an oscillator of modes with m_1 = sum phi_j^2 / omega_j^2 and
    m_2 = sum phi_j^2 / omega_j^4: omega^2 = m_1 / m_2, phi^2 = m_1^2 / m_2.
    """
    s = 2 * np.pi * frequencies(to_hz)
    rests = _sums_from_the_end(receptances(omega, phi, s))
    elastic = np.where(omega > 0, omega, np.inf)
    first, second = (_sums_from_the_end(phi**2 / elastic**i) for i in (2, 4))
    errors = []
    for m1, m2, rest in zip(first, second, rests.T, strict=True):
        # nothing elastic is left where m_1 = 0: rigid-body modes have no static response
        lumped = np.zeros(len(s))
        if m1:
            lumped = receptances(np.sqrt([m1 / m2]), np.array([m1 / np.sqrt(m2)]), s)[:, 0]
        errors.append(rms(lumped - rest))
    return np.array(errors) / size(rests[:, 0])


def _sums_from_the_end(values: np.ndarray) -> np.ndarray:
    """Sums of all, all but the first, ... none, along the last axis (.., k + 1)."""
    sums = np.cumsum(values[..., ::-1], axis=-1)[..., ::-1]
    return np.concatenate([sums, np.zeros((*values.shape[:-1], 1))], axis=-1)
