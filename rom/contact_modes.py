"""The modes that a force at the contact moves, without the others: Ritz pairs of a Krylov space.

    v_1 ~ K^-1 w,   v_{j+1} ~ K^-1 M v_j,   V^T K V = 1,   V^T M V = H tridiagonal

Of all spaces of k vectors this one has most of the receptance's moments at the contact right, 2 k
of them. A mode that the contact does not move never enters; one that it moves comes out to
rounding once k is large enough. With beta the K-norm of the next vector before it is normalised
and (1 + i eta - s^2 H) y = e_1 |K^-1 w|_K, a model of this space misses

    |H(s) - H_k(s)| <= (s^2 beta |y_k|)^2 / eta

at any frequency, since the forces left over are s^2 beta y_k K v_{k+1} and no mode with the loss
factor eta amplifies its own by more than 1 / eta.
Wilson, Yuan and Dickens, Earthquake Eng. Struct. Dyn. 10 (1982) 813; Bai, Appl. Numer. Math. 43
(2002) 9.
"""

from itertools import count
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular

from rom.factorisation import Pencil, ReductionError
from rom.lanczos import EigenPairs, with_columns
from rom.residual_vector import attachment_modes
from rom.selection import Selection
from rom.tall import ROWS, gram, shares, squares, turned
from rom.truncation import LOSS, frequencies, receptances, rms, size


class KrylovOptions(NamedTuple):
    """How large a Krylov space at a contact becomes, and which of its Ritz pairs are static."""

    converged: float = 5e-3  # bound of the space's own error where a number of modes is wanted
    share: float = 0.3  # of a wanted error, for the space; the choice among its modes has the rest
    exact: float = 1e-8  # bound where it stands for the full model: far below any stated error
    extra: int = 20  # vectors of a space for the full model more than the reduced model has modes
    check: int = 5  # vectors between two looks at the bound, each an eigenproblem of H
    largest: int = 1000  # vectors: of a solid far more than any chain notices
    exhausted: float = 1e-10  # of a vector, what is new in it where the space holds all that moves
    # times to_hz: vectors that resonate above it serve as static shapes, as they would cost steps
    reach: float = 2.5


class Space(NamedTuple):
    """Ritz pairs that hold the static response between them, and a bound of the relative rms error
    of the receptance that a model of all of them has."""

    pairs: EigenPairs
    bound: float


class Chosen(NamedTuple):
    """Modes, the static response (n,) to the contact force beyond them, the relative rms error of
    the receptance that both leave, and all Ritz pairs that the modes were chosen from."""

    pairs: EigenPairs
    residual: np.ndarray
    error: float
    space: EigenPairs


def contact_modes(
    problem: Pencil,
    w: np.ndarray,
    retained: EigenPairs,
    selection: Selection,
    options: KrylovOptions = KrylovOptions(),
) -> Chosen:
    """The n_modes that matter most for the receptance at the contact up to to_hz, or the fewest
    that with a residual vector keep it to the relative rms error selected.

    retained (k,) are modes to keep in any case, the rigid-body ones among them. The error stated
    holds for the modes with the residual vector: the space's bound and what the choice leaves.
    With finer_hz all that they are chosen from stands for the full model up to that frequency.
    Raises ReductionError.
    """
    n_modes, error, to_hz = selection.n_modes, selection.error, selection.to_hz
    n_retained = len(retained.omega)

    # candidates: Ritz pairs of a space of one vector more than modes are wanted
    n_vectors = 0 if n_modes is None else n_modes + 1 - n_retained
    if selection.finer_hz is None:
        bound = options.converged if error is None else options.share * error
        pairs, bound = krylov_space(problem, w, retained, bound, to_hz, n_vectors, options)
    else:
        finer_hz = max(to_hz, selection.finer_hz)
        pairs, bound = finer_space(problem, w, retained, finer_hz, n_vectors, options)
    phi = pairs.phi.T @ w

    # the choice: the retained ones, then the others by their weight; n is where the error is met
    order = _ranked(pairs.omega, phi, n_retained, to_hz)
    errors = bound + _residual_errors(pairs.omega[order], phi[order], to_hz)
    if error is not None:
        n_modes = max(int(np.argmax(errors <= error)), n_retained)
    n = min(n_modes, len(order))
    if n < n_retained:
        raise ReductionError(f"{n} modes cannot hold the {n_retained} to be kept; ask for more.")
    chosen = order[:n][np.argsort(pairs.omega[order[:n]])]

    # residual vector as the sum of the modes left out: the static response less the modes kept
    # would lose digits
    weights = np.zeros(len(order))
    weights[order[n:]] = phi[order[n:]] / pairs.omega[order[n:]] ** 2
    residual = pairs.phi @ weights
    modes = EigenPairs(pairs.omega[chosen], pairs.phi[:, chosen])
    return Chosen(modes, residual, float(errors[n]), pairs)


def static_shapes(
    omega: np.ndarray, highest: float, to_hz: float, options: KrylovOptions = KrylovOptions()
) -> int:
    """How many modes omega (k,) [rad/s] move with the force, being above the highest one that was
    chosen or far above to_hz; one or more, what stands for the rest."""
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
    """A space that stands for the full model at the contact up to to_hz, beside a reduced model of
    n_vectors."""
    n_vectors += options.extra
    return krylov_space(problem, w, retained, options.exact, to_hz, n_vectors, options)


