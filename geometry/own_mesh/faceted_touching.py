"""Contacts of the bodies of a mesh: facets that face each other across less than `gap`.

Of two facets the common area is that of one clipped by the other, projected onto its plane
(Sutherland and Hodgman, Commun. ACM 17 (1974) 32). Facets of touching curved faces may be apart
by the distances of their straight edges from the curve.
"""

from collections.abc import Mapping
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from skfem import Basis

from beadwave.geometry.cad.contacts import (
    MIN_COMMON_AREA,
    NEARLY_TOUCHING,
    FaceContact,
    NearMiss,
    Neighbours,
    Overlap,
    TouchingPair,
)
from beadwave.geometry.cad.patches import CurvedDisc, Disc, Patch, Spots, ThreadBand
from beadwave.geometry.cad.solids import Body, off_axis, parallel
from beadwave.geometry.own_mesh.faceted import Skin, away

FACING_COSINE = -0.8  # cosine between the normals of facets that touch, at most
# distance between facets of touching curved faces, over their size: chords of either mesh
CHORD_DISTANCE = 0.1
# common area over a facet's area from which on all of it counts as lying on the other body
COVERED_SHARE = 0.99
COVERED_SHARE_CURVED = 0.9  # the same on a curved face, whose facets lie askew to each other


class FacetPairs(NamedTuple):
    """Pairs of facets that touch."""

    first: NDArray[np.int64]  # (n,) index in the first body's skin
    second: NDArray[np.int64]  # (n,) index in the second body's skin
    area: NDArray[np.float64]  # (n,) [m^2] in common
    gap: NDArray[np.float64]  # (n,) [m] between them


class TouchingBodies(NamedTuple):
    """Two bodies that touch, and their facets."""

    near: Neighbours
    pairs: dict[str, FacetPairs]  # by the name of the touching pair, "a|b"

    def facets(self, name: str, body: str, skin: Skin, *, whole: bool) -> NDArray[np.int64]:
        """Numbers (k,), in its mesh, of a body's facets that touch the other body of the pair
        "a|b": with `whole` those that lie wholly on it, else all. What is wholly covered is the
        share of the facet's area that the sum of its common areas fills."""
        pairs = self.pairs[name]
        side = pairs.first if name.split("|")[0] == body else pairs.second
        covered = np.bincount(side, pairs.area, minlength=len(skin.area)) / skin.area
        wholly = np.where(skin.flat, COVERED_SHARE, COVERED_SHARE_CURVED)
        return skin.number[covered > (wholly if whole else MIN_COMMON_AREA)]

    def under(self, patch: Patch, skin: Skin) -> NDArray[np.int64]:
        """Numbers (k,), in its mesh, of the facets whose middles lie under a washer, on a pad, in a
        bolt's share or in a thread: a mesh that is given is not split along their outlines."""
        face = skin.on(patch.on.tags)
        if isinstance(patch, ThreadBand):
            return face.number[
                np.abs((face.middle - patch.centre) @ patch.axis) <= patch.length / 2
            ]
        if isinstance(patch, Spots | CurvedDisc):
            return face.number[patch.hold(face.middle)]
        if isinstance(patch, Disc):
            off = np.linalg.norm(np.cross(face.middle - patch.centre, patch.normal), axis=1)
            return face.number[off <= patch.radius * np.linalg.norm(patch.normal)]
        # nearer to this bolt than to the others, where both bodies touch
        off = np.linalg.norm(face.middle - patch.centre, axis=1)
        others = [np.linalg.norm(face.middle - centre, axis=1) for centre in patch.others]
        nearest = np.all([off <= distance for distance in others] or [off >= 0], axis=0)
        touching = self.facets(patch.pair, patch.on.body, skin, whole=False)
        return np.intersect1d(face.number[nearest], touching)


