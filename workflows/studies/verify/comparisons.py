"""Our results beside those of independent programs, published figures and exact solutions.

within   the difference is at most what is allowed
outside  it is above, or no number
failed   the computation ended in the sentence below
skipped  the independent program is not installed
"""

from collections.abc import Callable, Iterator
from time import perf_counter
from typing import NamedTuple

import numpy as np

from coupling.verification.comparisons import Comparison, Missing
from workflows.results.tables import Table
from workflows.studies.finding import Finding

VERDICTS = ("within", "outside", "failed", "skipped")
PRINTED = ("group", "quantity", "ours", "theirs", "difference", "allowed", "seconds")


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


def finding(rows: tuple[Row, ...]) -> Finding:
    """The table, its sources, what was skipped or failed, and a count."""
    table = Table("verify", Row._fields, rows, (PRINTED, *map(_printed, rows)))
    return Finding((table,), (*_sources(rows), *_ended(rows), _count(rows)))


def wrong(found: Finding) -> str | None:
    """A sentence on the rows that are outside or failed, None where there are none."""
    of = zip(*(found.tables[0].column(name) for name in ("group", "quantity", "verdict")),
             strict=True)  # fmt: skip
    bad = [f"{group}: {quantity}" for group, quantity, said in of if said in VERDICTS[1:3]]
    if not bad:
        return None
    return f"{len(bad)} rows are outside of what is allowed: {'; '.join(bad)}."


def _printed(row: Row) -> tuple:
    digits = [None if x is None else f"{x:.7g}" for x in (row.ours, row.theirs)]
    mark = "" if row.verdict in ("within", "skipped") else f" ({row.verdict})"
    return (row.group, row.quantity + mark, *digits, row.difference, row.allowed, row.seconds)


def _sources(rows: tuple[Row, ...]) -> Iterator[str]:
    told = [row for row in rows if row.difference is not None]
    for group in dict.fromkeys(row.group for row in told):
        sources = dict.fromkeys(row.source for row in told if row.group == group)
        yield f"{group} beside {'; '.join(sources)}."


def _ended(rows: tuple[Row, ...]) -> Iterator[str]:
    return (f"{row.group} {row.verdict}: {row.source}" for row in rows if row.difference is None)


def _count(rows: tuple[Row, ...]) -> str:
    verdicts = [row.verdict for row in rows]
    counts = (f"{verdicts.count(v)} {v}" for v in VERDICTS)
    return f"{len(rows)} rows: {', '.join(counts)}; {sum(row.seconds for row in rows):.0f} s."
