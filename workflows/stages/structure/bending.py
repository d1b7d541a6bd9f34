"""The stages of a beam or a plate, with the names of an assembly's: model, modes, reduced model.

The mesh error is estimated by a finer mesh, from u(h) - u(h / sqrt 2) and the order 4. A coarser
mesh would be no measure: elements of order 6 and 10 that are as long as the shortest wave are at
the edge of convergence, and the coarser one may have the smaller error. The order is 4 and not
that of the elements, since Hertz' pressure on the disc that strikes a plate ends like a square
root, so that w has hardly three derivatives there. Stated errors of plates and beams are 1.0 to 1.4
times those measured against elements half as long. The finer mesh of a plate of many waves takes
half as long again as the run's own.

The error of the theory is estimated by two other theories: the same corrected by solids (see
`fem.BeamCorrection`), which is five to ten times nearer to those, and the usual one, Cowper's beam
that does not bulge or Mindlin's shear factor. `examples/theory_errors.py` compares all with solids.
"""

import numpy as np

from beadwave import fem, rom
from beadwave.fem.modes.assembly_modes import SHOWN, AssemblyModes
from beadwave.fem.modes.mac import RIGID
from beadwave.fem.modes.mode_field import ModeField
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.stages.structure.reduction import SecondModel, selection

FINER = 2**-0.5  # length of the second mesh's elements over those of the run's, see above
ORDER = 4.0  # of the mesh error, at least, see above
NO_TARGETS = np.empty(0, np.int64)


# Factors that make the error of the theory of the differences to two others: the theory corrected
# by solids, and the usual one.
#
# Of 24 beams and 7 plates computed as solids, the differences to the first alone were 0.2 to 1.7
# and 0.5 to 2.5 times the errors, least where solids correct nothing: the second counts there.
BEAM_SHARES = (1.2, 0.1)
PLATE_SHARES = (1.2, 1.5)


def model(scene: Scene, coarser: float = 1.0, theory: str = "own") -> fem.Bending:
    """The beam or plate on elements `coarser` times as long, by its own `theory`, by that corrected
    by "solid" elements, or by the "usual" one; raises InvalidScene where its load buckles it, and
    for a plate of more waves than there is memory for."""
    table = scene.beam if scene.plate is None else scene.plate
    made_of = fem.Material(table.young, table.poisson, table.density)
    try:
        if scene.plate is None:
            ends = tuple(fem.BeamEnd(*springs) for springs in table.springs)
            shape = section(table)
            if theory == "solid":
                shape = shape._replace(correction=fem.BeamCorrection())
            # Cowper's factor of a rectangle (J. Appl. Mech. 33 (1966) 335), no bulge
            if theory == "usual":
                nu = table.poisson
                shape = shape._replace(shear_factor=10 * (1 + nu) / (12 + 11 * nu), bulge=0.0)
            return fem.beam(
                table.length, shape, made_of, ends, table.position,
                axial_force=table.axial_force, coarser=coarser,
            )  # fmt: skip
        size = table.length, table.width, table.thickness
        # Mindlin's factor, of the cut-off of thickness-shear waves
        kappa = np.pi**2 / 12 if theory == "usual" else table.shear_factor
        sheet = fem.Sheet(*size, made_of, kappa)
        return fem.mindlin_plate(
            sheet, table.edges, table.at,
            in_plane=(table.in_plane_x, table.in_plane_y), coarser=coarser,
            correction=fem.PlateCorrection() if theory == "solid" else None,
        )  # fmt: skip
    except fem.Buckled as why:
        keys = ", ".join(f"{scene.struck_body}.{key}" for key in scene.bending.loads)
        raise InvalidScene(f"{scene.name}: {keys}: {why}.") from None
    except fem.TooLarge as why:
        raise InvalidScene(f"{scene.name}: {why}.") from None


