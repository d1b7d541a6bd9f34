"""Scenes from and to TOML: changed by `--set`, completed by defaults, refused in one sentence."""

import tomllib
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import BaseModel, ValidationError

from workflows.scene import (
    Contact,
    InvalidScene,
    Joints,
    Mesh,
    NoDamping,
    Output,
    Patch,
    Reduction,
    RomWall,
    Scene,
    Time,
)
from workflows.scene.allowed_words import allowed_words
from workflows.scene.bodies import General, Meshing
from workflows.scene.contradictions import contradictions
from workflows.scene.gravity import fallen
from workflows.scene.quantities import entries, implausible, unusual_keys

Change = str | tuple[str, Any]  # "key=value" as --set takes it, or a dotted key and its value
GENERAL = General.model_fields.keys()  # keys of an assembly of bodies
INSTEAD = {
    "striker.velocity": {"drop"},
    "striker.drop": {"velocity"},
    "time.dt": {"error"},
    "time.error": {"dt"},
    "wall.coefficient": {"plate_thickness", "density"},
    "wall.plate_thickness": {"coefficient"},
    "beam.thickness": {"diameter", "bore", "area", "second_moment"},
    "beam.width": {"diameter", "bore", "area", "second_moment"},
    "beam.diameter": {"width", "thickness", "area", "second_moment"},
    "beam.area": {"width", "thickness", "diameter", "bore"},
    "reduction.modes": {"cutoff", "error"},
    "reduction.cutoff": {"modes", "error"},
    "reduction.error": {"modes", "cutoff"},
}


def resolved(tables: dict[str, Any], source: str, folder: Path = Path()) -> Scene:
    """The tables as a checked scene with every default of the parts it has."""
    if not tables:
        raise InvalidScene(f"{source} is empty; a scene needs at least [chain] or [assembly].")
    tables = {"name": Path(source).stem, **tables}
    checked = _validated(Scene, tables, source)
    _require_usual(checked, tables, source, (), checked.unusual)
    filled = checked.model_copy(update=_defaults(checked, tables, source, folder))
    filled = filled.model_copy(update={"unusual": unusual_keys(entries(filled)) or None})
    for sentence in contradictions(filled):
        raise InvalidScene(f"{source}: {sentence}")
    return filled


def toml(scene: Scene) -> str:
    """The scene as TOML; reading it back gives the same scene."""
    told = scene.model_copy(update={"unusual": unusual_keys(entries(scene)) or None})
    return tomli_w.dumps(told.model_dump(mode="python", exclude_none=True))


