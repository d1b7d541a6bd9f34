"""Who is told which stage runs: the terminal's bars, or nobody."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

Progress = Callable[[str], AbstractContextManager]  # of the stage named, while it runs


def quiet(stage: str) -> AbstractContextManager:
    """Nobody is told."""
    return nullcontext()
