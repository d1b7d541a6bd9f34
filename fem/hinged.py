"""The modes of a hinged beam by Euler and Bernoulli, w = sin(k x), k = n pi / L.

omega = k^2 sqrt(E I / rho A), and phi = sqrt(2 / rho A L) sin(k p) of a strike at p.
"""

import numpy as np
from numpy.typing import NDArray

from beadwave.fem.beam import Section
from beadwave.fem.materials import Material


def euler_bernoulli(
    length: float, section: Section, material: Material, position: float, n_modes: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """omega (n,) [rad/s], phi (n,) [kg^-1/2], and the compliance [m/N] of all further modes."""
    k, rho_A = np.arange(1, n_modes + 1) * np.pi / length, material.density * section.area
    EI = material.young * section.second_moment
    omega = k**2 * np.sqrt(EI / rho_A)
    phi = np.sqrt(2 / (rho_A * length)) * np.sin(k * position)
    static = (position * (length - position)) ** 2 / (3 * EI * length)
    return omega, phi, float(static - np.sum((phi / omega) ** 2))
