"""Report of the stages that run: a context that is entered with a stage's name."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

Progress = Callable[[str], AbstractContextManager]  # entered with the stage's name while it runs


def quiet(stage: str) -> AbstractContextManager:
    """A Progress that reports nothing."""
    return nullcontext()
