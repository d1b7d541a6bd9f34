"""Scenes from and to TOML: changed by `--set`, completed by defaults, refused in one sentence."""

import re
import tomllib
from collections.abc import Iterable, Mapping
from itertools import combinations
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import BaseModel, ValidationError

from beadwave.workflows.scene import (
    ContactTable,
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
from beadwave.workflows.scene.allowed_words import allowed_words, wanted_values
from beadwave.workflows.scene.named_files import in_folder
from beadwave.workflows.scene.named_materials import NUMBERS, named_material
from beadwave.workflows.scene.quantities import entries, implausible, unusual_keys
from beadwave.workflows.scene.rig import RigScene, RigTable, check
from beadwave.workflows.scene.rules.all_tables import contradictions
from beadwave.workflows.scene.scene_table import nearest
from beadwave.workflows.scene.shown import shown
from beadwave.workflows.scene.tables.bodies import SHAPES, General, Meshing, Strike
from beadwave.workflows.scene.tables.free_fall import fallen

Change = str | tuple[str, Any]  # "key=value" as --set takes it, or a dotted key and its value
GENERAL = General.model_fields.keys()  # keys of an assembly of bodies
INSTEAD = {
    "striker.velocity": {"drop"},
    "striker.drop": {"velocity"},
    "time.dt": {"error"},
    "time.error": {"dt"},
    "wall.coefficient": {"plate_thickness", "density"},
    "wall.plate_thickness": {"coefficient"},
    **{
        f"{table}.material": {"young", "poisson", "density", "yield_stress"}
        for table in ("chain", "chains.NAME", "crystal", "wall", "beam", "plate")
    },
    "beam.thickness": {"diameter", "bore", "area", "second_moment"},
    "beam.width": {"diameter", "bore", "area", "second_moment"},
    "beam.diameter": {"width", "thickness", "area", "second_moment"},
    "beam.area": {"width", "thickness", "diameter", "bore"},
    "crystal.precompression": {"force"},
    "crystal.force": {"precompression"},
    "reduction.modes": {"cutoff", "error"},
    "reduction.cutoff": {"modes", "error"},
    "reduction.error": {"modes", "cutoff"},
    "joints.NAME.preload": {"torque", "torque_deviation"},
    "joints.NAME.torque": {"preload"},
    "shakers.NAME.displacement": {"velocity", "acceleration", "force"},
    "shakers.NAME.velocity": {"displacement", "acceleration", "force"},
    "shakers.NAME.acceleration": {"displacement", "velocity", "force"},
    "shakers.NAME.force": {"displacement", "velocity", "acceleration"},
}


def resolved(tables: dict[str, Any], source: str, folder: Path = Path()) -> Scene:
    """The tables as a checked scene with every default of the parts it has, a rig expanded into its
    bodies; files that it names are looked for in `folder`. Raises InvalidScene, in one sentence
    that begins with the source."""
    if not tables:
        raise InvalidScene(
            f"{source} is empty; a scene needs at least [chain], [crystal] or [assembly]."
        )
    tables = {"name": Path(source).stem, **tables}

    # the tables one by one, then numbers that are allowed and unlikely; [assembly] and [mesh] come
    # later, as their keys depend on what the assembly is
    scene = _validated(Scene, tables, source)
    _require_usual(scene, tables, source, (), scene.unusual)

    # tables that the parts of the scene need and that it left out, at their defaults
    added: dict[str, Any] = {}
    if scene.chain or scene.chains or scene.crystal:
        added |= {"contact": ContactTable(), "time": Time(), "output": Output()}
    if scene.has_structure:
        kind = "craig-bampton" if scene.assembly is not None else "free-modes"
        added |= {"reduction": Reduction(kind=kind)}
    if scene.has_structure or isinstance(scene.wall, RomWall):
        added |= {"damping": NoDamping()}
    added = {name: table for name, table in added.items() if getattr(scene, name) is None}
    if scene.chain:
        added["striker"] = fallen(scene, source)
    if scene.assembly is not None:
        added |= _structure(scene, tables, source)
    if scene.chains or (scene.crystal and scene.crystal.on):
        added |= _several_contacts(scene, tables, source)

    complete = in_folder(scene.model_copy(update=added), folder)
    complete = complete.model_copy(update={"unusual": unusual_keys(entries(complete)) or None})
    for sentence in contradictions(complete):
        raise InvalidScene(f"{source}: {sentence}")
    return RigScene.of(complete) if isinstance(complete.assembly, RigTable) else complete


def _several_contacts(scene: Scene, tables: dict[str, Any], source: str) -> dict[str, Any]:
    """[strike] and [reduction] of a structure with several contacts: stages of one contact read the
    place of the first chain, or the middle of a crystal's last row."""
    if scene.strike is not None:
        whose = "each of [[chains]]" if scene.chains else "[crystal]"
        raise InvalidScene(
            f"{source}: [strike] is of one [chain]; {whose} has `on` and `at` of its own, drop it."
        )
    if scene.chains:
        strike = next(iter(scene.of_each_chain.values())).strike
    else:
        crystal = scene.crystal
        strike = Strike.model_construct(on=crystal.on, at=crystal.at, radius=crystal.patch_radius)
    given = tables.get("reduction", {})
    amount = {} if given.keys() & {"modes", "cutoff", "error"} else {"error": 1e-3}
    return {"strike": strike, "reduction": Reduction(**{"kind": "free-modes", **amount, **given})}


def _structure(scene: Scene, tables: dict[str, Any], source: str) -> dict[str, Any]:
    """[assembly] and [mesh] of bodies, or of the thesis' rig with its defaults."""

    def read(model: type[BaseModel], key: str) -> Any:
        """The table of a key by its model, checked."""
        table = _validated(model, tables.get(key, {}), source, (key,))
        _require_usual(table, tables.get(key, {}), source, (key,), scene.unusual)
        return table

    if isinstance(scene.assembly, dict) and (scene.bodies or GENERAL & scene.assembly.keys()):
        return {"assembly": read(General, "assembly"), "mesh": read(Meshing, "mesh")}

    rig = read(RigTable, "assembly")
    try:
        check(rig)
    except InvalidScene as error:
        raise InvalidScene(f"{source}: assembly: {error}") from None
    added = {"assembly": rig, "mesh": read(Mesh, "mesh")}
    if scene.patch is None:
        added["patch"] = Patch()
    if rig.constraint == "wires" and scene.joints is None:
        added["joints"] = Joints()
    return added


def toml(scene: Scene) -> str:
    """The scene as TOML; reading it back gives the same scene."""
    unusual = unusual_keys(entries(scene.written)) or None
    several = scene.chains or (scene.crystal and scene.crystal.on)
    update = {"unusual": unusual} | ({"strike": None} if several else {})
    complete = scene.model_copy(update=update)
    return tomli_w.dumps(complete.model_dump(mode="python", exclude_none=True))


def parsed(text: str, source: str) -> dict[str, Any]:
    """Tables of a text; raises InvalidScene if it is not TOML or has more than DEEPEST levels."""
    if deep := TOO_DEEP.search(text):
        line = text.count("\n", 0, deep.start()) + 1
        raise InvalidScene(
            f"{source}, line {line}: a key of more than {DEEPEST} dotted words is none of a scene; "
            "write chain.count."
        )
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InvalidScene(f"{source} is not TOML: {str(error).rstrip('.')}; correct it.") from None
    except RecursionError:
        raise InvalidScene(f"{source} has brackets nested too deeply; a scene has two.") from None
    except ValueError:  # raised by Python for whole numbers of thousands of digits
        raise InvalidScene(f"{source} holds a whole number that is too long; shorten it.") from None
    require_shallow(tables, source)
    return tables


def require_shallow(tables: Any, source: str) -> None:
    """Raise InvalidScene for tables and lists of more than DEEPEST levels."""
    level = [tables]
    for _ in range(DEEPEST + 1):
        level = [
            inner
            for outer in level
            for inner in (outer.values() if isinstance(outer, Mapping) else outer)
            if isinstance(inner, Mapping | list | tuple)
        ]
    if level:
        raise InvalidScene(
            f"{source} has tables or lists of more than {DEEPEST} levels; a scene has up to five."
        )


def changed(tables: dict[str, Any], changes: Iterable[Change]) -> dict[str, Any]:
    """The tables with values set by their dotted keys; raises InvalidScene for what is no key, and
    for two keys of which each takes the place of the other."""
    # `unusual` last: it refers to the final values
    pairs = sorted(map(_pair, changes), key=lambda pair: pair[0] == "unusual")
    given = [key for key, value in pairs if value not in (None, "none")]
    for first, second in combinations(given, 2):
        if replaces(first, second) and replaces(second, first):
            raise InvalidScene(f"--set {first} and --set {second} exclude each other; drop one.")
    written = tables
    for key, value in pairs:
        path = key.split(".")
        if not all(path) or len(path) > DEEPEST:
            raise InvalidScene(
                f"the key {shown(key)} is not dotted words, {DEEPEST} at most; write chain.count."
            )
        require_shallow([value], f"--set {key}")
        tables = _with(_with_named_material(tables, path), path, value, key)

        # a key listed as unusual was intended with its former value, not with this one
        unusual = tables.get("unusual")
        if isinstance(unusual, list):
            tables = {**tables, "unusual": [name for name in unusual if name != key]}
    for key, _ in pairs:
        _require_known_body(key, written, tables)
    return tables


def _with_named_material(tables: dict[str, Any], path: list[str]) -> dict[str, Any]:
    """The tables with all numbers of a material that is known by its name, where the path is that
    of one of them and the tables do not have it: the others stay as they were."""
    table, name = path[0], path[1] if len(path) == 3 else ""
    named, materials = named_material(name), tables.get("materials", {})
    if (
        table != "materials"
        or named is None
        or not isinstance(materials, dict)
        or name in materials
    ):
        return tables
    numbers = {number: getattr(named, number) for number in NUMBERS}
    return {**tables, "materials": {**materials, name: numbers}}


def _require_known_body(key: str, written: dict[str, Any], tables: dict[str, Any]) -> None:
    """Raises InvalidScene where a dotted key is of a body that is neither among those `written` nor
    drawn by the changes; bodies of a file are known once it has been read."""
    first, *inner = key.split(".")
    assembly = tables.get("assembly", {})
    of_file = isinstance(assembly, dict) and assembly.keys() & {"step", "mesh"}
    bodies, known = tables.get("bodies"), written.get("bodies", {})
    if first != "bodies" or len(inner) < 2 or of_file or not isinstance(bodies, dict):
        return
    name, body = inner[0], bodies[inner[0]]
    if name not in known and not (isinstance(body, dict) and body.keys() & set(SHAPES)):
        which = nearest(name, known) if known else "the scene has none"
        raise InvalidScene(
            f"--set {key}: there is no body {name!r}, {which}; for a further one set its "
            f"{', '.join(SHAPES[:-1])} or {SHAPES[-1]} as well."
        )


def _pair(change: Change) -> tuple[str, Any]:
    """Key and value of "key=value" or of a pair."""
    if isinstance(change, tuple):
        return change
    key, equals, text = change.partition("=")
    if not equals or not all(key.strip().split(".")):
        raise InvalidScene(f"--set {shown(change)} is not key=value; write --set chain.count=17.")
    key, text = key.strip(), text.strip()
    value = value_of(text)
    # a table or a list with a fault in it, which is no word
    if value is text and text[:1] in ("{", "["):
        try:
            tomllib.loads(f"value = {text}")
        except (ValueError, RecursionError) as error:
            reason = str(error).partition(" (at ")[0]
            raise InvalidScene(f"--set {key}: {shown(text)} is no TOML: {reason}.") from None
    return key, value


def instead_of(key: str) -> set[str]:
    """The keys of its table that a dotted key takes the place of."""
    words = key.split(".")
    of_a_name = words[0] in ("shakers", "joints", "chains") and len(words) > 2
    return INSTEAD.get(f"{words[0]}.NAME.{words[-1]}" if of_a_name else key, set())


def replaces(key: str, other: str) -> bool:
    """True if a dotted key stands in the stead of another of its table."""
    first, second = key.split("."), other.split(".")
    return first[:-1] == second[:-1] and second[-1] in instead_of(key)


def undoes(later: str, earlier: str) -> bool:
    """True if setting one dotted key undoes the setting of another: the same key, a table and a key
    in it, or a key in whose stead it stands."""
    first, second = later.split("."), earlier.split(".")
    shorter = min(len(first), len(second))
    return replaces(later, earlier) or first[:shorter] == second[:shorter]


def keys_set(changes: Iterable[Change]) -> tuple[str, ...]:
    """The dotted keys that changes give a value, those in tables too."""
    return tuple(key for change in changes for key in _leaves(*_pair(change)))


def _leaves(key: str, value: Any) -> list[str]:
    """The dotted keys that a value of a key holds: of a table, and of a list of tables."""
    tables = value if isinstance(value, dict) else _by_name(value)
    if not tables:
        return [key]
    return [leaf for name, below in tables.items() for leaf in _leaves(f"{key}.{name}", below)]


def value_of(text: str) -> Any:
    """A TOML value; a bare word is a string."""
    try:
        document = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text
    return document["value"] if len(document) == 1 else text  # more lines are more than a value


def _with(table: dict[str, Any], path: list[str], value: Any, key: str) -> dict[str, Any]:
    """A copy of the table with the value at the path; values that exclude the new one are dropped,
    all others of its table where it is another kind."""
    first, *inner = path
    if not inner:
        other_kind = first == "kind" and key != "reduction.kind" and table.get("kind") != value
        excluded = table.keys() if other_kind else instead_of(key)
        return {**{name: x for name, x in table.items() if name not in excluded}, first: value}

    # a table in a list, by its name
    below = table.get(first, {})
    by_name = _by_name(below)
    if len(inner) > 1 and (row := by_name.get(inner[0])):
        new_row = _with(row, inner[1:], value, key)
        return {**table, first: [new_row if old is row else old for old in below]}
    if isinstance(below, dict):
        return {**table, first: _with(below, inner, value, key)}
    if by_name:
        names = list(by_name)
        reason = f"{first} is a list of {', '.join(names)}; write {first}.{names[0]} and a key."
    else:
        reason = f"{first} = {shown(below)} is a value and has no keys below it."
    raise InvalidScene(f"--set {key}: {reason}")


def _by_name(value: Any) -> dict[str, dict[str, Any]]:
    """The tables of a list by their names, those that bear none by their number from 1."""
    tables = [t for t in value if isinstance(t, dict)] if isinstance(value, list) else []
    return {str(t.get("name", i)): t for i, t in enumerate(tables, start=1)}


def _validated(
    model: type[BaseModel], tables: dict[str, Any], source: str, prefix: tuple[str, ...] = ()
) -> Any:
    """The model of the tables, whose keys stand below `prefix`; raises InvalidScene with the first
    error as a sentence."""
    try:
        return model.model_validate(tables)
    except ValidationError as error:
        errors = error.errors()

    # where a list is none of the words allowed, the error in the list says more
    first = errors[0]
    if first["type"] == "literal_error" and isinstance(first["input"], list | tuple):
        place = first["loc"][:-1]
        first = next((e for e in errors[1:] if e["loc"][: len(place)] == place), first)

    # of a list that is too short, what the whole list must be
    short = first["type"] == "missing" and isinstance(first["loc"][-1], int)
    place = first["loc"][:-1] if short else first["loc"]
    words, wanted = allowed_words(model, first["loc"]), wanted_values(model, place)
    raise InvalidScene(f"{source}: {_sentence(first, tables, prefix, words, wanted)}")


def _require_usual(
    table: BaseModel,
    written: dict[str, Any],
    source: str,
    prefix: tuple[str, ...],
    intended: tuple[str, ...] | None,
) -> None:
    """Raise InvalidScene for a number outside of its usual range whose key is not `intended`."""
    for sentence in implausible(entries(table, written, prefix), intended or ()):
        raise InvalidScene(f"{source}: {sentence}")


# dotted words, as of a.b.c: one more of them than keys of a scene have levels is a mistake, and
# thousands would be taken apart for minutes
DEEPEST = 20
TOO_DEEP = re.compile(rf"(?<![\w.\"'-])(?:[\w\"'-]+[ \t]*\.[ \t]*){{{DEEPEST}}}")

SENTENCES = {
    "missing": "{key} is missing; add {words}.",
    "union_tag_not_found": "{key}.kind is missing; add it to say which kind this is.",
    "union_tag_invalid": "{key}.kind = {kind} must be one of {expected_tags}; change it.",
    "value_error": "{key}: {error}.",
    "empty": "{key} is an empty list; give at least one value.",
    "too_short": "{key} = {shown} has {count}; give at least {min_length}.",
    "too_few": "{key} = {shown} has {count}; give {wanted}.",
    "too_long": "{key} = {shown} has {count}; give {wanted}.",
    "tuple_type": "{key} = {shown} must be a list{wanted_values}; write {key} = [...].",
    "string_pattern_mismatch": "{key} = {shown} must be letters, digits, '.', '-' and '_', the "
    "first a letter, a digit or '_'; change it.",
    "name": "{key} = {shown} must be letters, digits, '-' and '_', the first no '-'; change it.",
    "axes": "{key} = {shown} must be some of the letters x, y and z; change it.",
    "string_too_long": "{key} = {shown} must have at most {max_length} characters; give another.",
    "string_too_short": "{key} is empty; give a text, or drop it.",
    "rows": "{key} is a list of tables: write [[{key}]], two brackets, once for each.",
    "model_type": "{key} = {shown} must be a table; write [{key}] with keys below it.",
    "table_in_row": "{key} = {shown} must be a table; write {last} = {{ KEY = VALUE }}.",
}
LISTS_OF_TABLES = {("crystal", "inclusions")} | {
    (name,)
    for name in ("shakers", "ties", "masses", "springs", "measured", "loads", "targets", "chains")
}
SENTENCES["model_attributes_type"] = SENTENCES["model_type"]


def _sentence(
    error: dict[str, Any],
    tables: dict[str, Any],
    prefix: tuple[str, ...],
    words: str,
    wanted: str,
) -> str:
    """The sentence of an error of pydantic, with the key as the user wrote it; `words` are those
    that it may be, `wanted` how many values (`allowed_words`)."""
    value, type_ = error["input"], error["type"]
    if type_ == "missing" and isinstance(error["loc"][-1], int):
        type_ = "too_few"
    type_ = "empty" if type_ == "too_short" and not value else type_
    if type_ == "string_pattern_mismatch":
        pattern = error["ctx"]["pattern"].replace("?", "")
        type_ = "axes" if "xyz" in pattern else type_ if "." in pattern else "name"
    if isinstance(value, dict) and type_ == "tuple_type" and error["loc"] in LISTS_OF_TABLES:
        type_ = "rows"
    n = len(value) if isinstance(value, list | tuple) else 0

    # the location in the user's tables, without the branches of unions that pydantic adds; rows of
    # lists by their names, else counted from 1
    key, table = list(prefix), tables
    for part in error["loc"]:
        in_table = isinstance(table, dict) and part in table
        in_list = isinstance(table, list | tuple) and isinstance(part, int) and part < len(table)
        if in_table or in_list:
            table = table[part]
            name = table.get("name") if in_list and isinstance(table, dict) else None
            counted = str(part + 1) if in_list else str(part)
            key.append(name if isinstance(name, str) and name else counted)
    # [a.b] names no row of a list, but a table that is written in it may be
    named = [part for part in error["loc"] if isinstance(part, int) or str(part) in key[-1:]]
    in_row = len(named) > 1 and isinstance(named[-2], int) and isinstance(named[-1], str)
    if in_row and SENTENCES.get(type_) == SENTENCES["model_type"]:
        type_ = "table_in_row"
    if type_ == "missing":
        key.append(str(error["loc"][-1]))
    return SENTENCES.get(type_, "{key} = {shown} {allowed}; change it.").format(
        key=repr(".".join(key))[1:-1] or "the scene",
        value=value,
        last=key[-1] if key else "",
        shown=shown(value),
        words=words or "it",
        wanted=wanted or error.get("ctx", {}).get("max_length"),
        wanted_values=f" of {wanted}" if wanted else "",
        kind=shown(value.get("kind") if isinstance(value, dict) else None),
        count=f"{n} value{'s' * (n != 1)}",
        allowed=error["msg"].replace("Input should", "must", 1),
        **error.get("ctx", {}),
    )
