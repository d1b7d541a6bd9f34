"""Scenes from and to TOML: built-in or a user's file, changed by `--set`, refused in a sentence."""

import tomllib
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

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
    nearest,
)
from workflows.scene_size import too_large
from workflows.summary import HAMMER_TEST_HZ

DEFAULT = "rig-rom"
INSTEAD = {
    "time.dt": {"error"},
    "time.error": {"dt"},
    "reduction.modes": {"cutoff", "error"},
    "reduction.cutoff": {"modes", "error"},
    "reduction.error": {"modes", "cutoff"},
}


class SceneText(NamedTuple):
    """TOML and where it comes from."""

    source: str
    text: str
    folder: Path  # paths inside the scene are relative to it


def built_in() -> dict[str, str]:
    """The scenes that come with the program, name to commented TOML, the default first."""
    texts = {
        entry.name.removesuffix(".toml"): entry.read_text(encoding="utf-8")
        for entry in sorted((files("workflows") / "scenes").iterdir(), key=lambda e: e.name)
        if entry.name.endswith(".toml")
    }
    return {DEFAULT: texts.pop(DEFAULT), **texts}


def scene_text(name: str | None) -> SceneText:
    """A built-in scene by name, or a file by path; raises InvalidScene when there is neither."""
    scenes = built_in()
    name = DEFAULT if name is None else name
    if name in scenes:
        return SceneText(name, scenes[name], Path.cwd())
    return SceneText(name, _file_text(name, scenes), Path(name).absolute().parent)


def _file_text(name: str, scenes: dict[str, str]) -> str:
    path = Path(name)
    if path.is_dir() and (path / "scene.toml").is_file():
        raise InvalidScene(f"{name} is a run folder; give its {path / 'scene.toml'}.")
    try:
        return path.read_text(encoding="utf-8-sig")  # some editors put a byte order mark
    except FileNotFoundError:
        raise InvalidScene(
            f"no scene {name!r}: neither a file nor a built-in scene has this name; "
            f"{nearest(name, scenes)}."
        ) from None
    except UnicodeDecodeError:
        raise InvalidScene(f"{name} is not a text file in UTF-8; give a scene in TOML.") from None
    except OSError as error:
        raise InvalidScene(f"{name} cannot be read ({error.strerror}); give a TOML file.") from None


def scene(name: str | None = None, changes: tuple[str, ...] = ()) -> Scene:
    """The resolved scene: `changes` ("key=value", dotted) applied, every default filled in."""
    source, text, folder = scene_text(name)
    return resolved(_changed(_parsed(text, source), changes), source, folder)


def resolved(tables: dict[str, Any], source: str, folder: Path = Path()) -> Scene:
    """The tables as a checked scene with every default of the parts it has."""
    if not tables:
        raise InvalidScene(f"{source} is empty; a scene needs at least [chain] or [assembly].")
    tables = {"name": Path(source).stem, **tables}
    checked = _validated(Scene, tables, source)
    filled = checked.model_copy(update=_defaults(checked, tables, source, folder))
    for sentence in _contradictions(filled):
        raise InvalidScene(f"{source}: {sentence}")
    return filled


def toml(scene: Scene) -> str:
    """The scene as TOML; reading it back gives the same scene."""
    return tomli_w.dumps(scene.model_dump(mode="python", exclude_none=True))


