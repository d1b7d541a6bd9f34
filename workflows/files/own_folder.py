"""Which folder a run fills, and what it takes the place of.

A folder belongs to what its `scene.toml` says: another scene, or other cases of a sweep, get
another folder, or a note of what they replace.
"""

from itertools import count
from os.path import lexists
from pathlib import Path
from tomllib import TOMLDecodeError, loads
from typing import NamedTuple

from workflows.files.run_folder import marked


class Place(NamedTuple):
    """A folder to fill, and what the user is to know of it, in sentences."""

    path: Path | None
    notes: tuple[str, ...] = ()


def place(out: str | Path | None, parent: Path, name: str, scene_toml: str) -> Place:
    """The folder that was asked for, or one in the parent that nothing else fills."""
    if out:
        return given(Path(out), scene_toml)
    usual, own = parent / name, own_folder(parent, name, scene_toml)
    left = f"{usual} is left as it is: it holds another run"
    return Place(own, () if own == usual else (left,))


def given(path: Path, scene_toml: str) -> Place:
    """The folder that was asked for; the note names a run that gives way."""
    other = _other_scene(path, scene_toml)
    said = f"replaced: what an earlier run of {other} left in {path}"
    return Place(path, () if other is None else (said,))


def own_folder(parent: Path, name: str, scene_toml: str) -> Path:
    """NAME in the parent, or the first of NAME-2, NAME-3, ... that no other scene's files fill."""
    numbered = (parent / (name if n == 1 else f"{name}-{n}") for n in count(1))
    return next(path for path in numbered if _takes(path, scene_toml))


def _takes(path: Path, scene_toml: str) -> bool:
    """Whether the folder is absent, or ours with this very scene, or with none yet."""
    if not lexists(path):
        return True
    ours = marked(path) or (path.is_dir() and not any(path.iterdir()))
    return ours and (_scene(path) == scene_toml or not lexists(path / "scene.toml"))


def _other_scene(path: Path, scene_toml: str) -> str | None:
    """The name of another scene, a run of which fills the folder."""
    held = _scene(path) if marked(path) else None
    if held is None or held == scene_toml:
        return None
    try:
        return str(loads(held).get("name", "unknown"))
    except TOMLDecodeError:
        return "unknown"


def _scene(path: Path) -> str | None:
    file = path / "scene.toml"
    return file.read_bytes().decode(errors="replace") if file.is_file() else None
