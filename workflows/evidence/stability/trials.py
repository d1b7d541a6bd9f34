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
