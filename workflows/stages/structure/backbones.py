"""Frequency and loss of modes over their amplitude, of faces in contact under preload."""

import numpy as np

from beadwave import fem
from beadwave.fem.contact.modal_backbone import (
    Loaded,
    ModalBackbone,
    friction_interface,
    modal_backbone,
)
from beadwave.fem.modes.assembly_modes import AssemblyModes
from beadwave.fem.modes.mac import RIGID
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.structure.meshed_parts import Parts

N_MODES = 6  # of the lowest elastic ones


def backbones(
    scene: Scene, mesh: Parts, model: fem.Model, modes: AssemblyModes
) -> dict[int, ModalBackbone]:
    """The backbones of the lowest elastic modes, by their numbers from 1 on."""
    interface, C = friction_interface(model)
    facets = model.contact.facets
    _, groups = mesh.pressed_groups(facets)

    of_mode = {}
    elastic = np.flatnonzero(modes.omega > RIGID * modes.omega.max())
    for i in elastic[:N_MODES]:
        phi, omega = modes.phi[:, i], modes.omega[i]
        nodes = (model.T @ phi)[: model.structure.n_dofs].reshape(-1, 3)
        largest = float(np.linalg.norm(nodes, axis=1).max())
        loaded = Loaded(interface, C @ phi / omega**2, 1 / omega**2)
        of_mode[int(i) + 1] = modal_backbone(loaded, facets.area, groups, largest)
    return of_mode
