"""How long stages took, kept beside the results, so that the next run can say what is left."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from json import dumps, loads
from pathlib import Path
from time import perf_counter

NAME = "durations.json"
NOTED = 1.0  # s that are worth a note
COMPILATION = {"compilation": 30.0}  # s on a quiet core of 2020, until a run has measured its own
RIG = {
    "mesh": 3.0, "modes": 12.0, "reduction": 12.0, "second-mesh": 6.0, "full-response": 6.0,
    "pictures": 6.0,
}  # fmt: skip
RIGS = ("None", "rig-rom", "rig-rom-269", "rig-rom-907")  # their scenes; those of others differ


class Durations:
    """Seconds of the stages of a command; an unreadable or read-only file is as good as none."""

    def __init__(self, command: str) -> None:
        self._command = command
        self._first = COMPILATION | (RIG if command.rpartition(" ")[2] in RIGS else {})
        self._foreseen = self._taken = 0.0  # s of the stages that this command has ended

    def expected(self, stage: str) -> float | None:
        """Seconds of the stage as the last time, more where those before took longer than then;
        None where nobody knows."""
        known = self._known(stage)
        return known and known * max(1.0, self._taken / max(self._foreseen, NOTED))

    def told(self, stage: str) -> str:
        """The same in words, of a stage that is running."""
        seconds = self.expected(stage)
        if not seconds:
            return f"{stage} is running"
        when = "as the last time" if stage in self._own() else "on a first run"
        return f"{stage} is running, about {seconds:.0f} s {when}"

    def _known(self, stage: str) -> float | None:
        return self._own().get(stage) or self._first.get(stage)

    def _own(self) -> dict[str, float]:
        return _noted().get(self._command, {})

    @contextmanager
    def measured(self, stage: str) -> Iterator[None]:
        """Note how long it takes, where it ends well."""
        known, started = self._known(stage), perf_counter()
        yield
        seconds = perf_counter() - started
        if known:
            self._foreseen, self._taken = self._foreseen + known, self._taken + seconds
        if seconds > NOTED and self._command:
            self._note(stage, seconds)

    def _note(self, stage: str, seconds: float) -> None:
        if not _file().parent.is_dir():  # made by the cache, with its own mode, or not at all
            return
        noted = _noted()
        noted.setdefault(self._command, {})[stage] = round(seconds, 1)
        with suppress(OSError):
            from workflows.files.whole_file import writing_file

            with writing_file(_file()) as part:
                part.write_text(dumps(noted), encoding="utf-8")


def _file() -> Path:
    from workflows.files.cache_folder import cache_folder

    return cache_folder() / NAME


def _noted() -> dict[str, dict[str, float]]:
    with suppress(OSError, ValueError):
        found = loads(_file().read_text(encoding="utf-8"))
        if isinstance(found, dict):
            return found
    return {}
