"""What a run costs beside its error, and the table that every accuracy study leaves."""

from typing import NamedTuple

from beadwave.workflows.report.tables import Table

HEADING = ("study", "method", "parameter", "setting", "error", "energy", "steps", "evaluations",
           "warm [ms]", "cold [ms]")  # fmt: skip


class AccuracyRow(NamedTuple):
    """One run: what it cost and how far off it was; None where it does not apply."""

    study: str
    method: str
    parameter: float | str  # step [s], tolerance, spheres, wall modes, part
    error: float | None  # largest velocity error over the largest initial speed
    seconds: float  # warm, the smallest of some repeats
    energy_error: float | None = None  # largest change over the kinetic energy at the start
    steps: int | None = None
    evaluations: int | None = None  # of all contact forces
    seconds_cold: float | None = None  # the first call in this process
    setting: float | None = None  # step [s] or tolerance where `parameter` is a size or a name
    processor_seconds: float | None = None  # of the processor, warm
    processor_cold: float | None = None
    bytes: float | None = None  # largest resident set of the method's own process


def table_of(rows: tuple[AccuracyRow, ...], *, printed: bool = True) -> Table:
    """The table `accuracy`; not `printed` where another one shows the same to a person."""
    lines = [HEADING] if printed else []
    for row in rows if printed else ():
        cold = None if row.seconds_cold is None else 1e3 * row.seconds_cold
        lines.append((
            row.study, row.method, row.parameter, row.setting, row.error, row.energy_error,
            row.steps, row.evaluations, 1e3 * row.seconds, cold,
        ))  # fmt: skip
    return Table("accuracy", AccuracyRow._fields, rows, tuple(lines))
