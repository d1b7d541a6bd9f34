"""Triangles of the faces of bodies, to look at."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from skfem import MeshTri

from beadwave.geometry.cad.solids import Body
from beadwave.geometry.own_mesh.facets import triangles

if TYPE_CHECKING:
    from beadwave.geometry.own_mesh.mesh_bodies import OwnMesh

ACROSS = 12.0  # triangles along the diagonal of a body, curved faces have more; chosen by eye


def drawn_face_triangles(bodies: Iterable[Body]) -> dict[int, NDArray[np.float64]]:
    """Corners (n, 3, 3) [m] of the triangles of each face, by its tag.

    To be called in the bodies' ``with model(...)``, before touching bodies split each other's
    faces; a mesh that the model holds is cleared.
    """
    import gmsh

    from beadwave.geometry.meshing.gmsh_session import EDGES_AROUND, mesh_options
    from beadwave.geometry.meshing.sizes import FINEST_AT_APEX, bounded_at_apices, circle_radii

    bodies = list(bodies)
    gmsh.model.mesh.clear()
    largest = max(float(np.linalg.norm(body.upper - body.lower)) for body in bodies)
    size = largest / ACROSS
    faces = [face.tag for body in bodies for face in body.faces]
    on_circles = [2 * np.pi * r / EDGES_AROUND for r in circle_radii(faces).values()]
    finest = min([FINEST_AT_APEX * size, *on_circles])
    with mesh_options({"MeshSizeMax": size, **bounded_at_apices(faces, finest)}):
        gmsh.model.mesh.generate(2)
    # of all faces: a node on the seam of a round face may be listed with another face alone
    nodes, points, _ = gmsh.model.mesh.getNodes()
    place = dict(zip(nodes.tolist(), points.reshape(-1, 3), strict=True))
    corners_of = {}
    for face in (face for body in bodies for face in body.faces):
        _, nodes_of = gmsh.model.mesh.getElementsByType(2, face.tag)  # type 2: triangles
        corners_of[face.tag] = np.array([place[n] for n in nodes_of.tolist()]).reshape(-1, 3, 3)
    gmsh.model.mesh.clear()
    return corners_of


def own_face_triangles(own: OwnMesh) -> dict[str, dict[int, NDArray[np.float64]]]:
    """Corners (n, 3, 3) [m] of the faces of a user's mesh, by body and by the tag of the face;
    quadrilaterals are halved, which needs no kernel."""
    corners_of: dict[str, dict[int, NDArray[np.float64]]] = {}
    for name, skin in own.skins.items():
        n, width = skin.corners.shape[:2]
        at = np.arange(n * width).reshape(n, width)
        corners = skin.corners.reshape(-1, 3)[at if width == 3 else triangles(at)]
        tag = skin.tag if width == 3 else np.tile(skin.tag, 2)
        corners_of[name] = {int(label): corners[tag == label] for label in np.unique(tag)}
    return corners_of


def surface(triangles: Mapping[int, NDArray[np.float64]]) -> MeshTri:
    """The triangles (n, 3, 3) [m] of a body's faces as one mesh in space, in which nodes within a
    nanometre are one."""
    corners = np.concatenate([*triangles.values()]).reshape(-1, 3)
    points, cells = np.unique(corners.round(9), axis=0, return_inverse=True)
    # unsorted: the order of a triangle's corners says on which side it is seen
    p, t = np.ascontiguousarray(points.T), np.ascontiguousarray(cells.reshape(-1, 3).T)
    return MeshTri(p, t, sort_t=False)
