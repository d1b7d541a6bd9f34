"""Stages of a run as pure functions of the scene, each kept by content and computed on demand.

    mesh -> model -> modes -> reduction -> wall -> impact

A stage's key is what it reads of the scene, the keys of the stages it needs, and the program
(`workflows.stages.engine.cache`). A stage whose result is kept never looks at the stages it needs:
a new sphere leaves the finite elements alone.
"""

from collections.abc import Sequence
from contextlib import nullcontext, suppress
from functools import cached_property
from importlib import import_module
from time import perf_counter
from typing import Any, NamedTuple

from joblib import Memory

from beadwave.workflows.scene import Scene
from beadwave.workflows.scene.tables.mesh import AskedOfMesh
from beadwave.workflows.stages.engine.cache import key, memory
from beadwave.workflows.stages.engine.progress import Progress, quiet
from beadwave.workflows.stages.engine.stage_table import Stage, stages_of

STAGES = "beadwave.workflows.stages"  # whose modules the stages name


class StageReport(NamedTuple):
    """Time of a stage in this run."""

    name: str
    seconds: float
    cached: bool


def couples(scene: Scene) -> bool:
    """True if dashpots or the thesis' scheme make a wall that is marched by its own integrator."""
    return scene.has_dashpots or (scene.strike is not None and scene.strike.weights == "thesis")


class Pipeline:
    """A scene's results, each computed or read from the cache when it is first needed."""

    def __init__(
        self,
        scene: Scene,
        memory: Memory,
        progress: Progress = quiet,
        further: Sequence[Stage] = (),
    ) -> None:
        self.scene = scene
        self.reports: list[StageReport] = []
        self._stages = stages_of(scene, further)
        self._results: dict[str, Any] = {}
        self._keys: dict[str, str] = {}
        self._computed: set[str] = set()
        self.keeps = memory.location is not None
        self._kept = memory.cache(_result, ignore=["pipeline"])
        self._progress = progress
        self._spent = 0.0  # s, on all stages so far
        self._started = perf_counter()
        self.worker: Any = None  # a second process that computes stages, see `second_process`

    def __call__(self, name: str) -> Any:
        """The result of a stage."""
        if name not in self._results:
            self._results[name] = self._timed(name)
            self._let_go(self._stages[name].needs + self._stages[name].means)
        return self._results[name]

    def give(self, name: str, result: Any) -> None:
        """Take a stage's result from elsewhere."""
        self._results[name] = result

    def _let_go(self, names: tuple[str, ...]) -> None:
        """Of these what is large and no stage needs any more."""
        for name in names:
            users = {
                user
                for user, stage in self._stages.items()
                if name in (*stage.needs, *stage.means, stage.within)
            }
            if self._stages[name].transient and users <= self._results.keys():
                self._results.pop(name, None)

    def release(self) -> None:
        """Drop what is so large that it does not fit into memory with the next structure; a stage
        that needs it after all computes it again."""
        for name in list(self._results):
            if self._stages[name].transient:
                del self._results[name]

    def _timed(self, name: str) -> Any:
        """The result of a stage, with a report of the seconds that it took without those that it
        needs, here or in the second process."""
        spent, started = self._spent, perf_counter()
        elsewhere = None
        if self.worker is not None and self.worker.has(name):
            with self._progress(name) if self._stages[name].listed else nullcontext():
                elsewhere = self.worker.seconds(name, self._meanwhile)
        is_kept = self._stages[name].kept
        result = self._kept(name, self.key(name), self) if is_kept else self.compute(name)
        seconds = perf_counter() - started - (self._spent - spent)
        if is_kept and name not in self._computed:
            self._report_behind(name)
        if self._stages[name].listed:
            self._spent += seconds
            computed = name in self._computed
            reported = seconds if computed or elsewhere is None else elsewhere
            # what was reported as not even read has been read now
            self.reports = [r for r in self.reports if r.name != name or not r.cached]
            self.reports.append(StageReport(name, reported, not computed and elsewhere is None))
        return result

    def _report_behind(self, name: str) -> None:
        """Report the stages that a kept result was made of, which this run does not even read."""
        for need in self._stages[name].needs:
            stage = self._stages[need]
            reported = {report.name for report in self.reports}
            if stage.kept and need not in reported and need not in self._results:
                self._report_behind(need)
                if stage.listed:
                    self.reports.append(StageReport(need, 0.0, True))

    def _meanwhile(self) -> bool:
        """Compute a stage that neither process computes yet; False where there is none. What needs
        the stage that is waited for is not ready, and would compute it here as well."""
        name = self.worker.claim_ready(self.ready)
        if name is not None:
            with suppress(Exception):  # raised again where the stage is needed
                self(name)
        return name is not None

    @property
    def elapsed(self) -> float:
        """[s] since the start; less than the sum of the stages where two processes share them."""
        return perf_counter() - self._started

    def kept(self, name: str) -> bool:
        """True if the stage need not be computed."""
        return name in self._results or self._kept.check_call_in_cache(name, self.key(name), self)

    def ready(self, name: str) -> bool:
        """True if all that the stage needs is kept, or not worth keeping."""
        return all(
            self.kept(need) if self._stages[need].kept else self.ready(need)
            for need in self._stages[name].needs + self._stages[name].means
        )

    def at_hand(self, name: str) -> bool:
        """True if all that the stage needs is kept, or in memory: nothing is computed before it."""
        needs = self._stages[name].needs + self._stages[name].means
        return all(
            need in self._results or (self._stages[need].kept and self.kept(need)) for need in needs
        )

    def prepare(self, names: Sequence[str]) -> bool:
        """Compute a result that these stages need and that no cache keeps, where all that it needs
        is there; False where there is none to compute."""
        needs = [need for name in names for need in self._stages[name].needs]
        for need in needs:
            if not self._stages[need].kept and need not in self._results and self.ready(need):
                self(need)
                return True
        return False

    def compute(self, name: str) -> Any:
        """Run a stage on the results it needs."""
        stage = self._stages[name]
        needed = [self(need) for need in stage.needs + stage.means]
        for earlier in stage.after:
            self(earlier)
        module, function = stage.function.split(":")
        self._computed.add(name)
        whole = self._results.get(stage.within)
        if whole is not None and name in whole.solved:
            return whole.solved.pop(name)  # from now on it is here alone, and let go from here
        with self._progress(name) if stage.listed else nullcontext():
            return getattr(import_module(module, STAGES), function)(self.scene, *needed)

    def key(self, name: str) -> str:
        """Changes with everything that the stage's result depends on."""
        if name not in self._keys:
            stage = self._stages[name]
            needs = [self.key(need) for need in stage.needs]
            self._keys[name] = key(name, stage.reads(self._keyed), needs)
        return self._keys[name]

    @cached_property
    def _keyed(self) -> Scene:
        """The scene without the time that its mesh may take, which changes no result."""
        usual = AskedOfMesh.model_fields["seconds"].default
        if self.scene.mesh is None or self.scene.mesh.seconds == usual:
            return self.scene
        return self.scene.but(mesh={"seconds": usual})


def pipeline_of(scene: Scene, progress: Progress, further: Sequence[Stage] = ()) -> Pipeline:
    """The scene's pipeline on the user's cache, or without one where it cannot be written."""
    return Pipeline(scene, memory() or Memory(None, verbose=0), progress, further)


def _result(name: str, key: str, pipeline: Pipeline) -> Any:
    return pipeline.compute(name)
