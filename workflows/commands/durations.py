"""How long stages took, kept beside the results, so that the next run can say what is left."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from json import dumps, loads
from pathlib import Path
from time import perf_counter

NAME = "durations.json"
NOTED = 1.0  # s that are worth a note
FIRST = {  # s on two cores of 2020, until a run has measured its own
    "compilation": 30.0, "mesh": 3.0, "modes": 12.0, "reduction": 12.0, "coarse-reduction": 6.0,
    "full-response": 6.0, "pictures": 6.0,
}  # fmt: skip


class Durations:
    """Seconds of the stages of a command; an unreadable or read-only file is as good as none."""

    def __init__(self, command: str) -> None:
        self._command = command

    def expected(self, stage: str) -> float | None:
        """Seconds of the stage the last time; None where nobody knows."""
        return _noted().get(self._command, {}).get(stage) or FIRST.get(stage)

    @contextmanager
    def measured(self, stage: str) -> Iterator[None]:
        """Note how long it takes, where it ends well."""
        started = perf_counter()
        yield
        seconds = perf_counter() - started
        if seconds > NOTED and self._command:
            self._note(stage, seconds)

    def _note(self, stage: str, seconds: float) -> None:
        if not _file().parent.is_dir():  # made by the cache, with its own mode, or not at all
            return
        noted = _noted()
        noted.setdefault(self._command, {})[stage] = round(seconds, 1)
        with suppress(OSError):
            from workflows.files.run_folder import writing_file

            with writing_file(_file()) as part:
                part.write_text(dumps(noted), encoding="utf-8")


def _file() -> Path:
    from workflows.pipeline.cache import cache_folder

    return cache_folder() / NAME


def _noted() -> dict[str, dict[str, float]]:
    with suppress(OSError, ValueError):
        found = loads(_file().read_text(encoding="utf-8"))
        if isinstance(found, dict):
            return found
    return {}
