"""Where a stage reports that it runs: at the terminal's bars, or nowhere."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

Progress = Callable[[str], AbstractContextManager]  # of the stage named, while it runs


def quiet(stage: str) -> AbstractContextManager:
    """Reports nothing."""
    return nullcontext()
