"""Element sizes of a body: a seed, less at fine points, growing away from them."""

from collections.abc import Mapping, Sequence
from math import log, pi
from typing import NamedTuple

import gmsh
import numpy as np
from numpy.typing import NDArray

from geometry.gmsh_session import EDGES_AROUND, mesh_options
from geometry.solids import Body, Vector, parallel

GRADING = 0.35  # growth of the element size per distance from a fine point
STEEP = 0.7  # the same from a line
# at a singular edge of a thick body of more than twice the default seed the first element has 1/8
# of it, or 1/2 of the default, and each next one three times as much: h(d) = first log(3) / 2 +
# log(3) d; at the default seed the edges leave less than the rest
SHARP, SHARPEST, SHARPLY, COARSE = 1 / 8, 1 / 2, log(3), 2.0
ACROSS, LAYERS = 20, 1 / 2  # elements along a body's diagonal, and through a thin one, at least
ACROSS_ALL = 60  # elements along an assembly's diagonal that are fine enough for its small bodies
EDGE = 4  # of the seed, the finest where a partner ends
THIN = 1.5  # of the thickness: a body with a larger seed is thin
SAMPLED = 200  # points of a line that distances are taken from


class Fine(NamedTuple):
    """Elements of this size at a point of a body."""

    body: str
    point: Vector  # (3,) [m]
    size: float  # m


class Size(NamedTuple):
    """Of one body [m]."""

    seed: float
    fine: tuple[Fine, ...] = ()
    edge: float | None = None  # where a partner ends inside a face of a thin body
    sharp: float | None = None  # of the first element at a singular edge of a thick one
    around: float = EDGES_AROUND  # edges around a circle, at least

    def times(self, coarser: float) -> "Size":
        """The same with all elements `coarser` times as large, those that its shape bounds too."""
        fine = tuple(f._replace(size=coarser * f.size) for f in self.fine)
        edge, sharp = (s and coarser * s for s in (self.edge, self.sharp))
        return Size(coarser * self.seed, fine, edge, sharp, self.around / coarser)


class Sizes(NamedTuple):
    """Of the bodies of an assembly, where they are not those by default."""

    seeds: Mapping[str, float] | None = None  # [m] by body
    fine: Sequence[Fine] = ()
    coarser: float = 1.0  # times all of them, see `Size.times`

    def of(self, body: Body) -> Size:
        """Of one body."""
        return size_of(body, (self.seeds or {}).get(body.name), self.fine).times(self.coarser)


def size_of(body: Body, seed: float | None = None, fine: Sequence[Fine] = ()) -> Size:
    """The sizes of a body, its seed the default unless given.

    A body bends sharply where a partner that holds it ends, over a length of its thickness: there
    elements of a thin one are as small.
    """
    seed = seed or default_seed(body)
    edge = max(_thickness(body), seed / EDGE)
    mine = tuple(f for f in fine if f.body == body.name)
    usual = default_seed(body)
    sharp = max(SHARP * seed, SHARPEST * usual) if seed > COARSE * usual else None
    return Size(seed, mine, edge if THIN * edge <= seed else None, sharp)


def default_seeds(bodies: Mapping[str, Body]) -> dict[str, float]:
    """Of every body of an assembly: small ones, which bend and stretch above all modes of the
    whole, have elements of a size that counts in the whole."""
    corners = [corner for body in bodies.values() for corner in (body.lower, body.upper)]
    least = float(np.linalg.norm(np.ptp(corners, axis=0))) / ACROSS_ALL
    return {name: default_seed(body, least) for name, body in bodies.items()}


def default_seed(body: Body, least: float = 0.0) -> float:
    """Element size from a body's extent, `least` or more, less for a thin one [m].

    The first six modes of a free beam, plate, tube and block lie within 0.5 % (hexahedra) and
    0.8 % (tetrahedra) of those on meshes twice as fine.
    """
    return min(max(body.extent / ACROSS, least), _thickness(body) / LAYERS)


def _thickness(body: Body) -> float:
    return 2 * body.volume / body.area


