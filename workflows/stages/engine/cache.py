"""The cache of results between runs: `key` of a result, and pickles in a folder of the user's own.

Each pickle has a checksum. Whoever can write a pickle can run code as the user who reads it: a
folder that belongs to somebody else, or that others can write, is not read.
"""

from contextlib import suppress
from functools import cache
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from json import dumps
from logging import ERROR, getLogger
from os import W_OK, access, replace
from pathlib import Path
from typing import Any
from warnings import filterwarnings

from joblib import Memory, register_store_backend
from joblib import __version__ as joblib_version
from joblib.memory import FileSystemStoreBackend

import beadwave
from beadwave.workflows.files import whole_file
from beadwave.workflows.files.cache_folder import OWN, cache_folder, own_folders

LIBRARIES = ("numpy", "scipy", "numba", "scikit-fem", "gmsh")
PACKAGE = Path(beadwave.__file__).parent
LIMIT = "8G"  # of all results; the oldest ones go first
SUM = "output.sha256"


class CheckedStore(FileSystemStoreBackend):
    """joblib's store with a checksum for each result: a damaged result is computed again."""

    def dump_item(self, call_id, item, *args, **kwargs):
        """Keep a result, then its checksum."""
        super().dump_item(call_id, item, *args, **kwargs)
        folder = Path(self.location, *call_id)
        with suppress(OSError):  # a disk that is full keeps no result either
            unfinished = folder / f"{SUM}.part"
            digest = whole_file.digest(folder / "output.pkl")
            unfinished.write_text(digest, encoding="utf-8", newline="\n")
            replace(unfinished, folder / SUM)

    def load_item(self, call_id, *args, **kwargs):
        """The result; raises ValueError, upon which it is computed again, where it is damaged."""
        folder = Path(self.location, *call_id)
        if whole_file.digest(folder / "output.pkl") != (folder / SUM).read_text(encoding="utf-8"):
            raise ValueError(f"{folder} is damaged")
        return super().load_item(call_id, *args, **kwargs)

    def get_cached_func_code(self, call_id):
        """Source of the function as joblib kept it; raises OSError, upon which joblib writes it
        again, where the file is damaged."""
        try:
            return super().get_cached_func_code(call_id)
        except UnicodeDecodeError as error:
            raise OSError(str(error)) from None


@cache
def _make_room(store: CheckedStore) -> None:
    """Drop the oldest results, once in a process: it looks at all of them."""
    with suppress(OSError):
        store.enforce_store_limits(LIMIT)


def memory() -> Memory | None:
    """The cache, or None where its folder cannot be used."""
    # joblib warns of damaged entries and full disks; the result is computed again, so be silent
    getLogger("joblib").setLevel(ERROR)
    filterwarnings("ignore", module="joblib")
    register_store_backend("checked", CheckedStore)
    if fault():
        return None
    return Memory(_results(), verbose=0, backend="checked")


def fault() -> str | None:
    """Reason why the cache cannot be used, as the end of a sentence that begins with the folder;
    None if it can."""
    try:
        if why := own_folders(cache_folder(), _results()):
            return why
        _results().chmod(OWN)
    except OSError as error:
        return f"cannot be written ({error.strerror})"
    return None if access(_results(), W_OK) else "cannot be written"


def _results() -> Path:
    return cache_folder() / f"joblib-{joblib_version}"


def key(stage: str, reads: Any, needs: list[str]) -> str:
    """The key of a stage's result, which changes with everything that the result depends on:

    the name of the stage, and what it reads of the scene
    the keys of the results that it needs
    the program
    """
    return digest([stage, reads, needs, *program()])


def program() -> list[Any]:
    """The program's part of a key: a digest of our sources, and versions of libraries."""
    return [fingerprint(), library_versions(("beadwave", *LIBRARIES))]


@cache
def fingerprint() -> str:
    """SHA-256, in hexadecimal digits, of all source and data files of beadwave: an edit of any of
    them makes every kept result new. Reading them takes some 30 ms; to follow the imports of each
    stage took six times as long."""
    content = sha256()
    for room in sorted(path for path in PACKAGE.iterdir() if path.is_dir()):
        for path in sorted(room.rglob("*")):
            # compiled code, whose records are .json, lies in __pycache__
            is_source = path.suffix in (".py", ".toml", ".json", ".csv")
            if is_source and "__pycache__" not in path.parts:
                name = path.relative_to(PACKAGE).as_posix()
                content.update(f"{name}\n".encode() + path.read_bytes())
    return content.hexdigest()


def digest(inputs: Any) -> str:
    """SHA-256, in hexadecimal digits, of inputs as JSON; what JSON does not know is taken
    as text."""
    return sha256(dumps(inputs, sort_keys=True, default=str).encode()).hexdigest()


def library_versions(names: tuple[str, ...]) -> dict[str, str]:
    """Installed versions by distribution; those that are absent are left out."""
    return {name: number for name in names if (number := _version(name))}


@cache
def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None
