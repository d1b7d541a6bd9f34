"""Designs of a sweep from text: grids, lists, samples and tables of values for keys of a scene."""

import csv
import re
from collections.abc import Callable, Iterable
from itertools import combinations, product
from math import isfinite, isinf, prod
from pathlib import Path
from tomllib import loads
from typing import Any

import numpy as np

from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.scene.named_files import require_file
from beadwave.workflows.scene.toml import undoes, value_of
from beadwave.workflows.sweep.core.design import Axis, Design, combined, latin_hypercube, sobol

MOST_CASES = 10_000_000  # rows of a table that a laptop still holds
SAMPLES = ("lhs", "sobol")
FORMS = "start:stop:n, start:stop:n:log, or a list a,b,c"
RANGE = "low:high or low:high:log"

Number = Callable[[str, str], float]  # of a key and a text, which may have a unit


def grid(over: Iterable[str], number: Number) -> Design:
    """Every combination of the values of all axes, the last key varying fastest.

    Each text of `over` is one axis: "key=start:stop:n", "key=start:stop:n:log" or "key=a,b,c".
    Raises InvalidScene for an axis that cannot be read and for more cases than a table holds.
    """
    axes = []
    for text in over:
        key, values = _split(text, FORMS)
        fields = values.split(":")
        if len(fields) == 1:
            if re.search(r"^,|,\s*,|,$", values):
                raise InvalidScene(f"--over {text} has an empty value; write key=a,b,c.")
            # a text that is a number with a unit by its key is that number, as in a range
            meant = [_with_unit(key, value, number) for value in _list_values(values)]
            axes.append(Axis(key, tuple(meant)))
            continue
        if len(fields) not in (3, 4) or fields[3:] not in ([], ["log"]):
            raise InvalidScene(f"--over {text} must be {FORMS}, or {RANGE} with --sample.")
        low, high = (number(key, field.strip()) for field in fields[:2])
        n = counted(fields[2], MOST_CASES)
        if n is None:
            raise InvalidScene(
                f"--over {text}: {fields[2].strip()!r} must be a number of values up to "
                f"{MOST_CASES}."
            )
        if n == 1:
            raise InvalidScene(f"--over {text} has one value; take --set {key}={fields[0]}.")
        axis = _sound(Axis(key, (), low, high, bool(fields[3:])), text)

        # the ends are the given numbers, not what linspace rounds them to
        spaced = axis.at(np.linspace(0.0, 1.0, n))
        spaced[[0, -1]] = low, high

        # keys that count want integers: whole ends, whole steps, all below 2^53, where a float
        # tells neighbouring integers apart
        integer_ends = all(field.strip().lstrip("-").isdecimal() for field in fields[:2])
        exact = max(abs(low), abs(high)) < 2**53
        if integer_ends and exact and np.allclose(spaced, np.round(spaced), 1e-12, 0.0):
            spaced = np.round(spaced).astype(int)
        axes.append(axis._replace(values=tuple(spaced.tolist())))
    _require_distinct(axes)
    _require_number(prod(len(axis.values) for axis in axes))
    return combined(axes)


def sampled(over: Iterable[str], sample: str, seed: int, number: Number) -> Design:
    """Latin hypercube ("lhs:n"), or a Sobol design ("sobol:n"), of ranges "key=low:high" or
    "key=low:high:log"; raises InvalidScene for what is neither, for a Sobol design whose n is no
    power of 2, and for more cases than a table holds."""
    kind, _, digits = sample.partition(":")
    n = counted(digits, MOST_CASES) or 0
    if kind not in SAMPLES or n < 2:
        raise InvalidScene(
            f"--sample {sample} must be lhs:n or sobol:n with n between 2 and {MOST_CASES}."
        )
    if kind == "sobol" and n.bit_count() != 1:
        above = 1 << n.bit_length()
        raise InvalidScene(
            f"--sample {sample}: Sobol sequences are balanced at powers of 2; take {above // 2} or "
            f"{above}."
        )

    axes = []
    for text in over:
        key, values = _split(text, RANGE)
        fields = values.split(":")
        if len(fields) not in (2, 3) or fields[2:] not in ([], ["log"]):
            raise InvalidScene(f"--over {text} with --sample must be {RANGE}.")
        low, high = (number(key, field.strip()) for field in fields[:2])
        axes.append(_sound(Axis(key, (), low, high, bool(fields[2:])), text))
    _require_distinct(axes)

    # Saltelli's scheme: A, B and one mixed matrix per key
    _require_number(n * (len(axes) + 2 if kind == "sobol" else 1))
    return (sobol if kind == "sobol" else latin_hypercube)(axes, n, seed)


