"""Checks of files that a user names: a pipe would be waited for, a device would never end."""

from pathlib import Path

from workflows.scene.scene_table import InvalidScene


def unfit(path: Path) -> str | None:
    """Why nothing is read from a path; None where an ordinary file is."""
    if path.is_file():
        return None
    if path.is_dir():
        return "is a folder"
    return "is a pipe or a device, no ordinary file" if path.exists() else "does not exist"


def require_file(path: str | Path, advice: str, *, key: str = "") -> Path:
    """The path; raises InvalidScene where no ordinary file is, with the key or option before it."""
    if why := unfit(Path(path)):
        raise InvalidScene(f"{key}{path} {why}; {advice}.")
    return Path(path)
