"""The assembly's stages: mesh, joined model, modes, contact patch."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from skfem import Mesh

import fem
import fem.tuning
import geometry
import rom
from fem.assembly_modes import AssemblyModes, assembly_modes
from geometry.named_cells import faces
from workflows.files.mesh import mesh_of
from workflows.scene import InvalidScene, JointStiffnesses, Scene
from workflows.scene.assembly import assembly
from workflows.scene.size import too_large_mesh
from workflows.stages import bodies, rig, strike
from workflows.stages.parts import GMSH_NEEDS, STRIKE, Parts
from workflows.stages.rig import STRUCK
from workflows.stages.targets import targets


def mesh(scene: Scene, coarser: float = 1.0) -> Parts:
    """The bodies meshed, or the user's own mesh of the rig, and what joins and holds them; elements
    `coarser` times as large as the scene has them, but for those of a user."""
    if scene.is_general:
        return bodies.parts(scene, coarser)
    table, m, dimensions = scene.assembly, scene.mesh, assembly(scene.assembly)
    touching, held = geometry.interfaces(dimensions), held_faces(table)

    # the rig as one mesh: the user's own, or ours
    if m.file:
        whole = mesh_of(Path(m.file), dimensions, faces(touching, held, STRUCK))
        for sentence in too_large_mesh(scene, f"mesh.file = {m.file!r}", nodes(whole)):
            raise InvalidScene(sentence)
    else:
        seeds = {name: getattr(m, f"{name}seed") for name in ("", "block_", "support_", "contact_")}
        sizes = {f"{name}seed": size and coarser * size for name, size in seeds.items()}
        sizes["contact_point"] = scene.patch.point
        if m.element == "tet":
            try:
                from geometry.tet_mesh import tet_mesh  # loads gmsh, and that its shared libraries
            except OSError as missing:
                raise ValueError(
                    f"gmsh cannot start ({missing}); install its shared libraries (Debian: "
                    f'{GMSH_NEEDS}), or mesh with mesh.element = "hex".'
                ) from None
            whole = tet_mesh(dimensions, **sizes, coarser=coarser)
        else:
            whole = geometry.hex_mesh(dimensions, **sizes, glued=table.constraint == "full-tie")
    meshes = geometry.by_body(whole)

    # joints as the scene has them
    match table.constraint:
        case "full-tie":
            connections = rig.full_tie(touching, held)
        case "screw-tie":
            connections = rig.screw_tie(touching, held)
        case _:
            connections = rig.wires(touching, held, bushings(scene.springs))
    return Parts(meshes, materials(table, meshes), connections)


def nodes(mesh: Mesh) -> dict[str, float]:
    """Corners and middles of edges, by body as the cells are shared out."""
    per_cell = (mesh.nvertices + mesh.nedges) / mesh.nelements
    return {body: per_cell * len(cells) for body, cells in mesh.subdomains.items()}


def model(scene: Scene, mesh: Parts) -> fem.Model:
    """The parts assembled, joined and held; raises InvalidScene for bodies that nothing keeps."""
    structure = fem.assemble(mesh.meshes, mesh.materials)
    below = scene.table and fem.SwayingTable(scene.table.frequency, scene.table.mass)
    connections = mesh.connections._replace(table=below)
    if scene.is_general:
        _require_kept(scene, structure, connections)
    joined = fem.joined(structure, connections)
    if mesh.load is None:
        return joined
    try:
        return fem.prestressed(joined, mesh.materials, mesh.load)
    except ValueError as why:
        raise InvalidScene(f"{scene.name}: loads: {str(why).rstrip('.')}.") from None


def _require_kept(scene: Scene, structure: fem.Structure, connections: fem.Connections) -> None:
    """Raise InvalidScene for a body that can move. An assembly that floats may also move in the
    directions in which its joints are free, k = 0."""
    loose = fem.loose_bodies(structure, connections)
    if not loose:
        return
    body, motions = loose[0]
    moves = f'{scene.name}: "{body}" can still move along or about {", ".join(motions)}, which '
    k = {
        f"joints.{name}.{key}": getattr(joint, key)
        for name, joint in scene.springs.items()
        for key in fem.DIRECTIONS
    }
    free = [key for key, value in k.items() if value == 0]
    # free directions made rigid: a body that is held then is released by k = 0 alone
    closed = [
        joint._replace(springs=fem.Bushing(*(value or np.inf for value in joint.springs)))
        for joint in connections.joints
    ]
    if not free or fem.loose_bodies(structure, connections._replace(joints=closed)):
        raise InvalidScene(
            f"{moves}nothing keeps; tie it, bolt it, or hold a face of it. An assembly that floats "
            "says assembly.held = []."
        )
    if not scene.floats:
        raise InvalidScene(
            f"{moves}{' and '.join(f'{key} = 0' for key in free)} leaves free; give it a "
            "stiffness, or let the assembly float, assembly.held = []."
        )


def held_faces(table) -> tuple[str, ...]:
    """Faces that stand on the ground, or on the table."""
    under_washers = table.constraint == "screw-tie"
    return geometry.held_faces(assembly(table), fixing=table.fixing, under_washers=under_washers)


def materials(table, names) -> dict[str, fem.Material]:
    """What each body is made of: the assembly's material where its own table says nothing; both
    sheets are one part."""
    parts = {body: "sheets" if body.startswith(("sheet-", "sheet+")) else body for body in names}
    return {body: material(table, part) for body, part in parts.items()}


def material(table, part: str) -> fem.Material:
    """What a part is made of."""
    steel = table.made_of(part)
    return fem.Material(steel.young, steel.poisson, steel.density)


def solid(scene: Scene, body: str) -> fem.Material | fem.Orthotropic:
    """What a body of the scene is made of."""
    made_of = scene.made_of(body)
    return bodies.material(made_of) if scene.is_general else fem.Material(**made_of.model_dump())


def bushings(tables: Mapping[str, JointStiffnesses]) -> dict[str, fem.Bushing]:
    """Screw stiffnesses by joint."""
    return {
        joint: fem.Bushing(**{key: getattr(table, key) for key in fem.DIRECTIONS})
        for joint, table in tables.items()
    }


def dashpots(scene: Scene, model: fem.Model):
    """C of the dashpots in the joints; None where there are none."""
    tables = {joint: table.dashpots for joint, table in scene.springs.items()}
    named = {f"{joint}.{key}": c for joint, table in tables.items() for key, c in table.items()}
    return fem.dashpots(model, named) if named else None


def factor(scene: Scene, model: fem.Model) -> fem.Factor | None:
    """K's, for modes and reduction; None for an assembly that floats or nearly does."""
    return fem.held(model.K, model.M)


