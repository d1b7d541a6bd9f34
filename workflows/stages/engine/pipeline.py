"""Stages of a run as pure functions of the scene, each kept by content and computed on demand.

    mesh -> model -> modes -> reduction -> wall -> impact

A stage's key is what it reads of the scene, the keys of the stages it needs, and the program
(`workflows.stages.engine.cache`). A stage whose result is kept never looks at the stages it needs:
a new sphere leaves the finite elements alone.
"""

from collections.abc import Callable, Sequence
from contextlib import nullcontext, suppress
from functools import lru_cache
from importlib import import_module
from os import environ
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

from joblib import Memory

from beadwave.workflows.files import whole_file
from beadwave.workflows.files.foreign import Unreadable, require_memory
from beadwave.workflows.scene import InvalidScene, LossFactorsTable, MeasuredWall, RomWall, Scene
from beadwave.workflows.scene.named_files import files_of
from beadwave.workflows.scene.places import has_friction, named_faces, sensor_places, words_of
from beadwave.workflows.stages.engine.cache import key, memory
from beadwave.workflows.stages.engine.progress import Progress, quiet

STAGES = "beadwave.workflows.stages"  # whose modules the stages name


class Stage(NamedTuple):
    """One step: its function, what it reads of the scene, what it needs."""

    function: str  # ".room.module:name" of STAGES, called with the scene and what it needs
    reads: Callable[[Scene], Any]
    needs: tuple[str, ...]
    kept: bool = True  # a quick stage with a large result is computed anew
    listed: bool = True  # among the times of a run
    transient: bool = False  # so large that it is freed once all its users are computed
    after: tuple[str, ...] = ()  # what it goes faster after, a second process may compute it
    # what it is computed with, handed in after what it needs: its result does not depend on it
    # but for rounding, so that a change of the contact keeps the modes
    means: tuple[str, ...] = ()


class StageReport(NamedTuple):
    """Time of a stage in this run."""

    name: str
    seconds: float
    cached: bool


def tables_of(*tables: str) -> Callable[[Scene], Any]:
    """Input of a stage from a scene: these tables whole, and the files that they name."""
    return lambda scene: {name: _plain(getattr(scene, name)) for name in tables}


def _plain(table: Any) -> Any:
    """A table as JSON has it, with the contents of the files that it names."""
    if isinstance(table, tuple):
        return [_plain(entry) for entry in table]
    if isinstance(table, dict):
        return {name: _plain(entry) for name, entry in table.items()}
    if not hasattr(table, "model_dump"):
        return table
    contents = []
    for file in map(Path, files_of(table)):
        status = file.stat() if file.is_file() else None
        stamp = status and (status.st_mtime_ns, status.st_ctime_ns, status.st_size, status.st_ino)
        contents.append(_content_of(file.absolute(), stamp))
    return [table.model_dump(), contents] if contents else table.model_dump()


_wall_reads = tables_of("wall", "damping", "strike", "assembly")
_targets = tables_of("targets", "test_axes")


def _observed(scene: Scene) -> Any:
    """Spheres at which a run is observed, and the number of instants."""
    return [scene.output.spheres, scene.output.samples]


def _marched(scene: Scene) -> Any:
    """Input of a march besides chain and wall."""
    return [tables_of("time")(scene), _observed(scene)]


def _measured(scene: Scene) -> Any:
    """Input of marches at walls fitted to a measured response."""
    return [_marched(scene), _wall_reads(scene)]


def _reduced(scene: Scene) -> Any:
    """Input of a reduction: its options, and the places where the structure is struck, shaken and
    observed."""
    tables = tables_of("reduction", "strike", "assembly")(scene)
    # loss factors ask for the shares of parts in the strain, whatever their values
    shared = ["strain"] if isinstance(scene.damping, LossFactorsTable) else []
    return [tables, words_of(scene), *shared]


