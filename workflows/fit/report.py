"""The report of a fit: a row per parameter or number, misfits, and sentences."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import floor, log10
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from beadwave.workflows.files.record import SYNTHETIC, MeanRecord, Record
from beadwave.workflows.fit.aligned_signals import Signals
from beadwave.workflows.fit.chain_fit import CalibrationResult
from beadwave.workflows.fit.model_errors import LEAST_SHARE, NOISE, bar_by_words, shares
from beadwave.workflows.fit.parameter import Parameter
from beadwave.workflows.fit.reliability import (
    AT_BOUND,
    SHARES,
    combinations,
    identifiable,
    remarks,
)
from beadwave.workflows.report.tables import LINE, aligned_text
from beadwave.workflows.scene import OneDofWall, Scene

if TYPE_CHECKING:
    from beadwave.workflows.fit.inspect import InspectionResult


class Row(BaseModel):
    """A fitted number: a parameter of the chain and its wall, a number of the structure, or one
    that a record has for itself."""

    name: str
    unit: str
    start: float
    bounds: tuple[float, float] | None  # None if one of them is infinite
    found: float
    two_sigma: float | None  # None if the data does not determine it
    # "yes", "weakly", "no", "at its bound"; "unconfirmed" for yes and weakly, "not explained"
    identifiable: str
    bar_by: dict[str, float] = {}  # share of noise and of each model error in the bar's square
    # low, median, high of the posterior, if one was sampled and its samples are enough
    quantiles: tuple[float, float, float] | None = None


def rows_of(
    parameters: Sequence[Parameter],
    value: NDArray[np.float64],
    bars: NDArray[np.float64],
    verdicts: Sequence[str],
    causes: Mapping[str, NDArray[np.float64]],
) -> list[Row]:
    """A row per parameter; value and two-sigma bars (p,), parts of the bars (p,) by their causes.
    An infinite bar is none."""
    rows = []
    for i, (p, x, bar, verdict) in enumerate(zip(parameters, value, bars, verdicts, strict=True)):
        has_bar = bool(np.isfinite(bar))
        rows.append(
            Row(
                name=p.name,
                unit=p.unit,
                start=p.start,
                bounds=(p.low, p.high) if np.isfinite([p.low, p.high]).all() else None,
                found=float(x),
                two_sigma=float(bar) if has_bar else None,
                identifiable=verdict,
                bar_by=shares(causes, i) if has_bar else {},
            )
        )
    return rows


def _to_digits_of(bar: float | None, value: float) -> float:
    """The value without the digits beyond the second of its bar, which say nothing."""
    return round(value, 1 - floor(log10(bar))) + 0.0 if bar else value  # + 0.0: never "-0"


# columns of a table of rows
COLUMNS: dict[str, Callable[[Row], str | None]] = {
    "start": lambda row: f"{row.start:.5g}",
    "found": lambda row: f"{_to_digits_of(row.two_sigma, row.found):.6g}",
    "two sigma": lambda row: None if row.two_sigma is None else f"{row.two_sigma:.2g}",
    # quantiles as their distance from the value found
    "2.3 %": lambda row: row.quantiles and f"{row.quantiles[0] - row.found:+.2g}",
    "97.7 %": lambda row: row.quantiles and f"{row.quantiles[2] - row.found:+.2g}",
    "bounds": lambda row: row.bounds and f"{row.bounds[0]:.4g} to {row.bounds[1]:.4g}",
    "identifiable": lambda row: row.identifiable,
    "bar by": lambda row: bar_by_words(row.bar_by),
}


def _table(of: str, rows: Sequence[Row], *columns: str) -> str:
    """Aligned text of the rows; the causes of bars only if others than noise count."""
    with_unit = [f"{row.name} [{row.unit}]" if row.unit else row.name for row in rows]
    if not any(1.0 - row.bar_by.get(NOISE, 1.0) >= LEAST_SHARE for row in rows):
        columns = tuple(column for column in columns if column != "bar by")
    cells = [
        (name, *(COLUMNS[column](row) for column in columns))
        for name, row in zip(with_unit, rows, strict=True)
    ]
    return aligned_text((of, *columns), cells)


def csv_lines(rows: Sequence[Row]) -> list[str]:
    """A head and a line per row, an empty cell for what a row does not have."""

    def cell(x: float | None, digits: int = 9) -> str:
        return "" if x is None else f"{x:.{digits}g}"

    nothing = (None, None, None)
    return [
        "name,unit,start,lower_bound,upper_bound,found,two_sigma,identifiable,low,median,high",
        *(
            ",".join(
                [row.name, row.unit, cell(row.start), *map(cell, row.bounds or nothing[:2]),
                 cell(row.found), cell(row.two_sigma, 4), row.identifiable,
                 *map(cell, row.quantiles or nothing)]
            )
            for row in rows
        ),
    ]  # fmt: skip


class PosteriorSummary(BaseModel):
    """Sampling of a posterior."""

    effective_samples: float
    peaks: list[float]  # shares of the separate peaks
    model_runs: int
    seed: int
    believable: bool
    seconds: float
    shares: tuple[float, float, float] = SHARES  # of low, median and high


def _page(report: CalibrationReport | InspectionReport, *lines: str) -> str:
    """Text of a report for a terminal: its face, tables and sums, and sentences."""
    face = [SYNTHETIC] if report.synthetic else []
    remarks = (fill(remark, LINE, subsequent_indent="  ") for remark in report.remarks)
    return "\n".join([*face, *lines, *remarks])


class CalibrationReport(BaseModel):
    """Input, results and reliability of a calibration."""

    scene: str
    data: str
    title: str
    synthetic: bool
    parameters: list[Row]
    misfit_m_s: dict[str, float]
    start_misfit_m_s: dict[str, float]
    held_out_m_s: dict[str, float]
    noise_m_s: float | None
    units: dict[str, tuple[str, float]] = {}  # of sensors' signals, and what 1 m/s stands for
    repeats: int
    trigger_s: float
    combinations: list[str]
    stages: list[dict[str, Any]]
    scan_hz: list[float]
    scan_misfit_m_s: list[float]
    seconds: float
    remarks: list[str]
    posterior: PosteriorSummary | None = None

    def text(self) -> str:
        """A table, and sentences on lines that a terminal holds."""
        sampled = any(row.quantiles for row in self.parameters)
        quantiles = ("2.3 %", "97.7 %") if sampled else ()
        columns = ("start", "found", "two sigma", *quantiles, "identifiable", "bar by")

        def signal(name: str) -> str:
            return name if name in self.units else f"sphere {name}"

        def misfit(name: str, value: float) -> str:
            """A misfit [m/s] in the signal's own unit."""
            unit, scale = self.units.get(name, ("mm/s", 1e3))
            return f"{scale * value:.4g} {unit}"

        misfits = [
            f"{signal(n):>16} misfit {misfit(n, x)}, at the start "
            f"{misfit(n, self.start_misfit_m_s[n])}"
            for n, x in self.misfit_m_s.items()
        ]
        misfits += [
            f"{signal(n):>16} misfit {misfit(n, x)}, held out" for n, x in self.held_out_m_s.items()
        ]
        runs = sum(stage["evaluations"] for stage in self.stages)
        return _page(
            self, _table("parameter", self.parameters, *columns), "", *misfits, "",
            f"{runs} model runs in {self.seconds:.2f} s",
        )  # fmt: skip


