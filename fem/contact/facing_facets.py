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
from beadwave.fem.assembly.trace import face_mean, trace

# triangle rule of degree 4 (Dunavant, Int. J. Numer. Methods Eng. 21 (1985) 1129): barycentric
# coordinates and shares of the area
_A, _B = 0.445948490915965, 0.091576213509771
TRIANGLE = np.array([np.roll([1 - 2 * x, x, x], k) for x in (_A, _B) for k in range(3)])  # (6, 3)
SHARES = np.repeat([0.223381589678011, 0.109951743655322], 3)
SMALLEST = 1e-8  # of a facet's area: smaller common parts are rounding


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

    # polygons of both faces in the plane (k, 3 or 4, 2), counted around
    polygons = []
    for face in (first, second):
        body, facets = structure.facets(face)
        mesh = structure.basis[body].mesh
        polygons.append(mesh.p[:, mesh.facets[:, facets]].transpose(2, 1, 0) @ axes[1:].T)
    mine, other = (_counted_around(p) for p in polygons)

    # common parts, of pairs whose boxes meet
    low, high = other.min(axis=1), other.max(axis=1)
    owner, x, w = [], [], []
    whole = _areas(mine)
    for i, polygon in enumerate(mine):
        meet = np.all((low < polygon.max(axis=0)) & (high > polygon.min(axis=0)), axis=1)
        for j in np.flatnonzero(meet):
            part = clipped(polygon, other[j])
            if len(part) < 3:
                continue
            fan = np.stack([np.repeat(part[:1], len(part) - 2, 0), part[1:-1], part[2:]], axis=1)
            areas = _areas(fan)
            if areas.sum() > SMALLEST * whole[i]:
                x.append((TRIANGLE @ fan).reshape(-1, 2))
                w.append(np.outer(areas, SHARES).ravel())
                owner.append(np.full(len(w[-1]), i))
    if not owner:
        raise ValueError(f"the faces {first!r} and {second!r} have nothing in common.")
    owner, x, w = np.concatenate(owner), np.concatenate(x), np.concatenate(w)

    # mean openings of the facets that have a part in common
    points = x @ axes[1:] + (mean.centre @ n) * n
    P = [trace(structure, face, points, gap=gap + 1e-9) for face in (first, second)]
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

    # the gap is that of the planes
    away = (face_mean(structure, second).centre - mean.centre) @ n
    return FacingFacets(average @ points, area, whole[used], np.full(len(used), away), C, S, axes)


def clipped(subject: NDArray[np.float64], by: NDArray[np.float64]) -> NDArray[np.float64]:
    """The part (k, 2) of a convex polygon within another one, both counted the same way around:
    Sutherland and Hodgman, Commun. ACM 17 (1974) 32."""
    part = subject
    for a, b in zip(by, np.roll(by, -1, axis=0), strict=True):
        if not len(part):
            break
        edge = b - a
        side = edge[0] * (part[:, 1] - a[1]) - edge[1] * (part[:, 0] - a[0])
        following, next_side = np.roll(part, -1, axis=0), np.roll(side, -1)
        kept = []
        for p, q, s, t in zip(part, following, side, next_side, strict=True):
            if s >= 0:
                kept.append(p)
            if s * t < 0:
                kept.append(p + s / (s - t) * (q - p))
        part = np.array(kept)
    return part


def _counted_around(polygons: NDArray[np.float64]) -> NDArray[np.float64]:
    """The polygons (k, n, 2) with their corners counted anticlockwise."""
    backward = _signed_areas(polygons) < 0
    polygons[backward] = polygons[backward, ::-1]
    return polygons


def _areas(polygons: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.abs(_signed_areas(polygons))


def _signed_areas(polygons: NDArray[np.float64]) -> NDArray[np.float64]:
    """(k,) of polygons (k, n, 2), positive anticlockwise."""
    x, y = polygons[..., 0], polygons[..., 1]
    return (x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1) / 2
