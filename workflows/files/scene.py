"""Scenes by name: built-in ones and files, read with the wall's file that they name."""

from collections.abc import Iterable, Mapping
from importlib.resources import files
from json import dumps, loads
from pathlib import Path
from typing import Any, NamedTuple

from beadwave.workflows.scene import InvalidScene, RomWall, Scene, nearest
from beadwave.workflows.scene.named_files import files_of, no_name, require_file
from beadwave.workflows.scene.shown import shown
from beadwave.workflows.scene.toml import Change, changed, parsed, require_shallow, resolved

# values by dotted keys, or texts "key=value" as --set takes them
Changes = Mapping[str, Any] | Iterable[Change]
Source = str | Path | Mapping[str, Any] | Scene | None  # name, file, tables; None is DEFAULT
DEFAULT = "rig-rom"
MESHES = (".msh", ".med", ".unv", ".inp", ".bdf", ".nas", ".vtu", ".vtk")
SURFACES = (".stl", ".obj", ".ply", ".3mf")  # triangles without a volume
MOST_BYTES = 50_000_000  # a million spheres, each with values of its own


class SceneText(NamedTuple):
    """TOML and where it comes from."""

    source: str
    text: str
    folder: Path  # paths inside the scene are relative to it


def built_in() -> dict[str, str]:
    """The scenes that come with the program, name to commented TOML, the default first."""
    texts = {
        entry.name.removesuffix(".toml"): entry.read_text(encoding="utf-8")
        for entry in sorted(
            (files("beadwave.workflows") / "scenes").iterdir(), key=lambda e: e.name
        )
        if entry.name.endswith(".toml")
    }
    return {DEFAULT: texts.pop(DEFAULT), **texts}


def scene_text(name: str | None) -> SceneText:
    """A built-in scene by name, or a file by path; raises InvalidScene when there is neither."""
    scenes = built_in()
    name = DEFAULT if name is None else name
    if name in scenes:
        return SceneText(name, scenes[name], working_folder())

    # no built-in scene: a file, or something that is likely to be meant for one
    path = Path(name)
    if why := no_name(name):
        raise InvalidScene(
            f"{shown(name)} {why}; give a TOML file, a built-in scene, or in Python a dict of its "
            "tables."
        )
    if path.is_dir() and (path / "scene.toml").is_file():
        raise InvalidScene(f"{name} is a run folder; give its {path / 'scene.toml'}.")
    if path.suffix.lower() in MESHES and path.is_file():
        raise InvalidScene(
            f"{name} is a mesh; name it in a scene, "
            f'assembly = {{ mesh = "{path.name}", material = "steel" }}, and give that.'
        )
    if path.suffix.lower() in (".igs", ".iges", *SURFACES):
        is_surface = path.suffix.lower() in SURFACES
        filled = ", or fill it with tetrahedra by examples/fill_surface.py" if is_surface else ""
        raise InvalidScene(
            f"{name} is {'a surface of triangles, no body' if is_surface else 'IGES'}, which is "
            f"not taken; save a solid as STEP{filled}."
        )
    if path.exists():
        require_file(name, "give a TOML file or a built-in scene")
    try:
        size = path.stat().st_size
        if size > MOST_BYTES:
            raise InvalidScene(
                f"{name} holds {size:.2g} bytes, a scene up to {MOST_BYTES:.2g}; give a TOML file."
            )
        text = path.read_text(encoding="utf-8-sig")  # some editors put a byte order mark
    except FileNotFoundError:
        if path.suffix == ".toml":
            raise InvalidScene(
                f"there is no file {path.absolute()}; give the path of one."
            ) from None
        raise InvalidScene(
            f"no scene {name!r}: neither a file nor a built-in scene has this name; "
            f"{nearest(name, scenes)}."
        ) from None
    except UnicodeDecodeError:
        raise InvalidScene(f"{name} is not a text file in UTF-8; give a scene in TOML.") from None
    except OSError as error:
        raise InvalidScene(f"{name} cannot be read ({error.strerror}); give a TOML file.") from None
    return SceneText(name, text, path.absolute().parent)


