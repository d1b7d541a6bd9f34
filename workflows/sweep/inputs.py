"""Inputs of a table besides scene and cases: the files that these name, and the program."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from beadwave.workflows.files.scene import files_read
from beadwave.workflows.scene import Scene
from beadwave.workflows.scene.named_files import every_file_key
from beadwave.workflows.stages.engine.cache import digest, program
from beadwave.workflows.stages.engine.stage_table import content
from beadwave.workflows.sweep.cases import Base
from beadwave.workflows.sweep.core.design import Design

Stamp = tuple[int, int, int, int]


class Inputs:
    """Files as they were when a table was begun, and the program that fills it."""

    def __init__(self, files: Iterable[Path]) -> None:
        # stamps first: a file that changes while it is read has another one afterwards
        self._stamps = {path: _stamp(path) for path in files}
        self._contents = {path: content(path) for path in self._stamps}
        contents = {str(path): read for path, read in self._contents.items()}
        self.key = digest([contents, *program()])

    def require_unchanged(self, *, by_content: bool = False) -> None:
        """Raise ValueError for a file that has changed; `by_content` reads also those whose
        size and times are the same."""
        for path, first_content in self._contents.items():
            stamp = _stamp(path)
            if stamp == self._stamps[path] and not by_content:
                continue
            if content(path) != first_content:
                raise ValueError(
                    f"{path} changed while its cases were computed; put the file back to go on "
                    "with the rows that are there, or repeat the command to compute all anew."
                )
            self._stamps[path] = stamp


def files_of_cases(base: Base, design: Design) -> list[Path]:
    """Files that the scene names and that the values of its cases name, each once."""
    folder = base.written.folder
    swept = (
        folder / name
        for key, values in design.columns.items()
        for value in values
        if isinstance(value, str | dict | list)
        for name in _named(value, key.rpartition(".")[2])
    )
    return list(dict.fromkeys([*files_of_scene(base.with_values({})), *swept]))


def files_of_scene(scene: Scene) -> list[Path]:
    """Files that its tables name, each once."""
    return list(dict.fromkeys(files_read(scene)))


def _named(value: Any, key: str) -> Iterator[str]:
    """Texts that stand for files in the value of a key, at any depth."""
    if isinstance(value, dict):
        for name, below in value.items():
            yield from _named(below, name)
    elif isinstance(value, list):
        for item in value:
            yield from _named(item, key)
    elif isinstance(value, str) and key in every_file_key():
        yield value


def _stamp(path: Path) -> Stamp | None:
    """Changes with nearly every change of a file: the change time cannot be set by hand."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_ctime_ns, status.st_size, status.st_ino
