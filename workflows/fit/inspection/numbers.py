"""Numbers of a scene that `inspect` and `design` look for: keys, bounds, values of a record."""

from math import isfinite
from typing import Any

import numpy as np

from workflows.fit.core.calibration.parameters import Parameter
from workflows.fit.core.inspection.forward import OWN, SHARED
from workflows.scene import InvalidScene, Scene
from workflows.scene.quantities import entries
from workflows.scene.toml import changed
from workflows.sweep.cases import Base

USUAL_BOUNDS = {SHARED: (0.7, 1.4), OWN: (0.5, 2.0)}  # factors on the scene's value
SCALE = 0.02  # of the bounds' distance: a change that counts as large
MOST_NUMBERS = 12
SPEED = "striker.velocity"


def shared(base: Base, find: str, bounds: str | None) -> tuple[Parameter, ...]:
    """The numbers to find, "a.b,c.d", within their bounds, "a.b=1mm:2mm"; raises InvalidScene."""
    keys = listed("--find", find)
    limits: dict[str, tuple[float, float]] = {}
    for item in bounds.split(",") if bounds else ():
        key, _, ends = (text.strip() for text in item.partition("="))
        low_text, colon, high_text = ends.partition(":")
        if not colon or key in limits:
            raise InvalidScene(f"--bounds {item} is not key=low:high, once; write it so.")
        low, high = base.number(key, low_text.strip()), base.number(key, high_text.strip())
        if not (isfinite(low) and isfinite(high) and low < high):
            raise InvalidScene(f"--bounds {item} must be finite and grow; turn or change them.")
        limits[key] = low, high
    if unknown := next((key for key in limits if key not in keys), None):
        raise InvalidScene(
            f"--bounds {unknown} is not among the numbers to find; add it to --find."
        )
    if len(keys) > MOST_NUMBERS:
        raise InvalidScene(
            f"--find names {len(keys)} numbers, up to {MOST_NUMBERS} are allowed; drop some."
        )
    scene = base.with_values({})
    return tuple(_bounded(scene, key, number(scene, key), SHARED, limits.get(key)) for key in keys)


def listed(option: str, text: str) -> list[str]:
    """The keys of a list; raises InvalidScene for none and for one that comes twice."""
    keys = [key.strip() for key in text.split(",") if key.strip()]
    if not keys:
        raise InvalidScene(f"{option} names nothing; write {option} wall.frequency, for example.")
    if twice := next((key for key in keys if keys.count(key) > 1), None):
        raise InvalidScene(f"{option} names {twice} twice; drop one.")
    return keys


def number(scene: Scene, key: str) -> float:
    """The value of a key; raises InvalidScene for a key that has none or no number."""
    value: Any = scene
    for name in key.split("."):
        value = _entry(value, name)
    if isinstance(value, bool) or not isinstance(value, int | float):
        reason = "has no value" if value is None else f"is {value!r}"
        raise InvalidScene(
            f"{key} {reason} in {scene.name}; name a key whose value is one number, as chain.young."
        )
    if isinstance(value, int):
        raise InvalidScene(f"{key} = {value} counts; name a key that varies smoothly.")
    return value


def _entry(table: Any, name: str) -> Any:
    """An entry of a table, or a table of a list by its name; None where there is none."""
    if isinstance(table, tuple):
        return next((item for item in table if getattr(item, "name", None) == name), None)
    return table.get(name) if isinstance(table, dict) else getattr(table, name, None)


def _bounded(
    scene: Scene, key: str, start: float, kind: str, limits: tuple[float, float] | None = None
) -> Parameter:
    """The number of a key within its bounds; raises InvalidScene where they do not hold its
    start."""
    if limits is None and start == 0.0:
        raise InvalidScene(
            f"{key} = 0 does not say how far it may go; add --bounds {key}=low:high."
        )
    low, high = limits or sorted(factor * start for factor in USUAL_BOUNDS[kind])
    if not low <= start <= high:
        raise InvalidScene(
            f"--bounds {key}={low:g}:{high:g} must hold the scene's value {start:g}; widen them or "
            "change the scene."
        )
    unit = next((entry.quantity.kind.unit for entry in entries(scene) if entry.key == key), "")
    return Parameter(key, kind, start, low, high, SCALE * (high - low), unit)


def per_record(base: Base, each: str, n_records: int) -> list[list[Parameter]]:
    """Numbers that every record has for itself, "key" or "key=v1,v2,..;key2", or "none"; by record.

    Raises InvalidScene.
    """
    scene = base.with_values({})
    numbers: list[list[Parameter]] = [[] for _ in range(n_records)]
    for item in () if each == "none" else each.split(";"):
        if not item.strip():
            continue
        key, _, texts = (text.strip() for text in item.partition("="))
        values = [base.number(key, text.strip()) for text in texts.split(",")] if texts else []
        if values and len(values) != n_records:
            raise InvalidScene(
                f"--each {key} has {len(values)} values for {n_records} records; give one for each."
            )
        for i, of_record in enumerate(numbers):
            start = values[i] if values else number(scene, key)
            of_record.append(_bounded(scene, key, start, OWN))
    return numbers


def usual_each(scene: Scene, find: str) -> str:
    """What every record has for itself unless it is found for all."""
    return SPEED if scene.striker and SPEED not in listed("--find", find) else "none"


def scene_at(base: Base, keys: tuple[str, ...], values: np.ndarray) -> Scene:
    """The scene with its keys at these values (q,), checked; raises InvalidScene."""
    return base.with_values(dict(zip(keys, map(float, values), strict=True)))


def changed_base(base: Base, values: dict[str, Any]) -> Base:
    """The scene with other values, to be varied further; raises InvalidScene."""
    base.with_values(values)
    return Base(base.written._replace(tables=changed(base.written.tables, values.items())))


def put(scene: Scene, keys: tuple[str, ...], values: np.ndarray) -> Scene:
    """`scene_at`, unchecked and quicker, of a scene whose bounds have been checked."""
    tables: dict[str, Any] = {}
    for key, value in zip(keys, map(float, values), strict=True):
        first, *path = key.split(".")
        tables[first] = _with_entry(tables.get(first, getattr(scene, first)), path, value)
    return scene.model_copy(update=tables)


def _with_entry(table: Any, path: list[str], value: float) -> Any:
    """The table with the value at a path of names below it."""
    if not path:
        return value
    first, *path = path
    if isinstance(table, tuple):
        return tuple(_with_entry(t, path, value) if t.name == first else t for t in table)
    entry = _with_entry(_entry(table, first), path, value)
    if isinstance(table, dict):
        return {**table, first: entry}
    return table.model_copy(update={first: entry})


def require_possible(base: Base, parameters: tuple[Parameter, ...]) -> None:
    """Raise InvalidScene where the end of a number's bounds is no value that a scene may have."""
    for p in parameters:
        for end in (p.low, p.high):
            try:
                base.with_values({p.name: end})
            except InvalidScene as reason:
                raise InvalidScene(f"bounds of {p.name}, {p.low:g}:{p.high:g}: {reason}") from None
