"""The folder of a fit: scene, tables, signals and figures."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from beadwave.workflows.files.record import SYNTHETIC
from beadwave.workflows.files.run_folder import Picture, RunFolder, write_pictures
from beadwave.workflows.fit.report import Row, csv_lines
from beadwave.workflows.scene.toml import toml

if TYPE_CHECKING:
    from beadwave.workflows.fit.calibrate import CalibrationOutcome
    from beadwave.workflows.fit.inspect import InspectionResult
    from beadwave.workflows.fit.report import CalibrationReport, InspectionReport

CALIBRATION_FILES = ("scene.toml", "report.json", "parameters.csv", "signals.csv", "posterior.npz")
INSPECTION_FILES = ("scene.toml", "report.json", "numbers.csv", "signals.csv")


def write_calibration(result: CalibrationOutcome, folder: RunFolder) -> None:
    """scene.toml, report.json, parameters.csv, signals.csv and figures/ of a calibration into a
    folder, and posterior.npz where there are enough samples."""
    from beadwave.workflows.fit.fit_pictures import calibration_pictures

    report, fit, signals = result.report, result.fit, result.signals

    # sensors in their own units, velocities in m/s
    units = report.units
    names = [f"{n} [{units[n][0]}]" if units else f"sphere {n} [m/s]" for n in signals.names]
    heads = [f"{what} {name}" for what in ("data", "start", "model") for name in names]
    scale = signals.channels.scale if signals.channels else 1.0
    rows = np.column_stack([signals.t, *(scale * y for y in (fit.data, fit.start, fit.model))])
    lines = [",".join(["time [s]", *heads]), *(",".join(f"{x:.9g}" for x in row) for row in rows)]

    posterior = result.posterior
    if posterior is not None and posterior.believable:
        # samples (s, p) in SI units, their weights and log probability relative to the answer
        with folder.writing("posterior.npz") as path:
            np.savez_compressed(
                path,
                names=np.array([row.name for row in report.parameters]),
                units=np.array([row.unit for row in report.parameters]),
                samples=posterior.samples,
                weights=posterior.weights,
                log_probability=posterior.log_probability,
                title=np.array(report.title),
                synthetic=np.array(report.synthetic),
            )
    factors = "# Contact factors are on contact.stiffness_factor of the scene that was fitted."
    scene = [*_comments(report.parameters, report.data), factors, toml(result.scene)]
    tables = {"parameters.csv": csv_lines(report.parameters), "signals.csv": lines}
    _write(folder, report, scene, tables, calibration_pictures(result))


def write_inspection(result: InspectionResult, report: InspectionReport, folder: RunFolder) -> None:
    """scene.toml with what was found, report.json, numbers.csv, signals.csv and figures/."""
    from beadwave.workflows.fit.fit_pictures import inspection_pictures

    # record and model of every sensor, record after record on its own clock
    heads = [f"{what} {name}" for what in ("record of", "model of") for name in report.sensors]
    lines = [", ".join(["record", "time [s]", *heads])]
    shots, models = result.answer.fit.shots, result.answer.inversion.model
    for i, (shot, model) in enumerate(zip(shots, models, strict=True), 1):
        rows = np.column_stack([shot.t, shot.y, model])
        lines += [",".join([str(i), *(f"{x:.7g}" for x in row)]) for row in rows]
    tables = {"numbers.csv": csv_lines([*report.numbers, *report.others]), "signals.csv": lines}
    scene = [*_comments(report.numbers, ", ".join(report.records)), toml(result.scene)]
    _write(folder, report, scene, tables, inspection_pictures(result, report))


def _comments(rows: Iterable[Row], data: str) -> list[str]:
    """A line of a scene for each number that was fitted to `data`."""
    return [
        f"# {row.name} = {f'{row.found:.6g} {row.unit}'.rstrip()} fitted to {data}, two sigma "
        f"{'-' if row.two_sigma is None else format(row.two_sigma, '.2g')}, identifiable: "
        f"{row.identifiable}"
        for row in rows
    ]


def _write(
    folder: RunFolder,
    report: CalibrationReport | InspectionReport,
    scene: list[str],
    tables: dict[str, list[str]],
    pictures: Iterable[Picture],
) -> None:
    """scene.toml and tables of these lines, report.json and figures/."""
    face = f"# {SYNTHETIC}\n" if report.synthetic else ""
    folder.write("scene.toml", face + "\n".join(scene))
    folder.write("report.json", report.model_dump_json(indent=1) + "\n")
    for name, lines in tables.items():
        folder.write(name, face + "\n".join([*lines, ""]))
    write_pictures(folder, tuple(pictures))
