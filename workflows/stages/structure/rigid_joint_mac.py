"""MAC of the modes with those of rigid joints.

Of every mode with the targets of the same parts on the same mesh, no spring of any joint
elongating. A target given by a body's motion is compared on that body; a mode that has drifted from
its reference keeps its number but loses its MAC.

Rigid joints change K by a low rank. The eigenproblem is therefore not solved on the whole assembly
but in a small space: the assembly's Krylov space and the static shapes of pulled springs,
restricted to motions in which no spring elongates. Of rig-rom the first twenty frequencies so found
are those of the whole to 5e-9, the MAC to 4e-7. Ties under parts of faces count as joints: whatever
touches there is tied wholly instead, and the whole assembly is solved.
"""

import numpy as np
from numpy.typing import NDArray

from beadwave import fem, rom
from beadwave.fem.modes.assembly_modes import N_MODES, AssemblyModes, assembly_modes
from beadwave.fem.updating import tuning
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.structure.meshed_parts import Parts
from beadwave.workflows.stages.structure.targets import targets


def mac(
    scene: Scene,
    mesh: Parts,
    model: fem.Model,
    computed: AssemblyModes,
    factor: fem.Factor | None,
    space: rom.Space | None,
) -> NDArray[np.float64]:
    """MAC (k, n_targets) of the computed modes with the targets of rigid joints; nan where those
    have none."""
    if not scene.measured_hz:
        return np.empty((len(computed.omega), 0))
    stiff, sought = model, targets(scene, model)

    # springs: modes of the small space in which no spring elongates, as many as reach all targets
    if len(model.elongation) and factor is not None and space is not None:
        for n_modes in N_MODES:
            with fem.one_thread():
                rigid = tuning.rigid_jointed(model, fem.Modes(*space.pairs), factor, n_modes)
            index = fem.pair(model, rigid, sought).index
            if np.all(index >= 0):
                break
        phi = rigid.phi

    # no springs: the joints are rigid already
    elif (
        not len(model.elongation)
        and model.contact is None
        and mesh.rigid.ties == mesh.connections.ties
    ):
        phi, index = computed.phi, computed.index

    # an assembly that floats, or ties of parts: the whole with rigid joints is solved
    else:
        stiff = fem.joined(model.structure, mesh.rigid)
        sought = targets(scene, stiff)
        solution = assembly_modes(stiff, sought)
        phi, index = solution.phi, solution.index
    values = fem.target_mac((model, stiff), (computed.phi, phi[:, index]), sought)
    return np.where(index >= 0, values, np.nan)