def section(table) -> fem.Section:
    """The cross-section of a [beam] table, with the shear factor of its shape or the one given."""
    if table.width:
        shape = fem.rectangle(table.width, table.thickness, table.poisson)
    elif table.diameter:
        shape = fem.tube(table.diameter, table.bore, table.poisson)
    else:
        shape = fem.section(table.area, table.second_moment, table.shear_factor)
    return shape._replace(shear_factor=table.shear_factor or shape.shear_factor)


def modes(scene: Scene, model: fem.Bending) -> AssemblyModes:
    """The lowest modes, at most 30, none of them paired: beams and plates have no targets."""
    n = model.K.shape[0]
    lowest = fem.modes(model.K, model.M, min(30, n - 2))  # those that a table of modes lists
    omega, phi = lowest.omega, lowest.phi

    # the shapes drawn: those that bend, on the nodes of the surface
    index = np.flatnonzero(omega > RIGID * omega.max())[:SHOWN]
    u = (model.T @ phi[:, index]).T.reshape(len(index), -1, 3).astype(np.float32)
    meshes = {scene.struck_body: model.drawn}
    target = np.zeros(len(index), dtype=int)
    field = ModeField(meshes, index + 1, lowest.frequency_hz[index], u, target)
    return AssemblyModes(
        omega, phi, NO_TARGETS, np.empty(0), n, model.effective_mass(phi), field, model.load_factor
    )


def contact(scene: Scene, model: fem.Bending) -> fem.ContactPatch:
    """The contact where the beam or plate is struck."""
    return model.patch


def mac(scene: Scene, modes: AssemblyModes) -> np.ndarray:
    """MAC (k, 0): there are no target shapes to compare k modes with."""
    return np.empty((len(modes.omega), 0))


def reduction(scene: Scene, model: fem.Bending) -> rom.ReducedModel:
    """The reduced model at the contact, with the matrix that recovers the drawn surface's
    motion: T (3 points, k) of the surface's nodes in single precision, not of the dofs."""
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
    """Material, place and half-space compliance of the contact; a beam has no half-space to take
    out, since its section does not deform under the disc, a plate has."""
    made_of, spot = scene.struck_material, model.patch.spot
    return rom.Contact(
        half_space=model.half_space,
        young=made_of.young,
        poisson=made_of.poisson,
        point=tuple(spot.point.tolist()),
        direction=tuple(spot.inward.tolist()),
    )


def second_mesh(scene: Scene) -> SecondModel:
    """The reduced model on elements `FINER` times as long, and the factor from its difference to
    the run's model to the error of that, 1 / (1 - FINER^ORDER)."""
    second = model(scene, FINER)
    reduced = _reduced(scene, second)._replace(T=None, contact=contact_of(scene, second))
    return SecondModel(reduced, 1 / (1 - FINER**ORDER))


def other_theories(scene: Scene) -> tuple[SecondModel, ...]:
    """The reduced models of the theory as solids correct it, and of the usual one: a beam that does
    not bulge with Cowper's shear factor, a plate with Mindlin's.

    Raises ValueError for a section for which solids were not computed.
    """
    table = scene.beam or scene.plate
    if scene.beam is not None and (table.bore or table.area):
        raise ValueError(
            "solids were compared with full rods and rectangles alone; a hollow or an open section "
            "also flattens under the sphere: compare with the beam drawn as a body."
        )
    of_kind = BEAM_SHARES if scene.plate is None else PLATE_SHARES
    models = []
    for theory, share in zip(("solid", "usual"), of_kind, strict=True):
        second = model(scene, theory=theory)
        reduced = _reduced(scene, second)._replace(T=None, contact=contact_of(scene, second))
        models.append(SecondModel(reduced, share))
    return tuple(models)


def _reduced(scene: Scene, model: fem.Bending) -> rom.ReducedModel:
    """The model in few coordinates, by the scene's kind of reduction."""
    matrices, selected = (model.K, model.M, model.patch.w), selection(scene)
    if scene.reduction.kind == "free-modes":
        return rom.free_modes(*matrices, selected, factorise=fem.factorised)
    return rom.craig_bampton(*matrices, model.patch.boundary, selected, factorise=fem.factorised)
