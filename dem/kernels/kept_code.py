"""`numba.njit` whose kept machine code is checked before it is used.

Machine code holds what it calls and the constants that it reads, also those of other files, and
numba looks at the function's own file alone. It is kept in a folder named by all sources that it
may come from: those beside the function and the kernels here. Each index and each piece of code
ends in its sha256. What is cut short, empty or changed is as good as absent: it is compiled again
and written over.
"""

import pickle
import shutil
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from hashlib import sha256
from pathlib import Path

import numba
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler

LENGTH = sha256().digest_size
PREFIX = "code-"
KEPT = 3  # folders of code: of this state of the sources and of the last ones before


@cache
def fingerprint(folder: Path) -> str:
    """A digest of the sources of a folder and of the kernels."""
    read = sha256()
    for source in sorted({*folder.glob("*.py"), *Path(__file__).parent.glob("*.py")}):
        content = source.read_bytes()
        read.update(f"{source.name} {len(content)}\n".encode() + content)
    return read.hexdigest()


class CheckedFile(IndexDataCacheFile):
    """A function's index and code, with their checksums; no trouble with them is the caller's."""

    def save(self, key: object, data: object) -> None:
        """Keep the code, unless the folder takes none."""
        with suppress(OSError):
            folder = Path(self._cache_path)
            if not folder.is_dir():
                folder.mkdir(parents=True)
                folders = folder.parent.glob(f"{PREFIX}*")
                oldest_first = sorted(folders, key=lambda code: code.stat().st_mtime)
                for code in oldest_first[:-KEPT]:
                    shutil.rmtree(code, ignore_errors=True)
            super().save(key, data)

    def _dump(self, obj):
        content = super()._dump(obj)
        return content + sha256(content).digest()  # a pickle ends before it

    def _load_index(self):
        try:
            with open(self._index_path, "rb") as index:
                pickle.load(index)  # the version
                _require_whole(index.read())
            return super()._load_index()
        except Exception:  # what unpickling rubbish raises has no bounds
            return {}

    def _load_data(self, name):
        with open(self._data_path(name), "rb") as code:
            _require_whole(code.read())
        return super()._load_data(name)


def _require_whole(content: bytes) -> None:
    """Raise OSError, which numba takes for an absent file, where the checksum does not fit."""
    if sha256(content[:-LENGTH]).digest() != content[-LENGTH:]:
        raise OSError("damaged")


class CheckedCache(FunctionCache):
    """The code of a function, in a folder of its sources where numba would keep it."""

    def __init__(self, function: Callable) -> None:
        super().__init__(function)
        sources = Path(function.__code__.co_filename).parent
        self._cache_file = CheckedFile(
            str(Path(self.cache_path, PREFIX + fingerprint(sources)[:16])),
            self._impl.filename_base,
            self._cache_file._source_stamp,
        )


class InnerLibrary(JITCodeLibrary):
    """The intermediate code of a function that compiled ones alone call.

    LLVM optimises the caller's module with all that it calls. numba also optimises each callee for
    itself, with its own callees, and makes machine code of it, which nobody enters: a function four
    calls deep was optimised five times.
    """

    def finalize(self) -> None:
        """Link what the function calls; leave the rest to the caller."""
        self._raise_if_finalized()
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._final_module.verify()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """0, as of any symbol without machine code."""
        self._ensure_finalized()
        return 0

    @property
    def codegen(self) -> "InnerLibrary":
        """What numba tells the function's environment (the Python objects of its exceptions)."""
        return self

    def set_env(self, name: str, environment: object) -> None:
        """Nothing: no machine code has a place for it, and none here raises an exception."""


class InnerCompiler(Compiler):
    """numba's pipeline into an `InnerLibrary`."""

    def __init__(self, typingctx, targetctx, library, *arguments) -> None:
        library = InnerLibrary(targetctx.codegen(), "inner")
        super().__init__(typingctx, targetctx, library, *arguments)


def dispatcher(function: Callable, *, inner: bool, **options) -> Callable:
    """What compiles the function for the arguments that it is called with, and keeps the code; of
    an inner one its caller's code is kept."""
    if inner:
        return numba.njit(pipeline_class=InnerCompiler, **options)(function)
    compiled = numba.njit(**options)(function)
    if compiled is not function:  # as it is where NUMBA_DISABLE_JIT is set
        with suppress(RuntimeError):  # no folder takes code: each start compiles anew
            compiled._cache = CheckedCache(function)
    return compiled
