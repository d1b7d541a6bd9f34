"""The ways to compile a function. numba, a quarter of a second to import, is loaded by the first
call: a run whose results are all kept does without."""

from collections.abc import Callable
from functools import cached_property, update_wrapper

FAST = {"contract", "reassoc", "nsz", "arcp"}


class Compiled:
    """A function that numba compiles.

    An inner one is called by compiled ones only, which saves a fifth of the compilation: it has no
    entry from Python, which runs it uncompiled.
    """

    def __init__(self, function: Callable, *, inner: bool, **options) -> None:
        update_wrapper(self, function)
        self.py_func, self._inner, self._options = function, inner, options

    @cached_property
    def dispatcher(self) -> Callable:
        """The function as numba has it."""
        from beadwave.dem.kernels.kept_code import dispatcher

        return dispatcher(self.py_func, inner=self._inner, **self._options)

    @property
    def _numba_type_(self):
        """How numba knows the function where a compiled one calls it."""
        return self.dispatcher._numba_type_

    def __call__(self, *arguments):
        """What the function gives."""
        return (self.py_func if self._inner else self.dispatcher)(*arguments)


def njit(*, inner: bool = False, **options) -> Callable:
    """A decorator that compiles a function and keeps what was compiled."""
    options["no_cfunc_wrapper"] = True  # C calls none of them
    if inner:
        options["no_cpython_wrapper"] = True
    return lambda function: Compiled(function, inner=inner, **options)


# `_nrt=False`: no reference counts, which would cost more than the arithmetic of a short chain;
# such a function allocates nothing. A function with many arguments that is called at every step
# is inline: numba hands over each array as seven words.
_ENTRY = {"error_model": "numpy"}
_INNER = _ENTRY | {"inner": True}

ieee = njit(**_INNER, _nrt=False)
fastmath = njit(**_INNER, _nrt=False, fastmath=FAST)
ieee_inline = njit(**_INNER, _nrt=False, forceinline=True)
fastmath_inline = njit(**_INNER, _nrt=False, fastmath=FAST, forceinline=True)
fastmath_allocating = njit(**_INNER, fastmath=FAST)
ieee_entry = njit(**_ENTRY, _nrt=False)
fastmath_entry = njit(**_ENTRY, _nrt=False, fastmath=FAST)
ieee_march = njit(**_ENTRY, _nrt=False, nogil=True)
fastmath_march = njit(**_ENTRY, _nrt=False, nogil=True, fastmath=FAST)
fastmath_allocating_march = njit(**_ENTRY, nogil=True, fastmath=FAST)
