"""Straight facets that enclose the volume of the cylinder they stand for.

Nodes on the cylinder make facets that cut inside it. By Gauss, the volume between a surface and
the axis, per 2, is the flux of the radial vector rho; scaling all rho by s scales it by s^2:

    s = sqrt( sum r A / sum |rho . a| )        A of the faces, a of the facets (area vectors)
"""

from collections.abc import Sequence
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
from geometry.solids import SAME, Face, off_axis, parallel

AnyMesh = TypeVar("AnyMesh", bound=Mesh)
RIM = 1e-6  # relative distance from a disc's rim of the nodes on it
FLATTENED = 0.3  # of an element's volume at a corner: what moving a rim must leave of it
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


def rimmed(
    mesh: AnyMesh,
    name: str,
    disc: Disc,
    radius: float,
    edges: float = EDGES_AROUND,
    beside: Sequence[str] = (),
) -> AnyMesh:
    """The mesh with the rim of a disc, drawn with a `radius` of about so many `edges`, moved to
    where its polygon has the area of the circle of the disc's own radius.

    Nodes on an edge of the face or on discs `beside`, and those that would flatten an element, stay
    where they are: s_i = 1 there, and for all others the one s with

        sum s_i s_j sin(step_ij) = (disc.radius / radius)^2 sum step_ij

    over the edges that are not between two that stay. A disc that its face cuts off stays whole.
    """
    normal = disc.normal / np.linalg.norm(disc.normal)
    nodes = np.unique(mesh.facets[:, mesh.boundaries[name]])
    rho = mesh.p[:, nodes].T - disc.centre
    on_rim = np.abs(np.linalg.norm(rho, axis=1) - radius) < RIM * radius
    if not on_rim.any():
        return mesh
    nodes, rho = nodes[on_rim], rho[on_rim]
    angle = np.arctan2(np.cross(rho[0], rho) @ normal / radius, rho @ rho[0] / radius)
    nodes, rho, angle = (array[np.argsort(angle)] for array in (nodes, rho, angle))
    step = np.diff(angle, append=angle[:1] + 2 * pi)
    if step.max() > OPEN * 2 * pi / edges:
        return mesh

    outer = mesh.facets[:, mesh.boundary_facets()]
    height = normal @ mesh.p - normal @ mesh.p[:, nodes[0]]
    aside = outer[:, np.any(np.abs(height[outer]) > SAME, axis=0)]
    shared = [mesh.facets[:, mesh.boundaries[other]].ravel() for other in beside]
    free = ~np.isin(nodes, np.concatenate([aside.ravel(), *shared]))
    corners = mesh.elem().doflocs[: mesh.t.shape[0]].T
    before = mesh.mapping().detDF(corners)
    while free.any():
        ahead = np.roll(free, -1)
        a = np.sin(step[free & ahead]).sum()
        b = np.sin(step[free != ahead]).sum()
        area = (disc.radius / radius) ** 2 * step[free | ahead].sum()
        s = (np.sqrt(b**2 + 4 * a * area) - b) / (2 * a) if a else area / b
        p = mesh.p.copy()
        p[:, nodes[free]] += (s - 1) * rho[free].T
        moved = replace(mesh, doflocs=p)
        left = moved.mapping().detDF(corners) / before
        flattened = np.isin(nodes, mesh.t[:, np.any(left < FLATTENED, axis=1)]) & free
        if not flattened.any():
            return moved
        free &= ~flattened
    return mesh
