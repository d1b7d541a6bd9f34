"""Stages of a run as pure functions of the scene, each kept by content and computed on demand.

    mesh -> model -> modes -> reduction -> wall -> impact

A stage's key is what it reads of the scene, the keys of the stages it needs, the source of the
rooms it runs and the versions of the libraries below them. A stage whose result is kept never
looks at the stages it needs: a new sphere touches nothing of the finite elements.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from functools import cache
from hashlib import sha256
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from json import dumps
from logging import ERROR, getLogger
from os import environ
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple
from warnings import filterwarnings

from joblib import Memory
from joblib import __version__ as joblib_version
from platformdirs import user_cache_path

from workflows.scene import RomWall, Scene

CACHE_LIMIT = "8G"
LIBRARIES = ("numpy", "scipy", "numba", "scikit-fem", "gmsh")


Watch = Callable[[str], AbstractContextManager]


class Stage(NamedTuple):
    """One step: its function, what it reads of the scene, what it needs, which rooms it runs."""

    function: str  # "module:name", called with the scene and the results it needs
    reads: Callable[[Scene], Any]
    needs: tuple[str, ...]
    rooms: tuple[str, ...]
    kept: bool = True  # a quick stage with a large result is computed anew


class StageReport(NamedTuple):
    """What a stage took in this run."""

    name: str
    seconds: float
    cached: bool


def _reads(*tables: str) -> Callable[[Scene], Any]:
    return lambda scene: {name: _plain(getattr(scene, name)) for name in tables}


def _plain(table: Any) -> Any:
    return table.model_dump() if hasattr(table, "model_dump") else table


def _wall_reads(scene: Scene) -> Any:
    file = getattr(scene.wall, "file", None)
    content = sha256(Path(file).read_bytes()).hexdigest() if file else None
    return {**_reads("wall", "damping", "patch", "assembly")(scene), "content": content}


def _dimensions(scene: Scene) -> Any:
    from workflows.assembly_table import assembly

    own = Path(scene.mesh.file) if scene.mesh.file else None
    content = sha256(own.read_bytes()).hexdigest() if own and own.is_file() else None
    return [repr(assembly(scene.assembly)), _plain(scene.mesh), scene.patch.point, content]


ROOMS = ("geometry", "fem", "rom", "coupling")
ASSEMBLY = {
    "mesh": Stage("workflows.assembly_stages:mesh", _dimensions, (), ("geometry",), kept=False),
    "model": Stage(
        "workflows.assembly_stages:model",
        _reads("assembly", "joints", "table"),
        ("mesh",),
        ("geometry", "fem"),
        kept=False,
    ),
    "tuning-basis": Stage("workflows.tuning:basis", _reads(), ("model",), ("fem",)),
    "modes": Stage("workflows.assembly_stages:modes", _reads(), ("model",), ("fem",)),
    "likeness": Stage(
        "workflows.shape_stage:likeness",
        _reads(),
        ("model", "modes"),
        ("geometry", "fem", "workflows.assembly_stages"),
    ),
    "contact": Stage(
        "workflows.assembly_stages:contact", _reads("patch"), ("model",), ("fem",), kept=False
    ),
    "reduction": Stage(
        "workflows.reduction_stage:reduction",
        _reads("reduction", "patch", "assembly"),
        ("model", "contact", "modes"),
        ("rom", "fem", "coupling"),
    ),
    "coarse-reduction": Stage(
        "workflows.error_stages:coarse_reduction",
        lambda scene: [_dimensions(scene), _reads("assembly", "joints", "table", "patch")(scene)],
        (),
        (*ROOMS, "workflows.assembly_stages", "workflows.reduction_stage"),
    ),
    "response": Stage(
        "workflows.response_stage:response",
        _reads(),
        ("model", "contact", "reduction"),
        ("fem", "rom", "coupling", "workflows.figures"),
    ),
    "reference-response": Stage(
        "workflows.accuracy.reduction:reference",
        _reads("patch", "assembly"),
        ("model", "contact"),
        ("fem", "rom"),
    ),
    "pictures": Stage(
        "workflows.picture_stage:pictures", _reads(), ("modes",), ("workflows.pictures",)
    ),
}

RUN = ("chain", "striker", "contact", "leaf_springs", "preload", "time")


def _stages(scene: Scene) -> dict[str, Stage]:
    """The stages that this scene may need; those of an assembly only where one is struck."""
    needs = ("reduction",) if needs_assembly(scene) and scene.chain else ()
    wall = Stage("workflows.chain_stages:wall", _wall_reads, needs, ("coupling", "rom", "dem"))
    walls, whole = {"wall": wall}, "wall"
    if getattr(scene.wall, "prune", False):
        pruning, pruned = "workflows.chain_stages:pruning", "workflows.chain_stages:pruned_wall"
        walls, whole = {"whole-wall": wall}, "whole-wall"
        walls["pruning"] = Stage(pruning, _reads(*RUN), (whole,), ("coupling", "dem"))
        walls["wall"] = Stage(pruned, _reads(), ("pruning",), ())
    return {**ASSEMBLY, **walls, **_impact_stages(whole)}


def _impact_stages(whole: str) -> dict[str, Stage]:
    """The run and what follows it; `whole` is the wall before any of its modes is left out."""
    return {
        "impact": Stage(
            "workflows.chain_stages:impact",
            _reads(*RUN, "wall", "output"),
            ("wall",),
            ("coupling", "dem"),
        ),
        "reduction-error": Stage(
            "workflows.error_stages:reduction_error",
            _reads("time", "output"),
            ("reduction", whole, "impact"),
            ("coupling", "dem"),
        ),
        "mesh-error": Stage(
            "workflows.error_stages:mesh_error",
            _reads("damping", "time", "output"),
            ("coarse-reduction", "impact"),
            ("coupling", "dem"),
        ),
        "waves": Stage(
            "workflows.chain_waves:waves",
            _reads(*RUN, "wall", "output"),
            ("impact",),
            ("dem", "workflows.chain_stages"),
        ),
        "figures": Stage(
            "workflows.figure_stages:of_chain",
            _reads("output"),
            ("impact", "waves"),
            ("workflows.figures",),
        ),
    }


def needs_assembly(scene: Scene) -> bool:
    """Whether a run of this scene builds the assembly."""
    if scene.assembly is None:
        return False
    return scene.chain is None or (isinstance(scene.wall, RomWall) and scene.wall.file is None)


class Pipeline:
    """A scene's results, computed or read from the cache when they are asked for."""

    def __init__(
        self,
        scene: Scene,
        memory: Memory,
        watch: Watch = lambda name: nullcontext(),
    ) -> None:
        self.scene = scene
        self.reports: list[StageReport] = []
        self._stages = _stages(scene)
        self._results: dict[str, Any] = {}
        self._computed: set[str] = set()
        self.keeps = memory.location is not None
        self._kept = memory.cache(_result, ignore=["pipeline"])
        self._watch = watch

    def __call__(self, name: str) -> Any:
        """The result of a stage."""
        if name not in self._results:
            self._results[name] = self._timed(name)
        return self._results[name]

    def _timed(self, name: str) -> Any:
        below = sum(report.seconds for report in self.reports)
        started = perf_counter()
        kept = self._stages[name].kept
        result = self._kept(name, self.key(name), self) if kept else self.compute(name)
        within = sum(report.seconds for report in self.reports) - below
        seconds = perf_counter() - started - within
        self.reports.append(StageReport(name, seconds, name not in self._computed))
        return result

    def compute(self, name: str) -> Any:
        """Run a stage on the results it needs."""
        stage = self._stages[name]
        needed = [self(need) for need in stage.needs]
        module, function = stage.function.split(":")
        self._computed.add(name)
        with self._watch(name):
            return getattr(import_module(module), function)(self.scene, *needed)

    def key(self, name: str) -> str:
        """Changes with everything that the stage's result depends on."""
        stage = self._stages[name]
        module = stage.function.split(":")[0]
        parts = [name, stage.reads(self.scene), [self.key(need) for need in stage.needs]]
        sources = [fingerprint(room) for room in (*stage.rooms, module)]
        return _digest([*parts, *sources, library_versions(LIBRARIES)])


