"""The reduced model as a contact with friction sees it: along n, t1 and t2, with shakers and
sensors.

    u = sum_j Phi_j q_j + S F,   q_j'' + 2 zeta_j omega_j q_j' + omega_j^2 q_j = Phi_j . F + ...

Phi (k, p) are the participations of all functionals W: the contact along n, t1 and t2, shakers,
sensors. Modes below the cutoff move one by one. What the others hold has the moments

    R_m = sum_j Phi_j^T Phi_j / omega_j^(2 m),   m = 1, 2

and the pencil (R_1, R_2) is that of p oscillators which have both, so that every receptance between
two functionals is right up to omega^4: the matrix form of what `coupling.reduced_wall` does along
the normal. As massless springs R_1 they would be right up to omega^2 only, and a residual
compliance that couples the directions would have to be solved for the contact's forces at every
step. So S holds the half-space alone, which the laws of Hertz and Mindlin hold once more: it is
negative, and nearly diagonal. Johnson, Contact Mechanics (1985), sec. 3.2, 3.6 and 7.2.
"""

import numpy as np
from scipy.linalg import eigh

from beadwave.coupling.damping import Damping, damping_ratios, matrix_ratios
from beadwave.coupling.errors import CouplingError
from beadwave.coupling.reduced_wall import moving_mask
from beadwave.coupling.spatial_wall import SpatialWall, spatial_wall_of_modes
from beadwave.rom import Columns, ModalWall, ReducedModel, modal


def spatial_wall_of(
    reduced: ReducedModel,
    *,
    damping: Damping | None = None,
    cutoff_hz: float | None = None,
) -> SpatialWall:
    """The wall of a reduced model whose contact is known along n, t1 and t2, its half-space taken
    out.

    Modes below cutoff_hz [Hz] move one by one; None takes all that are more than static shapes.
    damping adds to what C of the model gives. Raises CouplingError for a model that is known along
    the normal only, and where C couples the modes.
    """
    columns = reduced.columns
    if columns is None or columns.across is None:
        raise CouplingError(
            "the reduced model knows its contact along the normal only; friction needs w with "
            "three columns, along n, t1 and t2."
        )
    moving = modes_and_oscillators(reduced, functionals(reduced), cutoff_hz)
    omega, phi, _, D = moving
    zeta = damping_ratios(damping, omega) + matrix_ratios(D, omega)
    n_loads = 0 if columns.load is None else columns.load.shape[1]
    contact, load, sense = np.split(phi, [3, 3 + n_loads], axis=1)
    wall = spatial_wall_of_modes(omega, zeta, contact, load=load, sense=sense)
    return wall._replace(residual_compliance=-half_space_of(reduced))


def modes_and_oscillators(
    reduced: ReducedModel, W: np.ndarray, cutoff_hz: float | None = None
) -> ModalWall:
    """Modes below the cutoff [Hz] and oscillators for the others, phi (k, p) their participations
    at p functionals W (r, p); arguments as in spatial_wall_of."""
    modes = modal(reduced)
    mask = moving_mask(modes, reduced, cutoff_hz)
    phi = modes.vectors.T @ W

    # Ritz pairs of the others in their static shapes X = Phi / omega^2, which for K and M in these
    # modes have R_1 = X^T K X and R_2 = X^T X. Of shapes that depend on each other the span counts
    left_out = ~mask & (modes.omega > 0)
    squared = modes.omega[left_out] ** 2
    X = phi[left_out] / squared[:, None]
    length = np.linalg.norm(X, axis=0)
    X = X[:, length > 0] / length[length > 0]
    U, sizes, _ = np.linalg.svd(X, full_matrices=False)
    # 1e-7 of the largest singular value of the rest's static shapes: rounding
    U = U[:, sizes > 1e-7 * sizes.max(initial=0.0)]
    of_rest, turn = eigh(U.T @ (squared[:, None] * U))
    shapes = np.zeros((len(modes.omega), len(of_rest)))
    shapes[left_out] = U @ turn
    moving = np.column_stack([np.eye(len(mask))[:, mask], shapes])
    D = None if modes.damping is None else moving.T @ modes.damping @ moving
    omega = np.append(modes.omega[mask], np.sqrt(of_rest))
    return ModalWall(omega, moving.T @ phi, modes.vectors @ moving, D)


def with_stingers(reduced: ReducedModel, stiffness: np.ndarray) -> ReducedModel:
    """The model held at its shakers by springs (s,) [N/m] to what moves them, 0 for a force:
    K + sum_i k_i load_i load_i^T. A motion x(t) of the far end then is the force k x.

    The static response to every shaker is in the basis, so that the one with springs is exact too.
    """
    load = reduced.columns.load
    return reduced._replace(K=reduced.K + (load * stiffness) @ load.T)


def functionals(reduced: ReducedModel) -> np.ndarray:
    """W (r, 3 + s + m): the contact along n, t1 and t2, shakers, sensors."""
    columns = reduced.columns or Columns()
    parts = [reduced.w[:, None], columns.across, columns.load, columns.sense]
    return np.column_stack([part for part in parts if part is not None])


def half_space_of(reduced: ReducedModel) -> np.ndarray:
    """Compliance (3, 3) [m/N] of the half-space under the patch along n, t1 and t2.

    Where a model states that along the normal only, the one in the face follows from Poisson's
    ratio: (2 - nu) / (2 (1 - nu)) of it (Mindlin 1949; Johnson 1985, 7.43), with 0.3 where that is
    not stated either.
    """
    columns, contact = reduced.columns, reduced.contact
    if columns.half_space is not None:
        return columns.half_space
    nu = 0.3 if contact.poisson is None else contact.poisson
    in_face = (2 - nu) / (2 * (1 - nu))
    return np.diag([1.0, in_face, in_face]) * (contact.half_space or 0.0)
