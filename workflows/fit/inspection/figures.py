"""Pictures of an inspection: signals and residuals, bars, bars over the records' length."""

import numpy as np

from workflows.files.record import SYNTHETIC
from workflows.fit.inspection.inspect import Inspected
from workflows.fit.inspection.report import InspectionReport
from workflows.report.plots import (
    COLOURS,
    Line,
    Panel,
    correlation_map,
    drawn,
    frame,
    legend,
    png,
    residual_pairs,
    subplots,
)

MOST_RECORDS = 6  # in a picture of signals


def pictures(result: Inspected, report: InspectionReport) -> dict[str, bytes]:
    """Name to PNG."""
    face = SYNTHETIC if report.synthetic else ""
    return {
        "signals": signals(result, report, face),
        "numbers": numbers(report, face),
        "length": by_length(report, face),
    }


def signals(result: Inspected, report: InspectionReport, face: str) -> bytes:
    """Records and model, and the residual over the noise; two panels per record."""
    shots = result.fit.shots[:MOST_RECORDS]
    figure, panels = residual_pairs(len(shots), 2.1)
    for s, (shot, (upper, lower)) in enumerate(zip(shots, panels, strict=True)):
        for i, name in enumerate(report.sensors):
            largest = np.abs(shot.y[:, i]).max()
            upper.plot(1e3 * shot.t, shot.y[:, i] / largest, color="0.6", linewidth=2.2,
                       label="record" if i == 0 else None)  # fmt: skip
            upper.plot(1e3 * shot.t, result.inversion.model[s, :, i] / largest,
                       color=COLOURS[i % len(COLOURS)], linewidth=1.0, label=name)  # fmt: skip
            residual = (result.inversion.model[s, :, i] - shot.y[:, i]) / shot.noise[i]
            lower.plot(1e3 * shot.t, residual, color=COLOURS[i % len(COLOURS)], linewidth=0.5)
        upper.set_ylabel(f"{report.records[s][:18]}\nover largest")
        lower.set_ylabel("left\n/ noise")
        frame(upper)
        frame(lower)
    legend(panels[0][0], "above")
    lower.set_xlabel("time of the record [ms]")
    return png(figure, face)


def numbers(report: InspectionReport, face: str) -> bytes:
    """What was found with its bars between its bounds, and what goes together."""
    rows = report.numbers
    figure, (axis, matrix) = subplots(1, 2, (10, 1.8 + 0.55 * len(rows)), width_ratios=(1.6, 1))
    for i, row in enumerate(rows):
        place = (row.found - row.low) / (row.high - row.low)
        bar = row.two_sigma / (row.high - row.low)
        axis.errorbar(place, i, xerr=bar, fmt="o", color=COLOURS[0], capsize=4, linewidth=1.5)
        axis.text(0.5, i - 0.28, f"{row.found:.5g} +- {row.two_sigma:.2g} {row.unit}", fontsize=8,
                  ha="center")  # fmt: skip
    axis.set_yticks(range(len(rows)), [row.name for row in rows], fontsize=9)
    axis.set_ylim(len(rows) - 0.5, -0.6)
    axis.set_xlim(-0.03, 1.03)
    axis.set_xlabel("between its bounds, with two sigma")
    frame(axis)
    names = [row.name.split(".")[-1] for row in rows]
    correlation_map(matrix, np.array(report.correlation), names)
    return png(figure, face)


def by_length(report: InspectionReport, face: str) -> bytes:
    """Bars of the records if they had ended earlier, over their bounds."""
    t = 1e3 * np.array(report.record_length_s)
    lines = [
        Line(row.name, t, np.array(report.two_sigma_by_length[row.name]) / (row.high - row.low))
        for row in report.numbers
    ]
    panel = Panel(
        "", "end of the records after the first touch [ms]", "two sigma over the bounds", lines, "y"
    )
    figure, _ = drawn([panel], size=(8, 3.8))
    return png(figure, face)
