"""The folder of a calibration: scene, tables and figures."""

import numpy as np

from workflows.files.record import SYNTHETIC, Record, csv_text
from workflows.files.run_folder import Picture, RunFolder, write_pictures
from workflows.fit.calibration.report import CalibrationReport
from workflows.scene.toml import toml

FILES = ("scene.toml", "report.json", "parameters.csv", "signals.csv", "posterior.npz")
TWIN_FILES = (*FILES, "data.csv", "coverage.json")


def write(found, folder: RunFolder) -> None:
    """scene.toml, parameters.csv, signals.csv, report.json and figures/ into a folder, and what
    samples there are."""
    report = found.report
    folder.write("scene.toml", _scene_text(found))
    folder.write("report.json", report.model_dump_json(indent=1) + "\n")
    folder.write("parameters.csv", _parameters_csv(report))
    folder.write("signals.csv", _signals_csv(found))
    if found.posterior is not None and report.posterior.long_enough:
        with folder.writing("posterior.npz") as part:
            np.savez_compressed(part, **_samples(found))
    write_pictures(folder, drawn(found))


def drawn(found) -> tuple[Picture, ...]:
    """Signals, parameters, correlation, and the scan and posterior where there are any."""
    from workflows.fit.calibration.figures import pictures

    each = pictures(found.fit, found.signals.t, found.report, found.posterior)
    return tuple(Picture(name, png) for name, png in each.items())


def write_data(folder: RunFolder, data: Record, covered) -> None:
    """data.csv of a twin experiment, and coverage.json where there is one."""
    folder.write("data.csv", csv_text(data))
    if covered is not None:
        folder.write("coverage.json", covered.model_dump_json(indent=1) + "\n")


def _face(report: CalibrationReport) -> str:
    return f"# {SYNTHETIC}\n" if report.synthetic else ""


def _value(row) -> str:
    return f"{row.found:.6g} {row.unit}".rstrip()


def _scene_text(found) -> str:
    """The scene as TOML, with comments on what was calibrated and how well."""
    report = found.report
    lines = [f"# {row.name} = {_value(row)} calibrated to {report.data}, "
             f"two sigma {'-' if row.two_sigma is None else format(row.two_sigma, '.2g')}, "
             f"identifiable: {row.identifiable}" for row in report.parameters]  # fmt: skip
    factors = "# Contact factors are on contact.stiffness_factor of the scene that was fitted.\n"
    return _face(report) + "\n".join(lines) + "\n" + factors + toml(found.scene)


def _cell(x: float | None, digits: int = 9) -> str:
    return "" if x is None else f"{x:.{digits}g}"


def _parameters_csv(report: CalibrationReport) -> str:
    head = "parameter,unit,start,found,two_sigma,identifiable,truth,low,median,high"
    rows = [
        ",".join([r.name, r.unit, _cell(r.start), _cell(r.found), _cell(r.two_sigma, 4),
                  r.identifiable, *map(_cell, (r.truth, r.low, r.median, r.high))])
        for r in report.parameters
    ]  # fmt: skip
    return _face(report) + "\n".join([head, *rows, ""])


def _samples(found) -> dict[str, np.ndarray]:
    """Samples (s, p) in SI units, their log probability relative to the answer, and the face."""
    return {
        "names": np.array([row.name for row in found.report.parameters]),
        "units": np.array([row.unit for row in found.report.parameters]),
        "samples": found.posterior.samples,
        "log_probability": found.posterior.log_probability,
        "title": np.array(found.report.title),
        "synthetic": np.array(found.report.synthetic),
    }


def _signals_csv(found) -> str:
    fit, signals, units = found.fit, found.signals, found.report.units
    names = [f"{n} [{units[n][0]}]" if units else f"sphere {n} [m/s]" for n in signals.names]
    head = [f"{what} {name}" for what in ("data", "start", "model") for name in names]
    scale = signals.channels.scale if signals.channels else 1.0
    table = np.column_stack([signals.t, *(scale * y for y in (fit.data, fit.start, fit.model))])
    rows = [",".join(f"{x:.9g}" for x in row) for row in table]
    return _face(found.report) + "\n".join([",".join(["time [s]", *head]), *rows, ""])