def meeting(skins: Mapping[str, Skin], bodies: Mapping[str, Body], gap: float) -> TouchingBodies:
    """Every pair of bodies that touch across at most `gap` [m], overlap, or nearly touch, and the
    facets of those that touch; skins and bodies by the same names."""
    touching, misses, overlaps, facet_pairs = [], [], [], {}
    for a, b in combinations(skins, 2):
        # boxes too far apart leave nothing to look for
        within = NEARLY_TOUCHING + gap
        if np.any(bodies[a].lower - within > bodies[b].upper) or np.any(
            bodies[b].lower - within > bodies[a].upper
        ):
            continue
        pairs = _facet_pairs(skins[a], skins[b], bodies[a], bodies[b], gap)

        # pairs of faces, from the pairs of their facets
        contacts = []
        tags = np.column_stack([skins[a].tag[pairs.first], skins[b].tag[pairs.second]])
        for first, second in np.unique(tags, axis=0):
            of_pair = np.all(tags == (first, second), axis=1)
            face, partner = bodies[a].face(first), bodies[b].face(second)
            area = float(pairs.area[of_pair].sum())
            if not area > MIN_COMMON_AREA * min(face.area, partner.area):
                continue
            flush = area > (1 - MIN_COMMON_AREA) * max(face.area, partner.area)
            # the mean distance, of cylinders that of their radii and axes
            both_round = face.axis is not None and partner.axis is not None
            if both_round and parallel(face.axis, partner.axis):
                eccentricity = float(off_axis(partner.on_axis, face.on_axis, face.axis))
                distance = eccentricity + abs(face.radius - partner.radius)
            else:
                distance = float(pairs.area[of_pair] @ pairs.gap[of_pair] / area)
            contacts.append(FaceContact((int(first), int(second)), area, distance, (), flush))

        # bodies that touch or overlap do not miss each other
        overlap = _overlap(skins[a], skins[b], (a, b), gap)
        if overlap:
            overlaps.append(overlap)
        if contacts:
            touching.append(TouchingPair((a, b), tuple(contacts)))
            facet_pairs[f"{a}|{b}"] = pairs
        elif not overlap:
            miss = _nearest_miss(skins[a], skins[b], (a, b))
            misses += [miss] if miss.distance <= NEARLY_TOUCHING else []
    return TouchingBodies(Neighbours(tuple(touching), tuple(misses), tuple(overlaps)), facet_pairs)


def _facet_pairs(first: Skin, second: Skin, a: Body, b: Body, gap: float) -> FacetPairs:
    """Facets of two bodies that face each other and have an area in common."""
    # facets of a curved face lie off the face itself, those of a plane do not
    sag, sag_of_second = (CHORD_DISTANCE * skin.size * ~skin.flat for skin in (first, second))

    # facets within the other body's box; of these, all pairs whose enclosing spheres meet
    indices = []
    for skin, sagging, body in ((first, sag, b), (second, sag_of_second, a)):
        within = gap + sagging.max(initial=0.0)
        lower, upper = body.lower - within, body.upper + within
        in_box = (skin.corners.max(axis=1) >= lower) & (skin.corners.min(axis=1) <= upper)
        indices.append(np.flatnonzero(np.all(in_box, axis=1)))
    i, j = indices
    pairs = np.empty((0, 2), np.int64)
    if len(i) and len(j):
        reach = (first.size[i].max() + second.size[j].max()) * np.sqrt(3) / 2
        tree, other_tree = cKDTree(first.middle[i]), cKDTree(second.middle[j])
        close = tree.query_ball_tree(other_tree, reach)
        pairs = np.array([(i[k], j[m]) for k, ms in enumerate(close) for m in ms], np.int64)
        pairs = pairs.reshape(-1, 2)

    # those that look at each other, near enough along the normal; of facets that lie askew the
    # middles are apart along it by the slope as well
    cosine = np.sum(first.normal[pairs[:, 0]] * second.normal[pairs[:, 1]], axis=1)
    i, j = pairs[cosine < FACING_COSINE].T
    off = np.abs(np.sum((second.middle[j] - first.middle[i]) * first.normal[i], axis=1))
    close_by = off <= gap + sag[i] + sag_of_second[j]
    i, j, off = i[close_by], j[close_by], off[close_by]

    # the area in common, in the plane of the first: polygons that meet by their boxes are clipped.
    # The second faces the first and so runs clockwise there; reversed it is anticlockwise again
    u = first.corners[i, 1] - first.corners[i, 0]
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    axes = np.stack([u, np.cross(first.normal[i], u)], axis=2)
    polygons, knives = first.corners[i] @ axes, second.corners[j][:, ::-1] @ axes
    disjoint = (polygons.max(axis=1) <= knives.min(axis=1)) | (
        knives.max(axis=1) <= polygons.min(axis=1)
    )
    area = np.zeros(len(i))
    for k in np.flatnonzero(~disjoint.any(axis=1)):
        area[k] = clipped_area(polygons[k].tolist(), knives[k].tolist())
    touch = area > MIN_COMMON_AREA * np.minimum(first.area[i], second.area[j])
    return FacetPairs(i[touch], j[touch], area[touch], off[touch])


