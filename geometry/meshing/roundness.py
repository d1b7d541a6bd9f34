"""Straight facets that enclose the volume of the cylinder they stand for.

Facets between nodes on a cylinder cut inside it and lose volume. By Gauss' theorem twice the volume
between a surface and the axis is the flux of the radial vector rho through the surface, since
div rho = 2. Moving all nodes to s rho multiplies it by s^2; equal volumes need

    s = sqrt( sum r A / sum |rho . a| )        A of the faces, a of the facets (area vectors)
"""

from collections.abc import Sequence
from dataclasses import replace
from math import pi
from typing import TypeVar

import gmsh
import numpy as np
from numpy.typing import NDArray
from skfem import Mesh

from beadwave.geometry.cad.occ import face_of
from beadwave.geometry.cad.patches import Disc
from beadwave.geometry.cad.solids import SAME, Face, of_one_cylinder, parallel
from beadwave.geometry.meshing.gmsh_session import EDGES_AROUND

AnyMesh = TypeVar("AnyMesh", bound=Mesh)


RIM_TOLERANCE = 1e-6  # of the radius: distance from a disc's rim of the nodes on it
# of an element's volume at a corner: what moving a rim must leave of it
MIN_CORNER_VOLUME = 0.3
OPEN_EDGE = 1.5  # of the usual edge: a longer one is where a face cuts the disc off


def full_cylinders(volume: int, gap: float) -> list[tuple[Face, ...]]:
    """Faces of each cylinder of a body, bounded by planes across its axis, whose nodes may move out
    without leaving the faces that they border on.

    A face that a partner imprinted may have the partner's surface, off by the gap [m], and point
    the opposite way.
    """
    # faces of one cylinder: equal axes and radii, up to what imprints of partners are off
    boundary = [tag for _, tag in gmsh.model.getBoundary([(3, volume)], oriented=False)]
    faces = {tag: face_of(tag) for tag in boundary}
    groups = of_one_cylinder(faces.values(), 2 * gap)

    # of these the cylinders whose neighbours are all planes across the axis: only in such planes do
    # nodes of the rim stay when they move out along the radius
    cylinders = []
    for group in groups:
        tags = {face.tag for face in group}
        edges = {edge for tag in tags for edge in gmsh.model.getAdjacencies(2, tag)[1]}
        neighbours = {tag for edge in edges for tag in gmsh.model.getAdjacencies(1, edge)[0]} - tags
        normals = [faces[tag].normal if tag in faces else None for tag in neighbours]
        if all(normal is not None and parallel(normal, group[0].axis) for normal in normals):
            cylinders.append(tuple(group))
    return cylinders


def enclosing(
    p: NDArray[np.float64], corners: dict[int, NDArray[np.int64]], cylinders: list[tuple[Face, ...]]
) -> NDArray[np.float64]:
    """Points (n, 3) [m] with the nodes on cylinders moved out along the radius; `corners` are nodes
    (m, 3) of the triangles by the tag of their face, `cylinders` the faces of each cylinder."""
    moved = p.copy()
    for cylinder in cylinders:
        # s^2 = sum r A / sum |rho . a|, with the mean rho of each facet, as rho is linear on it
        facets = np.concatenate([corners[face.tag] for face in cylinder])
        nodes = np.unique(facets)
        axis, on_axis = cylinder[0].axis, cylinder[0].on_axis
        rho = p - on_axis
        rho -= np.outer(rho @ axis, axis)
        a, b, c = (p[facets[:, i]] for i in range(3))
        area = np.cross(b - a, c - a) / 2
        flux = float(np.sum(abs(np.sum(rho[facets].mean(axis=1) * area, axis=1))))
        exact = sum(face.radius * face.area for face in cylinder)
        moved[nodes] += (np.sqrt(exact / flux) - 1) * rho[nodes]
    return moved


def rimmed(
    mesh: AnyMesh,
    name: str,
    disc: Disc,
    radius: float,
    edges: float = EDGES_AROUND,
    neighbours: Sequence[str] = (),
) -> AnyMesh:
    """The mesh with the rim of a disc, drawn with a `radius` of about so many `edges`, moved to
    where its polygon has the area of the circle of the disc's own radius.

    Nodes on an edge of the face or on discs that are `neighbours`, and those that would flatten an
    element, stay where they are: s_i = 1 there, and for all others the one s with

        sum s_i s_j sin(step_ij) = (disc.radius / radius)^2 sum step_ij

    over the edges that are not between two that stay. A disc that its face cuts off stays whole.
    """
    # nodes of the disc on its rim, in the order of their angles
    normal = disc.normal / np.linalg.norm(disc.normal)
    nodes = np.unique(mesh.facets[:, mesh.boundaries[name]])
    rho = mesh.p[:, nodes].T - disc.centre
    on_rim = np.abs(np.linalg.norm(rho, axis=1) - radius) < RIM_TOLERANCE * radius
    if not on_rim.any():
        return mesh
    nodes, rho = nodes[on_rim], rho[on_rim]
    angle = np.arctan2(np.cross(rho[0], rho) @ normal / radius, rho @ rho[0] / radius)
    nodes, rho, angle = (array[np.argsort(angle)] for array in (nodes, rho, angle))
    step = np.diff(angle, append=angle[:1] + 2 * pi)
    if step.max() > OPEN_EDGE * 2 * pi / edges:
        return mesh

    # nodes that stay: on facets out of the disc's plane, and on rims of neighbours
    outer = mesh.facets[:, mesh.boundary_facets()]
    height = normal @ mesh.p - normal @ mesh.p[:, nodes[0]]
    aside = outer[:, np.any(np.abs(height[outer]) > SAME, axis=0)]
    shared = [mesh.facets[:, mesh.boundaries[rim]].ravel() for rim in neighbours]
    free = ~np.isin(nodes, np.concatenate([aside.ravel(), *shared]))
    corners = mesh.elem().doflocs[: mesh.t.shape[0]].T
    volume = mesh.mapping().detDF(corners)

    # the polygon's area over radius^2 / 2 is a s^2 + b s: edges between two nodes that move, and
    # between one that moves and one that stays. Nodes that flatten an element stay, the others move
    # again
    while free.any():
        ahead = np.roll(free, -1)
        a = np.sin(step[free & ahead]).sum()
        b = np.sin(step[free != ahead]).sum()
        area = (disc.radius / radius) ** 2 * step[free | ahead].sum()
        s = (np.sqrt(b**2 + 4 * a * area) - b) / (2 * a) if a else area / b
        p = mesh.p.copy()
        p[:, nodes[free]] += (s - 1) * rho[free].T
        moved = replace(mesh, doflocs=p)
        share = moved.mapping().detDF(corners) / volume
        flat_cells = np.any(share < MIN_CORNER_VOLUME, axis=1)
        flattened = np.isin(nodes, mesh.t[:, flat_cells]) & free
        if not flattened.any():
            return moved
        free &= ~flattened
    return mesh
