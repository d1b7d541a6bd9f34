"""What a number of a scene measures, and the range in which it is usual.

The range of a key holds what is built and rolled, and no more than that: a length in millimetres
where metres are asked for falls outside. A number outside is refused; with its unit it is meant,
unless another unit makes it usual: "9 m" for "9 mm". The list `unusual` of a scene names the keys
whose numbers are meant whatever they are; a scene that is written out lists all such keys.
"""

from collections.abc import Iterator
from functools import cache
from math import inf
from typing import Annotated, Any, NamedTuple, get_args

from pydantic import BaseModel, BeforeValidator

from workflows.scene.units import Kind, in_si, number_of


class Quantity(NamedTuple):
    """A kind of quantity, and the usual size of it in SI; 0 is usual everywhere."""

    kind: Kind
    least: float = 0.0
    most: float = inf

    def read(self, value: Any) -> Any:
        """A number in SI of a text with a unit; anything else as it is."""
        return in_si(value, self.kind) if isinstance(value, str) else value


class Entry(NamedTuple):
    """A number of a scene: its dotted key, and what stood for it in the user's tables."""

    key: str
    value: float
    written: Any
    quantity: Quantity

    @property
    def unusual(self) -> bool:
        """Whether it lies outside of the usual range; what is infinite is meant."""
        least, most = self.quantity[1:]
        return self.value != 0 and abs(self.value) != inf and not least <= abs(self.value) <= most


def of(number: Any, kind: Kind, least: float = 0.0, most: float = inf) -> Any:
    """The type of a number that may have a unit, with its usual range."""
    quantity = Quantity(kind, least, most)
    return Annotated[number, quantity, BeforeValidator(quantity.read)]


def entries(table: BaseModel, written: Any = None, path: tuple[str, ...] = ()) -> Iterator[Entry]:
    """Every number of a table that has a unit, beside what the user wrote for it."""
    for name in type(table).model_fields:
        value, here = getattr(table, name), (*path, name)
        below = written.get(name) if isinstance(written, dict) else None
        if several := _tables(value):
            for key, one in several.items():
                yield from entries(one, _under(below, key), (*here, getattr(one, "name", str(key))))
        elif isinstance(value, BaseModel):
            yield from entries(value, below, here)
        elif (
            value is not None
            and not isinstance(value, str)
            and (quantity := _quantity(type(table), name))
        ):
            yield from _numbers(".".join(here), value, below, quantity)


def _tables(value: Any) -> dict[str | int, BaseModel]:
    """Tables by name or, of a list, by their number from 1."""
    named = value if isinstance(value, dict) else {}
    if isinstance(value, tuple):
        named = dict(enumerate(value, start=1))
    return {key: one for key, one in named.items() if isinstance(one, BaseModel)}


def _under(written: Any, key: str | int) -> Any:
    if isinstance(written, dict):
        return written.get(key)
    return written[key - 1] if isinstance(written, list | tuple) else None


def _numbers(key: str, value: Any, written: Any, quantity: Quantity) -> Iterator[Entry]:
    if not isinstance(value, tuple):
        yield Entry(key, value, written, quantity)
        return
    each = written if isinstance(written, list | tuple) else (None,) * len(value)
    for one, as_written in zip(value, each, strict=True):
        yield from _numbers(key, one, as_written, quantity)


@cache
def _quantity(table: type[BaseModel], name: str) -> Quantity | None:
    field = table.model_fields[name]
    return next(_within((*field.metadata, field.annotation)), None)


def _within(parts: tuple[Any, ...]) -> Iterator[Quantity]:
    for part in parts:
        if isinstance(part, Quantity):
            yield part
        else:
            yield from _within((*get_args(part), *getattr(part, "__metadata__", ())))


def unusual_keys(found: Iterator[Entry]) -> tuple[str, ...]:
    """Keys with a number outside of its usual range, each once."""
    return tuple(dict.fromkeys(entry.key for entry in found if entry.unusual))


def implausible(found: Iterator[Entry], meant: tuple[str, ...]) -> Iterator[str]:
    """A sentence on each number outside of its usual range that does not say that it is meant."""
    for entry in found:
        if entry.unusual and entry.key not in meant:
            likely = _likely(entry)
            if likely or not isinstance(entry.written, str):
                yield _sentence(entry, likely)


def _number(entry: Entry) -> str:
    """Without its unit, as it is written."""
    text = entry.written if isinstance(entry.written, str) else f"{entry.value:g}"
    return number_of(text)


def _likely(entry: Entry) -> str | None:
    """The same number in the first unit that makes it usual."""
    (kind, least, most), number = entry.quantity, _number(entry)
    guesses = {f"{number} {unit}": in_si(f"{number} {unit}", kind) for unit in kind.others}
    told = (f"{si:g} ({text})" for text, si in guesses.items() if least <= abs(si) <= most)
    return next(told, None)


def _sentence(entry: Entry, likely: str | None) -> str:
    (kind, least, most), value = entry.quantity, f"{entry.value:g} {entry.quantity.kind.unit}"
    usual = f"{least:g} to {most:g} {kind.unit}" if least else f"up to {most:g} {kind.unit}"
    meant = f'write "{value}" with its unit'
    if likely:
        meant = f'did you mean {likely}? Else list the key, unusual = ["{entry.key}"]'
    return f"{entry.key} = {value} must be {usual} in size; {meant}, which says that it is meant."
