"""Every body meshed on its own, straight or curved elements for quadratic shape functions.

Hexahedra for boxes, extruded outlines and tubes, tetrahedra for all else. Elements have the body's
seed, less where it is bent or thin, and grow away from fine points. Curved ones follow curved faces
(`geometry.meshing.curved_faces`). Of straight ones nodes on full cylinders are moved out so that
the facets enclose the cylinder's volume: chords alone make pins too thin and holes too small, by
2 pi^2 / (3 n^2) of the volume for n edges around.

The number of nodes is estimated before meshing, so that a mesh that no machine could solve is
refused at once. For quadratic elements of the size s in a body of the volume V and the thickness
t = 2 V / area,

    n = V / s^3 (inner + outer s / t) + the finer elements around its cylinders and circles
"""

from collections.abc import Mapping, Sequence
from math import inf, log, pi

import gmsh
import numpy as np
from numpy.typing import NDArray
from skfem import Mesh, MeshTet

from beadwave import system
from beadwave.geometry.cad.contacts import TouchingPair
from beadwave.geometry.cad.imprint import MERGED, ImprintedBody, Region, fitted, imprinted, regions
from beadwave.geometry.cad.patches import Disc, Patch
from beadwave.geometry.cad.selectors import FaceSelection
from beadwave.geometry.cad.solids import Body
from beadwave.geometry.errors import InvalidGeometry
from beadwave.geometry.meshing.curved_faces import (
    NO_MIDDLES,
    EdgeMiddles,
    edges_around,
    followed,
    middles_of,
    straightened_share,
)
from beadwave.geometry.meshing.gmsh_session import CURVED_EDGES_AROUND, EDGES_AROUND, failing
from beadwave.geometry.meshing.hexahedra import hexahedra, prisms
from beadwave.geometry.meshing.roundness import enclosing, full_cylinders, rimmed
from beadwave.geometry.meshing.sizes import (
    FINEST_AT_APEX,
    GRADING,
    N_SAMPLED,
    Size,
    Sizes,
    bounded_at_apices,
    circle_radii,
    curvatures,
    mesh_visible,
    size_at,
)
from beadwave.geometry.own_mesh.facets import facets_of

LINE, TRIANGLE, TETRAHEDRON = 1, 2, 4  # gmsh's element types


# Factors of the estimated number of nodes. Of hexahedra measured on bodies of six kinds, with
# elements from a third of the default seed to the default seed; of tetrahedra fitted to 22 bodies
# of public STEP files with 0.6 of the default seed and with that, which have 0.9 to 1.7 times as
# many.
INNER_NODES = {"hex": 3.9, "tet": 5.6}
OUTER_NODES = {"hex": 4.0, "tet": 11.2}
CYLINDER_NODES = 12.0  # nodes of tetrahedra over area / s^2, at a cylinder
CIRCLE_NODES = 45.0  # the same in the space around a circle, in which they grow
POINT_NODES = 35.0  # the same in the half-space at a fine point of the surface
MAX_NODES = 5e6  # nodes of a body beyond which it is refused: no machine at hand solves it

# share of the curved edges that may stay straight. Of 18 bodies with bores one has more, 5 %, in a
# ring 0.26 mm wide between circles of 21.5 mm radius
MOST_STRAIGHTENED = 0.01

DEFAULT = Sizes()


