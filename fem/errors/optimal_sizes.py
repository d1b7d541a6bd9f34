"""Sizes of elements that miss no more than an energy allowed, with the fewest unknowns.

Of regions (elements, columns or layers of them) that miss the energies e at the sizes h and cost n
unknowns, with sizes f h,

    error = sum e f^q,    unknowns = sum n f^-d,

q is the order of the error and d the number of directions in which a region is divided. The fewest
unknowns at an error allowed have f = (kappa d n / (q e))^(1 / (q + d)) with one kappa everywhere
(Zienkiewicz and Zhu, Int. J. Numer. Meth. Eng. 24 (1987) 337, of d = 2 or 3; Diez and Huerta,
Comput. Methods Appl. Mech. Eng. 177 (1999) 141, for any).

Where several errors sum e_j f^q are bounded, e = sum weight_j e_j. The weights are 0 of errors that
are below what is allowed (conditions of Karush, Kuhn and Tucker; the problem is convex in log f).
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

SMOOTH_ORDER = 4.0  # of the energy that quadratic elements miss
# at singular edges, 2 lambda from 1 on; of the element at the edge alone, those next to it are
# graded by their own energies
SINGULAR_ORDER = 2.0
COARSEST = 2.0  # times the size, from one mesh to the next
N_BISECTIONS = 60  # of kappa, over 40 decades
N_BALANCED = 60  # steps of the weights


class Regions(NamedTuple):
    """Parts of a mesh whose sizes are chosen together."""

    # (n, k) missed of each quantity that is bounded, over what is allowed of it in all
    energy: NDArray[np.float64]
    cost: NDArray[np.float64]  # (n,) unknowns that each has now
    dimension: int  # directions in which a region is divided
    order: NDArray[np.float64]  # (n,) of the error
    coarsest: float = COARSEST  # times the size, at most

    def factors(self, kappa: float, weights: NDArray[np.float64]) -> NDArray[np.float64]:
        """Times their sizes (n,), with one kappa and weights (k,) for all regions of a mesh."""
        e = np.maximum(self.energy @ weights, 1e-30)
        f = (kappa * self.dimension * self.cost / (self.order * e)) ** (
            1 / (self.order + self.dimension)
        )
        return np.minimum(f, self.coarsest)

    def errors(self, f: NDArray[np.float64]) -> NDArray[np.float64]:
        """Energies (k,) missed with sizes times f (n,), over what is allowed."""
        return f**self.order @ self.energy


def largest_kappa(holds: Callable[[float], bool]) -> float:
    """The largest kappa of which something holds that holds of all smaller ones; the smallest one
    where it holds of none."""
    low, high = -20.0, 20.0
    for _ in range(N_BISECTIONS):
        middle = (low + high) / 2
        low, high = (middle, high) if holds(10**middle) else (low, middle)
    return 10**low


def kappa_for(regions: Sequence[Regions], allowed: float, weights: NDArray[np.float64]) -> float:
    """The largest kappa with which all regions miss no more than `allowed` of any quantity."""
    return largest_kappa(
        lambda kappa: np.max(sum(r.errors(r.factors(kappa, weights)) for r in regions)) <= allowed
    )


def balanced_weights(regions: Sequence[Regions], allowed: float) -> NDArray[np.float64]:
    """Weights (k,), of the sum 1, with which the fewest unknowns miss no more than `allowed` of
    every quantity."""
    # multipliers of the conditions, weights / kappa: an error above what is allowed raises its own.
    # Of a single one it falls as its power q / (q + d), so that this converges
    multipliers = np.ones(regions[0].energy.shape[1])
    for _ in range(N_BALANCED):
        total = multipliers.sum()
        weights = multipliers / total
        errors = sum(r.errors(r.factors(1 / total, weights)) for r in regions)
        multipliers = np.maximum(multipliers * errors / allowed, 1e-30)
    return multipliers / multipliers.sum()