def _dimensions(scene: Scene) -> Any:
    """Input of a mesh: bodies, their contacts, sizes of elements, the faces that are named."""
    tables = tables_of(*BODIES, "mesh")(scene)
    if scene.strike and any(body.lines for body in (scene.bodies or {}).values()):
        # grid lines are prescribed: the mesh does not depend on the patch
        tables |= {"strike": [scene.strike.on, scene.strike.at]}
    if faces := sorted(named_faces(scene).items()):
        tables |= {"faces": faces}
    return tables


def content(path: str | Path) -> str | None:
    """A digest of a file's content; None where there is none. Raises InvalidScene for one that
    memory has no room for."""
    if not Path(path).is_file():
        return None
    try:
        require_memory(Path(path))
    except Unreadable as error:
        raise InvalidScene(f"{path}: {error}; give a smaller file.") from None
    return whole_file.digest(Path(path))


@lru_cache(maxsize=256)  # several stages read the tables that name a file
def _content_of(path: Path, stamp: tuple[int, ...] | None) -> str | None:
    return content(path)


BENT = ("beam", "plate")
BODIES = ("assembly", "bodies", "materials", "ties", "joints", "strike", "loads")


def _joined(scene: Scene) -> Any:
    """Joints of the bodies, and their partners."""
    tables = tables_of("assembly", "joints", "table", "masses", "springs", "measured")(scene)
    if scene.measured:
        tables["test_axes"] = _plain(scene.test_axes)
    return tables


def _coarse(scene: Scene) -> Any:
    """Joints and strike of a second mesh; its bodies are in the key of the mesh."""
    return [_joined(scene), tables_of("strike")(scene)]


START = (
    "chain", "striker", "contact", "leaf_springs", "preload", "gravity", "guides", "wall", *BENT,
    *BODIES,
)  # fmt: skip
ASSEMBLY = {
    "mesh": Stage(".structure.assembly:mesh", _dimensions, (), kept=False),
    "model": Stage(
        ".structure.assembly:model",
        _joined,
        ("mesh",),
        kept=False,
    ),
    "tuning-basis": Stage(".structure.assembly:tuning_basis", _targets, ("model",)),
    "factor": Stage(
        ".structure.assembly:factor", tables_of(), ("model",), kept=False, transient=True
    ),
    "krylov-space": Stage(
        ".structure.krylov_space:krylov_space",
        lambda scene: [_targets(scene), tables_of("reduction", "strike")(scene)],
        ("mesh", "model", "factor"),
        kept=False,
        transient=True,
    ),
    "modes": Stage(".structure.assembly:modes", _targets, ("model",), means=("krylov-space",)),
    "mac": Stage(
        ".structure.rigid_joint_mac:mac",
        tables_of(),
        ("mesh", "model", "modes"),
        means=("factor", "krylov-space"),
    ),
    "contact": Stage(".structure.assembly:contact", tables_of("strike"), ("mesh", "model")),
    "surface": Stage(".structure.strike:surface", tables_of(), ("mesh",), listed=False),
    "participation": Stage(
        ".structure.assembly:participation", tables_of(), ("contact", "modes"), listed=False
    ),
    "reduction": Stage(
        ".structure.reduction:reduction",
        _reduced,
        ("model", "contact", "modes"),
        means=("factor", "krylov-space", "half-space"),
    ),
    "half-space": Stage(
        ".structure.reduction:half_space", tables_of("strike"), ("mesh", "model"), listed=False
    ),
    "static-shape": Stage(
        ".errors.mesh:static_shape",
        tables_of("reduction", "strike"),
        ("mesh", "model", "modes"),
        means=("krylov-space",),
        listed=False,
    ),
    "second-mesh": Stage(".errors.waves:second_mesh", _coarse, ("mesh",)),
    "missed-energy": Stage(
        ".errors.mesh:missed_by_mesh",
        tables_of("reduction", "strike"),
        ("mesh", "model", "modes"),
        means=("static-shape", "half-space"),
    ),
    "full-response": Stage(
        ".structure.response:full_response",
        tables_of(),
        ("model", "contact"),
        means=("factor", "krylov-space"),
    ),
    "response": Stage(
        ".structure.response:response", tables_of("damping"), ("full-response", "reduction")
    ),
    "structure-numbers": Stage(
        ".structure.health:structure_numbers",
        tables_of("targets"),
        ("modes", "reduction", "participation"),
        listed=False,
    ),
    "structure-errors": Stage(
        ".structure.health:structure_errors",
        tables_of(),
        ("modes", "missed-energy", "structure-numbers"),
        listed=False,
    ),
    "mode-files": Stage(".structure.files:mode_files", tables_of(), ("modes",), listed=False),
    "model-files": Stage(
        ".structure.files:model_files", tables_of("damping"), ("reduction",), listed=False
    ),
    "response-files": Stage(
        ".structure.files:response_files", tables_of(), ("response",), listed=False
    ),
    "compilation": Stage(
        ".engine.compilation:compilation",
        lambda scene: [
            environ.get("NUMBA_CACHE_DIR"),
            tables_of("damping")(scene),
            tables_of(*START)(scene),
        ],
        (),
    ),
    "pictures": Stage(".pages.pictures:pictures", tables_of(), ("mesh", "modes", "contact")),
}

