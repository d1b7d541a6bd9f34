"""What outputs depend on, as a table: Sobol's indices, or rank correlations of a sample."""

import numpy as np

from workflows.report.tables import Table
from workflows.sweep.core.design import Design
from workflows.sweep.core.effects import rank_correlations, sobol_effects

Array = np.ndarray


def effects_table(design: Design, outputs: dict[str, Array]) -> Table | None:
    """Indices, or rank correlations of a Latin hypercube, for outputs that have any."""
    if design.kind == "sobol":
        columns = ("output", "key", "first order", "+-", "total", "+-  ")
        return _table(columns, design, outputs, _sobol_rows)
    if design.kind == "lhs":
        return _table(("output", "key", "rank correlation"), design, outputs, _rank_rows)
    return None


def _table(columns, design, outputs, rows_of) -> Table | None:
    rows = tuple(row for name, y in outputs.items() for row in rows_of(design, name, y))
    return Table("effects", columns, rows) if rows else None


def _sobol_rows(design, name, y):
    try:
        found = sobol_effects(design, y)
    except ValueError:
        return
    for i, key in enumerate(design.keys):
        yield (
            name, key, float(found.first[i]), float(found.first_error[i]), float(found.total[i]),
            float(found.total_error[i]),
        )  # fmt: skip


def _rank_rows(design, name, y):
    for key, correlation in rank_correlations(design, y).items():
        yield name, key, correlation
