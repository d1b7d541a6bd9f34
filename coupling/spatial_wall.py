"""A structure as a contact in three directions, its shakers and its sensors see it.

    u = phi^T q + S F + L f,      q'' + 2 zeta omega q' + omega^2 q = phi F + load f

u and F are displacement and force of the wall at the contact along n, t1, t2: n points into the
wall, t1 is the first global axis that lies in the wall, projected, and t2 = n x t1. f are the
forces of s shakers. S is what the modes leave of the static compliance, the half-space that Hertz'
and Mindlin's laws of the contact hold already taken out in each direction (`half_space`); L is what
they leave of the contact's static motion under the shakers. A sensor reads

    y = sense^T q + sense_residual F + sense_load_residual f

R. D. Mindlin, J. Appl. Mech. 16 (1949) 259; K. L. Johnson, Contact Mechanics (1985), sec. 3.7.
"""

from typing import NamedTuple

import numpy as np

from beadwave.coupling.errors import CouplingError


class SpatialWall(NamedTuple):
    """k modes, one contact in three directions, s shakers and r sensors; fields without a default
    may be empty in k."""

    omega: np.ndarray  # (k,) [rad/s]
    zeta: np.ndarray  # (k,)
    phi: np.ndarray  # (k, 3) [kg^-1/2] participations along n, t1, t2, mass-normalised
    residual_compliance: np.ndarray  # (3, 3) [m/N] symmetric, S
    load: np.ndarray  # (k, s) [kg^-1/2] participations of the shakers
    load_residual: np.ndarray  # (3, s) [m/N] L
    sense: np.ndarray  # (k, r) [kg^-1/2] participations of the sensors
    sense_residual: np.ndarray  # (r, 3) [m/N]
    sense_load_residual: np.ndarray  # (r, s) [m/N]


def spatial_wall_of_modes(omega, zeta, phi, *, load=None, sense=None) -> SpatialWall:
    """A wall of modes alone, without residual motion; omega, zeta (k,), phi (k, 3), load (k, s),
    sense (k, r)."""
    omega = np.asarray(omega, float)
    load = np.zeros((omega.size, 0)) if load is None else np.asarray(load, float)
    sense = np.zeros((omega.size, 0)) if sense is None else np.asarray(sense, float)
    s, r = load.shape[1], sense.shape[1]
    return SpatialWall(
        omega,
        np.asarray(zeta, float),
        np.asarray(phi, float),
        np.zeros((3, 3)),
        load,
        np.zeros((3, s)),
        sense,
        np.zeros((r, 3)),
        np.zeros((r, s)),
    )


def half_space(young: float, poisson: float, radius: float) -> np.ndarray:
    """(3, 3) [m/N] weighted mean displacement of a half-space under unit forces along n, t1, t2,
    spread over a patch of this radius [m] by Hertz' weights and read by the same.

    Normal 0.6 (1 - nu^2) / (E b), tangential 0.15 (2 - nu) / (G b); the directions do not couple.
    """
    G = young / (2.0 * (1.0 + poisson))
    normal = 0.6 * (1.0 - poisson**2) / (young * radius)
    tangential = 0.15 * (2.0 - poisson) / (G * radius)
    return np.diag([normal, tangential, tangential])


def require_one_solution(
    residual_compliance: np.ndarray, stiffness: tuple[float, float], coefficient: float
) -> None:
    """Raise CouplingError unless contact and residual compliance S (3, 3) [m/N] in series answer
    every approach by one force, with so much of a coefficient of friction.

    `stiffness` [N/m] are those of the contact under its largest force, normal and tangential where
    it sticks: diag(1/k_n, 1/k_t, 1/k_t) + S is positive definite. Where all of it slips, T = mu F
    along the slip, and 1/k_n + s_nn - mu |s_nt| is positive.
    """
    k_n, k_t = stiffness
    S = np.asarray(residual_compliance, float)
    least = float(np.linalg.eigvalsh(np.diag([1.0 / k_n, 1.0 / k_t, 1.0 / k_t]) + S)[0])
    slipping = 1.0 / k_n + S[0, 0] - coefficient * float(np.hypot(S[0, 1], S[0, 2]))
    if min(least, slipping) <= 0.0:
        diagonal = ", ".join(f"{value:.3g}" for value in np.diag(S))
        raise CouplingError(
            f"the wall's residual compliance of {diagonal} m/N along n, t1, t2 next to a contact "
            f"of {1.0 / k_n:.3g} m/N normal and {1.0 / k_t:.3g} m/N tangential leaves no unique "
            f"force (least sum {min(least, slipping):.3g} m/N, it must be positive); enlarge the "
            "patch, or refine the mesh at the contact."
        )
