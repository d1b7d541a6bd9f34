"""The assembly's stages: mesh, joined model, modes, contact patch."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from skfem import Mesh

import fem
import fem.tuning
import geometry
from workflows.files import mesh as mesh_file
from workflows.files.mode_field import ModeField
from workflows.pipeline import rig
from workflows.pipeline.rig import STRUCK
from workflows.scene import InvalidScene, Joints, JointStiffnesses, Scene
from workflows.scene.assembly import assembly
from workflows.scene.size import too_large_file

N_MODES = (30, 80)  # the second where the first do not reach all four of the hammer test
GMSH_NEEDS = (
    "apt-get install libgl1 libglu1-mesa libgomp1 libxcursor1 libxft2 libxinerama1 libxrender1"
)
JOINTS = ("head", "foot")


class AssemblyModes(NamedTuple):
    """Modes of the joined assembly, and which of them are those of the hammer test."""

    omega: NDArray[np.float64]  # (k,) [rad/s]
    phi: NDArray[np.float64]  # (n, k) mass-normalised
    index: NDArray[np.int64]  # (4,) -1 where none fits
    score: NDArray[np.float64]  # (4,)
    n_dofs: int
    field: ModeField  # the paired modes on the mesh

    @property
    def paired_hz(self) -> dict[str, float]:
        """Frequencies of the hammer-test modes that were found, by their number."""
        hz = self.omega / (2 * np.pi)
        return {str(i + 1): float(hz[j]) for i, j in enumerate(self.index) if j >= 0}


def mesh(scene: Scene) -> dict[str, Mesh]:
    """The parts, meshed, or the user's own mesh of them."""
    return geometry.by_body(_whole(scene))


def _whole(scene: Scene) -> Mesh:
    m = scene.mesh
    if m.file:
        parts = assembly(scene.assembly)
        named = mesh_file.faces(geometry.interfaces(parts), held_faces(scene.assembly), STRUCK)
        own = mesh_file.mesh_of(Path(m.file), parts, named)
        for sentence in too_large_file(scene, _nodes(own)):
            raise InvalidScene(sentence)
        return own
    parts = assembly(scene.assembly)
    sizes = {
        "seed": m.seed,
        "block_seed": m.block_seed,
        "support_seed": m.support_seed,
        "contact_seed": m.contact_seed,
        "contact_point": scene.patch.point,
    }
    if m.element == "tet":
        return _tet_mesher()(parts, **sizes)
    return geometry.hex_mesh(parts, **sizes, glued=scene.assembly.constraint == "full-tie")


def _nodes(mesh: Mesh) -> dict[str, float]:
    """Corners and middles of edges, by body as the cells are shared out."""
    each = (mesh.nvertices + mesh.nedges) / mesh.nelements
    return {body: each * len(cells) for body, cells in mesh.subdomains.items()}


def _tet_mesher():
    try:
        from geometry.tet_mesh import tet_mesh  # loads gmsh, and that its shared libraries
    except OSError as missing:
        raise ValueError(
            f"gmsh cannot start ({missing}); install its shared libraries (Debian: {GMSH_NEEDS}), "
            'or mesh with mesh.element = "hex".'
        ) from None
    return tet_mesh


def model(scene: Scene, mesh: dict[str, Mesh]) -> fem.Model:
    """The parts assembled, joined and held."""
    table = scene.assembly
    parts = assembly(table)
    structure = fem.assemble(mesh, materials(table, mesh))
    touching, held = geometry.interfaces(parts), held_faces(table)
    match table.constraint:
        case "full-tie":
            how = rig.full_tie(touching, held)
        case "screw-tie":
            how = rig.screw_tie(touching, held)
        case _:
            how = rig.wires(touching, held, bushings(scene.joints))
    below = scene.table and fem.Table(scene.table.frequency, scene.table.mass)
    return fem.joined(structure, how._replace(table=below))


def held_faces(table) -> tuple[str, ...]:
    """Faces that stand on the ground, or on the table."""
    under_washers = table.constraint == "screw-tie"
    return geometry.held_faces(assembly(table), fixing=table.fixing, under_washers=under_washers)


def materials(table, bodies) -> dict[str, fem.Material]:
    """What each body is made of: the assembly's material where its own table says nothing."""
    return {body: material(table, _part(body)) for body in bodies}


def material(table, part: str) -> fem.Material:
    """What a part is made of."""
    steel = table.made_of(part)
    return fem.Material(steel.young, steel.poisson, steel.density)


def _part(body: str) -> str:
    return "sheets" if body.startswith("sheet-") or body.startswith("sheet+") else body


def bushings(table: Joints) -> dict[str, fem.Bushing]:
    """Screw stiffnesses by joint."""
    return {joint: _bushing(getattr(table, joint)) for joint in JOINTS}


def _bushing(stiffness: JointStiffnesses) -> fem.Bushing:
    return fem.Bushing(**{key: getattr(stiffness, key) for key in fem.DIRECTIONS})


def dashpots(scene: Scene, model: fem.Model):
    """C of the dashpots in the joints; None where there are none."""
    if scene.joints is None:
        return None
    tables = {joint: getattr(scene.joints, joint).dashpots for joint in JOINTS}
    named = {f"{joint}.{key}": c for joint, table in tables.items() for key, c in table.items()}
    return fem.dashpots(model, named) if named else None


def modes(scene: Scene, model: fem.Model) -> AssemblyModes:
    """The lowest modes, those of the hammer test found by shape."""
    for n_modes in N_MODES:
        found = fem.modes(model.K, model.M, n_modes)
        paired = fem.pair(model, found, rig.TARGETS)
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
    structure = model.structure
    u = model.T @ found.phi[:, index]
    corners = [structure.first[body] + b.nodal_dofs.T for body, b in structure.basis.items()]
    return ModeField(
        {body: basis.mesh for body, basis in structure.basis.items()},
        number,
        found.frequency_hz[index],
        np.moveaxis(u[np.concatenate(corners)], 2, 0),
    )


def contact(scene: Scene, model: fem.Model) -> fem.ContactPatch:
    """The patch that loads and reads the block; of the thesis' scheme the node it loads."""
    patch = scene.patch
    if patch.weights == "thesis":
        return fem.node_patch(model, STRUCK, [patch.point])
    if patch.nodes:
        return fem.node_patch(model, STRUCK, patch.nodes)
    return fem.contact_patch(model, STRUCK, patch.point, patch.radius, weights=patch.weights)


def tuning_basis(scene: Scene, model: fem.Model) -> fem.tuning.TuningBasis:
    """The assembly projected on the shapes that joints can move."""
    return fem.tuning.tuning_basis(model, rig.TARGETS)
