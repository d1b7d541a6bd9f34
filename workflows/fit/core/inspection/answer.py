"""The answer of an inspection: ends of the search, each with walls computed where it lies."""

from typing import NamedTuple

import numpy as np

from workflows.fit.core.inspection.fitting import RecordFit
from workflows.fit.core.inspection.inversion import Inversion, inverted, profiled
from workflows.fit.core.inspection.judgement import LIMITS
from workflows.fit.core.inspection.search import searched
from workflows.fit.core.least_squares import IMPOSSIBLE

ROUNDS = 3  # of walls computed at the answer, at most


class Answer(NamedTuple):
    """An end of the search, found again with walls computed where it lies."""

    inversion: Inversion
    fit: RecordFit
    moved: float | None  # bars by which the last computed wall moved it
    no_wall: str = ""  # why no wall could be computed there


def answered(
    fit: RecordFit, n_shared: int, gains: tuple[str, ...], *, starts: int, seed: int
) -> tuple[Answer, tuple[Inversion, ...]]:
    """The answer, and others that the records do not tell from it.

    Each end of the search is fitted again with a wall that is computed at it, until that moves it
    by less than a small share of its bars. Where no wall can be computed the end stays as the walls
    around it gave it. Raises what the system raises for values that cannot be marched.
    """
    search = searched(fit, n_shared=n_shared, starts=starts, seed=seed)
    answers = []
    for end in search.ends:
        end_fit = fit._replace(forward=search.forward)
        model, moved, no_wall = end_fit.forward.system, None, ""
        inversion = inverted(end_fit, begin=end.point, n_shared=n_shared, gains=gains)
        for _ in range(ROUNDS if model.between else 0):
            try:
                model = model.through(inversion.value[: len(model.keys)])
                fit_there = end_fit._replace(forward=end_fit.forward._replace(system=model))
                theta = inversion.value[: len(end_fit.unknowns.parameters)]
                again = inverted(fit_there, begin=theta, n_shared=n_shared, gains=gains)
            except IMPOSSIBLE as reason:
                no_wall = str(reason)
                break
            bars = again.uncertainty.two_sigma[:n_shared]
            moved = float((np.abs(again.value - inversion.value)[:n_shared] / bars).max())
            end_fit, inversion = fit_there, again
            if moved <= LIMITS.settled:
                break
        inversion = profiled(end_fit, inversion, n_shared)._replace(search=search)
        answers.append(Answer(inversion, end_fit, moved, no_wall))
    best, *others = sorted(answers, key=lambda answer: answer.inversion.whole_misfit)
    return best, best.inversion.rivals([answer.inversion for answer in others], n_shared)
