"""Modes K phi = omega^2 M phi by block Lanczos on the shifted inverse, fully reorthogonalised.

    A = (K - sigma M)^-1 M,   A phi = theta phi,   theta = 1 / (omega^2 - sigma)
    A Q_j = [Q_1 .. Q_j] h_j + Q_j+1 R_j,   Q^T M Q = 1,   H = Q^T M A Q

The lowest modes have the largest |theta|, and these converge first. With H s = theta s the Ritz
vector Q s misses by |R_j s_j|, s_j its rows of the last block. The lowest modes come as many as a
number, a frequency or the caller's test asks for, checked mass-orthonormal.
Grimes, Lewis and Simon, SIAM J. Matrix Anal. Appl. 15 (1994) 228.
"""

from collections.abc import Callable
from functools import partial
from itertools import count
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike
from scipy.linalg import eigh

from beadwave.rom.factorisation import Pencil, ReductionError, noise

Enough = Callable[[np.ndarray, Callable[[], np.ndarray]], bool]


class LanczosOptions(NamedTuple):
    """Search for modes."""

    dense: int = 400  # dofs up to which all modes by LAPACK are faster than a few by Lanczos
    block: int = 8  # right-hand sides a solution: eight together cost a third of eight alone
    check: int = 4  # blocks between two looks at convergence, each an eigenproblem of H
    converged: float = 1e-10  # residual of A phi = theta phi over theta
    most_rigid: int = 32  # modes without stiffness that are looked past for an elastic one


class EigenPairs(NamedTuple):
    """omega (k,) [rad/s], rigid-body modes as exact zeros; phi (n, k) mass-normalised. Ascending as
    this module gives them; modes to be retained, and pairs of a Krylov space, are in any order."""

    omega: np.ndarray
    phi: np.ndarray


def no_modes(n: int) -> EigenPairs:
    """No modes of a structure of n degrees of freedom: omega (0,), phi (n, 0)."""
    return EigenPairs(np.zeros(0), np.zeros((n, 0)))


def lowest_modes(
    problem: Pencil, n_modes: int, *, options: LanczosOptions = LanczosOptions()
) -> EigenPairs:
    """The n_modes lowest modes of a pencil, checked mass-orthonormal.

    Raises ReductionError if fewer exist, M is not positive on them, or K is indefinite.
    """
    n = problem.K.shape[0]
    if n_modes > n:
        raise ReductionError(
            f"{n_modes} modes were asked of {n} degrees of freedom; take at most {n}."
        )
    if n_modes == 0:
        return no_modes(n)
    omega, phi = modes_until(problem, lambda omega, _: len(omega) >= n_modes, options)
    return EigenPairs(omega[:n_modes], phi[:, :n_modes])


def past_rigid_modes(
    problem: Pencil, *, softer_than: float = 0.0, options: LanczosOptions = LanczosOptions()
) -> EigenPairs:
    """The lowest modes, as many as it takes until one of them is elastic, with an omega^2 above
    `softer_than` [rad^2/s^2], or `most_rigid` of them.

    Six modes of a body that floats are rigid, and one more for each motion that a joint leaves
    free: their number is not known before, nor that of the modes of a soft suspension.
    """
    n = problem.K.shape[0]
    n_modes = min(options.block, n)
    while True:
        pairs = lowest_modes(problem, n_modes, options=options)
        if pairs.omega.max() ** 2 > softer_than or n_modes == min(options.most_rigid, n):
            return pairs
        n_modes = min(2 * n_modes, options.most_rigid, n)


def modes_below(problem: Pencil, cutoff_hz: float) -> EigenPairs:
    """All modes of a pencil below cutoff_hz [Hz]: modes are sought until one of them lies above it.

    Raises ReductionError as `modes_until`.
    """
    cutoff = 2 * np.pi * cutoff_hz
    omega, phi = modes_until(problem, lambda omega, _: omega.max(initial=0) >= cutoff)
    below = np.count_nonzero(omega < cutoff)
    return EigenPairs(omega[:below], phi[:, :below])


def modes_until(
    problem: Pencil, enough: Enough, options: LanczosOptions = LanczosOptions()
) -> EigenPairs:
    """The lowest modes, as many as it takes until enough(omega, shapes) holds, or all there are.

    enough is called with omega (k,) [rad/s] of the modes that have converged, from the lowest on,
    and shapes, which gives their shapes (n, k) for the price of one product. A pencil of up to
    `dense` unknowns has all its modes computed, whatever enough says. Raises ReductionError
    where M is not positive on the modes, they are not orthonormal in M, or K is indefinite.
    """
    K, M = problem.K, problem.M
    if K.shape[0] <= options.dense:
        try:
            phi = eigh(K.toarray(), M.toarray())[1]
        except np.linalg.LinAlgError:
            raise ReductionError(
                "M is not positive definite; every degree of freedom needs mass."
            ) from None
    else:
        phi = block_lanczos(problem, enough, options)
    phi = _mass_normalised(phi, M)

    # Rayleigh quotients: theta of a shifted inverse would lose the digits of omega^2 << |sigma|
    squared = np.einsum("ij,ij->j", phi, K @ phi)
    order = np.argsort(squared)
    squared, rounding = squared[order], noise(K, M)
    if squared[0] < -rounding:
        raise ReductionError(
            f"K is indefinite: an eigenvalue is {squared[0]:.3g} rad^2/s^2; "
            f"a stiffness matrix has none below zero."
        )
    omega = np.sqrt(np.where(squared > rounding, squared, 0.0))
    return EigenPairs(omega, phi[:, order])


