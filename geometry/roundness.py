"""Straight facets that enclose the volume of the cylinder they stand for.

Nodes on the cylinder make facets that cut inside it. By Gauss, the volume between a surface and
the axis, per 2, is the flux of the radial vector rho; scaling all rho by s scales it by s^2:

    s = sqrt( sum r A / sum |rho . a| )        A of the faces, a of the facets (area vectors)
"""

from dataclasses import replace
from math import pi
from typing import NamedTuple, TypeVar

import gmsh
import numpy as np
from numpy.typing import NDArray
from skfem import Mesh

from geometry.cad import face_of
from geometry.gmsh_session import EDGES_AROUND
from geometry.imprint import Disc
from geometry.solids import Face, off_axis, parallel

AnyMesh = TypeVar("AnyMesh", bound=Mesh)
RIM = 1e-6  # relative distance from a disc's rim of the nodes on it
OPEN = 1.5  # of the usual edge: a longer one is where a face cuts the disc off


class Round(NamedTuple):
    """Faces that make up a cylinder, bounded by planes across its axis."""

    faces: tuple[Face, ...]


def full_cylinders(volume: int, gap: float) -> list[Round]:
    """Cylinders of a body whose nodes may move out without leaving the faces beside them.

    A face that a partner imprinted may have the partner's surface, off by the gap [m], and point
    the other way.
    """
    boundary = [tag for _, tag in gmsh.model.getBoundary([(3, volume)], oriented=False)]
    faces = {tag: face_of(tag) for tag in boundary}
    groups: list[list[Face]] = []
    for face in (f for f in faces.values() if f.axis is not None):
        home = [g for g in groups if _coaxial(g[0], face, 2 * gap)]
        home[0].append(face) if home else groups.append([face])
    return [Round(tuple(g)) for g in groups if _between_planes(g, faces)]


def _coaxial(one: Face, other: Face, within: float) -> bool:
    return (
        parallel(one.axis, other.axis)
        and abs(one.radius - other.radius) <= within
        and off_axis(other.on_axis, one.on_axis, one.axis) <= within
    )


def _between_planes(group: list[Face], faces: dict[int, Face]) -> bool:
    own = {face.tag for face in group}
    edges = {edge for tag in own for edge in gmsh.model.getAdjacencies(2, tag)[1]}
    beside = {tag for edge in edges for tag in gmsh.model.getAdjacencies(1, edge)[0]} - own
    normals = [faces[tag].normal if tag in faces else None for tag in beside]
    return all(n is not None and parallel(n, group[0].axis) for n in normals)


def enclosing(
    p: NDArray[np.float64], corners: dict[int, NDArray[np.int64]], cylinders: list[Round]
) -> NDArray[np.float64]:
    """Points (n, 3) with the nodes on cylinders moved out; corners (m, 3) of the facets by face."""
    moved = p.copy()
    for cylinder in cylinders:
        facets = np.concatenate([corners[face.tag] for face in cylinder.faces])
        nodes = np.unique(facets)
        first = cylinder.faces[0]
        rho = p - first.on_axis
        rho -= np.outer(rho @ first.axis, first.axis)
        exact = sum(face.radius * face.area for face in cylinder.faces)
        scale = np.sqrt(exact / _flux(p, rho, facets))
        moved[nodes] += (scale - 1) * rho[nodes]
    return moved


def _flux(p, rho, facets) -> float:
    a, b, c = (p[facets[:, i]] for i in range(3))
    area = np.cross(b - a, c - a) / 2
    return float(np.sum(abs(np.sum(rho[facets].mean(axis=1) * area, axis=1))))


def rimmed(mesh: AnyMesh, name: str, disc: Disc, edges: float = EDGES_AROUND) -> AnyMesh:
    """The mesh with the rim of a disc moved out, so that its polygon of about so many `edges`
    has the circle's area.

    A disc that its face cuts off stays as it is.
    """
    nodes = np.unique(mesh.facets[:, mesh.boundaries[name]])
    rho = mesh.p[:, nodes].T - disc.centre
    rim = np.abs(np.linalg.norm(rho, axis=1) - disc.radius) < RIM * disc.radius
    u = rho[rim][0] / np.linalg.norm(rho[rim][0]) if rim.any() else np.eye(3)[0]
    v = np.cross(disc.normal / np.linalg.norm(disc.normal), u)
    angle = np.sort(np.arctan2(rho[rim] @ v, rho[rim] @ u))
    steps = np.diff(angle, append=angle[:1] + 2 * pi)
    if not len(steps) or steps.max() > OPEN * 2 * pi / edges:
        return mesh
    p = mesh.p.copy()
    p[:, nodes[rim]] += (np.sqrt(2 * pi / np.sin(steps).sum()) - 1) * rho[rim].T
    return replace(mesh, doflocs=p)
