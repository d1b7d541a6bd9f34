"""Scenes that differ in preload, friction, roughness or flatness of faces in contact: one mesh, one
assembly, one factor.

Stages of such a scene that take these from the family: a bolt is placed anew on the drawing, the
state follows on the interface that is condensed once, and modes from those about the state of the
first scene. Geometric stiffnesses are those of each state.
"""

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beadwave import fem
from beadwave.fem.contact.further_states import N_GUARDS, FurtherModes, modes_about
from beadwave.fem.contact.pressed_model import PressedAssembly
from beadwave.fem.modes.assembly_modes import AssemblyModes, assembly_modes
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.engine.pipeline import Pipeline
from beadwave.workflows.stages.engine.stage_table import Stage, dimensions, joined, tables_of
from beadwave.workflows.stages.structure import assembly, bodies
from beadwave.workflows.stages.structure.meshed_parts import Parts
from beadwave.workflows.stages.structure.targets import targets

# of a joint in contact, which leave its mesh and its reference as they are
KEYS = ("preload", "torque", "torque_deviation", "friction", "roughness", "flatness")


class PressedFamily:
    """Results that scenes share whose faces in contact differ in preload, friction and roughness,
    computed when they are first needed from the pipeline of one of them."""

    def __init__(self, pipeline: Pipeline) -> None:
        self._pipeline = pipeline

    @cached_property
    def mesh(self) -> Parts:
        """The meshed parts of the first scene."""
        return self._pipeline("mesh")

    @cached_property
    def assembly(self) -> PressedAssembly:
        """Its faces condensed."""
        return assembly.condensed_faces(self._pipeline.scene, self.mesh)

    @cached_property
    def shapes(self) -> NDArray[np.float64]:
        """Modes (n, k) about the state of the first scene."""
        model = assembly.pressed(self._pipeline.scene, self.mesh, self.assembly)
        self._pipeline.give("model", model)
        return self._pipeline("modes").phi

    @cached_property
    def mesh_error(self) -> NDArray[np.float64]:
        """Relative errors (k,) of the mesh in the frequencies of the first scene."""
        modes = (self.shapes, self._pipeline("modes"))[1]
        return self._pipeline("missed-energy").of_frequencies(modes.omega)

    @property
    def seconds_kept(self) -> float:
        """Seconds that its results took which another family of these scenes finds kept."""
        return sum(report.seconds for report in self._pipeline.reports if not report.cached)

    def modes_about(self, model: fem.Model) -> FurtherModes:
        """The modes about another state."""
        n_modes = self.shapes.shape[1] - N_GUARDS
        return modes_about(self.assembly, model, self.shapes, n_modes)


def mesh(scene: Scene, *needs: Any) -> Parts:
    """The parts of the family with the bolts of the scene."""
    family: PressedFamily = needs[-1]
    return bodies.with_bolts_of(scene, family.mesh)


def model(scene: Scene, mesh: Parts, family: PressedFamily) -> fem.Model:
    """The model about the state of the scene."""
    return assembly.pressed(scene, mesh, family.assembly)


def modes(scene: Scene, model: fem.Model, family: PressedFamily) -> AssemblyModes:
    """The lowest modes about the state of the scene."""
    return assembly_modes(model, targets(scene, model), known=family.modes_about(model).modes)


FAMILY = "pressed-family"  # whose result is given
STAGES = (
    Stage(FAMILY, "", tables_of(), kept=False, listed=False),
    Stage(
        "mesh", ".structure.pressed_family:mesh", dimensions, ("sizes",), means=(FAMILY,),
        kept=False,
    ),
    Stage(
        "model", ".structure.pressed_family:model", joined, ("mesh",), means=(FAMILY,), kept=False
    ),
    # numbers that follow are kept apart from those of a scene by itself
    Stage(
        "modes", ".structure.pressed_family:modes",
        lambda scene: [FAMILY, tables_of("targets", "test_axes")(scene)], ("model",),
        means=(FAMILY,), kept=False,
    ),
)  # fmt: skip


def varied(scene: Scene, values: Mapping[str, Any]) -> list[str]:
    """Those of the keys that a family of the scene varies."""
    in_contact = {name for name, joint in scene.bushings.items() if joint.model == "contact"}
    return [
        key for key in values
        if key.startswith("joints.") and key.split(".")[1] in in_contact
        and key.split(".")[2] in KEYS
    ]  # fmt: skip
