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

from beadwave.coupling.coupled_wall import CoupledWall
from beadwave.coupling.damping import Damping, couples_modes, damping_ratios, matrix_ratios
from beadwave.coupling.errors import CouplingError
from beadwave.dem import Wall
from beadwave.rom import (
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
    half_space = reduced.contact.half_space or 0.0
    read_elsewhere = reduced.contact.weights_read is not None
    if read_elsewhere and cutoff_hz is None:
        cutoff_hz = np.inf  # the thesis takes its matrices whole
    options = {"half_space": half_space, "damping": damping, "cutoff_hz": cutoff_hz, "modes": modes}
    if read_elsewhere or couples_modes(modes.damping):
        return coupled_wall(reduced, **options)
    return wall_from_reduced(reduced, **options)


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
    # modes below the cutoff move one by one, one oscillator stands for those above
    modes = modal(reduced) if modes is None else modes
    moving = with_oscillator(modes, moving_mask(modes, reduced, cutoff_hz))

    # what they leave of the static compliance, the half-space taken out: Hertz' law of the contact
    # holds it as well. A negative s is passive while the contact in series with it keeps a positive
    # stiffness, see coupling.verdict
    residual = residual_compliance(reduced, modes, moving, half_space)

    # ratios >= 0 of modes that C does not couple: the wall dissipates
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
    mask = moving_mask(modes, reduced, cutoff_hz)
    weights = reduced.contact.weights_read
    if weights is None:
        moving, residual = with_oscillator(modes, mask), 0.0
        reading = moving.phi
    else:
        # an oscillator stands for a compliance of one functional, not for that from force to
        # reading: modes above the cutoff follow statically, by sum phi_j (weights v_j) / omega_j^2
        moving = moving_modes(modes, mask)
        reading = weights @ moving.vectors
        static = ~mask & (modes.omega > 0)
        cross = modes.phi[static] * (weights @ modes.vectors)[static]
        residual = float(np.sum(cross / modes.omega[static] ** 2))

    # D = diag(2 zeta omega) + V^T C V; an indefinite one feeds energy into the chain
    D = np.diag(2 * damping_ratios(damping, moving.omega) * moving.omega)
    if moving.damping is not None:
        D = D + moving.damping
    if is_indefinite(D):
        raise CouplingError("the wall's damping matrix is indefinite; it would generate energy.")
    return CoupledWall(moving.omega, D, moving.phi, reading, residual - half_space)


def moving_mask(modes: ModalWall, reduced: ReducedModel, cutoff_hz: float | None) -> np.ndarray:
    """Mask (r,) of the modes that move one by one: those below cutoff_hz, or where that is None
    below the static shapes of the reduced model.

    A residual vector or a constraint mode of the boundary would only cost step size as a mode.
    """
    inner = np.diag(reduced.K)[reduced.n_boundary :]
    if cutoff_hz is None:
        cutoff_hz = np.inf
        if reduced.n_residual:
            # below the first one whichever way the division by 2 pi rounds
            cutoff_hz = modes.omega[-reduced.n_residual] / (2 * np.pi) * (1 - 1e-9)
        elif reduced.kind == "craig-bampton" and len(inner):
            # up to the highest fixed-interface mode
            cutoff_hz = np.sqrt(inner.max()) / (2 * np.pi) * (1 + 1e-9)
    return modes.omega < 2 * np.pi * cutoff_hz


def moving_modes(modes: ModalWall, mask: np.ndarray) -> ModalWall:
    """The modes of the mask (r,) alone; all others follow the force at once."""
    omega, phi, vectors, damping = modes
    damping = None if damping is None else damping[np.ix_(mask, mask)]
    return ModalWall(omega[mask], phi[mask], vectors[:, mask], damping)


def with_oscillator(modes: ModalWall, mask: np.ndarray) -> ModalWall:
    """The modes of the mask (r,) and one oscillator that stands for the others.

    Its shape is their static response, sum_j v_j phi_j / omega_j^2, so that its Rayleigh quotient
    has their moments m_1 and m_2: omega_r^2 = m_1 / m_2, phi_r^2 = m_1^2 / m_2. Rigid-body modes
    have no static response and move.
    """
    moving, left_out = moving_modes(modes, mask), ~mask & (modes.omega > 0)
    if not modes.phi[left_out].any():
        return moving
    shape = np.where(left_out, modes.phi / np.where(left_out, modes.omega, 1) ** 2, 0.0)
    shape /= np.linalg.norm(shape)
    damping = None
    if modes.damping is not None:
        coupled = modes.damping @ shape
        damping = np.block(
            [[moving.damping, coupled[mask, None]], [coupled[mask], shape @ coupled]]
        )
    return ModalWall(
        np.append(moving.omega, np.sqrt(modes.omega**2 @ shape**2)),
        np.append(moving.phi, modes.phi @ shape),
        np.column_stack([moving.vectors, modes.vectors @ shape]),
        damping,
    )


def residual_compliance(
    reduced: ReducedModel, modes: ModalWall, moving: ModalWall, half_space: float
) -> float:
    """Static compliance s [m/N] of all that does not move, the half-space taken out.

        s = w^T K^-1 w - sum_moving phi_j^2 / omega_j^2 - half_space

    With an oscillator for the rest the first two differ by rounding alone, which counts as 0.
    Raises CouplingError if the modes do not add up to the static compliance of the model.
    """
    total = static_compliance(reduced, modes=modes)
    of_modes = modal_compliance(modes)
    if abs(of_modes - total) > 1e-6 * abs(total):
        raise CouplingError(
            f"the wall's modes add up to a static compliance of {of_modes:.6g} m/N, its stiffness "
            f"matrix says {total:.6g}; the reduced model is too badly conditioned."
        )
    static = total - modal_compliance(moving)
    return (static if static > 1e-9 * total else 0.0) - half_space


def damping_matrix(reduced: ReducedModel, damping: Damping | None) -> np.ndarray | None:
    """C (r, r) = M V diag(2 zeta omega) V^T M of the modes V, added to the model's own C."""
    if damping is None:
        return None
    modes = modal(reduced)
    MV = reduced.M @ modes.vectors
    return (MV * (2 * damping_ratios(damping, modes.omega) * modes.omega)) @ MV.T
