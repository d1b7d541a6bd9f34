"""The folder of an inspection: scene, tables, signals, pictures."""

import numpy as np

from workflows.files.record import SYNTHETIC
from workflows.files.run_folder import Picture, RunFolder, write_pictures
from workflows.fit.inspection.figures import pictures
from workflows.fit.inspection.inspect import Inspected
from workflows.fit.inspection.report import InspectionReport
from workflows.scene.toml import toml

FILES = ("scene.toml", "report.json", "numbers.csv", "signals.csv")


def write(result: Inspected, report: InspectionReport, folder: RunFolder) -> None:
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
    write_pictures(folder, drawn(result, report))


def drawn(result: Inspected, report: InspectionReport) -> tuple[Picture, ...]:
    """Signals, numbers, and bars over the records' length."""
    return tuple(Picture(name, png) for name, png in pictures(result, report).items())
