"""How a run time grows with a size: what is fixed, what each adds, the exponent of the rest."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from beadwave.workflows.evidence.accuracy.row import AccuracyRow


class TimeGrowth(NamedTuple):
    """seconds = fixed + each * size, and the exponent with which seconds - fixed grows."""

    fixed: float  # [s]
    each: float  # [s] for one sphere, mode or unknown more
    exponent: float


def line(size: Iterable[float], seconds: Iterable[float]) -> TimeGrowth:
    """The straight line nearest in relative error, through 0 or above; the exponent is of the sizes
    whose time stands clear of the fixed one, nan where fewer than two do."""
    size, seconds = np.array(list(size), float), np.array(list(seconds))
    terms = np.column_stack([1.0 / seconds, size / seconds])
    fixed, each = nnls(terms, np.ones(size.size))[0]
    clear = seconds > 1.3 * fixed
    exponent = growth_exponent(size[clear], seconds[clear] - fixed) if clear.sum() > 1 else np.nan
    return TimeGrowth(float(fixed), float(each), exponent)


def growth(rows: Iterable[AccuracyRow]) -> TimeGrowth:
    """Growth of the rows' seconds over their parameter."""
    rows = list(rows)
    return line([row.parameter for row in rows], [row.seconds for row in rows])


def growths(rows: tuple[AccuracyRow, ...]) -> dict[str, TimeGrowth]:
    """Growth of each method's seconds over the parameter of its rows."""
    methods = dict.fromkeys(row.method for row in rows)
    return {name: growth(row for row in rows if row.method == name) for name in methods}


def at_one_setting(rows: Iterable[AccuracyRow], method: str) -> list[AccuracyRow]:
    """One row for each size, the first: the same setting for all."""
    first = {}
    for row in rows:
        if row.method == method:
            first.setdefault(row.parameter, row)
    return [first[size] for size in sorted(first)]


def growth_exponent(size: Iterable[float], seconds: Iterable[float]) -> float:
    """Slope of log seconds over log size by least squares."""
    return float(np.polyfit(np.log(list(size)), np.log(list(seconds)), 1)[0])
