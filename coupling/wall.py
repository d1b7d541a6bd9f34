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

from coupling.damping import Damping, damping_ratios, matrix_ratios
from coupling.errors import CouplingError
from dem import Wall
from rom import ModalWall, ReducedModel, modal, modal_compliance, static_compliance

HALF_SPACE = {"hertz": 0.6, "area": 16 / (3 * np.pi**2)}


def half_space_compliance(young: float, poisson: float, radius: float, kind: str) -> float:
    """Compliance w^T G w [m/N] of a half-space loaded and read over a circle of radius [m].

    "hertz": weights of the Hertz pressure, 0.6 (1 - nu^2) / (E b); "area": uniform weights,
    16 (1 - nu^2) / (3 pi^2 E b). Raises CouplingError for another kind or a radius not positive.
    """
    if kind not in HALF_SPACE:
        raise CouplingError(
            f"the patch weights are {kind!r}; they can be {' or '.join(HALF_SPACE)}."
        )
    if not (radius > 0 and young > 0):
        raise CouplingError(
            f"a patch of radius {radius:g} m on E={young:g} Pa has no compliance; take both > 0."
        )
    return HALF_SPACE[kind] * (1 - poisson**2) / (young * radius)


def wall_from_reduced(
    reduced: ReducedModel,
    *,
    half_space: float,
    damping: Damping | None = None,
    cutoff_hz: float | None = None,
    remainder: str = "oscillator",
    contact_coefficient: float | None = None,
    largest_force: float | None = None,
) -> Wall:
    """The wall a chain leans on, from a reduced model.

    half_space [m/N] is taken out of the static compliance (0 if the patch is not part of an
    elastic body). Modes below cutoff_hz [Hz] move one by one; None takes all that are more than
    static shapes: no residual vectors, none above the highest fixed-interface mode. The rest is one
    "oscillator", or a massless "spring" where its frequency would cost steps. damping adds to what
    C of the model gives. With contact_coefficient A [N/m^1.5] of the last contact and largest_force
    [N], the series law delta = (F/A)^(2/3) + s F is checked monotone up to that force.
    Raises CouplingError.
    """
    modes = modal(reduced)
    moving = moving_modes(modes, kept_modes(modes, reduced, cutoff_hz), remainder)
    residual = residual_compliance(reduced, modes, moving, half_space)
    if contact_coefficient is not None and largest_force is not None:
        require_monotone(residual, contact_coefficient, largest_force)
    zeta = damping_ratios(damping, moving.omega) + matrix_ratios(moving)
    return Wall(moving.omega, zeta, moving.phi, residual, 0.0)


def moving_modes(modes: ModalWall, kept: np.ndarray, remainder: str) -> ModalWall:
    """The kept modes (r,) and, for the remainder "oscillator", one that stands for the others."""
    if remainder not in ("oscillator", "spring"):
        raise CouplingError(f"remainder is {remainder!r}; it can be 'oscillator' or 'spring'.")
    columns = np.eye(len(modes.omega))[:, kept]
    rest = ~kept & (modes.omega > 0)
    if remainder == "oscillator" and modes.phi[rest].any():
        shape = np.where(rest, modes.phi / np.where(rest, modes.omega, 1) ** 2, 0.0)
        columns = np.column_stack([columns, shape / np.linalg.norm(shape)])
    return ModalWall(
        omega=np.sqrt((modes.omega**2) @ columns**2),
        phi=modes.phi @ columns,
        vectors=modes.vectors @ columns,
        damping=None if modes.damping is None else columns.T @ modes.damping @ columns,
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
        return float(modes.omega[-reduced.n_residual] / (2 * np.pi))
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
    total, added_up = static_compliance(reduced), modal_compliance(modes)
    if abs(added_up - total) > 1e-6 * abs(total):
        raise CouplingError(
            f"the wall's modes add up to a static compliance of {added_up:.6g} m/N, its stiffness "
            f"matrix says {total:.6g}; the reduced model is too badly conditioned."
        )
    static = total - modal_compliance(moving)
    return (static if static > 1e-9 * total else 0.0) - half_space


def largest_monotone_force(residual: float, contact_coefficient: float) -> float:
    """Force [N] up to which delta = (F/A)^(2/3) + s F grows with F; inf for s >= 0.

    d delta / dF = 2/3 A^(-2/3) F^(-1/3) + s = 0 at F = (2 / (3 |s|))^3 / A^2.
    """
    if residual >= 0:
        return np.inf
    return (2 / (3 * abs(residual))) ** 3 / contact_coefficient**2


def require_monotone(residual: float, contact_coefficient: float, largest_force: float) -> None:
    """Raise CouplingError unless the series law is monotone up to largest_force [N]."""
    limit = largest_monotone_force(residual, contact_coefficient)
    if not largest_force < limit:
        raise CouplingError(
            f"the wall's residual compliance {residual:.3g} m/N makes the contact give way above "
            f"{limit:.3g} N, below the predicted {largest_force:.3g} N; lower the cutoff frequency "
            f"or load a larger patch."
        )
