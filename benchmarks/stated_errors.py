"""Stated beside true errors of runs, whose truth is a march by much shorter steps."""

from collections.abc import Callable
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

ROUNDING = 1e-12  # true errors below it are rounding
COLUMNS = (
    f"{'runs':>5} {'refused':>7} {'unknown':>7} {'below':>8} {'least':>6} {'median':>7} {'95 %':>7}"
)

Run = TypeVar("Run")


def stated_over_true(
    run: Run, stated: float, finer: Callable[[int], Run], difference: Callable[[Run, Run], float],
    agreement: float, references: int = 5,
) -> float:  # fmt: skip
    """Stated over true error of a run; NaN where no two references agree.

    `finer(i)` is the i-th of so many references, each by half the steps of the last. The finer of
    the first two that differ by no more than `agreement` of the stated error stands for the truth.
    """
    coarser = None
    for i in range(references):
        reference = finer(i)
        if coarser is not None:
            limit = max(agreement * stated, ROUNDING)
            if difference(reference, coarser) <= limit:
                return max(stated, ROUNDING) / max(difference(run, reference), ROUNDING)
        coarser = reference
    return np.nan


def row(ratios: NDArray[np.float64], refused: NDArray[np.bool_]) -> str:
    """The COLUMNS of runs: stated over true errors (k,), NaN where unknown or refused (k,)."""
    known = ratios[np.isfinite(ratios)]
    unknown = len(ratios) - refused.sum() - len(known)
    least, median, high = np.quantile(known, [0.0, 0.5, 0.95]) if len(known) else [np.nan] * 3
    return (
        f"{len(ratios):5d} {refused.sum():7d} {unknown:7d} {100 * np.mean(known < 1.0):6.2f} % "
        f"{least:6.2f} {median:7.2f} {high:7.1f}"
    )
