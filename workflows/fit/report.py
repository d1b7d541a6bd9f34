"""The report of a fit: a row per parameter or number, misfits, and sentences."""

from __future__ import annotations

from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import BaseModel

from beadwave.workflows.files.record import SYNTHETIC, MeanRecord, Record
from beadwave.workflows.fit.chain_fit import CalibrationResult
from beadwave.workflows.fit.judgement import SHARES, combinations, identifiable, remarks
from beadwave.workflows.fit.model_errors import LEAST_SHARE, NOISE, bar_by_words, shares
from beadwave.workflows.fit.signals import Signals
from beadwave.workflows.report.tables import LINE, aligned_text
from beadwave.workflows.scene import OneDofWall, Scene

if TYPE_CHECKING:
    from beadwave.workflows.fit.inspect import InspectionResult


class ParameterRow(BaseModel):
    """One parameter; `two_sigma` is None where the data does not determine it, the quantiles low,
    median and high where no posterior was asked for or its samples are too few."""

    name: str
    unit: str
    start: float
    found: float
    two_sigma: float | None
    identifiable: str  # "yes", "weakly", "no", "at its bound"; "unconfirmed" for yes and weakly
    low: float | None = None
    median: float | None = None
    high: float | None = None
    bar_by: dict[str, float] = {}  # share of noise and of each model error in the bar's square


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


def _with_unit(row: ParameterRow | NumberRow) -> str:
    """Name and unit of a row."""
    return f"{row.name} [{row.unit}]" if row.unit else row.name


class CalibrationReport(BaseModel):
    """Input, results and reliability of a calibration."""

    scene: str
    data: str
    title: str
    synthetic: bool
    parameters: list[ParameterRow]
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
        # a line per parameter; quantiles as what they are off the value found
        sampled = any(row.low is not None for row in self.parameters)
        head = ["parameter", "start", "found", "two sigma"]
        head += ["2.3 %", "97.7 %"] if sampled else []
        head.append("identifiable")
        widened = any(1.0 - row.bar_by.get(NOISE, 1.0) >= LEAST_SHARE for row in self.parameters)
        head += ["bar by"] if widened else []
        cells = []
        for row in self.parameters:
            bar = None if row.two_sigma is None else f"{row.two_sigma:.2g}"
            line = [_with_unit(row), f"{row.start:.5g}", f"{row.found:.6g}", bar]
            if sampled:
                line += [
                    None if x is None else f"{x - row.found:+.2g}" for x in (row.low, row.high)
                ]
            line.append(row.identifiable)
            if widened:
                line.append(bar_by_words(row.bar_by))
            cells.append(tuple(line))

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
            self, aligned_text(tuple(head), cells), "", *misfits, "",
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
    rows = []
    bars = np.where(fit.at_bound, np.inf, fit.uncertainty.two_sigma)
    for i, (p, x, bar, at_bound) in enumerate(
        zip(fit.parameters, fit.value, bars, fit.at_bound, strict=True)
    ):
        row = ParameterRow(
            name=p.name,
            unit=p.unit,
            start=p.start,
            found=float(x),
            two_sigma=float(bar) if np.isfinite(bar) else None,
            identifiable="at its bound" if at_bound else identifiable(p, x, bar, fit.confirmed),
            bar_by={} if at_bound else shares(fit.causes, i),
        )
        rows.append(row)

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


class NumberRow(BaseModel):
    """One number; `told` compares its bar with its bounds."""

    name: str
    unit: str
    low: float | None
    high: float | None
    found: float
    two_sigma: float
    told: str  # "yes", "weakly", "no", "at its bound"
    bar_by: dict[str, float] = {}  # share of noise and of each model error in the bar's square


class InspectionReport(BaseModel):
    """Results of an inspection, their reliability, and the numbers that the records do not
    determine."""

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
        return _page(
            self, _table(self.numbers, n_columns), "", _table(self.others, 3), "",
            f"The model leaves {misfit:.3g} times the noise of {n} record{'s' * (n != 1)}; "
            f"{self.seconds:.1f} s.",
        )  # fmt: skip


def _table(rows: list[NumberRow], n_columns: int) -> str:
    """The first columns of a table of numbers."""
    columns = ("number", "found", "two sigma", "bounds", "told", "bar by")[:n_columns]
    cells = []
    for row in rows:
        bounds = "" if row.low is None else f"{row.low:.4g} to {row.high:.4g}"
        line = (
            _with_unit(row), f"{row.found:.6g}", f"{row.two_sigma:.2g}", bounds, row.told,
            bar_by_words(row.bar_by),
        )  # fmt: skip
        cells.append(line[:n_columns])
    return aligned_text(columns, cells)


def inspection_report(
    result: InspectionResult, records: tuple[MeanRecord, ...]
) -> InspectionReport:
    """Rows, bars over the records' length, and what there is to be said."""
    judged = result.judged
    inversion, n, between = judged.inversion, judged.n_shared, judged.between
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
        noise=[shot.noise.tolist() for shot in judged.fit.shots],
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
