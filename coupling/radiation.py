"""Energy that a half-space carries away from a short push at its surface.

    E = B int F'(t)^2 dt,   B = I / (2 pi mu c_T)
    I = int_0^1 -Im[ s a / R ] ds + pi s_R a(s_R) / |R'(s_R)|
    a = sqrt(s^2 - g^2),  b = sqrt(s^2 - 1),  R = (2 s^2 - 1)^2 - 4 s^2 a b,  g = c_T / c_L

from the imaginary part of Lamb's surface integral, s the slowness times c_T: body waves up to
s = 1, Rayleigh's wave at R(s_R) = 0. The contact is small against the waves. H. Lamb, Phil. Trans.
A 203 (1904) 1; G. F. Miller, H. Pursey, Proc. R. Soc. A 233 (1955) 55; S. C. Hunter, J. Mech. Phys.
Solids 5 (1957) 162.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike


class Shares(NamedTuple):
    """Parts of Lamb's integral I that go into body waves and into Rayleigh's wave."""

    body: float
    surface: float


def lamb_integral(poisson: float) -> Shares:
    """The parts of I of a half-space of a Poisson's ratio below 1/2; the surface wave takes 0.674
    of it for nu = 1/4 (Miller and Pursey)."""
    from scipy.integrate import quad  # loaded for radiated energy alone
    from scipy.optimize import brentq

    g = np.sqrt((1 - 2 * poisson) / (2 * (1 - poisson)))

    def below_longitudinal(s: float) -> float:
        """-Im[s a / R] up to s = g, where a and b are imaginary."""
        a, b = np.sqrt(g**2 - s**2), np.sqrt(1 - s**2)
        return s * a / ((2 * s**2 - 1) ** 2 + 4 * s**2 * a * b)

    def below_shear(s: float) -> float:
        """The integral from g to 1, where a is real."""
        a, b = np.sqrt(max(s**2 - g**2, 0.0)), np.sqrt(max(1 - s**2, 0.0))
        return 4 * s**3 * a**2 * b / ((2 * s**2 - 1) ** 4 + 16 * s**4 * a**2 * b**2)

    def rayleigh(s: float) -> float:
        """R beyond s = 1, 0 at the slowness of Rayleigh's wave."""
        return (2 * s**2 - 1) ** 2 - 4 * s**2 * np.sqrt((s**2 - g**2) * (s**2 - 1))

    body = quad(below_longitudinal, 0, g)[0] + quad(below_shear, g, 1)[0]
    s = brentq(rayleigh, 1 + 1e-12, 3, xtol=1e-14)
    slope = (rayleigh(s * (1 + 1e-6)) - rayleigh(s * (1 - 1e-6))) / (2e-6 * s)
    return Shares(body, float(np.pi * s * np.sqrt(s**2 - g**2) / abs(slope)))


def radiated_energy(
    t: ArrayLike, force: ArrayLike, young: float, poisson: float, density: float
) -> float:
    """Energy [J] that leaves with the waves of a force (k,) [N] at times t (k,) [s] on a
    half-space, young [Pa], density [kg/m^3]. F' is by central differences: the instants have to
    resolve the push."""
    mu = young / (2 * (1 + poisson))
    B = sum(lamb_integral(poisson)) / (2 * np.pi * mu * np.sqrt(mu / density))
    rate = np.gradient(np.asarray(force, dtype=float), t)
    return float(B * np.trapezoid(rate**2, t))
