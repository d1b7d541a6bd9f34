"""Two faces that look at each other, facet by facet, on meshes that need not match.

Each facet of the first face has a plane with its normal n. Facets of the second face are seen along
n: what both have in common there is cut into convex polygons, and these into triangles with a
quadrature that is exact for quadratic shape functions. The mean opening over a facet f,

    g_f = g_0f + 1 / A_f int_f n . (u_second - u_first) dA = g_0f + c_f u,

is what pressure, constant on it, works on: an even pressure gives the consistent forces of both
faces, so that the patch test is met exactly on meshes that match and on those that do not (mortar
method with pressure of degree 0). M. A. Puso, T. A. Laursen, Comput. Methods Appl. Mech. Eng. 193
(2004) 601. The gap g_0 is that along n between the planes, cylinders and spheres that the nodes lie
on (`fem.contact.round_face`), else between the facets.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_matrix, diags_array, vstack
from scipy.sparse.csgraph import connected_components

from beadwave.fem.assembly.chord_height import area_vectors
from beadwave.fem.assembly.elasticity import Structure
from beadwave.fem.assembly.trace import interpolation, local_coordinates
from beadwave.fem.contact.round_face import fitted

# triangle rule of degree 4 (Dunavant, Int. J. Numer. Methods Eng. 21 (1985) 1129): barycentric
# coordinates and shares of the area
_A, _B = 0.445948490915965, 0.091576213509771
TRIANGLE = np.array([np.roll([1 - 2 * x, x, x], k) for x in (_A, _B) for k in range(3)])  # (6, 3)
SHARES = np.repeat([0.223381589678011, 0.109951743655322], 3)
SMALLEST = 1e-8  # of a facet's area: smaller common parts are rounding
ROUNDING = 1e-9  # [m] of the places of faces
# by which meshes of round faces may overlap, over their largest facet: nodes that move out to keep
# the volume of a cylinder do so by 0.018 of it, for 30 edges around and for others alike
OVERLAP = 0.05
SMOOTH = np.cos(np.radians(40))  # cosine of the normals of neighbours on one round face, at least
FACING = -0.5  # cosine of the normals of facets that look at each other, at most


class FacingFacets(NamedTuple):
    """Facets of one face that lie on another: m of them."""

    points: NDArray[np.float64]  # (m, 3) [m] middles of the parts in common
    area: NDArray[np.float64]  # (m,) [m^2] in common
    whole: NDArray[np.float64]  # (m,) [m^2] of the facets themselves
    gap: NDArray[np.float64]  # (m,) [m] before any load
    C: csr_matrix  # (3 m, ndof) mean opening of each along n, then t1 of all, then t2 of all
    S: csr_matrix  # (2 m, ndof) mean slopes of the first face's displacement along n, on t1, on t2
    axes: NDArray[np.float64]  # (m, 3, 3) rows n out of the first face, t1, t2
    pair: NDArray[np.int64]  # (m,) number of the pair of faces, of several

    @property
    def spanned(self) -> NDArray[np.int64]:
        """The two global axes (2,) along which the facets lie best."""
        return np.sort(np.argsort(self.area @ np.abs(self.axes[:, 0]), kind="stable")[:2])

    def direction(self, i: int) -> csr_matrix:
        """Rows (m, ndof) of the openings along axis i."""
        m = len(self.area)
        return self.C[i * m : (i + 1) * m]


def facing_facets(
    structure: Structure, first: str, second: str, gap: float = 0.0, least: float | None = None
) -> FacingFacets:
    """The facets of a face "body:face" that look at another one, up to `gap` [m] away along their
    normals, or that lie in it; facets of the first face carry the pressure. Raises ValueError for
    two that have nothing in common.

    Gaps of round faces begin at `least` [m] where that is known: meshes may have other radii than
    the bodies, as those that keep the volume of a cylinder.
    """
    # facets (k,) of both faces: corners (k, 3 or 4, 3) and outward normals (k, 3)
    bodies, numbers = zip(*(structure.facets(face) for face in (first, second)), strict=True)
    meshes = [structure.basis[body].mesh for body in bodies]
    corners, normals = zip(*map(_outward, meshes, numbers), strict=True)
    centres = [x.mean(axis=1) for x in corners]
    n = normals[0]
    t1 = np.eye(3)[np.argmin(np.abs(n).round(9), axis=1)]
    t1 = t1 - np.einsum("ij,ij->i", t1, n)[:, None] * n
    t1 /= np.linalg.norm(t1, axis=1)[:, None]
    axes = np.stack([n, t1, np.cross(n, t1)], axis=1)

    # pairs of facets whose boxes meet and that look at each other
    reach = gap + ROUNDING
    boxes = reach
    if least is not None:
        boxes += OVERLAP * max(np.ptp(x, axis=1).max() for x in corners)
    low, high = (getattr(corners[1], f)(axis=1) for f in ("min", "max"))
    meet = [
        np.all((low < x.max(axis=0) + boxes) & (high > x.min(axis=0) - boxes), axis=1)
        & (normals[1] @ normal < FACING)
        for x, normal in zip(corners[0], n, strict=True)
    ]
    pair = np.argwhere(meet)
    owner, facing = pair.T

    # common parts, seen along the normal of the first
    origin, frame = centres[0][owner], axes[owner]
    mine, other = (
        _counted_around(np.einsum("pij,pkj->pki", frame[:, 1:], x[i] - origin[:, None]))
        for x, i in zip(corners, (owner, facing), strict=True)
    )
    parts = clipped(mine, other)
    fans = np.stack(
        [np.broadcast_to(parts[:, :1], parts[:, 2:].shape), parts[:, 1:-1], parts[:, 2:]], axis=2
    )  # (pairs, triangles, 3, 2)
    areas, whole = _areas(fans), np.abs(_signed_areas(mine))
    n_triangles = areas.shape[1]
    areas[areas.sum(axis=1) <= SMALLEST * whole] = 0.0

    # points of the quadrature: on the plane of the first facet, and along n on that of the second
    kept = np.flatnonzero(areas)
    x = (TRIANGLE @ fans.reshape(-1, 3, 2)[kept]).reshape(-1, 2)
    w = np.outer(areas.ravel()[kept], SHARES).ravel()
    at = np.repeat(kept // n_triangles, len(SHARES))
    own = origin[at] + np.einsum("pi,pij->pj", x, frame[at][:, 1:])
    n, opposite = frame[at][:, 0], normals[1][facing[at]]
    height = np.einsum("pj,pj->p", centres[1][facing[at]] - own, opposite)
    height /= np.einsum("pj,pj->p", n, opposite)
    over = own + height[:, None] * n
    away, is_round = _between(meshes, numbers, (owner[at], facing[at]), normals, own, n, height)
    if least is not None and is_round.any():
        away[is_round] += least - away[is_round].min()

    # facets whose mean gap is within reach
    used, row = np.unique(owner[at], return_inverse=True)
    area = np.bincount(row, w, len(used))
    mean_gap = np.bincount(row, w * away, len(used)) / area
    near = mean_gap <= reach
    if not near.any():
        raise ValueError(f"the faces {first!r} and {second!r} have nothing in common.")
    inside = near[row]
    x, w, at, own, over, n = (part[inside] for part in (x, w, at, own, over, n))
    used, row = np.unique(owner[at], return_inverse=True)
    area, mean_gap = np.bincount(row, w), mean_gap[near]

    # mean openings of the facets
    P = []
    for body, mesh, facets, points in zip(
        bodies, meshes, (numbers[0][owner[at]], numbers[1][facing[at]]), (own, over), strict=True
    ):
        cells = mesh.f2t[0, facets]
        basis = structure.basis[body]
        X = local_coordinates(basis.mapping, points.T[:, :, None], cells)
        shapes = interpolation(basis, X[:, :, 0], cells)
        columns = shapes.indices + structure.first[body]
        shape = shapes.shape[0], structure.n_dofs
        P.append(csr_matrix((shapes.data, columns, shapes.indptr), shape))
    shape = (len(used), len(w))
    average = csr_matrix((w / area[row], (row, np.arange(len(w)))), shape)
    opening, frames = P[1] - P[0], axes[used][row]
    along = [_component(opening, frames[:, i]) for i in range(3)]
    C = vstack([average @ part for part in along]).tocsr()

    # slopes by least squares over the points of a facet
    off = x - (average @ x)[row]
    moments = np.zeros((len(used), 2, 2))
    np.add.at(moments, row, w[:, None, None] * off[:, :, None] * off[:, None, :])
    weights = w[:, None] * np.einsum("nij,nj->ni", np.linalg.inv(moments)[row], off)
    u_n = _component(P[0], n)
    S = vstack([csr_matrix((q, (row, np.arange(len(w)))), shape) @ u_n for q in weights.T]).tocsr()

    facets_whole = np.linalg.norm(area_vectors(corners[0].transpose(2, 1, 0)), axis=1)
    number = np.zeros(len(used), np.int64)
    return FacingFacets(average @ own, area, facets_whole[used], mean_gap, C, S, axes[used], number)


def _outward(mesh, facets: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Corners (k, n, 3) of facets, and their unit normals (k, 3) out of the elements behind."""
    corners = mesh.p[:, mesh.facets[:, facets]]
    vectors = area_vectors(corners)
    behind = mesh.p[:, mesh.t[:, mesh.f2t[0, facets]]].mean(axis=1).T
    corners = corners.transpose(2, 1, 0)
    outward = np.sign(np.einsum("ij,ij->i", vectors, corners.mean(axis=1) - behind))
    normals = vectors * (outward / np.linalg.norm(vectors, axis=1))[:, None]
    # a plane face has one normal, whatever the rounding of its corners
    mean = normals.mean(axis=0)
    if np.linalg.norm(mean) > 1 - 1e-9:
        normals = np.broadcast_to(mean / np.linalg.norm(mean), normals.shape)
    return corners, normals


