"""Error against run time: which study a stage's name stands for, and what is left of it.

A study is a function of the scene that returns a `Study`; another one takes a line in `STUDIES`.
"""

import csv
import platform
from collections.abc import Callable
from datetime import UTC, datetime
from importlib import import_module
from io import StringIO
from json import dumps
from math import isfinite
from os import cpu_count
from pathlib import Path
from textwrap import fill
from typing import Any, NamedTuple

from workflows.run_folder import Picture, RunFolder, write_pictures
from workflows.scene import InvalidScene, Scene, nearest
from workflows.stages import LIBRARIES, Watch, library_versions


class Row(NamedTuple):
    """One run: what it cost and how far off it was; None where it does not apply."""

    study: str
    method: str
    parameter: float | str  # step [s], tolerance, spheres, wall modes, part
    error: float | None  # largest velocity error over the largest initial speed
    seconds: float  # warm, the least of some repeats
    energy_error: float | None = None  # largest change over the kinetic energy at the start
    steps: int | None = None
    evaluations: int | None = None  # of all contact forces
    seconds_cold: float | None = None  # the first call in this process
    setting: float | None = None  # step [s] or tolerance where `parameter` is a size


class Study(NamedTuple):
    """Rows, sentences for a reader, plots."""

    rows: tuple[Row, ...]
    findings: tuple[str, ...]
    pictures: tuple[Picture, ...] = ()


class Machine(NamedTuple):
    """Where and with what the times were taken."""

    processor: str
    cores: int
    system: str
    python: str
    taken: str
    libraries: dict[str, str]


class Entry(NamedTuple):
    """A study's function "module:name" and the scene it takes unless one is given."""

    function: str
    scene: str


STUDIES = {
    "time": Entry("workflows.accuracy.chain:time", "rig-rigid"),
    "chain-length": Entry("workflows.accuracy.chain:chain_length", "rig-rigid"),
    "wall-modes": Entry("workflows.accuracy.chain:wall_modes", "rig-rigid"),
    "batch": Entry("workflows.accuracy.engine:batch", "rig-rigid"),
    "parts": Entry("workflows.accuracy.engine:parts", "rig-rigid"),
    "mesh": Entry("workflows.accuracy.mesh:mesh", "rig-rom"),
    "reduction": Entry("workflows.accuracy.reduction:reduction", "rig-rom"),
}


def entries(stage: str) -> dict[str, Entry]:
    """The studies that a stage's name stands for; raises InvalidScene for an unknown one."""
    if stage == "all":
        return STUDIES
    if stage not in STUDIES:
        known = nearest(stage, ("all", *STUDIES))
        raise InvalidScene(f"--stage {stage!r} is not known; {known}.")
    return {stage: STUDIES[stage]}


def accuracy(stage: str, scene: Callable[[str], Scene], watch: Watch) -> Study:
    """The studies of a stage as one; `scene` gives the scene for a study's usual one."""
    studies = []
    for name, entry in entries(stage).items():
        module, function = entry.function.split(":")
        with watch(name):
            studies.append(getattr(import_module(module), function)(scene(entry.scene), watch))
    return Study(*(sum(parts, ()) for parts in zip(*studies, strict=True)))


def machine() -> Machine:
    """This one."""
    return Machine(
        processor=_processor(),
        cores=cpu_count() or 1,
        system=platform.platform(),
        python=platform.python_version(),
        taken=datetime.now(UTC).isoformat(timespec="seconds"),
        libraries=library_versions(("beadwave", *LIBRARIES, "scikit-sundae")),
    )


def _processor() -> str:
    """The model's name where the system tells it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def json(study: Study) -> str:
    """For machines; a number that is not finite is null."""
    rows = [{name: _finite(value) for name, value in row._asdict().items()} for row in study.rows]
    content = {"rows": rows, "findings": study.findings, "machine": machine()._asdict()}
    return dumps(content, indent=1)


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not isfinite(value) else value


def write(study: Study, out: Path) -> None:
    """accuracy.csv, accuracy.json, machine.json and figures/ into a folder."""
    folder = RunFolder(out)
    folder.make()
    folder.write("accuracy.csv", table_csv(Row._fields, study.rows))
    folder.write("accuracy.json", json(study) + "\n")
    folder.write("machine.json", dumps(machine()._asdict(), indent=1) + "\n")
    write_pictures(folder, study.pictures)


def table_csv(header: tuple[str, ...], rows: tuple[tuple, ...]) -> str:
    """Comma-separated, None as nothing."""
    text = StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return text.getvalue()


OWN_TABLE = {"reduction"}
LINE = 100
HEADER = ("study", "method", "parameter", "setting", "error", "energy", "steps", "evaluations",
          "warm [ms]", "cold [ms]")  # fmt: skip


def text(study: Study) -> str:
    """A table and the findings for a person; rows that findings tell in a table of their own stay
    out of it."""
    cells = [HEADER, *(_cells(row) for row in study.rows if row.study not in OWN_TABLE)]
    table = [aligned(cells, left=2), ""] if len(cells) > 1 else []
    return "\n".join([*table, *map(_wrapped, study.findings)])


def _wrapped(finding: str) -> str:
    """A sentence on short lines; columns, which hold double spaces, as they are."""
    return finding if "  " in finding else fill(finding, LINE, subsequent_indent="  ")


def _cells(row: Row) -> tuple[str, ...]:
    cold = None if row.seconds_cold is None else 1e3 * row.seconds_cold
    numbers = (row.parameter, row.setting, row.error, row.energy_error, row.steps, row.evaluations)
    return (row.study, row.method, *map(short, (*numbers, 1e3 * row.seconds, cold)))


def short(value: Any) -> str:
    """A number in three digits, a word as it is, nothing as a dash; no power of ten below 1e5."""
    if value is None:
        return "-"
    if not isinstance(value, float):
        return str(value)
    return f"{value:.0f}" if 999.5 <= abs(value) < 1e5 else f"{value:.3g}"


def aligned(cells: list[tuple[str, ...]], *, left: int) -> str:
    """Columns as wide as their widest cell, the first `left` of them flush left."""
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return "\n".join(
        "  ".join(
            cell.ljust(width) if i < left else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in cells
    )
