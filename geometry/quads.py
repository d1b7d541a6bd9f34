"""Quadrilaterals on the base of a prism, with everything imprinted on its caps and sides.

Rectangles that carry only rectangles become grids, rings become polar grids; any other base is
meshed by gmsh in triangles that are joined to quadrilaterals and split once more.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import pairwise
from math import pi
from typing import NamedTuple

import gmsh
import numpy as np
from numpy.typing import NDArray

from geometry.gmsh_session import boolean_tolerance, failing, mesh_options
from geometry.prism import Imprints, Prism, corners_of
from geometry.sizes import Size, mesh_visible, size_at
from geometry.solids import SAME, Vector, parallel

TRIANGLE, QUADRILATERAL = 2, 3  # gmsh's element types
# gmsh's algorithms for triangles (frontal for quadrilaterals, frontal, Delaunay) and for joining
# them (full-quad, by blossom, or simple and split), the best first; full-quad halves all lines and
# gives up on one of a single element, which smaller elements avoid
JOINED = (
    {"Algorithm": 8, "RecombinationAlgorithm": 2},
    {"Algorithm": 8, "RecombinationAlgorithm": 2, "MeshSizeFactor": 0.7},
    {"Algorithm": 8, "RecombinationAlgorithm": 2, "MeshSizeFactor": 0.5},
    {"Algorithm": 6, "RecombinationAlgorithm": 2},
    {"Algorithm": 5, "RecombinationAlgorithm": 3},
    {"RecombinationAlgorithm": 1, "SubdivisionAlgorithm": 1, "MeshSizeFactor": 2},
)
SQUARE = 0.15  # sine of the sharpest corner, less is left to tetrahedra


class Flat(NamedTuple):
    """A mesh of the base; `parts` are the quadrilaterals of caps and imprints, by their tags."""

    p: NDArray[np.float64]  # (n, 3) on the base [m]
    quads: NDArray[np.int64]  # (m, 4)
    parts: dict[int, NDArray[np.int64]]


def flat_mesh(prism: Prism, marks: Imprints, size: Size, gap: float) -> Flat | None:
    """The base meshed; None when gmsh leaves a triangle."""
    return _grid(prism, marks, size) or _ring(prism, marks, size) or _free(prism, marks, size, gap)


def spaced(stops: Sequence[float], size: Callable[[NDArray], NDArray]) -> NDArray[np.float64]:
    """Points from the first to the last stop through all of them, apart as `size` says.

    Between two stops the points divide the integral of 1 / size evenly.
    """
    ordered = np.unique(np.round(stops, 9))
    points = [ordered[:1]]
    for lower, upper in pairwise(ordered):
        x = np.linspace(lower, upper, 1001)
        density = 1 / size(x)
        done = np.concatenate([[0], np.cumsum((density[1:] + density[:-1]) / 2 * np.diff(x))])
        n = max(1, round(done[-1]))
        points.append(np.interp(np.linspace(0, done[-1], n + 1)[1:], done, x))
    return np.concatenate(points)


def _grid(prism: Prism, marks: Imprints, size: Size) -> Flat | None:
    axes = _sides_of_rectangle(prism)
    boxes = {tag: _rectangle(tag, axes) for tag in marks.base} if axes else {}
    if axes is None or None in boxes.values():
        return None
    u, v = axes
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
    middle = p[quads].mean(axis=1) @ np.array([u, v]).T
    parts = {tag: np.flatnonzero(_within(middle, box)) for tag, box in boxes.items()}
    return Flat(p, quads, parts | _whole_caps(prism, len(quads)))


def _within(points: NDArray[np.float64], box) -> NDArray[np.bool_]:
    lower, upper = np.transpose(box)
    return np.all((points > lower) & (points < upper), axis=1)


def _sides_of_rectangle(prism: Prism) -> tuple[Vector, Vector] | None:
    normals = [face.normal for face in prism.sides]
    if len(prism.base) + len(prism.top) + len(normals) != 6 or any(n is None for n in normals):
        return None
    u = normals[0]
    v = np.cross(prism.axis, u)
    return (u, v) if all(parallel(n, u) or parallel(n, v) for n in normals) else None


def _rectangle(tag: int, axes) -> tuple | None:
    """Its extent along both axes, when the surface fills it."""
    points = np.array([gmsh.model.getValue(0, corner, []) for corner in corners_of(tag)])
    spans = tuple((float((points @ a).min()), float((points @ a).max())) for a in axes)
    filled = np.prod([upper - lower for lower, upper in spans])
    area = gmsh.model.occ.getMass(2, tag)
    return spans if len(points) and abs(filled - area) < 1e-6 * area else None


def _whole_caps(prism: Prism, n: int) -> dict[int, NDArray[np.int64]]:
    return {face.tag: np.arange(n) for face in (*prism.base, *prism.top)}


def _structured(rows: int, columns: int) -> NDArray[np.int64]:
    ix = np.arange(rows * columns).reshape(rows, columns)
    return np.stack(
        [ix[:-1, :-1].ravel(), ix[1:, :-1].ravel(), ix[1:, 1:].ravel(), ix[:-1, 1:].ravel()], axis=1
    )


def _ring(prism: Prism, marks: Imprints, size: Size) -> Flat | None:
    """Polar, from bore to outer radius; only where imprints cover a whole cap or part of a side."""
    whole = prism.base[0].area
    covered = [gmsh.model.occ.getMass(2, tag) for tag in marks.base]
    if not _is_ring(prism) or size.fine or not np.allclose(covered, whole, rtol=1e-6, atol=0):
        return None
    inner, outer = sorted(prism.sides, key=lambda face: face.radius)
    centre = prism.foot(outer.on_axis)
    u = _across(prism.axis)
    v = np.cross(prism.axis, u)
    feet = [patch.feet - centre for patch in marks.sides.values()]
    angles = [np.arctan2(f @ v, f @ u) % (2 * pi) for f in feet]
    stops = np.concatenate([*angles, [0.0, 2 * pi]])
    step = min(size.seed / outer.radius, 2 * pi / size.around)
    angle = spaced(stops, lambda x: np.full_like(x, step))[:-1]
    radius = spaced([inner.radius, outer.radius], lambda x: np.full_like(x, size.seed))
    r, a = np.meshgrid(radius, angle, indexing="ij")
    r, a = r.reshape(-1, 1), a.reshape(-1, 1)
    p = centre + r * (np.cos(a) * u + np.sin(a) * v)
    ix = np.arange(len(p)).reshape(len(radius), len(angle))
    ix = np.column_stack([ix, ix[:, 0]])
    quads = ix.ravel()[_structured(*ix.shape)]
    parts = {tag: np.arange(len(quads)) for tag in marks.base}
    return Flat(p, quads, parts | _whole_caps(prism, len(quads)))


def _is_ring(prism: Prism) -> bool:
    if len(prism.base) + len(prism.top) != 2 or len(prism.sides) != 2:
        return False
    one, other = prism.sides
    return one.axis is not None and other.axis is not None and one.hollow != other.hollow


def _across(axis: Vector) -> Vector:
    """A unit vector at right angles to the axis."""
    u = np.cross(axis, np.eye(3)[np.argmin(abs(axis))])
    return u / np.linalg.norm(u)


def _free(prism: Prism, marks: Imprints, size: Size, gap: float) -> Flat | None:
    """By gmsh, of the base with all imprints fused into it."""
    occ = gmsh.model.occ
    tags = [face.tag for face in prism.base + prism.top] + list(marks.base)
    feet = [_on_base(prism, tag) for tag in tags]
    n = len(prism.base)
    points = [p for patch in marks.sides.values() for p in patch.feet]
    ends = [(0, occ.addPoint(*point)) for point in points]
    with boolean_tolerance(2 * gap):
        _, became = occ.fragment([(2, t) for t in feet[:n]], [(2, t) for t in feet[n:]] + ends)
    occ.synchronize()
    pieces = {
        tag: [t for d, t in parts if d == 2] for tag, parts in zip(tags, became, strict=False)
    }
    visible = sorted({t for parts in pieces.values() for t in parts})
    tried = (_joined(pieces, visible, size, options) for options in JOINED)
    return next((flat for flat in tried if flat and _squareness(flat) > SQUARE), None)


def _joined(pieces, visible, size: Size, options: Mapping[str, float]) -> Flat | None:
    try:
        with failing("no quadrilaterals"), mesh_options({"RecombineAll": 1, **options}):
            mesh_visible([(2, tag) for tag in visible], size)
    except ValueError:
        return None
    return _read(pieces, visible)


def _squareness(flat: Flat) -> float:
    """Sine of the sharpest or bluntest corner, negative in an element turned inside out."""
    corners = flat.p[flat.quads]
    ahead = np.roll(corners, -1, axis=1) - corners
    behind = np.roll(corners, 1, axis=1) - corners
    area = np.cross(ahead, behind)
    upright = area.sum(axis=1, keepdims=True)
    sine = np.sum(area * upright, axis=2) / np.linalg.norm(upright, axis=2)
    lengths = np.linalg.norm(ahead, axis=2) * np.linalg.norm(behind, axis=2)
    return float((sine / lengths).min())


def _on_base(prism: Prism, tag: int) -> int:
    """A copy of a surface on a cap, moved along the axis onto the base."""
    occ = gmsh.model.occ
    ((_, copy),) = occ.copy([(2, tag)])
    height = prism.heights(np.array(occ.getCenterOfMass(2, copy)))
    occ.translate([(2, copy)], *(-height * prism.axis))
    return copy


def _read(pieces: dict[int, list[int]], visible: list[int]) -> Flat | None:
    mesh = gmsh.model.mesh
    if any(len(mesh.getElementsByType(TRIANGLE, tag)[0]) for tag in visible):
        return None
    found = [mesh.getElementsByType(QUADRILATERAL, tag)[1].reshape(-1, 4) for tag in visible]
    first = np.cumsum([0, *map(len, found)])
    of = {tag: np.arange(*first[i : i + 2]) for i, tag in enumerate(visible)}
    tags, points, _ = mesh.getNodes()
    used, quads = np.unique(np.concatenate(found), return_inverse=True)
    row = np.argsort(tags)
    p = points.reshape(-1, 3)[row[np.searchsorted(tags, used, sorter=row)]]
    quads = quads.reshape(-1, 4)
    # joined in a narrow gap some quadrilaterals lie over others, the other way round
    for tag in visible:
        a, b, c, d = (p[corner] for corner in quads[of[tag]].T)
        area = np.cross(c - a, d - b)
        if np.any(area @ area.sum(axis=0) <= 0):
            return None
    parts = {tag: np.concatenate([of[t] for t in ts]) for tag, ts in pieces.items()}
    return Flat(p, quads, parts)
