"""Folder that a run fills, and the files that it replaces there.

A folder belongs to the scene of its `scene.toml`: another scene, or other cases of a sweep, get
another folder, or a note on what they replace.
"""

from itertools import count
from os.path import lexists
from pathlib import Path
from tomllib import TOMLDecodeError, loads
from typing import NamedTuple

from beadwave.system import file_name
from beadwave.workflows.files.run_folder import marked


class OutputFolder(NamedTuple):
    """A folder to fill, and notes on it for the user, in sentences."""

    path: Path | None
    notes: tuple[str, ...] = ()


def place(out: str | Path | None, parent: Path, name: str, scene_toml: str) -> OutputFolder:
    """The folder `out`, or without one a folder in the parent that no other scene fills."""
    if out:
        return given(Path(out), scene_toml)
    usual, path = parent / file_name(name), own_folder(parent, name, scene_toml)
    note = f"{usual} is left as it is: it holds another run"
    return OutputFolder(path, () if path == usual else (note,))


def given(path: Path, scene_toml: str) -> OutputFolder:
    """The folder that the user named; a note if a run of another scene is replaced there."""
    earlier_toml = _scene(path) if marked(path) else None
    if earlier_toml is None or earlier_toml == scene_toml:
        return OutputFolder(path)
    try:
        earlier = str(loads(earlier_toml).get("name", "unknown"))
    except TOMLDecodeError:
        earlier = "unknown"
    return OutputFolder(path, (f"replaced: what an earlier run of {earlier} left in {path}",))


def own_folder(parent: Path, name: str, scene_toml: str) -> Path:
    """NAME in the parent, or the first of NAME-2, NAME-3, ... that no other scene's files fill."""

    def is_free(path: Path) -> bool:
        """True if the folder is absent, or one of ours that holds this scene or none yet."""
        if not lexists(path):
            return True
        ours = marked(path) or (path.is_dir() and not any(path.iterdir()))
        return ours and (_scene(path) == scene_toml or not lexists(path / "scene.toml"))

    numbered = (parent / file_name(name if n == 1 else f"{name}-{n}") for n in count(1))
    return next(filter(is_free, numbered))


def _scene(path: Path) -> str | None:
    file = path / "scene.toml"
    return file.read_bytes().decode(errors="replace") if file.is_file() else None
