"""Places of bolts: round holes of bodies, holes through two bodies about one axis, shanks in bores.

A bore consists of cylinder faces of one axis and radius that join without a gap and go more than
three quarters around, so that a fillet is none.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from math import pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.geometry.cad.contacts import TouchingPair
from beadwave.geometry.cad.solids import (
    ALIGNED,
    SAME,
    Body,
    Face,
    Vector,
    of_one_cylinder,
    off_axis,
    parallel,
)

HOLE_ANGLE = 0.75 * 2 * pi  # rad around, less is a fillet or a slot's end
CUT_HOLE_ANGLE = 0.45 * 2 * pi  # rad around, of a hole that an edge cuts; less is a fillet
# difference of the radii of shank and bore, or of their axes, over the bore's radius, at most:
# the depth of a coarse metric thread is 0.14 (M20) to 0.18 (M6) of it, and CAD files draw
# either of its diameters
THREAD_DEPTH = 0.2
# distance of a point on a hole's axis from the face that it opens into, over its radius, at most:
# the kernel finds that of the rim within 1 %, and a chamfer adds to it
NEAR_RIM = 1.25


class Bore(NamedTuple):
    """A cylindrical face that goes all around: the wall of a hole, or the outside of a pin."""

    tags: tuple[int, ...]  # of its faces in the CAD model
    radius: float  # m
    axis: Vector  # (3,) unit vector
    ends: NDArray[np.float64]  # (2, 3) points of its axis [m]

    @property
    def diameter(self) -> float:
        """[m], by which selectors and joints know a hole."""
        return 2 * self.radius


class Concentric(NamedTuple):
    """A hole through both bodies of a touching pair."""

    bodies: tuple[str, str]
    centre: Vector  # (3,) on the face in which they touch [m]
    axis: Vector  # of the hole, from the first body to the second
    diameters: tuple[float, float]  # m, in either body
    faces: tuple[int, int]  # tags of the faces that touch there
    lengths: tuple[float, float] = (0.0, 0.0)  # m, of the hole in either body


class ThreadedPair(NamedTuple):
    """A shank in a bore: where a thread joins two bodies."""

    bodies: tuple[str, str]
    tags: tuple[tuple[int, ...], tuple[int, ...]]  # of the cylinders' faces, on either body
    centre: Vector  # (3,) in the middle of the length that both have, on the bore's axis [m]
    axis: Vector
    length: float  # m


def bores(body: Body, *, hollow: bool = True) -> tuple[Bore, ...]:
    """The holes of a body; with hollow False its outer cylinders."""
    return tuple(bore for bore, angle in _cylinders(body, hollow) if angle > HOLE_ANGLE)


def cut_holes(body: Body) -> tuple[Bore, ...]:
    """Holes that an edge of the body cuts, with about half of them or more left."""
    cylinders = _cylinders(body, hollow=True)
    return tuple(bore for bore, angle in cylinders if CUT_HOLE_ANGLE < angle <= HOLE_ANGLE)


def _cylinders(body: Body, hollow: bool) -> list[tuple[Bore, float]]:
    """Cylinders with the angle that their faces go around [rad]."""
    # of one cylinder the runs of faces that follow each other along the axis without a gap
    runs: list[list[Face]] = []
    for group in of_one_cylinder((face for face in body.faces if face.hollow == hollow), SAME):
        reached = -np.inf
        for face in sorted(group, key=lambda f: _span(f, group[0])):
            lower, upper = _span(face, group[0])
            runs[-1].append(face) if lower < reached + SAME else runs.append([face])
            reached = max(reached, upper)

    cylinders = []
    for run in runs:
        first = run[0]
        spans = np.array([_span(face, first) for face in run])
        lower, upper = spans.min(), spans.max()
        # area = radius * angle * length
        angle = sum(face.area for face in run) / (first.radius * (upper - lower))
        ends = first.on_axis + np.outer([lower, upper], first.axis)
        bore = Bore(tuple(f.tag for f in run), first.radius, first.axis, ends)
        cylinders.append((bore, angle))
    return cylinders


def _span(face: Face, axis_of: Face) -> tuple[float, float]:
    """Lower and upper end [m] of a cylinder face along the axis of another one."""
    ends = face.on_axis + np.outer(face.along, face.axis) - axis_of.on_axis
    lower, upper = sorted(ends @ axis_of.axis)
    return lower, upper


class FacingHoles(NamedTuple):
    """A hole of each body of a touching pair, where they open into a face in which these touch."""

    diameters: tuple[float, float]  # m
    centres: tuple[Vector, Vector]  # (3,) on that face [m]
    lengths: tuple[float, float]  # m
    axis: Vector  # (3,) out of the first body: of a plane its normal, else along the holes
    faces: tuple[int, int]  # tags of the faces

    @property
    def distance(self) -> float:
        """Between the axes [m]."""
        return float(off_axis(self.centres[1], self.centres[0], self.axis))


def facing(touch: TouchingPair, bodies: Mapping[str, Body]) -> Iterator[FacingHoles]:
    """Every hole of the first body with every one of the second, across the faces of contact; of
    curved faces holes with parallel axes that open near each other."""
    first, second = (bodies[name] for name in touch.bodies)
    for contact in touch.contacts:
        plane = first.face(contact.faces[0])
        if plane.normal is not None:
            for one, other in product(_at_plane(first, plane), _at_plane(second, plane)):
                diameters, centres, lengths = zip(one, other, strict=True)
                yield FacingHoles(diameters, centres, lengths, plane.normal, contact.faces)
            continue
        openings = (
            _at_curved(body, body.face(tag))
            for body, tag in zip((first, second), contact.faces, strict=True)
        )
        for one, other in product(*openings):
            apart = np.linalg.norm(one.centre - other.centre)
            if one.outward @ other.outward < ALIGNED - 1 and apart < one.diameter + other.diameter:
                yield FacingHoles(
                    (one.diameter, other.diameter), (one.centre, other.centre),
                    (one.length, other.length), one.outward, contact.faces,
                )  # fmt: skip


def concentric(
    touch: TouchingPair, bodies: Mapping[str, Body], gap: float
) -> tuple[Concentric, ...]:
    """Holes of both bodies about one axis, across a face in which they touch."""
    places: list[Concentric] = []
    for pair in facing(touch, bodies):
        # a hole on the seam of two faces opens into both
        seen = any(np.linalg.norm(p.centre - pair.centres[0]) < SAME for p in places)
        if pair.distance <= SAME + gap and not seen:
            places.append(
                Concentric(
                    touch.bodies, pair.centres[0], pair.axis, pair.diameters, pair.faces,
                    pair.lengths,
                )
            )  # fmt: skip
    return tuple(places)


def misaligned(
    touch: TouchingPair, bodies: Mapping[str, Body], gap: float
) -> tuple[FacingHoles, ...]:
    """Holes of both bodies that open into each other and are about two axes."""
    return tuple(
        pair
        for pair in facing(touch, bodies)
        if SAME + gap < pair.distance < sum(pair.diameters) / 2
    )


class Opening(NamedTuple):
    """The end of a hole in a curved face."""

    diameter: float  # m
    centre: Vector  # (3,) where its axis meets the face [m]
    length: float  # m, to its other end
    outward: Vector  # (3,) along its axis, out of the body


def _at_curved(body: Body, face: Face) -> list[Opening]:
    """The ends of bores that open into a curved face, or at a chamfer below it."""
    openings = []
    for bore in bores(body):
        for end, other in (bore.ends, bore.ends[::-1]):
            outward = (end - other) / np.linalg.norm(end - other)
            # of a cylinder or a sphere where the axis meets it next to that end
            centre, way = end, _onto(face, end, outward)
            if way is not None and abs(way) < bore.radius:
                centre = end + way * outward
            if body.distance(centre, face.tag) <= NEAR_RIM * bore.radius:
                length = float(np.linalg.norm(centre - other))
                openings.append(Opening(bore.diameter, centre, length, outward))
    return openings


def _onto(face: Face, point: Vector, direction: Vector) -> float | None:
    """The shorter of both ways [m] from a point along a direction onto a cylinder or a sphere; None
    of other faces, and past them."""
    if face.on_axis is None:
        return None
    x, d = point - face.on_axis, direction
    if face.axis is not None:
        x, d = x - (x @ face.axis) * face.axis, d - (d @ face.axis) * face.axis
    a, b, c = d @ d, x @ d, x @ x - face.radius**2
    if a < ALIGNED or b * b < a * c:
        return None
    ways = (-b + np.sqrt(b * b - a * c) * np.array([-1.0, 1.0])) / a
    return float(ways[np.argmin(np.abs(ways))])


def _at_plane(body: Body, plane: Face) -> list[tuple[float, Vector, float]]:
    """Diameters [m] and centres (3,) on a plane of the bores that reach it or end at a chamfer
    below it, and the distances [m] from the plane to their other ends."""
    candidates: list[tuple[float, float, Vector, float]] = []
    for bore in bores(body):
        heights = (bore.ends - plane.centre) @ plane.normal
        end = int(np.argmin(abs(heights)))
        if parallel(bore.axis, plane.normal) and abs(heights[end]) <= bore.radius:
            centre = bore.ends[end] - heights[end] * plane.normal
            depth = float(np.abs(heights).max())
            candidates.append((abs(heights[end]), bore.diameter, centre, depth))
    # of a stepped hole the step nearest to the plane
    nearest: list[tuple[float, Vector, float]] = []
    for _, diameter, centre, depth in sorted(candidates, key=lambda candidate: candidate[0]):
        if all(np.linalg.norm(centre - nearer) > SAME for _, nearer, _ in nearest):
            nearest.append((diameter, centre, depth))
    return nearest


def crossed(
    touch: TouchingPair, bodies: Mapping[str, Body], points: Sequence[Sequence[float]]
) -> list[Concentric]:
    """Points (3,) [m] moved along the normal onto the nearest plane in which two bodies touch, as
    bolts without holes, of diameters 0; none where they touch on no plane. Whether a point lies
    within the common face is found when its washer is imprinted."""
    body = bodies[touch.bodies[0]]
    planes = [(body.face(c.faces[0]), c) for c in touch.contacts]
    planes = [(face, c) for face, c in planes if face.normal is not None]
    bolts = []
    for point in np.array(points) if planes else ():
        heights = [(face.centre - point) @ face.normal for face, _ in planes]
        nearest = int(np.argmin(np.abs(heights)))
        face, contact = planes[nearest]
        centre = point + heights[nearest] * face.normal
        bolts.append(Concentric(touch.bodies, centre, face.normal, (0.0, 0.0), contact.faces))
    return bolts


def engaged(first: Body, second: Body) -> tuple[ThreadedPair, ...]:
    """Shanks of either body in bores of the partner, the first body first: axes parallel,
    with a length in common; the distance of the axes and the difference of the radii make together
    at most THREAD_DEPTH of the bore's radius."""
    threads = []
    for hollow in (False, True):
        cylinders = bores(first, hollow=hollow), bores(second, hollow=not hollow)
        for a, b in product(*cylinders):
            bore = a if hollow else b
            mismatch = off_axis(a.ends, b.ends[0], b.axis).max() + abs(a.radius - b.radius)
            if not parallel(a.axis, b.axis) or mismatch > THREAD_DEPTH * bore.radius:
                continue
            # the length that both have, along the bore
            heights = [np.sort((c.ends - bore.ends[0]) @ bore.axis) for c in (a, b)]
            lower, upper = max(h[0] for h in heights), min(h[1] for h in heights)
            if upper - lower > SAME:
                names, tags = (first.name, second.name), (a.tags, b.tags)
                centre = bore.ends[0] + (lower + upper) / 2 * bore.axis
                threads.append(ThreadedPair(names, tags, centre, bore.axis, float(upper - lower)))
    return tuple(threads)
