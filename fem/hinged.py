"""The modes of a hinged beam, w = sin(k x), k = n pi / L: by Euler and Bernoulli, or by Lamb.

omega = k^2 sqrt(E I / rho A), and phi = sqrt(2 / rho A L) sin(k p) of a strike at p. Of a wide
strip, in plane strain, Lamb's antisymmetric waves stand between the ends: exact for any height (H.
Lamb, Proc. R. Soc. A 93 (1917) 114).
"""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

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


def lamb_hz(k: float, h: float, material: Material) -> float:
    """Frequency [Hz] of the lowest antisymmetric wave of the wave number k [1/m] in a strip of half
    the height h [m]; raises ValueError for a k h at which it lies outside of the range below:

    4 k^2 a b tanh(b h) = (k^2 + b^2)^2 tanh(a h), a^2 = k^2 - (omega / c_l)^2, b^2 = k^2 -
    (omega / c_t)^2: between a half and all of the thin strip's."""
    E, nu, rho = material
    c_l = np.sqrt(E * (1 - nu) / (rho * (1 + nu) * (1 - 2 * nu)))
    c_t = np.sqrt(E / (2 * rho * (1 + nu)))

    def dispersion(omega: float) -> float:
        """Difference of both sides, without their poles: both sides are multiplied out."""
        a, b = np.sqrt(k**2 - omega**2 / np.array([c_l, c_t]) ** 2)
        return 4 * k**2 * a * b * np.tanh(b * h) - (k**2 + b**2) ** 2 * np.tanh(a * h)

    thin = k**2 * h * np.sqrt(E / (3 * rho * (1 - nu**2)))
    return brentq(dispersion, 0.5 * thin, thin, xtol=1e-9 * thin) / (2 * np.pi)
