"""The folder that beadwave keeps its own results and notes in, and whether it is to be trusted."""

from os import environ, geteuid
from pathlib import Path
from stat import S_IWGRP, S_IWOTH

from platformdirs import user_cache_path

OWN = 0o700  # nobody else reads or writes


def cache_folder() -> Path:
    """Where results are kept: BEADWAVE_CACHE_DIR, or the user's cache."""
    given = environ.get("BEADWAVE_CACHE_DIR")
    return Path(given) if given else user_cache_path("beadwave")


def own_folders(*folders: Path) -> str | None:
    """Make each, one after the other; why one is not trusted, None where all are the user's own.

    Raises OSError where one cannot be made.
    """
    for folder in folders:
        folder.mkdir(mode=OWN, parents=True, exist_ok=True)
        if why := _distrusted(folder):
            return why
    return None


def _distrusted(folder: Path) -> str | None:
    found = folder.stat()
    if found.st_uid != geteuid():
        return f"is not trusted: {folder} belongs to another user"
    if found.st_mode & (S_IWGRP | S_IWOTH):
        return f"is not trusted: others may write into {folder} (chmod go-w ends that)"
    return None