def body_meshes(
    bodies: Mapping[str, Body],
    touching: Sequence[TouchingPair] = (),
    *,
    gap: float,
    sizes: Sizes = DEFAULT,
    named: Mapping[str, FaceSelection] | None = None,
    patches: Mapping[str, Patch] | None = None,
    element: str | None = None,
    seconds: float = inf,
) -> dict[str, Mesh]:
    """A mesh for every body, in metres; to be called once inside the bodies' ``with model(...)``.

    Boundaries of a mesh are the body's `named` faces and its `patches`, and "a|b" where it touches
    another body, under the same name in both. `element` = "tet" meshes all in tetrahedra, as do
    sizes that are of tetrahedra; else what is an extrusion is meshed in hexahedra, but for bodies
    whose sizes are graded. Raises InvalidGeometry for a seed that would give too many nodes, and
    ValueError, naming the body, for what gmsh cannot mesh. A command ends where a body takes longer
    than `seconds`.
    """
    for body in bodies.values():
        size = sizes.of(body)
        n = foreseen_nodes(body, size, "hex")
        if n > MAX_NODES:
            coarse = size.seed * (n / MAX_NODES) ** (1 / 3)
            raise InvalidGeometry(
                f'"{body.name}" with seed = {size.seed:.3g} m would have some {n:.1e} nodes, more '
                f"than {MAX_NODES:.0e}; take a seed above {coarse:.2g} m."
            )
    meshes = {}
    for name, body in bodies.items():
        size = sizes.of(body)
        late = late_mesh(body, size, seconds)
        try:
            with (
                failing(f'"{name}" could not be meshed with elements of {size.seed:.3g} m'),
                system.ended_after(seconds, late),
            ):
                fitting = fitted(body, patches or {}, gap, size.around)
                imprints = regions(body, touching, fitting, gap)
                whole = {**(named or {}), **whole_faces(body, touching)}
                order = (body, imprints, whole, size, gap)
                # sizes of tetrahedra fit no layers: a wall that hexahedra filled for the first time
                # at its second mesh had 19 times the nodes in place of 5
                of_tetrahedra = size.field is not None and not size.field.axes.any()
                tet = element == "tet" or name in sizes.graded or of_tetrahedra
                mesh, middles = (None if tet else hexahedra(*order)) or tetrahedra(*order)
        except ValueError as error:
            if isinstance(error, InvalidGeometry) or error.__cause__ is None:
                raise
            raise InvalidGeometry(
                f"{error}; take another seed for it, or repair its faces in the CAD."
            ) from error

        # discs get back their area, which the polygon of the rim and the fitted radius changed
        discs = {key: disc for key, disc in fitting.items() if isinstance(disc, Disc)}
        for key, disc in discs.items():
            _require_edges(mesh, key, disc, body, gap)
        for key, disc in discs.items():
            neighbours = [rim for rim in discs if rim != key]
            mesh = rimmed(mesh, key, patches[key], disc.radius, size.around, neighbours)
        # rims leave nodes on curved faces where they are
        meshes[name] = followed(mesh, middles) if size.curved else mesh
    return meshes


def whole_faces(body: Body, touching: Sequence[TouchingPair]) -> dict[str, FaceSelection]:
    """The faces of a body that touch another one over no area, at a point or along a line, by the
    names of the pairs."""
    named = {}
    for touch in touching:
        if body.name in touch.bodies and not any(c.regions for c in touch.contacts):
            side = touch.bodies.index(body.name)
            tags = tuple(dict.fromkeys(contact.faces[side] for contact in touch.contacts))
            named[touch.name] = FaceSelection(body.name, tags)
    return named


def late_mesh(body: Body, size: Size, seconds: float) -> str:
    """Sentence on a body whose mesh took longer than `seconds`."""
    smallest = sorted(body.faces, key=lambda face: face.area)[:3]
    faces = ", ".join(
        f"{body.name}@{','.join(f'{x:.4g}' for x in face.centre.round(6) + 0.0)} "
        f"({1e6 * face.area:.3g} mm^2)"
        for face in smallest
    )
    return (
        f'"{body.name}" was not meshed within {seconds:g} s with elements of '
        f"{1e3 * size.seed:.3g} mm; its smallest faces are {faces}. Take larger elements for "
        "it, repair small faces in the CAD, or allow more by mesh.seconds."
    )


