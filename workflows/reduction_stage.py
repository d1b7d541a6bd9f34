"""The assembly's model in few coordinates at the contact: how many, which, and what it carries."""

import numpy as np
from numpy.typing import NDArray

import fem
import rom
from workflows.assembly_stages import STRUCK, AssemblyModes, dashpots, material
from workflows.scene import Scene

TO_HZ = 20e3  # up to which an error of the reduction holds, unless the scene says
MOST_VALUES = 1.5e8  # of the constraint modes: 1.2 GB, some minutes
HELD_HZ = 0.1  # below, a wall floats for all that a chain notices
OPEN = 1.0  # [N/m] of a joint that holds nothing


def reduction(
    scene: Scene, model: fem.Model, contact: fem.ContactPatch, modes: AssemblyModes
) -> rom.ReducedModel:
    """The model in few coordinates at the contact, without the way back to the full field."""
    w_reading = reading(scene, model)
    aside = w_reading is not None and not scene.patch.nodes
    if aside and np.array_equal(w_reading, contact.w):
        raise ValueError(
            f'patch.weights = "thesis" would read the node that it pushes: patch.radius = '
            f"{scene.patch.radius} m ends nearer to it than to the next, with mesh.contact_seed = "
            f"{scene.mesh.contact_seed} m; raise the radius or refine the mesh."
        )
    hz = " ".join(f"{f:.9g}" for f in modes.field.frequency_hz)
    notes = {"hammer_modes_hz": hz, **provenance(scene, model, contact)}
    try:
        reduced = _reduced(scene, model, contact, modes, w_reading, notes)
    except rom.ReductionError:
        _require_held(scene, modes)
        raise
    captured = {"effective_mass_captured": f"{mass_captured(model, reduced):.9g}"}
    notes = reduced.provenance | captured | rigid_body(model)
    return reduced._replace(T=None, provenance=notes)


def _reduced(
    scene: Scene,
    model: fem.Model,
    contact: fem.ContactPatch,
    modes: AssemblyModes,
    w_reading,
    notes,
) -> rom.ReducedModel:
    asked = {**size(scene), "factorise": fem.factorised, "C": dashpots(scene, model)}
    if scene.reduction.kind == "craig-bampton":
        # w reads x alone: y and z of its nodes would only be constraint modes to solve for
        boundary = np.flatnonzero(contact.w if w_reading is None else contact.w + w_reading)
        if asked["C"] is not None:  # the modes answer slowly to the forces of dashpots
            boundary = np.union1d(boundary, np.flatnonzero(asked["C"].diagonal()))
        _require_room(scene, len(boundary), len(contact.w))
        notes |= reading_note(w_reading, boundary)
        ready = hammer_modes(modes) if asked["choice"] == "contact" else None
        return rom.craig_bampton(
            model.K, model.M, contact.w, boundary, **asked, modes=ready, provenance=notes
        )
    ready = _ready(scene, modes) if asked["choice"] == "lowest" else hammer_modes(modes)
    return rom.free_modes(model.K, model.M, contact.w, **asked, modes=ready, provenance=notes)


def _require_room(scene: Scene, n_boundary: int, n: int) -> None:
    """Raise ValueError where constraint modes (n, n_boundary) would not fit into memory."""
    if n_boundary * n > MOST_VALUES:
        raise ValueError(
            f"patch.radius = {scene.patch.radius} m holds {n_boundary} nodes of mesh.contact_seed "
            f"= {scene.mesh.contact_seed} m, whose constraint modes of {n} unknowns would take "
            f"{8e-9 * n_boundary * n:.1f} GB, allowed are {8e-9 * MOST_VALUES:.1f}; take a larger "
            'seed, a smaller patch, or reduction.kind = "free-modes".'
        )


def _require_held(scene: Scene, modes: AssemblyModes) -> None:
    """Raise ValueError with the keys to change where a reduction failed on parts that nothing
    holds."""
    lowest = modes.omega.min() / (2 * np.pi)
    if lowest > HELD_HZ:
        return
    keys = [(joint, key) for joint in ("head", "foot") for key in fem.DIRECTIONS]
    open_joints = [
        f"joints.{joint}.{key} = {k:g}"
        for joint, key in keys
        if scene.joints and (k := getattr(getattr(scene.joints, joint), key)) < OPEN
    ]
    loose = ", ".join(open_joints) or f"assembly.parts = {list(scene.assembly.parts)}"
    raise ValueError(
        f"the assembly, or a part of it, is not held: its lowest mode is at {lowest:.2g} Hz, with "
        f"{loose}. Constraint modes need what is held; hold it, or take reduction.kind = "
        '"free-modes".'
    )


def rigid_body(model: fem.Model) -> dict[str, str]:
    """Mass, centre and grounding of the parts, as a reduced model carries them in its file."""
    body = fem.rigid_body(model.structure)
    return {
        "mass_kg": f"{body.mass:.9g}",
        "centre_m": " ".join(f"{x:.6g}" for x in np.round(body.centre, 9) + 0.0),
        "grounding": f"{body.grounding:.3g}",
    }


def size(scene: Scene) -> dict:
    """How many modes, which, and up to what frequency."""
    table = scene.reduction
    choice = "lowest" if table.cutoff is not None else table.choice
    to_hz = table.to_hz or (TO_HZ if table.error or choice == "contact" else None)
    return {
        "n_modes": table.modes,
        "cutoff_hz": table.cutoff,
        "error": table.error,
        "to_hz": to_hz,
        "choice": choice,
    }


def hammer_modes(modes: AssemblyModes) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The modes of the hammer test, which stay whatever the contact says."""
    index = np.sort(modes.index[modes.index >= 0])
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
    if patch.weights != "thesis":
        return None
    y, z = patch.point
    beside = ((y - patch.radius, z), (y + patch.radius, z))
    return fem.node_patch(model, STRUCK, patch.nodes or beside).w


def reading_note(
    w_reading: NDArray[np.float64] | None, boundary: NDArray[np.int64]
) -> dict[str, str]:
    """The weights that read the boundary, as a reduced model carries them in its file."""
    if w_reading is None:
        return {}
    return {"reading_weights": " ".join(f"{w!r}" for w in w_reading[boundary].tolist())}


def mass_captured(model: fem.Model, reduced: rom.ReducedModel) -> float:
    """Share of the assembly's mass that the reduced model carries along the chain."""
    on_mesh = reduced._replace(T=model.T @ reduced.T)
    along_x = np.arange(model.T.shape[0]) % 3 == 0
    return rom.effective_mass(on_mesh, model.structure.M, along_x).captured


def provenance(scene: Scene, model: fem.Model, contact: fem.ContactPatch) -> dict[str, str]:
    """The patch, and the half-space within its compliance that the Hertz law holds once more."""
    local = 0.0  # the thesis reads far from the node it loads, and takes nothing off
    if scene.patch.weights != "thesis":
        steel = material(scene.assembly, "block")
        local = fem.half_space_on_mesh(model, STRUCK, contact, steel)
    return {
        "patch_weights": contact.weights,
        "patch_radius_m": repr(contact.radius),
        "half_space_compliance_m_per_N": repr(local),
    }
