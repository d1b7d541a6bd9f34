"""The assembly's model in few coordinates at the contact: how many, which, and what it carries."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import fem
import rom
from fem.assembly_modes import AssemblyModes
from rom.jointed import Jointed
from workflows.scene import Scene
from workflows.stages.assembly import dashpots, solid, struck
from workflows.stages.strike import surface_of

TO_HZ = 20e3  # up to which an error of the reduction holds, unless the scene says
MOST_VALUES = 1.5e8  # of the constraint modes: 1.2 GB, some minutes
HELD_HZ = 0.1  # below, a wall floats for all that a chain notices
OPEN = 1.0  # [N/m] of a joint that holds nothing
NOTHING = np.empty(0, np.int64)


class SecondModel(NamedTuple):
    """The reduced model of another mesh, and how much of its difference is the run's error."""

    reduced: rom.ReducedModel
    left: float


def jointed(
    scene: Scene, model: fem.Model, contact: fem.ContactPatch, modes: AssemblyModes
) -> Jointed:
    """The reduction of many assemblies that differ in the springs of their joints."""
    C = dashpots(scene, model)
    boundary = boundary_of(contact, reading(scene, model), C, model.elongation)
    reduced = reduction(scene, model, contact, modes, keep=model.elongation)
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
    *,
    keep: NDArray[np.int64] = NOTHING,
) -> rom.ReducedModel:
    """The model in few coordinates at the contact, with the way back to the outer nodes alone.

    The factor is that of K, where it is held. `keep` are further dofs that stay as they are.
    """
    w_reading = reading(scene, model)
    _require_other_nodes(scene, contact, w_reading)
    try:
        with fem.one_thread():
            reduced = _reduced(scene, model, contact, modes, w_reading, keep, factor)
    except rom.ReductionError:
        _require_held(scene, modes)
        raise
    known = contact_of(scene, model, contact)._replace(
        weights_read=None if w_reading is None else w_reading @ reduced.T,
        modes_hz=tuple(modes.paired_hz.values()) or None,
        point=tuple(contact.spot.point.tolist()),
        direction=tuple(contact.spot.inward.tolist()),
    )
    boundary = boundary_of(contact, w_reading, dashpots(scene, model), keep)
    outer = fem.outer_nodes(model.structure)
    T = (model.T[outer.dofs.ravel()] @ reduced.T).astype(np.float32)
    return reduced._replace(
        T=None,
        notes={"patch_weights": contact.weights, "patch_radius_m": repr(contact.radius)},
        surface=rom.Surface(outer.points, outer.faces, T, outer.body, tuple(model.structure.basis)),
        coordinates=names(model, boundary, reduced),
        contact=known,
        mass=mass_properties(model, reduced, contact.spot.inward),
        finer=reduced.finer._replace(contact=known._replace(weights_read=None)),
    )


def _require_other_nodes(scene: Scene, contact: fem.ContactPatch, w_reading) -> None:
    """Raise ValueError where the thesis' scheme would read the node that it pushes."""
    aside = w_reading is not None and not scene.patch.nodes
    if aside and np.array_equal(w_reading, contact.w):
        raise ValueError(
            f'patch.weights = "thesis" would read the node that it pushes: patch.radius = '
            f"{scene.patch.radius} m ends nearer to it than to the next, with mesh.contact_seed = "
            f"{scene.mesh.contact_seed} m; raise the radius or refine the mesh."
        )


def _reduced(
    scene: Scene, model: fem.Model, contact: fem.ContactPatch, modes: AssemblyModes, w_reading,
    keep: NDArray[np.int64], factor: fem.Factor | None,
) -> rom.ReducedModel:  # fmt: skip
    asked, solver = selection(scene), {"factorise": fem.factorised, "factor": factor}
    C = dashpots(scene, model)
    ready = targets_kept(modes) if asked.by_contact else None
    if scene.reduction.kind == "craig-bampton":
        boundary = boundary_of(contact, w_reading, C, keep)
        _require_room(contact, len(boundary), len(contact.w))
        asked, matrices = asked._replace(modes=ready), (model.K, model.M, contact.w, boundary)
        return rom.craig_bampton(*matrices, asked, C=C, **solver)
    # modes that are there are kept in any case, which those that the contact chooses among are not
    asked = asked._replace(modes=ready if asked.by_contact else ready or _ready(scene, modes))
    return rom.free_modes(model.K, model.M, contact.w, asked, C=C, **solver)


def boundary_of(
    contact: fem.ContactPatch, w_reading, C, keep: NDArray[np.int64] = NOTHING
) -> NDArray[np.int64]:
    """Dofs (b,) that a Craig-Bampton model keeps as they are."""
    # w reads x alone: y and z of its nodes would only be constraint modes to solve for
    boundary = np.flatnonzero(contact.w if w_reading is None else contact.w + w_reading)
    damped = NOTHING if C is None else np.flatnonzero(C.diagonal())  # modes answer slowly to it
    return np.union1d(boundary, np.union1d(damped, keep))


