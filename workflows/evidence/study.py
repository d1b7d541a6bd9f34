"""Sentences of a study from its template, formats of numbers, pieces with the time left.

The sentences of a study are the Markdown template beside its module, filled with computed numbers.
"""

from collections.abc import Callable, Iterable, Iterator
from functools import cache
from math import isfinite, isnan
from pathlib import Path
from time import perf_counter
from typing import Any, TypeVar

from beadwave.workflows.stages.progress import Progress

PREFIXES = {"nano": 1e9, "micro": 1e6, "milli": 1e3, "kilo": 1e-3, "giga": 1e-9}

Piece = TypeVar("Piece")


def rendered(module: str, **numbers: Any) -> tuple[str, ...]:
    """Paragraphs of the template beside a module (its __file__); a number it lacks is an error."""
    file = Path(module).with_suffix(".md")
    text = _environment(file.parent).get_template(file.name).render(numbers)
    paragraphs = (" ".join(paragraph.split()) for paragraph in text.split("\n\n"))
    return tuple(filter(None, paragraphs))


@cache  # a folder's templates are read once; jinja2 is imported by the first study that is run
def _environment(folder: Path):
    """jinja2 with the formats of numbers as filters; a name that is not given is an error, so that
    a sentence never has a gap."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(folder), undefined=StrictUndefined, autoescape=False,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    for name, factor in PREFIXES.items():  # a number in a unit with an SI prefix
        environment.filters[name] = lambda value, factor=factor: factor * value
    formats = (digits, places, power, signed, percent, listed, between, only_finite, verdict)
    environment.filters |= {function.__name__: function for function in formats}
    return environment


def digits(value: float, count: int = 6) -> str:
    """A number as text with `count` significant digits."""
    return f"{value:.{count}g}"


def places(value: float, count: int = 0) -> str:
    """A number as text with `count` decimals; no minus zero, a dash for nan."""
    return "-" if isnan(value) else f"{round(value, count) + 0.0:.{count}f}"


def power(value: float, count: int = 1) -> str:
    """A number as text with a power of ten and `count` decimals."""
    return f"{value:.{count}e}"


def signed(value: float, count: int = 0) -> str:
    """A number as text with its sign and `count` decimals."""
    return f"{value:+.{count}f}"


def percent(value: float, count: int = 0) -> str:
    """A share in percent; a dash for nan."""
    return "-" if isnan(value) else f"{places(100 * value, count)} %"


def listed(values: Iterable, word: str = "and") -> str:
    """Words as a list in a sentence, "a, b and c", with `word` before the last."""
    *first, last = map(str, values)
    return f"{', '.join(first)} {word} {last}" if first else last


def between(values: Iterable[float], count: int = 3) -> str:
    """Smallest to largest; one number where both are written alike."""
    low, high = places(min(values), count), places(max(values), count)
    return low if low == high else f"{low} to {high}"


def only_finite(values: Iterable[float]) -> list[float]:
    """The values that are numbers, neither nan nor infinite."""
    return list(filter(isfinite, values))


def verdict(holds: bool | None) -> str:
    """Words for whether a statement holds; None: it cannot be judged."""
    return "cannot be judged" if holds is None else "holds" if holds else "does not hold"


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
