"""The assembly's stages: mesh, joined model, modes, contact patch, reduction."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from skfem import Mesh

import fem
import geometry
import rom
from workflows import mesh_file
from workflows.assembly_table import assembly
from workflows.field_file import ModeField
from workflows.scene import Joints, JointStiffnesses, Scene

N_MODES = (30, 80)  # the second where the first do not reach all four of the hammer test
GMSH_NEEDS = (
    "apt-get install libgl1 libglu1-mesa libgomp1 libxcursor1 libxft2 libxinerama1 libxrender1"
)
TO_HZ = 20e3  # up to which an error of the reduction holds, unless the scene says
STRUCK = "block:+x"  # the face that the chain leans on
MASTER = {"block": "head", "sheets_support": "foot"}  # body a sheet is bolted to: joint


class AssemblyModes(NamedTuple):
    """Modes of the joined assembly, and which of them are those of the hammer test."""

    omega: NDArray[np.float64]  # (k,) [rad/s]
    phi: NDArray[np.float64]  # (n, k) mass-normalised
    index: NDArray[np.int64]  # (4,) -1 where none fits
    score: NDArray[np.float64]  # (4,)
    n_dofs: int
    field: ModeField  # the paired modes on the mesh


def mesh(scene: Scene) -> Mesh:
    """The parts, meshed, or the user's own mesh of them."""
    m = scene.mesh
    if m.file:
        parts = assembly(scene.assembly)
        named = mesh_file.faces(geometry.interfaces(parts), held_faces(scene.assembly), STRUCK)
        return mesh_file.mesh_of(Path(m.file), parts, named)
    return _mesher(m.element)(
        assembly(scene.assembly),
        seed=m.seed,
        block_seed=m.block_seed,
        support_seed=m.support_seed,
        contact_seed=m.contact_seed,
        contact_point=scene.patch.point,
    )


def _mesher(element: str):
    if element == "hex":
        return geometry.hex_mesh
    try:
        from geometry.tet_mesh import tet_mesh  # loads gmsh, and that its shared libraries
    except OSError as missing:
        raise ValueError(
            f"gmsh cannot start ({missing}); install its shared libraries (Debian: {GMSH_NEEDS}), "
            'or mesh with mesh.element = "hex".'
        ) from None
    return tet_mesh


def model(scene: Scene, mesh: Mesh) -> fem.Model:
    """The parts assembled, joined and held."""
    table = scene.assembly
    parts = assembly(table)
    structure = fem.assemble(mesh, materials(table, mesh.subdomains))
    touching, held = geometry.interfaces(parts), held_faces(table)
    below = scene.table and fem.Table(scene.table.frequency, scene.table.mass)
    match table.constraint:
        case "full-tie":
            return fem.full_tie(structure, touching, held, table=below)
        case "screw-tie":
            return fem.screw_tie(structure, touching, held, table=below)
    return fem.wires(structure, touching, held, joints(scene.joints), table=below)


def held_faces(table) -> tuple[str, ...]:
    """Faces that stand on the ground, or on the table."""
    under_washers = table.constraint == "screw-tie"
    return geometry.held_faces(assembly(table), fixing=table.fixing, under_washers=under_washers)


def materials(table, bodies) -> dict[str, fem.Material]:
    """What each body is made of: the assembly's material where its own table says nothing."""
    return {body: material(table, _part(body)) for body in bodies}


def material(table, part: str) -> fem.Material:
    """What a part is made of."""
    own = getattr(table, part) or table
    return fem.Material(
        own.young or table.young,
        table.poisson if own.poisson is None else own.poisson,
        own.density or table.density,
    )


def _part(body: str) -> str:
    return "sheets" if body.startswith("sheet-") or body.startswith("sheet+") else body


def joints(table: Joints) -> dict[str, fem.Joint]:
    """Screw stiffnesses by the body that the sheets are bolted to."""
    return {body: _joint(getattr(table, joint)) for body, joint in MASTER.items()}


