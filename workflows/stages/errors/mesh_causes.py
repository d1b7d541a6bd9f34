"""Causes and remedies of a large error of a mesh: places where the elements miss most of the
energy.

Each element belongs to the first of these places that it touches: a joint, a tie, a sharp inner
edge, a held face, a part of one element between two free faces, all else. The place that holds the
largest part of the energy is the cause. Stresses at the edges of the first four are singular: the
energy missed falls with the size h of elements as h^(2 lambda), lambda from 0.5 at a crack to 1
where there is no edge (Williams, J. Appl. Mech. 19 (1952) 526), that of smooth bending as h^4.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from skfem import Mesh, MeshHex

from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.structure.meshed_parts import Parts

# Errors that are explained, and trust in refinement
LARGE_ERROR = 0.05  # relative error from which on a cause is given
INNER_ANGLE = 50.0  # degrees by which faces turn inwards at a sharp edge; those of bores less
SINGULAR_ORDER = 1.0  # order of the error at singular edges, 2 lambda of the sharpest
SMOOTH_ORDER = 1.5  # elsewhere: of quadratic elements 4, less while they are few
FINEST_SCALE = 0.3  # times mesh.scale, below which a mesh has forty times the unknowns


class Cause(NamedTuple):
    """Place where the elements miss most of a shape's energy."""

    place: str
    share: float  # of the energy
    singular: bool  # whether stresses are infinite there
    remedy: str  # what helps besides smaller elements


class ErrorPlace(NamedTuple):
    """Elements of a body that one cause makes miss energy."""

    body: str
    cells: NDArray[np.bool_]  # (cells,) of the body's mesh
    words: str
    singular: bool = False
    remedy: str = ""


def error_places(mesh: Parts) -> list[ErrorPlace]:
    """Places where elements miss energy, in the order in which they claim an element; the last of a
    body has all of its elements."""
    connections, places = mesh.connections, []

    # where singular stresses are made by what is fastened to a body
    faces = [
        (side.face, f"around the joint {joint.name}", 'a larger washer, or sides = "mean"')
        for joint in connections.joints
        for side in (joint.first, joint.second)
        if side
    ]
    faces += [
        (face, "where bodies are tied", "one body in place of two, with a fillet")
        for tie in connections.ties
        for face in (tie.slave, tie.master)
    ]
    held = [(held.face, "at the face held", "springs to the ground") for held in connections.held]

    def touching(body: str, corners: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Elements (cells,) of a body with any of these corners."""
        return np.isin(mesh.meshes[body].t, corners).any(axis=0)

    def at(face: str) -> tuple[str, NDArray[np.bool_]]:
        """The body of a face "body:name", and its elements (cells,) that touch the face."""
        body, _, name = face.partition(":")
        return body, touching(body, mesh.meshes[body].facets[:, mesh.meshes[body].boundaries[name]])

    places += [ErrorPlace(*at(face), words, True, remedy) for face, words, remedy in faces]
    for body, mesh_of_body in mesh.meshes.items():
        inner = touching(body, inner_edges(mesh_of_body))
        places.append(ErrorPlace(body, inner, f"at sharp inner edges of {body}", True, "a fillet"))
    places += [ErrorPlace(*at(face), words, True, remedy) for face, words, remedy in held]
    for body, mesh_of_body in mesh.meshes.items():
        words = f"in parts of {body} that are one element thick"
        places.append(ErrorPlace(body, one_thick(mesh_of_body), words))
        places.append(ErrorPlace(body, np.ones(mesh_of_body.nelements, bool), f"within {body}"))
    return places


def causes(mesh: Parts, missed: Mapping[str, NDArray[np.float64]]) -> tuple[Cause, ...]:
    """The cause of each shape's error, by the energies (cells, k) that elements miss by body."""
    places = error_places(mesh)

    # each element's energy to the first of its places: set from the last place on, so that an
    # earlier one takes an element back
    energy = np.zeros((len(places), next(iter(missed.values())).shape[1]))
    for body, of_cells in missed.items():
        first = np.full(len(of_cells), -1)
        for i, place in reversed(list(enumerate(places))):
            if place.body == body:
                first[place.cells] = i
        np.add.at(energy, first, of_cells)

    # places of the same words are one: joints of one name, both sides of a tie
    words = [place.words for place in places]
    energy = np.array([energy[[w == word for w in words]].sum(axis=0) for word in words])
    total = np.maximum(sum(of_cells.sum(axis=0) for of_cells in missed.values()), 1e-300)
    return tuple(
        Cause(places[i].words, float(energy[i, j] / total[j]), *places[i][3:])
        for j, i in enumerate(energy.argmax(axis=0))
    )


def inner_edges(mesh: Mesh) -> NDArray[np.int64]:
    """Corners (m,) of a mesh on edges where its outer faces turn inwards sharply."""
    # normals of outer facets: of four corners by the diagonals, turned away from the element
    facets = mesh.boundary_facets()
    corners = mesh.facets[:, facets]
    p = mesh.p[:, corners]  # (3, corner, facet)
    normal = np.cross(p[:, -2] - p[:, 0], p[:, -1] - p[:, 1], axis=0) if len(corners) == 4 else (
        np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0], axis=0)
    )  # fmt: skip
    middle = p.mean(axis=1)
    inside = mesh.p[:, mesh.t[:, mesh.f2t[0, facets]]].mean(axis=1)
    normal *= np.sign(np.sum(normal * (middle - inside), axis=0)) / np.linalg.norm(normal, axis=0)

    # edges sorted by their corners, so that the two facets of an edge stand next to each other
    n = len(corners)
    edges = np.sort(np.hstack([corners[[i, (i + 1) % n]] for i in range(n)]), axis=0)
    facet = np.tile(np.arange(len(facets)), n)
    order = np.lexsort(edges)
    edges, facet = edges[:, order], facet[order]
    pairs = np.flatnonzero((edges[:, 1:] == edges[:, :-1]).all(axis=0))
    a, b = facet[pairs], facet[pairs + 1]

    # an edge turns inwards where the middle of one facet lies on the outer side of the other
    turns = np.degrees(np.arccos(np.clip(np.sum(normal[:, a] * normal[:, b], axis=0), -1, 1)))
    inwards = np.sum(normal[:, a] * (middle[:, b] - middle[:, a]), axis=0) > 0
    return np.unique(edges[:, pairs[inwards & (turns > INNER_ANGLE)]])


