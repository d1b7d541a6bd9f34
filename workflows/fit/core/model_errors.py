"""What the known errors of a model do to numbers that are found with it.

A model that is better in one respect (smaller steps, finer elements, more modes, another theory)
shows signals f + d; records that are like it move the numbers of least squares, to first order, by

    b = (J^T J + B)^-1 J^T d,

J and d over the noise, B the information of the bounds. Nobody knows whether the better model is
right, so b counts as a bound of a bias: it joins the bars in quadrature, along its direction.
"""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflows.fit.core.calibration.uncertainty import Uncertainty, combinations

NOISE, TIME = "noise", "time"
# e(h) over e(h) - e(h/2) of the order 1.5, to which a spring F ~ d^1.5 that opens bounds any
# scheme: halved steps took the differences of a chain of 17 down by 2.9
TIME_SHARE = 1 / (1 - 2**-1.5)
LEAST_SHARE = 0.01  # of a cause in the square of a bar, from which on a table names it
UNDETERMINED = 1e-12  # of the largest singular value: directions below take no bias


class BetterModel(NamedTuple):
    """A model beside the one of a fit, and how much of their difference counts as its error."""

    system: object  # what the forward model of a fit marches, or a function that gives it
    share: float
    beside: object | None = None  # the poorer of the pair; None is the model of the fit


class WidenedBars(NamedTuple):
    """Bars that hold the errors of a model, and what makes them."""

    uncertainty: Uncertainty
    # part (p,) of the two-sigma bars by noise and by each error, which join in quadrature
    causes: Mapping[str, NDArray[np.float64]] = MappingProxyType({})
    left: NDArray[np.float64] | float = 0.0  # (n,) what no numbers take up of the errors


def widened(
    bars: Uncertainty,
    scale: NDArray[np.float64],
    J: NDArray[np.float64],
    differences: Mapping[str, Sequence[NDArray[np.float64]]],
    *,
    B: NDArray[np.float64] | None = None,
    fixed: NDArray[np.bool_] | None = None,
) -> WidenedBars:
    """Bars (p,) of noise with the errors of the model that are known.

    `scale` (p,) is that of the numbers, J (n, p) the derivatives of n samples by numbers in scales,
    `differences` by cause those of better models (n,), as J over the noise and times the share that
    counts; B (p, p) the information of the bounds, positive semi-definite. Numbers that are `fixed`
    (p,) take no part; numbers without a bar stay without one.
    """
    free = np.ones(len(scale), bool) if fixed is None else ~fixed
    J = np.where(free, J, 0.0)
    B = np.zeros((len(scale),) * 2) if B is None else B

    causes, covariance = {NOISE: bars.two_sigma}, bars.covariance.copy()
    squares = np.zeros(len(J))
    for cause, better in differences.items():
        moved, rest = biases(J, np.array(better).T, B)
        squares += np.sum(rest**2, axis=1)
        b = scale[:, None] * moved
        causes[cause] = np.linalg.norm(b, axis=1)
        covariance += b @ b.T / 4.0

    in_scales = covariance / np.outer(scale, scale)
    blind = [c.direction[free] for c in bars.combinations if not np.isfinite(c.two_sigma)]
    uncertainty = bars._replace(
        covariance=covariance,
        two_sigma=np.sqrt(sum(part**2 for part in causes.values())),
        combinations=combinations(in_scales, np.array(blind).reshape(-1, free.sum()), free),
    )
    return WidenedBars(uncertainty, causes, np.sqrt(squares))


def biases(
    J: NDArray[np.float64], d: NDArray[np.float64], B: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """b = (J^T J + B)^-1 J^T d (p, k) of J (n, p) and d (n, k), and what numbers moved by it leave
    of d, (n, k)."""
    values, vectors = np.linalg.eigh(B)
    pull = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    rows = np.vstack([J, pull])
    b = np.linalg.lstsq(rows, np.vstack([d, np.zeros((len(B), d.shape[1]))]), rcond=UNDETERMINED)[0]
    return b, d - J @ b


def shares(causes: Mapping[str, NDArray[np.float64]], i: int) -> dict[str, float]:
    """Share of each cause in the square of the bar of number i; none of a number without a bar."""
    squares = {cause: float(bars[i]) ** 2 for cause, bars in causes.items()}
    whole = sum(squares.values())
    if not (0.0 < whole < np.inf):
        return {}
    return {cause: square / whole for cause, square in squares.items()}


def bar_by_words(shares: Mapping[str, float]) -> str:
    """ "noise 80%, mesh 20%": the causes of a bar, the largest first."""
    causes = sorted(shares.items(), key=lambda item: -item[1])
    return ", ".join(f"{cause} {share:.0%}" for cause, share in causes if share >= LEAST_SHARE)
