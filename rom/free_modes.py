"""Free-interface modes of the whole structure and one residual-attachment vector at the contact.

    q = (modal amplitudes, residual amplitude),   T = [phi_1 .. phi_k, r / |r|_M]
    r = K^-1 w - sum_j phi_j (phi_j^T w) / omega_j^2

r is orthogonal to the modes in K and M, so both reduced matrices are diagonal; the static response
to the contact force is exact whatever k. MacNeal, Computers & Structures 1 (1971) 581;
Rubin, AIAA Journal 13 (1975) 995.
"""

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from beadwave.rom.contact_modes import FinerModes, contact_modes, finer_space, static_shapes
from beadwave.rom.factorisation import Factorise, Pencil, ReductionError, Solver, superlu, symmetric
from beadwave.rom.floating import n_suspended, pencil
from beadwave.rom.health import require_faithful, require_static_response
from beadwave.rom.lanczos import (
    EigenPairs,
    known_modes,
    lowest_modes,
    modes_below,
    modes_until,
    no_modes,
    past_rigid_modes,
)
from beadwave.rom.reduced_model import ReducedModel, contact_functional, of_modes
from beadwave.rom.residual_vector import residual_vector, static_response
from beadwave.rom.selection import Selection, require_selection
from beadwave.rom.truncation import Moments, tail_errors


def free_modes(
    K: ArrayLike | sp.sparray,
    M: ArrayLike | sp.sparray,
    w: ArrayLike,
    selection: Selection,
    *,
    C: ArrayLike | sp.sparray | None = None,
    shift: float | None = None,
    factorise: Factorise = superlu,
    factor: Solver | None = None,
) -> ReducedModel:
    """Reduce K, M (n, n) to the free modes selected and the residual vector of the contact
    functional w (n,).

    K [N/m], M [kg] and C [N s/m] (n, n) are symmetric. Coordinates are the amplitudes of the
    mass-normalised modes by rising frequency, then that of the residual vector; K_r and M_r are
    diagonal, C_r is not where dashpots couple modes.

    shift [rad^2/s^2], negative, is the sigma of K - sigma M that gets factorised; None takes K
    itself, or where K floats freely a shift of -(omega_1 / 10)^2. factorise(A) returns an object
    with .solve; with the factor of a K that is held nothing is factorised. Raises ReductionError
    with one sentence where the result would not be right: for matrices that are not symmetric, a
    selection that contradicts itself, modes that are not M-orthonormal, an error that the modes
    handed in do not reach, and a static response that leaves forces.
    """
    K, M = symmetric(K, "K"), symmetric(M, "M")
    w = contact_functional(w, K.shape[0])
    require_selection(selection, modes_suffice=True)
    n_modes, error, to_hz = selection.n_modes, selection.error, selection.to_hz
    problem = Pencil(K, M, factor) if factor else pencil(K, M, factorise, shift)
    C = None if C is None else symmetric(C, "C")
    supplied = None if selection.modes is None else known_modes(problem, *selection.modes)

    # modes phi, the residual vector r = K^-1 w - sum phi_j (phi_j^T w) / omega_j^2, and the error
    # that both leave
    stated = None
    if selection.by_contact:
        # those that matter most at the contact, among the Ritz pairs of its Krylov space
        pairs, r, stated, finer = contact_modes(
            problem, w, retained_modes(problem, supplied), selection
        )
    elif error is not None:
        # the fewest of the lowest modes whose error bound holds; it is computed for every number
        # of them at once, and none holds before they reach to_hz
        rigid = rigid_modes(problem, supplied)
        static = static_response(problem, w, rigid)

        def enough(omega: np.ndarray, shapes: Callable[[], np.ndarray]) -> bool:
            """True if some number of these modes (k,) has a bound within the required error."""
            if omega.max(initial=0) < 2 * np.pi * to_hz:
                return False
            pairs = EigenPairs(omega, shapes())
            return _errors(problem, w, static, rigid, pairs, to_hz).min() <= error

        candidates = supplied or modes_until(problem, enough)
        errors = _errors(problem, w, static, rigid, candidates, to_hz)
        if errors.min() > error:
            raise ReductionError(
                f"{len(candidates.omega)} modes leave an error of {errors.min():.1e} up to "
                f"{to_hz:g} Hz, asked was {error:g}; hand in more, or leave modes out."
            )
        n_modes = int(np.argmax(errors <= error))
        pairs, stated = _lowest_of(candidates, n_modes, None), errors[n_modes]
        del candidates  # (n, k), not to be held next to the finer model
        r = residual_vector(M, pairs.phi, static)
    else:
        # the lowest modes, by their number or a frequency; one static response serves r and error
        if supplied is not None:
            pairs = _lowest_of(supplied, n_modes, selection.cutoff_hz)
        elif n_modes is not None:
            pairs = lowest_modes(problem, n_modes)
        else:
            pairs = modes_below(problem, selection.cutoff_hz)
        rigid = rigid_modes(problem, pairs)
        static = static_response(problem, w, rigid)
        r = residual_vector(M, pairs.phi, static)
        if to_hz is not None:
            stated = _errors(problem, w, static, rigid, pairs, to_hz)[-1]

    # a model that stands for the full one: modes of the contact bring theirs along
    if selection.finer_hz is not None and not selection.by_contact:
        retained, n_vectors = retained_modes(problem, None), len(pairs.omega)
        space = finer_space(problem, w, retained, selection.finer_hz, n_vectors)
        finer = FinerModes(*space.pairs)

    # T = [phi, r / |r|_M], r orthogonal to phi in K and M: diagonal matrices, r^T K r / r^T M r in
    # place of an omega^2. Of a structure whose modes are all kept r is rounding and left out; 1e-12
    # of their compliance instead of 1e-14 left a load unbalanced by 2.7e-6 where a joint's stiff
    # coordinates bore the rest
    omega, phi = pairs
    elastic = omega > 0
    compliance = np.sum(((phi.T @ w)[elastic] / omega[elastic]) ** 2)
    if w @ r <= 1e-14 * compliance:
        T, squared, n_residual = phi, omega**2, 0
    else:
        r = r / np.sqrt(r @ (M @ r))
        T, squared, n_residual = np.column_stack([phi, r]), np.append(omega**2, r @ (K @ r)), 1
        if selection.by_contact:
            n_residual = static_shapes(np.sqrt(squared), np.inf, to_hz)
    reduced = ReducedModel(
        K=np.diag(squared),
        M=np.eye(T.shape[1]),
        C=None if C is None else T.T @ (C @ T),
        w=T.T @ w,
        T=T,
        kind="free-modes",
        n_boundary=0,
        notes={},
        n_residual=n_residual,
        error=stated,
        finer=None if selection.finer_hz is None else of_modes(*finer, w, C),
    )

    # measured, not trusted: K_r = T^T K T, M_r = T^T M T, and T K_r^-1 w_r solves K u = w
    require_faithful(reduced, K, M)
    require_static_response(reduced, K, M, w, rigid_modes(problem, pairs))
    return reduced


