"""The answer of an inspection: ends of the search, each with walls computed where it lies."""

from typing import NamedTuple

import numpy as np

from workflows.fit.core.inspection.fitting import RecordFit
from workflows.fit.core.inspection.forward import IMPOSSIBLE
from workflows.fit.core.inspection.inversion import Inversion, inverted, profiled
from workflows.fit.core.inspection.judgement import SETTLED
from workflows.fit.core.inspection.search import Searched, searched

ROUNDS = 3  # of walls computed at the answer


class Answer(NamedTuple):
    """An end of the search, settled."""

    inversion: Inversion
    fit: RecordFit
    moved: float | None  # bars by which the last computed wall moved it
    no_wall: str = ""  # why no wall could be computed there


def answered(
    fit: RecordFit, n_shared: int, gains: tuple[str, ...], *, starts: int, seed: int
) -> tuple[Answer, tuple[Inversion, ...]]:
    """The answer, and others that the records do not tell from it.

    Raises what the system raises for values that cannot be marched.
    """
    search = searched(fit, n_shared=n_shared, starts=starts, seed=seed)
    fit = fit._replace(forward=search.forward)
    answers = [_settled(fit, end.theta, n_shared, gains, search) for end in search.ends]
    answers.sort(key=lambda answer: answer.inversion.whole_misfit)
    best, *others = answers
    return best, best.inversion.rivals([one.inversion for one in others], n_shared)


def _settled(
    fit: RecordFit, theta, n_shared: int, gains: tuple[str, ...], search: Searched
) -> Answer:
    """An end of the search, found again with walls computed where it lies. Where none can be
    computed the end stays as the walls around it gave it."""
    model, moved, no_wall = fit.forward.system, None, ""
    found = inverted(fit, begin=theta, n_shared=n_shared, gains=gains)
    for _ in range(ROUNDS if model.between else 0):
        try:
            model = model.through(found.value[: len(model.keys)])
            there = fit._replace(forward=fit.forward._replace(system=model))
            begin = found.value[: len(fit.unknowns.parameters)]
            anew = inverted(there, begin=begin, n_shared=n_shared, gains=gains)
        except IMPOSSIBLE as reason:
            no_wall = str(reason)
            break
        fit, before, found = there, found, anew
        off = np.abs(found.value - before.value)[:n_shared]
        moved = float((off / found.uncertainty.two_sigma[:n_shared]).max())
        if moved <= SETTLED:
            break
    return Answer(profiled(fit, found, n_shared)._replace(search=search), fit, moved, no_wall)
