"""The damping law of loss factors, from the strain that materials, joints and springs share."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from beadwave import coupling, fem
from beadwave.fem.modes.mac import RIGID
from beadwave.fem.updating.loss_factors import strain_shares
from beadwave.workflows.scene import LossFactorsTable, Scene
from beadwave.workflows.stages.chain.damping import damping_law, law_of_loss
from beadwave.workflows.stages.structure.assembly import dashpots

if TYPE_CHECKING:
    from beadwave import rom
    from beadwave.fem.modes.assembly_modes import AssemblyModes


def structure_damping(
    scene: Scene, model: fem.Model, modes: "AssemblyModes"
) -> coupling.Damping | None:
    """Damping law of a scene for the modes of its assembly."""
    if isinstance(scene.damping, LossFactorsTable):
        return law_of_loss(scene.damping, strain_of(scene, model, modes))
    return damping_law(scene.damping, scene.measured_hz)


def ratios_of_modes(scene: Scene, model: fem.Model, modes: "AssemblyModes") -> NDArray[np.float64]:
    """Damping ratios (k,) of the modes of an assembly: of its law, and of the dashpots in joints,
    springs and measured parts, phi^T C phi / (2 omega) of a mode; what these couple of modes is
    left out."""
    zeta = coupling.damping_ratios(structure_damping(scene, model, modes), modes.omega)
    C = dashpots(scene, model)
    if C is None:
        return zeta
    rates = np.einsum("ij,ij->j", modes.phi, C @ modes.phi)
    elastic = modes.omega > RIGID * modes.omega.max()
    return zeta + np.where(elastic, rates / np.where(elastic, 2 * modes.omega, 1.0), 0.0)


def strain_of(scene: Scene, model: fem.Model, modes: "AssemblyModes") -> "rom.StrainShares":
    """Of which materials, joints and springs the strain energy is, of the modes that have some."""
    from beadwave import rom

    material = {body: scene.material_name(body) or "" for body in model.structure.basis}
    parts, shares = strain_shares(model, fem.Modes(modes.omega, modes.phi), material)
    hz, first = np.unique(modes.omega / (2 * np.pi), return_index=True)
    strains = shares[first].sum(axis=1) > 0
    return rom.StrainShares(hz[strains], parts, shares[first][strains])