def modes(scene: Scene, model: fem.Model, space: rom.Space | None = None) -> AssemblyModes:
    """The lowest modes, the targets among them; from the assembly's Krylov space, where it has
    one."""
    known = None if space is None else fem.Modes(*space.modes)
    return assembly_modes(model, targets(scene, model), known=known)


def contact(scene: Scene, mesh: Parts, model: fem.Model) -> fem.ContactPatch:
    """The patch that loads and reads the body struck; of the thesis' scheme the node it loads."""
    if scene.is_general:
        if scene.strike is None:
            raise InvalidScene(
                f"{scene.name}: [strike] is missing, which says where the chain touches; add "
                'on = "body:+x".'
            )
        return strike.patch(scene, mesh, model)
    patch = scene.patch
    if patch.weights == "thesis":
        return fem.node_patch(model, STRUCK, [patch.point])
    if patch.nodes:
        return fem.node_patch(model, STRUCK, patch.nodes)
    return fem.contact_patch(model, STRUCK, patch.point, patch.radius, weights=patch.weights)


def participation(
    scene: Scene, contact: fem.ContactPatch, modes: AssemblyModes
) -> NDArray[np.float64]:
    """|w^T phi| (k,) [kg^-1/2] of the modes at the contact."""
    return np.abs(contact.w @ modes.phi)


def struck(scene: Scene) -> str:
    """The face that the chain leans on, as the mesh names it."""
    return f"{scene.struck_body}:{STRIKE}" if scene.is_general else STRUCK


def tuning_basis(scene: Scene, model: fem.Model) -> fem.tuning.TuningBasis:
    """The assembly projected on the shapes that joints can move."""
    return fem.tuning.tuning_basis(model, targets(scene, model))
