"""Free-interface modes of the whole structure and one residual-attachment vector at the contact.

    q = (modal amplitudes, residual amplitude),   T = [phi_1 .. phi_k, r / |r|_M]
    r = K^-1 w - sum_j phi_j (phi_j^T w) / omega_j^2

r is orthogonal to the modes in K and M, so both reduced matrices are diagonal; the static response
to the contact force is exact whatever k. MacNeal, Computers & Structures 1 (1971) 581;
Rubin, AIAA Journal 13 (1975) 995.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from rom.contact_modes import contact_modes, finer_space, static_shapes
from rom.factorisation import (
    Factor,
    Factorise,
    Pencil,
    ReductionError,
    static_response,
    superlu,
    symmetric,
)
from rom.floating import pencil
from rom.health import require_faithful, require_static_response
from rom.lanczos import (
    EigenPairs,
    known_modes,
    lowest_modes,
    modes_below,
    modes_until,
    past_rigid_modes,
)
from rom.reduced_model import ReducedModel, contact_functional, of_modes
from rom.selection import Selection, require_selection
from rom.truncation import Moments, tail_errors


def free_modes(
    K: ArrayLike | sp.sparray,
    M: ArrayLike | sp.sparray,
    w: ArrayLike,
    asked: Selection,
    *,
    C: ArrayLike | sp.sparray | None = None,
    shift: float | None = None,
    factorise: Factorise = superlu,
    factor: Factor | None = None,
) -> ReducedModel:
    """Reduce K, M (n, n) to the free modes asked for and the residual vector of the contact
    functional w (n,).

    shift [rad^2/s^2], negative, is the sigma of K - sigma M that gets factorised; None takes K
    itself, or where K floats freely a shift of -(omega_1 / 10)^2. factorise(A) returns an object
    with .solve; with the factor of a K that is held nothing is factorised. Raises ReductionError
    with one sentence where the result would not be right.
    """
    K, M = symmetric(K, "K"), symmetric(M, "M")
    w = contact_functional(w, K.shape[0])
    require_selection(asked, modes_suffice=True)
    problem = Pencil(K, M, factor) if factor else pencil(K, M, factorise, shift)
    C = None if C is None else symmetric(C, "C")
    known = None if asked.modes is None else known_modes(problem, *asked.modes)
    if asked.by_contact:
        found = contact_modes(problem, w, known_or_rigid(problem, known), asked)
        (omega, phi), beyond, stated, space = found
    else:
        (omega, phi), beyond, stated = _lowest(problem, w, known, asked)
        space = _finer(problem, w, len(omega), asked.finer_hz)
    residual = _residual(M, w, omega, phi, beyond)
    T = phi if residual is None else np.column_stack([phi, residual])
    squared = omega**2 if residual is None else np.append(omega**2, residual @ (K @ residual))
    reduced = ReducedModel(
        K=np.diag(squared),
        M=np.eye(T.shape[1]),
        C=None if C is None else T.T @ (C @ T),
        w=T.T @ w,
        T=T,
        kind="free-modes",
        n_boundary=0,
        notes={},
        n_residual=_static_shapes(squared, residual, asked.to_hz if asked.by_contact else None),
        error=stated,
        finer=None if asked.finer_hz is None else of_modes(*space, w, C),
    )
    require_faithful(reduced, K, M)
    require_static_response(reduced, K, M, w, _rigid(problem, EigenPairs(omega, phi)))
    return reduced


def _static_shapes(squared: np.ndarray, residual: np.ndarray | None, to_hz: float | None) -> int:
    if residual is None:
        return 0
    if to_hz is None:
        return 1
    return static_shapes(np.sqrt(squared), np.inf, to_hz)


class Choice(NamedTuple):
    """Modes, the static response (n,) to the contact force beyond them, and the error left."""

    pairs: EigenPairs
    residual: np.ndarray
    error: float | None


def _finer(
    problem: Pencil, w: np.ndarray, n_modes: int, finer_hz: float | None
) -> EigenPairs | None:
    if finer_hz is None:
        return None
    return finer_space(problem, w, known_or_rigid(problem, None), finer_hz, n_modes).pairs


def _lowest(problem: Pencil, w: np.ndarray, known: EigenPairs | None, asked: Selection) -> Choice:
    if asked.error is not None:
        return _to_error(problem, w, known, asked.error, asked.to_hz)
    if known is not None:
        pairs = _cut(known, asked.n_modes, asked.cutoff_hz)
    elif asked.n_modes is not None:
        pairs = lowest_modes(problem, asked.n_modes)
    else:
        pairs = modes_below(problem, asked.cutoff_hz)
    rigid = _rigid(problem, pairs)
    static = static_response(problem, w, rigid)
    beyond = _beyond(problem.M, pairs.phi, static)
    if asked.to_hz is None:
        return Choice(pairs, beyond, None)
    return Choice(pairs, beyond, _errors(problem, w, static, rigid, pairs, asked.to_hz)[-1])


def _to_error(
    problem: Pencil, w: np.ndarray, known: EigenPairs | None, error: float, to_hz: float
) -> Choice:
    rigid = _rigid(problem, known)
    static = static_response(problem, w, rigid)

    def enough(omega: np.ndarray, shapes: Callable[[], np.ndarray]) -> bool:
        if omega.max(initial=0) < 2 * np.pi * to_hz:
            return False
        found = EigenPairs(omega, shapes())
        return _errors(problem, w, static, rigid, found, to_hz).min() <= error

    pairs = known or modes_until(problem, enough)
    errors = _errors(problem, w, static, rigid, pairs, to_hz)
    if errors.min() > error:
        raise ReductionError(
            f"{len(pairs.omega)} modes leave an error of {errors.min():.1e} up to {to_hz:g} Hz, "
            f"asked was {error:g}; hand in more, or leave modes out."
        )
    n_modes = int(np.argmax(errors <= error))
    kept = _cut(pairs, n_modes, None)
    return Choice(kept, _beyond(problem.M, kept.phi, static), errors[n_modes])


def _errors(
    problem: Pencil,
    w: np.ndarray,
    static: np.ndarray,
    rigid: np.ndarray,
    pairs: EigenPairs,
    to_hz: float,
) -> np.ndarray:
    """Error after the first 0, 1, .. k modes of the pairs, (k + 1,)."""
    r = _beyond(problem.M, pairs.phi, static)
    inertia = problem.M @ r
    third = inertia @ static_response(problem, inertia, rigid)
    tail = Moments(float(w @ r), float(r @ inertia), float(third))
    return tail_errors(pairs.omega, pairs.phi.T @ w, tail, to_hz)


def _rigid(problem: Pencil, known: EigenPairs | None) -> np.ndarray:
    """Rigid-body modes (n, r); a K that was factorised as it is has none."""
    if problem.sigma == 0:
        return np.zeros((problem.K.shape[0], 0))
    omega, phi = known or past_rigid_modes(problem)
    return phi[:, omega == 0]


def known_or_rigid(problem: Pencil, known: EigenPairs | None) -> EigenPairs:
    """The modes to keep whatever the contact says: the rigid-body ones and those handed in."""
    rigid = _rigid(problem, None)
    if known is None:
        return EigenPairs(np.zeros(rigid.shape[1]), rigid)
    elastic = known.omega > 0  # of the rigid-body ones those handed in may be a part
    omega = np.append(np.zeros(rigid.shape[1]), known.omega[elastic])
    return EigenPairs(omega, np.column_stack([rigid, known.phi[:, elastic]]))


def _cut(pairs: EigenPairs, n_modes: int | None, cutoff_hz: float | None) -> EigenPairs:
    order = np.argsort(pairs.omega)[:n_modes]
    if cutoff_hz is not None:
        order = order[pairs.omega[order] < 2 * np.pi * cutoff_hz]
    return EigenPairs(pairs.omega[order], pairs.phi[:, order])


def _residual(
    M: sp.csc_array, w: np.ndarray, omega: np.ndarray, phi: np.ndarray, beyond: np.ndarray
) -> np.ndarray | None:
    elastic = omega > 0
    held = np.sum(((phi.T @ w)[elastic] / omega[elastic]) ** 2)
    # of a structure whose modes are all kept nothing remains but rounding; 1e-12 left a load
    # unbalanced by 2.7e-6 where a joint's stiff coordinates bore the rest
    if w @ beyond <= 1e-14 * held:
        return None
    return beyond / np.sqrt(beyond @ (M @ beyond))


def _beyond(M: sp.csc_array, phi: np.ndarray, static: np.ndarray) -> np.ndarray:
    """What the static response (n,) has beyond the modes; projected twice, once leaves rounding."""
    r = static - phi @ (phi.T @ (M @ static))
    return r - phi @ (phi.T @ (M @ r))
