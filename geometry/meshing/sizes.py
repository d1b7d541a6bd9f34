"""Element sizes of a body: its seed, smaller at fine points and growing away from them."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from math import log, pi
from typing import NamedTuple

import gmsh
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from beadwave.geometry.cad.solids import Body, Vector, parallel
from beadwave.geometry.meshing.gmsh_session import CURVED_EDGES_AROUND, EDGES_AROUND, mesh_options
from beadwave.geometry.meshing.size_field import GRADING, SizeField

# Element size by a body's shape; sizes grow away from a point or a circle by `GRADING`
STEEP_GRADING = 0.7  # the same from a line on which a partner ends
# singular edges of a thick body with a seed above COARSE times the default: the first element
# has SHARP times the seed, but at least SHARPEST times the default seed, and each next one
# is exp(SHARP_GROWTH) times as large, h(d) = first log(3) / 2 + log(3) d. At smaller seeds the
# edges cause less error than the rest of the mesh
SHARP = 1 / 8
SHARPEST = 1 / 2
SHARP_GROWTH = log(3)
COARSE = 2.0
# elements along a body's diagonal, and through the thickness of a thin one: with these the
# first six modes of a free beam, plate, tube and block lie within 0.5 % (hexahedra) and 0.8 %
# (tetrahedra) of those on meshes twice as fine
N_ACROSS = 20
N_LAYERS = 1 / 2
N_ACROSS_ASSEMBLY = 60  # elements along an assembly's diagonal: small bodies need no finer ones
EDGE = 4  # of the seed, the finest where a partner ends
THIN = 1.5  # of the thickness: a body with a larger seed is thin
N_SAMPLED = 200  # points of a line that distances are taken from
DELAUNAY = 5  # gmsh's number of this algorithm for faces
FINEST_AT_APEX = 1 / 2  # of the seed, on a body that has the apex of a cone


class Fine(NamedTuple):
    """Elements of this size at a point of a body."""

    body: str
    point: Vector  # (3,) [m]
    size: float  # m
    # (3,) unit vector along which elements of an extrusion may be as long as others; of a line
    along: Vector | None = None
    within: float = 0.0  # [m] from the point, up to which they keep this size


class Size(NamedTuple):
    """Element sizes of one body [m]."""

    seed: float
    fine: tuple[Fine, ...] = ()
    edge: float | None = None  # where a partner ends inside a face of a thin body
    sharp: float | None = None  # of the first element at a singular edge of a thick one
    around: float = EDGES_AROUND  # edges around a circle, at least
    field: SizeField | None = None  # in place of edge and sharp; the seed is its upper bound
    curved: bool = False  # whether elements follow curved faces

    def times(self, coarser: float) -> "Size":
        """Sizes with all elements `coarser` times as large, those that its shape bounds too."""
        fine = tuple(f._replace(size=coarser * f.size) for f in self.fine)
        edge, sharp = (s and coarser * s for s in (self.edge, self.sharp))
        field = self.field and self.field._replace(sizes=coarser * self.field.sizes)
        seed, around = coarser * self.seed, self.around / coarser
        return Size(seed, fine, edge, sharp, around, field, self.curved)


class Sizes(NamedTuple):
    """Element sizes of the bodies of an assembly, as far as they are not the default ones."""

    seeds: Mapping[str, float] | None = None  # [m] by body
    fine: Sequence[Fine] = ()
    coarser: float = 1.0  # times all of them, see `Size.times`
    fields: Mapping[str, SizeField] = {}  # by body
    curved: bool = False  # whether elements follow curved faces
    # bodies in tetrahedra alone, as their fine points are so fine that grid lines would be too many
    graded: Collection[str] = ()

    def of(self, body: Body) -> Size:
        """Element sizes of one body."""
        size = size_of(body, (self.seeds or {}).get(body.name), self.fine)
        if field := self.fields.get(body.name):
            size = size._replace(edge=None, sharp=None, field=field)
        if self.curved:
            size = size._replace(around=CURVED_EDGES_AROUND, curved=True)
        return size.times(self.coarser)


def size_of(body: Body, seed: float | None = None, fine: Sequence[Fine] = ()) -> Size:
    """Element sizes of a body, with the default seed unless one is given [m].

    Where a body that holds it ends, a thin body bends within a length of its thickness: there its
    elements are as small as that.
    """
    usual = default_seed(body)
    seed = seed or usual
    edge = max(_thickness(body), seed / EDGE)
    of_body = tuple(f for f in fine if f.body == body.name)
    thick = seed > COARSE * usual
    sharp = max(SHARP * seed, SHARPEST * usual) if thick else None
    return Size(seed, of_body, edge if THIN * edge <= seed else None, sharp)


def default_seeds(bodies: Mapping[str, Body]) -> dict[str, float]:
    """Default element size [m] of every body of an assembly. Small bodies, whose own modes lie
    above those of the whole, get larger elements than they would alone."""
    corners = [corner for body in bodies.values() for corner in (body.lower, body.upper)]
    smallest = float(np.linalg.norm(np.ptp(corners, axis=0))) / N_ACROSS_ASSEMBLY
    return {name: default_seed(body, smallest) for name, body in bodies.items()}


def default_seed(body: Body, smallest: float = 0.0) -> float:
    """Element size from a body's extent, `smallest` or more, less for a thin one [m]."""
    return min(max(body.extent / N_ACROSS, smallest), _thickness(body) / N_LAYERS)