def _between(
    meshes, numbers, at, normals, own, n, height
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Distances (k,) [m] along n (k, 3) from the first face to the second near points `own` (k, 3)
    on the facets of the first, which are `height` (k,) from the facets of the second; and where
    one of both is round. Facets of either face `at` (k,) the points."""
    ends, is_round = [], np.zeros(len(own), bool)
    for mesh, facets, there, outward, known in zip(
        meshes, numbers, at, normals, (np.zeros(len(own)), height), strict=True
    ):
        corners = mesh.p[:, mesh.facets[:, facets]].transpose(2, 1, 0)
        group, end = smooth_groups(mesh.facets[:, facets], outward), known.copy()
        for i in range(group.max() + 1):
            surface, mine = fitted(corners[group == i], outward[group == i]), group[there] == i
            if surface is not None and mine.any():
                end[mine] = surface.distance(own[mine], n[mine], known[mine])
                is_round |= mine
        ends.append(end)
    return ends[1] - ends[0], is_round


def smooth_groups(nodes: NDArray[np.int64], normals: NDArray[np.float64]) -> NDArray[np.int64]:
    """Number (k,) of the group of each facet, nodes (n, k) and unit normals (k, 3): neighbours
    whose normals differ by less than an edge does are of one."""
    k = nodes.shape[1]
    ends = np.sort([nodes, np.roll(nodes, -1, axis=0)], axis=0).reshape(2, -1)
    edge = np.unique(ends, axis=1, return_inverse=True)[1].ravel()
    order = np.argsort(edge, kind="stable")
    same = np.flatnonzero(np.diff(edge[order]) == 0)
    a, b = order[same] % k, order[same + 1] % k
    smooth = np.einsum("ij,ij->i", normals[a], normals[b]) > SMOOTH
    graph = coo_array((np.ones(smooth.sum()), (a[smooth], b[smooth])), shape=(k, k))
    return connected_components(graph, directed=False)[1]


def _component(P: csr_matrix, axis: NDArray[np.float64]) -> csr_matrix:
    """Rows (k, ndof) of displacements P (3 k, ndof) at points along an axis (k, 3) of each."""
    return sum(diags_array(axis[:, k]) @ P[k::3] for k in range(3))


def clipped(subjects: NDArray[np.float64], by: NDArray[np.float64]) -> NDArray[np.float64]:
    """The parts (n, k + l, 2) of convex polygons (n, k, 2) within others (n, l, 2), all counted
    anticlockwise: Sutherland and Hodgman, Commun. ACM 17 (1974) 32. A part repeats its last corner;
    an empty one is a single point."""
    parts = subjects
    for a, b in zip(np.moveaxis(by, 1, 0), np.moveaxis(np.roll(by, -1, 1), 1, 0), strict=True):
        edge, off = (b - a)[:, None], parts - a[:, None]
        side = edge[..., 0] * off[..., 1] - edge[..., 1] * off[..., 0]
        following, next_side = np.roll(parts, -1, axis=1), np.roll(side, -1, axis=1)
        crosses = side * next_side < 0
        share = side / np.where(crosses, side - next_side, 1.0)
        crossing = parts + share[..., None] * (following - parts)

        # corners inside, each with the crossing behind it, and the last one over again
        n, k = side.shape
        corners = np.stack([parts, crossing], axis=2).reshape(n, 2 * k, 2)
        kept = np.stack([side >= 0, crosses], axis=2).reshape(n, 2 * k)
        order = np.argsort(~kept, axis=1, kind="stable")[:, : k + 1]
        last = np.maximum(kept.sum(axis=1) - 1, 0)
        order = np.where(
            np.arange(k + 1) <= last[:, None], order, np.take_along_axis(order, last[:, None], 1)
        )
        parts = np.take_along_axis(corners, order[..., None], axis=1)
    return parts


def _counted_around(polygons: NDArray[np.float64]) -> NDArray[np.float64]:
    """The polygons (k, n, 2) with their corners counted anticlockwise."""
    backward = _signed_areas(polygons) < 0
    polygons[backward] = polygons[backward, ::-1]
    return polygons


def _areas(polygons: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.abs(_signed_areas(polygons))


def _signed_areas(polygons: NDArray[np.float64]) -> NDArray[np.float64]:
    """(...,) of polygons (..., n, 2), positive anticlockwise."""
    x, y = polygons[..., 0], polygons[..., 1]
    return (x * np.roll(y, -1, axis=-1) - y * np.roll(x, -1, axis=-1)).sum(axis=-1) / 2
