"""Every body meshed on its own, straight elements for quadratic shape functions.

Hexahedra for boxes, extruded outlines and tubes, tetrahedra for all else. Elements have the body's
seed, less where it is bent or thin, and grow away from fine points. Nodes on full cylinders are
moved out so that the facets enclose the cylinder's volume: chords alone make holes and pins too
small by 2 pi^2 / (3 n^2) for n edges around.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from skfem import Basis, Mesh

from geometry.assembly import InvalidGeometry
from geometry.foreseen import require_few
from geometry.gmsh_session import failing
from geometry.hexahedra import hexahedra
from geometry.imprint import RIM_ROOM, Disc, Patch, fitted, regions
from geometry.roundness import rimmed
from geometry.selectors import Selected
from geometry.sizes import Sizes
from geometry.solids import Body
from geometry.tetrahedra import tetrahedra
from geometry.touching import TouchingPair

DEFAULT = Sizes()


def body_meshes(
    bodies: Mapping[str, Body],
    touching: Sequence[TouchingPair] = (),
    *,
    gap: float,
    sizes: Sizes = DEFAULT,
    named: Mapping[str, Selected] | None = None,
    patches: Mapping[str, Patch] | None = None,
    element: str | None = None,
) -> dict[str, Mesh]:
    """A mesh for every body, in metres, to call in the bodies' ``with model(...)``, once.

    Its boundaries are the `named` faces and the `patches` of the body, and "a|b" where it touches
    another, under the same key in both. `element` "tet" takes tetrahedra for all. Raises
    InvalidGeometry for a seed that is too fine, ValueError, naming the body, for what gmsh cannot
    mesh.
    """
    for body in bodies.values():
        require_few(body, sizes.of(body))
    meshes = {}
    for name, body in bodies.items():
        size = sizes.of(body)
        with failing(f'"{name}" could not be meshed with elements of {size.seed:.3g} m'):
            fitting = fitted(body, patches or {}, gap, size.around)
            imprints = regions(body, touching, fitting, gap)
            order = (body, imprints, named or {}, size, gap)
            mesh = (None if element == "tet" else hexahedra(*order)) or tetrahedra(*order)

        # discs have their area again, which the polygon of their rim and its fitting took
        discs = {key: disc for key, disc in fitting.items() if isinstance(disc, Disc)}
        for key, disc in discs.items():
            _require_edges(mesh, key, disc, body, gap)
        for key, disc in discs.items():
            neighbours = [rim for rim in discs if rim != key]
            mesh = rimmed(mesh, key, patches[key], disc.radius, size.around, neighbours)
        meshes[name] = mesh
    return meshes


def _require_edges(mesh: Mesh, name: str, disc: Disc, body: Body, gap: float) -> None:
    """Raise InvalidGeometry where the rim of a disc, imprinted within the gap of an edge of its
    face, has bent that edge: a plane side beside it is plane no longer."""
    nodes = np.unique(mesh.facets[:, mesh.boundaries[name]])
    outer = mesh.facets[:, mesh.boundary_facets()]
    corners = mesh.p[:, outer[:, np.any(np.isin(outer, nodes), axis=0)]]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], axis=0)
    across /= np.linalg.norm(across, axis=0)

    # how far the facets at the disc are off the plane that they are nearly parallel to, 26 degrees
    planes = [face for face in body.faces if face.normal is not None]
    off = np.array(
        [
            np.where(
                np.abs(face.normal @ across) > 0.9,
                np.abs(np.tensordot(face.normal, corners, 1) - face.normal @ face.centre).max(0),
                np.inf,
            )
            for face in planes
        ]
    ).min(axis=0)
    # above rounding, and below the distance at which an intersection makes edges one
    if np.any((off > 1e-8) & (off < RIM_ROOM.merged * gap)):
        raise InvalidGeometry(
            f'"{name}": a washer of radius {disc.radius:.6g} m at '
            f"{np.round(disc.centre, 6).tolist()} m ends within {gap:g} m, the gap that faces may "
            f"touch across, of several edges of its face of {body.name}; make the washer 5 % "
            "larger or smaller."
        )


def facet_error(mesh: Mesh, body: Body) -> float:
    """Relative difference of the mesh's volume from the body's, which straight facets leave."""
    return float(Basis(mesh, mesh.elem(), intorder=3).dx.sum() / body.volume - 1)
