"""Verdicts on stiff and extreme cases as a table, in full or a line a case."""

from collections.abc import Callable, Iterator

from workflows.evidence.counted import verdict_count
from workflows.evidence.stability.trials import VERDICTS, Trial, TrialRow, judged
from workflows.report.finding import Finding
from workflows.report.tables import Table

BRIEF = ("case", *VERDICTS, "error/allowed", "seconds")
UNITS = {  # of parameters that are numbers
    "joint-stiffness": "N/m", "young": "Pa", "unlike-materials": "Pa", "radius": "m",
    "striker-speed": "m/s", "preload": "N", "sonic-vacuum": "N", "dashpot-wall": "N s/m",
}  # fmt: skip
PRINTED = ("case", "parameter", "verdict", "value", "allowed", "seconds")


def rows_of(_: str, trials: Callable[[], Iterator[Trial]]) -> Iterator[TrialRow]:
    """The rows of a case, each computed when it is taken from the iterator."""
    return map(judged, trials())


def finding(rows: tuple[TrialRow, ...]) -> Finding:
    """The table, the sentence of each trial that is not merely accurate, and a count."""
    sentences = [_sentence(row) for row in rows if row.verdict != "accurate"]
    sentences.append(verdict_count(rows, "cases", VERDICTS))
    lines = (tuple(getattr(row, name) for name in PRINTED) for row in rows)
    table = Table("stability", TrialRow._fields, rows, (PRINTED, *lines))
    return Finding((table,), tuple(sentences))


def brief(verdicts: Finding) -> Finding:
    """The same printed with a line for each case: its trials, the largest share of what is allowed,
    and one sentence on what was refused or flagged."""
    table = verdicts.tables[0]
    by_case: dict[str, list[TrialRow]] = {}
    for row in table.rows:
        by_case.setdefault(row[0], []).append(TrialRow(*row))

    lines, sentences = [BRIEF], []
    for case, rows in by_case.items():
        counts = [[row.verdict for row in rows].count(v) for v in VERDICTS]
        shares = [row.value / row.allowed for row in rows if row.value is not None and row.allowed]
        seconds = sum(row.seconds for row in rows)
        lines.append((case, *counts, max(shares, default=None), seconds))

        # the first trial of each verdict, in the order of the verdicts' last trials
        first: dict[str, TrialRow] = {}
        for row in rows:
            if row.verdict != "accurate":
                first[row.verdict] = first.pop(row.verdict, row)
        sentences += map(_sentence, first.values())
    count = verdicts.sentences[-1]
    return verdicts._replace(
        tables=(table._replace(printed=tuple(lines)),), sentences=(*sentences, count)
    )


def _sentence(row: TrialRow) -> str:
    parameter = row.parameter if isinstance(row.parameter, str) else f"{row.parameter:g}"
    unit = f" {UNITS[row.case]}" if parameter != row.parameter and row.case in UNITS else ""
    return f"{row.case} {parameter}{unit}, {row.verdict}: {row.sentence}"
