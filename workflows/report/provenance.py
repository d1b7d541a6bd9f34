"""Origin of each value of a scene, by the comments of the built-in scenes.

A value that equals that of the built-in scene of the same name has the mark of its comment there:
thesis, inferred or assumed; chosen, if there is none. A value that differs, or that stands in
another scene, is the user's, with the user's comment; a value that is not written is a default.
"""

import re
import shlex
import tomllib
from collections import Counter
from json import dumps
from pathlib import Path
from typing import Any, NamedTuple

from beadwave.workflows.files.scene import (
    DEFAULT,
    Changes,
    Source,
    built_in,
    each,
    scene_text,
    tables_of,
)
from beadwave.workflows.files.scene import scene as load
from beadwave.workflows.report.summary import ValueSource
from beadwave.workflows.scene import Scene
from beadwave.workflows.scene.toml import changed

MARK = re.compile(r"(?:^|[,;] )(thesis|inferred|assumed)(?=[:,;.]| with|$)", re.IGNORECASE)
HEADER = re.compile(r"(\[+)([\w.-]+)\]+\s*(?:#\s*(.*))?")
VALUE = re.compile(r"([\w-]+)\s*=\s*(?:[^#\"]|\"[^\"]*\")*(?:#\s*(.*))?")
NAME = re.compile(r"name\s*=\s*[\"']([^\"']*)")  # of a table of a list, its first key
BY_DEFAULT = ValueSource(kind="default")


class Origin(NamedTuple):
    """The request for a run: a command that repeats it, the source of each value by its dotted key,
    and the text of the scene with its comments."""

    command: str
    sources: dict[str, ValueSource]
    text: str = ""


UNKNOWN = Origin("", {})


def origin(word: str, scene: Scene, source: Source, changes: Changes) -> Origin:
    """The command `word` for a scene by name or file, in Python no command."""
    command = text = ""
    if source is None or isinstance(source, str | Path):
        options = []
        for change in each(changes):  # as --set takes them
            if not isinstance(change, str):
                key, value = change
                change = f"{key}={_inline(value)}"
            options.append(f"--set={change}")
        command = shlex.join(["beadwave", word, str(source or DEFAULT), *options])
        # names of files may have bytes that are no UTF-8, which no file of the folder can hold
        command = command.encode("utf-8", "backslashreplace").decode("utf-8")
        name = None if source is None else str(source)
        text = f"# the scene of: {command}\n{scene_text(name).text}"
    return Origin(command, sources(scene, source, changes), text)


def _inline(value: Any) -> str:
    """A value of TOML on one line."""
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key} = {_inline(item)}' for key, item in value.items())}}}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_inline, value))}]"
    return dumps(value) if isinstance(value, str | bool) else repr(value)


def sources(scene: Scene, source: Source, changes: Changes) -> dict[str, ValueSource]:
    """Dotted key to source for every value of the resolved scene."""
    name = None
    if source is None or isinstance(source, str | Path):
        name = DEFAULT if source is None else str(source)
    scenes = built_in()

    # yours: values that were given, with the comments of your file on those that no change took
    tables = tables_of(source)
    written = changed(tables, each(changes))
    unchanged, new_values = flat(tables), flat({"name": scene.name, **written})
    is_file = source is not None and name is not None and name not in scenes
    notes = comments(scene_text(name).text) if is_file else {}
    yours = {}
    for key, value in new_values.items():
        note = notes.get(key, "") if unchanged.get(key) == value else ""
        yours[key] = ValueSource(kind="yours", note=note)

    # the built-in scene that this one is, or was copied from: its values, and the marks of those
    # that it writes
    values, marks = {}, {}
    reference = next((key for key in (name, written.get("name")) if key in scenes), None)
    if reference:
        values = flat(load(reference).model_dump(exclude_none=True))
        notes = comments(scenes[reference])
        for key in flat(tomllib.loads(scenes[reference])):
            mark = MARK.search(notes.get(key, ""))
            kind = mark[1].lower() if mark else "chosen"
            marks[key] = ValueSource(kind=kind, note=notes.get(key, ""))

    return {
        key: marks.get(key, BY_DEFAULT)
        if key in values and values[key] == value
        else yours.get(key, BY_DEFAULT)
        for key, value in flat(scene.model_dump(exclude_none=True)).items()
    }


def flat(table: Any, path: str = "") -> dict[str, Any]:
    """Dotted keys to values; tables of a list by their name or number."""
    values: dict[str, Any] = {}
    for key, value in table.items():
        dotted = f"{path}.{key}" if path else key
        items = value if isinstance(value, list | tuple) else ()
        if isinstance(value, dict):
            values |= flat(value, dotted)
        elif items and all(isinstance(item, dict) for item in items):
            for i, item in enumerate(items, start=1):
                values |= flat(item, f"{dotted}.{item.get('name', i)}")
        else:
            values[dotted] = tuple(value) if isinstance(value, list) else value
    return values


def comments(text: str) -> dict[str, str]:
    """Dotted key to the comment behind it, over its lines; without a mark also that of its table,
    behind the table's name or on the lines before it, the first one whole, others its mark."""
    notes: dict[str, str] = {}
    table, table_note = "", ""  # the open table with its dot, what its values inherit
    last, block = "", ""  # the key of the last value, the comment on the lines before this one
    number, tables_of_name = "", Counter()  # of a table of a list, as long as it has no name
    for line in text.splitlines():
        if header := HEADER.fullmatch(line.strip()):
            brackets, name, note = header.groups()
            tables_of_name[name] += 1
            number = f"{tables_of_name[name]}." if brackets == "[[" else ""
            table, last = f"{name}.{number}", ""
            table_note = f"{block.removesuffix('.')}; {note or ''}".strip("; ")
        elif line.lstrip().startswith("#"):
            block = f"{block} {line.strip(' #')}".lstrip()
            if last and line.startswith("  "):  # a comment that goes on below its value
                notes[last] += f" {line.strip(' #')}"
            continue
        elif value := VALUE.match(line):
            key, note = value[1], value[2] or ""
            if number and (named := NAME.match(line)):
                table, number = f"{table.removesuffix(number)}{named[1]}.", ""
            if not MARK.search(note) and (mark := MARK.search(table_note)):
                note, table_note = f"{note}; {table_note}".lstrip("; "), mark[1].lower()
            last = table + key
            notes[last] = note
        block = ""
    return notes
