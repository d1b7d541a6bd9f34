"""Scenes by name: built-in ones and files, read with the wall's file that they name."""

from importlib.resources import files
from json import dumps, loads
from pathlib import Path
from typing import Any, NamedTuple

from workflows.scene import InvalidScene, RomWall, Scene, nearest
from workflows.scene.toml import changed, parsed, resolved

DEFAULT = "rig-rom"
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
    if path.exists() and not path.is_file():  # a pipe would be waited for, a device has no end
        raise InvalidScene(f"{name} is no ordinary file; give a TOML file or a built-in scene.")
    try:
        _require_readable(name, path.stat().st_size)
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


def _require_readable(name: str, size: int) -> None:
    if size > MOST_BYTES:
        raise InvalidScene(
            f"{name} holds {size:.2g} bytes, a scene up to {MOST_BYTES:.2g}; give a TOML file."
        )


def scene(name: str | None = None, changes: tuple[str, ...] = ()) -> Scene:
    """The resolved scene: `changes` ("key=value", dotted) applied, every default filled in."""
    source, text, folder = scene_text(name)
    found = resolved(changed(parsed(text, source), changes), source, folder)
    if not isinstance(found.wall, RomWall) or found.wall.file is None:
        return found
    from workflows.files.wall import with_surface  # only a wall from a file pays for the reader

    try:
        return found.model_copy(update={"wall": with_surface(found.wall)})
    except InvalidScene as error:
        raise InvalidScene(f"{source}: {error}") from None


def files_read(scene: Scene, name: str | None = None) -> tuple[Path, ...]:
    """The files that a run of the scene reads: its own, and those that its tables name."""
    own = [name] if name and name not in built_in() else []
    named = [getattr(table, key, None) for _, table in scene for key in ("file", "step")]
    return tuple(Path(file) for file in (*own, *named) if file)


def tables(name: str) -> dict[str, Any]:
    """The tables of a scene as they are written, for JSON: no date and no infinite number in it."""
    source, text, _ = scene_text(name)
    names = {"Infinity": "inf", "-Infinity": "-inf", "NaN": "nan"}
    try:
        return loads(dumps(parsed(text, source), default=str), parse_constant=names.get)
    except RecursionError:
        raise InvalidScene(f"{source} has tables nested too deeply; a scene has two.") from None