def _thickness(body: Body) -> float:
    """Mean thickness 2 V / A [m]: that of a plate, the radius of a long rod."""
    return 2 * body.volume / body.area


def size_at(
    size: Size, x: NDArray[np.float64], axis: Vector, edges: Sequence[float] = ()
) -> NDArray[np.float64]:
    """Element sizes (k,) [m] at the coordinates x (k,) [m] along an axis (3,): the smallest of the
    seed and of all that grows from fine points and from `edges`, the coordinates [m] at which other
    bodies end."""
    grown = [
        f.size + GRADING * np.maximum(np.abs(x - f.point @ axis) - f.within, 0.0)
        for f in size.fine
        if f.along is None or not parallel(f.along, axis)
    ]
    if size.field:
        grown.append(size.field.at(x, axis))
    if size.edge:
        grown += [size.edge + STEEP_GRADING * np.abs(x - edge) for edge in edges]
    elif size.sharp:
        grown += [SHARP_GROWTH * (size.sharp / 2 + np.abs(x - edge)) for edge in edges]
    return np.minimum.reduce([np.full_like(x, size.seed), *grown])


def mesh_visible(entities: Sequence[tuple[int, int]], size: Size) -> None:
    """Meshes these entities (dimension, tag) alone, with the lines and faces that bound them; sizes
    grow away from fine points, from where other bodies end, and from circles."""
    field = gmsh.model.mesh.field
    gmsh.model.mesh.clear()
    gmsh.model.setVisibility(gmsh.model.getEntities(), 0)
    gmsh.model.setVisibility(entities, 1, recursive=True)
    dimension = entities[0][0]
    solid = dimension == 3
    boundary = gmsh.model.getBoundary(entities, oriented=False) if solid else entities
    faces = [tag for _, tag in boundary]
    for tag in field.list():
        field.remove(tag)

    # straight lines between faces of one plane: another body ends there
    lines = []
    if size.edge:
        planes = {tag for tag in faces if gmsh.model.getType(2, tag) == "Plane"}
        for tag in edges_of(faces, "Line"):
            sides = [face for face in gmsh.model.getAdjacencies(1, tag)[0] if face in planes]
            normals = [gmsh.model.getEntityProperties(2, face)[1][:3] for face in sides]
            if len(normals) == 2 and parallel(*normals):
                lines.append(tag)

    # on circles elements of a size that goes around them so many times
    on_circle = {tag: 2 * pi * r / size.around for tag, r in circle_radii(faces).items()}

    # at every place the smallest of all sizes that grow from these places up to the seed
    fields = [_field_of_sizes(size.field)] if size.field else []
    for fine in (fine for fine in size.fine if fine.size < size.seed):
        ball = dict(zip(("XCenter", "YCenter", "ZCenter"), fine.point, strict=True))
        ball |= {
            "Radius": max(fine.size, fine.within),
            "Thickness": (size.seed - fine.size) / GRADING,
        }
        fields.append(_field("Ball", ball | {"VIn": fine.size, "VOut": size.seed}))
    sources = [(lines, size.edge, STEEP_GRADING)] if lines else []
    for finest in sorted({round(s, 9) for s in on_circle.values() if s < size.seed}):
        circles = [tag for tag, s in on_circle.items() if round(s, 9) == finest]
        sources.append((circles, finest, GRADING))
    for tags, finest, growth in sources:
        distance = _field("Distance", {"Sampling": N_SAMPLED})
        field.setNumbers(distance, "CurvesList", tags)
        growing = {"DistMin": 0.0, "DistMax": (size.seed - finest) / growth}
        sizes = {"InField": distance, "SizeMin": finest, "SizeMax": size.seed}
        fields.append(_field("Threshold", growing | sizes))
    smallest = field.add("Min")
    field.setNumbers(smallest, "FieldsList", fields)
    field.setAsBackgroundMesh(smallest)

    # faces by the fields alone: between two fine lines they would all be fine
    options = {
        "MeshOnlyVisible": 1, "MeshSizeMax": size.seed, "MeshSizeExtendFromBoundary": -3,
        "MeshSizeFromCurvature": size.around,
    }  # fmt: skip
    asked = [*on_circle.values(), *(f.size for f in size.fine), FINEST_AT_APEX * size.seed]
    options |= bounded_at_apices(faces, min(asked))
    with mesh_options(options):
        gmsh.model.mesh.generate(dimension)


