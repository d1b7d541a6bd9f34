"""Reduced models and walls that cases share, each computed once."""

from contextlib import nullcontext
from typing import Any, NamedTuple

import numpy as np

from beadwave import coupling, dem
from beadwave.dem import space
from beadwave.workflows.scene import InvalidScene, RomWall, Scene
from beadwave.workflows.stages import warnings
from beadwave.workflows.stages.chain import several
from beadwave.workflows.stages.chain.chain import start
from beadwave.workflows.stages.chain.impact import impact
from beadwave.workflows.stages.chain.walls import wall_of
from beadwave.workflows.stages.engine.pipeline import Pipeline, pipeline_of
from beadwave.workflows.stages.engine.stage_table import (
    Stage,
    has_sizes_chosen,
    needs_structure,
    tables_of,
)

FAILURES = (
    dem.InvalidChain, dem.NoEquilibrium, dem.UnstableStep, coupling.CouplingError, InvalidScene,
    ValueError, ArithmeticError, np.linalg.LinAlgError, MemoryError,
)  # fmt: skip
FURTHER = (
    Stage(
        "jointed",
        ".structure.reduction:jointed",
        tables_of("reduction", "strike", "assembly"),
        ("model", "contact", "modes"),
        means=("factor", "krylov-space"),
    ),
)


class Source(NamedTuple):
    """The scene whose assembly is reduced, the springs of its joints that cases vary, and what it
    shares with others that differ in preload, friction or roughness."""

    scene: Scene
    springs: tuple[str, ...] = ()  # "joint.direction"
    family: Any = None  # a PressedFamily, which stays in its process

    @property
    def stages(self) -> tuple[str, str]:
        """Names of the reduction and of what tells the error of the mesh; of several chains, which
        march on another mesh, of the reduction and their contacts."""
        if self.scene.chains:
            return "reduction", "chain-contacts"
        of_mesh = "missed-energy" if self.scene.bending is None else "second-mesh"
        return ("jointed" if self.springs else "reduction"), of_mesh

    @property
    def pipeline(self) -> Pipeline:
        """Stages of the scene, kept as those of a run are."""
        if self.family is None:
            return pipeline_of(self.scene, lambda name: nullcontext(), FURTHER)
        # finite elements
        from beadwave.workflows.stages.structure.pressed_family import FAMILY, STAGES

        pipeline = pipeline_of(self.scene, lambda name: nullcontext(), (*FURTHER, *STAGES))
        pipeline.give(FAMILY, self.family)
        return pipeline


class Models(NamedTuple):
    """A reduced model of an assembly, and what tells the error of its mesh, if anything does."""

    reduction: Any
    # of several chains their contacts
    second: Any | None
    # where springs vary, and of several chains: those of the source
    errors: tuple[float, float] | None = None
    of_mesh: str = ""  # a sentence where the mesh states more than mesh.error asks for


class SharedWall(NamedTuple):
    """The reduced wall that the cases of a group share, and the errors of its model over the
    striker's speed; or why there is none."""

    wall: dem.Wall | coupling.CoupledWall | space.Structure | None = None
    error_reduction: float = float("nan")
    error_mesh: float = float("nan")
    failure: str = ""
    message: str = ""  # on the mesh, in the row of each case
    surface: Any = None  # rom.Contact of the face struck; ChainContacts of several chains
    source: Source | None = None  # of a scene without a chain


def has_spheres(scene: Scene) -> bool:
    """True of one chain or several; the rows of other scenes are of their modes."""
    return bool(scene.chain or scene.chains)


def models_key(source: Source) -> str | None:
    """A key that is equal for sources with the same models; None where none is computed."""
    if not (needs_structure(source.scene) and has_spheres(source.scene)):
        return None
    return "".join(source.pipeline.key(stage) for stage in source.stages)


def is_kept(source: Source) -> bool:
    """True if the models were computed earlier."""
    return all(source.pipeline.kept(stage) for stage in source.stages)


