"""Files that are there complete or not at all, and where one can be written."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from hashlib import file_digest
from os import W_OK, access, getpid, kill, replace
from os.path import exists, isdir, lexists
from pathlib import Path
from re import escape, match

PART = ".beadwave-"  # and the number of the process that writes it


@contextmanager
def writing_file(path: Path) -> Iterator[Path]:
    """A path beside to write to, renamed to the file once it is complete; its folder is made."""
    path.parent.mkdir(parents=True, exist_ok=True)
    clear_parts(path.parent)
    part = path.with_name(f"{PART}{getpid()}-{path.stem[:40]}{path.suffix}")
    try:
        yield part
        replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def clear_parts(*folders: Path) -> None:
    """Remove what processes that are gone left half written."""
    for folder in folders:
        for part in folder.glob(f"{PART}*"):
            if (found := match(rf"{escape(PART)}(\d+)-", part.name)) and not runs(int(found[1])):
                part.unlink(missing_ok=True)


def runs(process: int) -> bool:
    """Whether another process of this number is there."""
    try:
        kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        return True
    return process != getpid()


def unfit(folder: Path) -> str | None:
    """Why nothing can be written into a folder that may have to be made."""
    there = next(each for each in (folder, *folder.parents) if lexists(each))
    if not isdir(there):
        return f"{there} is no folder"
    return None if access(there, W_OK) else f"{there} is read-only"


def digest(path: Path) -> str:
    """The sha256 of a file."""
    with path.open("rb") as file:
        return file_digest(file, "sha256").hexdigest()


def among(path: Path, others: Iterable[Path]) -> bool:
    """Whether the path leads to one of the other files."""
    return exists(path) and any(exists(each) and path.samefile(each) for each in others)
