"""Closed forms of a contact with friction under a constant load: what a cycle takes and how far it
goes (K. L. Johnson, Contact Mechanics, Cambridge 1985, sec. 7.4)."""

from beadwave.dem.friction import stick_stiffness
from beadwave.dem.kernels.tangential import TangentialLaw


def loop_energy(law: TangentialLaw, mu_P: float, amplitude: float, a: float) -> float:
    """Energy [J] of a cycle of the tangential force +-amplitude under constant load, up to
    amplitude = mu P [N] (Johnson, 7.57); a is the contact's radius [m].

    36/5 (mu P)^2 / k [1 - (1 - q)^(5/3) - 5/6 q (1 + (1 - q)^(2/3))],   q = Q*/mu P,   k = 2 a G*
    """
    q, k = amplitude / mu_P, float(stick_stiffness(law, a))
    bracket = 1.0 - (1.0 - q) ** (5.0 / 3.0) - 5.0 / 6.0 * q * (1.0 + (1.0 - q) ** (2.0 / 3.0))
    return 7.2 * mu_P**2 / k * bracket


def loop_amplitude(law: TangentialLaw, mu_P: float, amplitude: float, a: float) -> float:
    """Displacement [m] at the tips of such a cycle: 3 mu P / 2 k [1 - (1 - q)^(2/3)]."""
    q, k = amplitude / mu_P, float(stick_stiffness(law, a))
    return 1.5 * mu_P / k * (1.0 - (1.0 - q) ** (2.0 / 3.0))