def _require_edges(mesh: Mesh, name: str, disc: Disc, body: Body, gap: float) -> None:
    """Raise InvalidGeometry where the rim of a disc has bent an edge of its face.

    The intersection merges a rim and an edge that are closer than the gap; a plane side that ends
    on the edge is then no longer plane.
    """
    # outer facets that have a node of the disc, and their unit normals
    nodes = np.unique(mesh.facets[:, mesh.boundaries[name]])
    outer = mesh.facets[:, mesh.boundary_facets()]
    corners = mesh.p[:, outer[:, np.any(np.isin(outer, nodes), axis=0)]]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], axis=0)
    across /= np.linalg.norm(across, axis=0)

    # distance of the facets at the disc from the body's plane that they are parallel to within 26
    # degrees
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
    # beyond rounding, and up to the distance within which an intersection merges edges
    if np.any((off > 1e-8) & (off < MERGED * gap)):
        raise InvalidGeometry(
            f'"{name}": a washer of radius {disc.radius:.6g} m at '
            f"{np.round(disc.centre, 6).tolist()} m ends within {gap:g} m, the gap that faces may "
            f"touch across, of several edges of its face of {body.name}; make the washer 5 % "
            "larger or smaller."
        )


def tetrahedra(
    body: Body,
    wanted: Mapping[str, Sequence[Region]],
    named: Mapping[str, FaceSelection],
    size: Size,
    gap: float,
) -> tuple[MeshTet, EdgeMiddles]:
    """The body in straight tetrahedra, with the middles of edges of curved ones; boundaries are its
    imprints `wanted` and its `named` faces."""
    split = imprinted(body, wanted, named, gap)
    mesh, middles = _tetrahedra_of(split, size, gap)
    # cells fold where chords are as high as a ring between two circles is wide: such a body has
    # straight elements, and more of them
    if size.curved and straightened_share(mesh, middles) > MOST_STRAIGHTENED:
        around = size.around * EDGES_AROUND / CURVED_EDGES_AROUND
        return _tetrahedra_of(split, size._replace(around=around, curved=False), gap)
    return mesh, middles


def _tetrahedra_of(split: ImprintedBody, size: Size, gap: float) -> tuple[MeshTet, EdgeMiddles]:
    """Straight tetrahedra of a body whose faces are split, and the middles of edges of curved
    ones."""
    mesh_visible([(3, split.tag)], size)

    # gmsh's tags of nodes have gaps and no order: p (n, 3) are those that cells use, by rising tag
    tags, points, _ = gmsh.model.mesh.getNodes()
    _, cells = gmsh.model.mesh.getElementsByType(TETRAHEDRON, split.tag)
    used, cells = np.unique(cells, return_inverse=True)
    row = np.argsort(tags)
    p = points.reshape(-1, 3)[row[np.searchsorted(tags, used, sorter=row)]]

    def corners(faces: Sequence[int], dimension: int = 2) -> NDArray[np.int64]:
        """(n, 3) node numbers of the triangles on faces, (n, 2) of the lines on curves."""
        kind = TRIANGLE if dimension == 2 else LINE
        nodes = [gmsh.model.mesh.getElementsByType(kind, tag)[1] for tag in faces]
        return np.searchsorted(used, np.concatenate([*nodes, []])).reshape(-1, dimension + 1)

    middles = NO_MIDDLES
    if size.curved:
        # curves last: an edge between two faces is on both of them
        faces = [tag for _, tag in gmsh.model.getBoundary([(3, split.tag)], oriented=False)]
        curves = sorted({tag for face in faces for tag in gmsh.model.getAdjacencies(2, face)[1]})
        places = [(2, tag) for tag in faces] + [(1, tag) for tag in curves]
        edges = [edges_around(corners([tag], dimension)) for dimension, tag in places]
        on = [
            _nearest_on(*place, p[e].mean(axis=1)) for place, e in zip(places, edges, strict=True)
        ]
        middles = middles_of(p, edges, on)
    else:
        # nodes on cylinders move out, so that chords keep the volume
        # (`geometry.meshing.roundness`)
        cylinders = full_cylinders(split.tag, gap)
        round_faces = [face.tag for cylinder in cylinders for face in cylinder]
        p = enclosing(p, {tag: corners([tag]) for tag in round_faces}, cylinders)
    t = cells.reshape(-1, 4).T
    mesh = MeshTet(np.ascontiguousarray(p.T), np.ascontiguousarray(t))
    named_facets = {name: facets_of(mesh, corners(faces)) for name, faces in split.faces.items()}
    return mesh.with_boundaries(named_facets), middles


