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

from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular

from rom.factorisation import Pencil, ReductionError, static_response
from rom.lanczos import EigenPairs, with_columns
from rom.selection import Selection
from rom.tall import ROWS, gram, shares, squares, turned
from rom.truncation import LOSS, frequencies, receptances, rms, size

CONVERGED = 5e-3  # bound of the space's own error where a number of modes is asked for
EXACT = 1e-8  # the same of a space that stands for the full model, far below any error stated by it
BEYOND = 20  # vectors of such a space more than modes are kept
CHECK = 5  # vectors between two looks at the bound
LARGEST = 1000  # vectors: of a solid far more than any chain notices
EXHAUSTED = 1e-10  # of a vector, what the space leaves of it where it holds all that can move
REACH = 2.5  # times to_hz: what resonates beyond is a static shape there, and would cost steps


class Space(NamedTuple):
    """Ritz pairs that hold the static response between them, and a bound of the relative rms error
    of the receptance that a model of all of them has."""

    pairs: EigenPairs
    bound: float


class Chosen(NamedTuple):
    """Modes, the static response (n,) to the contact force beyond them, the error left, and all
    that the modes were chosen from."""

    pairs: EigenPairs
    residual: np.ndarray
    error: float
    space: EigenPairs


def contact_modes(problem: Pencil, w: np.ndarray, known: EigenPairs, asked: Selection) -> Chosen:
    """The asked number of modes that matter most for the receptance at the contact up to to_hz, or
    the fewest that with a residual vector keep it to the asked relative rms error.

    known (k,) are modes to keep in any case, the rigid-body ones among them. The error stated
    holds for the modes with the residual vector: the space's bound and what the choice leaves.
    With finer_hz all that they are chosen from stands for the full model up to that frequency.
    Raises ReductionError.
    """
    n_modes, error, to_hz = asked.n_modes, asked.error, asked.to_hz
    bound = CONVERGED if error is None else 0.3 * error
    n_vectors = 0 if n_modes is None else n_modes + 1 - len(known.omega)
    if asked.finer_hz is None:
        space = krylov_space(problem, w, known, bound, to_hz, n_vectors)
    else:
        space = finer_space(problem, w, known, max(to_hz, asked.finer_hz), n_vectors)
    pairs, n_known = space.pairs, len(known.omega)
    phi = pairs.phi.T @ w
    order = _ranked(pairs.omega, phi, n_known, to_hz)
    errors = space.bound + _residual_errors(pairs.omega[order], phi[order], to_hz)
    if error is not None:
        n_modes = max(int(np.argmax(errors <= error)), n_known)
    n = min(n_modes, len(order))
    if n < n_known:
        raise ReductionError(f"{n} modes cannot hold the {n_known} to be kept; ask for more.")
    kept = order[:n][np.argsort(pairs.omega[order[:n]])]
    # the sum of the modes left out: the static response less the modes kept would lose digits
    left_out = np.zeros(len(order))
    left_out[order[n:]] = phi[order[n:]] / pairs.omega[order[n:]] ** 2
    residual = pairs.phi @ left_out
    chosen = EigenPairs(pairs.omega[kept], pairs.phi[:, kept])
    return Chosen(chosen, residual, float(errors[n]), pairs)


def static_shapes(omega: np.ndarray, highest: float, to_hz: float) -> int:
    """How many modes omega (k,) [rad/s] move with the force, being above the highest one that was
    chosen or far above to_hz; one at least, what stands for the rest."""
    limit = min(highest, REACH * 2 * np.pi * to_hz)
    return max(1, int(np.count_nonzero(omega > (1 + 1e-9) * limit)))


def finer_space(
    problem: Pencil, w: np.ndarray, known: EigenPairs, to_hz: float, n_vectors: int = 0
) -> Space:
    """A space that stands for the full model at the contact up to to_hz, beside a reduced model of
    n_vectors."""
    return krylov_space(problem, w, known, EXACT, to_hz, n_vectors + BEYOND)


def krylov_space(
    problem: Pencil,
    w: np.ndarray,
    known: EigenPairs,
    error: float,
    to_hz: float,
    n_vectors: int = 0,
) -> Space:
    """Ritz pairs of n_vectors, or of more until their bound up to to_hz is below error.

    The first pairs are the known ones; the others are orthogonal to them.
    """
    s = 2 * np.pi * frequencies(to_hz)
    participation = known.phi.T @ w
    static, rest = _static(problem, w, known, participation)
    norm = _stiffness_norm(problem, rest)
    if norm <= 1e-12 * _stiffness_norm(problem, static):
        return Space(known, 0.0)
    V, H, v = np.empty((len(w), 2 * CHECK), order="F"), np.zeros((0, 0)), rest / norm
    while True:
        V, H, beta, v = _longer(problem, V, H, v, known)
        if len(H) < n_vectors and beta:
            continue
        bound = _bound(H, beta, norm, s, known.omega, participation)
        if bound <= error or beta == 0:
            break
        if len(H) >= max(LARGEST, n_vectors):
            raise ReductionError(
                f"{len(H)} vectors leave an error of up to {bound:.1e} up to {to_hz:g} Hz, asked "
                f"was {error:.1e}; ask for a larger error or a lower frequency."
            )
    return Space(_ritz(problem, known, V[:, : len(H)]), float(bound))


def _ritz(problem: Pencil, known: EigenPairs, V: np.ndarray) -> EigenPairs:
    """The known modes and the Ritz pairs of K-orthonormal V (n, k), which are written over."""
    # V^T M V anew, normalised below: what the recurrence found holds the errors of the solver
    inverse_squared, U = np.linalg.eigh(gram(V, problem.M))
    omega = np.append(known.omega, 1 / np.sqrt(inverse_squared))
    phi = turned(V, U)
    if len(known.omega):
        phi = np.column_stack([known.phi, phi])
    return _orthonormal(problem, EigenPairs(omega, phi))