def _joint(stiffness: JointStiffnesses) -> fem.Joint:
    return fem.Joint(**{key: getattr(stiffness, key) for key in fem.DIRECTIONS})


def dashpots(scene: Scene, model: fem.Model):
    """C of the dashpots in the joints; None where there are none."""
    if scene.joints is None:
        return None
    tables = {body: getattr(scene.joints, joint).dashpots for body, joint in MASTER.items()}
    named = {f"{body}.{key}": c for body, table in tables.items() for key, c in table.items()}
    return fem.dashpots(model, named) if named else None


def modes(scene: Scene, model: fem.Model) -> AssemblyModes:
    """The lowest modes, those of the hammer test found by shape."""
    for n_modes in N_MODES:
        found = fem.modes(model.K, model.M, n_modes)
        paired = fem.pair(model, found)
        if np.all(paired.index >= 0):
            break
    return AssemblyModes(
        found.omega,
        found.phi,
        paired.index,
        paired.score,
        model.M.shape[0],
        _field(model, found, paired),
    )


def _field(model: fem.Model, found: fem.Modes, paired: fem.Pairing) -> ModeField:
    number = np.flatnonzero(paired.index >= 0) + 1
    index = paired.index[number - 1]
    mesh, basis = model.structure.basis.mesh, model.structure.basis
    u = model.T @ found.phi[:, index]
    body = np.zeros(mesh.nelements, dtype=np.int32)
    for i, cells in enumerate(mesh.subdomains.values()):
        body[cells] = i
    return ModeField(
        mesh,
        body,
        tuple(mesh.subdomains),
        number,
        found.frequency_hz[index],
        np.array([u[basis.nodal_dofs, j].T for j in range(len(index))]),
    )


def contact(scene: Scene, model: fem.Model) -> fem.ContactPatch:
    """The patch that loads and reads the block; of the thesis' scheme the node it loads."""
    patch = scene.patch
    if patch.weights == "thesis":
        return fem.node_patch(model, STRUCK, [patch.point])
    if patch.nodes:
        return fem.node_patch(model, STRUCK, patch.nodes)
    return fem.contact_patch(model, STRUCK, patch.point, patch.radius, weights=patch.weights)


def reduction(
    scene: Scene, model: fem.Model, contact: fem.ContactPatch, modes: AssemblyModes
) -> rom.ReducedModel:
    """The model in few coordinates at the contact, without the way back to the full field."""
    w_reading = reading(scene, model)
    hz = " ".join(f"{f:.9g}" for f in modes.field.frequency_hz)
    notes = {"hammer_modes_hz": hz, **provenance(scene, model, contact)}
    asked = {**size(scene), "factorise": fem.factorised, "C": dashpots(scene, model)}
    if scene.reduction.kind == "craig-bampton":
        # w reads x alone: y and z of its nodes would only be constraint modes to solve for
        boundary = np.flatnonzero(contact.w if w_reading is None else contact.w + w_reading)
        if asked["C"] is not None:  # the modes answer slowly to the forces of dashpots
            boundary = np.union1d(boundary, np.flatnonzero(asked["C"].diagonal()))
        notes |= reading_note(w_reading, boundary)
        ready = hammer_modes(modes) if asked["choice"] == "contact" else None
        reduced = rom.craig_bampton(
            model.K, model.M, contact.w, boundary, **asked, modes=ready, provenance=notes
        )
    else:
        ready = _ready(scene, modes) if asked["choice"] == "lowest" else hammer_modes(modes)
        reduced = rom.free_modes(
            model.K, model.M, contact.w, **asked, modes=ready, provenance=notes
        )
    captured = {"effective_mass_captured": f"{mass_captured(model, reduced):.9g}"}
    notes = reduced.provenance | captured | rigid_body(model)
    return reduced._replace(T=None, provenance=notes)


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
