"""An infinite plate as a wall: its bending waves carry energy away as a dashpot would.

    v_w = F / (8 sqrt(D rho h)),   D = E h^3 / 12 (1 - nu^2),   k^4 = rho h omega^2 / D

It holds while the plate is thin against the waves, k h << 1. C. Zener, Phys. Rev. 59 (1941) 669;
K. F. Graff, Wave Motion in Elastic Solids (1975), ch. 4.
"""

from typing import NamedTuple

import numpy as np

from beadwave.dem import Wall, plate_wall


class Plate(NamedTuple):
    """An elastic plate."""

    young: float  # [Pa]
    poisson: float
    density: float  # [kg/m^3]
    thickness: float  # [m]


def infinite_plate(plate: Plate) -> Wall:
    """The wall of a plate without edges, thin against its bending waves."""
    return plate_wall(*plate)


def shear_speed(plate: Plate) -> float:
    """c_T [m/s]; bending waves of a thick plate stay below it."""
    return float(np.sqrt(plate.young / (2 * (1 + plate.poisson) * plate.density)))


def wavenumber(plate: Plate, omega: float) -> float:
    """k [1/m] of a thin plate's bending waves at omega [rad/s]."""
    D = plate.young * plate.thickness**3 / (12 * (1 - plate.poisson**2))
    return float((plate.density * plate.thickness * omega**2 / D) ** 0.25)


def group_speed(plate: Plate, omega: float) -> float:
    """d omega / d k = 2 omega / k [m/s] of the bending waves at omega [rad/s], at most c_T."""
    return min(2 * omega / wavenumber(plate, omega), shear_speed(plate))


def slenderness(plate: Plate, contact_time: float) -> float:
    """k h of the bending wave whose half period is the contact time [s]; Zener's law holds for
    k h << 1."""
    return wavenumber(plate, np.pi / contact_time) * plate.thickness
