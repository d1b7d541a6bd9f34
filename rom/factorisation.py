"""One sparse symmetric factorisation of K - sigma M, and what is solved with it.

Modes come by shift and invert, static responses directly (sigma = 0) or by conjugate gradients
preconditioned with the shifted factor, so that a free-floating K needs no second factorisation.
Grimes, Lewis and Simon, SIAM J. Matrix Anal. Appl. 15 (1994) 228, for block Lanczos.
"""

from collections.abc import Callable
from functools import partial
from itertools import count
from typing import NamedTuple, Protocol

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike
from scipy.linalg import eigh
from scipy.sparse.linalg import splu

EPS = np.finfo(float).eps
DENSE = 400  # up to this many dofs LAPACK is faster than Lanczos
BLOCK = 8  # vectors of a Lanczos block
CHECK = 4  # blocks between two looks at convergence
COLUMNS = 64  # right-hand sides solved at once


class ReductionError(ValueError):
    """The matrices handed in do not allow what was asked; the sentence says why."""


class Factor(Protocol):
    """What a factorisation can do: ``solve(b)`` for b (n,) or (n, k)."""

    def solve(self, b: np.ndarray) -> np.ndarray: ...


Factorise = Callable[[sp.csc_array], Factor]
Enough = Callable[[np.ndarray, Callable[[], np.ndarray]], bool]


class Pencil(NamedTuple):
    """K and M (n, n) with one factor of K - sigma M, sigma [rad^2/s^2]."""

    K: sp.csc_array
    M: sp.csc_array
    factor: Factor
    sigma: float


class EigenPairs(NamedTuple):
    """omega (k,) [rad/s] ascending, rigid-body modes as exact zeros; phi (n, k) mass-normalised."""

    omega: np.ndarray
    phi: np.ndarray


def superlu(A: sp.csc_array) -> Factor:
    """Symmetric-mode SuperLU factor of A (n, n): the default where no faster one is handed in."""
    return splu(
        sp.csc_array(A),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )


def symmetric(A: ArrayLike | sp.sparray | sp.spmatrix, name: str) -> sp.csc_array:
    """A (n, n) as a sparse array; raises ReductionError unless square, finite and symmetric."""
    A = sp.csc_array(A, dtype=float)
    if A.shape[0] != A.shape[1]:
        raise ReductionError(f"{name} is {A.shape[0]} x {A.shape[1]}; it must be square.")
    if not np.isfinite(A.data).all():
        raise ReductionError(f"{name} holds a value that is not finite.")
    asymmetry = abs(A - A.T).max() / max(abs(A).max(), np.finfo(float).tiny)
    if asymmetry > 1e-9:
        raise ReductionError(
            f"{name} is not symmetric (largest relative difference {asymmetry:.1e}, allowed 1e-9);"
            f" symmetrise it where it is assembled."
        )
    return A


def frequency_scale(K: sp.csc_array, M: sp.csc_array) -> float:
    """Largest diagonal ratio K_jj / M_jj [rad^2/s^2] but for one in a hundred.

    A bound of what rounding in K does to its eigenvalues: a few springs of any stiffness stand on
    a diagonal of their own and disturb nothing else.
    """
    k, m = K.diagonal(), M.diagonal()
    ratio = np.sort(k[m > 0] / m[m > 0])
    return float(ratio[max(0, int(np.ceil(0.99 * len(ratio))) - 1)]) if len(ratio) else 0.0


def pencil(
    K: sp.csc_array, M: sp.csc_array, factorise: Factorise, shift: float | None = None
) -> Pencil:
    """Factor of K, or of K - shift M where K floats freely and so has none.

    ``shift`` [rad^2/s^2] is negative, of the order of -(omega_1 / 10)^2; without it a floating K
    gets one from its own first elastic mode.
    """
    if shift is not None:
        return Pencil(K, M, factorise(sp.csc_array(K - shift * M)), shift)
    anchored = _anchored(K, M, factorise)
    return anchored if anchored is not None else _floating(K, M, factorise)


def _anchored(K: sp.csc_array, M: sp.csc_array, factorise: Factorise) -> Pencil | None:
    try:
        factor = factorise(K)
    except (RuntimeError, ArithmeticError, ValueError, np.linalg.LinAlgError):
        return None
    held = Pencil(K, M, factor, 0.0)
    return held if is_held(held) else None


def is_held(problem: Pencil) -> bool:
    """Whether the lowest eigenvalue of a K that was factorised as it is stands above rounding."""
    return _lowest_quotient(*problem[:3]) > _noise(problem.K, problem.M)


def _lowest_quotient(K: sp.csc_array, M: sp.csc_array, factor: Factor) -> float:
    x = np.random.default_rng(0).standard_normal(K.shape[0])
    for _ in range(3):
        x = factor.solve(M @ x)
        if not np.isfinite(x).all() or not x.any():
            return 0.0
        x /= np.linalg.norm(x)
    return float(x @ (K @ x) / (x @ (M @ x)))


