"""A case at a parameter, and the verdict on it.

accurate  the value, a measured error, is below what the case allows
refused   the engine declined in the sentence below
flagged   numerically right to the value, but outside of what the model is valid for, and said so
failed    neither: a wrong answer without a word
"""

from collections.abc import Callable
from time import perf_counter
from typing import NamedTuple

import numpy as np

from workflows.evidence.stability.outcomes import Outcome

VERDICTS = ("accurate", "flagged", "refused", "failed")


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
