"""The assembly's model in few coordinates at the contact: how many, which, and what it carries."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave import fem, rom
from beadwave.fem.modes.assembly_modes import AssemblyModes
from beadwave.rom.jointed import Jointed
from beadwave.rom.tall import shares
from beadwave.workflows.scene import InvalidScene, LossFactorsTable, Scene
from beadwave.workflows.scene.tables.reduction import TO_HZ
from beadwave.workflows.stages.structure.assembly import contact as patch
from beadwave.workflows.stages.structure.assembly import dashpots, solid, struck
from beadwave.workflows.stages.structure.functionals import with_functionals
from beadwave.workflows.stages.structure.loss_factors import strain_of
from beadwave.workflows.stages.structure.meshed_parts import Parts
from beadwave.workflows.stages.structure.strike import surface_of

NOTHING = np.empty(0, np.int64)


MAX_VALUES = 1.5e8  # of the constraint modes: 1.2 GB, some minutes
# Hz of the lowest mode: below, a wall floats for all that a chain notices; not varied
FLOATING_HZ = 0.1
OPEN_SPRING = 1.0  # [N/m] of a joint's spring that holds nothing; not varied


class SecondModel(NamedTuple):
    """The reduced model of another mesh, and how much of its difference is the run's error."""

    reduced: rom.ReducedModel
    left: float


def jointed(
    scene: Scene,
    model: fem.Model,
    contact: fem.ContactPatch,
    modes: AssemblyModes,
    factor: fem.Factor | None = None,
    space: rom.Space | None = None,
) -> Jointed:
    """The reduction of many assemblies that differ in the springs of their joints."""
    C = dashpots(scene, model)
    boundary_dofs = np.union1d(damped_dofs(model, C), model.elongation)
    boundary = boundary_of(contact, reading(scene, model), boundary_dofs)
    reduced = reduction(scene, model, contact, modes, factor, space, keep=model.elongation)
    names, at = np.array(model.spring), np.searchsorted(boundary, model.elongation)
    places = {name: at[names == name] for name in dict.fromkeys(model.spring)}
    stiffness = dict(zip(model.spring, model.stiffness.tolist(), strict=True))
    return Jointed(reduced, places, stiffness)


def reduction(
    scene: Scene,
    model: fem.Model,
    contact: fem.ContactPatch,
    modes: AssemblyModes,
    factor: fem.Factor | None = None,
    space: rom.Space | None = None,
    field: fem.HalfSpaceField | None = None,
    *,
    keep: NDArray[np.int64] = NOTHING,
) -> rom.ReducedModel:
    """The model in few coordinates at the contact, with the way back to the outer nodes alone.

    The factor is that of K, where it is held, the space and the field of a half-space are those of
    this contact. `keep` (k,) are further dofs that stay as they are. Raises InvalidScene for an
    assembly or a part that nothing holds, ValueError for a patch of too many nodes and for a thesis
    scheme whose nodes coincide, rom.ReductionError for a model that would not be right.
    """
    # the thesis' scheme reads the wall elsewhere than it pushes
    w_reading, C = reading(scene, model), dashpots(scene, model)
    if w_reading is not None and not scene.strike.nodes and np.array_equal(w_reading, contact.w):
        raise ValueError(
            'weights = "thesis" would read the node that it pushes: the patch of radius = '
            f"{scene.strike.radius} m ends nearer to it than to the next, with elements of "
            f"{scene.strike.size} m; raise the radius or refine the mesh there."
        )

    # what a Craig-Bampton model keeps: the patch, dashpots' elongations, oscillators of parts
    keep = np.union1d(damped_dofs(model, C), keep)
    boundary = boundary_of(contact, w_reading, keep)

    # modes that were computed already: where the contact chooses, the measured ones are kept in any
    # case and all others compete; a free-modes model of the lowest takes them all, if they are as
    # many as it needs
    selected, table = selection(scene), scene.reduction
    ready = targets_kept(modes) if selected.by_contact else None
    craig_bampton = table.kind == "craig-bampton"
    if not craig_bampton and not selected.by_contact:
        below = table.cutoff is not None and 2 * np.pi * table.cutoff < modes.omega[-1]
        if below or (table.modes is not None and table.modes <= len(modes.omega)):
            ready = modes.omega, modes.phi
    selected = selected._replace(modes=ready, space=space)
    if craig_bampton and len(boundary) * len(contact.w) > MAX_VALUES:
        gigabytes = 8e-9 * len(boundary) * len(contact.w)
        raise ValueError(
            f"the patch of radius = {contact.radius:g} m holds {len(boundary)} nodes of the mesh, "
            f"whose constraint modes of {len(contact.w)} unknowns would take "
            f"{gigabytes:.1f} GB, allowed are {8e-9 * MAX_VALUES:.1f}; take a larger "
            'seed, a smaller patch, or reduction.kind = "free-modes".'
        )
    matrices, solver = (model.K, model.M, contact.w), {"factorise": fem.factorised}
    try:
        with fem.one_thread():
            if craig_bampton:
                reduced = rom.craig_bampton(
                    *matrices, boundary, selected, C=C, factor=factor, **solver
                )
            else:
                reduced = rom.free_modes(*matrices, selected, C=C, factor=factor, **solver)
    except rom.ReductionError:
        _require_held(scene, modes)
        raise

    # further functionals: the contact across, shakers, sensors
    reach = rom.ColumnOptions(to_hz=selected.to_hz or TO_HZ)
    with fem.one_thread():
        reduced = with_functionals(
            scene, model, contact, reduced, reach, C=C, factor=factor, **solver
        )

    # what it carries: the contact's law, the way back to the outer nodes, names, masses
    struck_surface = contact_of(scene, model, contact, field)._replace(
        weights_read=None if w_reading is None else w_reading @ reduced.T,
        modes_hz=tuple(modes.paired_hz.values()) or None,
        point=tuple(contact.spot.point.tolist()),
        direction=tuple(contact.spot.inward.tolist()),
    )
    if isinstance(scene.damping, LossFactorsTable):
        struck_surface = struck_surface._replace(strain=strain_of(scene, model, modes))
    reduced = with_outer_nodes(reduced, model, contact.spot.inward)
    finer = reduced.finer._replace(contact=struck_surface._replace(weights_read=None))
    return reduced._replace(
        notes={"patch_weights": contact.weights, "patch_radius_m": repr(contact.radius)},
        coordinates=names(model, boundary, reduced),
        contact=struck_surface,
        finer=finer,
    )


