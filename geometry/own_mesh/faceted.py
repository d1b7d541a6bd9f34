"""Bodies of a user's mesh described like those of a CAD model, their faces found on the facets.

Facets that meet at a small angle are one face. It is a plane where all lie in one, a cylinder or a
sphere where all corners have the same distance from an axis or a point, otherwise "other".
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

from beadwave.geometry.cad.solids import Body, Face, Vector
from beadwave.geometry.own_mesh.curved import edge_normals, facet_areas, facet_nodes, is_curved
from beadwave.geometry.own_mesh.facets import triangles

# of the components of an axis or a normal: smaller ones are the rounding of a global axis
ROUNDING = 1e-9


# least cosine between normals of neighbours on one curved face
SMOOTH_COSINE = np.cos(np.radians(40))
FLAT_COSINE = 1 - 1e-9  # the same on a plane
PLANE_SPREAD = 1e-6  # largest spread of the normals' components on a plane face
ROUND_TOLERANCE = 1e-3  # distance of corners from their cylinder or sphere, over its radius
# area of a strip of coplanar facets over the median of a curved face's strips, beyond which it
# is a plane that runs into the curved face
STRIP_RATIO = 4.0


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
        """Mean of each facet's corners, (n, 3) [m]."""
        return self.corners.mean(axis=1)

    @property
    def size(self) -> NDArray[np.float64]:
        """The longest extent of each facet along a global axis, (n,) [m]."""
        return np.ptp(self.corners, axis=1).max(axis=1)

    @property
    def triangles(self) -> NDArray[np.float64]:
        """Corners (m, 3, 3) of the facets as triangles, quadrilaterals halved [m]."""
        n = self.corners.shape[1]
        facets = np.arange(self.corners.shape[0] * n).reshape(-1, n)
        return self.corners.reshape(-1, 3)[triangles(facets) if n == 4 else facets]

    @property
    def flat(self) -> NDArray[np.bool_]:
        """True for each facet whose face is a plane, (n,)."""
        _, face = np.unique(self.tag, return_inverse=True)
        spread = [np.ptp(self.normal[face == i], axis=0).max() for i in range(face.max() + 1)]
        return np.array(spread)[face] < PLANE_SPREAD

    def on(self, tags) -> "Skin":
        """The facets of the faces with these tags."""
        chosen = np.isin(self.tag, tags)
        return self._replace(**{name: getattr(self, name)[chosen] for name in self._fields[1:]})


def skins(
    meshes: Mapping[str, Mesh], named: Mapping[str, Mapping[str, NDArray[np.int64]]]
) -> dict[str, Skin]:
    """The outer facets of every body, with tags of the faces that they belong to, from 1 on through
    all bodies.

    meshes are straight tetrahedra or hexahedra by body. `named` has numbers (k,) of facets by body
    and by surface; a named surface is a face of its own. Corners run anticlockwise seen from
    outside.
    """
    outsides, last_tag = {}, 0
    for name, mesh in meshes.items():
        number = mesh.boundary_facets()
        corners = mesh.p[:, mesh.facets[:, number]].transpose(2, 1, 0)
        n = corners.shape[1]
        # area vectors: half the cross product of the diagonals, of two sides for triangles; turned
        # away from the element
        across = np.cross(corners[:, 2] - corners[:, 0], corners[:, n - 1] - corners[:, 1]) / 2
        behind = mesh.p[:, mesh.t[:, mesh.f2t[0, number]]].mean(axis=1).T
        inward = np.sum(across * (corners.mean(axis=1) - behind), axis=1) < 0
        across[inward] *= -1
        corners[inward] = corners[inward][:, ::-1]
        area = np.linalg.norm(across, axis=1)
        normal = across / area[:, None]
        at_edges = None
        if is_curved(mesh):
            nodes = facet_nodes(mesh, number)
            pieces = facet_areas(nodes)
            area = np.linalg.norm(pieces, axis=2).sum(axis=1)
            whole = pieces.sum(axis=1)
            # out of the element, as the chords are
            turn = np.where(np.sum(whole * normal, axis=1) < 0, -1.0, 1.0)[:, None]
            normal = turn * whole / np.linalg.norm(whole, axis=1, keepdims=True)
            at_edges = turn[:, None] * edge_normals(nodes)
        skin = Skin(mesh, number, corners, normal, area, np.zeros_like(number))

        # 0 for facets of no named surface
        surface = np.zeros(len(number), dtype=np.int64)
        for i, facets in enumerate(named.get(name, {}).values(), start=1):
            surface[np.isin(number, facets)] = i
        outsides[name] = skin._replace(tag=last_tag + 1 + _faces(skin, surface, at_edges))
        last_tag = int(outsides[name].tag.max())
    return outsides


