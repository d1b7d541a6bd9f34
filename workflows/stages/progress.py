"""How a stage reports that it runs: a context entered with the stage's name."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

Progress = Callable[[str], AbstractContextManager]  # entered with the stage's name while it runs


def quiet(stage: str) -> AbstractContextManager:
    """A Progress that reports nothing."""
    return nullcontext()
