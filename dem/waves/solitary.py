"""The solitary wave of equal spheres with Hertz contacts: its shape, speed and force.

    u/u_inf = (1 + tanh(f/2))/2,   f = 2.39536 a + 0.268529 a^3 + 0.0061347 a^5,   a = c t

with the wave's speed c [spheres/s]. S. Sen, M. Manciu, Phys. Rev. E 64 (2001) 056605; the numbers
of speed and force are those of the discrete chain (V. F. Nesterenko, Dynamics of Heterogeneous
Materials, Springer 2001, gives 0.91461 for long waves).
"""

import numpy as np
from numpy.typing import ArrayLike

from dem.kernels.arguments import Array

SPEED = 0.90747  # spheres/s in (A/m)^0.4 v^0.2
FORCE = 1.01302  # peak force in A^0.4 m^0.6 v^1.2
WIDTH = 1.579  # full width at half maximum of the velocity, in spheres
F1, F3, F5 = 2.39536, 0.268529, 0.0061347
ENDS = 6.0  # a wave is over this many spheres from its crest


def speed(velocity: ArrayLike, mass: ArrayLike, A: ArrayLike) -> Array:
    """c [spheres/s] of the wave whose spheres reach `velocity` [m/s], signed like it."""
    return SPEED * np.sign(velocity) * (A / mass) ** 0.4 * np.abs(velocity) ** 0.2


def force(velocity: ArrayLike, mass: ArrayLike, A: ArrayLike) -> Array:
    """Peak contact force [N] of the wave whose spheres reach `velocity` [m/s]."""
    return FORCE * A**0.4 * mass**0.6 * np.abs(velocity) ** 1.2


def velocity_of_force(peak: ArrayLike, mass: ArrayLike, A: ArrayLike) -> Array:
    """Peak velocity [m/s] of the spheres in a wave of this peak contact force [N]."""
    return (np.maximum(peak, 0.0) / (FORCE * A**0.4 * mass**0.6)) ** (1.0 / 1.2)


def displacement_shape(a: ArrayLike) -> Array:
    """Share of its way that a sphere has gone, 0 to 1; a = c t from the crest, in spheres."""
    return 0.5 * (1.0 + np.tanh(0.5 * _f(np.clip(a, -ENDS, ENDS))))


def velocity_shape(a: ArrayLike) -> Array:
    """Velocity of a sphere over its largest; a = c t from the crest, in spheres.

    >>> bool(abs(velocity_shape(0.5 * WIDTH) - 0.5) < 2e-3)
    True
    """
    a = np.clip(a, -ENDS, ENDS)
    square = a * a
    rise = 1.0 + square * (3.0 * F3 + square * 5.0 * F5) / F1
    return rise / np.cosh(0.5 * _f(a)) ** 2


def _f(a):
    square = a * a
    return a * (F1 + square * (F3 + square * F5))