def pipeline_of(scene: Scene, watch: Watch) -> Pipeline:
    """The scene's pipeline on the user's cache, or without one where it cannot be written."""
    return Pipeline(scene, memory() or Memory(None, verbose=0), watch)


def unkept(pipeline: Pipeline) -> tuple[str, ...]:
    """A sentence where results cannot be kept."""
    if pipeline.keeps:
        return ()
    return (
        f"Nothing is kept for the next run, {cache_folder()} cannot be written; "
        "BEADWAVE_CACHE_DIR names another folder.",
    )


def _result(name: str, key: str, pipeline: Pipeline) -> Any:
    return pipeline.compute(name)


def _digest(content: Any) -> str:
    return sha256(dumps(content, sort_keys=True, default=str).encode()).hexdigest()


@cache
def fingerprint(module: str) -> str:
    """A digest of the source of a module, or of all modules of a room, without importing it."""
    origin = Path(find_spec(module).origin)
    sources = sorted(origin.parent.glob("*.py")) if origin.name == "__init__.py" else [origin]
    return sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()


def library_versions(names: tuple[str, ...]) -> dict[str, str]:
    """Installed versions by distribution; those that are absent are left out."""
    return {name: found for name in names if (found := _version(name))}


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def cache_folder() -> Path:
    """Where results are kept: BEADWAVE_CACHE_DIR, or the user's cache."""
    given = environ.get("BEADWAVE_CACHE_DIR")
    return Path(given) if given else user_cache_path("beadwave")


def memory() -> Memory | None:
    """The cache, or None where its folder cannot be written."""
    # an entry that is damaged or does not fit on the disk is computed again, no need to print why
    getLogger("joblib").setLevel(ERROR)
    filterwarnings("ignore", module="joblib")
    folder = cache_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        kept = Memory(folder / f"joblib-{joblib_version}", verbose=0)
        kept.reduce_size(bytes_limit=CACHE_LIMIT)
    except OSError:
        return None
    return kept
