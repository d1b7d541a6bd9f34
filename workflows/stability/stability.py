"""Stiff and extreme cases, a verdict each.

accurate  the value, a measured error, is below what the case allows
refused   the engine declined in the sentence below
flagged   numerically right to the value, but outside of what the model is valid for, and said so
failed    neither: a wrong answer without a word
"""

from collections.abc import Callable, Iterable, Iterator
from importlib import import_module
from json import dumps
from pathlib import Path
from textwrap import wrap
from time import perf_counter
from typing import NamedTuple

import numpy as np

from workflows.accuracy.accuracy import aligned, short, table_csv
from workflows.run_folder import RunFolder
from workflows.scene import InvalidScene, nearest
from workflows.stages import Watch


class Row(NamedTuple):
    """A verdict; the value is None where there is no answer to measure."""

    case: str
    parameter: float | str
    verdict: str
    value: float | None
    sentence: str
    seconds: float


class Outcome(NamedTuple):
    """The measured error of an answer, what it may be, and what the run warned of."""

    value: float
    allowed: float
    warnings: tuple[str, ...] = ()


class Trial(NamedTuple):
    """A case at a parameter."""

    case: str
    parameter: float | str
    run: Callable[[], Outcome]


CASES = {
    "joint-stiffness": "assembly:joint_stiffness",
    "rayleigh-damping": "assembly:rayleigh_damping",
    "wall-mode-frequency": "walls:mode_frequency",
    "one-dof-wall": "walls:one_dof",
    "wall-damping": "walls:wall_damping",
    "dashpot-wall": "walls:dashpot",
    "young": "chains:young",
    "unlike-materials": "chains:unlike_materials",
    "radius": "chains:radius",
    "unlike-radii": "chains:unlike_radii",
    "striker-speed": "chains:striker_speed",
    "preload": "chains:preload",
    "sonic-vacuum": "chains:sonic_vacuum",
    "dissipation": "chains:dissipation",
    "spheres": "chains:spheres",
    "step": "steps:step",
    "drift": "steps:drift",
    "time-reversal": "steps:time_reversal",
    "float-extremes": "steps:float_extremes",
}


def stability(cases: Iterable[str], watch: Watch) -> tuple[Row, ...]:
    """Verdicts on the trials of these cases."""
    rows: list[Row] = []
    for case in cases:
        with watch(case):
            rows += [judged(trial) for trial in trials(case)]
    return tuple(rows)


def chosen(cases: Iterable[str] | None) -> tuple[str, ...]:
    """The cases of these names, all without any; raises InvalidScene for an unknown one."""
    names = tuple(cases or CASES)
    for name in names:
        if name not in CASES:
            raise InvalidScene(f"--case {name!r} is not known; {nearest(name, CASES)}.")
    return names


def trials(case: str) -> Iterator[Trial]:
    """What is tried of a case."""
    module, function = CASES[case].split(":")
    return getattr(import_module(f"workflows.stability.{module}"), function)()


def judged(trial: Trial) -> Row:
    """The verdict on a trial: ValueErrors are how the engine refuses, any other is a failure."""
    started = perf_counter()
    verdict, value, sentence = _verdict(trial)
    seconds = perf_counter() - started
    return Row(trial.case, trial.parameter, verdict, value, sentence, seconds)


def _verdict(trial: Trial) -> tuple[str, float | None, str]:
    try:
        with np.errstate(all="ignore"):
            outcome = trial.run()
    except ValueError as refusal:
        return "refused", None, str(refusal)
    except Exception as error:
        return "failed", None, f"{type(error).__name__}: {error}"
    if not outcome.value <= outcome.allowed:
        return "failed", outcome.value, f"above {outcome.allowed:.2g}, and not a word of it."
    if outcome.warnings:
        return "flagged", outcome.value, " ".join(outcome.warnings)
    return "accurate", outcome.value, f"allowed {outcome.allowed:.2g}"


HEADER = ("case", "parameter", "verdict", "value", "allowed", "seconds")
WIDTH, INDENT = 100, 6 * " "  # of the sentences


def text(rows: tuple[Row, ...]) -> str:
    """A table and a count for a person."""
    table = aligned([HEADER, *(_cells(row) for row in rows)], left=3).splitlines()
    lines = [table[0]]
    for line, row in zip(table[1:], rows, strict=True):
        lines += [line, *_below(row)]
    return "\n".join([*lines, "", _count(rows)])


def _cells(row: Row) -> tuple[str, ...]:
    allowed = row.sentence.removeprefix("allowed ") if row.verdict == "accurate" else "-"
    numbers = map(short, (row.case, row.parameter, row.verdict, row.value))
    return (*numbers, allowed, short(row.seconds))


def _below(row: Row) -> list[str]:
    """What was said of a case that is not merely accurate."""
    if row.verdict == "accurate":
        return []
    return wrap(row.sentence, WIDTH, initial_indent=INDENT, subsequent_indent=INDENT)


def _count(rows: tuple[Row, ...]) -> str:
    verdicts = [row.verdict for row in rows]
    counts = (f"{verdicts.count(v)} {v}" for v in ("accurate", "flagged", "refused", "failed"))
    return f"{len(rows)} cases: {', '.join(counts)}; {sum(row.seconds for row in rows):.0f} s."


def json(rows: tuple[Row, ...]) -> str:
    """For machines; a value that is not finite is null."""
    return dumps({"rows": [_finite(row)._asdict() for row in rows]}, indent=1)


def _finite(row: Row) -> Row:
    finite = row.value is not None and np.isfinite(row.value)
    return row if finite else row._replace(value=None)


def write(rows: tuple[Row, ...], out: Path) -> None:
    """stability.csv and stability.json into a folder."""
    folder = RunFolder(out)
    folder.make()
    folder.write("stability.csv", table_csv(Row._fields, rows))
    folder.write("stability.json", json(rows) + "\n")