def krylov_space(
    problem: Pencil,
    w: np.ndarray,
    retained: EigenPairs,
    error: float,
    to_hz: float,
    n_vectors: int = 0,
    options: KrylovOptions = KrylovOptions(),
) -> Space:
    """Ritz pairs of n_vectors, or of more until their bound up to to_hz is below error.

    The first pairs are the retained ones; the others are orthogonal to them. Raises ReductionError
    where `largest` vectors do not meet the error.
    """
    K, M = problem.K, problem.M
    s = 2 * np.pi * frequencies(to_hz)

    # K^-1 w (inertia relief where the structure floats), and what it has beyond the retained modes
    participation = retained.phi.T @ w
    elastic, rigid = retained.omega > 0, retained.phi[:, retained.omega == 0]
    static = attachment_modes(problem, w, rigid)
    rest = static - retained.phi[:, elastic] @ (
        participation[elastic] / retained.omega[elastic] ** 2
    )
    norm = _k_norm(rest, K @ rest)
    if norm <= 1e-12 * _k_norm(static, K @ static):
        return Space(retained, 0.0)

    V, H, v = np.empty((len(w), 2 * options.check), order="F"), np.zeros((0, 0)), rest / norm
    for k in count():
        # x = K^-1 M v_k beyond the retained modes and the vectors so far. In exact arithmetic the
        # last two would do; all of them, twice, keep V K-orthonormal to rounding
        V = with_columns(V, k, v[:, None])
        x = attachment_modes(problem, M @ v, rigid)
        if len(retained.omega):
            x -= retained.phi @ (retained.phi.T @ (M @ x))
        force = K @ x
        length, column = _k_norm(x, force), 0.0
        for _ in range(2):
            h = V[:, : k + 1].T @ force
            x -= V[:, : k + 1] @ h
            force = K @ x
            column = column + h
        H = np.pad(H, (0, 1))
        H[-1], H[:, -1] = column, column
        beta = _k_norm(x, force)
        if beta <= options.exhausted * length:
            beta = 0.0  # the space holds all that the force can move
        else:
            v = x / beta
        if beta and (len(H) % options.check or len(H) < n_vectors):
            continue

        bound = _bound(H, beta, norm, s, retained.omega, participation)
        if bound <= error or beta == 0:
            break
        if len(H) >= max(options.largest, n_vectors):
            raise ReductionError(
                f"{len(H)} vectors leave an error of up to {bound:.1e} up to {to_hz:g} Hz, asked "
                f"was {error:.1e}; ask for a larger error or a lower frequency."
            )

    # Ritz pairs by V^T M V anew, not by H: what the recurrence says holds the errors of the solver
    V = V[:, : len(H)]
    inverse_squared, U = np.linalg.eigh(gram(V, M))
    omega = np.append(retained.omega, 1 / np.sqrt(inverse_squared))
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
    return Space(EigenPairs(np.where(omega == 0, 0, quotients), phi), float(bound))


def _k_norm(x: np.ndarray, force: np.ndarray) -> float:
    """|x|_K = sqrt(x^T K x) from force = K x; 0 where rounding makes that negative."""
    return float(np.sqrt(max(x @ force, 0.0)))


def _bound(
    H: np.ndarray,
    beta: float,
    norm: float,
    s: np.ndarray,
    omega: np.ndarray,
    participation: np.ndarray,
) -> float:
    """Bound of the relative rms error of a space's receptance at s [rad/s], as the module says;
    norm is |K^-1 w|_K beyond the retained modes, omega and participation are theirs."""
    theta, U = np.linalg.eigh((H + H.T) / 2)
    dynamic = 1 / (1 + 1j * LOSS - s[:, None] ** 2 * theta)
    receptance = norm**2 * dynamic @ U[0] ** 2
    receptance = receptance + receptances(omega, participation, s).sum(axis=1)
    last = norm * dynamic @ (U[0] * U[-1])
    return rms((s**2 * beta * np.abs(last)) ** 2) / LOSS / size(receptance)


def _ranked(omega: np.ndarray, phi: np.ndarray, n_retained: int, to_hz: float) -> np.ndarray:
    """Indices (k,) of the modes: the retained ones, then the others by what an oscillator with
    their first two moments misses of their receptance, the largest first."""
    s = 2 * np.pi * frequencies(to_hz)[:, None]
    others, squared = omega[n_retained:], omega[n_retained:] ** 2
    missed = phi[n_retained:] ** 2 * (s / others) ** 4 / (squared * (1 + 1j * LOSS) - s**2)
    order = np.argsort(-np.linalg.norm(missed, axis=0))
    return np.append(np.arange(n_retained), n_retained + order)


def _residual_errors(omega: np.ndarray, phi: np.ndarray, to_hz: float) -> np.ndarray:
    """Relative rms errors (k + 1,) after the first 0, 1, .. k modes, one oscillator for the rest.

    The residual vector makes an oscillator of modes with m_1 = sum phi_j^2 / omega_j^2 and
    m_2 = sum phi_j^2 / omega_j^4: omega^2 = m_1 / m_2, phi^2 = m_1^2 / m_2.
    """
    s = 2 * np.pi * frequencies(to_hz)
    rests = _sums_from_the_end(receptances(omega, phi, s))
    elastic = np.where(omega > 0, omega, np.inf)
    first, second = (_sums_from_the_end(phi**2 / elastic**i) for i in (2, 4))
    errors = []
    for m1, m2, rest in zip(first, second, rests.T, strict=True):
        lumped = np.zeros(len(s))
        if m1:
            lumped = receptances(np.sqrt([m1 / m2]), np.array([m1 / np.sqrt(m2)]), s)[:, 0]
        errors.append(rms(lumped - rest))
    return np.array(errors) / size(rests[:, 0])


def _sums_from_the_end(values: np.ndarray) -> np.ndarray:
    """Sums of all, all but the first, ... none, along the last axis (.., k + 1)."""
    sums = np.cumsum(values[..., ::-1], axis=-1)[..., ::-1]
    return np.concatenate([sums, np.zeros((*values.shape[:-1], 1))], axis=-1)
