"""The residual vector of a contact (residual attachment mode): its static response beyond modes.

    u = K^-1 w                                    attachment mode, of a held structure
    u = P^T K^+ P w,   P = 1 - M R R^T            of a floating one: inertia relief, R rigid modes
    r = u - sum_j phi_j (phi_j^T w) / omega_j^2   what the modes j leave of it

With r added to the modes the static response to the contact force is exact, however few they are.
Free modes take it as computed here; modes that the contact chooses sum it up from the Ritz pairs
left out (`contact_modes`); Craig-Bampton has it in its constraint modes (`craig_bampton`).
MacNeal, Computers & Structures 1 (1971) 581; Rubin, AIAA Journal 13 (1975) 995.
"""

import numpy as np
import scipy.sparse as sp

from beadwave.rom.factorisation import Pencil, ReductionError


def residual_vector(M: sp.csc_array, phi: np.ndarray, static: np.ndarray) -> np.ndarray:
    """Part of the static response (n,) [m/N] beyond the modes phi (n, k), orthogonal to them in M.

    Projected instead of summed up by modes, so that errors of their frequencies do not enter; and
    twice, since one projection leaves rounding of the size of the static response.
    """
    r = static - phi @ (phi.T @ (M @ static))
    return r - phi @ (phi.T @ (M @ r))


def static_response(problem: Pencil, load: np.ndarray, rigid: np.ndarray) -> np.ndarray:
    """u (n,) with K u = load, the rigid-body part taken out of both (inertia relief).

    rigid (n, r) are the mass-normalised rigid-body modes, r = 0 for a held structure. For r > 0
    the load is balanced by inertia forces, load - M R R^T load, and R^T M u = 0. By conjugate
    gradients preconditioned with the factor of K - sigma M, so that a floating K needs no second
    factorisation. Raises ReductionError if the equations are left unsatisfied.
    """
    K, M, factor, _ = problem

    # conjugate gradients in the elastic motions: the balanced load and every direction are
    # orthogonal to the rigid ones, where K would be singular
    r = load - M @ (rigid @ (rigid.T @ load))
    u, p, rho = np.zeros_like(r), np.zeros_like(r), 1.0
    enough = None
    for _ in range(200):
        # the preconditioner answers in rigid motions most of all, by 1 / sigma: take them out
        z = factor.solve(r)
        z = z - rigid @ (rigid.T @ (M @ z))
        previous, rho = rho, float(r @ z)
        enough = 1e-22 * rho if enough is None else enough  # squares: 1e-11 of the first residual
        if rho <= enough:
            return u
        p = z + (rho / previous) * p
        q = K @ p
        step = rho / float(p @ q)
        u, r = u + step * p, r - step * q
    raise ReductionError(
        "K u = w could not be solved; K is singular beyond the modes known as rigid."
    )


def attachment_modes(problem: Pencil, loads: np.ndarray, rigid: np.ndarray) -> np.ndarray:
    """Static responses to loads (n,) or (n, m) [N], of their shape [m]: one solution where K itself
    was factorised, else `static_response` with inertia relief for each, rigid (n, r) as there."""
    if problem.sigma == 0:
        return problem.factor.solve(loads)
    if loads.ndim == 1:
        return static_response(problem, loads, rigid)
    return np.column_stack([static_response(problem, load, rigid) for load in loads.T])
