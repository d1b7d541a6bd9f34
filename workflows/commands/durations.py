"""Seconds that stages took, kept beside the cache, for the time left on the next run's bars."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from json import dumps, loads
from pathlib import Path
from time import perf_counter

NAME = "durations.json"
SHORTEST = 1.0  # s of a stage that is recorded
COMPILATION = {"compilation": 30.0}  # s on a quiet core of 2020, until a run has measured its own
RIG = {
    "mesh": 3.0, "modes": 12.0, "reduction": 12.0, "second-mesh": 6.0, "full-response": 6.0,
    "pictures": 6.0,
}  # fmt: skip
RIGS = ("None", "rig-rom", "rig-rom-269", "rig-rom-907")  # their scenes; those of others differ


class Durations:
    """Seconds of the stages of a command; a file that cannot be read or written counts as empty."""

    def __init__(self, command: str) -> None:
        self._command = command
        self._defaults = COMPILATION | (RIG if command.rpartition(" ")[2] in RIGS else {})
        self._foreseen = self._measured = 0.0  # s of the stages that this command has ended

    def expected(self, stage: str) -> float | None:
        """Seconds that the stage took the last time, times the factor by which the stages of this
        command have been slower than then, if they were; None without a last time."""
        last = self._last(stage)
        slower = max(1.0, self._measured / max(self._foreseen, SHORTEST))
        return last and last * slower

    def in_words(self, stage: str) -> str:
        """The same as a sentence on a stage that is running."""
        seconds = self.expected(stage)
        if not seconds:
            return f"{stage} is running"
        when = "as the last time" if stage in self._recorded() else "on a first run"
        return f"{stage} is running, about {seconds:.0f} s {when}"

    def _last(self, stage: str) -> float | None:
        return self._recorded().get(stage) or self._defaults.get(stage)

    def _recorded(self) -> dict[str, float]:
        return _all_recorded().get(self._command, {})

    @contextmanager
    def measured(self, stage: str) -> Iterator[None]:
        """Record how long a stage takes, where it ends well."""
        last, started = self._last(stage), perf_counter()
        yield
        seconds = perf_counter() - started
        if last:
            self._foreseen, self._measured = self._foreseen + last, self._measured + seconds
        # the folder is made by the cache, with its own mode, or not at all
        if seconds <= SHORTEST or not self._command or not _file().parent.is_dir():
            return
        commands = _all_recorded()
        commands.setdefault(self._command, {})[stage] = round(seconds, 1)
        with suppress(OSError):
            from workflows.files.whole_file import writing_file

            with writing_file(_file()) as path:
                path.write_text(dumps(commands), encoding="utf-8")


def _file() -> Path:
    from workflows.files.cache_folder import cache_folder

    return cache_folder() / NAME


def _all_recorded() -> dict[str, dict[str, float]]:
    """Seconds by command and stage."""
    with suppress(OSError, ValueError):
        commands = loads(_file().read_text(encoding="utf-8"))
        if isinstance(commands, dict):
            return commands
    return {}
