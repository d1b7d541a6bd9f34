"""Which cases a sweep has: grids, lists, samples and tables of values for keys of a scene."""

import csv
from collections.abc import Callable, Iterable
from itertools import combinations, product
from math import isfinite, isinf, prod
from pathlib import Path
from tomllib import loads
from typing import Any

import numpy as np

from workflows.scene import InvalidScene
from workflows.scene.named_files import require_file
from workflows.scene.toml import undoes, value_of
from workflows.sweep.core.design import Axis, Design, combined, latin_hypercube, sobol

MOST_CASES = 10_000_000  # rows of a table that a laptop still holds
SAMPLES = ("lhs", "sobol")
FORMS = "start:stop:n, start:stop:n:log, or a list a,b,c"
RANGE = "low:high or low:high:log"

Number = Callable[[str, str], float]  # of a key and a text, which may have a unit


def grid(over: Iterable[str], number: Number) -> Design:
    """Every combination of the values of all axes, the last key varying fastest.

    Raises InvalidScene for an axis that cannot be read and for more cases than a table holds.
    """
    axes = _distinct([_grid_axis(text, number) for text in over])
    _require_number(prod(len(axis.values) for axis in axes))
    return combined(axes)


def sampled(over: Iterable[str], sample: str, seed: int, number: Number) -> Design:
    """Latin hypercube ("lhs:n"), or a Sobol design ("sobol:n"); raises InvalidScene."""
    kind, n = _sample(sample)
    axes = _distinct([_range_axis(text, number) for text in over])
    _require_number(n * (len(axes) + 2 if kind == "sobol" else 1))
    return (sobol if kind == "sobol" else latin_hypercube)(axes, n, seed)


def table(path: Path) -> Design:
    """The cases of a CSV file: a line of keys, then a line of values for each case."""
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
    keys = [cell.strip() for cell in lines[0]]
    for key in keys:
        _require_key(key, f"--cases {path}")
    if len(set(keys)) < len(keys):
        raise InvalidScene(f"--cases {path} names a key twice; name each once.")
    _require_apart(keys, f"--cases {path}")
    for i, line in enumerate(lines[1:], start=2):
        if len(line) != len(keys):
            raise InvalidScene(
                f"--cases {path}: line {i} has {len(line)} values for {len(keys)} keys; give one "
                "for each key."
            )
    _require_number(len(lines) - 1)
    rows = ([_value(cell.strip()) for cell in line] for line in lines[1:])
    return Design("table", _columns(keys, rows))


def _columns(keys: list[str], rows: Iterable[Iterable[Any]]) -> dict[str, tuple[Any, ...]]:
    return dict(zip(keys, zip(*rows, strict=True), strict=True))


def _distinct(axes: list[Axis]) -> list[Axis]:
    keys = [axis.key for axis in axes]
    if not axes:
        raise InvalidScene(f"a sweep needs keys to vary; write --over key={FORMS}, or --cases.")
    if twice := next((key for key in keys if keys.count(key) > 1), None):
        raise InvalidScene(f"--over names {twice} twice; give all its values at once.")
    _require_apart(keys, "--over")
    return axes


def _require_apart(keys: list[str], where: str) -> None:
    """Raise InvalidScene for two keys of which one undoes the other."""
    for one, other in combinations(keys, 2):
        if undoes(one, other) or undoes(other, one):
            raise InvalidScene(
                f"{where} varies both {one} and {other}, of which one undoes the other; vary one "
                "of them."
            )


def require_free(design: Design, given: Iterable[str]) -> tuple[str, ...]:
    """What to know of changes to keys that vary, in sentences: such a change is the value of the
    scene, which may need one. Raises InvalidScene for a change that the cases undo beside it."""
    for key, one in product(design.keys, given):
        if key != one and undoes(key, one):
            raise InvalidScene(f"{key} varies, which undoes --set {one}; drop one of them.")
    both = (key for key in design.keys if key in given)
    return tuple(f"--set {key} is of the scene alone: the cases vary it" for key in both)


