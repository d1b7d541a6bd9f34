"""The folder of a fit: scene, tables, signals and figures."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from workflows.files.record import SYNTHETIC, Record, csv_text
from workflows.files.run_folder import Picture, RunFolder, write_pictures
from workflows.scene.toml import toml

if TYPE_CHECKING:
    from workflows.fit.inspect import Inspected
    from workflows.fit.report import InspectionReport


CALIBRATION_FILES = ("scene.toml", "report.json", "parameters.csv", "signals.csv", "posterior.npz")
TWIN_FILES = (*CALIBRATION_FILES, "data.csv", "coverage.json")


def write_calibration(result, folder: RunFolder) -> None:
    """scene.toml, report.json, parameters.csv, signals.csv and figures/ of a calibration into a
    folder, and posterior.npz where there are enough samples."""
    report, fit, signals = result.report, result.fit, result.signals
    face = f"# {SYNTHETIC}\n" if report.synthetic else ""

    # the scene as TOML, with comments on what was calibrated and how well
    comments = [
        f"# {row.name} = {f'{row.found:.6g} {row.unit}'.rstrip()} calibrated to {report.data}, "
        f"two sigma {'-' if row.two_sigma is None else format(row.two_sigma, '.2g')}, "
        f"identifiable: {row.identifiable}"
        for row in report.parameters
    ]
    factors = "# Contact factors are on contact.stiffness_factor of the scene that was fitted.\n"
    folder.write("scene.toml", face + "\n".join(comments) + "\n" + factors + toml(result.scene))
    folder.write("report.json", report.model_dump_json(indent=1) + "\n")

    lines = ["parameter,unit,start,found,two_sigma,identifiable,truth,low,median,high"]
    lines += [
        ",".join([r.name, r.unit, _cell(r.start), _cell(r.found), _cell(r.two_sigma, 4),
                  r.identifiable, *map(_cell, (r.truth, r.low, r.median, r.high))])
        for r in report.parameters
    ]  # fmt: skip
    folder.write("parameters.csv", face + "\n".join([*lines, ""]))

    # sensors in their own units, velocities in m/s
    units = report.units
    names = [f"{n} [{units[n][0]}]" if units else f"sphere {n} [m/s]" for n in signals.names]
    head = [f"{what} {name}" for what in ("data", "start", "model") for name in names]
    scale = signals.channels.scale if signals.channels else 1.0
    table = np.column_stack([signals.t, *(scale * y for y in (fit.data, fit.start, fit.model))])
    lines = [",".join(["time [s]", *head])]
    lines += [",".join(f"{x:.9g}" for x in row) for row in table]
    folder.write("signals.csv", face + "\n".join([*lines, ""]))

    # samples (s, p) in SI units, their log probability relative to the answer
    posterior = result.posterior
    if posterior is not None and report.posterior.long_enough:
        with folder.writing("posterior.npz") as path:
            np.savez_compressed(
                path,
                names=np.array([row.name for row in report.parameters]),
                units=np.array([row.unit for row in report.parameters]),
                samples=posterior.samples,
                log_probability=posterior.log_probability,
                title=np.array(report.title),
                synthetic=np.array(report.synthetic),
            )
    write_pictures(folder, calibration_drawn(result))


def _cell(x: float | None, digits: int = 9) -> str:
    """A number in so many digits; nothing where there is none."""
    return "" if x is None else f"{x:.{digits}g}"


def calibration_drawn(result) -> tuple[Picture, ...]:
    """Signals, parameters, correlation, and the scan and posterior where there are any."""
    from workflows.fit.figures import calibration_pictures

    images = calibration_pictures(result.fit, result.signals.t, result.report, result.posterior)
    return tuple(Picture(name, png) for name, png in images.items())


def write_data(folder: RunFolder, data: Record, covered) -> None:
    """data.csv of a twin experiment, and coverage.json where there is one."""
    folder.write("data.csv", csv_text(data))
    if covered is not None:
        folder.write("coverage.json", covered.model_dump_json(indent=1) + "\n")


INSPECTION_FILES = ("scene.toml", "report.json", "numbers.csv", "signals.csv")


def write_inspection(result: Inspected, report: InspectionReport, folder: RunFolder) -> None:
    """scene.toml with what was found, report.json, numbers.csv, signals.csv and figures/."""
    face = f"# {SYNTHETIC}\n" if report.synthetic else ""
    comments = "".join(
        f"# {row.name} = {row.found:.6g} {row.unit} found, two sigma {row.two_sigma:.2g}\n"
        for row in report.numbers
    )
    folder.write("scene.toml", face + comments + toml(result.scene))
    folder.write("report.json", report.model_dump_json(indent=1) + "\n")
    rows = [
        f"{row.name},{row.unit},{row.found:.9g},{row.two_sigma:.4g},{row.told}"
        for row in (*report.numbers, *report.others)
    ]
    numbers = "\n".join(["number,unit,found,two_sigma,told", *rows, ""])
    folder.write("numbers.csv", face + numbers)

    # record and model of every sensor, record after record on its own clock
    heads = [f"{what} {name}" for what in ("record of", "model of") for name in report.sensors]
    lines = [", ".join(["record", "time [s]", *heads])]
    for i, (shot, model) in enumerate(
        zip(result.fit.shots, result.inversion.model, strict=True), 1
    ):
        table = np.column_stack([shot.t, shot.y, model])
        lines += [",".join([str(i), *(f"{x:.7g}" for x in row)]) for row in table]
    folder.write("signals.csv", face + "\n".join([*lines, ""]))
    write_pictures(folder, inspection_drawn(result, report))


def inspection_drawn(result: Inspected, report: InspectionReport) -> tuple[Picture, ...]:
    """Signals, numbers, and bars over the records' length."""
    from workflows.fit.figures import inspection_pictures

    return tuple(Picture(name, png) for name, png in inspection_pictures(result, report).items())
