"""Comparisons as a table with its sources and a count, and what of them is wrong."""

from collections.abc import Iterator

from workflows.evidence.verify.comparisons import VERDICTS, Row
from workflows.report.finding import Finding
from workflows.report.tables import Table

PRINTED = ("group", "quantity", "ours", "theirs", "difference", "allowed", "seconds")


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