def _errors(
    problem: Pencil,
    w: np.ndarray,
    static: np.ndarray,
    rigid: np.ndarray,
    pairs: EigenPairs,
    to_hz: float,
) -> np.ndarray:
    """Relative rms error of the receptance up to to_hz [Hz] after the first 0, 1, .. k modes of the
    pairs and a residual vector for the rest, (k + 1,).

    static (n,) is the response K^-1 w, rigid (n, r) the rigid-body modes. The moments of all modes
    beyond the pairs cost one solution: m_1 = w^T r, m_2 = r^T M r, m_3 = r^T M K^-1 M r.
    """
    r = residual_vector(problem.M, pairs.phi, static)
    inertia = problem.M @ r
    third = inertia @ static_response(problem, inertia, rigid)
    tail = Moments(float(w @ r), float(r @ inertia), float(third))
    return tail_errors(pairs.omega, pairs.phi.T @ w, tail, to_hz)


def rigid_modes(problem: Pencil, supplied: EigenPairs | None) -> np.ndarray:
    """Rigid-body modes (n, r), mass-normalised: those among the modes supplied, or sought; a K that
    was factorised as it is has none, r = 0."""
    if problem.sigma == 0:
        return np.zeros((problem.K.shape[0], 0))
    omega, phi = supplied or past_rigid_modes(problem)
    return phi[:, omega == 0]


def retained_modes(problem: Pencil, supplied: EigenPairs | None) -> EigenPairs:
    """The modes to keep whatever the contact says: the rigid-body ones, those of a soft suspension
    and those handed in."""
    if problem.sigma == 0:
        return supplied or no_modes(problem.K.shape[0])
    soft = -problem.sigma
    omega, phi = past_rigid_modes(problem, softer_than=soft)
    n_retained = np.count_nonzero(omega == 0)
    n_retained += n_suspended(omega[n_retained:])
    omega, phi = omega[:n_retained], phi[:, :n_retained]
    if supplied is None:
        return EigenPairs(omega, phi)
    # modes handed in may hold some of these: one lies in their span if the length of its projection
    # in M, between 0 and 1, is nearer to 1
    others = np.linalg.norm(phi.T @ (problem.M @ supplied.phi), axis=0) < 0.5
    omega = np.append(omega, supplied.omega[others])
    return EigenPairs(omega, np.column_stack([phi, supplied.phi[:, others]]))


def _lowest_of(pairs: EigenPairs, n_modes: int | None, cutoff_hz: float | None) -> EigenPairs:
    """The n_modes lowest of the pairs, or those below cutoff_hz; None sets no limit."""
    order = np.argsort(pairs.omega)[:n_modes]
    if cutoff_hz is not None:
        order = order[pairs.omega[order] < 2 * np.pi * cutoff_hz]
    return EigenPairs(pairs.omega[order], pairs.phi[:, order])
