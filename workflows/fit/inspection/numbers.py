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

USUAL = {SHARED: (0.7, 1.4), OWN: (0.5, 2.0)}  # of the scene's value
SCALE = 0.02  # of the bounds' distance: a change that counts as large
MOST = 12  # numbers
SPEED = "striker.velocity"


def shared(base: Base, find: str, bounds: str | None) -> tuple[Parameter, ...]:
    """The numbers to find, "a.b,c.d", within their bounds, "a.b=1mm:2mm"; raises InvalidScene."""
    keys = listed("--find", find)
    limits = _bounds(base, bounds)
    if unknown := next((key for key in limits if key not in keys), None):
        raise InvalidScene(
            f"--bounds {unknown} is not among the numbers to find; add it to --find."
        )
    if len(keys) > MOST:
        raise InvalidScene(
            f"--find names {len(keys)} numbers, up to {MOST} are allowed; drop some."
        )
    scene = base.with_values({})
    return tuple(_bounded(scene, key, number(scene, key), limits.get(key)) for key in keys)


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
    found: Any = scene
    for name in key.split("."):
        found = _below(found, name)
    if isinstance(found, bool) or not isinstance(found, int | float):
        told = "has no value" if found is None else f"is {found!r}"
        raise InvalidScene(
            f"{key} {told} in {scene.name}; name a key whose value is one number, as chain.young."
        )
    if isinstance(found, int):
        raise InvalidScene(f"{key} = {found} counts; name a key that varies smoothly.")
    return found


def _below(table: Any, name: str) -> Any:
    if isinstance(table, tuple):
        return next((one for one in table if getattr(one, "name", None) == name), None)
    return table.get(name) if isinstance(table, dict) else getattr(table, name, None)


def _bounds(base: Base, text: str | None) -> dict[str, tuple[float, float]]:
    found = {}
    for item in text.split(",") if text else ():
        key, _, limits = (part.strip() for part in item.partition("="))
        low, colon, high = limits.partition(":")
        if not colon or key in found:
            raise InvalidScene(f"--bounds {item} is not key=low:high, once; write it so.")
        pair = tuple(base.number(key, end.strip()) for end in (low, high))
        if not (all(map(isfinite, pair)) and pair[0] < pair[1]):
            raise InvalidScene(f"--bounds {item} must be finite and grow; turn or change them.")
        found[key] = pair
    return found


def _bounded(scene: Scene, key: str, value: float, limits=None, kind=SHARED) -> Parameter:
    if limits is None and value == 0.0:
        raise InvalidScene(
            f"{key} = 0 does not say how far it may go; add --bounds {key}=low:high."
        )
    low, high = limits or sorted(factor * value for factor in USUAL[kind])
    if not low <= value <= high:
        raise InvalidScene(
            f"--bounds {key}={low:g}:{high:g} must hold the scene's value {value:g}; widen them or "
            "change the scene."
        )
    unit = next((one.quantity.kind.unit for one in entries(scene) if one.key == key), "")
    return Parameter(key, kind, value, low, high, SCALE * (high - low), unit)


def own(base: Base, each: str, n_records: int) -> list[list[Parameter]]:
    """Numbers that every record has for itself, "key" or "key=v1,v2,..;key2", or "none"; by record.

    Raises InvalidScene.
    """
    scene = base.with_values({})
    found: list[list[Parameter]] = [[] for _ in range(n_records)]
    for item in filter(None, map(str.strip, () if each == "none" else each.split(";"))):
        key, _, values = (part.strip() for part in item.partition("="))
        told = [base.number(key, value.strip()) for value in values.split(",")] if values else []
        if told and len(told) != n_records:
            raise InvalidScene(
                f"--each {key} has {len(told)} values for {n_records} records; give one for each."
            )
        for i, record in enumerate(found):
            start = told[i] if told else number(scene, key)
            record.append(_bounded(scene, key, start, None, OWN))
    return found


def usual_each(scene: Scene, find: str) -> str:
    """What every record has for itself unless it is found for all."""
    return SPEED if scene.striker and SPEED not in listed("--find", find) else "none"


def moved(base: Base, keys: tuple[str, ...], values: np.ndarray) -> Scene:
    """The scene with numbers at these values, checked; raises InvalidScene."""
    return base.with_values(dict(zip(keys, map(float, values), strict=True)))


def changed_base(base: Base, values: dict[str, Any]) -> Base:
    """The scene with other values, to be varied further; raises InvalidScene."""
    base.with_values(values)
    return Base(base.written._replace(tables=changed(base.written.tables, values.items())))


def put(scene: Scene, keys: tuple[str, ...], values: np.ndarray) -> Scene:
    """The same, unchecked, of a scene whose bounds have been checked."""
    tables: dict[str, Any] = {}
    for key, value in zip(keys, map(float, values), strict=True):
        first, *rest = key.split(".")
        tables[first] = _put(tables.get(first, getattr(scene, first)), rest, value)
    return scene.model_copy(update=tables)


def _put(table: Any, path: list[str], value: float) -> Any:
    if not path:
        return value
    first, *rest = path
    if isinstance(table, tuple):
        return tuple(_put(t, rest, value) if t.name == first else t for t in table)
    below = _put(_below(table, first), rest, value)
    if isinstance(table, dict):
        return {**table, first: below}
    return table.model_copy(update={first: below})


def require_possible(base: Base, parameters: tuple[Parameter, ...]) -> None:
    """Raise InvalidScene where the end of a number's bounds is no value that a scene may have."""
    for p in parameters:
        for end in (p.low, p.high):
            try:
                base.with_values({p.name: end})
            except InvalidScene as reason:
                raise InvalidScene(f"bounds of {p.name}, {p.low:g}:{p.high:g}: {reason}") from None