BENDING = ASSEMBLY | {
    "model": Stage(".structure.bending:model", tables_of(*BENT), (), kept=False),
    "modes": Stage(".structure.bending:modes", tables_of(), ("model",)),
    "mac": Stage(".structure.bending:mac", tables_of(), ("modes",), listed=False),
    "contact": Stage(
        ".structure.bending:contact", tables_of(), ("model",), kept=False, listed=False
    ),
    "reduction": Stage(".structure.bending:reduction", tables_of("reduction"), ("model",)),
    "full-response": Stage(".structure.response:full_response", tables_of(), ("model", "contact")),
    "pictures": Stage(".pages.pictures:pictures_of_plate", tables_of(), ("modes", "contact")),
    "second-mesh": Stage(".structure.bending:second_mesh", tables_of(*BENT, "reduction"), ()),
    "other-theories": Stage(".structure.bending:other_theories", tables_of(*BENT, "reduction"), ()),
    "theory-error": Stage(
        ".structure.bending:theory_error",
        lambda scene: [_marched(scene), tables_of("damping")(scene)],
        ("start", "other-theories", "impact"),
    ),
}

IMPACT = {
    "start": Stage(".chain.chain:start", tables_of(*START), (), listed=False),
    "impact": Stage(".chain.impact:impact", _marched, ("start", "wall"), after=("compilation",)),
    "reduction-error": Stage(
        ".errors.waves:reduction_error", _marched, ("start", "reduction", "impact")
    ),
    "mesh-error": Stage(
        ".errors.waves:mesh_error",
        lambda scene: [_marched(scene), tables_of("damping")(scene)],
        ("start", "second-mesh", "impact"),
    ),
    "quantity-errors": Stage(
        ".errors.quantities:quantity_errors",
        lambda scene: [_marched(scene), tables_of("damping")(scene)],
        ("start", "missed-energy", "reduction", "impact", "waves"),
    ),
    "time-errors": Stage(
        ".errors.numbers:time_errors", _marched, ("start", "impact", "waves"), listed=False
    ),
    "waves": Stage(".chain.waves:waves", _observed, ("start", "impact")),
    "chain-numbers": Stage(
        ".chain.numbers:chain_numbers", _marched, ("start", "wall", "impact", "waves"), listed=False
    ),
    "chain-files": Stage(
        ".chain.numbers:chain_files", tables_of("output"), ("impact", "wall"), listed=False
    ),
    "figures": Stage(".pages.figures:of_chain", _observed, ("impact", "waves")),
    "record": Stage(
        ".chain.signals:record", tables_of("output"), ("impact", "waves"), kept=False, listed=False
    ),
    "sensor-numbers": Stage(
        ".chain.signals:sensor_waves", tables_of("output"), ("record",), listed=False
    ),
    "signals": Stage(
        ".pages.figures:signals", tables_of("output"), ("record",), kept=False, listed=False
    ),
}


