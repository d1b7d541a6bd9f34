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
from typing import ClassVar

import numba
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.types import Array, BaseTuple, Boolean, Number, unliteral

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
            # with what it was compiled for: numba numbers the pieces of code, and of two processes
            # that compile one function for other arguments both may take the same number
            super().save(key, (key, data))

    def load(self, key: object) -> object | None:
        """The code; None where there is none, or another process's under the same number."""
        key_of_code, data = super().load(key) or (None, None)
        return data if key_of_code == key else None

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

    def _optimize_final_module(self) -> None:
        """Nothing: the caller's module is optimised with what is linked here."""

    def _finalize_final_module(self) -> None:
        """No machine code."""
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


class KernelTyping:
    """numba's typing context, which types an operator on numbers and arrays of them once.

    numba asks some ten templates about each `+` and `[ ]` of a function, those of strings and lists
    among them: a fifth of the compilation.
    """

    signatures: ClassVar[dict] = {}  # of a context, an operator and types of its arguments

    def __init__(self, context) -> None:
        self._context = context

    def __getattr__(self, name: str):
        return getattr(self._context, name)

    def _once(self, resolve: Callable, operator: object, *arguments):
        """What `resolve` gives for the operator; only that on numbers and arrays is kept, which
        numba writes itself: other code depends on the flags of the function that calls it."""
        if not all(map(is_numeric, arguments)):
            return resolve()
        key = self._context, operator, arguments
        if key not in self.signatures:
            self.signatures[key] = resolve()
        return self.signatures[key]

    def resolve_function_type(self, func, args, kws):
        """The signature of a function for these types of arguments."""

        def resolve():
            return self._context.resolve_function_type(func, args, kws)

        operator = getattr(func, "typing_key", func)
        if getattr(operator, "__module__", None) != "_operator":
            return resolve()
        return self._once(resolve, operator, *args)

    def resolve_setitem(self, target, index, value):
        """The signature of target[index] = value."""

        def resolve():
            return self._context.resolve_setitem(target, index, value)

        return self._once(resolve, "setitem", target, index, value)


def is_numeric(type_) -> bool:
    """Is it the type of a number, of a tuple of numbers or of an array?"""
    if isinstance(type_, BaseTuple):
        return all(map(is_numeric, type_))
    return isinstance(unliteral(type_), Number | Boolean | Array)


class EntryCompiler(Compiler):
    """numba's pipeline with `KernelTyping`."""

    def __init__(self, typingctx, *arguments) -> None:
        super().__init__(KernelTyping(typingctx), *arguments)


class InnerCompiler(EntryCompiler):
    """The same into an `InnerLibrary`."""

    def __init__(self, typingctx, targetctx, library, *arguments) -> None:
        library = InnerLibrary(targetctx.codegen(), "inner")
        super().__init__(typingctx, targetctx, library, *arguments)


def dispatcher(function: Callable, *, inner: bool, **options) -> Callable:
    """What compiles the function for the arguments that it is called with, and keeps the code; of
    an inner one its caller's code is kept."""
    if inner:
        return numba.njit(pipeline_class=InnerCompiler, **options)(function)
    compiled = numba.njit(pipeline_class=EntryCompiler, **options)(function)
    if compiled is not function:  # as it is where NUMBA_DISABLE_JIT is set
        with suppress(RuntimeError):  # no folder takes code: each start compiles anew
            compiled._cache = CheckedCache(function)
    return compiled
