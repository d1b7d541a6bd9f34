"""Least squares between bounds, as every fit of this room solves it.

    minimise  |r(z)|^2 + |pull (z - centre)|^2,   low <= z <= high

by Gauss-Newton steps in a trust region (M. A. Branch, T. F. Coleman, Y. Li, SIAM J. Sci. Comput. 21
(1999) 1). The second term is what is known besides the data: a number that the data say nothing of
stays at its centre, where it would otherwise take any value.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from coupling.errors import CouplingError
from dem import InvalidChain, NoEquilibrium, UnstableStep

# what a model raises for values that cannot be marched: a run that is impossible, not an error
IMPOSSIBLE = (CouplingError, InvalidChain, NoEquilibrium, UnstableStep)
MARGIN = 1e-9  # of the bounds' distance: least_squares must begin strictly inside


class Solution(NamedTuple):
    """Where a fit ended, and whether it converged before its largest number of runs."""

    point: NDArray[np.float64]  # (p,) in the coordinates of the problem
    misfit: float  # rms of the residual, without the pull
    evaluations: int  # of the residual
    converged: bool


def solved(
    residual: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    jacobian: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    start: NDArray[np.float64],
    free: NDArray[np.bool_],
    bounds: tuple[NDArray[np.float64], NDArray[np.float64]],
    pull: NDArray[np.float64],
    centre: NDArray[np.float64],
    *,
    max_runs: int,
    tolerance: float,
) -> Solution:
    """The least misfit from z = `start` (p,) on, by `max_runs` of the model at most.

    `residual` (n,) and `jacobian` (n, p) are functions of z; what is not `free` (p,) stays where it
    starts. Ends where misfit or step fall by less than `tolerance`, relative.
    """
    low, high = (end[free] for end in bounds)
    margin = MARGIN * (high - low)
    springs = np.diag(pull[free])

    def full(x):
        """z (p,) of the free coordinates x."""
        z = start.copy()
        z[free] = x
        return z

    solution = least_squares(
        lambda x: np.concatenate([residual(full(x)), springs @ (x - centre[free])]),
        np.clip(start[free], low + margin, high - margin),
        lambda x: np.vstack([jacobian(full(x))[:, free], springs]),
        bounds=(low, high), xtol=tolerance, ftol=tolerance, gtol=1e-15, max_nfev=max_runs,
    )  # fmt: skip
    misfit = rms(solution.fun[: len(solution.fun) - len(springs)])
    return Solution(full(solution.x), misfit, solution.nfev, solution.status > 0)


def rms(residual: NDArray[np.float64]) -> float:
    """Root mean square; 0 for an empty array."""
    return float(np.sqrt(np.mean(residual**2))) if residual.size else 0.0
