"""MAC of the modes with those of stiff joints.

Of every mode with the targets of the same parts on the same mesh, all joints rigid: of the thesis'
rig all touching faces tied. A target given by a body's motion is compared on that body; a mode that
has drifted from its reference keeps its number but loses its MAC.
"""

import numpy as np
from numpy.typing import NDArray

import fem
import geometry
from fem.assembly_modes import AssemblyModes
from workflows.scene import Scene
from workflows.scene.assembly import assembly
from workflows.stages import rig
from workflows.stages.assembly import modes
from workflows.stages.parts import Parts
from workflows.stages.targets import targets


def mac(
    scene: Scene, mesh: Parts, model: fem.Model, computed: AssemblyModes
) -> NDArray[np.float64]:
    """MAC (k, n_targets) of the computed modes with the targets of stiff joints; nan where those
    have none."""
    if not scene.measured_hz:
        return np.empty((len(computed.omega), 0))
    if scene.is_general:
        rigid = [joint._replace(springs=fem.Bushing()) for joint in mesh.connections.joints]
        connections = mesh.connections._replace(joints=rigid)
    else:
        parts = assembly(scene.assembly)
        held = geometry.held_faces(parts, fixing=scene.assembly.fixing)
        connections = rig.full_tie(geometry.interfaces(parts), held)
    stiff = fem.joined(model.structure, connections)
    reference = modes(scene, stiff)
    shapes = computed.phi, reference.phi[:, reference.index]
    values = fem.target_mac((model, stiff), shapes, targets(scene, stiff))
    return np.where(reference.index >= 0, values, np.nan)
