"""A quantity by us beside the same by an independent program, a book, a closed solution.

within   the difference is at most what is allowed
outside  it is above, or no number
failed   the computation ended in the sentence below
skipped  the independent program is not installed, or does not start
"""

from collections.abc import Callable, Iterator
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from shutil import which
from subprocess import run
from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

NOT_STARTED = (126, 127)  # statuses of a program that the system cannot load
VERDICTS = ("within", "outside", "failed", "skipped")


class Missing(Exception):
    """An independent program is not installed or does not start; says how to install it."""


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
    """Raises Missing if no such program is on the path or it does not start; `package` is
    Debian's."""
    if which(name) is None:
        raise Missing(f"{name} is not installed; apt-get install {package} adds it.")
    found = run([name, "-v"], capture_output=True, text=True, check=False)
    if found.returncode in NOT_STARTED:
        why = _first_line(found.stderr)
        remedy = f"apt-get install --reinstall {package} mends it."
        raise Missing(f"{name} is installed and does not start ({why}); {remedy}")


def require_module(name: str, start: Callable[[], object] | None = None) -> None:
    """Raises Missing if no such Python module of the extra `verify` is installed, or if `start`,
    without it the import, does not find what the module needs."""
    if find_spec(name) is None:
        raise Missing(f"{name} is not installed; ./install.sh verify adds it.")
    try:
        (start or partial(import_module, name))()
    except (ImportError, OSError) as error:
        why = f"{name} is installed and does not start ({_first_line(str(error))})"
        raise Missing(f"{why}; ./install.sh verify adds what it needs.") from error


def _first_line(said: str) -> str:
    return said.strip().partition("\n")[0]


class Row(NamedTuple):
    """A comparison, its verdict and what it took since the one before it."""

    group: str
    quantity: str
    ours: float | None
    theirs: float | None
    difference: float | None
    allowed: float | None
    seconds: float
    verdict: str
    source: str


def rows_of(group: str, comparisons: Callable[[], Iterator[Comparison]]) -> Iterator[Row]:
    """The rows of a group, each computed when it is asked for; what ends it early is its last."""
    started = perf_counter()

    def row(verdict: str, quantity: str, source: str, *numbers: float | None) -> Row:
        nonlocal started
        since, started = started, perf_counter()
        return Row(group, quantity, *numbers, started - since, verdict, source)

    nothing = (None,) * 4
    try:
        with np.errstate(all="ignore"):
            for quantity, *numbers, source in comparisons():
                verdict = "within" if numbers[2] <= numbers[3] else "outside"
                yield row(verdict, quantity, source, *numbers)
    except Missing as missing:
        yield row("skipped", "skipped", str(missing), *nothing)
    except Exception as error:
        yield row("failed", "failed", f"{type(error).__name__}: {error}", *nothing)