def stages_of(scene: Scene) -> dict[str, Stage]:
    """The stages that a run of this scene may ask for; what it never asks for costs nothing.

    Begins with the tables above and puts in place of rows what this scene does in another way, each
    in a block below: later blocks build on what earlier ones have put there.
    """
    # a wall is made of the structure's reduced model where there are both, else of its table
    needs = ("reduction",) if needs_structure(scene) and scene.chain else ()
    wall = Stage(".chain.walls:wall_of", _wall_reads, needs)
    structure = ASSEMBLY if scene.bending is None else BENDING
    impact = IMPACT

    # measured parts: fits of their responses have errors in frequencies and waves
    if scene.measured:
        errors = ASSEMBLY["structure-errors"]
        structure = structure | {
            "part-errors": Stage(
                ".errors.measured_parts:part_errors", tables_of(), ("model", "modes")
            ),
            "structure-errors": errors._replace(needs=(*errors.needs, "part-errors")),
        }
    if scene.measured and scene.chain:
        impact = impact | {
            "receptance-error": Stage(
                ".errors.measured_parts:receptance_error",
                lambda scene: [_marched(scene), _coarse(scene), tables_of("damping")(scene)],
                ("mesh", "start", "impact"),
            )
        }

    # a measured wall: errors by the noise and the band of its response
    if scene.chain and isinstance(scene.wall, MeasuredWall):
        impact = impact | {
            "receptance-error": Stage(
                ".errors.receptance:receptance_error", _measured, ("start", "impact")
            ),
            "time-errors": Stage(
                ".errors.receptance:number_errors",
                _measured,
                ("start", "impact", "waves"),
                listed=False,
            ),
        }

    # sensors: their record is among the files; those on the structure read its reduced model
    if scene.chain and scene.output.sensors:
        files = IMPACT["chain-files"]
        impact = impact | {"chain-files": files._replace(needs=(*files.needs, "record"))}
        if sensor_places(scene):
            impact["record"] = IMPACT["record"]._replace(
                reads=tables_of("output", "damping"), needs=("impact", "waves", "reduction")
            )

    # friction at the wall: a march across after the one along, or one of both on a structure
    if scene.chain and scene.friction:
        impact = impact | across_the_chain(impact)
    if scene.chain and has_friction(scene):
        impact = impact | on_a_structure(scene, impact, needs)
        wall = Stage(".structure.friction:wall_along", tables_of(), ("spatial-wall",), kept=False)

    # the page shows what the files and the tables of numbers hold
    shown = (
        *(("chain-files", "chain-numbers") if scene.chain else ()),
        *(("model-files", "response-files", "structure-numbers") if needs_structure(scene) else ()),
    )
    page = Stage(
        ".pages.page:data",
        lambda scene: [scene.name, tables_of("output")(scene)],
        shown,
        listed=False,
    )
    impact = impact | {"page": page}

    # errors by the mesh: of bodies by the energy that it misses, of beams and plates by a second
    # mesh, and by other theories
    if scene.bending is None:
        of_mesh = IMPACT["mesh-error"]._replace(
            function=".errors.quantities:error_of_mesh", needs=("quantity-errors",)
        )
        impact = impact | {"mesh-error": of_mesh}
    else:
        # of hollow and of open sections no other theory is known, see `bending.other_theories`
        compared = scene.plate is not None or not (scene.beam.bore or scene.beam.area)
        theories = ("other-theories",) if compared else ()
        of_waves = IMPACT["quantity-errors"]._replace(
            function=".errors.bending:quantity_errors",
            needs=("start", "reduction", "second-mesh", "impact", "waves", *theories),
        )
        of_modes = Stage(
            ".errors.bending:structure_errors",
            tables_of(),
            ("modes", "reduction", "second-mesh", *theories),
        )
        impact = impact | {"quantity-errors": of_waves}
        structure = structure | {"structure-errors": of_modes}

    # the struck face of a body may be curved or orthotropic, which changes the law of the contact
    if needs and scene.bending is None:
        impact = impact | {"start": IMPACT["start"]._replace(needs=("surface",))}

    return {**structure, "wall": wall, **impact}


