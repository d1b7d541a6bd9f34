"""Bodies of a mesh that somebody else made, as those of a CAD model: faces found on the facets.

Facets that meet nearly flat are one face. It is a plane where all lie in one, a cylinder or a
sphere where their corners are as far from an axis or a point, and "other" else.
"""

from collections.abc import Mapping
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from skfem import Basis, Mesh

from geometry.facets import triangles
from geometry.solids import Body, Face, Vector

SMOOTH = np.cos(np.radians(40))  # between normals of facets on one curved face
FLAT = 1 - 1e-9  # cosine between those of one plane
STRAIGHT = 1e-6  # between normals of facets of a plane face
ROUND = 1e-3  # of a radius, by which corners may miss their cylinder or sphere
WIDE = 4.0  # times the usual strip of a curved face: a plane that it runs into


class Skin(NamedTuple):
    """The outside of a body's mesh."""

    mesh: Mesh
    number: NDArray[np.int64]  # (n,) of the outer facets in the mesh
    corners: NDArray[np.float64]  # (n, 3 or 4, 3) [m]
    normal: NDArray[np.float64]  # (n, 3) outward
    area: NDArray[np.float64]  # (n,) [m^2]
    tag: NDArray[np.int64]  # (n,) of the face that each belongs to

    @property
    def middle(self) -> NDArray[np.float64]:
        """(n, 3) [m]"""
        return self.corners.mean(axis=1)

    @property
    def size(self) -> NDArray[np.float64]:
        """(n,) the longest extent of each along an axis [m]."""
        return np.ptp(self.corners, axis=1).max(axis=1)

    @property
    def triangles(self) -> NDArray[np.float64]:
        """(m, 3, 3) their corners, quadrilaterals halved [m]."""
        n = self.corners.shape[1]
        each = np.arange(self.corners.shape[0] * n).reshape(-1, n)
        return self.corners.reshape(-1, 3)[triangles(each) if n == 4 else each]

    @property
    def flat(self) -> NDArray[np.bool_]:
        """(n,) whether the face of each is a plane."""
        _, face = np.unique(self.tag, return_inverse=True)
        spread = [np.ptp(self.normal[face == i], axis=0).max() for i in range(face.max() + 1)]
        return np.array(spread)[face] < STRAIGHT

    def on(self, tags) -> "Skin":
        """The facets of some faces alone."""
        mine = np.isin(self.tag, tags)
        return self._replace(**{name: getattr(self, name)[mine] for name in self._fields[1:]})


def skins(
    meshes: Mapping[str, Mesh], named: Mapping[str, Mapping[str, NDArray[np.int64]]]
) -> dict[str, Skin]:
    """The outside of every body, its faces numbered from 1 on through all; surfaces with a name,
    facets by body and name, are faces of their own."""
    found, last = {}, 0
    for name, mesh in meshes.items():
        skin = _outside(mesh)
        own = np.zeros(len(skin.number), dtype=np.int64)
        for i, facets in enumerate(named.get(name, {}).values(), start=1):
            own[np.isin(skin.number, facets)] = i
        found[name] = skin._replace(tag=last + 1 + _faces(skin, own))
        last = int(found[name].tag.max())
    return found


def bodies(
    found: Mapping[str, Skin], named: Mapping[str, Mapping[str, NDArray[np.int64]]]
) -> dict[str, Body]:
    """What the meshes hold, in the terms of a CAD model."""
    return {
        name: _body(i, name, skin, named.get(name, {}))
        for i, (name, skin) in enumerate(found.items(), start=1)
    }


def distance(skin: Skin, point, tag: int) -> float:
    """Of a point from the nearest point of a face, by its tag [m]."""
    return float(away(np.asarray(point, dtype=float), skin.on([tag]).triangles).min())


