"""Round holes of bodies, those that go through two bodies at one axis, and shanks in bores: where
bolts sit.

A bore is the cylinder faces of one axis and radius that follow each other without a gap and go
more than three quarters around: a fillet is none.
"""

from collections.abc import Mapping, Sequence
from math import pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.solids import SAME, Body, Face, Vector, off_axis, parallel
from geometry.touching import Contact, Touch

AROUND = 0.75 * 2 * pi  # rad, less is a fillet or a slot's end
HALF = 0.45 * 2 * pi  # rad, less is a fillet
THREAD = 0.2  # of a bore's radius, that a shank in it may be thinner or off its axis; the depth of
# a coarse metric thread is 0.14 (M20) to 0.18 (M6) of it, and CAD draws either of its diameters


class Bore(NamedTuple):
    """A cylindrical face all around: of a hole, or the outside of a pin."""

    tags: tuple[int, ...]  # of its faces in the CAD model
    radius: float  # m
    axis: Vector
    ends: NDArray[np.float64]  # (2, 3) points of its axis [m]

    @property
    def diameter(self) -> float:
        return 2 * self.radius


class Concentric(NamedTuple):
    """A hole through both bodies of a touching pair."""

    bodies: tuple[str, str]
    centre: Vector  # (3,) on the plane in which they touch [m]
    axis: Vector  # of the hole, from the first body to the second
    diameters: tuple[float, float]  # m, in either body
    faces: tuple[int, int]  # tags of the planes that touch there


class Engaged(NamedTuple):
    """A shank in a bore: where a thread joins two bodies."""

    bodies: tuple[str, str]
    tags: tuple[tuple[int, ...], tuple[int, ...]]  # of the cylinders' faces, on either body
    centre: Vector  # (3,) in the middle of the length that both have, on the bore's axis [m]
    axis: Vector
    length: float  # m


def bores(body: Body, *, hollow: bool = True) -> tuple[Bore, ...]:
    """The holes of a body; with hollow False its outer cylinders."""
    return tuple(bore for bore, around in _cylinders(body, hollow) if around > AROUND)


def cut_holes(body: Body) -> tuple[Bore, ...]:
    """Holes that an edge of the body cuts, at least half of them there."""
    found = _cylinders(body, hollow=True)
    return tuple(bore for bore, around in found if HALF < around <= AROUND)


def _cylinders(body: Body, hollow: bool) -> list[tuple[Bore, float]]:
    """Cylinders with how far they go around [rad]."""
    groups: list[list[Face]] = []
    for face in (f for f in body.faces if f.axis is not None and f.hollow == hollow):
        home = [g for g in groups if _one_cylinder(g[0], face)]
        home[0].append(face) if home else groups.append([face])
    return [_bore(run) for group in groups for run in _runs(group)]


def concentric(touch: Touch, bodies: Mapping[str, Body], gap: float) -> tuple[Concentric, ...]:
    """Holes of both bodies about one axis, across a plane in which they touch."""
    a, b = (bodies[name] for name in touch.bodies)
    return tuple(
        hole
        for contact in touch.contacts
        if a.face(contact.faces[0]).normal is not None
        for hole in _across(a, b, contact, gap)
    )


def engaged(one: Body, other: Body) -> tuple[Engaged, ...]:
    """Shanks of either body in bores of the other, the first body first."""
    found = []
    for hollow in (False, True):
        for a in bores(one, hollow=hollow):
            for b in bores(other, hollow=not hollow):
                bore = a if hollow else b
                apart = off_axis(a.ends, b.ends[0], b.axis).max() + abs(a.radius - b.radius)
                if not parallel(a.axis, b.axis) or apart > THREAD * bore.radius:
                    continue
                heights = [np.sort((c.ends - bore.ends[0]) @ bore.axis) for c in (a, b)]
                lower, upper = max(h[0] for h in heights), min(h[1] for h in heights)
                if upper - lower > SAME:
                    centre = bore.ends[0] + (lower + upper) / 2 * bore.axis
                    found.append(
                        Engaged(
                            (one.name, other.name), (a.tags, b.tags), centre, bore.axis,
                            float(upper - lower),
                        )
                    )  # fmt: skip
    return tuple(found)


def _across(a: Body, b: Body, contact: Contact, gap: float) -> list[Concentric]:
    plane = a.face(contact.faces[0])
    firsts, seconds = (_at_plane(body, plane) for body in (a, b))
    return [
        Concentric((a.name, b.name), at, plane.normal, (one, other), contact.faces)
        for one, at in firsts
        for other, there in seconds
        if np.linalg.norm(at - there) <= SAME + gap
    ]


def _at_plane(body: Body, plane: Face) -> list[tuple[float, Vector]]:
    """Diameters and axes of the bores that come up to a plane, or to a chamfer below it."""
    found: list[tuple[float, float, Vector]] = []
    for bore in bores(body):
        heights = (bore.ends - plane.centre) @ plane.normal
        end = int(np.argmin(abs(heights)))
        if parallel(bore.axis, plane.normal) and abs(heights[end]) <= bore.radius:
            at = bore.ends[end] - heights[end] * plane.normal
            found.append((abs(heights[end]), bore.diameter, at))
    # of a stepped hole the part nearest to the plane
    nearest: list[tuple[float, Vector]] = []
    for _, diameter, at in sorted(found, key=lambda f: f[0]):
        if all(np.linalg.norm(at - other) > SAME for _, other in nearest):
            nearest.append((diameter, at))
    return nearest


def _one_cylinder(one: Face, other: Face) -> bool:
    return (
        parallel(one.axis, other.axis)
        and abs(one.radius - other.radius) < SAME
        and off_axis(other.on_axis, one.on_axis, one.axis) < SAME
    )


def _span(face: Face, along: Face) -> tuple[float, float]:
    """From where to where a face goes along the axis of another."""
    ends = face.on_axis + np.outer(face.along, face.axis) - along.on_axis
    lower, upper = sorted(ends @ along.axis)
    return lower, upper


def _runs(group: list[Face]) -> list[list[Face]]:
    """Faces of one cylinder, apart where there is a gap along the axis."""
    first = group[0]
    runs, reached = [], -np.inf
    for face in sorted(group, key=lambda f: _span(f, first)):
        lower, upper = _span(face, first)
        runs[-1].append(face) if lower < reached + SAME else runs.append([face])
        reached = max(reached, upper)
    return runs


def _bore(run: list[Face]) -> tuple[Bore, float]:
    first = run[0]
    spans = np.array([_span(face, first) for face in run])
    lower, upper = spans.min(), spans.max()
    around = sum(face.area for face in run) / (first.radius * (upper - lower))
    ends = first.on_axis + np.outer([lower, upper], first.axis)
    return Bore(tuple(f.tag for f in run), first.radius, first.axis, ends), around


def crossed(
    touch: Touch, bodies: Mapping[str, Body], points: Sequence[Sequence[float]]
) -> list[Concentric]:
    """Points (3,) [m] moved onto the nearest plane in which two bodies touch, as bolts without
    holes; none where they touch on no plane."""
    body = bodies[touch.bodies[0]]
    planes = [(body.face(c.faces[0]), c) for c in touch.contacts]
    planes = [(face, c) for face, c in planes if face.normal is not None]
    found = []
    for point in np.array(points) if planes else ():
        off = [(face.centre - point) @ face.normal for face, _ in planes]
        nearest = int(np.argmin(np.abs(off)))
        face, contact = planes[nearest]
        at = point + off[nearest] * face.normal
        found.append(Concentric(touch.bodies, at, face.normal, (0.0, 0.0), contact.faces))
    return found
