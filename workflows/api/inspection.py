"""Numbers of a structure from the waves in a chain, and the measurement that tells them best."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from workflows.api.progress import Progress, quiet
from workflows.files.run_folder import Picture, RunFolder, picture_named
from workflows.files.scene import Changes, Source, files_read
from workflows.scene import Scene
from workflows.scene.parts import with_chain

if TYPE_CHECKING:
    from workflows.inspection.inspect import Inspected
    from workflows.inspection.report import InspectionReport
    from workflows.studies.finding import Finding


@dataclass(frozen=True, repr=False)
class Inspection:
    """A scene whose numbers were found: `report.numbers` one by one with their bars, `plot()`
    signals, numbers, or bars over the records' length."""

    scene: Scene
    report: InspectionReport
    found: Inspected

    def plot(self, name: str | None = None) -> Picture:
        """signals, numbers or length; the first without a name."""
        from workflows.inspection.folder import drawn

        return picture_named(drawn(self.found, self.report), name)

    def __repr__(self) -> str:
        return self.report.text()


def inspect(
    scene: Source,
    data: str | Path | Sequence[str | Path],
    changes: Changes = (),
    *,
    out: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = quiet,
    **asked: str | int | None,
) -> Inspection:
    """Numbers of the structure found from records of sensors on the chain (`beadwave inspect`).

    `data` is a file or several, one for each impact. asked:

    find      "beam.thickness,beam.young": keys of the scene whose values are one number
    bounds    "beam.thickness=8mm:12mm"; 0.7 to 1.4 of the scene's value without
    each      "striker.velocity=0.3,0.35": numbers that every record has for itself, and where they
              start; "none" for none
    starts, seed    of the search

    `out` gets scene, tables and pictures. Raises InvalidScene for bad input.
    """
    from coupling.inspection.reading import called_apart
    from workflows.files.records import recorded
    from workflows.inspection.folder import FILES, write
    from workflows.inspection.inspect import Request, inspected
    from workflows.inspection.report import report_of
    from workflows.sweep.cases import base_of

    files = [Path(one) for one in ([data] if isinstance(data, str | Path) else data)]
    base = base_of(scene, changes)
    chosen = with_chain(base.with_values({}))
    folder = None
    if out:
        inputs = (*files_read(chosen, scene), *files)
        folder = RunFolder(Path(out), inputs=inputs, overwrite=overwrite)
    with folder.renewed(*FILES) if folder else nullcontext():
        records = called_apart(tuple(recorded(file) for file in files))
        found = inspected(base, records, Request(**asked), progress)
        report = report_of(found, records)
        if folder:
            write(found, report, folder)
    return Inspection(found.scene, report, found)


def design(
    scene: Source,
    changes: Changes = (),
    *,
    find: str,
    bounds: str | None = None,
    over: Sequence[str] = (),
    out: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = quiet,
) -> Finding:
    """Which sphere to watch, in which chain, at which velocity (`beadwave design`).

    Bars of the numbers in `find`, key by key, from each sphere alone, before anything is measured.
    `over` varies the chain, as in a sweep: ["chain.count=9,17", "striker.velocity=0.2:0.5:4"].
    `out` is a folder for the table (CSV, JSON) and the picture. Raises InvalidScene for bad input.
    """
    from workflows.inspection.design import designed
    from workflows.studies import finding
    from workflows.sweep.cases import base_of

    base = base_of(scene, changes)
    chosen = with_chain(base.with_values({}))
    folder = None
    if out:
        folder = RunFolder(Path(out), inputs=files_read(chosen, scene), overwrite=overwrite)
        folder.require(*finding.files("design"))
    found = designed(base, find, bounds, over, progress)
    if folder:
        finding.write(found, folder, scene=chosen.name, find=find)
    return found