def one_thick(mesh: Mesh) -> NDArray[np.bool_]:
    """Elements (m,) with two outer faces that have no corner in common, of hexahedra; with all
    corners on outer faces, of tetrahedra."""
    outer = np.zeros(mesh.nfacets, bool)
    outer[mesh.boundary_facets()] = True
    if not isinstance(mesh, MeshHex):
        on_outside = np.zeros(mesh.nvertices, bool)
        on_outside[mesh.facets[:, outer]] = True
        return on_outside[mesh.t].all(axis=0)
    sides = mesh.facets[:, mesh.t2f]  # (corner, side, cell)
    thick = np.zeros(mesh.nelements, bool)
    for i in range(6):
        for j in range(i):
            apart = ~(sides[:, None, i] == sides[None, :, j]).any(axis=(0, 1))
            thick |= apart & outer[mesh.t2f[i]] & outer[mesh.t2f[j]]
    return thick


def explanation(scene: Scene, relative: float, cause: Cause) -> str:
    """Cause and remedy of a large relative error of a number by the mesh; "" of a small one."""
    if not relative > LARGE_ERROR:
        return ""
    why = f"{100 * cause.share:.0f} % of the mesh's error of {100 * relative:.2g} % "
    why += f"arises {cause.place}"
    times = size_for(LARGE_ERROR, relative, cause)
    if scene.own_mesh:
        return f"{why}; take elements {times:.2g} times as large there."
    if scene.mesh.error:
        return f"{why}; a smaller mesh.error lowers it, or a larger mesh.modes of a higher mode."
    if times < FINEST_SCALE and cause.remedy:
        return f"{why}, where errors fall slowly with the size of elements; {cause.remedy} helps."
    keys = refinement(scene, times, LARGE_ERROR)
    return f"{why}; {keys} would bring it to about {100 * LARGE_ERROR:.0f} %."


def size_for(wanted: float, relative: float, cause: Cause) -> float:
    """Times the size of elements that brings a relative error to the one wanted."""
    return (wanted / relative) ** (1 / (SINGULAR_ORDER if cause.singular else SMOOTH_ORDER))


def refinement(scene: Scene, times: float, wanted: float) -> str:
    """The keys that make elements so many times as large, or choose those of the relative error
    that is wanted."""
    error = f"mesh.error = {wanted:.2g}"
    if scene.mesh.error:
        return error
    # the scale rounded down to two digits: up, 0.68 of 1.5 would be 1.5 again
    scale = times * scene.mesh.scale
    unit = 10.0 ** (np.floor(np.log10(scale)) - 1)
    scale = f"mesh.scale = {np.floor(scale / unit * (1 + 1e-9)) * unit:.2g}"
    bound = scene.strike and (scene.strike.nodes or scene.strike.weights == "thesis")
    return scale if bound or scene.mesh.sizes else f"{scale}, or {error},"