def _floating(K: sp.csc_array, M: sp.csc_array, factorise: Factorise) -> Pencil:
    guess = -1e-9 * frequency_scale(K, M)
    rough = Pencil(K, M, factorise(sp.csc_array(K - guess * M)), guess)
    omega = lowest_modes(rough, min(8, K.shape[0])).omega
    if not omega.any():
        raise ReductionError(
            f"K has at least {len(omega)} rigid-body modes and no elastic one could be found; "
            f"tie the parts that move on their own, or pass shift."
        )
    sigma = -((omega[omega > 0][0] / 10) ** 2)
    if 1e-2 < sigma / guess < 1e2:
        return rough
    return Pencil(K, M, factorise(sp.csc_array(K - sigma * M)), sigma)


def lowest_modes(problem: Pencil, n_modes: int) -> EigenPairs:
    """The n_modes lowest modes of a pencil, checked mass-orthonormal.

    Raises ReductionError if fewer exist, M is not positive on them, or K is indefinite.
    """
    n = problem.K.shape[0]
    if n_modes > n:
        raise ReductionError(
            f"{n_modes} modes were asked of {n} degrees of freedom; take at most {n}."
        )
    if n_modes == 0:
        return EigenPairs(np.zeros(0), np.zeros((n, 0)))
    omega, phi = modes_until(problem, lambda omega, _: len(omega) >= n_modes)
    return EigenPairs(omega[:n_modes], phi[:, :n_modes])


def modes_below(problem: Pencil, cutoff_hz: float) -> EigenPairs:
    """All modes of a pencil below cutoff_hz [Hz]."""
    cutoff = 2 * np.pi * cutoff_hz
    omega, phi = modes_until(problem, lambda omega, _: omega.max(initial=0) >= cutoff)
    below = np.count_nonzero(omega < cutoff)
    return EigenPairs(omega[:below], phi[:, :below])


def modes_until(problem: Pencil, enough: Enough) -> EigenPairs:
    """The lowest modes, as many as it takes until enough(omega, shapes) holds, or all there are.

    shapes() gives the mode shapes (n, k), for the price of one product.
    """
    K, M = problem.K, problem.M
    phi = _dense_vectors(K, M) if K.shape[0] <= DENSE else _lanczos(problem, enough)
    phi = _mass_normalised(phi, M)
    squared = np.einsum("ij,ij->j", phi, K @ phi)
    order = np.argsort(squared)
    return EigenPairs(_circular_frequency(squared[order], _noise(K, M)), phi[:, order])


def _dense_vectors(K: sp.csc_array, M: sp.csc_array) -> np.ndarray:
    try:
        return eigh(K.toarray(), M.toarray())[1]
    except np.linalg.LinAlgError:
        raise ReductionError(
            "M is not positive definite; every degree of freedom needs mass."
        ) from None


def _lanczos(problem: Pencil, enough: Enough) -> np.ndarray:
    # block Lanczos on (K - sigma M)^-1 M, fully reorthogonalised in M: a block of right-hand sides
    # costs a third of as many single ones, and twins among the modes cannot be missed
    M, factor = problem.M, problem.factor
    start = np.random.default_rng(1).standard_normal((M.shape[0], BLOCK))
    block = _orthonormal(factor.solve(start), M)
    if block.shape[1] < BLOCK:  # rigid motions drown the rest: let it come with the second block
        block = _orthonormal(start, M)
    Q, H = block, np.zeros(2 * block.shape[1:])
    for step in count(1):
        W = factor.solve(np.asfortranarray(M @ block))
        norm = np.sqrt(np.einsum("ij,ij->j", W, M @ W).max())
        h = _projected_out(W, Q[:, : len(H)], M)
        last = slice(len(H) - block.shape[1], None)
        H[:, last], H[last, :] = h, h.T
        block = _orthonormal(W, M, norm)
        exhausted = block.shape[1] == 0
        if exhausted or step % CHECK == 0:
            pairs = _converged(H, (block.T @ (M @ W)), last, problem.sigma)
            shapes = partial(np.matmul, Q[:, : len(H)], pairs.phi)
            if exhausted or enough(pairs.omega, shapes):
                return shapes()
        Q = with_columns(Q, len(H), block)
        H = np.pad(H, (0, block.shape[1]))


def _projected_out(W: np.ndarray, Q: np.ndarray, M: sp.csc_array) -> np.ndarray:
    """Take Q out of W, in place, twice; the coefficients come back."""
    total = 0.0
    for _ in range(2):
        h = Q.T @ (M @ W)
        W -= Q @ h
        total = total + h
    return total


def with_columns(Q: np.ndarray, used: int, block: np.ndarray) -> np.ndarray:
    """Q (n, capacity) with block behind the columns in use; twice the capacity where it is full."""
    width = used + block.shape[1]
    if width > Q.shape[1]:
        larger = np.empty((len(Q), 2 * width), order="F")
        larger[:, :used] = Q[:, :used]
        Q = larger
    Q[:, used:width] = block
    return Q