def block_lanczos(
    problem: Pencil, enough: Enough, options: LanczosOptions = LanczosOptions()
) -> np.ndarray:
    """Shapes (n, k) of the converged modes, the lowest first, once enough(omega, shapes) holds.

    Blocks instead of single vectors, so that twins among the modes cannot be missed.
    """
    M, factor, sigma = problem.M, problem.factor, problem.sigma

    # one solution takes the stiff half of the random start away before anything is built on it
    start = np.random.default_rng(1).standard_normal((M.shape[0], options.block))
    block = _m_orthonormalised(factor.solve(start), M)
    if block.shape[1] < options.block:
        # rigid motions drown all others in rounding: those come with the second block
        block = _m_orthonormalised(start, M)
    Q, H = block, np.zeros(2 * block.shape[1:])
    for step in count(1):
        # W = A Q_j without what the basis holds already. Projected on all of Q, not on the last
        # two blocks as in exact arithmetic, or converged modes would come back as ghosts; and
        # twice, since the first time leaves rounding of the size of W
        W = factor.solve(np.asfortranarray(M @ block))
        norm = np.sqrt(np.einsum("ij,ij->j", W, M @ W).max())
        basis, h = Q[:, : len(H)], 0.0
        for _ in range(2):
            projection = basis.T @ (M @ W)
            W -= basis @ projection
            h = h + projection
        last = slice(len(H) - block.shape[1], None)
        H[:, last], H[last, :] = h, h.T
        block = _m_orthonormalised(W, M, norm)

        # converged Ritz pairs, from the largest |theta| to the first that is not converged
        exhausted = block.shape[1] == 0
        if exhausted or step % options.check == 0:
            R = block.T @ (M @ W)
            theta, S = eigh((H + H.T) / 2)
            order = np.argsort(-np.abs(theta))
            theta, S = theta[order], S[:, order]
            residual = np.linalg.norm(R @ S[last], axis=0)
            n = int(np.argmax(np.append(residual > options.converged * np.abs(theta), True)))
            shapes = partial(np.matmul, basis, S[:, :n])
            if exhausted or enough(np.sqrt(np.maximum(sigma + 1 / theta[:n], 0)), shapes):
                return shapes()
        Q = with_columns(Q, len(H), block)
        H = np.pad(H, (0, block.shape[1]))


def with_columns(Q: np.ndarray, used: int, block: np.ndarray) -> np.ndarray:
    """Q (n, capacity) with block behind the columns in use; twice the capacity where it is full."""
    width = used + block.shape[1]
    if width > Q.shape[1]:
        larger = np.empty((len(Q), 2 * width), order="F")
        larger[:, :used] = Q[:, :used]
        Q = larger
    Q[:, used:width] = block
    return Q


def _m_orthonormalised(W: np.ndarray, M: sp.csc_array, norm: float = 0.0) -> np.ndarray:
    """A basis (n, j) of the columns of W with W^T M W = 1, j their rank.

    `norm` is the size of W before a projection: directions at the rounding of that are none.
    """
    for _ in range(2):
        gram = W.T @ (M @ W)
        scale = np.sqrt(np.maximum(np.diag(gram), (1e-13 * norm) ** 2 + np.finfo(float).tiny))
        size, U = eigh(gram / np.outer(scale, scale))
        independent = size > 1e-12
        independent &= np.diag(U.T @ gram @ U) > (1e-13 * norm) ** 2
        turn = U[:, independent] / scale[:, None] / np.sqrt(size[independent])
        W, norm = W @ turn, 0.0
    return W


def _mass_normalised(phi: np.ndarray, M: sp.csc_array) -> np.ndarray:
    """phi (n, k) with phi_j^T M phi_j = 1; raises ReductionError unless phi^T M phi = 1 then."""
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
    """Modes omega (k,) [rad/s], phi (n, k) found elsewhere, in their order: scaled to unit modal
    mass, those at rounding set to frequency zero.

    Raises ReductionError where they are not orthogonal in M or have no positive modal mass.
    """
    squared = np.asarray(omega, dtype=float) ** 2
    rounding = noise(problem.K, problem.M)
    omega = np.sqrt(np.where(squared > rounding, squared, 0.0))
    return EigenPairs(omega, _mass_normalised(np.asarray(phi, dtype=float), problem.M))