def names(
    model: fem.Model, boundary: NDArray[np.int64], reduced: rom.ReducedModel
) -> tuple[str, ...]:
    """What each coordinate is: displacements of the boundary, then amplitudes of shapes."""
    kept = [_place(model, dof) for dof in model.free[boundary[: reduced.n_boundary]]]
    shapes = range(1, len(reduced.w) - reduced.n_boundary + 1)
    return (*kept, *(f"amplitude of shape {j}" for j in shapes))


def _place(model: fem.Model, dof: int) -> str:
    if dof >= model.structure.n_dofs:
        return "elongation of a joint"
    x, y, z = model.structure.points[dof // 3]
    return f"u_{'xyz'[dof % 3]} at x = {x:.6g}, y = {y:.6g}, z = {z:.6g} m"


def _require_room(contact: fem.ContactPatch, n_boundary: int, n: int) -> None:
    """Raise ValueError where constraint modes (n, n_boundary) would not fit into memory."""
    if n_boundary * n > MOST_VALUES:
        raise ValueError(
            f"the patch of radius = {contact.radius:g} m holds {n_boundary} nodes of the mesh, "
            f"whose constraint modes of {n} unknowns would take "
            f"{8e-9 * n_boundary * n:.1f} GB, allowed are {8e-9 * MOST_VALUES:.1f}; take a larger "
            'seed, a smaller patch, or reduction.kind = "free-modes".'
        )


def _require_held(scene: Scene, modes: AssemblyModes) -> None:
    """Raise ValueError with the keys to change where a reduction failed on parts that nothing
    holds."""
    lowest = modes.omega.min() / (2 * np.pi)
    if lowest > HELD_HZ:
        return
    springs = scene.springs.items()
    open_joints = [
        f"joints.{joint}.{key} = {k:g}"
        for joint, table in springs
        for key in fem.DIRECTIONS
        if (k := getattr(table, key)) < OPEN
    ]
    key = "held" if scene.is_general else "parts"
    given = list(getattr(scene.assembly, key) or ())
    loose = ", ".join(open_joints) or f"assembly.{key} = {given}"
    raise ValueError(
        f"the assembly, or a part of it, is not held: its lowest mode is below {HELD_HZ:g} Hz, "
        f"with {loose}. Constraint modes need what is held; hold it, or take reduction.kind = "
        '"free-modes".'
    )


def mass_properties(
    model: fem.Model, reduced: rom.ReducedModel, along: NDArray[np.float64]
) -> rom.MassProperties:
    """Of the parts, and the share of their mass that the reduced model carries along the chain."""
    body = fem.rigid_body(model.structure)
    centre = tuple((np.round(body.centre, 9) + 0.0).tolist())  # no rounding, no minus zero
    return rom.MassProperties(
        body.mass, centre, body.grounding, mass_captured(model, reduced, along)
    )


def selection(scene: Scene) -> rom.Selection:
    """How many modes, which, and up to what frequency."""
    table = scene.reduction
    choice = "lowest" if table.cutoff is not None else table.choice
    to_hz = table.to_hz or (TO_HZ if table.error or choice == "contact" else None)
    return rom.Selection(
        table.modes, table.cutoff, table.error, to_hz=to_hz, choice=choice, finer_hz=TO_HZ
    )


def targets_kept(
    modes: AssemblyModes,
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """The modes measured, which stay whatever the contact says."""
    # a motion that nothing holds may bear two of the characters that the modes are found by
    index = np.unique(modes.index[modes.index >= 0])
    if not len(modes.index):
        return None
    return modes.omega[index], modes.phi[:, index]


def _ready(
    scene: Scene, modes: AssemblyModes
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """The modes that are there, where they are enough."""
    table, found = scene.reduction, len(modes.omega)
    below = table.cutoff is not None and 2 * np.pi * table.cutoff < modes.omega[-1]
    enough = below or (table.modes is not None and table.modes <= found)
    return (modes.omega, modes.phi) if enough else None


def reading(scene: Scene, model: fem.Model) -> NDArray[np.float64] | None:
    """w (n,) that reads the wall where the thesis' scheme does so elsewhere than it pushes."""
    patch = scene.patch
    if patch is None or patch.weights != "thesis":
        return None
    y, z = patch.point
    beside = ((y - patch.radius, z), (y + patch.radius, z))
    return fem.node_patch(model, struck(scene), patch.nodes or beside).w


def mass_captured(model: fem.Model, reduced: rom.ReducedModel, along: NDArray[np.float64]) -> float:
    """Share of the assembly's mass that the reduced model carries along a direction (3,)."""
    motion = np.tile(along, model.T.shape[0] // 3)
    return rom.effective_mass(reduced, model.structure.M, motion, model.T).captured


def contact_of(scene: Scene, model: fem.Model, contact: fem.ContactPatch) -> rom.Contact:
    """The material that is struck, and the half-space that the Hertz law holds once more."""
    steel = solid(scene, scene.struck_body)
    if reading(scene, model) is not None:  # reads far from the node it loads, and takes nothing off
        local = 0.0
    else:
        local = fem.half_space_on_mesh(model, struck(scene), contact, steel)
    spot = contact.spot
    return surface_of(steel, spot.inward, spot.radii)._replace(half_space=local)