def _nearest_on(dimension: int, tag: int, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (n, 3) [m] of a curve (1) or a face (2) of the CAD model nearest to points (n, 3)."""
    if not len(points) or gmsh.model.getType(dimension, tag) in ("Plane", "Line"):
        return points
    return np.reshape(gmsh.model.getClosestPoint(dimension, tag, points.ravel())[0], (-1, 3))


def foreseen_nodes(body: Body, size: Size, element: str) -> float:
    """Estimated number of nodes with elements "hex" or "tet", within a factor of 2; imprints are
    left out.

    The module's formula: nodes of the inside go with V / s^3, those near the surface with A / s^2,
    and each cylinder adds what its finer elements have more.
    """
    seed, thickness = size.seed, 2 * body.volume / body.area
    n = body.volume / seed**3 * (INNER_NODES[element] + OUTER_NODES[element] * seed / thickness)
    around = 0.0
    for face in (face for face in body.faces if face.axis is not None):
        on_circle = 2 * pi * face.radius / size.around  # size of elements there
        if element == "tet":
            around += max(0.0, CYLINDER_NODES * face.area * (1 / on_circle**2 - 1 / seed**2))
        elif on_circle < seed:
            # rings of quadrilaterals that grow from the cylinder's size to the seed, in layers
            length = face.along[1] - face.along[0]
            edges = size.around * face.area / (2 * pi * face.radius * length)
            rings = 1 - on_circle / seed + log(seed / on_circle) / GRADING
            if not face.hollow:  # inside a pin there is no room for more
                rings = min(rings, size.around / (4 * pi))
            around += edges * rings * (4 * max(1, round(length / seed)) + 3)
    fine = [f for f in size.fine if f.size < seed]
    if element == "tet":
        tags = [face.tag for face in body.faces]
        finest = bounded_at_apices(tags, FINEST_AT_APEX * seed).get("MeshSizeMin", 0.0)
        for face in (f for f in body.faces if f.normal is None and f.axis is None):
            on_face = 2 * pi / size.around / np.maximum(curvatures(face.tag), 1e-12)
            on_face = np.maximum(on_face, finest)
            finer = np.maximum(0.0, 1 / on_face**2 - 1 / seed**2)
            around += CYLINDER_NODES * face.area * finer.mean()
        radii = circle_radii(tags).values()
        around += CIRCLE_NODES * sum(_grown(2 * pi * r / size.around / seed) for r in radii)
        around += POINT_NODES * sum(_grown(f.size / seed) for f in fine)
    elif fine and (prism := next(prisms(body), None)):
        # layers, and lines of a grid, are fine from end to end; a base of another outline is fine
        # around the point alone
        is_box = len(body.faces) == len(prism.base + prism.top) + 4
        for axis in np.eye(3) if is_box else [prism.axis]:
            ends = np.sort([body.lower @ axis, body.upper @ axis])
            x = np.linspace(*ends, N_SAMPLED)
            varied = np.trapezoid(1 / size_at(size, x, axis), x)
            n *= max(1.0, varied) / max(1.0, np.ptp(ends) / seed)
    return n + around


def _grown(share: float) -> float:
    """Integral of d^2 / h^3 over the distance d, in which sizes h = c + G d grow from c, this share
    of the seed, to the seed."""
    if share >= 1:
        return 0.0
    return (-log(share) + 2 * share - share**2 / 2 - 3 / 2) / GRADING**3