def _split(text: str, form: str) -> tuple[str, str]:
    key, equals, values = (part.strip() for part in text.partition("="))
    if not equals or not values:
        raise InvalidScene(f"--over {text!r} is not key=values; write key={form}.")
    _require_key(key, "--over")
    return key, values


def _require_key(key: str, where: str) -> None:
    if not all(key.split(".")):
        raise InvalidScene(f"{where} {key!r} is no dotted key; write chain.young, for example.")


def _grid_axis(text: str, number: Number) -> Axis:
    key, values = _split(text, FORMS)
    parts = values.split(":")
    if len(parts) == 1:
        return Axis(key, _listed(values))
    if len(parts) not in (3, 4) or parts[3:] not in ([], ["log"]):
        raise InvalidScene(f"--over {text} must be {FORMS}, or {RANGE} beside --sample.")
    low, high = (number(key, part.strip()) for part in parts[:2])
    n = _whole(parts[2], text)
    if n == 1:
        raise InvalidScene(f"--over {text} has one value; take --set {key}={parts[0]}.")
    axis = _checked(Axis(key, (), low, high, bool(parts[3:])), text)
    spaced = axis.at(np.linspace(0.0, 1.0, n))
    spaced[[0, -1]] = low, high  # as they are given, not as they are rounded
    whole = all(part.strip().lstrip("-").isdecimal() for part in parts[:2])
    exact = max(abs(low), abs(high)) < 2**53  # whole numbers that a float tells apart
    if whole and exact and np.allclose(spaced, np.round(spaced), 1e-12, 0.0):  # of keys that count
        spaced = np.round(spaced).astype(int)
    return axis._replace(values=tuple(spaced.tolist()))


def _range_axis(text: str, number: Number) -> Axis:
    key, values = _split(text, RANGE)
    parts = values.split(":")
    if len(parts) not in (2, 3) or parts[2:] not in ([], ["log"]):
        raise InvalidScene(f"--over {text} beside --sample must be {RANGE}.")
    low, high = (number(key, part.strip()) for part in parts[:2])
    return _checked(Axis(key, (), low, high, bool(parts[2:])), text)


def _checked(axis: Axis, text: str) -> Axis:
    if not isfinite(axis.high - axis.low) or axis.low == axis.high:
        raise InvalidScene(f"--over {text} must run between two finite numbers that differ.")
    if axis.logarithmic and min(axis.low, axis.high) <= 0.0:
        raise InvalidScene(f"--over {text} is logarithmic and must run between numbers above 0.")
    return axis


def _listed(text: str) -> tuple[Any, ...]:
    """Values of a list: TOML values, or bare words."""
    try:
        lines = loads(f"values = [{text}]")
    except (ValueError, RecursionError):
        lines = {}
    if len(lines) == 1:  # more lines are more than a list
        return tuple(_in_column(value, text) for value in lines["values"])
    return tuple(_value(part.strip()) for part in text.split(","))


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


def counted(text: str, most: int) -> int | None:
    """The whole number from 1 to `most` that a text is; None for any other text."""
    digits = text.strip()
    # digits are counted first: Python refuses to read thousands of them
    if not digits.isdecimal() or len(digits) > len(str(most)):
        return None
    return int(digits) if 1 <= int(digits) <= most else None


def _whole(text: str, where: str) -> int:
    n = counted(text, MOST_CASES)
    if n is None:
        raise InvalidScene(
            f"--over {where}: {text.strip()!r} must be a number of values up to {MOST_CASES}."
        )
    return n


def _sample(text: str) -> tuple[str, int]:
    kind, _, number = text.partition(":")
    n = counted(number, MOST_CASES) or 0
    if kind not in SAMPLES or n < 2:
        raise InvalidScene(
            f"--sample {text} must be lhs:n or sobol:n with n between 2 and {MOST_CASES}."
        )
    if kind == "sobol" and n.bit_count() != 1:
        above = 1 << n.bit_length()
        raise InvalidScene(
            f"--sample {text}: Sobol sequences are balanced at powers of 2; take {above // 2} or "
            f"{above}."
        )
    return kind, n


def _require_number(n: int) -> None:
    if n > MOST_CASES:
        raise InvalidScene(f"the sweep has {n} cases, a table holds {MOST_CASES}; take fewer.")
