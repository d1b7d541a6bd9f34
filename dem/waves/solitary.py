"""The solitary wave of equal spheres with Hertz contacts: its shape, speed and force.

    u/u_inf = (1 + tanh(f/2))/2,   f = 2.39536 a + 0.268529 a^3 + 0.0061347 a^5,   a = c t

u is the displacement of a sphere, u_inf what it is after the wave, c [spheres/s] the wave's speed,
and a the distance from the crest in spheres. The shape is that of S. Sen, M. Manciu, Phys. Rev. E
64 (2001) 056605; the factors of speed and force are those of the discrete chain (V. F. Nesterenko,
Dynamics of Heterogeneous Materials, Springer 2001, gives 0.91461 for long waves).

Hertz' law is F = A d^1.5 with A [N/m^1.5]; m [kg] is the mass of a sphere. Arguments are numbers or
arrays that broadcast against each other.
"""

import numpy as np
from numpy.typing import ArrayLike

from beadwave.dem.kernels.arguments import Array

SPEED = 0.90747  # c = SPEED (A/m)^0.4 v^0.2 [spheres/s]
FORCE = 1.01302  # peak force = FORCE A^0.4 m^0.6 v^1.2 [N]
WIDTH = 1.579  # full width at half maximum of the velocity, in spheres
F1, F3, F5 = 2.39536, 0.268529, 0.0061347  # coefficients of f
ENDS = 6.0  # spheres from the crest beyond which a wave is over: cosh(f/2)^-2 is below 1e-50 there


def speed(velocity: ArrayLike, mass: ArrayLike, A: ArrayLike) -> Array:
    """Wave speed c [spheres/s] of a wave in which spheres of a mass [kg] reach `velocity` [m/s];
    with the sign of that velocity."""
    return SPEED * np.sign(velocity) * (A / mass) ** 0.4 * np.abs(velocity) ** 0.2


def force(velocity: ArrayLike, mass: ArrayLike, A: ArrayLike) -> Array:
    """Peak contact force [N] of a wave in which spheres of a mass [kg] reach `velocity` [m/s]."""
    return FORCE * A**0.4 * mass**0.6 * np.abs(velocity) ** 1.2


def velocity_of_force(peak: ArrayLike, mass: ArrayLike, A: ArrayLike) -> Array:
    """Peak velocity [m/s] of spheres of a mass [kg] in a wave of this peak contact force [N]; the
    inverse of `force`, 0 for a tensile one."""
    return (np.maximum(peak, 0.0) / (FORCE * A**0.4 * mass**0.6)) ** (1.0 / 1.2)


def displacement_shape(a: ArrayLike) -> Array:
    """u/u_inf, from 0 ahead of the wave to 1 behind it; a = c t from the crest, in spheres."""
    return 0.5 * (1.0 + np.tanh(0.5 * _f(np.clip(a, -ENDS, ENDS))))


def velocity_shape(a: ArrayLike) -> Array:
    """Velocity of a sphere over its peak velocity; a = c t from the crest, in spheres.

    >>> bool(abs(velocity_shape(0.5 * WIDTH) - 0.5) < 2e-3)
    True
    """
    a = np.clip(a, -ENDS, ENDS)
    square = a * a
    rise = 1.0 + square * (3.0 * F3 + square * 5.0 * F5) / F1
    return rise / np.cosh(0.5 * _f(a)) ** 2


def _f(a):
    """f(a) of the module's equation."""
    square = a * a
    return a * (F1 + square * (F3 + square * F5))
