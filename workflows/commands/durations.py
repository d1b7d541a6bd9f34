"""Seconds that stages take: those of an earlier run, kept beside the cache, or those of the thesis'
rig, scaled to the unknowns of the mesh."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from json import dumps, loads
from math import isfinite
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

NAME = "durations.json"
SHORTEST = 1.0  # s of a stage that is recorded


class Duration(NamedTuple):
    """How long a stage takes."""

    seconds: float
    unknowns: float | None = None  # of the mesh; None where there is none, or it is not known
    power: float = 0.0  # of the unknowns, which the seconds grow with


UNKNOWNS = 40_389.0  # of rig-rom
# Processor seconds of one core, without compilation, and the power between these and the seconds
# with all seeds times 0.7, 62 607 unknowns. Those of a factor grow towards the power 4/3.
RIG = {
    "mesh": Duration(0.5),
    "model": Duration(2.1, UNKNOWNS, 0.96),
    "factor": Duration(3.2, UNKNOWNS, 0.87),
    "krylov-space": Duration(4.1, UNKNOWNS, 0.86),
    "modes": Duration(0.2, UNKNOWNS, 1.35),
    "reduction": Duration(2.2, UNKNOWNS, 0.87),
    "response": Duration(0.7),
    "mac": Duration(0.6, UNKNOWNS, 0.99),
    "pictures": Duration(3.2),
    "missed-energy": Duration(2.5, UNKNOWNS, 1.42),
    "figures": Duration(0.6),
}
COMPILATION = Duration(7.0)  # from an empty cache
SCENES = ("None", "rig-rom", "rig-rom-269", "rig-rom-907")  # of the rig; others differ


class Durations:
    """Seconds of the stages of a command; a file that cannot be read or written counts as empty."""

    def __init__(self, command: str) -> None:
        self._command = command
        self._is_rig = command.rpartition(" ")[2] in SCENES
        self._foreseen = self._measured = 0.0  # s of the stages that this command has ended
        self.unknowns: float | None = None  # of this command's mesh, once they are known

    def expected(self, stage: str) -> float | None:
        """Seconds that the stage took the last time, for as many unknowns as there are now, times
        the factor by which the stages of this command have been slower than then, if they were;
        None where nothing is known."""
        seconds = self._last(stage)
        slower = max(1.0, self._measured / max(self._foreseen, SHORTEST))
        return seconds and seconds * slower

    def left(self, stages: Iterable[str]) -> float:
        """Seconds that these stages will take, as far as they are known."""
        return sum(self.expected(stage) or 0.0 for stage in stages)

    def _last(self, stage: str) -> float | None:
        """Seconds on a machine as fast as the last time's."""
        usual = COMPILATION if stage == "compilation" else RIG.get(stage)
        recorded = self._recorded().get(stage)
        if recorded is None:
            recorded = usual
            # of a mesh that nobody has run the rig's are all that there is
            if usual is None or not (usual.unknowns is None or self._is_rig or self.unknowns):
                return None
        if recorded.unknowns and self.unknowns:
            power = usual.power if usual else 0.0
            return recorded.seconds * (self.unknowns / recorded.unknowns) ** power
        return recorded.seconds

    def _recorded(self) -> dict[str, Duration]:
        stages = _file_content().get(self._command, {})
        return {stage: Duration(*entry) for stage, entry in stages.items()}

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
        commands = _file_content()
        recorded = commands.setdefault(self._command, {})
        recorded[stage] = [round(seconds, 1), self.unknowns]
        with suppress(OSError):
            from beadwave.workflows.files.whole_file import writing_file

            with writing_file(_file()) as path:
                path.write_text(dumps(commands), encoding="utf-8", newline="\n")


def _file() -> Path:
    from beadwave.workflows.files.cache_folder import cache_folder

    return cache_folder() / NAME


def _file_content() -> dict[str, dict[str, list]]:
    """Seconds and unknowns by command and stage; without what is of another version or damaged."""
    commands: object = {}
    with suppress(OSError, ValueError, RecursionError):
        if _file().is_file():  # a pipe would block
            commands = loads(_file().read_text(encoding="utf-8"))

    def is_number(value: object) -> bool:
        """Whether a value of the file is a finite number."""
        return isinstance(value, int | float) and isfinite(value)

    return {
        command: {
            stage: entry
            for stage, entry in stages.items()
            if isinstance(entry, list)
            and len(entry) == 2
            and is_number(entry[0])
            and (entry[1] is None or is_number(entry[1]))
        }
        for command, stages in (commands.items() if isinstance(commands, dict) else ())
        if isinstance(stages, dict)
    }
