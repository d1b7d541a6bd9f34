"""Files that are there complete or not at all, and where one can be written."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from hashlib import file_digest
from os import W_OK, access, getpid, replace
from os.path import exists, isdir, lexists
from pathlib import Path
from re import escape, match

from beadwave.system import runs

PART = ".beadwave-"  # and the number of the process that writes it


@contextmanager
def writing_file(path: Path) -> Iterator[Path]:
    """A temporary path to write to, renamed to the file once it is complete; its folder is made."""
    path.parent.mkdir(parents=True, exist_ok=True)
    clear_parts(path.parent)
    draft = path.with_name(f"{PART}{getpid()}-{path.stem[:40]}{path.suffix}")
    try:
        yield draft
        replace(draft, path)
    except OSError as error:
        if error.filename == str(draft):  # a user knows the file alone
            error.filename = str(path)
        raise
    finally:
        draft.unlink(missing_ok=True)


def clear_parts(*folders: Path) -> None:
    """Remove unfinished files of processes that have ended."""
    for folder in folders:
        for draft in folder.glob(f"{PART}*"):
            writer = match(rf"{escape(PART)}(\d+)-", draft.name)
            if writer and not runs(int(writer[1])):
                draft.unlink(missing_ok=True)


def unfit(folder: Path) -> str | None:
    """Reason why nothing can be written into a folder that may have to be made."""
    existing = next(path for path in (folder, *folder.parents) if lexists(path))
    if not isdir(existing):
        return f"{existing} is no folder"
    return None if access(existing, W_OK) else f"{existing} is read-only"


def digest(path: Path) -> str:
    """The sha256 of a file."""
    with path.open("rb") as file:
        return file_digest(file, "sha256").hexdigest()


def among(path: Path, others: Iterable[Path]) -> bool:
    """True if the path leads to one of the other files."""
    return exists(path) and any(exists(file) and path.samefile(file) for file in others)
