"""Effect of the known errors of a model on the numbers fitted with it.

A model that is better in one respect (smaller steps, finer elements, more modes, another theory)
shows signals f + d; records that are like it move the numbers of least squares, to first order, by

    b = (J^T J + B)^-1 J^T d,

J and d over the noise, B the information of the bounds. Beyond the first order b is what a fit to
f + d moves the numbers by. Nobody knows whether the better model is
right, so b counts as a bound of a bias: it joins the bars in quadrature, along its direction.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from beadwave.workflows.fit.uncertainty import Uncertainty, combinations

NOISE, TIME = "noise", "time"
LEAST_SHARE = 0.01  # of a cause in the square of a bar, from which on a table names it


class Forward(Protocol):
    """A model of signals that can be marched otherwise."""

    def with_steps(self, factor: float) -> "Forward":
        """The model with time steps so many times as long."""

    def with_system(self, system: object) -> "Forward":
        """The model with another chain and wall."""


class BetterModel(NamedTuple):
    """A better model than that of a fit, and how much of their difference counts as its error."""

    system: object  # what the forward model of a fit marches, a function that gives it, or a wall
    share: float
    beside: object | None = None  # the poorer of the pair; None is the model of the fit


class ModelChange(NamedTuple):
    """Change of the signals in a better model, and the part of it that counts as an error."""

    signals: NDArray[np.float64]  # as `shown` of `changes` gives them, better less usual
    share: float


def with_systems(
    models: Mapping[str, Sequence[BetterModel]], system: Callable[[object], object]
) -> dict[str, list[BetterModel]]:
    """The models by cause with `system(x)` in place of x, as a rig in place of its wall."""
    return {
        cause: [
            BetterModel(
                system(model.system),
                model.share,
                None if model.beside is None else system(model.beside),
            )
            for model in better
        ]
        for cause, better in models.items()
    }


def changes(
    forward: Forward,
    usual: NDArray[np.float64],
    shown: Callable[[Forward], NDArray[np.float64]],
    models: Mapping[str, Sequence[BetterModel]],
) -> dict[str, list[ModelChange]]:
    """By cause what better models change in the signals that `shown` computes of a forward model:
    smaller steps of time, and each of the models. `usual` is shown(forward), of any shape and
    unit. Raises what a march by one of them raises."""
    # 1 / (1 - 2**-1.5): e(h) over e(h) - e(h/2) of the order 1.5, to which a spring F ~ d^1.5 that
    # opens bounds any scheme: halved steps took the differences of a chain of 17 down by 2.9
    by_cause = {TIME: [ModelChange(shown(forward.with_steps(0.5)) - usual, 1 / (1 - 2**-1.5))]}
    for cause, better in models.items():
        by_cause[cause] = []
        for model in better:
            poorer = usual if model.beside is None else shown(forward.with_system(model.beside))
            change = shown(forward.with_system(model.system)) - poorer
            by_cause[cause].append(ModelChange(change, model.share))
    return by_cause


def widened(
    bars: Uncertainty,
    scale: NDArray[np.float64],
    biases: Mapping[str, NDArray[np.float64]],
    fixed: NDArray[np.bool_] | None = None,
) -> tuple[Uncertainty, dict[str, NDArray[np.float64]]]:
    """Bars of noise with the errors of the model that are known; and the part (p,) of the two-sigma
    bars by noise and by each error, which join in quadrature.

    `scale` (p,) is that of the numbers, `biases` by cause those (p, k) of k better models, in
    scales. Numbers that are `fixed` (p,) have no part; numbers without a bar stay without one.
    """
    causes, covariance = {NOISE: bars.two_sigma}, bars.covariance.copy()
    for cause, moved in biases.items():
        # a bias counts as two standard deviations of an error along its direction, so b b^T / 4
        b = scale[:, None] * moved
        causes[cause] = np.linalg.norm(b, axis=1)
        covariance += b @ b.T / 4.0

    free = np.ones(len(scale), bool) if fixed is None else ~fixed
    in_scales = covariance / np.outer(scale, scale)
    blind = [c.direction[free] for c in bars.combinations if not np.isfinite(c.two_sigma)]
    uncertainty = bars._replace(
        covariance=covariance,
        two_sigma=np.sqrt(sum(part**2 for part in causes.values())),
        combinations=combinations(in_scales, np.array(blind).reshape(-1, free.sum()), free),
    )
    return uncertainty, causes


def biases(
    J: NDArray[np.float64], d: NDArray[np.float64], B: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """b = (J^T J + B)^-1 J^T d (p, k) in scales: J (n, p) by numbers in scales and d (n, k) of k
    better models over the noise, B (p, p) the information of the bounds, positive semi-definite."""
    rows, known = J, d
    if B is not None:
        # B = R^T R as further rows of J: least squares has the condition of J, J^T J its square
        values, vectors = np.linalg.eigh(B)
        rows = np.vstack([J, np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T])
        known = np.vstack([d, np.zeros((len(B), d.shape[1]))])
    # 1e-12 of the largest singular value: directions below take no bias
    return np.linalg.lstsq(rows, known, rcond=1e-12)[0]


def shares(causes: Mapping[str, NDArray[np.float64]], i: int) -> dict[str, float]:
    """Share of each cause in the square of the bar of number i, from the parts (p,) of the bars;
    empty for a number without a bar."""
    squares = {cause: float(bars[i]) ** 2 for cause, bars in causes.items()}
    whole = sum(squares.values())
    if not (0.0 < whole < np.inf):
        return {}
    return {cause: square / whole for cause, square in squares.items()}


def bar_by_words(shares: Mapping[str, float]) -> str:
    """ "noise 80%, mesh 20%": the causes of a bar, the largest first."""
    causes = sorted(shares.items(), key=lambda item: -item[1])
    return ", ".join(f"{cause} {share:.0%}" for cause, share in causes if share >= LEAST_SHARE)
