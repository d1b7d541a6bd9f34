"""The stages of a beam or a plate, by the doors of an assembly: model, modes, reduced model.

What the mesh leaves of error in the waves is told by a finer one, e(h) - e(h / sqrt 2): elements of
order 6 and 10 that are as long as the shortest wave converge too fast for a coarser one to say
anything. Under the disc that strikes a plate Hertz' pressure ends like a square root, and leaves w
hardly three derivatives, so that its mean over the disc is sure of order 4 alone. The errors stated
of plates and beams are 1.0 to 1.4 times those against elements half as long. A coarser mesh tells
nothing, since its error may be the smaller one; the finer one of a plate of many waves takes half
as long again as the run's own.
"""

import numpy as np

import fem
import rom
from fem.assembly_modes import SHOWN, AssemblyModes
from fem.mode_field import ModeField
from workflows.scene import InvalidScene, Scene
from workflows.stages.reduction import SecondModel, selection

N_MODES = 30
FINER = 2**-0.5  # times the elements' length, on the second mesh
ORDER = 4.0  # of the mesh's error at least
NO_TARGETS = np.empty(0, np.int64)


def model(scene: Scene, coarser: float = 1.0) -> fem.Bending:
    """The beam or plate; raises InvalidScene where its load buckles it, and for a plate of more
    waves than there is memory for."""
    try:
        return _beam(scene.beam, coarser) if scene.plate is None else _plate(scene.plate, coarser)
    except fem.Buckled as why:
        keys = ", ".join(f"{scene.struck_body}.{key}" for key in scene.bending.loads)
        raise InvalidScene(f"{scene.name}: {keys}: {why}.") from None
    except fem.TooLarge as why:
        raise InvalidScene(f"{scene.name}: {why}.") from None


def _beam(table, coarser: float) -> fem.Bending:
    made_of = fem.Material(table.young, table.poisson, table.density)
    ends = tuple(fem.BeamEnd(*springs) for springs in table.springs)
    return fem.beam(
        table.length, section(table), made_of, ends, table.position,
        axial_force=table.axial_force, coarser=coarser,
    )  # fmt: skip


def _plate(table, coarser: float) -> fem.Bending:
    in_plane = table.in_plane_x, table.in_plane_y
    return fem.mindlin_plate(
        _sheet(table), table.edges, table.at, in_plane=in_plane, coarser=coarser
    )


def _sheet(table) -> fem.Sheet:
    made_of = fem.Material(table.young, table.poisson, table.density)
    return fem.Sheet(table.length, table.width, table.thickness, made_of, table.shear_factor)


def section(table) -> fem.Section:
    """The cross-section, with the shear factor of its shape or the one given."""
    if table.width:
        found = fem.rectangle(table.width, table.thickness, table.poisson)
    elif table.diameter:
        found = fem.tube(table.diameter, table.bore, table.poisson)
    else:
        found = fem.section(table.area, table.second_moment, table.shear_factor)
    return found._replace(shear_factor=table.shear_factor or found.shear_factor)


def modes(scene: Scene, model: fem.Bending) -> AssemblyModes:
    """The lowest modes; there are no targets."""
    n = model.K.shape[0]
    found = fem.modes(model.K, model.M, min(N_MODES, n - 2))
    return AssemblyModes(
        found.omega, found.phi, NO_TARGETS, np.empty(0), n, model.effective_mass(found.phi),
        _field(scene, model, found), model.load_factor,
    )  # fmt: skip


def _field(scene: Scene, model: fem.Bending, found: fem.Modes) -> ModeField:
    index = np.flatnonzero(found.omega > fem.correlation.RIGID * found.omega.max())[:SHOWN]
    u = (model.T @ found.phi[:, index]).T.reshape(len(index), -1, 3)
    meshes = {scene.struck_body: model.drawn}
    target = np.zeros(len(index), dtype=int)
    return ModeField(meshes, index + 1, found.frequency_hz[index], u.astype(np.float32), target)


def contact(scene: Scene, model: fem.Bending) -> fem.ContactPatch:
    """Where it is struck."""
    return model.patch


def mac(scene: Scene, modes: AssemblyModes) -> np.ndarray:
    """(k, 0): there is nothing to compare with."""
    return np.empty((len(modes.omega), 0))


def reduction(scene: Scene, model: fem.Bending) -> rom.ReducedModel:
    """The model in few coordinates at the contact, with the way back to its drawn surface."""
    reduced, known = _reduced(scene, model), contact_of(scene, model)
    drawn, n = model.drawn, len(model.drawn.p[0])
    T = (model.T @ reduced.T).astype(np.float32)
    faces = drawn.facets[:, drawn.boundary_facets()].T
    return reduced._replace(
        T=None,
        surface=rom.Surface(drawn.p.T, faces, T, np.zeros(n, int), (scene.struck_body,)),
        contact=known,
        mass=rom.MassProperties(model.mass, tuple(model.middle)),
        finer=reduced.finer._replace(contact=known),
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
    matrices, asked = (model.K, model.M, model.patch.w), selection(scene)
    if scene.reduction.kind == "free-modes":
        return rom.free_modes(*matrices, asked, factorise=fem.factorised)
    return rom.craig_bampton(*matrices, model.patch.boundary, asked, factorise=fem.factorised)
