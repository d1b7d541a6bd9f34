"""Comparisons as a table with sources and a count, and a sentence on rows that are wrong."""

from workflows.evidence.counted import verdict_count
from workflows.evidence.verify.comparisons import VERDICTS, ComparisonRow, rows_of
from workflows.report.finding import Finding
from workflows.report.tables import Table

__all__ = ["finding", "rows_of", "wrong"]

PRINTED = ("group", "quantity", "ours", "theirs", "difference", "allowed", "seconds")


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
