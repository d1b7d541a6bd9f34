"""A quantity by us beside the same by an independent program, a book, a closed solution."""

from importlib.util import find_spec
from shutil import which
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike


class Missing(Exception):
    """An independent program is not installed; says how to install it."""


class Comparison(NamedTuple):
    """A quantity by us and by them; of arrays the entries that differ most."""

    quantity: str
    ours: float
    theirs: float
    difference: float  # largest, over their largest or an absolute scale
    allowed: float
    source: str


def compared(
    quantity: str,
    ours: ArrayLike,
    theirs: ArrayLike,
    *,
    allowed: float,
    source: str,
    of: float | None = None,
) -> Comparison:
    """The largest difference of arrays of one shape over `of`, without it over their largest."""
    a, b = np.broadcast_arrays(np.asarray(ours, float), np.asarray(theirs, float))
    off = np.abs(a - b)
    worst = np.unravel_index(np.argmax(np.where(np.isnan(off), np.inf, off)), off.shape)
    scale = float(np.abs(b).max()) if of is None else of
    difference = float(off[worst]) / scale
    return Comparison(quantity, float(a[worst]), float(b[worst]), difference, allowed, source)


def require_program(name: str, package: str) -> None:
    """Raises Missing if no such program is on the path; `package` is Debian's."""
    if which(name) is None:
        raise Missing(f"{name} is not installed; apt-get install {package} adds it.")


def require_module(name: str) -> None:
    """Raises Missing if no such Python module is installed, of the extra `verify`."""
    if find_spec(name) is None:
        raise Missing(f"{name} is not installed; ./install.sh verify adds it.")
