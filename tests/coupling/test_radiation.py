"""Energy that waves carry away from a push: Lamb's integral on another path, and known pulses."""

import numpy as np
import pytest
from scipy.integrate import quad

from beadwave.coupling.radiation import lamb_integral, radiated_energy

RATIOS = (0.0, 0.17, 0.25, 0.33, 0.45)


@pytest.mark.parametrize("poisson", RATIOS)
def test_lambs_integral_is_that_below_the_real_slownesses(poisson):
    """-Im int s a / R ds by a path that leaves branch points and Rayleigh's pole above it."""
    g = np.sqrt((1 - 2 * poisson) / (2 * (1 - poisson)))

    def along(x):
        s, ds = x - 0.3j * np.sin(np.pi * x / 3), 1 - 0.1j * np.pi * np.cos(np.pi * x / 3)
        a, b = np.sqrt(s**2 - g**2), np.sqrt(s**2 - 1)
        return -(s * a / ((2 * s**2 - 1) ** 2 - 4 * s**2 * a * b) * ds).imag

    exact = quad(along, 0, 3, epsabs=1e-11, limit=400)[0]
    result = lamb_integral(poisson)
    assert sum(result) == pytest.approx(exact, rel=1e-6)


@pytest.mark.parametrize("poisson", RATIOS)
def test_the_surface_wave_takes_the_residue_at_its_slowness(poisson):
    """1 / s^2 is the root of x^3 - 8 x^2 + (24 - 16 g^2) x - 16 (1 - g^2) below 1."""
    g2 = (1 - 2 * poisson) / (2 * (1 - poisson))
    x = min(r.real for r in np.roots([1, -8, 24 - 16 * g2, -16 * (1 - g2)]) if abs(r.imag) < 1e-9)
    s = x**-0.5
    a, b = np.sqrt(s**2 - g2), np.sqrt(s**2 - 1)
    slope = 8 * s * (2 * s**2 - 1) - 8 * s * a * b - 4 * s**3 * (b / a + a / b)
    assert lamb_integral(poisson).surface == pytest.approx(np.pi * s * a / abs(slope), rel=1e-6)


def test_the_surface_wave_takes_two_thirds():
    """G. F. Miller, H. Pursey, Proc. R. Soc. A 233 (1955) 55: 67.4 % for nu = 1/4."""
    body, surface = lamb_integral(0.25)
    assert surface / (body + surface) == pytest.approx(0.674, abs=5e-4)


def test_a_gaussian_pulse_radiates_by_the_square_of_its_rate():
    """int F'^2 dt = sqrt(pi / 2) F^2 / tau of F exp(-(t / tau)^2)."""
    tau, F, young, poisson, density = 2e-5, 300.0, 70e9, 0.33, 2700.0
    t = np.linspace(-6 * tau, 6 * tau, 4001)
    mu = young / (2 * (1 + poisson))
    square = np.sqrt(np.pi / 2) * F**2 / tau
    exact = sum(lamb_integral(poisson)) / (2 * np.pi * mu * np.sqrt(mu / density)) * square
    result = radiated_energy(t + 1.0, F * np.exp(-((t / tau) ** 2)), young, poisson, density)
    assert result == pytest.approx(exact, rel=1e-4)
