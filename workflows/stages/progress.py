"""How stages report that they run: a context with a stage's name, and before all a plan."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import NamedTuple

Progress = Callable[[str], AbstractContextManager]  # entered with the stage's name while it runs


class Plan(NamedTuple):
    """What a run is about to compute; kept results are not in it."""

    stages: tuple[str, ...]  # in their order
    beside: tuple[str, ...] = ()  # those of them that a second process may compute
    unknowns: float | None = None  # of the mesh, foreseen or counted; None where nothing is known


Planned = Callable[[Plan], None]


def quiet(stage: str) -> AbstractContextManager:
    """A Progress that reports nothing."""
    return nullcontext()


def unplanned(plan: Plan) -> None:
    """A Planned that reports nothing."""
