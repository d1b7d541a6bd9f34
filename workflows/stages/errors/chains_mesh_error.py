"""Error of the mesh in the waves of several chains: their march again on another mesh.

The other mesh and the share of the difference that is the run's own are those of `second_mesh`.
"""

from beadwave import fem, rom
from beadwave.coupling.shaken_packing import ShakenState
from beadwave.dem import space
from beadwave.fem.modes.assembly_modes import AssemblyModes
from beadwave.workflows.scene import LossFactorsTable, Scene
from beadwave.workflows.scene.tables.reduction import TO_HZ
from beadwave.workflows.stages.chain import several
from beadwave.workflows.stages.errors.second_mesh import other_mesh
from beadwave.workflows.stages.structure import assembly
from beadwave.workflows.stages.structure.meshed_parts import Parts
from beadwave.workflows.stages.structure.several import ChainContacts, contacts, with_shakers


def mesh_errors(
    scene: Scene,
    start: several.ChainsStart,
    march: space.SpaceTrajectory,
    mesh: Parts,
    modes: AssemblyModes,
    before: ShakenState | None = None,
) -> several.ChainsErrors:
    """Errors of the velocities by the mesh. Raises ValueError where no other mesh tells them."""
    structure, places, share = structure_on_other_mesh(scene, mesh, modes)
    again = several.march_at_step(
        scene, several.start(scene, places, structure), structure, march.dt, before
    )
    return several.errors_of_difference(start, march, again, share, before)


def structure_on_other_mesh(
    scene: Scene, mesh: Parts, modes: AssemblyModes
) -> tuple[space.Structure, ChainContacts, float]:
    """The structure on another mesh, its contacts, and the share of a difference that is the error
    of the mesh. Raises ValueError where no other mesh tells it."""
    if isinstance(scene.damping, LossFactorsTable):
        raise ValueError(
            "loss factors of parts are not known on a second mesh; compare with a run on a finer "
            "mesh, --set mesh.scale=0.5."
        )
    parts, share = other_mesh(scene, mesh)
    model = assembly.model(scene, parts)
    places, table = contacts(scene, parts, model), scene.reduction
    with fem.one_thread():
        reduced = rom.several_contacts(
            model.K, model.M, with_shakers(scene, model, places), error=table.error,
            to_hz=table.to_hz or TO_HZ, factorise=fem.factorised,
        )  # fmt: skip
    # frequencies that ratios of damping are of, as the run has them
    struck = reduced.contact._replace(modes_hz=tuple(modes.paired_hz.values()) or None)
    return several.structure(scene, reduced._replace(contact=struck), places), places, share