def calibration_report(
    scene: Scene,
    source: str,
    measured: Record,
    fit: CalibrationResult,
    signals: Signals,
    noise: float | None,
    left_out: dict[str, float],
) -> CalibrationReport:
    """The report of a fit to a file `source`; noise is the rms of the mean signals and `left_out`
    the misfit of spheres held out [m/s]."""
    names, channels = signals.names, signals.channels
    triggers = [x for p, x in zip(fit.parameters, fit.value, strict=True) if p.kind == "trigger"]
    units = {}
    if channels:
        units = {
            name: (unit, float(scale))
            for name, unit, scale in zip(names, channels.units, channels.scale, strict=True)
        }

    # a parameter at its bound has no bar, nor has one that the data does not determine
    bars = np.where(fit.at_bound, np.inf, fit.uncertainty.two_sigma)
    verdicts = [
        AT_BOUND if at_bound else identifiable(p, x, bar, fit.confirmed)
        for p, x, bar, at_bound in zip(fit.parameters, fit.value, bars, fit.at_bound, strict=True)
    ]
    rows = rows_of(fit.parameters, fit.value, bars, verdicts, fit.causes)

    sentences = list(remarks(fit, noise, signals))
    if isinstance(scene.wall, OneDofWall):
        kinds = {p.kind for p in fit.parameters}
        if "frequency" in kinds and "mass" not in kinds:
            sentences.append(
                f"The wall's mass was held at the scene's {scene.wall.mass:g} kg: assumed."
            )
    return CalibrationReport(
        scene=scene.name,
        data=source,
        title=measured.title,
        synthetic=SYNTHETIC.split(":")[0] in measured.title,
        parameters=rows,
        misfit_m_s=dict(zip(names, map(float, fit.misfit), strict=True)),
        start_misfit_m_s=dict(zip(names, map(float, fit.start_misfit), strict=True)),
        held_out_m_s=left_out,
        noise_m_s=noise,
        units=units,
        repeats=signals.repeats,
        trigger_s=float(triggers[0]) if triggers else 0.0,
        combinations=combinations(fit),
        stages=[stage._asdict() for stage in fit.stages],
        scan_hz=[] if fit.scan is None else list(map(float, fit.scan.value)),
        scan_misfit_m_s=[] if fit.scan is None else list(map(float, fit.scan.misfit)),
        seconds=0.0,
        remarks=sentences,
    )


