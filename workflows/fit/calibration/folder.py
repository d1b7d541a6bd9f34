"""The folder of a calibration: scene, tables and figures."""

import numpy as np

from workflows.files.record import SYNTHETIC, Record, csv_text
from workflows.files.run_folder import Picture, RunFolder, write_pictures
from workflows.scene.toml import toml

FILES = ("scene.toml", "report.json", "parameters.csv", "signals.csv", "posterior.npz")
TWIN_FILES = (*FILES, "data.csv", "coverage.json")


def write(result, folder: RunFolder) -> None:
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
    write_pictures(folder, drawn(result))


def _cell(x: float | None, digits: int = 9) -> str:
    """A number in so many digits; nothing where there is none."""
    return "" if x is None else f"{x:.{digits}g}"


def drawn(result) -> tuple[Picture, ...]:
    """Signals, parameters, correlation, and the scan and posterior where there are any."""
    from workflows.fit.calibration.figures import pictures

    images = pictures(result.fit, result.signals.t, result.report, result.posterior)
    return tuple(Picture(name, png) for name, png in images.items())


def write_data(folder: RunFolder, data: Record, covered) -> None:
    """data.csv of a twin experiment, and coverage.json where there is one."""
    folder.write("data.csv", csv_text(data))
    if covered is not None:
        folder.write("coverage.json", covered.model_dump_json(indent=1) + "\n")
