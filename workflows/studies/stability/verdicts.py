"""Stiff and extreme cases, a verdict each.

accurate  the value, a measured error, is below what the case allows
refused   the engine declined in the sentence below
flagged   numerically right to the value, but outside of what the model is valid for, and said so
failed    neither: a wrong answer without a word
"""

from collections.abc import Callable
from time import perf_counter
from typing import NamedTuple

import numpy as np

from coupling.verification import Outcome
from workflows.results.tables import Table
from workflows.studies.finding import Finding

VERDICTS = ("accurate", "flagged", "refused", "failed")
BRIEF = ("case", *VERDICTS, "error/allowed", "seconds")
PRINTED = ("case", "parameter", "verdict", "value", "allowed", "seconds")


class Row(NamedTuple):
    """A verdict; the value is None where there is no answer to measure."""

    case: str
    parameter: float | str
    verdict: str
    value: float | None
    allowed: float | None
    sentence: str
    seconds: float


class Trial(NamedTuple):
    """A case at a parameter."""

    case: str
    parameter: float | str
    run: Callable[[], Outcome]


class Verdict(NamedTuple):
    """What a trial showed, the error and what it may be where there is one."""

    verdict: str
    value: float | None
    allowed: float | None
    sentence: str


def judged(trial: Trial) -> Row:
    """The verdict on a trial: ValueErrors are how the engine refuses, any other is a failure."""
    started = perf_counter()
    verdict = _verdict(trial)
    return Row(trial.case, trial.parameter, *verdict, perf_counter() - started)


def _verdict(trial: Trial) -> Verdict:
    try:
        with np.errstate(all="ignore"):
            outcome = trial.run()
    except ValueError as refusal:
        return Verdict("refused", None, None, str(refusal))
    except Exception as error:
        return Verdict("failed", None, None, f"{type(error).__name__}: {error}")
    if not outcome.value <= outcome.allowed:
        return Verdict("failed", *outcome[:2], "the error is above what is allowed, unreported.")
    return Verdict(
        "flagged" if outcome.warnings else "accurate", *outcome[:2], " ".join(outcome.warnings)
    )


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
