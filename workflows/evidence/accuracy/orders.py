"""Observed orders of the schemes: the slope of the error over the step."""

from collections.abc import Iterable

import dem
from workflows.evidence.accuracy.growth import growth_exponent
from workflows.evidence.accuracy.peers import Problem
from workflows.evidence.accuracy.problem_variants import pressed
from workflows.evidence.accuracy.row import Row
from workflows.evidence.accuracy.runs import reference, scheme_rows


def orders_closed(case: Problem) -> dict[str, float]:
    """Observed order of each scheme while all contacts are pressed shut."""
    shut = pressed(case)
    truth = reference(shut, independent=False)
    return orders(scheme_rows("order", shut, truth, dem.SCHEMES, until=2e-9), 2e-9, last=2)


def orders(rows: Iterable[Row], floor: float, last: int) -> dict[str, float]:
    """Observed order of each scheme over its `last` smallest steps of errors above the floor."""
    rows = tuple(rows)
    return {name: _order(rows, name, floor, last) for name in dem.SCHEMES}


def _order(rows: tuple[Row, ...], scheme: str, floor: float, last: int) -> float:
    """Over the smallest steps whose error stands above the floor; nan where it cannot be told."""
    clear = [row for row in rows if row.method == scheme and floor < row.error < 0.1][-last:]
    if len(clear) < 2:
        return float("nan")
    return growth_exponent((r.setting for r in clear), (r.error for r in clear))
