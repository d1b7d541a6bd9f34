"""Two plane faces that look at each other, facet by facet, on meshes that need not match.

Each facet of the first face is cut into the convex polygons that it has in common with facets of
the second one, and these into triangles with a quadrature that is exact for quadratic shape
functions. The mean opening over a facet f,

    g_f = g_0f + 1 / A_f int_f n . (u_second - u_first) dA = g_0f + c_f u,

is what pressure, constant on it, works on: an even pressure gives the consistent forces of both
faces, so that the patch test is met exactly on meshes that match and on those that do not (mortar
method with pressure of degree 0). M. A. Puso, T. A. Laursen, Comput. Methods Appl. Mech. Eng. 193
(2004) 601.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, vstack

from beadwave.fem.assembly.elasticity import Structure
from beadwave.fem.assembly.trace import face_mean, interpolation, local_coordinates

# triangle rule of degree 4 (Dunavant, Int. J. Numer. Methods Eng. 21 (1985) 1129): barycentric
# coordinates and shares of the area
_A, _B = 0.445948490915965, 0.091576213509771
TRIANGLE = np.array([np.roll([1 - 2 * x, x, x], k) for x in (_A, _B) for k in range(3)])  # (6, 3)
SHARES = np.repeat([0.223381589678011, 0.109951743655322], 3)
SMALLEST = 1e-8  # of a facet's area: smaller common parts are rounding
ROUNDING = 1e-9  # [m] of the places of faces


class FacingFacets(NamedTuple):
    """Facets of one face that lie on another: m of them."""

    points: NDArray[np.float64]  # (m, 3) [m] middles of the parts in common
    area: NDArray[np.float64]  # (m,) [m^2] in common
    whole: NDArray[np.float64]  # (m,) [m^2] of the facets themselves
    gap: NDArray[np.float64]  # (m,) [m] before any load
    C: csr_matrix  # (3 m, ndof) mean opening of each along n, then t1 of all, then t2 of all
    S: csr_matrix  # (2 m, ndof) mean slopes of the first face's displacement along n, on t1, on t2
    axes: NDArray[np.float64]  # (3, 3) rows n out of the first face, t1, t2

    def direction(self, i: int) -> csr_matrix:
        """Rows (m, ndof) of the openings along axis i."""
        m = len(self.area)
        return self.C[i * m : (i + 1) * m]


def facing_facets(structure: Structure, first: str, second: str, gap: float = 0.0) -> FacingFacets:
    """The facets of a plane face "body:face" that lie on another one, up to `gap` [m] away; facets
    of the first face carry the pressure. Raises ValueError for faces that are not plane, and for
    two that have nothing in common."""
    mean = face_mean(structure, first)
    if np.linalg.norm(mean.normal) < 1 - 1e-6:
        raise ValueError(f"the face {first!r} is not plane; contact under preload takes planes.")
    n = mean.normal / np.linalg.norm(mean.normal)
    t1 = np.eye(3)[np.argmin(np.abs(n))]
    t1 = t1 - (t1 @ n) * n
    t1 /= np.linalg.norm(t1)
    axes = np.array([n, t1, np.cross(n, t1)])

    # the gap is that of the planes
    opposite = face_mean(structure, second)
    away = (opposite.centre - mean.centre) @ n
    if opposite.normal @ n > 1e-6 - 1 or abs(away) > gap + ROUNDING:
        raise ValueError(
            f"the face {second!r} does not lie on {first!r} all over; contact under preload takes "
            "planes that do."
        )

    # facets of both faces as polygons in the plane (k, 3 or 4, 2), counted around
    bodies, numbers = zip(*(structure.facets(face) for face in (first, second)), strict=True)
    meshes = [structure.basis[body].mesh for body in bodies]
    mine, other = (
        _counted_around(mesh.p[:, mesh.facets[:, facets]].transpose(2, 1, 0) @ axes[1:].T)
        for mesh, facets in zip(meshes, numbers, strict=True)
    )

    # common parts, of pairs whose boxes meet
    low, high = other.min(axis=1), other.max(axis=1)
    meet = [np.all((low < p.max(axis=0)) & (high > p.min(axis=0)), axis=1) for p in mine]
    pair = np.argwhere(meet)
    parts = clipped(mine[pair[:, 0]], other[pair[:, 1]])
    fans = np.stack(
        [np.broadcast_to(parts[:, :1], parts[:, 2:].shape), parts[:, 1:-1], parts[:, 2:]], axis=2
    )  # (pairs, triangles, 3, 2)
    areas, whole = _areas(fans), _areas(mine)
    n_triangles = areas.shape[1]
    areas[areas.sum(axis=1) <= SMALLEST * whole[pair[:, 0]]] = 0.0
    kept = np.flatnonzero(areas)
    if not len(kept):
        raise ValueError(f"the faces {first!r} and {second!r} have nothing in common.")
    x = (TRIANGLE @ fans.reshape(-1, 3, 2)[kept]).reshape(-1, 2)
    w = np.outer(areas.ravel()[kept], SHARES).ravel()
    owner, facing = np.repeat(pair[kept // n_triangles], len(SHARES), axis=0).T

    # mean openings of the facets that have a part in common, each face at its own plane
    P = []
    for body, mesh, facets, height in zip(
        bodies, meshes, (numbers[0][owner], numbers[1][facing]), (0.0, away), strict=True
    ):
        points = x @ axes[1:] + (mean.centre @ n + height) * n
        cells = mesh.f2t[0, facets]
        basis = structure.basis[body]
        X = local_coordinates(basis.mapping, points.T[:, :, None], cells)
        at = interpolation(basis, X[:, :, 0], cells)
        shape = at.shape[0], structure.n_dofs
        P.append(csr_matrix((at.data, at.indices + structure.first[body], at.indptr), shape))
    used, row = np.unique(owner, return_inverse=True)
    area = np.bincount(row, w)
    shape = (len(used), len(w))
    average = csr_matrix((w / area[row], (row, np.arange(len(w)))), shape)
    opening = P[1] - P[0]
    along = [sum(axis[k] * opening[k::3] for k in range(3)) for axis in axes]
    C = vstack([average @ part for part in along]).tocsr()

    # slopes by least squares over the points of a facet
    off = x - (average @ x)[row]
    moments = np.zeros((len(used), 2, 2))
    np.add.at(moments, row, w[:, None, None] * off[:, :, None] * off[:, None, :])
    weights = w[:, None] * np.einsum("nij,nj->ni", np.linalg.inv(moments)[row], off)
    u_n = sum(n[k] * P[0][k::3] for k in range(3))
    S = vstack([csr_matrix((q, (row, np.arange(len(w)))), shape) @ u_n for q in weights.T]).tocsr()

    middles = average @ (x @ axes[1:]) + (mean.centre @ n) * n
    return FacingFacets(middles, area, whole[used], np.full(len(used), away), C, S, axes)


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
