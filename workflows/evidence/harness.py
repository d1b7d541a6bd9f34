"""Rows of evidence: an answer beside what it should be, and a verdict.

    group, quantity, ours, theirs, difference, allowed, source  ->  verdict, seconds

A group of `verify` is a generator of comparisons: a quantity by us beside the same in a book or a
closed solution.

within   the difference is at most what is allowed
outside  it is above, or no number
failed   the computation ended in the sentence below

A case of `stability` is a generator of trials, whose difference is the measured error of a run.

accurate  the error is at most what the case allows
refused   the engine declined in the sentence below
flagged   numerically right, but outside of what the model is valid for, and said so
failed    neither: a wrong answer without a word
"""

from collections.abc import Callable, Iterable, Iterator
from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from beadwave.workflows.report.finding import Finding
from beadwave.workflows.report.tables import Table

VERDICTS = {
    "verify": ("within", "outside", "failed"),
    "stability": ("accurate", "flagged", "refused", "failed"),
}
# of stability's table: its column, and the field of a row; verify's table has all but the unit
TRIALS = {
    "case": "group", "parameter": "quantity", "unit": "unit", "verdict": "verdict",
    "value": "difference", "allowed": "allowed", "sentence": "source", "seconds": "seconds",
}  # fmt: skip
BRIEF = ("case", *VERDICTS["stability"], "error/allowed", "seconds")


class Comparison(NamedTuple):
    """A quantity by us and by them; of arrays the entries that differ most."""

    quantity: str
    ours: float
    theirs: float
    difference: float  # largest, over their largest or an absolute scale
    allowed: float
    source: str


class Outcome(NamedTuple):
    """The measured error of an answer, what it may be, and what the run warned of."""

    value: float  # error of the velocities over the largest initial speed
    allowed: float
    warnings: tuple[str, ...] = ()


class Trial(NamedTuple):
    """A case at a parameter, not yet run."""

    parameter: float | str
    run: Callable[[], Outcome]
    unit: str = ""  # of a parameter that is a number


