"""Pictures of a fit: signals and residuals, parameters with bars, what goes together, scans."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from beadwave.workflows.files.record import SYNTHETIC
from beadwave.workflows.files.run_folder import Picture
from beadwave.workflows.fit.nested import quantiles
from beadwave.workflows.report.plots import (
    COLOURS,
    Line,
    Panel,
    correlation_map,
    drawn,
    frame,
    legend,
    log_ticks,
    png,
    residual_pairs,
    subplots,
)

if TYPE_CHECKING:
    from beadwave.workflows.fit.calibrate import CalibrationOutcome
    from beadwave.workflows.fit.inspect import InspectionResult
    from beadwave.workflows.fit.report import InspectionReport


VERDICTS = {"yes": 2, "weakly": 3, "no": 1, "at its bound": 4, "unconfirmed": 5}  # into COLOURS


def calibration_pictures(result: CalibrationOutcome) -> tuple[Picture, ...]:
    """Signals, parameters, correlation, and the scan and posterior where there are any."""
    fit, report, posterior = result.fit, result.report, result.posterior
    face = SYNTHETIC if report.synthetic else ""
    images = {
        "signals": fitted_signals(result.signals.t, fit, report, face),
        "parameters": parameters(report, face),
        "correlation": correlation(fit, face),
    }
    if report.scan_hz:
        images["scan"] = scan(report, face)
    if posterior is not None and posterior.believable:
        images["posterior"] = corner(fit, posterior, report.parameters, face)
    return tuple(Picture(name, png) for name, png in images.items())


def fitted_signals(t, fit, report, face: str) -> bytes:
    """Data, the model that it started from and the one found, two panels per signal."""
    figure, panels = residual_pairs(len(report.misfit_m_s), 2.3)
    for i, (name, (upper, lower)) in enumerate(zip(report.misfit_m_s, panels, strict=True)):
        # a sensor in its unit, a velocity in m/s, a residual in mm/s
        words, residual_words = f"sphere {name}\nvelocity [m/s]", "residual\n[mm/s]"
        scale, residual_scale = 1.0, 1e3
        if name in report.units:
            unit, scale = report.units[name]
            residual_scale = scale
            words, residual_words = f"{name}\n[{unit}]", f"residual\n[{unit}]"

        upper.plot(1e3 * t, scale * fit.data[:, i], color="0.55", linewidth=2.6, label="data")
        start = scale * fit.start[:, i]
        upper.plot(1e3 * t, start, "--", color=COLOURS[1], linewidth=1, label="start")
        model = scale * fit.model[:, i]
        upper.plot(1e3 * t, model, color=COLOURS[0], linewidth=1.1, label="calibrated")
        upper.axvspan(
            1e3 * t[0], 1e3 * fit.first_waves[i], color=COLOURS[2], alpha=0.08, linewidth=0,
            label="first waves",
        )  # fmt: skip
        upper.set_ylabel(words)
        residual = residual_scale * (fit.data[:, i] - fit.model[:, i])
        lower.plot(1e3 * t, residual, color="black", linewidth=0.6)
        lower.set_ylabel(residual_words)
        frame(upper)
        frame(lower)
    legend(panels[0][0], "above")
    lower.set_xlabel("time [ms]")
    return png(figure, face)


def scan(report, face: str) -> bytes:
    """Misfit over the wall's frequency with the chain of the first waves held."""
    f, misfit = np.array(report.scan_hz), 1e3 * np.array(report.scan_misfit_m_s)
    row = next(row for row in report.parameters if row.name == "wall.frequency")
    # 5.0: largest misfit of a scan over its least, from which on the axis is logarithmic
    wide = misfit.max() > 5.0 * misfit.min() > 0
    panel = Panel(
        "", "frequency of the wall [Hz]", "misfit of all samples, rms [mm/s]",
        [Line(None, f, misfit, "o-")], "xy" if wide else "x", None if wide else (0.0, None),
    )  # fmt: skip
    figure, (axis,) = drawn([panel], size=(8, 3.8))
    axis.axvline(row.found, color=COLOURS[1], linewidth=1, label=f"found {row.found:.4g} Hz")
    start = f"start {row.start:.4g} Hz"
    axis.axvline(row.start, color="0.5", linestyle="--", linewidth=1, label=start)
    legend(axis)
    return png(figure, face)


