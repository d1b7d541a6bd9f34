"""Where bodies of a mesh touch: facets that look at each other across less than `gap`.

Of two facets the common area is that of one clipped by the other, projected onto its plane
(Sutherland and Hodgman, Commun. ACM 17 (1974) 32). Facets of curved faces may be off each other by
what straight edges leave.
"""

from collections.abc import Mapping
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from skfem import Basis, Mesh

from geometry.faceted import Skin, away
from geometry.imprint import Band, Disc, Patch
from geometry.solids import Body, off_axis, parallel
from geometry.touching import FRACTION, NEAR, Contact, NearMiss, Neighbours, Overlap, Touch

FACING = -0.8  # cosine between normals of facets that touch
SAGGING = 0.1  # of a facet's size, by which those of a curved face may miss it
WHOLE = 0.99  # of a facet's area, of a curved face less: all of it lies on the partner
WHOLE_CURVED = 0.9


class Met(NamedTuple):
    """Pairs of facets that touch."""

    one: NDArray[np.int64]  # (n,) of the first body's skin
    other: NDArray[np.int64]
    area: NDArray[np.float64]  # (n,) [m^2]
    gap: NDArray[np.float64]  # (n,) [m]


class Meeting(NamedTuple):
    """Which bodies touch, and on which facets."""

    near: Neighbours
    met: dict[str, Met]  # by the name of the touching pair, "a|b"

    def facets(self, name: str, body: str, skin: Skin, *, whole: bool) -> NDArray[np.int64]:
        """Numbers in its mesh of a body's facets on the partner: those wholly there, or all."""
        met = self.met[name]
        mine = met.one if name.split("|")[0] == body else met.other
        covered = np.bincount(mine, met.area, minlength=len(skin.area)) / skin.area
        least = np.where(skin.flat, WHOLE, WHOLE_CURVED)
        return skin.number[covered > (least if whole else FRACTION)]

    def under(self, patch: Patch, skin: Skin) -> NDArray[np.int64]:
        """Numbers of the facets under a washer, of a bolt's share or in a thread: by their
        middles."""
        mine = skin.on(patch.on.tags)
        if isinstance(patch, Band):
            return mine.number[
                np.abs((mine.middle - patch.centre) @ patch.axis) <= patch.length / 2
            ]
        if isinstance(patch, Disc):
            apart = np.linalg.norm(np.cross(mine.middle - patch.centre, patch.normal), axis=1)
            return mine.number[apart <= patch.radius * np.linalg.norm(patch.normal)]
        own = np.linalg.norm(mine.middle - patch.centre, axis=1)
        others = [np.linalg.norm(mine.middle - other, axis=1) for other in patch.others]
        nearest = np.all([own <= other for other in others] or [own >= 0], axis=0)
        body = patch.on.body
        touched = [
            self.facets(name, body, skin, whole=False)
            for name in self.met
            if body in name.split("|")
        ]
        return np.intersect1d(mine.number[nearest], np.concatenate(touched))


def meeting(skins: Mapping[str, Skin], bodies: Mapping[str, Body], gap: float) -> Meeting:
    """Every pair of bodies nearer than NEAR."""
    touching, misses, overlaps, found = [], [], [], {}
    for a, b in combinations(skins, 2):
        within = NEAR + gap
        one, other = bodies[a], bodies[b]
        if np.any(one.lower - within > other.upper) or np.any(other.lower - within > one.upper):
            continue
        met = _met(skins[a], skins[b], bodies[a], bodies[b], gap)
        contacts = tuple(_contacts(met, skins[a], skins[b], bodies[a], bodies[b]))
        overlap = _overlap(skins[a], skins[b], (a, b), gap)
        if overlap:
            overlaps.append(overlap)
        if contacts:
            touching.append(Touch((a, b), contacts))
            found[f"{a}|{b}"] = met
        elif not overlap:
            misses += [m for m in [_miss(skins[a], skins[b], (a, b))] if m.distance <= NEAR]
    return Meeting(Neighbours(tuple(touching), tuple(misses), tuple(overlaps)), found)


