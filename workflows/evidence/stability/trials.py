"""A case at a parameter, and the verdict on it.

accurate  the value, a measured error, is below what the case allows
refused   the engine declined in the sentence below
flagged   numerically right to the value, but outside of what the model is valid for, and said so
failed    neither: a wrong answer without a word
"""

from collections.abc import Callable, Iterator
from functools import partial
from time import perf_counter
from typing import NamedTuple

import numpy as np

import dem
from dem.spheres import time_scale
from workflows.evidence.study import verdict_count
from workflows.report.finding import Finding
from workflows.report.tables import Table

STEEL = 210e9  # Pa
VERDICTS = ("accurate", "flagged", "refused", "failed")
BRIEF = ("case", *VERDICTS, "error/allowed", "seconds")
UNITS = {  # of parameters that are numbers
    "joint-stiffness": "N/m", "young": "Pa", "unlike-materials": "Pa", "radius": "m",
    "striker-speed": "m/s", "preload": "N", "sonic-vacuum": "N", "dashpot-wall": "N s/m",
}  # fmt: skip
PRINTED = ("case", "parameter", "verdict", "value", "allowed", "seconds")


class Outcome(NamedTuple):
    """The measured error of an answer, what it may be, and what the run warned of."""

    value: float  # error of the velocities over the largest initial speed
    allowed: float
    warnings: tuple[str, ...] = ()


def settled(
    chain: dem.Chain,
    wall: dem.Wall | None,
    v0: np.ndarray,
    duration: float,
    *,
    young: float | np.ndarray = STEEL,
    error: float = 1e-4,
    n_save: int = 100,
) -> Outcome:
    """A run to an error, its true error against a finer one, and where it left the model's range.

    An energy error counts as a hundredth of its size as an error of the velocities, so that it may
    be a hundred times `error`. The search for the step is given 1e9 evaluations of all contacts and
    modes.
    """
    size = chain.mass.size + (0 if wall is None else wall.omega.size)
    run = dem.march_to_error(
        chain, wall, v0, duration=duration, error=error, n_save=n_save,
        search=dem.StepSearch(max_evaluations=1e9 / size),
    ).trajectory  # fmt: skip
    speed = float(np.abs(v0).max()) or 1.0
    true = float(np.abs(finer(chain, wall, v0, run).v - run.v).max()) / speed
    warnings = dem.outside(dem.strain(chain, young, run.contact_force, run.v))
    return Outcome(max(true, 1e-2 * run.energy_error), error, warnings)


def finer(
    chain: dem.Chain, wall: dem.Wall | None, v0: np.ndarray, run: dem.Trajectory
) -> dem.Trajectory:
    """The same with a quarter of the step by another scheme, where one bears the damping.

    The implicit schemes, which alone average a force that jumps, take an eighth of the step. Beside
    a light wall the step is no longer than the contacts' stability allows: a run to an error
    resolves the motion by longer ones, which `march` refuses.
    """
    march = partial(dem.march, chain, wall, v0, duration=run.t[-1], n_save=run.t.size - 1)
    if run.scheme.startswith("energy"):
        return march(scheme=run.scheme, dt=run.dt / 8)

    def stable(scheme: str) -> float:
        # half: contacts that share a sphere lower the limit by up to sqrt(2)
        return min(run.dt / 4, dem.stability_limit(chain, wall, v0, scheme=scheme) / 2)

    scheme = "split6" if chain.dissipation == "none" else "kahan-li6"
    try:
        return march(scheme=scheme, dt=stable(scheme))
    except dem.UnstableStep:  # of the damping
        return march(scheme=run.scheme, dt=stable(run.scheme))


def collisions(chain: dem.Chain, speed: float, count: float) -> float:
    """Duration [s] of so many of the slowest contact's natural times."""
    n = chain.A.size
    return count * float(time_scale(chain.mass[:n], chain.A, speed).max())


class TrialRow(NamedTuple):
    """A verdict; value and allowed are None where there is no answer to measure."""

    case: str
    parameter: float | str
    verdict: str
    value: float | None  # measured error
    allowed: float | None
    sentence: str  # the engine's refusal, the run's warnings, or what is wrong
    seconds: float


class Trial(NamedTuple):
    """A case at a parameter, not yet run."""

    case: str
    parameter: float | str
    run: Callable[[], Outcome]


def judged(trial: Trial) -> TrialRow:
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
    return TrialRow(trial.case, trial.parameter, verdict, value, allowed, sentence, seconds)


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
