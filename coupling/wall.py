"""The reduced model as the chain sees it: modes below a cutoff, one oscillator for the rest.

    u_w = sum phi_j q_j + phi_r q_r + s F,   q_j'' + 2 zeta_j omega_j q_j' + omega_j^2 q_j = phi_j F

The modes above the cutoff have m_1 = sum phi_j^2 / omega_j^2 and m_2 = sum phi_j^2 / omega_j^4. One
oscillator, omega_r^2 = m_1 / m_2 and phi_r^2 = m_1^2 / m_2, has both and so their receptance up to
omega^4; as a massless spring m_1 they would be right up to omega^2 only. The Hertz law of the
contact already holds the half-space under the patch, so s is minus its compliance (plus m_1 where
the rest is a spring). What is left of the static compliance belongs to the structure alone and
depends neither on the mesh nor on the patch. MacNeal, Computers & Structures 1 (1971) 581 for the
residual; Johnson, Contact Mechanics (1985), sec. 3.2 and 3.4 for the half-space.
"""

import numpy as np

from coupling.coupled_wall import CoupledWall
from coupling.damping import Damping, couples_modes, damping_ratios, matrix_ratios
from coupling.errors import CouplingError
from dem import Wall
from rom import (
    ModalWall,
    ReducedModel,
    is_indefinite,
    modal,
    modal_compliance,
    static_compliance,
)


def wall_of(
    reduced: ReducedModel,
    *,
    damping: Damping | None = None,
    cutoff_hz: float | None = None,
    modes: ModalWall | None = None,
) -> Wall | CoupledWall:
    """The wall that a reduced model says it is, its half-space taken out.

    Oscillators, unless it is read through other weights than the force enters, or its damping
    couples its modes. Arguments as in wall_from_reduced. Raises CouplingError.
    """
    modes = modal(reduced) if modes is None else modes
    read_elsewhere = reduced.contact.weights_read is not None
    if read_elsewhere and cutoff_hz is None:
        cutoff_hz = np.inf  # the thesis takes its matrices whole
    coupled = read_elsewhere or couples_modes(modes.damping)
    make = coupled_wall if coupled else wall_from_reduced
    half_space = reduced.contact.half_space or 0.0
    return make(reduced, half_space=half_space, damping=damping, cutoff_hz=cutoff_hz, modes=modes)


def wall_from_reduced(
    reduced: ReducedModel,
    *,
    half_space: float,
    damping: Damping | None = None,
    cutoff_hz: float | None = None,
    modes: ModalWall | None = None,
) -> Wall:
    """The wall a chain leans on, from a reduced model.

    half_space [m/N] is taken out of the static compliance (0 if the patch is not part of an
    elastic body). Modes below cutoff_hz [Hz] move one by one; None takes all that are more than
    static shapes: no residual vectors, none above the highest fixed-interface mode. The rest is one
    oscillator. damping adds to what C of the model gives. modes are those of `rom.modal(reduced)`,
    where they are known. Raises CouplingError.
    """
    modes = modal(reduced) if modes is None else modes
    moving = with_oscillator(modes, kept_modes(modes, reduced, cutoff_hz))
    residual = residual_compliance(reduced, modes, moving, half_space)
    zeta = damping_ratios(damping, moving.omega) + matrix_ratios(moving.damping, moving.omega)
    return Wall(moving.omega, zeta, moving.phi, residual, 0.0)


def coupled_wall(
    reduced: ReducedModel,
    *,
    half_space: float,
    damping: Damping | None = None,
    cutoff_hz: float | None = None,
    modes: ModalWall | None = None,
) -> CoupledWall:
    """The wall of a reduced model with all of C, read through the weights that it says.

    Arguments as in wall_from_reduced. Raises CouplingError.
    """
    modes = modal(reduced) if modes is None else modes
    kept = kept_modes(modes, reduced, cutoff_hz)
    weights = reduced.contact.weights_read
    moving = (with_oscillator if weights is None else moving_modes)(modes, kept)
    reading = moving.phi if weights is None else weights @ moving.vectors
    D = np.diag(2 * damping_ratios(damping, moving.omega) * moving.omega)
    if moving.damping is not None:
        D = D + moving.damping
    if is_indefinite(D):
        raise CouplingError("the wall's damping matrix is indefinite; it would generate energy.")
    residual = 0.0 if weights is None else _cross_compliance(modes, ~kept, weights)
    return CoupledWall(moving.omega, D, moving.phi, reading, residual - half_space)


