"""Options that several commands share."""

from pathlib import Path
from typing import Annotated, Any

import typer

SceneName = Annotated[
    str | None,
    typer.Argument(metavar="[SCENE]", help="A built-in scene or a TOML file; default: rig-rom."),
]
Changes = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Set a value of the scene by its dotted key, a unit is optional: chain.radius=5mm.",
    ),
]


def json_of(shape: str) -> Any:
    """The option --json of a command, with the shape of what it prints."""
    escaped = shape.replace("[", "\\[")  # rich takes a word in brackets for a style
    return Annotated[bool, typer.Option("--json", help=f"Print JSON: {escaped}.")]


Json = json_of("summary.json")
JsonFiles = json_of("{written: [files]}")
StudyFolder = Annotated[Path | None, typer.Option("--out", help="Folder for table, CSV and plots.")]
Overwrite = Annotated[
    bool, typer.Option("--overwrite", help="Replace existing files that beadwave did not write.")
]