def _met(one: Skin, other: Skin, a: Body, b: Body, gap: float) -> Met:
    """Facets of the two that face each other and have an area in common."""
    near = [
        np.flatnonzero(_in_box(s.corners, body, gap + _sag(s).max(initial=0.0)))
        for s, body in ((one, b), (other, a))
    ]
    pairs = _close(one, other, *near)
    i, j = pairs[np.sum(one.normal[pairs[:, 0]] * other.normal[pairs[:, 1]], axis=1) < FACING].T
    off = np.abs(np.sum((other.middle[j] - one.middle[i]) * one.normal[i], axis=1))
    # of facets that lie askew the middles are apart along the normal by the slope as well
    reach = gap + _sag(one)[i] + _sag(other)[j]
    keep = off <= reach
    i, j, off = i[keep], j[keep], off[keep]
    area = _common(one, other, i, j)
    has = area > FRACTION * np.minimum(one.area[i], other.area[j])
    return Met(i[has], j[has], area[has], off[has])


def _sag(skin: Skin) -> NDArray[np.float64]:
    """(n,) what facets may miss their face by [m]: nothing of a plane."""
    return SAGGING * skin.size * ~skin.flat


def _in_box(corners: NDArray[np.float64], body: Body, within: float) -> NDArray[np.bool_]:
    lower, upper = body.lower - within, body.upper + within
    return np.all((corners.max(axis=1) >= lower) & (corners.min(axis=1) <= upper), axis=1)


def _close(one: Skin, other: Skin, i: NDArray[np.int64], j: NDArray[np.int64]):
    """Pairs (n, 2) of facets whose spheres meet."""
    if not len(i) or not len(j):
        return np.empty((0, 2), np.int64)
    reach = (one.size[i].max() + other.size[j].max()) * np.sqrt(3) / 2
    close = cKDTree(one.middle[i]).query_ball_tree(cKDTree(other.middle[j]), reach)
    return np.array([(i[k], j[m]) for k, ms in enumerate(close) for m in ms], np.int64).reshape(
        -1, 2
    )


def _common(one: Skin, other: Skin, i: NDArray[np.int64], j: NDArray[np.int64]):
    """Areas (n,) of the facets i under the facets j, in the planes of i."""
    u = one.corners[i, 1] - one.corners[i, 0]
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    axes = np.stack([u, np.cross(one.normal[i], u)], axis=2)
    polygons, knives = one.corners[i] @ axes, other.corners[j][:, ::-1] @ axes
    apart = (polygons.max(axis=1) <= knives.min(axis=1)) | (
        knives.max(axis=1) <= polygons.min(axis=1)
    )
    area = np.zeros(len(i))
    for k in np.flatnonzero(~apart.any(axis=1)):
        area[k] = _area_of_both(polygons[k].tolist(), knives[k].tolist())
    return area


def _area_of_both(polygon: list, knife: list) -> float:
    for a, b in zip(knife, knife[1:] + knife[:1], strict=True):
        polygon = _clipped(polygon, a, b)
    ends = zip(polygon, polygon[1:] + polygon[:1], strict=True)
    return abs(sum(x * v - y * u for (x, y), (u, v) in ends)) / 2


def _clipped(polygon: list, a: list[float], b: list[float]) -> list:
    """What of a polygon lies left of the line from a to b."""
    left = [(b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]) for x, y in polygon]
    kept = []
    for k, point in enumerate(polygon):
        before, s, t = polygon[k - 1], left[k - 1], left[k]
        if (s < 0 < t) or (t < 0 < s):
            r = s / (s - t)
            kept.append(
                [before[0] + r * (point[0] - before[0]), before[1] + r * (point[1] - before[1])]
            )
        if t >= 0:
            kept.append(point)
    return kept