class InspectionReport(BaseModel):
    """Results of an inspection, their reliability, and the numbers that the records do not
    determine."""

    scene: str
    records: list[str]
    sensors: list[str]
    synthetic: bool
    numbers: list[Row]
    others: list[Row]  # of the records: velocities, triggers, gains
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
        misfit = float(np.sqrt(np.mean(np.square(self.misfit))))
        return _page(
            self,
            _table(
                "number", self.numbers, "found", "two sigma", "bounds", "identifiable", "bar by"
            ),
            "", _table("number", self.others, "found", "two sigma"), "",
            f"The model leaves {misfit:.3g} times the noise of {n} record{'s' * (n != 1)}; "
            f"{self.seconds:.1f} s.",
        )  # fmt: skip


def inspection_report(
    result: InspectionResult, records: tuple[MeanRecord, ...]
) -> InspectionReport:
    """Rows, bars over the records' length, and what there is to be said."""
    answer = result.answer
    inversion, n, between = answer.inversion, answer.n_shared, answer.between
    t, bars = answer.bars_by_length()

    bars_found = inversion.uncertainty.two_sigma
    rows = rows_of(
        inversion.parameters, inversion.value, bars_found, answer.identifiable, inversion.causes
    )
    return InspectionReport(
        scene=result.scene.name,
        records=list(answer.records),
        sensors=[channel.name for channel in records[0].channels],
        synthetic=any(record.synthetic for record in records),
        numbers=rows[:n],
        others=rows[n:],
        correlation=inversion.uncertainty.correlation[:n, :n].tolist(),
        misfit=inversion.misfit.tolist(),
        noise=[shot.noise.tolist() for shot in answer.fit.shots],
        explained=answer.explained,
        record_length_s=t.tolist(),
        two_sigma_by_length={row.name: bars[:, i].tolist() for i, row in enumerate(rows[:n])},
        walls=between.n_walls if between else 0,
        wall_missed=between.missed.frequency if between else None,
        rivals=answer.rival_numbers,
        starts=inversion.search.starts,
        seconds=result.seconds,
        remarks=list(answer.remarks()),
    )
