"""Numbers that a run may start from: finite, in range, as many as there should be."""

import math

import numpy as np
from numba import njit

SMALLEST, LARGEST = 5e-324, 1.7976931348623157e308  # of all positive numbers

compiled = njit(cache=True, error_model="numpy", _nrt=False)


class InvalidChain(ValueError):
    """A chain, wall or initial velocity that no run can start from."""


@compiled
def first_outside(values, lowest):
    """Index of the first value that is not finite or below the lowest; -1 if all are well."""
    for i in range(values.size):
        if not lowest <= values[i] < math.inf:
            return i
    return -1


@compiled
def weighted_square(mass, v):
    """sum m v^2."""
    total = 0.0
    for i in range(mass.size):
        total += mass[i] * v[i] * v[i]
    return total


def require(condition, sentence):
    if not condition:
        raise InvalidChain(sentence)


def vector(name, values, size, *, positive=False, at_least=None):
    try:
        values = np.array(values, float)
    except (TypeError, ValueError):
        raise InvalidChain(f"{name} is {values!r}; give {size} numbers") from None
    if values.shape != (size,):
        raise InvalidChain(f"{name} has shape {values.shape}; give {size} numbers")
    lowest = SMALLEST if positive else -LARGEST if at_least is None else at_least
    i = first_outside(values, lowest)
    if i >= 0:
        least = "" if lowest == -LARGEST else f" and at least {lowest:g}"
        allowed = "finite" + (" and above 0" if positive else least)
        raise InvalidChain(f"{name}[{i}] is {values[i]:g}; it must be {allowed}")
    return values


def scalar(name, value, *, at_least=None):
    lowest = -math.inf if at_least is None else at_least
    if not (isinstance(value, float) and math.isfinite(value) and value >= lowest):
        vector(name, np.atleast_1d(value), 1, at_least=at_least)


def above_0(name, value):
    vector(name, np.atleast_1d(value), 1, positive=True)