def _orthonormal(problem: Pencil, pairs: EigenPairs) -> EigenPairs:
    """The pairs without what rounding leaves between them in M, the lowest kept as they are; phi
    is written over."""
    order, phi = np.argsort(pairs.omega), pairs.phi
    back = np.argsort(order)
    L = np.linalg.cholesky(gram(phi, problem.M)[order][:, order])
    for some in shares(len(phi), ROWS):
        phi[some] = solve_triangular(L, phi[some][:, order].T, lower=True).T[:, back]
    omega = np.sqrt(np.maximum(squares(phi, problem.K), 0))
    return EigenPairs(np.where(pairs.omega == 0, 0, omega), phi)


def _static(problem: Pencil, w: np.ndarray, known: EigenPairs, participation: np.ndarray):
    """K^-1 w, and what it has beyond the known modes; inertia relief where the structure floats."""
    elastic = known.omega > 0
    static = _solved(problem, w, known)
    rest = static - known.phi[:, elastic] @ (participation[elastic] / known.omega[elastic] ** 2)
    return static, rest


def _solved(problem: Pencil, load: np.ndarray, known: EigenPairs) -> np.ndarray:
    if problem.sigma == 0:
        return problem.factor.solve(load)
    return static_response(problem, load, known.phi[:, known.omega == 0])


def _longer(problem: Pencil, V: np.ndarray, H: np.ndarray, v: np.ndarray, known: EigenPairs):
    """CHECK more vectors, v the first; the next one and its length, 0 where there is none."""
    K, M = problem.K, problem.M
    for k in range(len(H), len(H) + CHECK):
        V = with_columns(V, k, v[:, None])
        x = _solved(problem, M @ v, known)
        if len(known.omega):
            x -= known.phi @ (known.phi.T @ (M @ x))
        force = K @ x
        before, column = _length(x, force), 0.0
        for _ in range(2):
            h = V[:, : k + 1].T @ force
            x -= V[:, : k + 1] @ h
            force = K @ x
            column = column + h
        H = np.pad(H, (0, 1))
        H[-1], H[:, -1] = column, column
        beta = _length(x, force)
        if beta <= EXHAUSTED * before:
            return V, H, 0.0, x
        v = x / beta
    return V, H, beta, v


def _stiffness_norm(problem: Pencil, x: np.ndarray) -> float:
    return _length(x, problem.K @ x)


def _length(x: np.ndarray, force: np.ndarray) -> float:
    """|x|_K from force = K x."""
    return float(np.sqrt(max(x @ force, 0.0)))


def _bound(
    H: np.ndarray,
    beta: float,
    norm: float,
    s: np.ndarray,
    omega: np.ndarray,
    participation: np.ndarray,
) -> float:
    """Of the relative rms error, as the module says; norm is |K^-1 w|_K beyond the known modes."""
    theta, U = np.linalg.eigh((H + H.T) / 2)
    dynamic = 1 / (1 + 1j * LOSS - s[:, None] ** 2 * theta)
    found = norm**2 * dynamic @ U[0] ** 2
    found = found + receptances(omega, participation, s).sum(axis=1)
    last = norm * dynamic @ (U[0] * U[-1])
    return rms((s**2 * beta * np.abs(last)) ** 2) / LOSS / size(found)


def _ranked(omega: np.ndarray, phi: np.ndarray, n_known: int, to_hz: float) -> np.ndarray:
    """The known ones, then the others by what an oscillator with their first two moments misses."""
    s = 2 * np.pi * frequencies(to_hz)[:, None]
    squared = omega[n_known:] ** 2
    beyond = phi[n_known:] ** 2 * (s / omega[n_known:]) ** 4 / (squared * (1 + 1j * LOSS) - s**2)
    order = np.argsort(-np.linalg.norm(beyond, axis=0))
    return np.append(np.arange(n_known), n_known + order)


def _residual_errors(omega: np.ndarray, phi: np.ndarray, to_hz: float) -> np.ndarray:
    """Relative rms error after the first 0, 1, .. k modes and one oscillator for the rest."""
    s = 2 * np.pi * frequencies(to_hz)
    each = receptances(omega, phi, s)
    beyond = _from_the_end(each)
    elastic = np.where(omega > 0, omega, np.inf)
    moments = [_from_the_end(phi**2 / elastic**i) for i in (2, 4)]
    lumped = (_one(first, second, s) for first, second in zip(*moments, strict=True))
    errors = [rms(one - rest) for one, rest in zip(lumped, beyond.T, strict=True)]
    return np.array(errors) / size(beyond[:, 0])


def _from_the_end(values: np.ndarray) -> np.ndarray:
    """Sums of all, all but the first, ... none, along the last axis (.., k + 1)."""
    sums = np.cumsum(values[..., ::-1], axis=-1)[..., ::-1]
    return np.concatenate([sums, np.zeros((*values.shape[:-1], 1))], axis=-1)


def _one(first: float, second: float, s: np.ndarray) -> np.ndarray:
    """Receptance (len(s),) of the oscillator that the residual vector makes of modes with
    sum phi_j^2 / omega_j^2 = first and sum phi_j^2 / omega_j^4 = second."""
    if first == 0:
        return np.zeros(len(s))
    return receptances(np.sqrt([first / second]), np.array([first / np.sqrt(second)]), s)[:, 0]
