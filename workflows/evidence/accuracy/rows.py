"""The table of rows that every accuracy study leaves."""

from workflows.evidence.accuracy.row import Row
from workflows.report.tables import Table

HEADING = ("study", "method", "parameter", "setting", "error", "energy", "steps", "evaluations",
           "warm [ms]", "cold [ms]")  # fmt: skip


def table_of(rows: tuple[Row, ...], *, printed: bool = True) -> Table:
    """The table `accuracy`; not `printed` where another one shows the same to a person."""
    lines = (HEADING, *map(_line, rows)) if printed else ()
    return Table("accuracy", Row._fields, rows, lines)


def _line(row: Row) -> tuple:
    cold = None if row.seconds_cold is None else 1e3 * row.seconds_cold
    numbers = (row.parameter, row.setting, row.error, row.energy_error, row.steps, row.evaluations)
    return (row.study, row.method, *numbers, 1e3 * row.seconds, cold)