def _faces(
    skin: Skin, surface: NDArray[np.int64], at_edges: NDArray[np.float64] | None
) -> NDArray[np.int64]:
    """Number (n,) of the face, from 0, that each facet belongs to; facets with different numbers
    `surface` (n,) of named surfaces are never on one face. `at_edges` (n, edges, 3) are the normals
    of curved facets at their edges, from each corner in the mesh to the next."""
    # pairs of facets that have an edge in common
    nodes = skin.mesh.facets[:, skin.number]
    edges = np.sort(np.stack([nodes, np.roll(nodes, -1, axis=0)]), axis=0).reshape(2, -1)
    _, edge = np.unique(edges, axis=1, return_inverse=True)
    order = np.argsort(edge.ravel(), kind="stable")
    repeats = np.flatnonzero(np.diff(edge.ravel()[order]) == 0)
    facet = np.tile(np.arange(nodes.shape[1]), len(nodes))
    first, second = facet[order[repeats]], facet[order[repeats + 1]]

    def connected(joined: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Number of each facet's group (n,), where these pairs (m,) are joined."""
        pairs = (np.ones(joined.sum()), (first[joined], second[joined]))
        graph = coo_matrix(pairs, shape=(len(surface), len(surface)))
        return connected_components(graph, directed=False)[1]

    # two groupings of the facets: across smooth edges, and across edges within one plane
    cosine = np.sum(skin.normal[first] * skin.normal[second], axis=1)
    bend = cosine
    if at_edges is not None:
        there = at_edges.transpose(1, 0, 2).reshape(-1, 3)
        bend = np.sum(there[order[repeats]] * there[order[repeats + 1]], axis=1)
    alike = surface[first] == surface[second]
    smooth = connected(alike & (bend > SMOOTH_COSINE))
    strip = connected(alike & (cosine > FLAT_COSINE))

    # a smooth group that is neither plane nor round may be a fillet with the planes that it runs
    # into: those of its flat strips that are much larger than the others are planes
    face = smooth.copy()
    for group in range(smooth.max() + 1):
        in_group = np.flatnonzero(smooth == group)
        strips, number = np.unique(strip[in_group], return_inverse=True)
        if len(strips) > 1 and _curved(skin, in_group) is None:
            area = np.bincount(number, skin.area[in_group])
            plane = area[number] > STRIP_RATIO * np.median(area)
            face[in_group[plane]] = smooth.max() + 1 + strip[in_group[plane]]
    # a face that such a plane has cut in two becomes two
    return connected(alike & (face[first] == face[second]))


class RoundSurface(NamedTuple):
    """A cylinder or a sphere."""

    kind: str  # "cylinder" or "sphere"
    centre: Vector  # (3,) [m], of a cylinder a point on its axis
    radius: float  # m
    axis: Vector | None = None  # (3,) of a cylinder


def _curved(skin: Skin, mine: NDArray[np.int64]) -> RoundSurface | None:
    """The cylinder or sphere on which the facets `mine` lie; None for any other surface."""
    points = np.unique(skin.corners[mine].reshape(-1, 3), axis=0)
    # cylinders first: a single row of facets around one lies on a sphere as well
    areas = skin.normal[mine] * skin.area[mine, None]
    cylinder = _cylinder(points, areas, tolerance=1e-15 if is_curved(skin.mesh) else 1e-8)
    if cylinder:
        return cylinder
    middle = points.mean(axis=0)
    centre, radius = _circle(points - middle)
    off = np.linalg.norm(points - middle - centre, axis=1)
    if len(points) < 5 or np.abs(off - radius).max() > ROUND_TOLERANCE * radius:
        return None
    return RoundSurface("sphere", middle + centre, radius)


def _cylinder(
    points: NDArray[np.float64], normals: NDArray[np.float64], tolerance: float
) -> RoundSurface | None:
    """The cylinder with the least squares of the deviations of the radii of points (n, 3) [m], to a
    relative `tolerance` of their sum; None where a point is off it. `normals` (m, 3) of the facets
    are weighted by area [m^2]."""
    # first guess of the axis: the direction in which the normals have the smallest components; two
    # facets alone have one too
    normals = np.vstack([normals, np.zeros((max(0, 3 - len(normals)), 3))])
    _, s, directions = np.linalg.svd(normals, full_matrices=False)
    if s[1] < 1e-6 * s[0]:
        return None
    middle, (u, v, w) = points.mean(axis=0), directions

    def radii(x):
        """Distances of the points from the axis w + x0 u + x1 v through middle + x2 u + x3 v."""
        axis = w + x[0] * u + x[1] * v
        axis = axis / np.linalg.norm(axis)
        return np.linalg.norm(np.cross(points - middle - x[2] * u - x[3] * v, axis), axis=1)

    # axis and place together from there, the place by the circle in the plane across the axis
    size = np.ptp(points, axis=0).max()
    rho = (points - middle) @ np.array([u, v]).T
    start = np.array([0.0, 0.0, *_circle(rho)[0]])
    x = least_squares(
        lambda x: radii(x) - radii(x).mean(),
        start,
        x_scale=[1, 1, size, size],
        xtol=1e-14,
        ftol=tolerance,
        gtol=tolerance,
    ).x
    radius = radii(x).mean()
    # an arc shorter than a tenth of the radius, 6 degrees, could as well be a plane
    if not np.abs(radii(x) - radius).max() < ROUND_TOLERANCE * radius or radius > 10 * size:
        return None
    axis = w + x[0] * u + x[1] * v
    return RoundSurface("cylinder", middle + x[2] * u + x[3] * v, radius, _unit(axis))


def _circle(rho: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Centre c and radius r of the circle or sphere nearest to points rho (n, 2 or 3) [m], by
    linear least squares of rho^2 = 2 c rho + d in c and d = r^2 - c^2 (I. Kasa, IEEE Trans.
    Instrum. Meas. 25 (1976) 8)."""
    (*c, d), *_ = np.linalg.lstsq(np.column_stack([2 * rho, np.ones(len(rho))]), (rho**2).sum(1))
    return np.array(c), float(np.sqrt(max(d + np.dot(c, c), 0.0)))


def _unit(axis: Vector) -> Vector:
    """The axis (3,) with length 1; components that are rounding of a global axis become 0."""
    axis = axis / np.linalg.norm(axis)
    axis[np.abs(axis) < ROUNDING] = 0.0
    return axis


def bodies(
    outsides: Mapping[str, Skin], named: Mapping[str, Mapping[str, NDArray[np.int64]]]
) -> dict[str, Body]:
    """The bodies of the meshes, as those of a CAD model, by name; `named` as in `skins`.

    Volume [m^3], centroid [m] and inertia of unit density [m^5] are those of the elements: of
    straight ones not those of the curved body that they stand for.
    """
    described = {}
    for number, (name, skin) in enumerate(outsides.items(), start=1):
        # moments of the elements: 1, x and x x^T, at most quadratic, integrated exactly where the
        # mapping is affine; of curved ones to 1e-6
        order = 6 if is_curved(skin.mesh) else 3
        basis = Basis(skin.mesh, skin.mesh.elem(), intorder=order)
        x, dx = np.array(basis.global_coordinates()).reshape(3, -1), basis.dx.ravel()
        volume = float(dx.sum())
        centroid = x @ dx / volume
        r = x - centroid[:, None]
        inertia = (r**2).sum(axis=0) @ dx * np.eye(3) - (r * dx) @ r.T
        points = skin.corners.reshape(-1, 3)
        faces = tuple(_face(skin, tag, named.get(name, {})) for tag in np.unique(skin.tag))
        box = points.min(axis=0), points.max(axis=0)
        described[name] = Body(
            name, number, volume, centroid, inertia, *box, faces, partial(distance, skin)
        )
    return described


def _face(skin: Skin, tag: int, named: Mapping[str, NDArray[np.int64]]) -> Face:
    """The face that the facets with a tag make: a plane, a cylinder, a sphere or "other"."""
    # the mean normal by area; that of a closed surface is zero, and any direction does then
    tagged = np.flatnonzero(skin.tag == tag)
    area, normals = skin.area[tagged], skin.normal[tagged]
    points = skin.corners[tagged].reshape(-1, 3)
    mean = _unit(area @ normals) if np.linalg.norm(area @ normals) > 0 else np.eye(3)[0]
    # normals against their mean: they may differ by more than those of two neighbours
    is_plane = bool(np.all(normals @ mean > FLAT_COSINE - 1e-7))
    if is_plane and is_curved(skin.mesh):
        heights = (facet_nodes(skin.mesh, skin.number[tagged]) - points[0]) @ mean
        is_plane = bool(np.abs(heights).max() < PLANE_SPREAD * np.sqrt(area.sum()))
    curved = None if is_plane else _curved(skin, tagged)
    label = (n for n, facets in named.items() if np.isin(skin.number[tagged], facets).all())
    face = Face(
        tag=int(tag),
        kind="plane" if is_plane else curved.kind if curved else "other",
        area=float(area.sum()),
        centre=area @ skin.middle[tagged] / area.sum(),
        normal=mean if is_plane else None,
        axis=curved.axis if curved else None,
        on_axis=curved.centre if curved else None,
        radius=curved.radius if curved else None,
        hollow=False,
        along=(0.0, 0.0),
        lower=points.min(axis=0),
        upper=points.max(axis=0),
        name=next(label, ""),
    )
    if curved is None:
        return face

    # of a round face where it reaches along its axis, and whether its normals point inwards: summed
    # over the facets, since one that spans much of the circle may point anywhere
    outward = skin.middle[tagged] - curved.centre
    if curved.axis is not None:
        heights = (points - curved.centre) @ curved.axis
        face = face._replace(along=(float(heights.min()), float(heights.max())))
        outward = outward - np.outer(outward @ curved.axis, curved.axis)
    return face._replace(hollow=bool(np.sum(normals * outward) < 0))


def distance(skin: Skin, point, tag: int) -> float:
    """Distance [m] of a point (3,) from a face, by its tag."""
    return float(away(np.asarray(point, dtype=float), skin.on([tag]).triangles).min())


def away(point: Vector, corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distances (n,) [m] of a point (3,) from triangles (n, 3, 3) [m] that are not degenerate."""
    ahead = np.roll(corners, -1, axis=1) - corners
    off = point - corners
    normal = np.cross(ahead[:, 0], ahead[:, 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    # above the triangle the distance is that of its plane, else that of the nearest side
    inside = np.all(np.sum(np.cross(ahead, off) * normal[:, None], axis=2) >= 0, axis=1)
    along = np.sum(off * ahead, axis=2) / np.sum(ahead**2, axis=2)
    edges = np.linalg.norm(off - np.clip(along, 0, 1)[..., None] * ahead, axis=2).min(axis=1)
    return np.where(inside, np.abs(np.sum(off[:, 0] * normal, axis=1)), edges)