def moving_modes(modes: ModalWall, kept: np.ndarray) -> ModalWall:
    """The kept modes (r,) alone; all others follow the force at once."""
    omega, phi, vectors, damping = modes
    damping = None if damping is None else damping[np.ix_(kept, kept)]
    return ModalWall(omega[kept], phi[kept], vectors[:, kept], damping)


def with_oscillator(modes: ModalWall, kept: np.ndarray) -> ModalWall:
    """The kept modes (r,) and one that stands for the others."""
    moving, rest = moving_modes(modes, kept), ~kept & (modes.omega > 0)
    if not modes.phi[rest].any():
        return moving
    shape = np.where(rest, modes.phi / np.where(rest, modes.omega, 1) ** 2, 0.0)
    shape /= np.linalg.norm(shape)
    damping = None
    if modes.damping is not None:
        coupled = modes.damping @ shape
        damping = np.block(
            [[moving.damping, coupled[kept, None]], [coupled[kept], shape @ coupled]]
        )
    return ModalWall(
        np.append(moving.omega, np.sqrt(modes.omega**2 @ shape**2)),
        np.append(moving.phi, modes.phi @ shape),
        np.column_stack([moving.vectors, modes.vectors @ shape]),
        damping,
    )


def kept_modes(modes: ModalWall, reduced: ReducedModel, cutoff_hz: float | None) -> np.ndarray:
    """Mask (r,) of the modes that move."""
    if cutoff_hz is None:
        cutoff_hz = own_cutoff_hz(modes, reduced)
    return modes.omega < 2 * np.pi * cutoff_hz


def own_cutoff_hz(modes: ModalWall, reduced: ReducedModel) -> float:
    """Where the modes of a reduced model end [Hz] and its static shapes begin.

    A residual vector or a constraint mode of the boundary would only cost step size as a mode.
    """
    if reduced.n_residual:
        # below the first one whichever way the division by 2 pi rounds
        return float(modes.omega[-reduced.n_residual] / (2 * np.pi) * (1 - 1e-9))
    inner = np.diag(reduced.K)[reduced.n_boundary :]
    if reduced.kind == "craig-bampton" and len(inner):
        return float(np.sqrt(inner.max()) / (2 * np.pi) * (1 + 1e-9))
    return np.inf


def residual_compliance(
    reduced: ReducedModel, modes: ModalWall, moving: ModalWall, half_space: float
) -> float:
    """Static compliance s [m/N] of all that does not move, the half-space taken out.

    Raises CouplingError if the modes do not add up to the static compliance of the model.
    """
    total = static_compliance(reduced, modes=modes)
    added_up = modal_compliance(modes)
    if abs(added_up - total) > 1e-6 * abs(total):
        raise CouplingError(
            f"the wall's modes add up to a static compliance of {added_up:.6g} m/N, its stiffness "
            f"matrix says {total:.6g}; the reduced model is too badly conditioned."
        )
    static = total - modal_compliance(moving)
    return (static if static > 1e-9 * total else 0.0) - half_space


def _cross_compliance(modes: ModalWall, static: np.ndarray, weights: np.ndarray) -> float:
    """Displacement read per force [m/N] in the modes that do not move."""
    static = static & (modes.omega > 0)
    force, reading = modes.phi[static], (weights @ modes.vectors)[static]
    return float(np.sum(force * reading / modes.omega[static] ** 2))


def damping_matrix(reduced: ReducedModel, damping: Damping | None) -> np.ndarray | None:
    """C (r, r) = M V diag(2 zeta omega) V^T M of the modes V, beside the model's own C."""
    if damping is None:
        return None
    modes = modal(reduced)
    MV = reduced.M @ modes.vectors
    return (MV * (2 * damping_ratios(damping, modes.omega) * modes.omega)) @ MV.T