def _contacts(met: Met, one: Skin, other: Skin, a: Body, b: Body):
    tags = np.column_stack([one.tag[met.one], other.tag[met.other]])
    for first, second in np.unique(tags, axis=0):
        mine = np.all(tags == (first, second), axis=1)
        faces = a.face(first), b.face(second)
        area = float(met.area[mine].sum())
        if area > FRACTION * min(faces[0].area, faces[1].area):
            yield Contact(
                (int(first), int(second)),
                area,
                _gap(*faces, met, mine),
                (),
                area > (1 - FRACTION) * max(faces[0].area, faces[1].area),
            )


def _gap(one, other, met: Met, mine) -> float:
    """Mean distance of two faces; of cylinders that of their radii and axes."""
    if one.axis is not None and other.axis is not None and parallel(one.axis, other.axis):
        return float(off_axis(other.on_axis, one.on_axis, one.axis)) + abs(
            one.radius - other.radius
        )
    return float(met.area[mine] @ met.gap[mine] / met.area[mine].sum())


def _overlap(one: Skin, other: Skin, names: tuple[str, str], gap: float) -> Overlap | None:
    """The volume of elements of either body whose middles lie in the other."""
    volumes = _volume_in(one, other, gap), _volume_in(other, one, gap)
    shares = [
        v.sum() / _volumes(skin.mesh).sum() for v, skin in zip(volumes, (one, other), strict=True)
    ]
    if not max(shares):
        return None
    inside = next((n for n, share in zip(names, shares, strict=True) if share > 1 - FRACTION), None)
    return Overlap(names, float(max(v.sum() for v in volumes)), inside)


def _volume_in(skin: Skin, other: Skin, gap: float) -> NDArray[np.float64]:
    """Volumes of the elements whose middles lie in another body [m^3]."""
    middle = skin.mesh.p[:, skin.mesh.t].mean(axis=1).T
    lower, upper = other.corners.min(axis=(0, 1)), other.corners.max(axis=(0, 1))
    there = np.flatnonzero(np.all((middle > lower + gap) & (middle < upper - gap), axis=1))
    return _volumes(skin.mesh)[there[_inside(middle[there], other.triangles)]]


def _volumes(mesh: Mesh) -> NDArray[np.float64]:
    return np.abs(Basis(mesh, mesh.elem(), intorder=2).dx).sum(axis=1)


def _inside(points: NDArray[np.float64], corners: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether points (n, 3) lie within a closed surface of triangles, by its solid angle.

    A. van Oosterom and J. Strackee, IEEE Trans. Biomed. Eng. 30 (1983) 125.
    """
    found = np.zeros(len(points), dtype=bool)
    for i, point in enumerate(points):
        a, b, c = (corners[:, k] - point for k in range(3))
        x, y, z = (np.linalg.norm(v, axis=1) for v in (a, b, c))
        over = np.sum(a * np.cross(b, c), axis=1)
        under = x * y * z + np.sum(a * b, 1) * z + np.sum(b * c, 1) * x + np.sum(c * a, 1) * y
        found[i] = abs(np.sum(2 * np.arctan2(over, under))) > 2 * np.pi
    return found


def _miss(one: Skin, other: Skin, names: tuple[str, str]) -> NearMiss:
    """From the corners of either body to the other's facets."""
    best = NearMiss(names, np.inf, np.zeros(3))
    for skin, partner in ((one, other), (other, one)):
        corners = np.unique(skin.corners.reshape(-1, 3), axis=0)
        lower = partner.corners.min(axis=(0, 1)) - NEAR
        upper = partner.corners.max(axis=(0, 1)) + NEAR
        for point in corners[np.all((corners >= lower) & (corners <= upper), axis=1)]:
            distance = float(away(point, partner.triangles).min())
            if distance < best.distance:
                best = NearMiss(names, distance, point)
    return best
