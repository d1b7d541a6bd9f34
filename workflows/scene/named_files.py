"""Files that a user names: the keys of a scene that do, and checks: a pipe would be waited for.

A key of the type FileName is looked for in the folder of the scene (`in_folder`), never written
over (`files_of`), and its content is in the key of every stage that reads its table
(`workflows.stages.engine.pipeline.tables_of`).
"""

import os
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Annotated, Any, get_args

from pydantic import AfterValidator, BaseModel

from beadwave.system import free_memory
from beadwave.workflows.scene.scene_table import InvalidScene, SceneTable
from beadwave.workflows.scene.shown import shown

ALWAYS_READ = 1e7  # bytes of a file that is read whatever the memory
LONGEST_PATH, LONGEST_NAME = 4096, 255  # bytes of a path, and of a name in it


class ToRead:
    """Marks the type of a key whose text is a file that is read."""


def _nameable(path: str) -> str:
    if why := no_name(path):
        raise ValueError(f"{shown(path)} {why}")
    return path


FileName = Annotated[str, ToRead(), AfterValidator(_nameable)]


@cache
def file_keys(table: type[BaseModel]) -> tuple[str, ...]:
    """The keys of a table that name files, without those of tables in it."""
    names = []
    for name, field in table.model_fields.items():
        parts: list[Any] = [*field.metadata, field.annotation]
        while parts:
            part = parts.pop()
            if isinstance(part, ToRead):
                names.append(name)
            parts += get_args(part)
    return tuple(dict.fromkeys(names))


def every_file_key() -> set[str]:
    """The last words of all keys that name files, as "receptance"."""
    tables, names = [SceneTable], set()
    while tables:
        table = tables.pop()
        names |= {*file_keys(table)}
        tables += table.__subclasses__()
    return names


def tables_in(value: Any) -> Iterator[SceneTable]:
    """The tables in a value of a scene at any depth, itself among them."""
    if isinstance(value, SceneTable):
        yield value
        for name in type(value).model_fields:
            yield from tables_in(getattr(value, name))
    elif isinstance(value, tuple | list | dict):
        for entry in value.values() if isinstance(value, dict) else value:
            yield from tables_in(entry)


def files_of(value: Any) -> Iterator[str]:
    """The files that the tables in a value of a scene name."""
    for table in tables_in(value):
        yield from filter(None, (getattr(table, key) for key in file_keys(type(table))))


def in_folder(value: Any, folder: Path) -> Any:
    """A value of a scene with the files that its tables name looked for in a folder."""
    if isinstance(value, tuple | list):
        return type(value)(in_folder(entry, folder) for entry in value)
    if isinstance(value, dict):
        return {name: in_folder(entry, folder) for name, entry in value.items()}
    if not isinstance(value, SceneTable):
        return value
    changed = {}
    for name in type(value).model_fields:
        before = getattr(value, name)
        is_file = name in file_keys(type(value)) and before
        after = str(folder / before) if is_file else in_folder(before, folder)
        if after != before:
            changed[name] = after
    return value.model_copy(update=changed) if changed else value


def no_name(path: str | Path) -> str | None:
    """Reason for which a path cannot be the name of a file; None if it can."""
    try:
        parts = [os.fsencode(part) for part in Path(path).parts]
    except UnicodeEncodeError:
        return "has characters that no name of a file has"
    if any(b"\0" in part for part in parts):
        return "contains a null character, which no name of a file has"
    if any(len(part) > LONGEST_NAME for part in parts) or sum(map(len, parts)) > LONGEST_PATH:
        return "is too long for the name of a file"
    return None


def unfit(path: Path) -> str | None:
    """Reason why nothing is read from a path; None of a regular file."""
    if path.is_file():
        return None
    if path.is_dir():
        return "is a folder"
    return "is a pipe or a device, no ordinary file" if path.exists() else "does not exist"


def require_file(path: str | Path, advice: str, *, key: str = "", grows: float = 6.0) -> Path:
    """The path; raises InvalidScene where no ordinary file is, or one whose content, `grows` times
    its size, does not fit into the memory that is free, with the key or option before it.

    Measured with 20 MB of CSV: responses take 6 times their size, time records 1.8 times.
    """
    path = Path(path)
    if why := no_name(path):
        raise InvalidScene(f"{key}{shown(str(path))} {why}; {advice}.")
    if why := unfit(path):
        raise InvalidScene(f"{key}{path} {why}; {advice}.")
    size, most = path.stat().st_size, free_memory() / grows
    if size > max(most, ALWAYS_READ):
        raise InvalidScene(
            f"{key}{path} has {size / 1e9:.3g} GB, and the free memory allows files up to "
            f"{most / 1e9:.3g} GB; cut it into parts, or leave out columns or samples."
        )
    return path
