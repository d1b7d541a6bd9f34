"""Options that several commands share."""

from pathlib import Path
from typing import Annotated

import typer

SceneName = Annotated[
    str | None,
    typer.Argument(metavar="[SCENE]", help="A built-in scene or a TOML file; default: rig-rom."),
]
Changes = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change a value of the scene, dotted key."),
]
Json = Annotated[bool, typer.Option("--json", help="Print the result for machines.")]
StudyFolder = Annotated[Path | None, typer.Option("--out", help="Folder for table, CSV and plots.")]
