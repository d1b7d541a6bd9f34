"""Hexahedra of a body that is an extruded outline: a box, a plate with holes, a tube.

top    =======          a body is an extrusion when its faces are two caps, equal planes normal to
sides  |  ||  |         an axis, and sides along that axis, planes or cylinders; its volume is then
base   =======          the area of a cap times the height

Everything imprinted on its caps and sides is drawn on the base, which is meshed in quadrilaterals:

    rectangles that carry only rectangles     a grid
    rings                                     a polar grid
    any other                                 gmsh's triangles joined, and split once more

Copies of the base are stacked in layers, which end where an imprint on a side ends.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import pairwise
from math import pi
from typing import NamedTuple

import gmsh
import numpy as np
from numpy.typing import NDArray
from skfem import MeshHex

from beadwave.geometry.cad.imprint import Region
from beadwave.geometry.cad.occ import distance
from beadwave.geometry.cad.selectors import FaceSelection
from beadwave.geometry.cad.solids import SAME, Body, Face, Vector, off_axis, parallel
from beadwave.geometry.meshing.curved_faces import (
    NO_MIDDLES,
    EdgeMiddles,
    edges_around,
    middles_of,
)
from beadwave.geometry.meshing.gmsh_session import boolean_tolerance, failing, mesh_options
from beadwave.geometry.meshing.roundness import enclosing, full_cylinders
from beadwave.geometry.meshing.size_field import smallest_at
from beadwave.geometry.meshing.sizes import Size, mesh_visible, size_at
from beadwave.geometry.own_mesh.facets import EXTRUDED, facets_of, triangles

TRIANGLE, QUADRILATERAL = 2, 3  # gmsh's element types
# gmsh's algorithms for triangles and for joining them to quadrilaterals, the best first. Full-quad
# halves all lines and fails on a line of a single element, which smaller elements (MeshSizeFactor)
# avoid: covers with two holes have 1.7 to 2.1 times the elements then
JOINED = (
    {"Algorithm": 8, "RecombinationAlgorithm": 2},  # frontal for quadrilaterals, simple full-quad
    {"Algorithm": 6, "RecombinationAlgorithm": 2},  # frontal, simple full-quad
    {"Algorithm": 5, "RecombinationAlgorithm": 3},  # Delaunay, full-quad by blossom
    {
        "RecombinationAlgorithm": 1,
        "SubdivisionAlgorithm": 1,
        "MeshSizeFactor": 2,
    },  # by blossom, split
    {"Algorithm": 8, "RecombinationAlgorithm": 2, "MeshSizeFactor": 0.7},
    {"Algorithm": 8, "RecombinationAlgorithm": 2, "MeshSizeFactor": 0.5},
)
# of sizes that vary: rims are fine there, and a quadrilateral with two edges on one has a corner of
# nearly 180 degrees; of a plate with four washers one of these has none, at 1.1 to 3 times the
# elements
OF_FIELDS = (
    *JOINED[:3],
    *(
        {"Algorithm": algorithm, "RecombinationAlgorithm": 2, "MeshSizeFactor": factor}
        for factor in (0.9, 0.85, 0.8, 0.75, 0.7, 0.6)
        for algorithm in (6, 8)
    ),
    *JOINED[3:],
)


VOLUME_TOLERANCE = 1e-9  # relative difference of area times height from the volume
UPRIGHT_TOLERANCE = 1e-6  # component of a side's unit normal along the axis
FILLED_TOLERANCE = 1e-6  # relative difference of a rectangle's area from what should fill it
MIN_SINE = 0.15  # sine of the sharpest corner; a sharper one is left to tetrahedra
# the same, from which on no other algorithm is tried. On a corner of 0.19 at an inner edge of a
# U profile the error of the first mode was stated 7 times too large; not varied
FAIR_SINE = 0.3
# times the same, from which on a mesh is taken in place of one before. Where the outline itself
# has such a corner all algorithms have it, and rounding chose meshes of half the size
FAIRER_FACTOR = 1.1


class Prism(NamedTuple):
    """A body as an extrusion."""

    axis: Vector  # (3,) unit vector from base to top
    height: float  # m
    base: tuple[Face, ...]
    top: tuple[Face, ...]
    sides: tuple[Face, ...]

    def heights(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Heights (...) [m] of points (..., 3) above the base."""
        return (points - self.base[0].centre) @ self.axis

    def foot(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (..., 3) moved along the axis onto the base."""
        return points - self.heights(points)[..., None] * self.axis


class SidePatch(NamedTuple):
    """A part of a side between two heights and two lines along the axis."""

    region: Region
    lower: float  # [m] above the base
    upper: float  # m
    feet: NDArray[np.float64]  # (n, 3) [m], where those lines meet the base


class Imprints(NamedTuple):
    """Surfaces whose rims must be lines of a prism's mesh, by tag."""

    base: dict[int, Region]  # on the base or the top
    sides: dict[int, SidePatch]

    @property
    def sharp(self) -> list[SidePatch]:
        """Parts of sides along whose rims stresses are singular."""
        return [patch for patch in self.sides.values() if patch.region.sharp]


class BaseMesh(NamedTuple):
    """A mesh of the base in quadrilaterals."""

    p: NDArray[np.float64]  # (n, 3) [m] nodes on the base
    quads: NDArray[np.int64]  # (m, 4) their nodes
    parts: dict[int, NDArray[np.int64]]  # quadrilaterals of caps and imprints, by tag


class Layers(NamedTuple):
    """A base of n nodes and its copies above each other; node i of layer k has the number i
    + k n."""

    prism: Prism
    base: BaseMesh
    edges: NDArray[np.int64]  # (m, 2) nodes of the edges around the base
    under: NDArray[np.int64]  # (m,) tag of the side above each edge
    heights: NDArray[np.float64]  # (k,) [m] of the layers

    def cap(self, part: int, on: int) -> NDArray[np.int64]:
        """Nodes (m, 4) of the facets of a part of the cap `on`, base or top."""
        below = any(face.tag == on for face in self.prism.base)
        top = 0 if below else (len(self.heights) - 1) * len(self.base.p)
        return self.base.quads[self.base.parts[part]] + top

    def wall(self, edges: NDArray[np.int64], lower: float, upper: float) -> NDArray[np.int64]:
        """Nodes (m, 4) of the facets above edges (e, 2) of the base, between two heights [m]."""
        middle = (self.heights[1:] + self.heights[:-1]) / 2
        layers = np.flatnonzero((middle > lower) & (middle < upper))
        low = (edges[None] + layers[:, None, None] * len(self.base.p)).reshape(-1, 2)
        return np.concatenate([low, low[:, ::-1] + len(self.base.p)], axis=1)

    def face(self, tag: int) -> NDArray[np.int64]:
        """Nodes (m, 4) of the facets of a whole face."""
        if tag in self.base.parts:
            return self.cap(tag, tag)
        return self.wall(self.edges[self.under == tag], 0, self.prism.height)

    def patch(self, patch: SidePatch, gap: float) -> NDArray[np.int64]:
        """Nodes (m, 4) of the facets of a part of a side, whose place is known within the
        gap [m]."""
        side = next(face for face in self.prism.sides if face.tag == patch.region.on)
        edges = self.edges[self.under == side.tag]
        half_way_up = (patch.lower + patch.upper) / 2 * self.prism.axis
        middle = _onto(side, self.base.p[edges].mean(axis=1)) + half_way_up
        inside = [distance(point, patch.region.tag) < SAME + 2 * gap for point in middle]
        return self.wall(edges[np.array(inside, dtype=bool)], patch.lower, patch.upper)


def hexahedra(
    body: Body,
    wanted: Mapping[str, Sequence[Region]],
    named: Mapping[str, FaceSelection],
    size: Size,
    gap: float,
) -> tuple[MeshHex, EdgeMiddles] | None:
    """The body in hexahedra with the boundaries, and the middles of edges, that `tetrahedra` gives
    it; None where it is no extrusion, or one whose base no algorithm meshes fairly. The surfaces
    `wanted` are not consumed, so that tetrahedra can still use them. `gap` [m] is the distance up
    to which bodies touch.
    """
    # the lowest extrusion on which all imprints can be meshed
    for prism in prisms(body):
        marks = imprints(prism, wanted)
        if marks is None:
            continue
        feet = (f._replace(point=prism.foot(f.point)) for f in size.fine)
        of_base = size._replace(fine=tuple(feet))
        base = (
            _grid(prism, marks, of_base)
            or _ring(prism, marks, of_base)
            or _joined(prism, marks, of_base, gap)
        )
        if base is not None:
            break
    else:
        return None

    # anticlockwise seen against the axis, so that all hexahedra are right-handed
    p, quads = base.p, base.quads.copy()
    diagonals = p[quads[:, 2]] - p[quads[:, 0]], p[quads[:, 3]] - p[quads[:, 1]]
    turned = np.cross(*diagonals) @ prism.axis < 0
    quads[turned] = quads[turned][:, ::-1]
    base = base._replace(quads=quads)

    # the base is fixed from here on; node i of layer k gets the number i + k n. Heights of the
    # layers: lines where imprints on sides end, smaller elements where stresses are singular
    stops = [end for patch in marks.sides.values() for end in (patch.lower, patch.upper)]
    sharp: list[float] = []
    if not size.edge:
        sharp += [end for patch in marks.sharp for end in (patch.lower, patch.upper)]
        below = {face.tag for face in prism.base}
        on_caps = (region for region in marks.base.values() if region.sharp)
        sharp += [0.0 if region.on in below else prism.height for region in on_caps]
    foot = prism.base[0].centre @ prism.axis
    heights = spaced(
        [0.0, prism.height, *stops],
        lambda z: size_at(size, z + foot, prism.axis, np.add(foot, sharp)),
    )

    # an edge of the rim belongs to one quadrilateral only; the side above it is the one whose
    # surface holds both its ends. Where several sides share that plane or cylinder, it is the one
    # that is nearest to the middle of the edge
    edges = np.sort(quads[:, [[0, 1], [1, 2], [2, 3], [3, 0]]].reshape(-1, 2))
    edges, count = np.unique(edges, axis=0, return_counts=True)
    rim = edges[count == 1]
    ends = p[rim]  # (m, 2, 3)
    surface_distances = []
    for side in prism.sides:
        if side.normal is not None:
            off = np.abs((ends - side.centre) @ side.normal)
        else:
            off = np.abs(off_axis(ends, side.on_axis, side.axis) - side.radius)
        surface_distances.append(off.max(axis=1))
    off = np.array(surface_distances)
    under = np.array([side.tag for side in prism.sides])[np.argmin(off, axis=0)]
    for i in np.flatnonzero(np.sum(off < 2 * SAME, axis=0) > 1):
        middle = ends[i].mean(axis=0)[None] + prism.height / 2 * prism.axis
        rivals = [side for side, d in zip(prism.sides, off[:, i], strict=True) if d < 2 * SAME]
        distances = [distance(_onto(side, middle)[0], side.tag) for side in rivals]
        under[i] = rivals[int(np.argmin(distances))].tag
    layers = Layers(prism, base, rim, under, heights)

    # facets of the imprints and of the named faces
    corners = {}
    for name, regions in wanted.items():
        facets = [
            layers.patch(marks.sides[region.tag], gap)
            if region.tag in marks.sides
            else layers.cap(region.tag, region.on)
            for region in regions
        ]
        corners[name] = np.unique(np.concatenate(facets), axis=0)
    for name, selected in named.items():
        if selected.body == body.name:
            corners[name] = np.concatenate([layers.face(tag) for tag in selected.tags])

    # copies of the base; straight elements have their nodes on cylinders moved out to keep the
    # cylinders' volume
    n, middles = len(p), NO_MIDDLES
    points = (p + heights[:, None, None] * prism.axis).reshape(-1, 3)
    if size.curved:
        round_sides = [side for side in prism.sides if side.axis is not None]
        bent = [edges_around(layers.face(side.tag)) for side in round_sides]
        on = [_onto(s, points[e].mean(axis=1)) for s, e in zip(round_sides, bent, strict=True)]
        middles = middles_of(points, bent, on)
    else:
        cylinders = full_cylinders(body.tag, gap)
        tags = [face.tag for cylinder in cylinders for face in cylinder]
        points = enclosing(points, {tag: triangles(layers.face(tag)) for tag in tags}, cylinders)
    quads = quads + np.arange(len(heights) - 1)[:, None, None] * n
    quads = quads.reshape(-1, 4).T
    t = np.concatenate([quads, quads + n])[EXTRUDED]
    mesh = MeshHex(np.ascontiguousarray(points.T), np.ascontiguousarray(t))
    facets = {name: facets_of(mesh, quad) for name, quad in corners.items()}
    return mesh.with_boundaries(facets), middles


def _onto(side: Face, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (n, 3) [m] on chords of a side, moved onto it radially if it is a cylinder."""
    if side.axis is None:
        return points
    rho = points - side.on_axis
    rho -= np.outer(rho @ side.axis, side.axis)
    return points + (side.radius / np.linalg.norm(rho, axis=1, keepdims=True) - 1) * rho


def prisms(body: Body) -> Iterator[Prism]:
    """All extrusions that a body can be seen as, a box as three, in order of their heights: of a
    plate the one across its thickness is first, whose base shows all of its holes."""
    extrusions = []
    normals = [face.normal for face in body.faces if face.normal is not None]
    for i, axis in enumerate(normals):
        if any(parallel(axis, earlier) for earlier in normals[:i]):
            continue
        caps = [f for f in body.faces if f.normal is not None and parallel(f.normal, axis)]
        sides = tuple(f for f in body.faces if not any(f is cap for cap in caps))
        top = tuple(f for f in caps if f.normal @ axis > 0)
        base = tuple(f for f in caps if f.normal @ axis < 0)
        upright = all(
            abs(f.normal @ axis) < UPRIGHT_TOLERANCE
            if f.normal is not None
            else f.axis is not None and parallel(f.axis, axis)
            for f in sides
        )
        if not (top and base and upright):
            continue

        # both caps have the area volume / height, and all corners of the sides lie at either end
        levels = [[f.centre @ axis for f in faces] for faces in (base, top)]
        height = levels[1][0] - levels[0][0]
        if not max(np.ptp(levels[0]), np.ptp(levels[1])) < SAME:
            continue
        areas = [sum(f.area for f in faces) for faces in (base, top)]
        volumes = [areas[1] * height, areas[0] * height]
        if not np.allclose(volumes, body.volume, rtol=VOLUME_TOLERANCE, atol=0):
            continue
        corners = [
            [gmsh.model.getValue(0, tag, []) @ axis for tag in corners_of(f.tag)] for f in sides
        ]
        if all(np.ptp(h) > height - SAME and np.all(_at_either_end(h)) for h in corners):
            extrusions.append(Prism(axis, height, base, top, sides))
    yield from sorted(extrusions, key=lambda prism: prism.height)


def _at_either_end(values: Sequence[float]) -> NDArray[np.bool_]:
    """(n,) True for values [m] that equal the lowest or the highest one, within `SAME`."""
    lowest, highest = min(values), max(values)
    off = np.minimum(np.abs(np.subtract(values, lowest)), np.abs(np.subtract(values, highest)))
    return off < SAME


def corners_of(face: int) -> list[int]:
    """Tags of the points at the corners of a face."""
    points = gmsh.model.getBoundary([(2, face)], combined=False, oriented=False, recursive=True)
    return [tag for dimension, tag in points if dimension == 0]


def imprints(prism: Prism, wanted: Mapping[str, Sequence[Region]]) -> Imprints | None:
    """The regions on caps and sides of an extrusion; None when one on a side is not bounded by two
    heights and two lines along the axis, since layers cannot end on its rim then."""
    caps = {face.tag for face in prism.base + prism.top}
    base, sides = {}, {}
    for region in (region for regions in wanted.values() for region in regions):
        if region.on in caps:
            base[region.tag] = region
            continue
        levels, feet = [], []
        for _, curve in gmsh.model.getBoundary([(2, region.tag)], oriented=False):
            (start,), (end,) = gmsh.model.getParametrizationBounds(1, curve)
            points = gmsh.model.getValue(1, curve, np.linspace(start, end, 5)).reshape(-1, 3)
            heights, on_base = prism.heights(points), prism.foot(points)
            if np.ptp(heights) < SAME:
                levels.append(heights[0])
            elif np.ptp(on_base, axis=0).max() < SAME:
                feet.append(on_base[0])
            else:
                return None
        if len(levels) < 2 or not np.all(_at_either_end(levels)):
            return None
        sides[region.tag] = SidePatch(region, min(levels), max(levels), np.reshape(feet, (-1, 3)))
    return Imprints(base, sides)


def spaced(stops: Sequence[float], size: Callable[[NDArray], NDArray]) -> NDArray[np.float64]:
    """Ascending points from the lowest to the highest stop [m], through all stops.

    Between two stops they divide the integral of 1 / size evenly, rounded to a whole number; `size`
    [m] is the distance between points as a function of their places (k,) [m].
    """
    # stops within a nanometre are one: a rim and an edge in the same place differ by rounding
    ordered = np.unique(np.round(stops, 9))
    points = [ordered[:1]]
    for lower, upper in pairwise(ordered):
        x = np.linspace(lower, upper, 1001)
        density = 1 / size(x)
        cells = np.concatenate([[0], np.cumsum((density[1:] + density[:-1]) / 2 * np.diff(x))])
        n = max(1, round(cells[-1]))
        points.append(np.interp(np.linspace(0, cells[-1], n + 1)[1:], cells, x))
    return np.concatenate(points)


def _grid(prism: Prism, marks: Imprints, size: Size) -> BaseMesh | None:
    """Base mesh of a rectangle on which all imprints are rectangles along its sides."""
    # a rectangle: one base, one top, four plane sides along two directions u and v
    normals = [face.normal for face in prism.sides]
    if len(prism.base) + len(prism.top) + len(normals) != 6 or any(n is None for n in normals):
        return None
    u = normals[0]
    v = np.cross(prism.axis, u)
    if not all(parallel(n, u) or parallel(n, v) for n in normals):
        return None

    # spans of the imprints along u and v, if they fill the rectangle between these
    boxes = {}
    for tag in marks.base:
        corners = np.array([gmsh.model.getValue(0, corner, []) for corner in corners_of(tag)])
        spans = tuple((float((corners @ a).min()), float((corners @ a).max())) for a in (u, v))
        filled = np.prod([upper - lower for lower, upper in spans])
        area = gmsh.model.occ.getMass(2, tag)
        if not (len(corners) and abs(filled - area) < FILLED_TOLERANCE * area):
            return None
        boxes[tag] = spans

    # grid lines through the ends of the base and of all imprints, closer to those that are singular
    feet = np.concatenate(
        [np.reshape(patch.feet, (-1, 3)) for patch in marks.sides.values()]
        + [np.array([gmsh.model.getValue(0, tag, []) for tag in corners_of(prism.base[0].tag)])]
    )
    lines = []
    for i, axis in enumerate((u, v)):
        stops = [*(feet @ axis), *(end for box in boxes.values() for end in box[i])]
        if size.edge:
            edges = [end for end in stops if min(stops) + SAME < end < max(stops) - SAME]
        else:
            edges = [end for tag, box in boxes.items() if marks.base[tag].sharp for end in box[i]]
            edges += [end for patch in marks.sharp for end in patch.feet @ axis]
        lines.append(spaced(stops, partial(size_at, size, axis=axis, edges=edges)))
    x, y = np.meshgrid(*lines, indexing="ij")
    off = (prism.base[0].centre @ prism.axis) * prism.axis
    p = off + x.reshape(-1, 1) * u + y.reshape(-1, 1) * v
    quads = _structured(*x.shape)

    # each imprint is made of the quadrilaterals whose middles lie in its rectangle
    middle = p[quads].mean(axis=1) @ np.array([u, v]).T
    parts = {}
    for tag, box in boxes.items():
        lower, upper = np.transpose(box)
        parts[tag] = np.flatnonzero(np.all((middle > lower) & (middle < upper), axis=1))
    return BaseMesh(p, quads, parts | _caps(prism, len(quads)))


def _caps(prism: Prism, n: int) -> dict[int, NDArray[np.int64]]:
    """The parts that base and top are: all n quadrilaterals."""
    return {face.tag: np.arange(n) for face in (*prism.base, *prism.top)}


def _structured(rows: int, columns: int) -> NDArray[np.int64]:
    """Nodes (m, 4) of the quadrilaterals of a grid of points, which are numbered row by row."""
    ix = np.arange(rows * columns).reshape(rows, columns)
    return np.stack(
        [ix[:-1, :-1].ravel(), ix[1:, :-1].ravel(), ix[1:, 1:].ravel(), ix[:-1, 1:].ravel()], axis=1
    )


def _ring(prism: Prism, marks: Imprints, size: Size) -> BaseMesh | None:
    """Polar base mesh from bore to outer radius; only where imprints cover a whole cap or part of a
    side."""
    if len(prism.base) + len(prism.top) != 2 or len(prism.sides) != 2:
        return None
    a, b = prism.sides
    if a.axis is None or b.axis is None or a.hollow == b.hollow or size.fine:
        return None
    covered = [gmsh.model.occ.getMass(2, tag) for tag in marks.base]
    if not np.allclose(covered, prism.base[0].area, rtol=FILLED_TOLERANCE, atol=0):
        return None

    # axes u, v across the axis; lines along the radius through the feet of side patches, and one at
    # angle 0, from which the others are counted
    inner, outer = sorted(prism.sides, key=lambda face: face.radius)
    centre = prism.foot(outer.on_axis)
    u = np.cross(prism.axis, np.eye(3)[np.argmin(abs(prism.axis))])
    u = u / np.linalg.norm(u)
    v = np.cross(prism.axis, u)
    feet = [patch.feet - centre for patch in marks.sides.values()]
    angles = [np.arctan2(f @ v, f @ u) % (2 * pi) for f in feet]
    stops = np.concatenate([*angles, [0.0, 2 * pi]])
    step = min(size.seed / outer.radius, 2 * pi / size.around)
    along_angle = partial(np.full_like, fill_value=step)
    along_radius = partial(np.full_like, fill_value=size.seed)
    if size.field:
        foot = prism.foot(size.field.points) - centre
        r, across = np.linalg.norm(foot, axis=1), size.field.across(prism.axis)
        turned = np.arctan2(foot @ v, foot @ u) % (2 * pi)
        along_radius = partial(smallest_at, r, across)
        along_angle = partial(smallest_at, turned, np.minimum(across / outer.radius, step))
    angle = spaced(stops, along_angle)[:-1]
    radius = spaced([inner.radius, outer.radius], along_radius)
    r, phi = np.meshgrid(radius, angle, indexing="ij")
    r, phi = r.reshape(-1, 1), phi.reshape(-1, 1)
    p = centre + r * (np.cos(phi) * u + np.sin(phi) * v)

    # the last column is the first again
    ix = np.arange(len(p)).reshape(len(radius), len(angle))
    ix = np.column_stack([ix, ix[:, 0]])
    quads = ix.ravel()[_structured(*ix.shape)]
    parts = {tag: np.arange(len(quads)) for tag in marks.base}
    return BaseMesh(p, quads, parts | _caps(prism, len(quads)))


def _joined(prism: Prism, marks: Imprints, size: Size, gap: float) -> BaseMesh | None:
    """Base mesh by gmsh with all imprints fused into it, without triangles, overlaps and sharp
    corners: by the first of its algorithms whose corners are fair, else by the one with the least
    sharp corner. None where all corners are too sharp."""
    occ, mesh = gmsh.model.occ, gmsh.model.mesh

    # copies of caps and imprints, moved along the axis onto the base, and the feet of side patches
    tags = [face.tag for face in prism.base + prism.top] + list(marks.base)
    copies = []
    for tag in tags:
        ((_, copy),) = occ.copy([(2, tag)])
        height = prism.heights(np.array(occ.getCenterOfMass(2, copy)))
        occ.translate([(2, copy)], *(-height * prism.axis))
        copies.append(copy)
    n = len(prism.base)
    feet = [point for patch in marks.sides.values() for point in patch.feet]
    points = [(0, occ.addPoint(*point)) for point in feet]
    with boolean_tolerance(2 * gap):
        _, became = occ.fragment(
            [(2, t) for t in copies[:n]], [(2, t) for t in copies[n:]] + points
        )
    occ.synchronize()
    pieces = {
        tag: [t for d, t in entities if d == 2] for tag, entities in zip(tags, became, strict=False)
    }
    visible = sorted({t for surfaces in pieces.values() for t in surfaces})

    size = size._replace(field=size.field and size.field.on_base(prism.axis))

    # algorithms one after the other; triangles left over cannot be extruded to hexahedra
    best, sharpest = None, MIN_SINE
    for options in OF_FIELDS if size.field else JOINED:
        try:
            with failing("no quadrilaterals"), mesh_options({"RecombineAll": 1, **options}):
                mesh_visible([(2, tag) for tag in visible], size)
        except ValueError:
            continue
        if any(len(mesh.getElementsByType(TRIANGLE, tag)[0]) for tag in visible):
            continue
        nodes = [mesh.getElementsByType(QUADRILATERAL, tag)[1].reshape(-1, 4) for tag in visible]
        first = np.cumsum([0, *map(len, nodes)])
        of = {tag: np.arange(*first[i : i + 2]) for i, tag in enumerate(visible)}
        node_tags, coordinates, _ = mesh.getNodes()
        used, quads = np.unique(np.concatenate(nodes), return_inverse=True)
        row = np.argsort(node_tags)
        p = coordinates.reshape(-1, 3)[row[np.searchsorted(node_tags, used, sorter=row)]]
        quads = quads.reshape(-1, 4)

        # joined in a narrow gap some quadrilaterals lie over others, the other way round
        overlapping = False
        for tag in visible:
            a, b, c, d = (p[corner] for corner in quads[of[tag]].T)
            area = np.cross(c - a, d - b)
            overlapping |= bool(np.any(area @ area.sum(axis=0) <= 0))
        if overlapping:
            continue

        # sine of the sharpest or bluntest corner, negative in an element turned inside out
        corners = p[quads]
        ahead = np.roll(corners, -1, axis=1) - corners
        behind = np.roll(corners, 1, axis=1) - corners
        area = np.cross(ahead, behind)
        upright = area.sum(axis=1, keepdims=True)
        sine = np.sum(area * upright, axis=2) / np.linalg.norm(upright, axis=2)
        lengths = np.linalg.norm(ahead, axis=2) * np.linalg.norm(behind, axis=2)
        corner = float((sine / lengths).min())
        if corner > sharpest * (FAIRER_FACTOR if best else 1.0):
            parts = {tag: np.concatenate([of[t] for t in ts]) for tag, ts in pieces.items()}
            best, sharpest = BaseMesh(p, quads, parts), corner
        if sharpest > FAIR_SINE:
            break
    return best