def clipped_area(polygon: list, knife: list) -> float:
    """Area of what of a polygon, points [x, y], lies in a convex one, the knife, with its corners
    counter-clockwise (Sutherland and Hodgman): clipped at one side of the knife after another.

    Lists and plain numbers: polygons of three or four points are clipped faster so than as arrays.
    The polygon may run either way; 0 where it has no area in common.
    """
    for a, b in zip(knife, knife[1:] + knife[:1], strict=True):
        # > 0 to the left of the line from a to b
        side = [(b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]) for x, y in polygon]
        clipped = []
        for k, point in enumerate(polygon):
            previous, s, t = polygon[k - 1], side[k - 1], side[k]
            if (s < 0 < t) or (t < 0 < s):
                r = s / (s - t)
                x = previous[0] + r * (point[0] - previous[0])
                y = previous[1] + r * (point[1] - previous[1])
                clipped.append([x, y])
            if t >= 0:
                clipped.append(point)
        polygon = clipped
    ends = zip(polygon, polygon[1:] + polygon[:1], strict=True)
    return abs(sum(x * v - y * u for (x, y), (u, v) in ends)) / 2


def _overlap(first: Skin, second: Skin, names: tuple[str, str], gap: float) -> Overlap | None:
    """Overlap by the volume of elements whose middles lie in the other body; None without any."""
    volumes, shares = [], []
    for skin, partner in ((first, second), (second, first)):
        volume = np.abs(Basis(skin.mesh, skin.mesh.elem(), intorder=2).dx).sum(axis=1)
        middle = skin.mesh.p[:, skin.mesh.t].mean(axis=1).T
        lower, upper = partner.corners.min(axis=(0, 1)), partner.corners.max(axis=(0, 1))
        in_box = np.all((middle > lower + gap) & (middle < upper - gap), axis=1)
        candidates = np.flatnonzero(in_box)
        filled = volume[candidates[inside(middle[candidates], partner.triangles)]].sum()
        volumes.append(filled)
        shares.append(filled / volume.sum())
    if not max(shares):
        return None
    within = (n for n, s in zip(names, shares, strict=True) if s > 1 - MIN_COMMON_AREA)
    return Overlap(names, float(max(volumes)), next(within, None))


def inside(points: NDArray[np.float64], corners: NDArray[np.float64]) -> NDArray[np.bool_]:
    """True for points (n, 3) within a closed surface of triangles (m, 3, 3), by its solid angle: 4
    pi seen from inside, 0 from outside. 2 pi parts them, except for points on the surface.

    A. van Oosterom and J. Strackee, IEEE Trans. Biomed. Eng. 30 (1983) 125.
    """
    enclosed = np.zeros(len(points), dtype=bool)
    for i, point in enumerate(points):
        # tan(Omega / 2) = a . (b x c) / (abc + (a . b) c + (b . c) a + (c . a) b)
        a, b, c = (corners[:, k] - point for k in range(3))
        x, y, z = (np.linalg.norm(v, axis=1) for v in (a, b, c))
        over = np.sum(a * np.cross(b, c), axis=1)
        under = x * y * z + np.sum(a * b, 1) * z + np.sum(b * c, 1) * x + np.sum(c * a, 1) * y
        enclosed[i] = abs(np.sum(2 * np.arctan2(over, under))) > 2 * np.pi
    return enclosed


def _nearest_miss(first: Skin, second: Skin, names: tuple[str, str]) -> NearMiss:
    """The smallest distance of a corner of one body from a facet of the other, and its place."""
    best = NearMiss(names, np.inf, np.zeros(3))
    for skin, partner in ((first, second), (second, first)):
        corners = np.unique(skin.corners.reshape(-1, 3), axis=0)
        lower = partner.corners.min(axis=(0, 1)) - NEARLY_TOUCHING
        upper = partner.corners.max(axis=(0, 1)) + NEARLY_TOUCHING
        for point in corners[np.all((corners >= lower) & (corners <= upper), axis=1)]:
            distance = float(away(point, partner.triangles).min())
            if distance < best.distance:
                best = NearMiss(names, distance, point)
    return best
