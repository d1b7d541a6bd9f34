"""`beadwave accuracy`, `stability` and `study`: what is measured and made again."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from workflows.commands.options import Changes, Overwrite, SceneName, StudyFolder, json_of
from workflows.commands.terminal import StageProgress, told
from workflows.files.run_folder import RunFolder
from workflows.files.scene import DEFAULT, files_read
from workflows.files.scene import scene as load
from workflows.scene import Scene


def accuracy(
    scene: Annotated[
        str | None,
        typer.Argument(metavar="[SCENE]", help="A scene; default: the one each study is made for."),
    ] = None,
    stage: Annotated[
        str,
        typer.Option(help="time, chain-length, wall-modes, batch, parts, mesh, reduction, or all."),
    ] = "all",
    out: StudyFolder = None,
    changes: Changes = None,
    overwrite: Overwrite = False,
    json: json_of("{rows: [{study, method, parameter, error, seconds, ...}], ...}") = False,
) -> None:
    """Error against run time, compared with general-purpose integrators in the same run."""
    from workflows.studies import catalogue, finding
    from workflows.studies.accuracy.folder import FILES, write
    from workflows.studies.accuracy.machine import machine

    def scene_of(usual: str) -> Scene:
        return load(scene or usual, tuple(changes or ()))

    read = files_read(scene_of(DEFAULT), scene) if scene else ()
    folder = RunFolder(out, inputs=read, overwrite=overwrite) if out else None
    if folder:
        folder.require(*FILES)
    with StageProgress(sys.stderr) as progress:
        found = catalogue.accuracy(stage, scene_of, progress.stage)
    if folder:
        write(found, folder)
    every = finding.merged(found.values())
    told(finding.record(every, machine=machine()._asdict()), finding.text(every), json)


def stability(
    case: Annotated[list[str] | None, typer.Option(help="Only this case; may be repeated.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for the table as CSV.")] = None,
    overwrite: Overwrite = False,
    json: json_of("{rows: [{case, parameter, verdict, value, ...}]}") = False,
) -> None:
    """Stiff and extreme cases with a verdict each."""
    from workflows.studies import catalogue, finding

    folder = RunFolder(out, overwrite=overwrite) if out else None
    if folder:
        folder.require(*finding.files("stability"))
    with StageProgress(sys.stderr) as progress:
        found = catalogue.stability(tuple(case or ()), progress.stage)
    if folder:
        finding.write(found, folder)
    told(finding.record(found), finding.text(found), json)


def run_study(
    name: Annotated[
        str | None, typer.Argument(metavar="[NAME]", help="A study; without it they are listed.")
    ] = None,
    scene: SceneName = None,
    out: StudyFolder = None,
    changes: Changes = None,
    overwrite: Overwrite = False,
    json: json_of("{study, rows, findings, ...}; without NAME {studies: [{name, shows}]}") = False,
) -> None:
    """Figures of the thesis made again, each beside its cure."""
    from workflows.studies import catalogue, finding

    if name is None:
        known = catalogue.catalogue("thesis").items()
        rows = [{"name": name, "shows": entry.shows} for name, entry in known]
        told({"studies": rows}, catalogue.listing("thesis"), json)
        return
    chosen = load(scene, tuple(changes or ()))
    path = out or Path("studies")
    folder = RunFolder(path, inputs=files_read(chosen, scene), overwrite=overwrite)
    folder.require(*finding.files(name))
    with StageProgress(sys.stderr) as progress:
        found = catalogue.study(name, chosen, progress.stage)
    finding.write(found, folder, study=name)
    told(finding.record(found, study=name), finding.text(found), json)
    if not json:
        typer.echo(f"written: {path}/figures/{found.pictures[0].name}.png")
