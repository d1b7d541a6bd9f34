"""`beadwave accuracy`, `stability`, `verify` and `study`, the commands on evidence.

Their studies are modules of `workflows.evidence`.
"""

from pathlib import Path
from typing import Annotated

import typer

from workflows.commands.options import (
    Changes,
    Overwrite,
    Quiet,
    StudyFolder,
    UsualScene,
    case_names,
    group_names,
    json_of,
    stage_names,
    study_names,
)
from workflows.commands.terminal import StageProgress, print_lines, print_result


def accuracy(
    scene: UsualScene = None,
    stage: Annotated[
        str,
        typer.Option(
            help="time, chain-length, wall-modes, batch, parts, compile, mesh, reduction, size, "
            "peers, or all.",
            autocompletion=stage_names,
        ),
    ] = "all",
    thorough: Annotated[
        bool,
        typer.Option("--thorough", help="Leave nothing out, of one stage or of all: minutes."),
    ] = False,
    out: StudyFolder = None,
    changes: Changes = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: json_of("{rows: [{study, method, parameter, error, seconds, ...}], ...}") = False,
) -> None:
    """Error against run time, beside other integrators."""
    from workflows.evidence.accuracy.machine import machine
    from workflows.evidence.api import accuracy as measured
    from workflows.report import finding

    with StageProgress(f"accuracy {scene}", quiet=quiet) as progress:
        result = measured(
            scene, changes or (), stage=stage, thorough=thorough, out=out, overwrite=overwrite,
            progress=progress.stage,
        )  # fmt: skip
    record = finding.record(result, machine=machine()._asdict())
    print_result(record, finding.text(result), json, quiet)


CASES = (
    "joint-stiffness, rayleigh-damping, young, unlike-materials, unlike-radii, radius, "
    "striker-speed, preload, sonic-vacuum, dissipation, spheres, step, drift, time-reversal, "
    "float-extremes, wall-mode-frequency, one-dof-wall, wall-damping, dashpot-wall"
)


def stability(
    case: Annotated[
        list[str] | None,
        typer.Option(help=f"Only this case; may be repeated: {CASES}.", autocompletion=case_names),
    ] = None,
    all_trials: Annotated[
        bool, typer.Option("--all", help="Print each trial; without it a line for each case.")
    ] = False,
    out: Annotated[Path | None, typer.Option(help="Folder for the table as CSV.")] = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: json_of("{rows: [{case, parameter, verdict, value, ...}]}") = False,
) -> None:
    """Stiff and extreme cases with a verdict each."""
    from workflows.evidence.api import stability as judged
    from workflows.evidence.stability.verdicts import brief
    from workflows.report import finding

    with StageProgress("stability", quiet=quiet) as progress:
        result = judged(case or (), out=out, overwrite=overwrite, progress=progress.stage)
    text = finding.text(result if all_trials else brief(result))
    print_result(finding.record(result), text, json, quiet)


def verify(
    group: Annotated[
        list[str] | None,
        typer.Option(
            help="Only this group; may be repeated. --list names them.",
            autocompletion=group_names,
        ),
    ] = None,
    listed: Annotated[bool, typer.Option("--list", help="The groups, a line each.")] = False,
    out: Annotated[Path | None, typer.Option(help="Folder for the table as CSV.")] = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: json_of("{rows: [{group, quantity, ours, theirs, difference, ...}]}") = False,
) -> None:
    """Our results beside independent codes, published and exact ones."""
    if listed:
        _list("verify", "groups", json)
        return
    from workflows.evidence.api import verify as comparisons
    from workflows.evidence.verify.table import wrong
    from workflows.report import finding

    with StageProgress("verify", quiet=quiet) as progress:
        result = comparisons(group or (), out=out, overwrite=overwrite, progress=progress.stage)
    print_result(finding.record(result), finding.text(result), json, quiet)
    if sentence := wrong(result):
        raise ValueError(sentence)


def run_study(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME",
            help="A study; without it they are listed.",
            autocompletion=study_names,
        ),
    ] = None,
    scene: UsualScene = None,
    out: StudyFolder = None,
    changes: Changes = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: json_of("{study, rows, findings, ...}; without NAME {studies: [{name, shows}]}") = False,
) -> None:
    """Figures of the thesis computed again, and what explains them."""
    from workflows.evidence.api import study

    if name is None:
        _list("thesis", "studies", json)
        return
    from workflows.report import finding

    path = out or Path("studies")
    with StageProgress(f"study {name}", quiet=quiet) as progress:
        result = study(
            name, scene, changes or (), out=path, overwrite=overwrite, progress=progress.stage
        )
    print_result(finding.record(result, study=name), finding.text(result), json, quiet)
    for picture in result.pictures[:1]:
        print_lines(f"written: {path}/figures/{picture.name}.png", json=json, quiet=quiet)


def _list(folder: str, called: str, json: bool) -> None:
    from workflows.evidence import catalogue

    entries = catalogue.catalogue(folder).items()
    rows = [{"name": name, "shows": entry.shows} for name, entry in entries]
    print_result({called: rows}, catalogue.listing(folder), json)
