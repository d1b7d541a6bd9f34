"""`beadwave accuracy`, `stability` and `study`: what is measured and made again."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from workflows.options import Changes, Json, SceneName, StudyFolder
from workflows.progress import StageProgress
from workflows.scene_file import scene as load


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
    json: Json = False,
) -> None:
    """Error against run time, beside general-purpose integrators measured in the same run."""
    from workflows.accuracy import accuracy as studies

    with StageProgress(sys.stderr) as progress:
        study = studies.accuracy(
            stage, lambda usual: load(scene or usual, tuple(changes or ())), progress.stage
        )
    if out:
        studies.write(study, out)
    typer.echo(studies.json(study) if json else studies.text(study))


def stability(
    case: Annotated[
        list[str] | None,
        typer.Option(help="Only this case; may be repeated."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for the table as CSV.")] = None,
    json: Json = False,
) -> None:
    """Stiff and extreme cases, a verdict each."""
    from workflows.stability import stability as cases

    with StageProgress(sys.stderr) as progress:
        rows = cases.stability(cases.chosen(case), progress.stage)
    if out:
        cases.write(rows, out)
    typer.echo(cases.json(rows) if json else cases.text(rows))


def run_study(
    name: Annotated[
        str | None,
        typer.Argument(metavar="[NAME]", help="A study; without it they are listed."),
    ] = None,
    scene: SceneName = None,
    out: StudyFolder = None,
    changes: Changes = None,
    json: Json = False,
) -> None:
    """Figures of the thesis made again, each beside its cure."""
    from workflows import study
    from workflows.run_folder import checked_folder

    if name is None:
        typer.echo(study.listing())
        return
    folder = checked_folder(out or Path("studies"))
    with StageProgress(sys.stderr) as progress:
        found = study.study(name, load(scene, tuple(changes or ())), progress.stage)
    study.write(found, folder)
    typer.echo(study.json(found) if json else study.text(found))
    if not json:
        typer.echo(f"written: {folder}/figures/{found.pictures[0].name}.png")