def parameters(report, face: str) -> bytes:
    """Contact factors with bars, and every parameter's bar relative to its size."""
    contacts = [r for r in report.parameters if r.name.startswith("contact ")]
    figure, panels = subplots(2 if contacts else 1, 1, (9, 6.2 if contacts else 3.4))

    if contacts:
        panel, place = panels[0], [int(row.name.split()[1]) for row in contacts]
        bars = [row.two_sigma or 0.0 for row in contacts]
        panel.errorbar(
            place, [row.found for row in contacts], bars, fmt="o", color=COLOURS[0], capsize=3,
            markersize=4, linewidth=1.2, label="found, two sigma",
        )  # fmt: skip
        panel.axhline(1.0, color="0.5", linewidth=0.8, linestyle="--", label="start")
        panel.set_xticks(place)
        panel.set_xlabel("contact (the last one at the wall)")
        panel.ticklabel_format(axis="y", useOffset=False)
        panel.set_ylabel("stiffness over the scene's")
        legend(panel, "above")
        frame(panel)

    # the trigger is a time on a clock, without a size of its own
    panel = panels[-1]
    rows = [r for r in report.parameters if r.two_sigma and r.name != "trigger" and r.found]
    if not rows:
        panel.text(0.5, 0.5, "no parameter has a bar", ha="center", transform=panel.transAxes)
        return png(figure, face)
    share = [100 * r.two_sigma / abs(r.found) for r in rows]
    # a colour for each verdict that there is, named where not all are identifiable
    verdicts = list(dict.fromkeys(row.identifiable for row in rows))
    for verdict in verdicts:
        of_it = [i for i, row in enumerate(rows) if row.identifiable == verdict]
        colour = COLOURS[VERDICTS.get(verdict, 3)]
        panel.bar(of_it, [share[i] for i in of_it], color=colour, label=f"identifiable: {verdict}")
    if verdicts != ["yes"]:
        legend(panel, "above")
    panel.set_yscale("log")
    panel.set_ylim(min(share) / 1.5, max(share) * 1.2)
    log_ticks(panel.yaxis, [np.array(share)], plain=False)
    panel.set_xticks(range(len(rows)), [r.name for r in rows], rotation=60, ha="right", fontsize=8)
    panel.set_ylabel("two sigma over value [%]")
    frame(panel)
    return png(figure, face)


def correlation(fit, face: str) -> bytes:
    """Correlations of the parameters, and the singular values of the scaled Jacobian."""
    names = [p.name for p in fit.parameters]
    singular = 1e3 * fit.uncertainty.singular
    panel = Panel(
        "", "combination of parameters,\nbest to least determined",
        "singular value [mm/s per scale]",
        [Line(None, np.arange(1, len(singular) + 1), singular, "o-")], "y",
    )  # fmt: skip
    shares = {"width_ratios": (1, 2.2)}
    figure, (_, matrix) = drawn([panel], columns=2, size=(5, 5.4), **shares)
    matrix.set_axis_on()
    correlation_map(matrix, fit.uncertainty.correlation, names)
    matrix.tick_params(labelsize=7)
    matrix.tick_params(axis="x", rotation=90)
    return png(figure, face)


def corner(fit, posterior, rows, face: str) -> bytes:
    """Marginals and pairs of the least determined parameters, with the Gaussian of the bars."""
    size = np.nan_to_num(fit.uncertainty.two_sigma / [p.scale for p in fit.parameters])
    # the picture of a posterior has the 4 parameters that are determined least
    chosen = np.sort(np.argsort(-size, kind="stable")[:4])
    n = len(chosen)
    figure, axes = subplots(n, n, (1.6 + 2.1 * n, 1.4 + 2.0 * n), sharex="col")
    panels = np.reshape(axes, (n, n))
    for r, i in enumerate(chosen):
        for c, j in enumerate(chosen):
            if c > r:
                panels[r, c].set_axis_off()
            elif c == r:
                _marginal(panels[r, c], rows[i], posterior.samples[:, i], posterior.weights)
            else:
                covariance = fit.uncertainty.covariance[np.ix_([j, i], [j, i])]
                samples = posterior.samples[:, [j, i]]
                _pair(panels[r, c], rows[j], rows[i], samples, posterior.weights, covariance)
        panels[-1, r].set_xlabel(_labelled(rows[i]))
        if r:
            panels[r, 0].set_ylabel(_labelled(rows[i]))
        for c in range(1, r):
            panels[r, c].tick_params(labelleft=False)
    panels[0, 0].set_ylabel("density")
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper right", frameon=False)
    return png(figure, face)


def _labelled(row) -> str:
    unit = "\N{MICRO SIGN}s" if row.unit == "s" else row.unit
    return f"{row.name} [{unit}]" if unit else f"{row.name} [-]"


def _unit_factor(row) -> float:
    """Times are plotted in microseconds."""
    return 1e6 if row.unit == "s" else 1.0


