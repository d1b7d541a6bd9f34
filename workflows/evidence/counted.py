"""Pieces of a study, one after another, with the time that is left; verdicts, counted."""

from collections.abc import Callable, Iterable, Iterator
from time import perf_counter
from typing import TypeVar

from workflows.stages.progress import Progress

Piece = TypeVar("Piece")


def counted(
    pieces: Iterable[Piece], progress: Progress, name: Callable[[Piece], str]
) -> Iterator[Piece]:
    """Each of the pieces, shown as the stage of its name while the caller works on it.

    From the second on the name ends in "(3 of 7, about 40 s left)", from the mean of those before:
    a first run has no last one to go by.
    """
    pieces = tuple(pieces)
    started = perf_counter()
    for i, piece in enumerate(pieces):
        left = ""
        if i:
            seconds = (perf_counter() - started) / i * (len(pieces) - i)
            left = f" ({i + 1} of {len(pieces)}, about {seconds:.0f} s left)"
        with progress(name(piece) + left):
            yield piece


def verdict_count(rows: tuple, noun: str, verdicts: Iterable[str]) -> str:
    """How many rows have each of these verdicts, and the seconds of all."""
    each = [row.verdict for row in rows]
    counts = ", ".join(f"{each.count(verdict)} {verdict}" for verdict in verdicts)
    return f"{len(rows)} {noun}: {counts}; {sum(row.seconds for row in rows):.0f} s."
