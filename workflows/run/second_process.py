"""Stages that a second process computes on a core that the run leaves idle.

Both take stages from one list: who makes a stage's file first has it. What the other one has
finished is read from the cache of results, or of machine code; what failed there is computed here.

A pool of a library was tried in place of it: loky, which joblib brings, and
concurrent.futures.ProcessPoolExecutor (spawn), one worker each, on two busy cores.

                                   this module     loky            concurrent.futures
    from the call to a stage       2.1 to 2.5 s    3.1 to 8.9 s    2.1 to 2.6 s
    run interrupted amid a stage   ends at once    ends at once    when the stage ends
    run killed, or terminated      ends with it    stays behind    stays behind
    script without a main guard    runs            runs            is refused

Nor would a pool replace the list. Of four stages handed to one worker of loky three count as begun
and cannot be taken back; and the second process has to look for itself which stage has its inputs
in the cache by now.
"""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from os import environ, replace
from pathlib import Path
from pickle import dumps, loads
from subprocess import Popen
from tempfile import TemporaryDirectory
from time import perf_counter, sleep

from beadwave.system import free_cores
from beadwave.workflows.files.child import while_open
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.scene.rules.size import foreseen_nodes, room_beside
from beadwave.workflows.stages.engine.pipeline import Pipeline, couples, pipeline_of

# in the order in which the second process takes them
IMPACT = ("compilation", "half-space", "missed-energy")
RUN = (*IMPACT, "pictures", "response", "figures")
PAUSE = 0.05  # s between two looks at what the other process has


class SecondProcess:
    """The second process as the run sees it."""

    def __init__(self, folder: Path, process: Popen, names: tuple[str, ...]) -> None:
        self._folder = folder
        self._process = process
        self._theirs = set(names)

    def has(self, name: str) -> bool:
        """True if the stage may be there."""
        return name in self._theirs

    def claim_ready(self, ready: Callable[[str], bool]) -> str | None:
        """Claim a stage that is ready and that nobody has begun; None where there is none."""
        names = sorted(self._theirs)
        return next((name for name in names if ready(name) and self._claim(name)), None)

    def seconds(self, name: str, meanwhile: Callable[[], bool]) -> float | None:
        """Seconds of a stage there, once it has ended; None if this process has to compute it.

        meanwhile() computes another stage, and is False where there is none to compute.
        """
        ended = self._folder / f"{name}.seconds"
        if name not in self._theirs or self._claim(name):
            return None
        while self._process.poll() is None and not ended.exists():
            if not meanwhile():
                sleep(PAUSE)
        self._theirs.discard(name)
        return float(ended.read_text(encoding="utf-8")) if ended.exists() else None

    def _claim(self, name: str) -> bool:
        """True if this process computes the stage: it claims it now, or has done so."""
        if claim(self._folder, name):
            self._theirs.discard(name)
        return name not in self._theirs


@contextmanager
def two_processes(pipeline: Pipeline, names: tuple[str, ...]) -> Iterator[None]:
    """A second process for these stages, where a core, memory and the cache allow for it.

    None is started for a single picture. BEADWAVE_PROCESSES=1 keeps a run to one process; raises
    InvalidScene where it is neither 1 nor 2.
    """
    processes = environ.get("BEADWAVE_PROCESSES") or "2"
    if processes not in ("1", "2"):
        raise InvalidScene(
            f"BEADWAVE_PROCESSES = {processes!r} must be 1 or 2; set it so, or leave it out."
        )
    missing = tuple(name for name in names if _wanted(pipeline, name))
    cores = free_cores()
    allowed = processes == "2" and cores > 1 and pipeline.keeps
    worth = len(missing) > 1 or "compilation" in missing
    if allowed and worth and (scene := pipeline.scene).bending is None:
        # nodes of bodies are counted only once they are meshed, which the run does anyway
        allowed = room_beside(scene, foreseen_nodes(scene) or pipeline("mesh").nodes)
    if not allowed or not worth:
        yield
        return
    # threads of MKL that wait for a core spin: each process gets its share
    environ.setdefault("MKL_NUM_THREADS", str(cores // 2))
    # on Windows a child that was killed may have its files open for some ms
    with TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        Path(folder, "work").write_bytes(dumps((pipeline.scene, missing)))
        with while_open("beadwave.workflows.run.second_process", folder) as process:
            pipeline.worker = SecondProcess(Path(folder), process, missing)
            try:
                yield
            finally:
                pipeline.worker = None


def _wanted(pipeline: Pipeline, name: str) -> bool:
    """True if the run will need a stage that is not kept."""
    scene = pipeline.scene
    if not scene.chain and name in ("compilation", "half-space", "figures"):
        return False
    if name == "compilation" and (couples(scene) or pipeline.kept("impact")):
        return False
    if name in ("half-space", "missed-energy") and scene.bending is not None:
        return False
    if name == "half-space" and pipeline.kept("reduction") and pipeline.kept("missed-energy"):
        return False
    return not pipeline.kept(name)


def claim(folder: Path, name: str) -> bool:
    """Make the stage's file; False where the other process has made it before."""
    with suppress(FileExistsError):
        (folder / name).touch(exist_ok=False)
        return True
    return False


def main() -> None:
    """Compute what nobody has begun of the stages in the folder named on the command line."""
    folder = Path(sys.argv[1])
    scene, names = loads((folder / "work").read_bytes())
    pipeline = pipeline_of(scene, lambda name: nullcontext())
    while unclaimed := [name for name in names if not (folder / name).exists()]:
        ready = next((name for name in unclaimed if pipeline.at_hand(name)), None)
        if ready is None:
            # meanwhile what these stages need and no cache keeps, as mesh and model
            if not pipeline.prepare(unclaimed):
                sleep(PAUSE)
            continue
        if not claim(folder, ready):
            continue
        started = perf_counter()
        with suppress(Exception):  # computed again by the run, which says what is wrong
            pipeline(ready)
        # the whole number at once: the run reads it as soon as the file is there
        (folder / "part").write_text(f"{perf_counter() - started}", encoding="utf-8", newline="\n")
        replace(folder / "part", folder / f"{ready}.seconds")


if __name__ == "__main__":
    main()
