"""Reduced models and walls that cases share, each computed once."""

from contextlib import nullcontext
from typing import Any, NamedTuple

import numpy as np

import coupling
import dem
from workflows.scene import InvalidScene, RomWall, Scene
from workflows.stages.chain import start, wall
from workflows.stages.impact import impact
from workflows.stages.pipeline import Pipeline, Stage, needs_structure, pipeline_of, tables_of

FAILURES = (
    dem.InvalidChain, dem.NoEquilibrium, dem.UnstableStep, coupling.CouplingError, InvalidScene,
    ValueError, ArithmeticError, np.linalg.LinAlgError, MemoryError,
)  # fmt: skip
FURTHER = {
    "jointed": Stage(
        ".reduction:jointed",
        tables_of("reduction", "patch", "assembly"),
        ("model", "contact", "modes"),
    )
}


class Source(NamedTuple):
    """The scene whose assembly is reduced, and the springs of its joints that cases vary."""

    scene: Scene
    springs: tuple[str, ...] = ()  # "joint.direction"

    @property
    def stages(self) -> tuple[str, str]:
        """Names of the reduction and of that on another mesh."""
        return ("jointed" if self.springs else "reduction"), "second-mesh"

    @property
    def pipeline(self) -> Pipeline:
        """Stages of the scene, kept as those of a run are."""
        return pipeline_of(self.scene, lambda name: nullcontext(), FURTHER)


class Models(NamedTuple):
    """Reduced models of an assembly on its mesh and on another one, as far as that can be made."""

    reduction: Any
    second: Any | None
    errors: tuple[float, float] | None = None  # where springs vary: those of the source


class Prepared(NamedTuple):
    """What the cases of a group share: the wall, if a reduced model makes it, and errors of that
    model; or why there is none."""

    wall: dem.Wall | coupling.CoupledWall | None = None
    error_reduction: float = float("nan")
    error_mesh: float = float("nan")
    failure: str = ""
    surface: Any = None  # rom.Contact of the face struck


def models_key(source: Source) -> str | None:
    """The same for sources that share their models; None where none is computed."""
    if not needs_structure(source.scene):
        return None
    return "".join(source.pipeline.key(stage) for stage in source.stages)


def is_kept(source: Source) -> bool:
    """Whether the models were computed earlier."""
    return all(source.pipeline.kept(stage) for stage in source.stages)


def models(source: Source) -> Models | str:
    """The models, from the cache where they are kept; a sentence where they fail."""
    pipeline, (reduction, second) = source.pipeline, source.stages
    try:
        found = Models(pipeline(reduction), _second(pipeline, second))
        if not source.springs:
            return found
        usual = Models(found.reduction.reduced, found.second)
        return found._replace(errors=_errors(source.scene, wall(source.scene, usual[0]), usual))
    except FAILURES as reason:
        return sentence(reason)


def _second(pipeline: Pipeline, stage: str) -> Any | None:
    """None for a mesh that no other one tells the error of, or whose other one fails."""
    try:
        return pipeline(stage)
    except ValueError:
        return None


def prepared(scene: Scene, source: Source, found: Models | str | None) -> Prepared:
    """What the cases of a group share, whose first scene this is."""
    if isinstance(found, str):
        return Prepared(failure=found)
    if not isinstance(scene.wall, RomWall):
        return Prepared()
    try:
        if found is None:
            return Prepared(wall(scene, None))
        if source.springs:
            springs = {name: scene.stiffness(name) for name in source.springs}
            reduced, errors = found.reduction.with_stiffness(springs), found.errors
            return Prepared(wall(scene, reduced), *errors, surface=reduced.contact)
        own = wall(scene, found.reduction)
        return Prepared(own, *_errors(scene, own, found), surface=found.reduction.contact)
    except FAILURES as reason:
        return Prepared(failure=sentence(reason))


def _errors(scene: Scene, own: Any, found: Models) -> tuple[float, float]:
    """Of reduction and mesh in the waves of a scene."""
    none = float("nan")
    if isinstance(own, coupling.CoupledWall):
        return none, none
    from workflows.stages.errors import mesh_error, reduction_error  # finite elements

    begun = start(scene, found.reduction.contact)
    run = impact(scene, begun, own)
    of_reduction = reduction_error(scene, begun, found.reduction, run)
    return of_reduction, none if found.second is None else mesh_error(
        scene, begun, found.second, run
    )


def sentence(reason: Exception) -> str:
    """Why something failed, for a row of the table."""
    return str(reason).strip() or type(reason).__name__
