"""The cache folder of the user, with results and notes, and the check that only the user can write
into it."""

from os import environ
from pathlib import Path

from platformdirs import user_cache_path

from beadwave.system import untrusted

OWN = 0o700  # mode of a folder that nobody else reads or writes


def cache_folder() -> Path:
    """Folder of kept results: BEADWAVE_CACHE_DIR, or the user's cache."""
    folder = environ.get("BEADWAVE_CACHE_DIR")
    return Path(folder) if folder else user_cache_path("beadwave")


def own_folders(*folders: Path) -> str | None:
    """Make the folders in order; the reason why one is not trusted, None if all are the user's.

    Raises OSError where one cannot be made.
    """
    for folder in folders:
        folder.mkdir(mode=OWN, parents=True, exist_ok=True)
        if why := untrusted(folder):
            return f"is not trusted: {why}"
    return None
