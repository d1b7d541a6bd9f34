"""Machine code of the functions that Python enters, kept for the next start.

numba keeps code (`cache=True`) under a stamp of the function's own file. The code also holds what
the function calls in other files, and constants from there, so its folder here is named by a
fingerprint of all sources that it may come from: those in the function's folder and the kernels.

Two processes that compile one function for different arguments may give their files the same
number, and numba loads what it finds: changed bytes of machine code end the process. So the code of
a function is loaded, compiled and written under the function's lock, and its manifest has the
sha256 of each file. A file that differs from it is removed before numba looks, and compiled again.
"""

import gc
import json
import os
import shutil
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryFile

import numba
from filelock import FileLock, Timeout
from platformdirs import user_cache_path

PREFIX = "code-"
KEPT = 3  # folders of code: of this state of the sources and of the last ones before
PATIENCE = 30.0  # s to wait for the lock of a process that may be stopped; a kernel takes 1 to 7 s
_setting = threading.Lock()  # numba's settings are those of the process


@cache
def fingerprint(folder: Path) -> str:
    """Digest of numba's version, the sources of a folder and those of the kernels."""
    read = sha256(numba.__version__.encode())
    for source in sorted({*folder.glob("*.py"), *Path(__file__).parent.glob("*.py")}):
        content = source.read_bytes()
        read.update(f"{source.name} {len(content)}\n".encode() + content)
    return read.hexdigest()


def folder_of_code(sources: Path) -> Path | None:
    """Folder that keeps the code of a folder of sources; None if no place can be written.

    The place is the folder that the user chose for numba, else `__pycache__` of the sources, else
    the cache that BEADWAVE_CACHE_DIR names, else that of the user. A new folder displaces the
    oldest beyond `KEPT`.
    """
    of_sources = f"{sources.name}-{sha256(os.fsencode(sources)).hexdigest()[:8]}"
    caches = (os.environ.get("BEADWAVE_CACHE_DIR"), user_cache_path("beadwave"))
    places = [Path(place, "code", of_sources) for place in caches if place]
    places.insert(0, sources / "__pycache__")
    if numba.config.CACHE_DIR:
        places = [Path(numba.config.CACHE_DIR, of_sources)]
    for place in places:
        folder = place / (PREFIX + fingerprint(sources)[:16])
        # a file system without locks is a NotImplementedError
        with suppress(OSError, NotImplementedError):
            is_new = not folder.is_dir()
            folder.mkdir(parents=True, exist_ok=True)
            TemporaryFile(dir=folder).close()
            with suppress(Timeout), FileLock(folder / "lock", timeout=0.0):
                pass
            with suppress(OSError):  # another process may remove them too
                codes = [*place.glob(f"{PREFIX}*")] if is_new else []
                for code in sorted(codes, key=lambda code: code.stat().st_mtime)[:-KEPT]:
                    shutil.rmtree(code, ignore_errors=True)
            return folder
    return None


def _files(folder: Path, name: str) -> dict[str, tuple[int, int]]:
    """Size and time of each file that numba wrote of a function."""
    places = [place.path for place in os.scandir(folder) if place.is_dir()]
    files = [file for place in places for file in os.scandir(place)]
    return {
        os.path.relpath(file.path, folder): (file.stat().st_size, file.stat().st_mtime_ns)
        for file in files
        if file.name.startswith(f"{name}-")  # and the number of its first line
    }


def _digest(path: Path) -> str | None:
    try:
        return sha256(path.read_bytes()).hexdigest()
    except OSError:
        return None


@contextmanager
def whole_code(folder: Path, name: str) -> Iterator[None]:
    """Hold the lock of a function with none of its files damaged; list what is written.

    Removes the function's files after an error inside. Raises OSError if the lock is not free
    within `PATIENCE` or the folder takes no file.
    """
    manifest = folder / f"{name}.json"
    with FileLock(folder / f"{name}.lock", timeout=PATIENCE):
        try:
            digests = dict(json.loads(manifest.read_bytes()))
        except (OSError, ValueError, TypeError):  # missing or damaged
            digests = {}
        # a process killed while it wrote leaves files that are in no list
        for file in _files(folder, name):
            if digests.get(file) != _digest(folder / file):
                (folder / file).unlink(missing_ok=True)
        before = _files(folder, name)

        try:
            yield
        except Exception:  # of any kind if a class has gone that the code names
            for file in _files(folder, name):
                (folder / file).unlink(missing_ok=True)
            raise

        after = _files(folder, name)
        if after != before:
            half = manifest.with_suffix(".new")
            listed = {file: _digest(folder / file) for file in after}
            half.write_text(json.dumps(listed), encoding="utf-8", newline="\n")
            os.replace(half, manifest)


class Entry:
    """A compiled function that Python enters: numba's `dispatcher` and the folder of its code."""

    def __init__(self, function: Callable, **options) -> None:
        self.function, self.options = function, options
        self.folder = None
        if not numba.config.DISABLE_JIT:  # njit returns the function itself then
            self.folder = folder_of_code(Path(function.__code__.co_filename).parent)
        self.dispatcher = self._kept() if self.folder else numba.njit(**options)(function)

    def _kept(self) -> Callable:
        """The dispatcher that keeps its code in the folder.

        numba reads these settings when it decorates; for other functions they stay the user's.
        """
        ours = {"CACHE_DIR": str(self.folder), "CACHE_LOCATOR_CLASSES": ""}
        with _setting:
            users = {name: getattr(numba.config, name, "") for name in ours}
            try:
                vars(numba.config).update(ours)
                return numba.njit(cache=True, **self.options)(self.function)
            finally:
                vars(numba.config).update(users)

    def prepare(self, arguments: tuple) -> None:
        """Load the code for arguments of these types, or compile it and keep it."""
        types = tuple(map(numba.typeof, arguments))
        if self.folder is None or types in self.dispatcher.signatures:
            return
        # as numba begins the names of its files
        module = self.function.__module__.rpartition(".")[2]
        name = f"{module}.{self.function.__qualname__}".replace("<", "").replace(">", "")
        # numba makes millions of objects and few cycles: without collections 0.82, 0.89 and 0.97 of
        # the processor time in three pairs of runs, at 55 MB more
        collects = gc.isenabled()
        gc.disable()
        try:
            with whole_code(self.folder, name):
                self.dispatcher.compile(types)
        except Exception:  # not kept: the next start compiles again
            if types not in self.dispatcher.signatures:
                # the call compiles, and raises the error of a function that numba cannot compile
                self.folder, self.dispatcher = None, numba.njit(**self.options)(self.function)
        finally:
            if collects:
                gc.enable()
