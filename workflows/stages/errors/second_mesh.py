"""A second mesh of an assembly, of which a difference tells the error of the run's own.

It has elements twice as large, those that thickness and bores bound too: of an error e = c h^p,

    e(2 h) - e(h) = (2^p - 1) e(h),    e(h) - e(h / 2^k) = (1 - 2^-kp) e(h).

Some meshes have no coarser one to compare with: a user's own mesh, bodies whose elements are
bounded by their shape, and small meshes, of which a coarser one would be too poor. There every
element is split in eight instead, if that is affordable; in the smallest meshes in 64 or 512, since
a few elements miss more than half of the motion. Elements that are split evenly converge with the
order 1 at singular edges.

Stresses are singular where a face ends on another; meshes refined there converge faster than the
order 1 that singular edges leave on even ones, and slower than the 4 of smooth modes. With the
order taken, the errors stated of rig-rom and rig-full-tie are 1.2 and 2.7 times those against
meshes of 127 000 and 107 000 unknowns. Beams and plates have another, see `bending`.
"""

from math import log

from beadwave import fem, geometry, rom
from beadwave.fem.modes.assembly_modes import N_MODES
from beadwave.workflows.scene import Scene
from beadwave.workflows.scene.tables.reduction import TO_HZ
from beadwave.workflows.stages.structure import assembly as stages
from beadwave.workflows.stages.structure import bodies
from beadwave.workflows.stages.structure.meshed_parts import Parts
from beadwave.workflows.stages.structure.reduction import SecondModel, contact_of

COARSER = 2.0  # times the element size
ORDER = 1.5  # of the mesh's error; see above for what the errors stated are with it


# Choice of a coarser or a finer mesh that a run is compared with
EVEN_ORDER = 1.0  # of the error of a mesh whose elements are parted evenly
FEWER_ELEMENTS = 1.5  # times the elements of a body in a mesh that is markedly coarser
# share of all elements in bodies whose second mesh is hardly coarser, up to which the second
# mesh still shows the error
UNSEEN_SHARE = 0.3
SMALL_UNKNOWNS = 1.6e4  # unknowns of a finer mesh that is solved in a second
MAX_UNKNOWNS = 6e4  # unknowns of one that takes as long as the run


def other_mesh(scene: Scene, mesh: Parts) -> tuple[Parts, float]:
    """A mesh coarser than the run's own, or finer where none is, and how much of the difference
    to it is the error of the run's own.

    Raises ValueError for one that cannot be made coarser and is too large to be made finer.
    """
    n = 3 * sum(mesh.nodes.values())
    if not of_few_elements(mesh) and scene.own_mesh is None:
        coarse = bodies.parts(scene, mesh.sizes, COARSER)
        # markedly coarser: nearly all elements are in bodies that have fewer there
        n_cells = {name: body.nelements for name, body in mesh.meshes.items()}
        hardly_coarser = [
            n_cells[name]
            for name, body in coarse.meshes.items()
            if n_cells[name] < FEWER_ELEMENTS * body.nelements
        ]
        if sum(hardly_coarser) <= UNSEEN_SHARE * sum(n_cells.values()):
            return coarse, 1 / (COARSER**ORDER - 1)
    if 8 * n > MAX_UNKNOWNS:
        finer = "one of your own" if scene.own_mesh else "--set mesh.scale=0.5"
        raise ValueError(
            f"its elements cannot be made larger, and halved they would have {8 * n:.1e} "
            f"unknowns, allowed are {MAX_UNKNOWNS:.0e}; compare with a run on a finer mesh, "
            f"{finer}."
        )
    times = max(1, int(log(SMALL_UNKNOWNS / n, 8)))
    meshes = {name: geometry.refined(body, times) for name, body in mesh.meshes.items()}
    return mesh._replace(meshes=meshes), 1 / (1 - 2 ** (-times * EVEN_ORDER))


def of_few_elements(mesh: Parts) -> bool:
    """True if every element can be split in eight and the assembly solved again in a second."""
    return 8 * 3 * sum(mesh.nodes.values()) <= SMALL_UNKNOWNS


def second_mesh(scene: Scene, mesh: Parts) -> SecondModel:
    """The assembly on another mesh, reduced the quickest way; raises ValueError where none is."""
    parts, error_share = other_mesh(scene, mesh)
    model = stages.model(scene, parts)
    return SecondModel(wall_model(scene, model, stages.contact(scene, parts, model)), error_share)


def wall_model(scene: Scene, model: fem.Model, contact: fem.ContactPatch) -> rom.ReducedModel:
    """A model at its contact, reduced the quickest way, for a march alone."""
    reduced = rom.free_modes(
        model.K,
        model.M,
        contact.w,
        rom.Selection(n_modes=N_MODES[0], choice="contact", to_hz=TO_HZ),
        factorise=fem.factorised,
    )
    return reduced._replace(T=None, contact=contact_of(scene, model, contact))