def _converged(H: np.ndarray, R: np.ndarray, last: slice, sigma: float) -> EigenPairs:
    """Converged Ritz pairs of the projected inverse H; phi are coefficients in the basis."""
    theta, S = eigh((H + H.T) / 2)
    order = np.argsort(-np.abs(theta))
    theta, S = theta[order], S[:, order]
    left = np.linalg.norm(R @ S[last], axis=0)
    n = int(np.argmax(np.append(left > 1e-10 * np.abs(theta), True)))
    return EigenPairs(np.sqrt(np.maximum(sigma + 1 / theta[:n], 0)), S[:, :n])


def _orthonormal(W: np.ndarray, M: sp.csc_array, norm: float = 0.0) -> np.ndarray:
    # directions at the rounding of what W was before the projection, norm, are none
    for _ in range(2):
        gram = W.T @ (M @ W)
        scale = np.sqrt(np.maximum(np.diag(gram), (1e-13 * norm) ** 2 + np.finfo(float).tiny))
        size, U = eigh(gram / np.outer(scale, scale))
        kept = size > 1e-12
        kept &= np.diag(U.T @ gram @ U) > (1e-13 * norm) ** 2
        W, norm = W @ (U[:, kept] / scale[:, None] / np.sqrt(size[kept])), 0.0
    return W


def _mass_normalised(phi: np.ndarray, M: sp.csc_array) -> np.ndarray:
    gram = phi.T @ (M @ phi)
    mass = np.diag(gram)
    if not (mass > 0).all():
        raise ReductionError("M is not positive definite on the lowest modes; check the densities.")
    norm = np.sqrt(mass)
    coupling = np.abs(gram / np.outer(norm, norm) - np.eye(len(norm))).max()
    if coupling > 1e-7:
        raise ReductionError(
            f"the modes are not mass-orthonormal (largest product {coupling:.1e}, allowed 1e-7); "
            f"pass a shift nearer to -(omega_1 / 10)^2."
        )
    return phi / norm


def known_modes(problem: Pencil, omega: ArrayLike, phi: ArrayLike) -> EigenPairs:
    """Modes found elsewhere: checked mass-orthonormal, rigid-body ones set to frequency zero."""
    squared = np.asarray(omega, dtype=float) ** 2
    noise = _noise(problem.K, problem.M)
    omega = np.sqrt(np.where(squared > noise, squared, 0.0))
    return EigenPairs(omega, _mass_normalised(np.asarray(phi, dtype=float), problem.M))


def _noise(K: sp.csc_array, M: sp.csc_array) -> float:
    return 200 * EPS * frequency_scale(K, M)


def _circular_frequency(squared: np.ndarray, noise: float) -> np.ndarray:
    if squared[0] < -noise:
        raise ReductionError(
            f"K is indefinite: an eigenvalue is {squared[0]:.3g} rad^2/s^2; "
            f"a stiffness matrix has none below zero."
        )
    return np.sqrt(np.where(squared > noise, squared, 0.0))


def solutions(factor: Factor, B: sp.csc_array | np.ndarray) -> np.ndarray:
    """X (n, k) with A X = B, in blocks of columns so that no dense copy of B is made."""
    X = np.empty(B.shape)
    for first in range(0, B.shape[1], COLUMNS):
        columns = B[:, first : first + COLUMNS]
        dense = columns.toarray() if sp.issparse(columns) else columns
        X[:, first : first + COLUMNS] = factor.solve(np.asfortranarray(dense))
    return X


def static_response(problem: Pencil, load: np.ndarray, rigid: np.ndarray) -> np.ndarray:
    """u (n,) with K u = load, the rigid-body part taken out of both (inertia relief).

    rigid (n, r) are the mass-normalised rigid-body modes, r = 0 for a held structure. For r > 0
    the load is balanced by inertia forces, load - M R R^T load, and R^T M u = 0.
    Raises ReductionError if the equations are left unsatisfied.
    """
    K, M, factor, _ = problem

    def elastic_solve(residual: np.ndarray) -> np.ndarray:
        z = factor.solve(residual)
        return z - rigid @ (rigid.T @ (M @ z))

    r = load - M @ (rigid @ (rigid.T @ load))
    u, p, rho = np.zeros_like(r), np.zeros_like(r), 1.0
    enough = None
    for _ in range(200):
        z = elastic_solve(r)
        previous, rho = rho, float(r @ z)
        enough = 1e-22 * rho if enough is None else enough
        if rho <= enough:
            return u
        p = z + (rho / previous) * p
        q = K @ p
        step = rho / float(p @ q)
        u, r = u + step * p, r - step * q
    raise ReductionError(
        "K u = w could not be solved; K is singular beyond the modes known as rigid."
    )
