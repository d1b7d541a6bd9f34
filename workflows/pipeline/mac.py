"""MAC of the modes with those of stiff joints, on the motion of the block.

Of every mode with the four of the same parts on the same mesh, all touching faces tied. The
four are told by the block (`fem.correlation`), so the block's displacements are compared; a mode
that has drifted from its reference keeps its number but loses its MAC.
"""

import numpy as np
from numpy.typing import NDArray

import fem
import geometry
from workflows.pipeline import rig
from workflows.pipeline.assembly import AssemblyModes, modes
from workflows.scene import Scene
from workflows.scene.assembly import assembly


def mac(scene: Scene, model: fem.Model, found: AssemblyModes) -> NDArray[np.float64]:
    """MAC (k, 4) of the modes found with the hammer-test modes of stiff joints; nan without one."""
    parts = assembly(scene.assembly)
    held = geometry.held_faces(parts, fixing=scene.assembly.fixing)
    stiff = fem.joined(model.structure, rig.full_tie(geometry.interfaces(parts), held))
    reference = modes(scene, stiff)
    shapes = found.phi, reference.phi[:, reference.index]
    found_mac = fem.target_mac((model, stiff), shapes, rig.TARGETS)
    return np.where(reference.index >= 0, found_mac, np.nan)
