"""Elastic spheres and the Hertz law between two of them or between one and a flat.

    F = A delta^(3/2),   A = 4/3 E* sqrt(R*),   1/R* = 1/R1 + 1/R2,
    1/E* = (1 - nu1^2)/E1 + (1 - nu2^2)/E2

K. L. Johnson, Contact Mechanics, Cambridge 1985, chap. 4. A flat is R = inf, a rigid body
E = inf. Arguments in SI units (R [m], E [Pa], A [N/m^1.5], F [N]) are numbers or arrays that
broadcast against each other, element by element. Nothing is checked: bad numbers give NaN.
"""

import numpy as np
from numpy.typing import ArrayLike

from beadwave.dem.kernels.arguments import Array


def mass(radius: ArrayLike, density: ArrayLike) -> Array:
    """Mass 4/3 pi R^3 rho [kg] of a solid sphere of a density rho [kg/m^3]."""
    return 4.0 / 3.0 * np.pi * np.asarray(radius, float) ** 3 * density


def relative_radius(R1: ArrayLike, R2: ArrayLike = np.inf) -> Array:
    """Relative radius R* = R1 R2 / (R1 + R2) [m]; R2 = inf is a plane."""
    return 1.0 / (1.0 / np.asarray(R1, float) + 1.0 / np.asarray(R2, float))


def contact_modulus(
    E1: ArrayLike, nu1: ArrayLike, E2: ArrayLike = np.inf, nu2: ArrayLike = 0.0
) -> Array:
    """Contact modulus E*, 1 / E* = (1 - nu1^2) / E1 + (1 - nu2^2) / E2 [Pa]; E2 = inf is rigid."""
    return 1.0 / ((1.0 - np.square(nu1)) / E1 + (1.0 - np.square(nu2)) / np.asarray(E2, float))


def hertz_coefficient(
    R1: ArrayLike,
    E1: ArrayLike,
    nu1: ArrayLike,
    R2: ArrayLike = np.inf,
    E2: ArrayLike = np.inf,
    nu2: ArrayLike = 0.0,
) -> Array:
    """A of F = A delta^(3/2) [N/m^(3/2)], Johnson's eq. 4.23 solved for the force.

    >>> float(round(hertz_coefficient(0.0127, 210e9, 0.3, 0.0127, 210e9, 0.3) / 1e10, 4))
    1.226
    """
    return 4.0 / 3.0 * contact_modulus(E1, nu1, E2, nu2) * np.sqrt(relative_radius(R1, R2))


def mindlin_coefficient(
    R1: ArrayLike, E1: ArrayLike, nu1: ArrayLike, R2: ArrayLike = np.inf,
    E2: ArrayLike = np.inf, nu2: ArrayLike = 0.0,
) -> Array:  # fmt: skip
    """K [N/m^(3/2)] of the tangential stiffness K sqrt(delta) of a contact that does not slip,
    8 a / ((2 - nu1) / G1 + (2 - nu2) / G2) with a = sqrt(R* delta) and G = E / 2 (1 + nu) (Johnson,
    eq. 7.43)."""
    soft = [
        2.0 * (1.0 + np.asarray(nu)) * (2.0 - np.asarray(nu)) / np.asarray(E, float)
        for E, nu in ((E1, nu1), (E2, nu2))
    ]
    return 8.0 * np.sqrt(relative_radius(R1, R2)) / (soft[0] + soft[1])


def hertz_overlap(force: ArrayLike, A: ArrayLike) -> Array:
    """Overlap delta = (F / A)^(2/3) [m] of a contact under a force F [N] by Hertz' law."""
    return (np.asarray(force, float) / A) ** (2.0 / 3.0)


def hertz_stiffness(overlap: ArrayLike, A: ArrayLike) -> Array:
    """Stiffness dF/d delta = 3/2 A delta^(1/2) [N/m] of a contact at an overlap delta [m]."""
    return 1.5 * np.asarray(A, float) * np.sqrt(overlap)


def hertz_energy(force: ArrayLike, A: ArrayLike) -> Array:
    """Elastic energy 2/5 F delta [J] of a contact under a force F [N]."""
    return 0.4 * np.asarray(force, float) * hertz_overlap(force, A)


def modulus_of_contact(A: ArrayLike, R: ArrayLike) -> Array:
    """E* = 3/4 A / sqrt(R) [Pa] behind a Hertz coefficient A and the relative radius R."""
    return 0.75 * A / np.sqrt(R)


def radii_of_contacts(radius: ArrayLike) -> Array:
    """(n,) relative radii R* [m] of the contacts of a row of spheres (n,), the last with a flat."""
    return np.append(relative_radius(radius[:-1], radius[1:]), radius[-1:])


def contact_radius(force: ArrayLike, R: ArrayLike, E_star: ArrayLike) -> Array:
    """a = (3 F R / 4 E*)^(1/3) [m] for the relative radius R and the contact modulus E* (Johnson,
    eq. 4.22)."""
    return np.cbrt(0.75 * np.asarray(force, float) * R / E_star)


def max_pressure(force: ArrayLike, R: ArrayLike, E_star: ArrayLike) -> Array:
    """p0 = (6 F E*^2 / (pi^3 R^2))^(1/3) [Pa], at the centre of the contact circle (Johnson, eq.
    4.24)."""
    return np.cbrt(6.0 * np.asarray(force, float) * E_star**2 / (np.pi**3 * R**2))


def yield_overlap(R: ArrayLike, E_star: ArrayLike, contact_yield_stress: float) -> Array:
    """Overlap [m] at which the largest pressure reaches the contact yield stress, about 1.6 times
    the yield stress of the softer material (C. Thornton, J. Appl. Mech. 64 (1997) 383)."""
    return R * (0.5 * np.pi * contact_yield_stress / E_star) ** 2


def yielded_radius(force: ArrayLike, R: ArrayLike, A: ArrayLike, overlap: ArrayLike) -> Array:
    """Radius [m] of a contact pressed by a force, beyond its yield overlap [m] at constant
    pressure: a^2 = R delta as in Hertz' law, with the straight line of Thornton's."""
    # overlap up to first yield by Hertz, and what the straight line of slope 3/2 F / delta adds
    first = A * overlap**1.5
    beyond = np.maximum(np.asarray(force, float) / first - 1.0, 0.0) / 1.5
    return np.sqrt(R * (hertz_overlap(np.minimum(force, first), A) + overlap * beyond))


def time_scale(m: ArrayLike, A: ArrayLike, speed: ArrayLike) -> Array:
    """t_s = (m/A)^(2/5) V^(-1/5) [s], the natural unit of time of a Hertz chain."""
    return (m / A) ** 0.4 * np.abs(speed) ** -0.2


def force_scale(m: ArrayLike, A: ArrayLike, speed: ArrayLike) -> Array:
    """F_s = A^(2/5) m^(3/5) V^(6/5) [N], the natural unit of force of a Hertz chain."""
    return A**0.4 * m**0.6 * np.abs(speed) ** 1.2


def yield_overlaps(radius: ArrayLike, A: ArrayLike, pressure: ArrayLike) -> np.ndarray:
    """Overlaps (n_contacts,) [m] at which contacts of coefficients A (n_contacts,) reach a pressure
    [Pa], one for all or (n_contacts,); radius (n,) of the spheres."""
    A = np.asarray(A)
    R = radii_of_contacts(radius)[: A.size]
    return yield_overlap(R, modulus_of_contact(A, R), np.broadcast_to(pressure, R.shape))
