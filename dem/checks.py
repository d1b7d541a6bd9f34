"""Checks of a run's numbers: finite, in range, as many as needed; raise InvalidChain."""

import math
from collections.abc import Iterable
from numbers import Integral, Real
from typing import NamedTuple

import numpy as np

from beadwave.dem.kernels.arguments import Array

SMALLEST, LARGEST = 5e-324, 1.7976931348623157e308  # of all positive numbers
MOST_SAVED = 5e8  # spheres times saves: 12 GB


class InvalidChain(ValueError):
    """A chain, wall or initial velocity that no run can start from."""


def require(condition: object, sentence: str) -> None:
    """Raise InvalidChain with the sentence unless the condition holds."""
    if not condition:
        raise InvalidChain(sentence)


def vector(
    name: str, values: object, size: int, *, positive: bool = False, at_least: float | None = None
) -> Array:
    """The values as (size,) numbers, in a copy. Raises InvalidChain, with the place and the number
    found, unless all are finite and above 0 (`positive`) or `at_least` a bound."""
    try:
        values = np.array(values, float)
    except (TypeError, ValueError):
        raise InvalidChain(f"{name} is {values!r}; give {size} numbers") from None
    if values.shape != (size,):
        raise InvalidChain(f"{name} has shape {values.shape}; give {size} numbers")
    lowest = SMALLEST if positive else -LARGEST if at_least is None else at_least
    if size and not (lowest <= values.min() and values.max() < math.inf):  # never so with a NaN
        i = int(np.argmin((lowest <= values) & (values < math.inf)))
        bound = "" if lowest == -LARGEST else f" and at least {lowest:g}"
        allowed = "finite" + (" and above 0" if positive else bound)
        raise InvalidChain(f"{name}[{i}] is {values[i]:g}; it must be {allowed}")
    return values


def spread(name: str, values: object, size: int) -> Array:
    """Values (..., size), from one number for all or one each; leading axes stay. A view that is
    not to be written to. Raises InvalidChain for another count."""
    try:
        array = np.asarray(values, float)
        return np.broadcast_to(array, (*array.shape[:-1], size))
    except (TypeError, ValueError):
        raise InvalidChain(f"{name} is {values!r}; give one number or {size}") from None


def scalar(name: str, value: object, *, at_least: float | None = None) -> None:
    """Require one finite number, not below a bound if there is one; raises InvalidChain."""
    lowest = -math.inf if at_least is None else at_least
    if not (isinstance(value, float) and math.isfinite(value) and value >= lowest):
        vector(name, np.atleast_1d(value), 1, at_least=at_least)


def above_0(name: str, value: object) -> None:
    """Require one finite number above 0."""
    vector(name, np.atleast_1d(value), 1, positive=True)


def positive(name: str, value: object, unit: str = "") -> None:
    """Require a finite number above 0; raises InvalidChain, in a sentence that names its unit."""
    if not (isinstance(value, Real) and 0.0 < value < math.inf):
        raise InvalidChain(f"{name} is {value!r}{unit}; it must be finite and above 0")


def whole(name: str, value: object, *, at_least: int = 1) -> None:
    """Require a whole number, not below a bound."""
    require(
        isinstance(value, Integral) and value >= at_least,
        f"{name} is {value!r}; give a whole number of at least {at_least}",
    )


def saves(n_save: int, n: int) -> None:
    """Require a number of saves of n spheres that fits into memory."""
    whole("n_save", n_save)
    require(
        n_save * (n + 4) < MOST_SAVED,
        f"n_save = {n_save} of {n} spheres is more than memory holds; save fewer than "
        f"{MOST_SAVED / (n + 4):.2g} times",
    )


def columns(observed: object, n: int) -> Array:
    """Indices (n_observed,) of the observed of n spheres, from 0, negative ones from the end; all
    where `observed` is None. Raises InvalidChain for none, for others, and for what is no list of
    whole numbers."""
    if observed is None:
        return np.arange(n)
    indices = np.asarray(observed)
    integers = indices.ndim == 1 and indices.size > 0 and indices.dtype.kind in "iu"
    if not (integers and -n <= indices.min() and indices.max() < n):
        raise InvalidChain(
            f"observed is {observed!r}; give a list of whole numbers from 0 to {n - 1}"
        )
    return indices


def arrays(owner: NamedTuple, names: Iterable[str]) -> None:
    """Raise InvalidChain for a field that is there but no array."""
    for name in names:
        values = getattr(owner, name)
        if not (values is None or isinstance(values, np.ndarray)):
            raise InvalidChain(f"{name} is {values!r}; give a numpy array")
