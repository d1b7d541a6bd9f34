"""The stages of a beam or a plate, by the doors of an assembly: model, modes, reduced model.

What the mesh leaves of error in the waves is estimated by a finer one, e(h) - e(h / sqrt 2):
elements of order 6 and 10 that are as long as the shortest wave converge too fast for a coarser one
to say anything. Under the disc that strikes a plate Hertz' pressure ends like a square root, and
leaves w hardly three derivatives, so that its mean over the disc is sure of order 4 alone. The
errors stated of plates and beams are 1.0 to 1.4 times those against elements half as long. A
coarser mesh would be no measure, since its error may be the smaller one; the finer one of a plate
of many waves takes half as long again as the run's own.
"""

import numpy as np

import fem
import rom
from fem.assembly_modes import SHOWN, AssemblyModes
from fem.mode_field import ModeField
from workflows.scene import InvalidScene, Scene
from workflows.stages.reduction import SecondModel, selection

FINER = 2**-0.5  # times the elements' length, on the second mesh
ORDER = 4.0  # of the mesh's error at least, see above
NO_TARGETS = np.empty(0, np.int64)


def model(scene: Scene, coarser: float = 1.0) -> fem.Bending:
    """The beam or plate; raises InvalidScene where its load buckles it, and for a plate of more
    waves than there is memory for."""
    table = scene.beam if scene.plate is None else scene.plate
    made_of = fem.Material(table.young, table.poisson, table.density)
    try:
        if scene.plate is None:
            ends = tuple(fem.BeamEnd(*springs) for springs in table.springs)
            return fem.beam(
                table.length, section(table), made_of, ends, table.position,
                axial_force=table.axial_force, coarser=coarser,
            )  # fmt: skip
        size = table.length, table.width, table.thickness
        sheet = fem.Sheet(*size, made_of, table.shear_factor)
        in_plane = table.in_plane_x, table.in_plane_y
        return fem.mindlin_plate(sheet, table.edges, table.at, in_plane=in_plane, coarser=coarser)
    except fem.Buckled as why:
        keys = ", ".join(f"{scene.struck_body}.{key}" for key in scene.bending.loads)
        raise InvalidScene(f"{scene.name}: {keys}: {why}.") from None
    except fem.TooLarge as why:
        raise InvalidScene(f"{scene.name}: {why}.") from None


def section(table) -> fem.Section:
    """The cross-section, with the shear factor of its shape or the one given."""
    if table.width:
        shape = fem.rectangle(table.width, table.thickness, table.poisson)
    elif table.diameter:
        shape = fem.tube(table.diameter, table.bore, table.poisson)
    else:
        shape = fem.section(table.area, table.second_moment, table.shear_factor)
    return shape._replace(shear_factor=table.shear_factor or shape.shear_factor)


def modes(scene: Scene, model: fem.Bending) -> AssemblyModes:
    """The lowest modes; there are no targets."""
    n = model.K.shape[0]
    lowest = fem.modes(model.K, model.M, min(30, n - 2))  # those that a table of modes lists
    omega, phi = lowest.omega, lowest.phi

    # the shapes drawn: those that bend, on the nodes of the surface
    index = np.flatnonzero(omega > fem.correlation.RIGID * omega.max())[:SHOWN]
    u = (model.T @ phi[:, index]).T.reshape(len(index), -1, 3).astype(np.float32)
    meshes = {scene.struck_body: model.drawn}
    target = np.zeros(len(index), dtype=int)
    field = ModeField(meshes, index + 1, lowest.frequency_hz[index], u, target)
    return AssemblyModes(
        omega, phi, NO_TARGETS, np.empty(0), n, model.effective_mass(phi), field, model.load_factor
    )


def contact(scene: Scene, model: fem.Bending) -> fem.ContactPatch:
    """Where it is struck."""
    return model.patch


def mac(scene: Scene, modes: AssemblyModes) -> np.ndarray:
    """(k, 0): there is nothing to compare with."""
    return np.empty((len(modes.omega), 0))


def reduction(scene: Scene, model: fem.Bending) -> rom.ReducedModel:
    """The model in few coordinates at the contact, with the way back to its drawn surface."""
    reduced, contact = _reduced(scene, model), contact_of(scene, model)
    mesh, n = model.drawn, len(model.drawn.p[0])
    T = (model.T @ reduced.T).astype(np.float32)
    faces = mesh.facets[:, mesh.boundary_facets()].T
    return reduced._replace(
        T=None,
        surface=rom.Surface(mesh.p.T, faces, T, np.zeros(n, int), (scene.struck_body,)),
        contact=contact,
        mass=rom.MassProperties(model.mass, tuple(model.middle)),
        finer=reduced.finer._replace(contact=contact),
    )


def contact_of(scene: Scene, model: fem.Bending) -> rom.Contact:
    """The material that is struck; a beam's section holds no half-space, a plate's disc does."""
    made_of, spot = scene.struck_material, model.patch.spot
    return rom.Contact(
        half_space=model.half_space,
        young=made_of.young,
        poisson=made_of.poisson,
        point=tuple(spot.point.tolist()),
        direction=tuple(spot.inward.tolist()),
    )


def second_mesh(scene: Scene) -> SecondModel:
    """The same on shorter elements."""
    second = model(scene, FINER)
    reduced = _reduced(scene, second)._replace(T=None, contact=contact_of(scene, second))
    return SecondModel(reduced, 1 / (1 - FINER**ORDER))


def _reduced(scene: Scene, model: fem.Bending) -> rom.ReducedModel:
    matrices, selected = (model.K, model.M, model.patch.w), selection(scene)
    if scene.reduction.kind == "free-modes":
        return rom.free_modes(*matrices, selected, factorise=fem.factorised)
    return rom.craig_bampton(*matrices, model.patch.boundary, selected, factorise=fem.factorised)
