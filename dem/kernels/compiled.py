"""The ways to compile a function. numba, a quarter of a second to import, is loaded by the first
call: a run whose results are all kept does without."""

from collections.abc import Callable
from functools import cached_property, update_wrapper
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from beadwave.dem.kernels.kept_code import Entry

# major and minor number of the newest numba whose insides `inner_compiler` is known to fit; a later
# one compiles as it does by itself, a quarter longer
NEWEST_NUMBA = (0, 68)

FAST = {"contract", "reassoc", "nsz", "arcp"}


class CompiledFunction:
    """A function that numba compiles.

    An inner one is called by compiled ones only, which saves a fifth of the compilation: it has no
    entry from Python, which runs it uncompiled.
    """

    def __init__(self, function: Callable, *, inner: bool, **options) -> None:
        update_wrapper(self, function)
        self.py_func, self._inner, self._options = function, inner, options
        self._prepared = set()  # kinds of arguments

    @cached_property
    def _entry(self) -> "Entry":
        from beadwave.dem.kernels.kept_code import Entry

        return Entry(self.py_func, **self._options)

    @property
    def dispatcher(self) -> Callable:
        """The function that Python enters, as numba has it."""
        return self._entry.dispatcher

    @cached_property
    def within(self) -> Callable:
        """The function as compiled ones call it: its code is part of theirs."""
        import numba

        options = self._options | {"no_cpython_wrapper": True}
        if numba.version_info.short <= NEWEST_NUMBA:
            from beadwave.dem.kernels.inner_compiler import InnerCompiler

            options["pipeline_class"] = InnerCompiler
        return numba.njit(**options)(self.py_func)

    @property
    def _numba_type_(self):
        """The type of the function where a compiled one calls it."""
        return self.within._numba_type_

    def prepare(self, *arguments) -> None:
        """Compile for arguments like these, or load the code."""
        kinds = tuple(map(kind, arguments))
        if kinds not in self._prepared:
            self._entry.prepare(arguments)
            self._prepared.add(kinds)

    def __call__(self, *arguments):
        """The function of the arguments."""
        if self._inner:
            return self.py_func(*arguments)
        self.prepare(*arguments)
        return self._entry.dispatcher(*arguments)


def kind(argument: object) -> object:
    """Type of an argument as far as numba compiles for it, in a thirtieth of `numba.typeof`'s time.

    A finer one only looks a second time whether there is code.
    """
    if isinstance(argument, np.ndarray):
        return argument.dtype, argument.ndim, argument.flags.num
    if isinstance(argument, tuple):
        return type(argument), *map(kind, argument)
    return type(argument)


def njit(*, inner: bool = False, **options) -> Callable:
    """A decorator that compiles a function and keeps what was compiled."""
    options["no_cfunc_wrapper"] = True  # C calls none of them
    return lambda function: CompiledFunction(function, inner=inner, **options)


# `_nrt=False`: no reference counts, which would cost more than the arithmetic of a short chain;
# such a function allocates nothing. A function with many arguments that is called at every step
# is inline: numba hands over each array as seven words.
_ENTRY = {"error_model": "numpy"}
_INNER = _ENTRY | {"inner": True}

# a product and a sum in one operation: no order changes, a force in space takes a fifth less
CONTRACT = {"contract"}

ieee = njit(**_INNER, _nrt=False)
contracted = njit(**_INNER, _nrt=False, fastmath=CONTRACT)
contracted_inline = njit(**_INNER, _nrt=False, fastmath=CONTRACT, forceinline=True)
fastmath = njit(**_INNER, _nrt=False, fastmath=FAST)
ieee_inline = njit(**_INNER, _nrt=False, forceinline=True)
fastmath_inline = njit(**_INNER, _nrt=False, fastmath=FAST, forceinline=True)
fastmath_allocating = njit(**_INNER, fastmath=FAST)
ieee_entry = njit(**_ENTRY, _nrt=False)
fastmath_entry = njit(**_ENTRY, _nrt=False, fastmath=FAST)
ieee_march = njit(**_ENTRY, _nrt=False, nogil=True)
fastmath_march = njit(**_ENTRY, _nrt=False, nogil=True, fastmath=FAST)
fastmath_allocating_march = njit(**_ENTRY, nogil=True, fastmath=FAST)