def _parsed(text: str, source: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InvalidScene(f"{source} is not TOML: {str(error).rstrip('.')}; correct it.") from None


def _changed(tables: dict[str, Any], changes: tuple[str, ...]) -> dict[str, Any]:
    for change in changes:
        key, equals, text = change.partition("=")
        if not equals or not all(key.strip().split(".")):
            raise InvalidScene(f"--set {change!r} is not key=value; write --set chain.count=17.")
        tables = _with(tables, key.strip().split("."), _value(text.strip()), key.strip())
    return tables


def _value(text: str) -> Any:
    """A TOML value; a bare word is a string."""
    try:
        found = tomllib.loads(f"value = {text}")
    except tomllib.TOMLDecodeError:
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
    if not isinstance(below, dict):
        raise InvalidScene(f"--set {key}: {first} = {below!r} is a value and has no keys below it.")
    return {**table, first: _with(below, rest, value, key)}


def _validated(model: type[BaseModel], tables: dict[str, Any], source: str, prefix=()):
    try:
        return model.model_validate(tables)
    except ValidationError as error:
        raise InvalidScene(f"{source}: {_sentence(error.errors()[0], tables, prefix)}") from None


def _sentence(error: dict[str, Any], tables: dict[str, Any], prefix: tuple[str, ...]) -> str:
    key = ".".join((*prefix, *_key(error, tables))) or "the scene"
    found, allowed = error["input"], error["msg"].replace("Input should", "must", 1)
    match error["type"]:
        case "missing":
            return f"{key} is missing; add it."
        case "union_tag_not_found":
            return f"{key}.kind is missing; add it to say which kind this is."
        case "union_tag_invalid":
            expected = error["ctx"]["expected_tags"]
            return f"{key}.kind = {found['kind']!r} must be one of {expected}; change it."
        case "value_error":
            return f"{key}: {error['ctx']['error']}; change it."
        case "too_short":
            return f"{key} is an empty list; give at least one value."
        case "too_long":
            most = error["ctx"]["max_length"]
            return f"{key} = {_shown(found)} has {len(found)} values; give {most}."
        case "tuple_type":
            return f"{key} = {_shown(found)} must be a list; write {key} = [...]."
        case "string_pattern_mismatch":
            return f"{key} = {_shown(found)} must be letters, digits, '.', '-' and '_'; change it."
        case "model_type" | "model_attributes_type":
            return f"{key} = {found!r} must be a table; write [{key}] with keys below it."
    return f"{key} = {_shown(found)} {allowed}; change it."


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
    if scene.assembly is not None:
        filled |= {"mesh": Mesh(), "patch": Patch(), "reduction": Reduction()}
    if scene.assembly is not None or isinstance(scene.wall, RomWall):
        filled |= {"damping": NoDamping()}
    filled = {name: table for name, table in filled.items() if getattr(scene, name) is None}
    if scene.assembly is not None:
        filled["assembly"] = _assembly(tables, source)
        if filled["assembly"].constraint == "wires" and scene.joints is None:
            filled["joints"] = Joints()
    if isinstance(scene.wall, RomWall) and scene.wall.file:
        path = str(folder / scene.wall.file)
        filled["wall"] = scene.wall.model_copy(update={"file": path})
    if scene.mesh is not None and scene.mesh.file:
        path = str(folder / scene.mesh.file)
        filled["mesh"] = scene.mesh.model_copy(update={"file": path})
    return filled


def _assembly(tables: dict[str, Any], source: str):
    # geometry loads its mesher on import: only a scene with an assembly pays for that
    from workflows.assembly_table import AssemblyTable, assembly

    table = _validated(AssemblyTable, tables["assembly"], source, ("assembly",))
    try:
        assembly(table)
    except ValueError as error:
        raise InvalidScene(f"{source}: assembly: {error}") from None
    return table


def _contradictions(scene: Scene):
    """Sentences on keys that are each allowed but not together."""
    yield from _missing_parts(scene)
    yield from _unreadable_wall(scene)
    if scene.assembly is not None:
        yield from _outside_patch(scene)
        yield from _unread_nodes(scene)
    yield from too_large(scene)
    if scene.chain:
        yield from _wrong_lengths(scene)
        yield from _at_rest(scene)
        yield from _unseen_spheres(scene)


def _missing_parts(scene: Scene):
    chain, wall = scene.chain, scene.wall
    if chain is None and scene.assembly is None:
        yield "there is neither [chain] nor [assembly]; add one of them."
    if chain is None and wall is not None:
        yield "[wall] needs a [chain] that hits it; add one or drop [wall]."
    if isinstance(wall, RomWall) and wall.file is None and scene.assembly is None:
        yield 'wall.kind = "rom" needs [assembly] or wall.file; add one of them.'
    if isinstance(wall, RomWall) and wall.file and not Path(wall.file).is_file():
        yield f"wall.file = {wall.file!r} does not exist; give a reduced model (.npz, .mat, .h5)."
    if chain and wall is None and chain.count < 2:
        yield "chain.count = 1 must be at least 2 without a wall; add spheres or [wall]."
    if chain and wall is None and scene.preload and scene.preload.force > 0:
        yield f"preload.force = {scene.preload.force} needs a wall to push against; add [wall]."


def _unreadable_wall(scene: Scene):
    if not isinstance(scene.wall, RomWall) or not scene.wall.file:
        return
    from workflows.reduced_wall import loaded  # only a wall from a file pays for the reader

    try:
        loaded(Path(scene.wall.file))
    except InvalidScene as error:
        yield str(error)


def _outside_patch(scene: Scene):
    sides = (scene.assembly.block_y, scene.assembly.block_z)
    for axis, at, side in zip("yz", scene.patch.point, sides, strict=True):
        reach = side / 2 - scene.patch.radius
        if abs(at) > reach:
            yield (
                f"patch.point has {axis} = {at} m, allowed is up to {reach:.6g} m from the "
                f"middle of the block's face for patch.radius = {scene.patch.radius} m; move it."
            )


def _unread_nodes(scene: Scene):
    half = (scene.assembly.block_y / 2, scene.assembly.block_z / 2)
    for point in scene.patch.nodes or ():
        if any(abs(at) > reach for at, reach in zip(point, half, strict=True)):
            yield (
                f"patch.nodes has {list(point)}, allowed are y, z up to {half[0]:.6g} and "
                f"{half[1]:.6g} m from the middle of the block's face; move it."
            )
    if scene.patch.weights != "thesis":
        return
    if scene.reduction.kind != "craig-bampton":
        yield (
            'patch.weights = "thesis" reads nodes that only reduction.kind = "craig-bampton" '
            "keeps; change one of them."
        )
    if scene.time and scene.time.dt is not None:
        yield 'patch.weights = "thesis" is marched to an error; give time.error, not time.dt.'
    if getattr(scene.wall, "prune", False):
        yield 'patch.weights = "thesis" makes no modes to leave out; drop wall.prune.'


def _wrong_lengths(scene: Scene):
    n, contacts = scene.chain.count, scene.n_contacts
    each = [
        (f"chain.{key}", getattr(scene.chain, key), n) for key in type(scene.chain).model_fields
    ]
    each += [(f"contact.{key}", getattr(scene.contact, key), contacts) for key in PER_CONTACT]
    if scene.leaf_springs:
        each += [(f"leaf_springs.{key}", value, n) for key, value in scene.leaf_springs]
    each += [("damping.ratio", getattr(scene.damping, "ratio", None), len(HAMMER_TEST_HZ))]
    for key, value, length in each:
        if isinstance(value, tuple) and len(value) != length:
            yield f"{key} has {len(value)} values, {length} are allowed; give one each."


PER_CONTACT = ("coefficient", "stiffness_factor")


def _at_rest(scene: Scene):
    given = scene.chain.initial_velocity is not None
    if given and scene.striker:
        yield "chain.initial_velocity replaces [striker]; drop one of them."
    if scene.striker is None and not any(scene.chain.initial_velocity or ()):
        yield "nothing moves; add [striker] velocity or chain.initial_velocity."


def _unseen_spheres(scene: Scene):
    for sphere in scene.output.spheres:
        if sphere > scene.chain.count:
            yield (
                f"output.spheres has {sphere}, allowed are 1 to chain.count = {scene.chain.count}; "
                "drop it or add spheres."
            )
