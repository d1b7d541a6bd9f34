"""`beadwave inspect`."""

from pathlib import Path
from typing import Annotated

import typer

from workflows.commands.options import Changes, Overwrite, Quiet, json_of, scene_names
from workflows.commands.terminal import StageProgress, noted, shown

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


def inspect(
    scene: Annotated[
        str,
        typer.Argument(
            metavar="SCENE", help="A built-in scene or a file.", autocompletion=scene_names
        ),
    ],
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
        int, typer.Option(help="Largest number of starts of the search.", min=1, max=1000)
    ] = 6,
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
    from workflows.api.inspection import inspect as inspected

    with StageProgress(f"inspect {scene}", quiet=quiet) as progress:
        found = inspected(
            scene, data, changes or (), find=find, bounds=bounds, each=each, starts=starts,
            seed=seed, out=out, overwrite=overwrite, progress=progress.stage,
        )  # fmt: skip
    shown(found.report, json, quiet)
    if out:
        noted(f"written: {out}/scene.toml", json=json, quiet=quiet)