def parsed(text: str, source: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InvalidScene(f"{source} is not TOML: {str(error).rstrip('.')}; correct it.") from None
    except RecursionError:
        raise InvalidScene(f"{source} has brackets nested too deeply; a scene has two.") from None
    except ValueError:  # of Python's, on whole numbers of thousands of digits
        raise InvalidScene(f"{source} holds a whole number that is too long; shorten it.") from None


def changed(tables: dict[str, Any], changes: Iterable[Change]) -> dict[str, Any]:
    """The tables with values set by their dotted keys; raises InvalidScene for what is no key."""
    # what is said to be meant is said of the values that other changes bring
    for key, value in sorted(map(_pair, changes), key=lambda pair: pair[0] == "unusual"):
        path = key.split(".")
        if not all(path):
            raise InvalidScene(f"the key {key!r} is not dotted words; write chain.count.")
        tables = _judged_again(_with(tables, path, value, key), key)
    return tables


def _pair(change: Change) -> tuple[str, Any]:
    if isinstance(change, tuple):
        return change
    key, equals, text = change.partition("=")
    if not equals or not all(key.strip().split(".")):
        raise InvalidScene(f"--set {change!r} is not key=value; write --set chain.count=17.")
    return key.strip(), value_of(text.strip())


def undoes(later: str, earlier: str) -> bool:
    """Whether setting one dotted key undoes the setting of another: the same key, a table and a
    key in it, or a key in whose stead it stands."""
    first, second = later.split("."), earlier.split(".")
    shorter = min(len(first), len(second))
    beside = first[:-1] == second[:-1] and second[-1] in INSTEAD.get(later, ())
    return beside or first[:shorter] == second[:shorter]


def keys_set(changes: Iterable[Change]) -> tuple[str, ...]:
    """The dotted keys that changes give a value, those in tables too."""
    return tuple(key for change in changes for key in _leaves(*_pair(change)))


def _leaves(key: str, value: Any) -> list[str]:
    """The dotted keys that a value of a key holds: of a table, and of a list of tables."""
    tables = value if isinstance(value, dict) else _called(value)
    if not tables:
        return [key]
    return [leaf for name, below in tables.items() for leaf in _leaves(f"{key}.{name}", below)]


def _judged_again(tables: dict[str, Any], key: str) -> dict[str, Any]:
    """What was meant was the value before this change."""
    meant = tables.get("unusual")
    if not isinstance(meant, list):
        return tables
    return {**tables, "unusual": [name for name in meant if name != key]}


def value_of(text: str) -> Any:
    """A TOML value; a bare word is a string."""
    try:
        found = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text
    return found["value"] if len(found) == 1 else text  # more lines are more than a value


def _with(table: dict[str, Any], path: list[str], value: Any, key: str) -> dict[str, Any]:
    """A copy of the table with the value at the path; what it replaces is dropped."""
    first, *rest = path
    if not rest:
        switched = first == "kind" and key != "reduction.kind" and table.get("kind") != value
        replaced = (
            {} if switched else {k: v for k, v in table.items() if k not in INSTEAD.get(key, ())}
        )
        return {**replaced, first: value}
    below = table.get(first, {})
    if (named := _called(below).get(rest[0])) and len(rest) > 1:
        with_value = _with(named, rest[1:], value, key)
        return {**table, first: [with_value if one is named else one for one in below]}
    if not isinstance(below, dict):
        raise InvalidScene(f"--set {key}: {_no_keys(first, below)}")
    return {**table, first: _with(below, rest, value, key)}


def _no_keys(name: str, value: Any) -> str:
    """Why a value that is no table has none of the name that was asked for."""
    if known := list(_called(value)):
        return f"{name} is a list of {', '.join(known)}; write {name}.{known[0]} and a key."
    return f"{name} = {_shown(value)} is a value and has no keys below it."


def _called(value: Any) -> dict[str, dict[str, Any]]:
    """The tables of a list by their names, those that bear none by their number from 1."""
    tables = [t for t in value if isinstance(t, dict)] if isinstance(value, list) else []
    return {str(t.get("name", i)): t for i, t in enumerate(tables, start=1)}


def _validated(model: type[BaseModel], tables: dict[str, Any], source: str, prefix=()):
    try:
        return model.model_validate(tables)
    except ValidationError as error:
        first = _told(error.errors())
        words = allowed_words(model, first["loc"])
        raise InvalidScene(f"{source}: {_sentence(first, tables, prefix, words)}") from None


def _require_usual(table: BaseModel, written: dict[str, Any], source: str, prefix, meant) -> None:
    for sentence in implausible(entries(table, written, prefix), meant or ()):
        raise InvalidScene(f"{source}: {sentence}")


SENTENCES = {
    "missing": "{key} is missing; add {words}.",
    "union_tag_not_found": "{key}.kind is missing; add it to say which kind this is.",
    "union_tag_invalid": "{key}.kind = {kind!r} must be one of {expected_tags}; change it.",
    "value_error": "{key}: {error}.",
    "empty": "{key} is an empty list; give at least one value.",
    "too_short": "{key} = {shown} has {count}; give at least {min_length}.",
    "too_long": "{key} = {shown} has {count}; give {max_length}.",
    "tuple_type": "{key} = {shown} must be a list; write {key} = [...].",
    "string_pattern_mismatch": "{key} = {shown} must be letters, digits, '.', '-' and '_', the "
    "first a letter, a digit or '_'; change it.",
    "string_too_long": "{key} = {shown} must have at most {max_length} characters; give another.",
    "model_type": "{key} = {found!r} must be a table; write [{key}] with keys below it.",
}
SENTENCES["model_attributes_type"] = SENTENCES["model_type"]


def _told(errors: list[Any]) -> Any:
    """The first of the errors; where a list is none of the words allowed, what is wrong with it."""
    first, *others = errors
    if first["type"] != "literal_error" or not isinstance(first["input"], list | tuple):
        return first
    place = first["loc"][:-1]
    return next((e for e in others if e["loc"][: len(place)] == place), first)


def _sentence(
    error: dict[str, Any], tables: dict[str, Any], prefix: tuple[str, ...], words: str
) -> str:
    found, type_ = error["input"], error["type"]
    type_ = "empty" if type_ == "too_short" and not found else type_
    n = len(found) if isinstance(found, list | tuple) else 0
    return SENTENCES.get(type_, "{key} = {shown} {allowed}; change it.").format(
        key=repr(".".join((*prefix, *_key(error, tables))))[1:-1] or "the scene",
        found=found,
        shown=_shown(found),
        words=words or "it",
        kind=found.get("kind") if isinstance(found, dict) else None,
        count=f"{n} value{'s' * (n != 1)}",
        allowed=error["msg"].replace("Input should", "must", 1),
        **error.get("ctx", {}),
    )


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _key(error: dict[str, Any], tables: Any) -> list[str]:
    """The location in the user's tables, without the branches of unions that pydantic adds."""
    key, at = [], tables
    for part in error["loc"]:
        if isinstance(at, dict) and part in at:
            key, at = [*key, str(part)], at[part]
        elif isinstance(at, list | tuple) and isinstance(part, int) and part < len(at):
            key, at = [*key, str(part)], at[part]
    return [*key, str(error["loc"][-1])] if error["type"] == "missing" else key


def _defaults(scene: Scene, tables: dict[str, Any], source: str, folder: Path) -> dict[str, Any]:
    """The tables that the scene's parts need and that it left out, at their defaults."""
    filled: dict[str, Any] = {}
    if scene.chain:
        filled |= {"contact": Contact(), "time": Time(), "output": Output()}
    if scene.has_structure:
        kind = "craig-bampton" if scene.assembly is not None else "free-modes"
        filled |= {"reduction": Reduction(kind=kind)}
    if scene.has_structure or isinstance(scene.wall, RomWall):
        filled |= {"damping": NoDamping()}
    filled = {name: table for name, table in filled.items() if getattr(scene, name) is None}
    if scene.chain:
        filled["striker"] = fallen(scene, source)
    if scene.assembly is not None:
        filled |= _structure(scene, tables, source)
    if isinstance(scene.wall, RomWall) and scene.wall.file:
        path = str(folder / scene.wall.file)
        filled["wall"] = scene.wall.model_copy(update={"file": path})
    for table, key in (("mesh", "file"), ("assembly", "step"), ("assembly", "mesh")):
        if named := getattr(filled.get(table), key, None):
            filled[table] = filled[table].model_copy(update={key: str(folder / named)})
    if any(target.shape for target in scene.targets or ()):
        filled["targets"] = tuple(target.beside(folder) for target in scene.targets)
    return filled


def _structure(scene: Scene, tables: dict[str, Any], source: str) -> dict[str, Any]:
    """[assembly] and [mesh] of bodies, or of the thesis' rig with its defaults."""
    general = isinstance(scene.assembly, dict) and (scene.bodies or GENERAL & scene.assembly.keys())
    read = partial(_part, tables=tables, source=source, meant=scene.unusual)
    if general:
        return {"assembly": read(General, "assembly"), "mesh": read(Meshing, "mesh")}
    found = {"assembly": _assembly(tables, source, scene.unusual), "mesh": read(Mesh, "mesh")}
    if scene.patch is None:
        found["patch"] = Patch()
    if found["assembly"].constraint == "wires" and scene.joints is None:
        found["joints"] = Joints()
    return found


def _part(model: type[BaseModel], key: str, *, tables: dict[str, Any], source: str, meant):
    table = _validated(model, tables.get(key, {}), source, (key,))
    _require_usual(table, tables.get(key, {}), source, (key,), meant)
    return table


def _assembly(tables: dict[str, Any], source: str, unusual: tuple[str, ...] | None):
    # geometry loads its mesher on import: only a scene with an assembly pays for that
    from workflows.scene.assembly import AssemblyTable, assembly

    table = _part(AssemblyTable, "assembly", tables=tables, source=source, meant=unusual)
    try:
        assembly(table)
    except ValueError as error:
        raise InvalidScene(f"{source}: assembly: {error}") from None
    return table