def size_at(
    size: Size, x: NDArray[np.float64], axis: Vector, edges: Sequence[float] = ()
) -> NDArray[np.float64]:
    """Sizes along a line of an axis, at its coordinates x [m], partners ending at `edges`."""
    grown = [f.size + GRADING * np.abs(x - f.point @ axis) for f in size.fine]
    if size.edge:
        grown += [size.edge + STEEP * np.abs(x - edge) for edge in edges]
    elif size.sharp:
        grown += [SHARPLY * (size.sharp / 2 + np.abs(x - edge)) for edge in edges]
    return np.minimum.reduce([np.full_like(x, size.seed), *grown])


def mesh_visible(entities: Sequence[tuple[int, int]], size: Size) -> None:
    """Lines, faces and volumes meshed of these entities alone; all others left out."""
    gmsh.model.mesh.clear()
    gmsh.model.setVisibility(gmsh.model.getEntities(), 0)
    gmsh.model.setVisibility(entities, 1, recursive=True)
    dimension = entities[0][0]
    solid = dimension == 3
    faces = gmsh.model.getBoundary(entities, oriented=False) if solid else entities
    _refine(size, [tag for _, tag in faces])
    # faces by the fields alone: between two fine lines they would all be fine
    options = {
        "MeshOnlyVisible": 1, "MeshSizeMax": size.seed, "MeshSizeExtendFromBoundary": -3,
        "MeshSizeFromCurvature": size.around,
    }  # fmt: skip
    with mesh_options(options):
        gmsh.model.mesh.generate(dimension)


def _refine(size: Size, faces: Sequence[int]) -> None:
    """Sizes that grow away from fine points, from where partners end, and from circles."""
    field = gmsh.model.mesh.field
    for tag in field.list():
        field.remove(tag)
    curves = sorted({tag for face in faces for tag in gmsh.model.getAdjacencies(2, face)[1]})
    lines = _ends_inside(curves, faces) if size.edge else []
    around = {tag: 2 * pi * _radius(tag) / size.around for tag in curves if _is("Circle", tag)}
    fields = [_ball(f, size.seed) for f in size.fine if f.size < size.seed]
    fields += [_from(lines, size.edge, size.seed, STEEP)] if lines else []
    for fine in sorted({round(s, 9) for s in around.values() if s < size.seed}):
        circles = [tag for tag, s in around.items() if round(s, 9) == fine]
        fields.append(_from(circles, fine, size.seed, GRADING))
    least = field.add("Min")
    field.setNumbers(least, "FieldsList", fields)
    field.setAsBackgroundMesh(least)


def _ends_inside(curves: Sequence[int], faces: Sequence[int]) -> list[int]:
    """Straight lines between parts of one plane: there a partner ends."""
    flat = {tag for tag in faces if gmsh.model.getType(2, tag) == "Plane"}
    return [c for c in curves if _is("Line", c) and _in_plane(c, flat)]


def _in_plane(curve: int, flat: set[int]) -> bool:
    beside = [tag for tag in gmsh.model.getAdjacencies(1, curve)[0] if tag in flat]
    normals = [gmsh.model.getEntityProperties(2, tag)[1][:3] for tag in beside]
    return len(normals) == 2 and parallel(*normals)


def _is(kind: str, curve: int) -> bool:
    return gmsh.model.getType(1, curve) == kind


def _radius(circle: int) -> float:
    first, _ = gmsh.model.getParametrizationBounds(1, circle)
    return 1 / gmsh.model.getCurvature(1, circle, first)[0]


def _ball(fine: Fine, coarse: float) -> int:
    middle = dict(zip(("XCenter", "YCenter", "ZCenter"), fine.point, strict=True))
    growing = {"Radius": fine.size, "Thickness": (coarse - fine.size) / GRADING}
    return _field("Ball", middle | growing | {"VIn": fine.size, "VOut": coarse})


def _from(curves: Sequence[int], fine: float, coarse: float, growth: float) -> int:
    away = _field("Distance", {"Sampling": SAMPLED})
    gmsh.model.mesh.field.setNumbers(away, "CurvesList", curves)
    growing = {"DistMin": 0.0, "DistMax": (coarse - fine) / growth}
    return _field("Threshold", growing | {"InField": away, "SizeMin": fine, "SizeMax": coarse})


def _field(kind: str, numbers: Mapping[str, float]) -> int:
    tag = gmsh.model.mesh.field.add(kind)
    for name, value in numbers.items():
        gmsh.model.mesh.field.setNumber(tag, name, value)
    return tag
