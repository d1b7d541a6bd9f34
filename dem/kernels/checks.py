"""Checks of numbers and contacts before a march: one pass over arrays each."""

import math

from dem.kernels.arguments import Array
from dem.kernels.compiled import ieee_entry


@ieee_entry
def first_outside(values: Array, lowest: float) -> int:
    """Index of the first value that is not finite or below the lowest; -1 if there is none."""
    for i in range(values.size):
        if not lowest <= values[i] < math.inf:
            return i
    return -1


@ieee_entry
def weighted_square(mass: Array, v: Array) -> float:
    """sum m v^2."""
    total = 0.0
    for i in range(mass.size):
        total += mass[i] * v[i] * v[i]
    return total


@ieee_entry
def fastest_contact(
    mass: Array, A: Array, force: Array, energy: float, omega: Array, phi: Array
) -> float:
    """Largest frequency [rad/s] of a contact under its static force if it took up all energy.

    Wall modes, ascending, are bodies up to the frequency of the contact and springs beyond.
    """
    n = mass.size
    fastest = 0.0
    for i in range(A.size):
        depth = (2.5 * energy / A[i]) ** 0.4 + (force[i] / A[i]) ** (2.0 / 3.0)
        stiffness = 1.5 * A[i] * math.sqrt(depth)
        inverse = 1.0 / mass[i]
        if i < n - 1:
            inverse += 1.0 / mass[i + 1]
        else:
            for j in range(omega.size):
                if omega[j] ** 2 > stiffness / mass[i]:
                    break
                inverse += phi[j] ** 2
        fastest = max(fastest, stiffness * inverse)
    return math.sqrt(fastest)