def with_outer_nodes(
    reduced: rom.ReducedModel, model: fem.Model, direction: NDArray[np.float64]
) -> rom.ReducedModel:
    """The reduced model with the way back to the outer nodes of the mesh in place of T (n, r), and
    with the masses of the whole; `direction` (3,) is that of the effective mass captured."""
    outer = fem.outer_nodes(model.structure)
    rows = model.T[outer.dofs.ravel()]
    T = np.empty((rows.shape[0], reduced.T.shape[1]), np.float32)
    for c in shares(reduced.T.shape[1]):  # never all of it in double precision
        T[:, c] = rows @ reduced.T[:, c]
    body = fem.rigid_body(model.structure)
    centre = tuple((np.round(body.centre, 9) + 0.0).tolist())  # no rounding, no minus zero
    motion = np.tile(direction, model.T.shape[0] // 3)  # of the whole, as it is struck
    captured = rom.effective_mass(reduced, model.structure.M, motion, model.T).captured
    return reduced._replace(
        T=None,
        surface=rom.Surface(outer.points, outer.faces, T, outer.body, tuple(model.structure.basis)),
        mass=rom.MassProperties(body.mass, centre, body.grounding, captured),
    )


def boundary_of(
    contact: fem.ContactPatch, w_reading, keep: NDArray[np.int64] = NOTHING
) -> NDArray[np.int64]:
    """Dofs (b,) that a Craig-Bampton model keeps as they are: those that w reads or loads, and
    `keep`."""
    # w reads x alone: y and z of its nodes would add constraint modes that nothing loads
    boundary = np.flatnonzero(contact.w if w_reading is None else contact.w + w_reading)
    return np.union1d(boundary, keep)


def damped_dofs(model: fem.Model, C) -> NDArray[np.int64]:
    """Elongations of joints with dashpots, and oscillators of measured parts (k,): on the boundary,
    since a damper force converges slowly with the number of modes. Dashpots parallel to springs
    between points, which are far softer than bodies, do without."""
    if C is None:
        return NOTHING
    elongations = model.elongation[C.diagonal()[model.elongation] > 0]
    return np.concatenate([elongations, *(at for _, at in model.measured)])


def names(
    model: fem.Model, boundary: NDArray[np.int64], reduced: rom.ReducedModel
) -> tuple[str, ...]:
    """Names of the coordinates (r,): displacements of the boundary (b,), then amplitudes of
    shapes."""
    coordinates = []
    oscillator = {
        int(model.free[position]): f"amplitude of oscillator {j} of {part.name}"
        for part, at in model.measured for j, position in enumerate(at.tolist(), 1)
    }  # fmt: skip
    for dof in model.free[boundary[: reduced.n_boundary]]:
        if dof in oscillator:
            coordinates.append(oscillator[dof])
            continue
        if dof >= model.structure.n_dofs:
            coordinates.append("elongation of a joint")
            continue
        x, y, z = model.structure.points[dof // 3]
        coordinates.append(f"u_{'xyz'[dof % 3]} at x = {x:.6g}, y = {y:.6g}, z = {z:.6g} m")
    n_shapes = len(reduced.w) - reduced.n_boundary
    return (*coordinates, *(f"amplitude of shape {j}" for j in range(1, n_shapes + 1)))


def _require_held(scene: Scene, modes: AssemblyModes) -> None:
    """Raise InvalidScene with the keys to change where a reduction failed on parts that nothing
    holds."""
    lowest = modes.omega.min() / (2 * np.pi)
    if lowest > FLOATING_HZ:
        return
    springs = scene.bushings.items()
    open_joints = [
        f"joints.{joint}.{key} = {k:g}"
        for joint, table in springs
        for key in fem.DIRECTIONS
        if (k := getattr(table, key)) is not None and k < OPEN_SPRING
    ]
    held = [hold.on for hold in scene.assembly.holds]
    loose = ", ".join(open_joints) or f"assembly.held = {held} (of the rig: assembly.parts)"
    if scene.springs:
        names = ", ".join(spring.name for spring in scene.springs)
        loose = f"springs ({names}) that leave that motion free"
    raise InvalidScene(
        f"{scene.name}: the assembly, or a part of it, is not held: its lowest mode is below "
        f"{FLOATING_HZ:g} Hz, with {loose}. Constraint modes need what is held; hold it, or "
        'take reduction.kind = "free-modes".'
    )


def selection(scene: Scene) -> rom.Selection:
    """Number of modes, the rule that chooses them, and their highest frequency."""
    table = scene.reduction
    choice = "lowest" if table.cutoff is not None else table.choice
    to_hz = table.to_hz or (TO_HZ if table.error or choice == "contact" else None)
    return rom.Selection(
        table.modes, table.cutoff, table.error, to_hz=to_hz, choice=choice, finer_hz=TO_HZ
    )


def targets_kept(
    modes: AssemblyModes,
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """omega (k,) and phi (n, k) of the measured modes, which are kept however little the contact
    moves them; None without any."""
    # one computed mode may be the partner of two targets, as a motion that nothing holds
    index = np.unique(modes.index[modes.index >= 0])
    if not len(modes.index):
        return None
    return modes.omega[index], modes.phi[:, index]


def reading(scene: Scene, model: fem.Model) -> NDArray[np.float64] | None:
    """w (n,) by which the thesis' scheme reads the wall, at other nodes than it pushes; None for
    one functional of both."""
    strike = scene.strike
    if strike is None or strike.weights != "thesis":
        return None
    first, second = strike.at
    either_side = ((first - strike.radius, second), (first + strike.radius, second))
    return fem.node_patch(model, struck(scene), strike.nodes or either_side).w


def half_space(scene: Scene, mesh: Parts, model: fem.Model) -> fem.HalfSpaceField | None:
    """The field of the half-space that the Hertz law holds once more; None where none is known, and
    who needs one says why."""
    try:
        return half_space_at(scene, model, patch(scene, mesh, model))
    except (InvalidScene, ValueError):
        return None


def half_space_at(
    scene: Scene, model: fem.Model, contact: fem.ContactPatch
) -> fem.HalfSpaceField | None:
    """None of the thesis' scheme, which reads outside of the local dent: nothing is subtracted."""
    if reading(scene, model) is not None:
        return None
    material = solid(scene, scene.struck_body)
    return next(fem.half_space_fields(model, struck(scene), [contact], material))


def contact_of(
    scene: Scene,
    model: fem.Model,
    contact: fem.ContactPatch,
    field: fem.HalfSpaceField | None = None,
) -> rom.Contact:
    """The material that is struck, and the half-space that the Hertz law holds once more, whose
    field is computed where it is not handed in."""
    field, spot = field or half_space_at(scene, model, contact), contact.spot
    material = solid(scene, scene.struck_body)
    local = 0.0 if field is None else field.compliances([contact])[0]
    return surface_of(material, spot.inward, spot.radii)._replace(half_space=local)
