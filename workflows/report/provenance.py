"""Where each value of a scene comes from, by the comments of the built-in scenes.

A value is its scene's own where it equals that of the built-in scene of the same name, with the
mark of that scene's comment: thesis, inferred, assumed, or chosen where it has none. What differs
or stands in another scene is yours, with your comment, what nobody wrote is a default.
"""

import re
import shlex
import tomllib
from collections import Counter
from json import dumps
from pathlib import Path
from typing import Any, NamedTuple

from workflows.files.scene import DEFAULT, Changes, Source, built_in, each, scene_text, tables_of
from workflows.files.scene import scene as load
from workflows.report.summary import ValueSource
from workflows.scene import Scene
from workflows.scene.toml import changed

MARK = re.compile(r"(?:^|[,;] )(thesis|inferred|assumed)(?=[:,;.]| with|$)", re.IGNORECASE)
HEADER = re.compile(r"(\[+)([\w.-]+)\]+\s*(?:#\s*(.*))?")
VALUE = re.compile(r"([\w-]+)\s*=\s*(?:[^#\"]|\"[^\"]*\")*(?:#\s*(.*))?")
NAME = re.compile(r"name\s*=\s*[\"']([^\"']*)")  # of a table of a list, its first key
BY_DEFAULT = ValueSource(kind="default")


class Origin(NamedTuple):
    """What asked for a run: a command that repeats it, the source of each value, and the scene as
    it was written, comments and all."""

    command: str
    sources: dict[str, ValueSource]
    text: str = ""


UNKNOWN = Origin("", {})


def origin(word: str, scene: Scene, source: Source, changes: Changes) -> Origin:
    """The command `word` for a scene by name or file, in Python no command."""
    named = source is None or isinstance(source, str | Path)
    options = [f"--set={_written(change)}" for change in each(changes)]
    command = shlex.join(["beadwave", word, str(source or DEFAULT), *options]) if named else ""
    text = f"# the scene of: {command}\n{scene_text(_name(source)).text}" if named else ""
    return Origin(command, sources(scene, source, changes), text)


def _name(source: Source) -> str | None:
    return None if source is None else str(source)


def _written(change: str | tuple[str, Any]) -> str:
    """A change as --set takes it."""
    if isinstance(change, str):
        return change
    key, value = change
    return f"{key}={_inline(value)}"


def _inline(value: Any) -> str:
    """A value of TOML on one line."""
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key} = {_inline(one)}' for key, one in value.items())}}}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_inline, value))}]"
    return dumps(value) if isinstance(value, str | bool) else repr(value)


def sources(scene: Scene, source: Source, changes: Changes) -> dict[str, ValueSource]:
    """Dotted key to source for every value of the resolved scene."""
    before = tables_of(source)
    written = changed(before, each(changes))
    given = flat({"name": scene.name, **written})
    yours = _yours(source, flat(before), given)
    reference = _reference(source, written)
    values, marks = _marked(reference) if reference else ({}, {})
    return {
        key: marks.get(key, BY_DEFAULT)
        if key in values and values[key] == value
        else yours.get(key, BY_DEFAULT)
        for key, value in flat(scene.model_dump(exclude_none=True)).items()
    }


def _yours(source: Source, before: dict[str, Any], given: dict[str, Any]) -> dict[str, ValueSource]:
    """Values that were given, with the comments of the user's file on those that no change took."""
    own = isinstance(source, str | Path) and str(source) not in built_in()
    notes = _comments(scene_text(str(source)).text) if own else {}
    kept = {key: notes.get(key, "") if before.get(key) == given[key] else "" for key in given}
    return {key: ValueSource(kind="yours", note=note) for key, note in kept.items()}


def flat(table: Any, path: str = "") -> dict[str, Any]:
    """Dotted keys to values; tables of a list by their name or number."""
    found: dict[str, Any] = {}
    for key, value in table.items():
        here = f"{path}.{key}" if path else key
        several = value if isinstance(value, list | tuple) else ()
        if isinstance(value, dict):
            found |= flat(value, here)
        elif several and all(isinstance(one, dict) for one in several):
            for i, one in enumerate(several, start=1):
                found |= flat(one, f"{here}.{one.get('name', i)}")
        else:
            found[here] = tuple(value) if isinstance(value, list) else value
    return found


def _reference(source: Source, written: dict[str, Any]) -> str | None:
    """The built-in scene that this one is, or was copied from."""
    scenes = built_in()
    own = DEFAULT if source is None else str(source) if isinstance(source, str | Path) else None
    return next((one for one in (own, written.get("name")) if one in scenes), None)


def _marked(name: str) -> tuple[dict[str, Any], dict[str, ValueSource]]:
    """The values of a built-in scene, and the marks of those that it writes."""
    text = built_in()[name]
    written, notes = flat(tomllib.loads(text)), _comments(text)
    marks = {key: _mark(notes.get(key, "")) for key in written}
    return flat(load(name).model_dump(exclude_none=True)), marks


def _mark(comment: str) -> ValueSource:
    found = MARK.search(comment)
    return ValueSource(kind=found[1].lower() if found else "chosen", note=comment)


def _comments(text: str) -> dict[str, str]:
    """Dotted key to the comment behind it, over its lines; without a mark also that of its table,
    behind the table's name or on the lines before it, the first one whole, others its mark."""
    notes: dict[str, str] = {}
    table, head, last, block = "", "", "", ""
    number, seen = "", Counter()
    for line in text.splitlines():
        if found := HEADER.fullmatch(line.strip()):
            seen[found[2]] += 1
            number = f"{seen[found[2]]}." if found[1] == "[[" else ""
            table, last = f"{found[2]}.{number}", ""
            head = f"{block.removesuffix('.')}; {found[3] or ''}".strip("; ")
        elif line.lstrip().startswith("#"):
            block = f"{block} {line.strip(' #')}".lstrip()
            if last and line.startswith("  "):
                notes[last] += f" {line.strip(' #')}"
            continue
        elif found := VALUE.match(line):
            if number and (name := NAME.match(line)):
                table, number = f"{table.removesuffix(number)}{name[1]}.", ""
            last, own = table + found[1], found[2] or ""
            if not MARK.search(own) and (mark := MARK.search(head)):
                own, head = f"{own}; {head}".lstrip("; "), mark[1].lower()
            notes[last] = own
        block = ""
    return notes
