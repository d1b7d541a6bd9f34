"""Folders for pictures, looked at before anything is computed."""

from __future__ import annotations

from pathlib import Path

from beadwave.workflows.files.run_folder import RunFolder


def picture_folder(
    out: str | Path | None, inputs: tuple[Path, ...], overwrite: bool, *names: str
) -> RunFolder | None:
    """The folder that takes these pictures, or None; raises InvalidScene where it cannot."""
    if out is None:
        return None
    folder = RunFolder(Path(out), inputs=inputs, overwrite=overwrite)
    folder.require(*(f"figures/{name}.png" for name in names))
    return folder