def circle_radii(faces: Iterable[int]) -> dict[int, float]:
    """Radii [m] of the circular edges of faces, whole or in part, by the tags of the edges."""
    radii = {}
    for tag in edges_of(faces, "Circle"):
        start, _ = gmsh.model.getParametrizationBounds(1, tag)
        radii[tag] = 1 / gmsh.model.getCurvature(1, tag, start)[0]
    return radii


def bounded_at_apices(faces: Iterable[int], finest: float) -> dict[str, float]:
    """Options of gmsh for faces of which some end in the apex of a cone, where the curvature has no
    bound and the face no normal: elements of `finest` [m] or more; none for others.

    Of 16 meshes of four cones the frontal algorithm overlapped facets on six, and with elements
    below a quarter of the usual either went on for more than 8 s on up to six.
    """
    for face in faces:
        edges = gmsh.model.getAdjacencies(2, face)[1]
        # an edge of no length has no type
        if gmsh.model.getType(2, face) == "Cone" and any(
            gmsh.model.getType(1, edge) == "Unknown" for edge in edges
        ):
            return {"Algorithm": DELAUNAY, "MeshSizeMin": finest}
    return {}


def curvatures(face: int, n: int = 6) -> NDArray[np.float64]:
    """Largest curvature [1/m] of a face at the middles of n by n parts of its parameters."""
    lower, upper = gmsh.model.getParametrizationBounds(2, face)
    at = (np.arange(n) + 0.5) / n
    u, v = (a + (b - a) * at for a, b in zip(lower, upper, strict=True))
    places = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1)
    return np.asarray(gmsh.model.getCurvature(2, face, places))


def edges_of(faces: Iterable[int], kind: str) -> list[int]:
    """Tags of the edges of faces that are of gmsh's type `kind`, in their order."""
    edges = {tag for face in faces for tag in gmsh.model.getAdjacencies(2, face)[1]}
    return [tag for tag in sorted(edges) if gmsh.model.getType(1, tag) == kind]


def _field(kind: str, numbers: Mapping[str, float]) -> int:
    """Tag of a field of gmsh with these options."""
    tag = gmsh.model.mesh.field.add(kind)
    for name, value in numbers.items():
        gmsh.model.mesh.field.setNumber(tag, name, value)
    return tag


def _field_of_sizes(sizes: SizeField) -> int:
    """Tag of the field of gmsh that is the size of the nearest point, in a plane linear between."""
    view, smallest = gmsh.view.add("sizes"), sizes.sizes.min(axis=1)
    if sizes.plane is None:
        values = np.column_stack([sizes.points, smallest])
        gmsh.view.addListData(view, "SP", len(values), values.ravel())
    else:
        flat = sizes.points @ sizes.plane.T
        corners = Delaunay(flat - flat.mean(axis=0)).simplices
        places = sizes.points[corners].transpose(0, 2, 1).reshape(-1, 9)
        values = np.concatenate([places, smallest[corners]], axis=1)
        gmsh.view.addListData(view, "ST", len(values), values.ravel())
    return _field("PostView", {"ViewTag": view, "UseClosest": 1})