def _marginal(panel, row, samples, weights) -> None:
    """Histogram of samples (s,) of these weights (s,), their quantiles and the two-sigma bar."""
    unit = _unit_factor(row)
    # lines of the 2.3 and 97.7 % lie inside; samples of next to no weight would widen the axis
    low, high = quantiles(samples, weights, (1e-4, 1 - 1e-4))
    panel.hist(unit * samples, bins=40, range=(unit * low, unit * high), weights=weights,
               density=True, color=COLOURS[0], alpha=0.35,
               label="posterior")  # fmt: skip
    for end in (row.quantiles[0], row.quantiles[2]):
        panel.axvline(unit * end, color=COLOURS[0], linewidth=1,
                      label="its 2.3 and 97.7 %" if end is row.quantiles[0] else None)  # fmt: skip
    if row.two_sigma is not None:
        for end in (-row.two_sigma, row.two_sigma):
            panel.axvline(unit * (row.found + end), color=COLOURS[1], linestyle="--", linewidth=1,
                          label="found, two sigma" if end < 0 else None)  # fmt: skip
    panel.set_yticks([])
    _few_ticks(panel.xaxis)
    panel.spines[["top", "right", "left"]].set_visible(False)


def _pair(panel, across, up, samples, weights, covariance) -> None:
    """Histogram of samples (s, 2) of these weights (s,), and the two-sigma ellipse of the
    covariance (2, 2)."""
    x, y = _unit_factor(across), _unit_factor(up)
    ends = [quantiles(column, weights, (1e-4, 1 - 1e-4)) for column in samples.T]
    ends = [np.array(end) * unit for end, unit in zip(ends, (x, y), strict=True)]
    panel.hist2d(
        x * samples[:, 0], y * samples[:, 1], bins=30, range=ends, weights=weights, cmap="Blues"
    )
    values, vectors = np.linalg.eigh(covariance)
    angle = np.linspace(0.0, 2.0 * np.pi, 100)
    circle = np.array([np.cos(angle), np.sin(angle)])
    ellipse = 2.0 * (vectors * np.sqrt(np.maximum(values, 0.0))) @ circle
    panel.plot(x * (across.found + ellipse[0]), y * (up.found + ellipse[1]), "--", color=COLOURS[1],
               linewidth=1)  # fmt: skip
    _few_ticks(panel.xaxis)
    _few_ticks(panel.yaxis)


def _few_ticks(axis) -> None:
    axis.get_major_locator().set_params(nbins=3)
    axis.set_major_formatter("{x:.6g}")
    axis.set_tick_params(labelsize=8)


def inspection_pictures(result: InspectionResult, report: InspectionReport) -> tuple[Picture, ...]:
    """Signals, numbers, and bars over the records' length."""
    face = SYNTHETIC if report.synthetic else ""
    return (
        Picture("signals", recorded_signals(result, report, face)),
        Picture("numbers", numbers(report, face)),
        Picture("length", by_length(report, face)),
    )


def recorded_signals(result: InspectionResult, report: InspectionReport, face: str) -> bytes:
    """Records and model, and the residual over the noise; two panels per record."""
    # at most 6 records in a picture of signals
    shots, models = result.answer.fit.shots[:6], result.answer.inversion.model
    figure, panels = residual_pairs(len(shots), 2.1)
    for s, (shot, (upper, lower)) in enumerate(zip(shots, panels, strict=True)):
        for i, name in enumerate(report.sensors):
            largest = np.abs(shot.y[:, i]).max()
            upper.plot(1e3 * shot.t, shot.y[:, i] / largest, color="0.6", linewidth=2.2,
                       label="record" if i == 0 else None)  # fmt: skip
            upper.plot(1e3 * shot.t, models[s, :, i] / largest,
                       color=COLOURS[i % len(COLOURS)], linewidth=1.0, label=name)  # fmt: skip
            residual = (models[s, :, i] - shot.y[:, i]) / shot.noise[i]
            lower.plot(1e3 * shot.t, residual, color=COLOURS[i % len(COLOURS)], linewidth=0.5)
        upper.set_ylabel(f"{report.records[s][:18]}\nover largest")
        lower.set_ylabel("left\n/ noise")
        frame(upper)
        frame(lower)
    legend(panels[0][0], "above")
    lower.set_xlabel("time of the record [ms]")
    return png(figure, face)


def numbers(report: InspectionReport, face: str) -> bytes:
    """Fitted numbers with their bars between their bounds, and their correlations."""
    rows = report.numbers
    figure, (axis, matrix) = subplots(1, 2, (10, 1.8 + 0.55 * len(rows)), width_ratios=(1.6, 1))
    for i, row in enumerate(rows):
        low, high = row.bounds
        place, bar = (row.found - low) / (high - low), row.two_sigma / (high - low)
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
    """Bars of the noise alone if the records had ended earlier, over the bounds of the numbers."""
    t = 1e3 * np.array(report.record_length_s)
    lines = [
        Line(row.name, t, np.array(report.two_sigma_by_length[row.name]) / np.ptp(row.bounds))
        for row in report.numbers
    ]
    panel = Panel(
        "of the noise alone: the bars of the table hold the errors of the theory as well",
        "end of the records after the first touch [ms]", "two sigma over the bounds", lines, "y",
    )  # fmt: skip
    figure, _ = drawn([panel], size=(8, 3.8))
    return png(figure, face)