class Row(NamedTuple):
    """A comparison or a trial, its verdict and its seconds; None where there is no number."""

    group: str
    quantity: float | str  # of a trial the parameter
    ours: float | None
    theirs: float | None
    difference: float | None
    allowed: float | None
    seconds: float  # since the row before it
    verdict: str
    source: str  # or what was refused, warned of, or went wrong
    unit: str = ""  # of a trial's parameter


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
    theirs unless given. The arrays have one shape, or shapes that numpy broadcasts to one. A nan
    differs more than any number: it must not pass for agreement."""
    a, b = np.broadcast_arrays(np.asarray(ours, float), np.asarray(theirs, float))
    distance = np.abs(a - b)
    worst = np.unravel_index(
        np.argmax(np.where(np.isnan(distance), np.inf, distance)), distance.shape
    )
    scale = float(np.abs(b).max()) if of is None else of
    difference = float(distance[worst]) / scale
    return Comparison(quantity, float(a[worst]), float(b[worst]), difference, allowed, source)


def rows_of(group: str, pieces: Callable[[], Iterable[Comparison | Trial]]) -> Iterator[Row]:
    """The rows of a group, each computed when it is taken from the iterator; an exception ends the
    group with a row `failed` that holds its message."""
    started = perf_counter()
    try:
        with np.errstate(all="ignore"):
            for piece in pieces():
                if isinstance(piece, Trial):
                    yield judged(piece, group)
                    continue
                since, started = perf_counter() - started, perf_counter()
                yield row_of(group, piece, since)
    except Exception as error:
        sentence, since = f"{type(error).__name__}: {error}", perf_counter() - started
        yield Row(group, "failed", None, None, None, None, since, "failed", sentence)


def row_of(group: str, comparison: Comparison, seconds: float) -> Row:
    """A comparison with its verdict; a difference that is no number is outside."""
    verdict = "within" if comparison.difference <= comparison.allowed else "outside"
    return Row(group, *comparison[:-1], seconds, verdict, comparison.source)


def judged(trial: Trial, case: str = "") -> Row:
    """The verdict on a trial: ValueErrors are how the engine refuses, any other is a failure."""
    started = perf_counter()
    value = allowed = None
    try:
        with np.errstate(all="ignore"):
            value, allowed, warnings = trial.run()
    except ValueError as refusal:
        verdict, sentence = "refused", str(refusal)
    except Exception as error:
        verdict, sentence = "failed", f"{type(error).__name__}: {error}"
    else:
        if value <= allowed:  # False for nan
            verdict, sentence = "flagged" if warnings else "accurate", " ".join(warnings)
        else:
            verdict, sentence = "failed", "the error is above what is allowed, unreported."
    seconds = perf_counter() - started
    numbers = None, None, value, allowed, seconds
    return Row(case, trial.parameter, *numbers, verdict, sentence, trial.unit)


def finding(folder: str, rows: tuple[Row, ...]) -> Finding:
    """The table of a folder's rows, "verify" or "stability", what there is to say of single ones,
    and a count."""
    if folder == "stability":
        lines = [tuple(getattr(row, field) for field in TRIALS.values()) for row in rows]
        printed = [name for name in TRIALS if name not in ("unit", "sentence")]
        shown = [tuple(getattr(row, TRIALS[name]) for name in printed) for row in rows]
        table = Table(folder, tuple(TRIALS), tuple(lines), (tuple(printed), *shown))
        sentences = [said(row) for row in rows if row.verdict != "accurate"]
    else:
        shown = [("group", "quantity", "ours", "theirs", "difference", "allowed", "seconds")]
        for row in rows:
            numbers = [None if x is None else f"{x:.7g}" for x in (row.ours, row.theirs)]
            mark = "" if row.verdict == "within" else f" ({row.verdict})"
            shown.append((
                row.group, row.quantity + mark, *numbers, row.difference, row.allowed, row.seconds,
            ))  # fmt: skip
        table = Table(folder, Row._fields[:-1], tuple(row[:-1] for row in rows), tuple(shown))

        # the sources of each group, in order and once each; what failed
        sources: dict[str, dict[str, None]] = {}
        for row in rows:
            if row.difference is not None:
                sources.setdefault(row.group, {})[row.source] = None
        sentences = [f"{group} beside {'; '.join(names)}." for group, names in sources.items()]
        sentences += [
            f"{row.group} {row.verdict}: {row.source}" for row in rows if row.difference is None
        ]

    verdicts = [row.verdict for row in rows]
    counts = ", ".join(f"{verdicts.count(verdict)} {verdict}" for verdict in VERDICTS[folder])
    noun, seconds = "rows" if folder == "verify" else "cases", sum(row.seconds for row in rows)
    sentences.append(f"{len(rows)} {noun}: {counts}; {seconds:.0f} s.")
    return Finding((table,), tuple(sentences))


def brief(verdicts: Finding) -> Finding:
    """The finding of trials, printed with a line for each case: its trials, the largest share of
    what is allowed, and one sentence on what was refused or flagged."""
    table = verdicts.tables[0]
    by_case: dict[str, list[Row]] = {}
    for case, parameter, unit, verdict, value, allowed, sentence, seconds in table.rows:
        row = Row(case, parameter, None, None, value, allowed, seconds, verdict, sentence, unit)
        by_case.setdefault(case, []).append(row)

    lines, sentences = [BRIEF], []
    for case, trials in by_case.items():
        counts = map([row.verdict for row in trials].count, VERDICTS["stability"])
        shares = [row.difference / row.allowed for row in trials if row.allowed]
        seconds = sum(row.seconds for row in trials)
        lines.append((case, *counts, max(shares, default=None), seconds))

        # the first trial of each verdict, in the order of the verdicts' last trials
        first: dict[str, Row] = {}
        for row in trials:
            if row.verdict != "accurate":
                first[row.verdict] = first.pop(row.verdict, row)
        sentences += map(said, first.values())
    sentences.append(verdicts.sentences[-1])
    return Finding((table._replace(printed=tuple(lines)),), tuple(sentences))


def said(row: Row) -> str:
    """A trial in words."""
    parameter = row.quantity if isinstance(row.quantity, str) else f"{row.quantity:g}"
    unit = f" {row.unit}" if row.unit else ""
    return f"{row.group} {parameter}{unit}, {row.verdict}: {row.source}"


def wrong(comparisons: Finding) -> str | None:
    """A sentence on the rows that are outside or failed, None where there are none."""
    rows = (Row(*row) for row in comparisons.tables[0].rows)
    bad = [f"{row.group}: {row.quantity}" for row in rows if row.verdict in ("outside", "failed")]
    if not bad:
        return None
    return f"{len(bad)} rows are outside of what is allowed: {'; '.join(bad)}."
