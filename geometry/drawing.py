"""The bodies of an assembly, from shapes, a STEP file or a mesh, and their meshes.

with drawn(shapes, step, volumes, gap) as drawing:    bodies, and which of them touch
    chosen = picked(words, drawing.bodies, ...)       `geometry.cad.joints`
    meshes, fineness = meshed(drawing, chosen, ties, named, sizing)
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from math import inf
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from skfem import Mesh

from beadwave import system
from beadwave.geometry.cad.contacts import Neighbours, TouchingPair, require_apart
from beadwave.geometry.cad.face_triangles import drawn_face_triangles, own_face_triangles
from beadwave.geometry.cad.joints import NamedParts
from beadwave.geometry.cad.round_contacts import RoundContact
from beadwave.geometry.cad.selectors import FaceSelection
from beadwave.geometry.cad.shapes import Shape
from beadwave.geometry.cad.solids import Body, Vector, parallel, require_size
from beadwave.geometry.errors import InvalidGeometry
from beadwave.geometry.meshing.size_field import SizeField
from beadwave.geometry.own_mesh.mesh_bodies import OwnMesh, own_mesh

if TYPE_CHECKING:
    from beadwave.geometry.meshing.sizes import Sizes

# more nodes of hexahedra for each partner that ends inside a face; 600 to 850 in a gearbox of six
# bodies
OUTLINE_NODES = 700.0
GMSH_NEEDS = (
    "apt-get install libgl1 libglu1-mesa libgomp1 libxcursor1 libxft2 libxinerama1 libxrender1"
)


class Drawing(NamedTuple):
    """The bodies in the CAD kernel or in a mesh, and which of them touch."""

    bodies: dict[str, Body]
    unit: str | None  # of length in the STEP file; None for drawn bodies
    near: Neighbours
    own: OwnMesh | None = None  # the mesh, if bodies come from one
    remarks: tuple[str, ...] = ()  # on what of the file is left out
    # faces in contact that touch at points or along lines, by the name of the pair of bodies
    round_contacts: Mapping[str, tuple[RoundContact, ...]] = MappingProxyType({})


class FinePoint(NamedTuple):
    """Elements of this size at a point of a body, as `geometry.meshing.sizes.Fine`."""

    body: str
    point: Vector  # (3,) [m]
    size: float  # [m]
    along: Vector | None = None  # (3,) of a line: elements may be long along it
    within: float = 0.0  # [m] of the point they keep this size


class Sizing(NamedTuple):
    """Element sizes that are asked for; those of a mesh that is given stay."""

    gap: float  # [m] up to which faces touch
    scale: float  # on all sizes below
    seeds: Mapping[str, float | None]  # [m] of each body; None: by its shape
    fine: Sequence[FinePoint]
    coarser: float  # on all sizes, those that the shape of a body bounds too
    element: str | None  # "tet": tetrahedra alone
    fields: Mapping[str, SizeField]  # sizes that vary over bodies
    usual: float  # on the sizes by the shape of a body
    seconds: float = inf  # that the mesh of a body may take
    curved: bool = False  # whether elements follow curved faces
    # bodies in tetrahedra alone, as their fine points are so fine that grid lines would be too many
    graded: Collection[str] = ()


@contextmanager
def drawn(
    shapes: Mapping[str, Shape], step: Path | None, volumes: Mapping[str, Mesh], gap: float
) -> Iterator[Drawing]:
    """The bodies of a mesh's volumes, or, if there are none, of shapes and a STEP file in the CAD
    kernel until the context ends.

    Raises InvalidGeometry for bodies that nobody can build; ValueError for what gmsh cannot draw,
    and where gmsh cannot start.
    """
    if volumes:
        mesh_of_file = own_mesh(volumes, gap)
        require_size(mesh_of_file.bodies, of_file=True)
        require_apart(mesh_of_file.meeting.near)
        yield Drawing(mesh_of_file.bodies, None, mesh_of_file.meeting.near, mesh_of_file)
        return
    try:
        from beadwave.geometry.cad.occ import model
        from beadwave.geometry.cad.touching import neighbours
    except ModuleNotFoundError as missing:
        if missing.name != "gmsh":
            raise
        raise ValueError(
            "gmsh is not installed, and has no wheel for Linux on ARM; build it of its sources, or "
            "take another machine."
        ) from None
    except OSError as missing:
        raise ValueError(
            f"gmsh cannot start ({missing}); install its shared libraries (Debian: {GMSH_NEEDS})."
        ) from None
    with model(shapes, step) as cad:
        require_size(cad.bodies, of_file=step is not None)
        near = neighbours(cad.bodies, gap)
        require_apart(near)
        remarks = tuple(
            f"The STEP file refers to {name} for other parts, which is not read; export the "
            "assembly as one file if they belong to it."
            for name in cad.elsewhere
        )
        yield Drawing(cad.bodies, cad.unit, near, remarks=remarks)


def meshed(
    drawing: Drawing, chosen: NamedParts, ties: Sequence[TouchingPair],
    named: Mapping[str, FaceSelection], sizing: Sizing,
) -> tuple[dict[str, Mesh], dict[str, float]]:  # fmt: skip
    """Meshes of the bodies, with named faces, patches and ties as boundaries, and the fineness by
    which of two bodies tied the finer one is the slave; to be called once in `drawn`.

    One order of all bodies, so that ties never form a circle: the finer mesh, in a mesh that is
    given and where faces are tied in part the smaller volume. Raises InvalidGeometry.
    """
    # a mesh that is given keeps its elements: faces become sets of its facets
    bodies = drawing.bodies
    by_volume = {name: 1 / body.volume for name, body in bodies.items()}
    if drawing.own:
        slaves = [sorted(tie.bodies, key=lambda body: by_volume[body])[1] for tie in ties]
        tied = list(zip(ties, slaves, strict=True))
        try:
            marked = drawing.own.marked(named, chosen.patches, tied, drawing.round_contacts)
            return marked, by_volume
        except ValueError as error:
            raise InvalidGeometry(str(error)) from None

    # bodies in the CAD kernel are meshed, each with the size asked for or that of its shape
    from beadwave.geometry.meshing.body_mesh import body_meshes

    meshes = body_meshes(
        bodies,
        ties,
        gap=sizing.gap,
        sizes=sizes_of(bodies, sizing),
        named=named,
        patches=chosen.patches,
        element=sizing.element,
        seconds=sizing.seconds,
    )
    if chosen.partly:
        return meshes, by_volume
    return meshes, {name: mesh.nelements / bodies[name].volume for name, mesh in meshes.items()}


def extruded_along(body: Body, direction: Vector) -> bool:
    """True of a body in the CAD kernel whose elements can be long along a direction."""
    from beadwave.geometry.meshing.hexahedra import prisms

    return any(parallel(prism.axis, direction) for prism in prisms(body))


def sizes_of(bodies: Mapping[str, Body], sizing: Sizing) -> "Sizes":
    """Element sizes of bodies in the CAD kernel, as asked for or by their shapes."""
    from beadwave.geometry.meshing.sizes import Fine, Sizes, default_seeds

    scale, usual = sizing.scale, default_seeds(bodies)
    seeds = {name: scale * (sizing.seeds[name] or sizing.usual * usual[name]) for name in bodies}
    fine = [Fine(*place._replace(size=scale * place.size)) for place in sizing.fine]
    return Sizes(seeds, fine, sizing.coarser, sizing.fields, sizing.curved, sizing.graded)


def nodes_foreseen(drawing: Drawing, sizing: Sizing) -> dict[str, float]:
    """Nodes of each body with quadratic elements: those of a mesh that is given, within a factor of
    2 those of a mesh that is not made yet."""
    if drawing.own:
        return nodes_of({name: skin.mesh for name, skin in drawing.own.skins.items()})
    from beadwave.geometry.meshing.body_mesh import foreseen_nodes
    from beadwave.geometry.meshing.hexahedra import prisms

    sizes = sizes_of(drawing.bodies, sizing)
    nodes = {}
    for name, body in drawing.bodies.items():
        areas = [face.area for face in body.faces]
        extruded = sizing.element != "tet" and name not in sizing.graded and any(prisms(body))
        nodes[name] = foreseen_nodes(body, sizes.of(body), "hex" if extruded else "tet")
        # a partner that ends inside a face makes lines of the grid that go on across it
        ends_inside = [
            name in pair.bodies and not np.isclose(pair.area, areas, rtol=0.01).any()
            for pair in drawing.near.touching
        ]
        nodes[name] += extruded * OUTLINE_NODES * sum(ends_inside)
    return nodes


def nodes_of(meshes: Mapping[str, Mesh]) -> dict[str, float]:
    """Number of nodes of quadratic elements by body: corners and middles of edges."""
    return {name: float(mesh.nvertices + mesh.nedges) for name, mesh in meshes.items()}


def face_triangles(
    drawing: Drawing, seconds: float = inf
) -> dict[str, dict[int, NDArray[np.float64]]]:
    """Corners (n, 3, 3) [m] of the triangles of each face, by body and by the face's tag; to be
    called in `drawn`, before any mesh. A command ends where they take longer than `seconds`."""
    if drawing.own:
        return own_face_triangles(drawing.own)
    late = (
        f"the faces of {', '.join(drawing.bodies)} were not drawn within {seconds:g} s; repair "
        "them in the CAD, or allow more by mesh.seconds."
    )
    with system.ended_after(seconds, late):
        by_tag = drawn_face_triangles(drawing.bodies.values())
    return {
        name: {face.tag: by_tag[face.tag] for face in body.faces}
        for name, body in drawing.bodies.items()
    }