def table(path: Path, number: Number) -> Design:
    """The cases of a CSV file: a line of keys, then a line of values for each case, numbers with
    units among them. Raises InvalidScene for a file that cannot be read, for lines of another
    length than the first, and for keys that come twice or undo each other."""
    require_file(path, "give a CSV file", key="--cases ")
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            lines = [line for line in csv.reader(file) if any(cell.strip() for cell in line)]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or "it is no CSV in UTF-8"
        raise InvalidScene(f"--cases {path} cannot be read ({reason}); give a CSV file.") from None
    if len(lines) < 2:
        raise InvalidScene(
            f"--cases {path} has {len(lines)} lines; give a line of keys and one for each case."
        )

    # the first line: keys, which semicolons or tabs would leave as one
    keys = [cell.strip() for cell in lines[0]]
    if len(keys) == 1 and (mark := next((mark for mark in (";", "\t") if mark in keys[0]), "")):
        name = "semicolons" if mark == ";" else "tabs"
        raise InvalidScene(
            f"--cases {path} has {name} between its values; write commas, and decimal points."
        )
    for key in keys:
        _require_key(key, f"--cases {path}")
    if len(set(keys)) < len(keys):
        raise InvalidScene(f"--cases {path} names a key twice; name each once.")
    _require_independent(keys, f"--cases {path}")
    for i, line in enumerate(lines[1:], start=2):
        if len(line) != len(keys):
            raise InvalidScene(
                f"--cases {path}: line {i} has {len(line)} values for {len(keys)} keys; give one "
                "for each key."
            )

    # a column of values by key; equal cells are read once, since a unit is read by the scene
    _require_number(len(lines) - 1)
    columns = {}
    for key, *cells in zip(keys, *lines[1:], strict=True):
        meant = {cell: _with_unit(key, _value(cell.strip()), number) for cell in set(cells)}
        columns[key] = tuple(meant[cell] for cell in cells)
    return Design("table", columns)


def require_free(design: Design, given: Iterable[str]) -> tuple[str, ...]:
    """Notes, in sentences, on the changes (`given`, dotted keys of --set) to keys that vary: such
    a change holds for the scene alone, which may need a value there. Raises InvalidScene for a
    change that the values of the cases would undo."""
    for key, changed_key in product(design.keys, given):
        if key != changed_key and undoes(key, changed_key):
            raise InvalidScene(f"{key} varies, which undoes --set {changed_key}; drop one of them.")
    both = (key for key in design.keys if key in given)
    return tuple(f"--set {key} is of the scene alone: the cases vary it" for key in both)


def counted(text: str, largest: int) -> int | None:
    """The whole number from 1 to `largest` that a text is; None for any other text."""
    digits = text.strip()
    # digits are counted first: Python refuses to read thousands of them
    if not digits.isdecimal() or len(digits) > len(str(largest)):
        return None
    return int(digits) if 1 <= int(digits) <= largest else None


def _split(text: str, form: str) -> tuple[str, str]:
    """Key and values of "key=values"; raises InvalidScene, which shows the form."""
    key, equals, values = (field.strip() for field in text.partition("="))
    if not equals or not values:
        raise InvalidScene(f"--over {text!r} is not key=values; write key={form}.")
    _require_key(key, "--over")
    return key, values


def _sound(axis: Axis, text: str) -> Axis:
    """The axis; raises InvalidScene where no values lie between its ends."""
    if not isfinite(axis.high - axis.low) or axis.low == axis.high:
        raise InvalidScene(f"--over {text} must run between two finite numbers that differ.")
    if axis.logarithmic and min(axis.low, axis.high) <= 0.0:
        raise InvalidScene(f"--over {text} is logarithmic and must run between numbers above 0.")
    return axis


def _require_distinct(axes: list[Axis]) -> None:
    """Raise InvalidScene for no axis at all, and for axes that vary the same thing."""
    keys = [axis.key for axis in axes]
    if not axes:
        raise InvalidScene(f"a sweep needs keys to vary; write --over key={FORMS}, or --cases.")
    if twice := next((key for key in keys if keys.count(key) > 1), None):
        raise InvalidScene(f"--over names {twice} twice; give all its values at once.")
    _require_independent(keys, "--over")


def _require_independent(keys: list[str], where: str) -> None:
    """Raise InvalidScene for two keys of which one undoes the other."""
    for first, second in combinations(keys, 2):
        if undoes(first, second) or undoes(second, first):
            raise InvalidScene(
                f"{where} varies both {first} and {second}, of which one undoes the other; vary "
                "one of them."
            )


def _require_key(key: str, where: str) -> None:
    if not all(key.split(".")):
        raise InvalidScene(f"{where} {key!r} is no dotted key; write chain.young, for example.")


def _require_number(n: int) -> None:
    if n > MOST_CASES:
        raise InvalidScene(f"the sweep has {n} cases, a table holds {MOST_CASES}; take fewer.")


def _list_values(text: str) -> tuple[Any, ...]:
    """Values of the list "a,b,c": TOML values, or bare words."""
    try:
        document = loads(f"values = [{text}]")
    except (ValueError, RecursionError):
        document = {}
    # a text with line breaks and further keys is TOML, but no list
    if len(document) == 1:
        return tuple(_in_column(value, text) for value in document["values"])
    return tuple(_value(word.strip()) for word in text.split(","))


def _with_unit(key: str, value: Any, number: Number) -> Any:
    """The number that a text with a unit means for its key; any other value as it is."""
    if not isinstance(value, str) or not value.lstrip("+-.")[:1].isdigit():
        return value
    try:
        return number(key, value)
    except InvalidScene:
        return value  # its case is refused, and the others run


def _value(text: str) -> Any:
    """A TOML value; a bare word is a string."""
    return _in_column(value_of(text), text)


def _in_column(value: Any, text: str) -> Any:
    """The value as a column holds it: a whole number beyond 64 bits as a float, and one beyond all
    floats as its text, for which its case is refused; only "inf" itself is infinite."""
    if isinstance(value, int) and not -(2**63) <= value < 2**63:
        value = float(str(value))
    overflows = isinstance(value, float) and isinf(value) and "inf" not in text.lower()
    return text if overflows else value