def working_folder() -> Path:
    """The current folder; raises InvalidScene if it no longer exists."""
    try:
        return Path.cwd()
    except FileNotFoundError:
        raise InvalidScene(
            "the current folder has been removed; change to another one (cd) and try again."
        ) from None


def checked_text(name: str) -> SceneText:
    """Text of one scene; raises InvalidScene if it is not a scene."""
    text = scene_text(name)
    if name not in built_in():
        completed(Written(name, parsed(text.text, name), text.folder))
    return text


def scene(source: Source = None, changes: Changes = ()) -> Scene:
    """The resolved scene: `changes` by dotted keys applied, every default filled in."""
    if isinstance(source, Scene) and not changes:
        return source
    return completed(written(source, changes))


class Written(NamedTuple):
    """A scene as it is written."""

    name: str  # where it comes from, for sentences
    tables: dict[str, Any]
    folder: Path  # paths inside the scene are relative to it


def written(source: Source = None, changes: Changes = ()) -> Written:
    """The tables of a scene with `changes` by dotted keys applied, nothing else."""
    if isinstance(source, Scene):
        tables = Written(source.name, source.model_dump(exclude_none=True), working_folder())
    elif isinstance(source, Mapping):
        require_shallow(source, "scene")
        tables = Written("scene", _plain(source), working_folder())
    else:
        name, text, folder = scene_text(None if source is None else str(source))
        tables = Written(name, parsed(text, name), folder)
    return tables._replace(tables=changed(tables.tables, each(changes)))


def completed(written: Written) -> Scene:
    """The scene with every default filled in; raises InvalidScene."""
    scene = resolved(written.tables, written.name, written.folder)
    if not isinstance(scene.wall, RomWall) or scene.wall.file is None:
        return scene
    # only a wall from a file pays for the reader
    from beadwave.workflows.files.wall_file import with_surface

    try:
        return scene.model_copy(update={"wall": with_surface(scene.wall)})
    except InvalidScene as error:
        raise InvalidScene(f"{written.name}: {error}") from None


def tables_of(source: Source) -> dict[str, Any]:
    """The tables that a scene is told by, as they are written."""
    return written(source).tables


def each(changes: Changes) -> tuple[Change, ...]:
    """The changes one by one."""
    if not isinstance(changes, Mapping):
        return tuple(changes)
    require_shallow(changes, "changes")
    return tuple(_plain(changes).items())


def _plain(value: Any) -> Any:
    """Arrays as lists, paths as texts: what TOML knows."""
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if hasattr(value, "tolist"):  # numpy's arrays and numbers
        return value.tolist()
    return str(value) if isinstance(value, Path) else value


def about_its_file(sentence: str, source: Source) -> str:
    """A sentence that begins with the name of a scene, begun with the file that the scene is in."""
    if not isinstance(source, str | Path) or str(source) in built_in():
        return sentence
    try:
        name = written(source).tables.get("name", Path(source).stem)
    except InvalidScene:
        return sentence
    begin = f"{name}: "
    return f"{source}: {sentence.removeprefix(begin)}" if sentence.startswith(begin) else sentence


def files_read(scene: Scene, source: Source = None, *others: str | Path | None) -> tuple[Path, ...]:
    """The files that a run of the scene reads: its own, those that its tables name, and others
    that are given."""
    is_file = isinstance(source, str | Path) and str(source) not in built_in()
    itself = [source] if is_file else []
    files = (*itself, *files_of(scene), *others)
    return tuple(Path(file) for file in files if isinstance(file, str | Path) and file)


def tables(name: str) -> dict[str, Any]:
    """The tables of a scene as they are written, for JSON: no infinite number in it. Raises
    InvalidScene for a text that is no scene."""
    source, text, _ = checked_text(name)
    names = {"Infinity": "inf", "-Infinity": "-inf"}
    try:
        return loads(dumps(parsed(text, source)), parse_constant=names.get)
    except RecursionError:
        raise InvalidScene(f"{source} has tables nested too deeply; a scene has two.") from None


def keys(source: Source = None) -> list[str]:
    """The dotted keys of the tables that a scene has."""
    written = scene(source).written
    tables = {name: table for name, table in written if hasattr(type(table), "model_fields")}
    return [f"{name}.{key}" for name, table in tables.items() for key in type(table).model_fields]
