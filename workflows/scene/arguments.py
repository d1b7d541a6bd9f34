"""Checks of the arguments of Python functions, where they are called.

Types are read off the signature of a function, so that nothing is listed twice. Values pass as they
are: a function converts what it takes.
"""

import builtins
import os
import types
from collections.abc import Callable, Collection, Iterable, Mapping
from functools import cache, wraps
from inspect import signature
from math import isnan
from numbers import Integral, Real
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

from beadwave.workflows.scene.named_files import no_name
from beadwave.workflows.scene.scene_table import InvalidScene, nearest
from beadwave.workflows.scene.shown import shown

Function = TypeVar("Function", bound=Callable)
WORDS = {  # of one value, and of the values in a list
    "bool": ("True or False", "True or False"),
    "int": ("an integer", "integers"),
    "float": ("a number", "numbers"),
    "str": ("a text", "texts"),
    "Path": ("a path", "paths"),
    "NoneType": ("None", "None"),
    "Any": ("any value", "values"),
    "ArrayLike": ("an array of finite numbers", "arrays"),
    "sparray": ("a sparse matrix", "sparse matrices"),
}


class _Names(dict):
    """Names that annotations use. A type that a module imports for type checkers alone is replaced
    by an empty class of its name."""

    def __missing__(self, name: str) -> type:
        return type(name, (), {"unloaded": True})


def checked(function: Function) -> Function:
    """The function with a check of its arguments before anything else. It raises InvalidScene for a
    value of a type that it does not take, TypeError for a missing or an unknown argument."""
    known = signature(function)

    @wraps(function)
    def call(*values: Any, **named: Any) -> Any:
        for name in named:
            if name not in known.parameters:
                which = nearest(name, known.parameters) if known.parameters else "it takes none"
                raise TypeError(f"{function.__name__}: there is no argument {name!r}; {which}.")
        try:
            given = known.bind(*values, **named).arguments
        except TypeError as error:
            raise TypeError(f"{function.__name__}: {error}.") from None
        hints = _hints(function)
        for name, value in given.items():
            if not _admits(hints[name], value):
                raise InvalidScene(
                    f"{function.__name__}: {name} = {shown(value)} must be {_words(hints[name])}."
                )
            is_path = isinstance(value, str | os.PathLike) and "path" in _words(hints[name])
            if is_path and (why := no_name(value)):
                raise InvalidScene(f"{function.__name__}: {name} = {shown(value)} {why}.")
        return function(*values, **named)

    return call


@cache
def _hints(function: Callable) -> dict[str, Any]:
    """Types of the arguments by name."""
    names = _Names(vars(builtins) | function.__globals__)
    return get_type_hints(function, globalns={}, localns=names)


def _admits(hint: Any, value: Any) -> bool:
    """True if a value is of a type; the contents of lists count too."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        return any(_admits(each, value) for each in inner)
    if origin is tuple:
        fits = isinstance(value, list | tuple) and len(value) == len(inner)
        return fits and all(map(_admits, inner, value))
    if origin is Callable:
        return callable(value)
    if origin is not None and issubclass(origin, Mapping):
        return isinstance(value, Mapping)
    if origin is not None:  # an iterable; one that can be read once only is not read here
        if isinstance(value, str | bytes | Mapping) or not isinstance(value, Iterable):
            return False
        return all(_admits(inner[0], x) for x in (value if isinstance(value, Collection) else ()))
    if hint is Any:
        return True
    if hint is bool:
        return isinstance(value, bool) or type(value).__name__ in ("bool", "bool_")  # of numpy
    if hint in (int, float):
        number = isinstance(value, Integral if hint is int else Real)
        return number and not isinstance(value, bool) and not isnan(value)
    if not hasattr(hint, "unloaded"):
        return isinstance(value, os.PathLike if hint.__name__ == "Path" else hint)
    if hint.__name__ == "ArrayLike":
        return _is_array(value)
    if hint.__name__ == "sparray":
        return hasattr(value, "tocsr")
    return hint.__name__ in {each.__name__ for each in type(value).__mro__}


def _is_array(value: Any) -> bool:
    """True if a value is an array of finite numbers, or becomes one."""
    import numpy as np

    try:
        array = np.asarray(value, dtype=complex)
    except (TypeError, ValueError):
        return False
    return array.ndim > 0 and bool(np.isfinite(array).all())


def _words(hint: Any, several: bool = False) -> str:
    """A type in words, in singular or plural."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        *first, last = dict.fromkeys(_words(each, several) for each in inner)
        return f"{', '.join(first)} or {last}"
    if origin is tuple:
        return f"{'pairs ' if several else ''}({', '.join(map(_words, inner))})"
    if origin is Callable:
        return "a function"
    if origin is not None and issubclass(origin, Mapping):
        return "a dict"
    if origin is not None:
        return f"a list of {_words(inner[0], True)}"
    name = getattr(hint, "__name__", str(hint))
    return WORDS.get(name, (f"a {name}", f"{name}s"))[several]
