"""Options that several commands share, and what a shell completes them with."""

from typing import Annotated, Any

import typer


def scene_names(incomplete: str) -> list[str]:
    """Built-in scenes that begin so; a shell completes files by itself."""
    from beadwave.workflows.files.scene import built_in

    return [name for name in built_in() if name.startswith(incomplete)]


def dotted_keys(ctx: typer.Context, incomplete: str) -> list[str]:
    """Keys of the scene that is named, up to the sign of equality."""
    from beadwave.workflows.files.scene import keys
    from beadwave.workflows.scene import InvalidScene

    # a line that ends in an option without its value leaves the words before it among the others
    scene = ctx.params.get("scene") or next((word for word in ctx.args if word[:1] != "-"), None)
    try:
        return [f"{key}=" for key in keys(scene) if key.startswith(incomplete)]
    except InvalidScene:
        return []


def stage_names(incomplete: str) -> list[str]:
    """Studies of accuracy that begin so."""
    return _names("accuracy", incomplete)


def case_names(incomplete: str) -> list[str]:
    """Cases of stability that begin so."""
    return _names("stability", incomplete)


def group_names(incomplete: str) -> list[str]:
    """Groups of comparisons that begin so."""
    return _names("verify", incomplete)


def _names(folder: str, incomplete: str) -> list[str]:
    from beadwave.workflows.evidence.groups import names

    return [name for name in names(folder) if name.startswith(incomplete)]


def json_of(shape: str) -> Any:
    """The option --json of a command, with the shape of what it prints."""
    return Annotated[bool, typer.Option("--json", help=f"Print JSON: {shape}.")]


JsonFiles = json_of("{written: [files]}")
Overwrite = Annotated[
    bool,
    typer.Option(
        "--overwrite", help="Replace files beadwave did not write or that were changed since."
    ),
]
Verbose = Annotated[
    bool, typer.Option("--verbose", "-v", help="Every number of the run, verdict and stages.")
]
Quiet = Annotated[
    bool,
    typer.Option(
        "--quiet", "-q", help="No progress, no text; files, JSON, warnings and errors stay."
    ),
]