def across_the_chain(impact: dict[str, Stage]) -> dict[str, Stage]:
    """Stages that friction at the wall adds to those of an impact, or puts in their place."""
    files, numbers = impact["chain-files"], impact["chain-numbers"]
    further = files.needs[2:]  # the record, of a scene with sensors
    across = tables_of("friction", "arm", "shakers", "striker")
    compiled = ASSEMBLY["compilation"]
    return {
        "compilation": compiled._replace(
            function=".chain.friction:compilation",
            reads=lambda scene: [compiled.reads(scene), across(scene)],
        ),
        "friction": Stage(
            ".chain.friction:friction",
            lambda scene: [_marched(scene), across(scene)],
            ("start", "wall", "impact"),
            after=("compilation",),
        ),
        "chain-files": files._replace(
            function=".chain.friction:chain_files", needs=("impact", "wall", "friction", *further)
        ),
        "chain-numbers": numbers._replace(
            function=".chain.friction:chain_numbers", needs=(*numbers.needs, "friction")
        ),
        "figures": impact["figures"]._replace(
            function=".pages.figures:of_friction", needs=("impact", "waves", "friction")
        ),
    }


def on_a_structure(
    scene: Scene, impact: dict[str, Stage], needs: tuple[str, ...]
) -> dict[str, Stage]:
    """Stages that friction on a structure puts in the place of those of an impact with friction:
    one march along and across the chain."""
    reads = impact["friction"].reads
    stages = {
        "spatial-wall": Stage(
            ".structure.friction:spatial_wall",
            lambda scene: [_wall_reads(scene), tables_of("shakers")(scene)],
            needs,
        ),
        "march": Stage(".structure.friction:march", reads, ("start", "spatial-wall")),
        "impact": Stage(
            ".structure.friction:impact", tables_of(), ("start", "wall", "march"), kept=False
        ),
        "friction": Stage(".structure.friction:across", tables_of(), ("march",), kept=False),
    }
    if sensor_places(scene):
        stages["record"] = IMPACT["record"]._replace(
            function=".structure.friction:record",
            reads=tables_of("output", "shakers"),
            needs=("start", "spatial-wall", "march", "impact", "waves"),
        )
    return stages


def needs_structure(scene: Scene) -> bool:
    """True if a run of this scene builds its finite elements."""
    if not scene.has_structure:
        return False
    return scene.chain is None or (isinstance(scene.wall, RomWall) and scene.wall.file is None)


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
        further: dict[str, Stage] | None = None,
    ) -> None:
        self.scene = scene
        self.reports: list[StageReport] = []
        self._stages = stages_of(scene) | (further or {})
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

    def _let_go(self, names: tuple[str, ...]) -> None:
        """Of these what is large and no stage needs any more."""
        for name in names:
            users = {
                user
                for user, stage in self._stages.items()
                if name in stage.needs or name in stage.means
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
        with self._progress(name) if stage.listed else nullcontext():
            return getattr(import_module(module, STAGES), function)(self.scene, *needed)

    def key(self, name: str) -> str:
        """Changes with everything that the stage's result depends on."""
        if name not in self._keys:
            stage = self._stages[name]
            needs = [self.key(need) for need in stage.needs]
            self._keys[name] = key(name, stage.reads(self.scene), needs)
        return self._keys[name]


def pipeline_of(
    scene: Scene, progress: Progress, further: dict[str, Stage] | None = None
) -> Pipeline:
    """The scene's pipeline on the user's cache, or without one where it cannot be written."""
    return Pipeline(scene, memory() or Memory(None, verbose=0), progress, further)


def _result(name: str, key: str, pipeline: Pipeline) -> Any:
    return pipeline.compute(name)