def models(source: Source) -> Models | str:
    """The models, from the cache where they are kept; a sentence where they fail."""
    pipeline, (reduction, second) = source.pipeline, source.stages
    try:
        first = pipeline(reduction)
        if source.scene.chains:
            contacts, of_reduction = pipeline(second), pipeline("chains-errors").largest
            try:
                of_mesh = pipeline("chains-mesh-errors").largest
            except ValueError:  # no other mesh tells the error of this one
                of_mesh = float("nan")
            pipeline.release()
            return Models(first, contacts, (of_reduction, of_mesh))
        try:
            of_mesh = pipeline(second)
        except ValueError:  # no other mesh tells the error of this one
            of_mesh = None
        sentences: list[str] = []
        if of_mesh is not None and has_sizes_chosen(source.scene):
            sentences += warnings.mesh_above_asked(pipeline("mesh-numbers"))
        pipeline.release()
        reduced = Models(first, of_mesh, of_mesh=" ".join(sentences))
        if not source.springs:
            return reduced
        usual = Models(reduced.reduction.reduced, reduced.second)
        errors = _errors(source.scene, wall_of(source.scene, usual.reduction), usual)
        return reduced._replace(errors=errors)
    except FAILURES as reason:
        return sentence(reason)


def shared_wall(scene: Scene, source: Source, models: Models | str | None) -> SharedWall:
    """Wall and errors that the cases of a group share, whose first scene this is; `models` are
    those of the source, the sentence with which they failed, or None where no reduced model is
    computed."""
    if isinstance(models, str):
        return SharedWall(failure=models)
    if not has_spheres(scene):
        return SharedWall(source=source)
    try:
        if scene.chains:
            structure = several.structure(scene, models.reduction, models.second)
            return SharedWall(structure, *models.errors, surface=models.second)
        if not isinstance(scene.wall, RomWall):
            return SharedWall()
        if models is None:
            return SharedWall(wall_of(scene, None))
        if source.springs:
            springs = {name: scene.stiffness(name) for name in source.springs}
            reduced = models.reduction.with_stiffness(springs)
            return SharedWall(
                wall_of(scene, reduced), *models.errors,
                message=models.of_mesh, surface=reduced.contact,
            )  # fmt: skip
        reduced_wall = wall_of(scene, models.reduction)
        errors = _errors(scene, reduced_wall, models)
        return SharedWall(
            reduced_wall, *errors, message=models.of_mesh, surface=models.reduction.contact
        )
    except FAILURES as reason:
        return SharedWall(failure=sentence(reason))


def _errors(
    scene: Scene, reduced_wall: dem.Wall | coupling.CoupledWall, models: Models
) -> tuple[float, float]:
    """Errors of reduction and mesh in the waves of a scene, in parts of the striker's speed; nan
    where they are not known."""
    nan = float("nan")
    if isinstance(reduced_wall, coupling.CoupledWall):
        return nan, nan
    from beadwave.workflows.stages.errors import better_walls  # finite elements

    at_rest = start(scene, models.reduction.contact)
    run = impact(scene, at_rest, reduced_wall)

    def error(better: better_walls.BetterWalls) -> float:
        """Error of the observed velocities that these walls show."""
        comparison = better_walls.marched(scene, at_rest, run, better)
        return better_walls.velocity_error(scene, at_rest, comparison)

    of_reduction = error(better_walls.of_reduction(scene, models.reduction))
    if models.second is None:
        return of_reduction, nan
    if scene.bending is not None:
        return of_reduction, error(better_walls.of_second_mesh(scene, models.second))
    try:
        missed = better_walls.of_missed_energy(scene, models.second, models.reduction)
    except ValueError:
        return of_reduction, nan
    return of_reduction, error(missed)


def sentence(reason: Exception) -> str:
    """Reason of a failure, for a row of the table."""
    return str(reason).strip() or type(reason).__name__
