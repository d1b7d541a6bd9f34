"""Free-interface modes of the whole structure and one residual-attachment vector at the contact.

    q = (modal amplitudes, residual amplitude),   T = [phi_1 .. phi_k, r / |r|_M]
    r = K^-1 w - sum_j phi_j (phi_j^T w) / omega_j^2

r is orthogonal to the modes in K and M, so both reduced matrices are diagonal; the static response
to the contact force is exact whatever k. MacNeal, Computers & Structures 1 (1971) 581;
Rubin, AIAA Journal 13 (1975) 995.
"""

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from rom.factorisation import (
    EigenPairs,
    Factorise,
    Pencil,
    ReductionError,
    known_modes,
    lowest_modes,
    modes_below,
    pencil,
    static_response,
    superlu,
    symmetric,
)
from rom.health import require_faithful, require_static_response
from rom.reduced_model import ReducedModel, contact_functional


def free_modes(
    K: ArrayLike | sp.sparray,
    M: ArrayLike | sp.sparray,
    w: ArrayLike,
    *,
    n_modes: int | None = None,
    cutoff_hz: float | None = None,
    shift: float | None = None,
    modes: tuple[np.ndarray, np.ndarray] | None = None,
    C: ArrayLike | sp.sparray | None = None,
    factorise: Factorise = superlu,
    provenance: dict[str, str] | None = None,
) -> ReducedModel:
    """Reduce K, M (n, n) to k free modes and the residual vector of the contact functional w (n,).

    Give n_modes, or cutoff_hz [Hz] for all modes below it, or modes = (omega (k,) [rad/s],
    phi (n, k) mass-normalised) that are already there (then n_modes and cutoff_hz cut them).
    shift [rad^2/s^2], negative, is the sigma of K - sigma M that gets factorised; None takes K
    itself, or where K floats freely a shift of -(omega_1 / 10)^2. factorise(A) returns an object
    with .solve. Raises ReductionError with one sentence where the result would not be right.
    """
    K, M = symmetric(K, "K"), symmetric(M, "M")
    w = contact_functional(w, K.shape[0])
    problem = pencil(K, M, factorise, shift)
    omega, phi = _kept(problem, modes, n_modes, cutoff_hz)
    rigid = phi[:, omega == 0]
    residual = _residual(problem, w, omega, phi, rigid)
    T = phi if residual is None else np.column_stack([phi, residual])
    squared = omega**2 if residual is None else np.append(omega**2, residual @ (K @ residual))
    damping = None if C is None else T.T @ (symmetric(C, "C") @ T)
    reduced = ReducedModel(
        K=np.diag(squared),
        M=np.eye(T.shape[1]),
        C=damping,
        w=T.T @ w,
        T=T,
        kind="free-modes",
        n_boundary=0,
        provenance=dict(provenance or {}),
        n_residual=0 if residual is None else 1,
    )
    require_faithful(reduced, K, M)
    require_static_response(reduced, K, M, w, rigid)
    return reduced


def _kept(
    problem: Pencil,
    modes: tuple[np.ndarray, np.ndarray] | None,
    n_modes: int | None,
    cutoff_hz: float | None,
) -> EigenPairs:
    if modes is None and (n_modes is None) == (cutoff_hz is None):
        raise ReductionError("give either n_modes or cutoff_hz to say how many modes to keep.")
    if modes is not None:
        return _cut(known_modes(problem, *modes), n_modes, cutoff_hz)
    if n_modes is not None:
        return lowest_modes(problem, n_modes)
    return modes_below(problem, cutoff_hz)


def _cut(pairs: EigenPairs, n_modes: int | None, cutoff_hz: float | None) -> EigenPairs:
    order = np.argsort(pairs.omega)[:n_modes]
    if cutoff_hz is not None:
        order = order[pairs.omega[order] < 2 * np.pi * cutoff_hz]
    return EigenPairs(pairs.omega[order], pairs.phi[:, order])


def _residual(
    problem: Pencil, w: np.ndarray, omega: np.ndarray, phi: np.ndarray, rigid: np.ndarray
) -> np.ndarray | None:
    static = static_response(problem, w, rigid)
    r = static - phi @ (phi.T @ (problem.M @ static))
    r -= phi @ (phi.T @ (problem.M @ r))
    # of a structure whose modes are all kept nothing remains but rounding
    if w @ r < 1e-12 * abs(w @ static):
        return None
    return r / np.sqrt(r @ (problem.M @ r))