def away(point: Vector, corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distances (n,) of a point from triangles (n, 3, 3) [m]."""
    ahead = np.roll(corners, -1, axis=1) - corners
    off = point - corners
    normal = np.cross(ahead[:, 0], ahead[:, 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    inside = np.all(np.sum(np.cross(ahead, off) * normal[:, None], axis=2) >= 0, axis=1)
    along = np.sum(off * ahead, axis=2) / np.sum(ahead**2, axis=2)
    edges = np.linalg.norm(off - np.clip(along, 0, 1)[..., None] * ahead, axis=2).min(axis=1)
    return np.where(inside, np.abs(np.sum(off[:, 0] * normal, axis=1)), edges)


def _outside(mesh: Mesh) -> Skin:
    number = mesh.boundary_facets()
    corners = mesh.p[:, mesh.facets[:, number]].transpose(2, 1, 0)
    n = corners.shape[1]
    across = np.cross(corners[:, 2] - corners[:, 0], corners[:, n - 1] - corners[:, 1]) / 2
    behind = mesh.p[:, mesh.t[:, mesh.f2t[0, number]]].mean(axis=1).T
    inward = np.sum(across * (corners.mean(axis=1) - behind), axis=1) < 0
    across[inward] *= -1
    corners[inward] = corners[inward][:, ::-1]
    area = np.linalg.norm(across, axis=1)
    return Skin(mesh, number, corners, across / area[:, None], area, np.zeros_like(number))


def _faces(skin: Skin, own: NDArray[np.int64]) -> NDArray[np.int64]:
    """Which face (0, 1, ...) each facet belongs to."""
    one, other = _neighbours(skin)
    cosine = np.sum(skin.normal[one] * skin.normal[other], axis=1)
    same = own[one] == own[other]
    smooth = _groups(one, other, same & (cosine > SMOOTH), len(own))
    flat = _groups(one, other, same & (cosine > FLAT), len(own))
    parts = smooth.copy()
    for face in range(smooth.max() + 1):
        mine = np.flatnonzero(smooth == face)
        strips, area = np.unique(flat[mine], return_inverse=True)
        if len(strips) > 1 and _curved(skin, mine) is None:
            total = np.bincount(area, skin.area[mine])
            plane = total[area] > WIDE * np.median(total)
            parts[mine[plane]] = smooth.max() + 1 + flat[mine[plane]]
    return _groups(one, other, same & (parts[one] == parts[other]), len(own))


def _neighbours(skin: Skin) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs of facets that have an edge in common."""
    nodes = skin.mesh.facets[:, skin.number]
    edges = np.sort(np.stack([nodes, np.roll(nodes, -1, axis=0)]), axis=0).reshape(2, -1)
    _, edge = np.unique(edges, axis=1, return_inverse=True)
    order = np.argsort(edge.ravel(), kind="stable")
    met = np.flatnonzero(np.diff(edge.ravel()[order]) == 0)
    facet = np.tile(np.arange(nodes.shape[1]), len(nodes))
    return facet[order[met]], facet[order[met + 1]]


def _groups(one, other, joined: NDArray[np.bool_], n: int) -> NDArray[np.int64]:
    pairs = (np.ones(joined.sum()), (one[joined], other[joined]))
    return connected_components(coo_matrix(pairs, shape=(n, n)), directed=False)[1]


class _Round(NamedTuple):
    kind: str
    centre: Vector
    radius: float
    axis: Vector | None = None


def _curved(skin: Skin, mine: NDArray[np.int64]) -> _Round | None:
    """The cylinder or sphere that facets lie on, None where they lie on neither."""
    points = np.unique(skin.corners[mine].reshape(-1, 3), axis=0)
    # cylinders first: a single row of facets around one lies on a sphere as well
    cylinder = _cylinder(points, skin.normal[mine] * skin.area[mine, None])
    return cylinder or _sphere(points)


def _sphere(points: NDArray[np.float64]) -> _Round | None:
    middle = points.mean(axis=0)
    centre, radius = _fitted(points - middle)
    off = np.linalg.norm(points - middle - centre, axis=1)
    if len(points) < 5 or np.abs(off - radius).max() > ROUND * radius:
        return None
    return _Round("sphere", middle + centre, radius)


def _fitted(rho: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Centre and radius of the circle or sphere nearest to points: rho^2 = 2 c rho + d."""
    (*c, d), *_ = np.linalg.lstsq(np.column_stack([2 * rho, np.ones(len(rho))]), (rho**2).sum(1))
    return np.array(c), float(np.sqrt(max(d + np.dot(c, c), 0.0)))


def _cylinder(points: NDArray[np.float64], normals: NDArray[np.float64]) -> _Round | None:
    _, s, directions = np.linalg.svd(normals, full_matrices=False)
    if s[1] < 1e-6 * s[0]:
        return None
    middle, (u, v, w) = points.mean(axis=0), directions

    def rims(x):
        axis = w + x[0] * u + x[1] * v
        axis = axis / np.linalg.norm(axis)
        return np.linalg.norm(np.cross(points - middle - x[2] * u - x[3] * v, axis), axis=1)

    size = np.ptp(points, axis=0).max()
    rho = (points - middle) @ np.array([u, v]).T
    start = np.array([0.0, 0.0, *_fitted(rho)[0]])
    found = least_squares(
        lambda x: rims(x) - rims(x).mean(), start, x_scale=[1, 1, size, size], xtol=1e-14
    ).x
    radius = rims(found).mean()
    if not np.abs(rims(found) - radius).max() < ROUND * radius or radius > 10 * size:
        return None
    axis = w + found[0] * u + found[1] * v
    return _Round("cylinder", middle + found[2] * u + found[3] * v, radius, _unit(axis))


def _unit(axis: Vector) -> Vector:
    """Of length 1, without the rounding beside a global axis."""
    axis = axis / np.linalg.norm(axis)
    axis[np.abs(axis) < 1e-9] = 0.0
    return axis


def _body(number: int, name: str, skin: Skin, named: Mapping[str, NDArray[np.int64]]) -> Body:
    basis = Basis(skin.mesh, skin.mesh.elem(), intorder=3)
    x, dx = np.array(basis.global_coordinates()).reshape(3, -1), basis.dx.ravel()
    volume = float(dx.sum())
    centroid = x @ dx / volume
    r = x - centroid[:, None]
    inertia = (r**2).sum(axis=0) @ dx * np.eye(3) - (r * dx) @ r.T
    points = skin.corners.reshape(-1, 3)
    faces = tuple(_face(skin, tag, named) for tag in np.unique(skin.tag))
    box = points.min(axis=0), points.max(axis=0)
    measured = partial(distance, skin)
    return Body(name, number, volume, centroid, inertia, *box, faces, measured)


def _face(skin: Skin, tag: int, named: Mapping[str, NDArray[np.int64]]) -> Face:
    mine = np.flatnonzero(skin.tag == tag)
    area, normals = skin.area[mine], skin.normal[mine]
    points = skin.corners[mine].reshape(-1, 3)
    mean = _unit(area @ normals) if np.linalg.norm(area @ normals) > 0 else np.eye(3)[0]
    flat = bool(np.all(normals @ mean > FLAT - 1e-7))
    curved = None if flat else _curved(skin, mine)
    label = (n for n, facets in named.items() if np.isin(skin.number[mine], facets).all())
    found = Face(
        tag=int(tag),
        kind="plane" if flat else curved.kind if curved else "other",
        area=float(area.sum()),
        centre=area @ skin.middle[mine] / area.sum(),
        normal=mean if flat else None,
        axis=curved.axis if curved else None,
        on_axis=curved.centre if curved and curved.axis is not None else None,
        radius=curved.radius if curved else None,
        hollow=False,
        along=(0.0, 0.0),
        lower=points.min(axis=0),
        upper=points.max(axis=0),
        name=next(label, ""),
    )
    if curved is None:
        return found
    outward = skin.middle[mine] - curved.centre
    if curved.axis is not None:
        heights = (points - curved.centre) @ curved.axis
        found = found._replace(along=(float(heights.min()), float(heights.max())))
        outward = outward - np.outer(outward @ curved.axis, curved.axis)
    return found._replace(hollow=bool(np.sum(normals * outward) < 0))
