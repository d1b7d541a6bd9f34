"""`beadwave inspect` and `beadwave design`."""

from pathlib import Path
from typing import Annotated

import typer

from workflows.commands.options import (
    Changes,
    Overwrite,
    Quiet,
    RequiredScene,
    StudyFolder,
    dotted_keys,
    json_of,
)
from workflows.commands.terminal import StageProgress, print_lines, print_report, print_result

Find = Annotated[
    str,
    typer.Option(
        metavar="KEY,...", help="Numbers to find, keys of the scene: beam.thickness,beam.young."
    ),
]
Bounds = Annotated[
    str | None,
    typer.Option(
        metavar="KEY=LOW:HIGH,..",
        help="Where they lie, as beam.thickness=8mm:12mm; default 0.7 to 1.4 of the scene's value.",
    ),
]

Over = Annotated[
    list[str] | None,
    typer.Option(
        "--over",
        metavar="KEY=VALUES",
        help="A key that varies, as chain.count=9,17 or striker.velocity=0.2:0.5:4; may be "
        "repeated.",
        autocompletion=dotted_keys,
    ),
]


def inspect(
    scene: RequiredScene,
    data: Annotated[
        list[Path],
        typer.Argument(metavar="DATA...", help="Records of sensors, .csv, one for each impact."),
    ],
    find: Find,
    bounds: Bounds = None,
    each: Annotated[
        str | None,
        typer.Option(
            metavar="KEY=V1,V2,..",
            help="Numbers that every record has for itself, and where they start; several with "
            "semicolons, or none; default striker.velocity.",
        ),
    ] = None,
    starts: Annotated[
        int, typer.Option(help="Candidates that the search follows.", min=1, max=1000)
    ] = 12,
    seed: Annotated[int, typer.Option(help="Random seed of the starts.", min=0)] = 0,
    out: Annotated[
        Path | None, typer.Option(help="Folder for the scene found, tables and pictures.")
    ] = None,
    changes: Changes = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: json_of("the report, {numbers: [...], ...}, see report.json") = False,
) -> None:
    """Numbers of the structure from measured waves."""
    from workflows.fit.api import inspect as inspected

    with StageProgress(f"inspect {scene}", quiet=quiet) as progress:
        result = inspected(
            scene, data, changes or (), find=find, bounds=bounds, each=each, starts=starts,
            seed=seed, out=out, overwrite=overwrite, progress=progress.stage,
        )  # fmt: skip
    print_report(result.report, json, quiet)
    if out:
        print_lines(f"written: {out}/scene.toml", json=json, quiet=quiet)


def design(
    scene: RequiredScene,
    find: Find,
    bounds: Bounds = None,
    over: Over = None,
    out: StudyFolder = None,
    changes: Changes = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: json_of("{rows: [{sphere, ...}], findings: [...]}") = False,
) -> None:
    """Which sphere, chain and velocity tell a number best."""
    from workflows.fit.api import design as designed
    from workflows.report import finding

    with StageProgress(f"design {scene}", quiet=quiet) as progress:
        result = designed(
            scene, changes or (), find=find, bounds=bounds, over=over or (), out=out,
            overwrite=overwrite, progress=progress.stage,
        )  # fmt: skip
    print_result(finding.record(result), finding.text(result), json, quiet)
