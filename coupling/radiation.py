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
    """I of a half-space; the surface wave takes 0.674 of it for nu = 1/4 (Miller and Pursey)."""
    from scipy.integrate import quad  # loaded by who asks for radiated energy alone

    g = np.sqrt((1 - 2 * poisson) / (2 * (1 - poisson)))
    slow = quad(_below_longitudinal, 0, g, args=(g,))[0]
    fast = quad(_below_shear, g, 1, args=(g,))[0]
    return Shares(slow + fast, _surface(g))


def _below_longitudinal(s: float, g: float) -> float:
    a, b = np.sqrt(g**2 - s**2), np.sqrt(1 - s**2)
    return s * a / ((2 * s**2 - 1) ** 2 + 4 * s**2 * a * b)


def _below_shear(s: float, g: float) -> float:
    a, b = np.sqrt(max(s**2 - g**2, 0.0)), np.sqrt(max(1 - s**2, 0.0))
    return 4 * s**3 * a**2 * b / ((2 * s**2 - 1) ** 4 + 16 * s**4 * a**2 * b**2)


def _surface(g: float) -> float:
    from scipy.optimize import brentq

    s = brentq(_rayleigh, 1 + 1e-12, 3, args=(g,), xtol=1e-14)
    slope = (_rayleigh(s * (1 + 1e-6), g) - _rayleigh(s * (1 - 1e-6), g)) / (2e-6 * s)
    return float(np.pi * s * np.sqrt(s**2 - g**2) / abs(slope))


def _rayleigh(s: float, g: float) -> float:
    return (2 * s**2 - 1) ** 2 - 4 * s**2 * np.sqrt((s**2 - g**2) * (s**2 - 1))


def radiated_energy(
    t: ArrayLike, force: ArrayLike, young: float, poisson: float, density: float
) -> float:
    """Energy [J] that leaves with the waves of a force (k,) [N] at times t (k,) [s]."""
    mu = young / (2 * (1 + poisson))
    B = sum(lamb_integral(poisson)) / (2 * np.pi * mu * np.sqrt(mu / density))
    rate = np.gradient(np.asarray(force, dtype=float), t)
    return float(B * np.trapezoid(rate**2, t))
