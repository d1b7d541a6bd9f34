"""Modes by shift and invert: K phi = omega^2 M phi from a factor of K - sigma M, by block Lanczos.

The lowest ones, as many as a number, a frequency or a test of one's own asks for, checked
mass-orthonormal. Grimes, Lewis and Simon, SIAM J. Matrix Anal. Appl. 15 (1994) 228.
"""

from collections.abc import Callable
from functools import partial
from itertools import count
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike
from scipy.linalg import eigh

from rom.factorisation import Pencil, ReductionError, noise

DENSE = 400  # up to this many dofs LAPACK is faster than Lanczos
BLOCK = 8  # vectors of a Lanczos block
MOST_RIGID = 32  # modes without stiffness that are looked past for an elastic one
CHECK = 4  # blocks between two looks at convergence
CONVERGED = 1e-10  # of theta = 1 / (omega^2 - sigma), its residual
Enough = Callable[[np.ndarray, Callable[[], np.ndarray]], bool]


class EigenPairs(NamedTuple):
    """omega (k,) [rad/s] ascending, rigid-body modes as exact zeros; phi (n, k) mass-normalised."""

    omega: np.ndarray
    phi: np.ndarray


def lowest_modes(problem: Pencil, n_modes: int, *, tolerance: float = CONVERGED) -> EigenPairs:
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
    omega, phi = modes_until(problem, lambda omega, _: len(omega) >= n_modes, tolerance)
    return EigenPairs(omega[:n_modes], phi[:, :n_modes])


def past_rigid_modes(problem: Pencil, *, tolerance: float = CONVERGED) -> EigenPairs:
    """The lowest modes, so many that one of them is elastic, or MOST_RIGID: six of a body that
    floats are not, and one more for each motion that a joint leaves free."""
    n_modes = min(BLOCK, problem.K.shape[0])
    while True:
        pairs = lowest_modes(problem, n_modes, tolerance=tolerance)
        most = min(MOST_RIGID, problem.K.shape[0])
        if pairs.omega.any() or n_modes == most:
            return pairs
        n_modes = min(2 * n_modes, most)


def modes_below(problem: Pencil, cutoff_hz: float) -> EigenPairs:
    """All modes of a pencil below cutoff_hz [Hz]."""
    cutoff = 2 * np.pi * cutoff_hz
    omega, phi = modes_until(problem, lambda omega, _: omega.max(initial=0) >= cutoff)
    below = np.count_nonzero(omega < cutoff)
    return EigenPairs(omega[:below], phi[:, :below])


def modes_until(problem: Pencil, enough: Enough, tolerance: float = CONVERGED) -> EigenPairs:
    """The lowest modes, as many as it takes until enough(omega, shapes) holds, or all there are.

    shapes() gives the mode shapes (n, k), for the price of one product.
    """
    K, M = problem.K, problem.M
    phi = _dense_vectors(K, M) if K.shape[0] <= DENSE else _lanczos(problem, enough, tolerance)
    phi = _mass_normalised(phi, M)
    squared = np.einsum("ij,ij->j", phi, K @ phi)
    order = np.argsort(squared)
    return EigenPairs(_circular_frequency(squared[order], noise(K, M)), phi[:, order])


def _dense_vectors(K: sp.csc_array, M: sp.csc_array) -> np.ndarray:
    try:
        return eigh(K.toarray(), M.toarray())[1]
    except np.linalg.LinAlgError:
        raise ReductionError(
            "M is not positive definite; every degree of freedom needs mass."
        ) from None


def _lanczos(problem: Pencil, enough: Enough, tolerance: float) -> np.ndarray:
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
            R = block.T @ (M @ W)
            pairs = _converged(H, R, last, problem.sigma, tolerance)
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


def _converged(
    H: np.ndarray, R: np.ndarray, last: slice, sigma: float, tolerance: float
) -> EigenPairs:
    """Converged Ritz pairs of the projected inverse H; phi are coefficients in the basis."""
    theta, S = eigh((H + H.T) / 2)
    order = np.argsort(-np.abs(theta))
    theta, S = theta[order], S[:, order]
    residual = np.linalg.norm(R @ S[last], axis=0)
    n = int(np.argmax(np.append(residual > tolerance * np.abs(theta), True)))
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
    rounding = noise(problem.K, problem.M)
    omega = np.sqrt(np.where(squared > rounding, squared, 0.0))
    return EigenPairs(omega, _mass_normalised(np.asarray(phi, dtype=float), problem.M))


def _circular_frequency(squared: np.ndarray, rounding: float) -> np.ndarray:
    if squared[0] < -rounding:
        raise ReductionError(
            f"K is indefinite: an eigenvalue is {squared[0]:.3g} rad^2/s^2; "
            f"a stiffness matrix has none below zero."
        )
    return np.sqrt(np.where(squared > rounding, squared, 0.0))
