"""Verdicts on stiff and extreme cases as a table, in full or a line a case."""

from workflows.evidence.stability.trials import VERDICTS, Row
from workflows.report.finding import Finding
from workflows.report.tables import Table

BRIEF = ("case", *VERDICTS, "error/allowed", "seconds")
PRINTED = ("case", "parameter", "verdict", "value", "allowed", "seconds")


def finding(rows: tuple[Row, ...]) -> Finding:
    """The table, what was said of each case that is not merely accurate, and a count."""
    said = (f"{row.case} {row.parameter}, {row.verdict}: {row.sentence}" for row in rows
            if row.verdict != "accurate")  # fmt: skip
    printed = (PRINTED, *(tuple(getattr(row, name) for name in PRINTED) for row in rows))
    return Finding((Table("stability", Row._fields, rows, printed),), (*said, _count(rows)))


def brief(found: Finding) -> Finding:
    """The same printed with a line for each case: its trials, the largest share of what is allowed,
    and one sentence on what was refused or flagged."""
    rows = tuple(Row(*row) for row in found.tables[0].rows)
    cases = list(dict.fromkeys(row.case for row in rows))
    grouped = [[row for row in rows if row.case == case] for case in cases]
    printed = (BRIEF, *(_together(same) for same in grouped))
    said = [row for same in grouped for row in same if row.verdict != "accurate"]
    first = {(row.case, row.verdict): row for row in reversed(said)}.values()
    told = (f"{row.case} {row.parameter}, {row.verdict}: {row.sentence}" for row in first)
    table = found.tables[0]._replace(printed=printed)
    return found._replace(tables=(table,), sentences=(*reversed([*told]), found.sentences[-1]))


def _together(rows: list[Row]) -> tuple:
    """The line of a case."""
    verdicts = [row.verdict for row in rows]
    shares = [row.value / row.allowed for row in rows if row.value is not None and row.allowed]
    counts = tuple(verdicts.count(v) for v in VERDICTS)
    return (rows[0].case, *counts, max(shares, default=None), sum(row.seconds for row in rows))


def _count(rows: tuple[Row, ...]) -> str:
    verdicts = [row.verdict for row in rows]
    counts = (f"{verdicts.count(v)} {v}" for v in VERDICTS)
    return f"{len(rows)} cases: {', '.join(counts)}; {sum(row.seconds for row in rows):.0f} s."
