"""The quantity and the usual range of each number of a scene.

The usual range of a key is that of real structures and no wider, so that a length in millimetres
where metres are needed falls outside. A number outside is refused. One written with a unit is taken
as intended, unless another unit would make it usual: "9 m" for "9 mm". The list `unusual` of a
scene names keys whose numbers are intended, whatever they are; a scene that is written out lists
all such keys.
"""

from collections.abc import Iterator
from functools import cache
from math import inf
from typing import Annotated, Any, NamedTuple, get_args

from pydantic import BaseModel, BeforeValidator

from beadwave.workflows.scene.units import Kind, in_si, number_of


class Quantity(NamedTuple):
    """A kind of quantity, and the usual range of its size in SI; 0 is usual everywhere."""

    kind: Kind
    low: float = 0.0
    high: float = inf
    of_high: str = ""  # what the upper end is, where it depends on other numbers of the table

    def read(self, value: Any) -> Any:
        """A number in SI of a text with a unit; anything else as it is."""
        return in_si(value, self.kind) if isinstance(value, str) else value


class ScannedNumber(NamedTuple):
    """A number of a scene: its dotted key, its value in SI, and the user's number or text."""

    key: str
    value: float
    written: Any
    quantity: Quantity

    @property
    def unusual(self) -> bool:
        """True if it lies outside of the usual range; 0 and inf are always usual."""
        size, quantity = abs(self.value), self.quantity
        return size not in (0.0, inf) and not quantity.low <= size <= quantity.high


def of(number: Any, kind: Kind, low: float = 0.0, high: float = inf) -> Any:
    """The type of a number that may have a unit, with its usual range."""
    quantity = Quantity(kind, low, high)
    return Annotated[number, quantity, BeforeValidator(quantity.read)]


def entries(
    table: BaseModel, written: Any = None, path: tuple[str, ...] = ()
) -> Iterator[ScannedNumber]:
    """Every number of a table that has a unit, with what the user wrote for it; `path` are the
    keys above the table."""
    for name in type(table).model_fields:
        value, key = getattr(table, name), (*path, name)
        below = written.get(name) if isinstance(written, dict) else None
        if isinstance(value, BaseModel):
            yield from entries(value, below, key)
            continue

        # tables by name, or in a list: under their `name`, else by their number from 1
        if isinstance(value, dict):
            for word, row in value.items():
                if isinstance(row, BaseModel):
                    row_below = below.get(word) if isinstance(below, dict) else None
                    yield from entries(row, row_below, (*key, getattr(row, "name", word)))
            continue
        if isinstance(value, tuple) and any(isinstance(row, BaseModel) for row in value):
            for i, row in enumerate(value):
                if isinstance(row, BaseModel):
                    row_below = below[i] if isinstance(below, list | tuple) else None
                    yield from entries(row, row_below, (*key, getattr(row, "name", str(i + 1))))
            continue

        # a number, or numbers at any depth of a list; a table may narrow the range of one by others
        quantity = quantity_of(type(table), name)
        if quantity and (narrowed := getattr(table, "narrowed", None)):
            quantity = narrowed(name, quantity)
        if quantity and value is not None and not isinstance(value, str):
            yield from _numbers(".".join(key), value, below, quantity)


def _numbers(key: str, value: Any, written: Any, quantity: Quantity) -> Iterator[ScannedNumber]:
    """The numbers of a value, of a list one by one, each with its text as it was written."""
    if not isinstance(value, tuple):
        yield ScannedNumber(key, value, written, quantity)
        return
    texts = written if isinstance(written, list | tuple) else (None,) * len(value)
    if len(texts) != len(value):  # one point, written without the list around it
        texts = (texts,)
    for number, text in zip(value, texts, strict=True):
        yield from _numbers(key, number, text, quantity)


@cache
def quantity_of(table: type[BaseModel], name: str) -> Quantity | None:
    """The quantity in the annotation of a field, at any depth of its unions and tuples."""
    field = table.model_fields[name]
    annotations: list[Any] = [*field.metadata, field.annotation]
    while annotations:
        annotation = annotations.pop(0)
        if isinstance(annotation, Quantity):
            return annotation
        annotations[:0] = (*get_args(annotation), *getattr(annotation, "__metadata__", ()))
    return None


def unusual_keys(numbers: Iterator[ScannedNumber]) -> tuple[str, ...]:
    """Keys with a number outside of its usual range, each once."""
    return tuple(dict.fromkeys(number.key for number in numbers if number.unusual))


def implausible(numbers: Iterator[ScannedNumber], intended: tuple[str, ...]) -> Iterator[str]:
    """A sentence on each number outside of its usual range whose key is not among the intended
    ones."""
    for number in numbers:
        if not number.unusual or number.key in intended:
            continue
        kind, low, high, of_high = number.quantity

        # the same digits in the first unit that makes the number usual
        text = number.written if isinstance(number.written, str) else f"{number.value:g}"
        digits, likely = number_of(text), None
        for unit in kind.others:
            value = in_si(f"{digits} {unit}", kind)
            if low <= abs(value) <= high:
                likely = f"{value:g} ({digits} {unit})"
                break
        if likely is None and isinstance(number.written, str):
            continue

        value = f"{number.value:g} {kind.unit}"
        if high == inf:
            usual = f"at least {low:g} {kind.unit}"
        else:
            usual = f"{low:g} to {high:g} {kind.unit}" if low else f"up to {high:g} {kind.unit}"
        usual += f" ({of_high})" if of_high else ""
        remedy = f'write "{value}" with its unit'
        if likely:
            remedy = f'did you mean {likely}? Else list the key, unusual = ["{number.key}"]'
        yield (
            f"{number.key} = {value} must be {usual} in size; {remedy}, which says that it is "
            "meant."
        )
