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

from workflows.evidence.study import verdict_count
from workflows.report.finding import Finding
from workflows.report.tables import Table

NOT_STARTED = (126, 127)  # statuses of a program that the system cannot load
VERDICTS = ("within", "outside", "failed", "skipped")
__all__ = ["finding", "rows_of", "wrong"]
PRINTED = ("group", "quantity", "ours", "theirs", "difference", "allowed", "seconds")


class PeerMissing(Exception):
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
    """The entries of two arrays that differ most, by |ours - theirs| / of; `of` is the largest of
    theirs unless given. A nan differs more than any number."""
    a, b = np.broadcast_arrays(np.asarray(ours, float), np.asarray(theirs, float))
    distance = np.abs(a - b)
    worst = np.unravel_index(
        np.argmax(np.where(np.isnan(distance), np.inf, distance)), distance.shape
    )
    scale = float(np.abs(b).max()) if of is None else of
    difference = float(distance[worst]) / scale
    return Comparison(quantity, float(a[worst]), float(b[worst]), difference, allowed, source)


def require_program(name: str, package: str) -> None:
    """Raises PeerMissing if the program is not on the path or does not start; `package` is the
    Debian package that installs it."""
    if which(name) is None:
        raise PeerMissing(f"{name} is not installed; apt-get install {package} adds it.")
    version = run([name, "-v"], capture_output=True, text=True, check=False)
    if version.returncode in NOT_STARTED:
        why = _first_line(version.stderr)
        remedy = f"apt-get install --reinstall {package} repairs it."
        raise PeerMissing(f"{name} is installed and does not start ({why}); {remedy}")


def require_module(name: str, start: Callable[[], object] | None = None) -> None:
    """Raises PeerMissing if a Python module of the extra `verify` is not installed, or if `start`
    (the import, if None) does not find a library that the module needs."""
    if find_spec(name) is None:
        raise PeerMissing(f"{name} is not installed; ./install.sh verify adds it.")
    try:
        (start or partial(import_module, name))()
    except (ImportError, OSError) as error:
        why = f"{name} is installed and does not start ({_first_line(str(error))})"
        raise PeerMissing(f"{why}; ./install.sh verify adds what it needs.") from error


def _first_line(message: str) -> str:
    return message.strip().partition("\n")[0]


class ComparisonRow(NamedTuple):
    """A comparison, its verdict and the seconds since the row before it."""

    group: str
    quantity: str
    ours: float | None
    theirs: float | None
    difference: float | None
    allowed: float | None
    seconds: float
    verdict: str
    source: str


def rows_of(group: str, comparisons: Callable[[], Iterator[Comparison]]) -> Iterator[ComparisonRow]:
    """The rows of a group, each computed when it is taken from the iterator.

    A missing program ends the group with a row `skipped`, any other exception with a row `failed`
    that holds its message.
    """
    started = perf_counter()

    def row(verdict: str, quantity: str, source: str, *numbers: float | None) -> ComparisonRow:
        nonlocal started
        since, started = started, perf_counter()
        return ComparisonRow(group, quantity, *numbers, started - since, verdict, source)

    no_numbers = (None,) * 4
    try:
        with np.errstate(all="ignore"):
            for quantity, *numbers, source in comparisons():
                verdict = "within" if numbers[2] <= numbers[3] else "outside"
                yield row(verdict, quantity, source, *numbers)
    except PeerMissing as missing:
        yield row("skipped", "skipped", str(missing), *no_numbers)
    except Exception as error:
        yield row("failed", "failed", f"{type(error).__name__}: {error}", *no_numbers)


def finding(rows: tuple[ComparisonRow, ...]) -> Finding:
    """The table; as sentences the sources of each group, what was skipped or failed, a count."""
    lines = []
    for row in rows:
        numbers = [None if x is None else f"{x:.7g}" for x in (row.ours, row.theirs)]
        mark = "" if row.verdict in ("within", "skipped") else f" ({row.verdict})"
        lines.append((
            row.group, row.quantity + mark, *numbers, row.difference, row.allowed, row.seconds,
        ))  # fmt: skip

    sources: dict[str, dict[str, None]] = {}  # by group, in order and once each
    for row in rows:
        if row.difference is not None:
            sources.setdefault(row.group, {})[row.source] = None
    sentences = [f"{group} beside {'; '.join(names)}." for group, names in sources.items()]
    sentences += [
        f"{row.group} {row.verdict}: {row.source}" for row in rows if row.difference is None
    ]
    sentences.append(verdict_count(rows, "rows", VERDICTS))
    return Finding(
        (Table("verify", ComparisonRow._fields, rows, (PRINTED, *lines)),), tuple(sentences)
    )


def wrong(comparisons: Finding) -> str | None:
    """A sentence on the rows that are outside or failed, None where there are none."""
    columns = (comparisons.tables[0].column(name) for name in ("group", "quantity", "verdict"))
    bad = [
        f"{group}: {quantity}"
        for group, quantity, verdict in zip(*columns, strict=True)
        if verdict in ("outside", "failed")
    ]
    if not bad:
        return None
    return f"{len(bad)} rows are outside of what is allowed: {'; '.join(bad)}."
