"""The report of an inspection: a row per number, what the records leave, and sentences."""

from textwrap import fill

import numpy as np
from pydantic import BaseModel

from workflows.files.record import SYNTHETIC, Recorded
from workflows.fit.core.inspection.judgement import Judged
from workflows.fit.core.model_errors import bar_by_words, shares
from workflows.fit.inspection.inspect import Inspected
from workflows.report.tables import LINE, Table, text


class NumberRow(BaseModel):
    """One number; `told` says what its bar is beside its bounds."""

    name: str
    unit: str
    low: float | None
    high: float | None
    found: float
    two_sigma: float
    told: str  # "yes", "weakly", "no", "at its bound"
    bar_by: dict[str, float] = {}  # share of noise and of each model error in the bar's square


class InspectionReport(BaseModel):
    """What was found, how far to believe it, and what the records do not tell."""

    scene: str
    records: list[str]
    sensors: list[str]
    synthetic: bool
    numbers: list[NumberRow]
    others: list[NumberRow]  # of the records: velocities, triggers, gains
    correlation: list[list[float]]  # of the numbers
    misfit: list[list[float]]  # rms over the noise, by record and sensor
    noise: list[list[float]]  # rms, in the sensors' units
    explained: bool
    record_length_s: list[float]
    two_sigma_by_length: dict[str, list[float]]
    walls: int
    wall_missed: float | None
    rivals: list[dict[str, float]]  # other numbers that explain the records as well
    starts: int
    seconds: float
    remarks: list[str]

    def text(self) -> str:
        """Two tables, and sentences on lines that a terminal holds."""
        n = len(self.records)
        n_columns = 6 if any(row.bar_by for row in self.numbers) else 5
        misfit = float(np.sqrt(np.mean(np.square(self.misfit))))
        return "\n".join([
            *([SYNTHETIC] if self.synthetic else []),
            _table(self.numbers, n_columns), "", _table(self.others, 3), "",
            f"The model leaves {misfit:.3g} times the noise of {n} record{'s' * (n != 1)}; "
            f"{self.seconds:.1f} s.",
            *(fill(remark, LINE, subsequent_indent="  ") for remark in self.remarks),
        ])  # fmt: skip


def _table(rows: list[NumberRow], n_columns: int) -> str:
    """The first columns of a table of numbers."""
    columns = ("number", "found", "two sigma", "bounds", "told", "bar by")[:n_columns]
    cells = []
    for row in rows:
        name = f"{row.name} [{row.unit}]" if row.unit else row.name
        bounds = "" if row.low is None else f"{row.low:.4g} to {row.high:.4g}"
        line = (
            name, f"{row.found:.6g}", f"{row.two_sigma:.2g}", bounds, row.told,
            bar_by_words(row.bar_by),
        )  # fmt: skip
        cells.append(line[:n_columns])
    return text(Table("", columns, tuple(cells)))


def report_of(result: Inspected, records: tuple[Recorded, ...]) -> InspectionReport:
    """Rows, bars over the records' length, and what there is to be said."""
    inversion, n = result.inversion, result.n_shared
    between = result.structure.between
    judged = Judged(
        inversion,
        result.rivals,
        result.fit,
        n,
        result.noise_known,
        between,
        result.moved,
        tuple(record.name for record in records),
        result.no_wall,
    )
    t, bars = judged.bars_by_length()

    # gains have no upper bound: their rows show none
    rows = [
        NumberRow(
            name=p.name, unit=p.unit, found=float(x), two_sigma=float(bar),
            low=p.low if np.isfinite(p.high) else None,
            high=p.high if np.isfinite(p.high) else None,
            told=verdict,
            bar_by=shares(inversion.causes, i),
        )
        for i, (p, x, bar, verdict) in enumerate(zip(
            inversion.parameters, inversion.value, inversion.uncertainty.two_sigma, judged.told,
            strict=True,
        ))
    ]  # fmt: skip
    return InspectionReport(
        scene=result.scene.name,
        records=list(judged.records),
        sensors=[channel.name for channel in records[0].channels],
        synthetic=any(record.synthetic for record in records),
        numbers=rows[:n],
        others=rows[n:],
        correlation=inversion.uncertainty.correlation[:n, :n].tolist(),
        misfit=inversion.misfit.tolist(),
        noise=[shot.noise.tolist() for shot in result.fit.shots],
        explained=judged.explained,
        record_length_s=t.tolist(),
        two_sigma_by_length={row.name: bars[:, i].tolist() for i, row in enumerate(rows[:n])},
        walls=between.n_walls if between else 0,
        wall_missed=between.missed.frequency if between else None,
        rivals=judged.rival_numbers,
        starts=inversion.search.starts,
        seconds=result.seconds,
        remarks=list(judged.remarks()),
    )
