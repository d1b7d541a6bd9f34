"""A run's cost beside its error, and the table of them that every accuracy study leaves."""

from typing import NamedTuple

from workflows.results.tables import Table

HEADING = ("study", "method", "parameter", "setting", "error", "energy", "steps", "evaluations",
           "warm [ms]", "cold [ms]")  # fmt: skip


class Row(NamedTuple):
    """One run: what it cost and how far off it was; None where it does not apply."""

    study: str
    method: str
    parameter: float | str  # step [s], tolerance, spheres, wall modes, part
    error: float | None  # largest velocity error over the largest initial speed
    seconds: float  # warm, the least of some repeats
    energy_error: float | None = None  # largest change over the kinetic energy at the start
    steps: int | None = None
    evaluations: int | None = None  # of all contact forces
    seconds_cold: float | None = None  # the first call in this process
    setting: float | None = None  # step [s] or tolerance where `parameter` is a size


def table_of(rows: tuple[Row, ...], *, printed: bool = True) -> Table:
    """The table `accuracy`; not `printed` where another one shows the same to a person."""
    lines = (HEADING, *map(_line, rows)) if printed else ()
    return Table("accuracy", Row._fields, rows, lines)


def _line(row: Row) -> tuple:
    cold = None if row.seconds_cold is None else 1e3 * row.seconds_cold
    numbers = (row.parameter, row.setting, row.error, row.energy_error, row.steps, row.evaluations)
    return (row.study, row.method, *numbers, 1e3 * row.seconds, cold)
