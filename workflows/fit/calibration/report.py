"""The report of a calibration: a row per parameter, misfits, and sentences."""

from textwrap import fill
from typing import Any

import numpy as np
from pydantic import BaseModel

from workflows.files.record import SYNTHETIC
from workflows.fit.core.calibration.calibration import CalibrationResult
from workflows.fit.core.calibration.judgement import SHARES, combinations, identifiable, remarks
from workflows.fit.core.calibration.signals import Signals
from workflows.report.tables import LINE, aligned_text
from workflows.scene import OneDofWall, Scene


class ParameterRow(BaseModel):
    """One parameter; `two_sigma` is None where the data does not determine it, the quantiles low,
    median and high where no posterior was asked for or its samples are too few."""

    name: str
    unit: str
    start: float
    found: float
    two_sigma: float | None
    identifiable: str  # "yes", "weakly", "no", "at its bound"
    truth: float | None = None
    low: float | None = None
    median: float | None = None
    high: float | None = None


class PosteriorSummary(BaseModel):
    """How the samples of a posterior came about; steps and autocorrelation are the walkers'."""

    walkers: int
    steps: int
    discarded: int
    autocorrelation_steps: float | None  # of the worst parameter; None where it cannot be told
    effective_samples: float
    acceptance: float
    model_runs: int
    seed: int
    long_enough: bool
    seconds: float
    shares: tuple[float, float, float] = SHARES  # of low, median and high


class CalibrationReport(BaseModel):
    """What was fitted, what came out, and how far to believe it."""

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
    coverage: dict[str, Any] | None = None

    def text(self) -> str:
        """A table, and sentences on lines that a terminal holds."""
        spheres = [
            f"{self._named(n):>16} misfit {self._shown(n, x)}, at the start "
            f"{self._shown(n, self.start_misfit_m_s[n])}"
            for n, x in self.misfit_m_s.items()
        ]
        held = [
            f"{self._named(n):>16} misfit {self._shown(n, x)}, held out"
            for n, x in self.held_out_m_s.items()
        ]
        face = [SYNTHETIC] if self.synthetic else []
        told = (fill(remark, LINE, subsequent_indent="  ") for remark in self.remarks)
        cost = f"{sum(s['evaluations'] for s in self.stages)} model runs in {self.seconds:.2f} s"
        table = _table(self.parameters)
        return "\n".join([*face, table, "", *spheres, *held, "", cost, *told])

    def _named(self, signal: str) -> str:
        return signal if signal in self.units else f"sphere {signal}"

    def _shown(self, signal: str, misfit: float) -> str:
        """A misfit [m/s] in the signal's own unit."""
        unit, scale = self.units.get(signal, ("mm/s", 1e3))
        return f"{scale * misfit:.4g} {unit}"


def _table(rows: list[ParameterRow]) -> str:
    """A line per parameter; quantiles are told as what they are off the value found."""
    sampled, known = (any(getattr(row, x) is not None for row in rows) for x in ("low", "truth"))
    quantiles, truth = ("2.3 %", "97.7 %") if sampled else (), ("truth",) if known else ()
    head = ("parameter", "start", "found", "two sigma", *quantiles, "identifiable", *truth)
    return aligned_text(head, (_cells(row, sampled, known) for row in rows))


def _cells(row: ParameterRow, sampled: bool, known: bool) -> tuple:
    name = f"{row.name} [{row.unit}]" if row.unit else row.name
    low, high = (None if x is None else f"{x - row.found:+.2g}" for x in (row.low, row.high))
    bar = None if row.two_sigma is None else f"{row.two_sigma:.2g}"
    truth = None if row.truth is None else f"{row.truth:.6g}"
    return (
        name, f"{row.start:.5g}", f"{row.found:.6g}", bar,
        *((low, high) if sampled else ()), row.identifiable, *((truth,) if known else ()),
    )  # fmt: skip


def report_of(scene, source, measured, fit, signals, noise, left_out) -> CalibrationReport:
    """The report of a fit; `left_out` is the misfit [m/s] of spheres held out."""
    names, channels = signals.names, signals.channels
    triggers = [x for p, x in zip(fit.parameters, fit.value, strict=True) if p.kind == "trigger"]
    return CalibrationReport(
        scene=scene.name,
        data=source,
        title=measured.title,
        synthetic=SYNTHETIC.split(":")[0] in measured.title,
        parameters=_rows(fit),
        misfit_m_s=dict(zip(names, map(float, fit.misfit), strict=True)),
        start_misfit_m_s=dict(zip(names, map(float, fit.start_misfit), strict=True)),
        held_out_m_s=left_out,
        noise_m_s=noise,
        units={
            name: (unit, float(scale))
            for name, unit, scale in zip(names, channels.units, channels.scale, strict=True)
        }
        if channels
        else {},
        repeats=signals.repeats,
        trigger_s=float(triggers[0]) if triggers else 0.0,
        combinations=combinations(fit),
        stages=[stage._asdict() for stage in fit.stages],
        scan_hz=[] if fit.scan is None else list(map(float, fit.scan.value)),
        scan_misfit_m_s=[] if fit.scan is None else list(map(float, fit.scan.misfit)),
        seconds=0.0,
        remarks=list(_remarks(scene, fit, noise, signals)),
    )


def _rows(fit: CalibrationResult) -> list[ParameterRow]:
    bars = np.where(fit.at_bound, np.inf, fit.uncertainty.two_sigma)
    return [
        ParameterRow(
            name=p.name,
            unit=p.unit,
            start=p.start,
            found=float(x),
            two_sigma=float(bar) if np.isfinite(bar) else None,
            identifiable="at its bound" if held else identifiable(p, x, bar),
        )
        for p, x, bar, held in zip(fit.parameters, fit.value, bars, fit.at_bound, strict=True)
    ]


def _remarks(scene: Scene, fit: CalibrationResult, noise: float | None, signals: Signals):
    yield from remarks(fit, noise, signals)
    if isinstance(scene.wall, OneDofWall):
        held = {"frequency", "mass"} - {p.kind for p in fit.parameters}
        if "mass" in held and "frequency" not in held:
            yield f"The wall's mass was held at the scene's {scene.wall.mass:g} kg: assumed."
