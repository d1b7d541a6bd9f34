"""Values of a run between the ends of its steps, at equal samples, by Hermite polynomials."""

import numpy as np

from beadwave.dem.kernels.arguments import Array
from beadwave.dem.kernels.dense import fill_slopes, fill_values


def velocities_between(x: Array, v: Array, a: Array, h: float, n_samples: int) -> Array:
    """(n_samples + 1, m) velocities at equal instants of a run by k - 1 equal steps of h [s], which
    left positions x, velocities v and accelerations a (k, m) at their ends: slopes of quintics."""
    velocities = np.empty((n_samples + 1, x.shape[1]))
    fill_slopes(np.ascontiguousarray(x), np.ascontiguousarray(v), a, h, velocities)
    return velocities


def values_between(values: Array, n_samples: int) -> Array:
    """Values (n_samples + 1,) at equally spaced instants, from values (k,) at the ends of equal
    steps, by cubics with central differences as slopes."""
    samples = np.empty(n_samples + 1)
    fill_values(np.ascontiguousarray(values), np.gradient(values), samples)
    return samples
