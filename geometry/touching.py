"""Where bodies touch, found on the CAD before anything is meshed.

Two faces touch where they lie within `gap` of each other over an area: coplanar planes that look
at each other, a pin in its bore, any two faces on one surface. The area is that of their common
part, by OpenCASCADE's intersection with `gap` as its tolerance. Bodies that meet without a common
area, overlap, or miss each other are told apart from those, with numbers.
"""

from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import NamedTuple

import gmsh
import numpy as np

from geometry.assembly import InvalidGeometry
from geometry.gmsh_session import boolean_tolerance, failing
from geometry.solids import ALIGNED, SAME, Body, Face, off_axis, parallel

NEAR = 1e-3  # m, bodies closer than this that do not touch are told
FRACTION = 1e-6  # of the smaller face: a common area below is none


class Contact(NamedTuple):
    """Two faces that touch."""

    faces: tuple[int, int]  # tags
    area: float  # m^2
    gap: float  # m, mean distance of the two
    regions: tuple[int, ...]  # tags of their common part, surfaces in the CAD model
    flush: bool  # both faces end where the other does


class Touch(NamedTuple):
    """Two bodies that touch."""

    bodies: tuple[str, str]
    contacts: tuple[Contact, ...]

    @property
    def name(self) -> str:
        return "|".join(self.bodies)

    @property
    def area(self) -> float:
        return sum(contact.area for contact in self.contacts)

    @property
    def gap(self) -> float:
        return max(contact.gap for contact in self.contacts)

    def covers(self, body: str) -> Iterator[tuple[str, int]]:
        """Faces (body, tag) of the other body that touch one of this body."""
        if body in self.bodies:
            i = 1 - self.bodies.index(body)
            yield from ((self.bodies[i], contact.faces[i]) for contact in self.contacts)


class NearMiss(NamedTuple):
    """Two bodies that do not touch over an area: a line or a point where the distance is 0."""

    bodies: tuple[str, str]
    distance: float  # m
    at: np.ndarray  # (3,) [m], where they are closest


class Overlap(NamedTuple):
    """Two bodies of which one fills part of the other."""

    bodies: tuple[str, str]
    volume: float  # m^3
    inside: str | None  # the body that lies wholly in the other


class Neighbours(NamedTuple):
    touching: tuple[Touch, ...]
    misses: tuple[NearMiss, ...]
    overlaps: tuple[Overlap, ...]

    def free(self, bodies: Mapping[str, Body]) -> tuple[str, ...]:
        """Bodies that touch no other."""
        touched = {name for touch in self.touching for name in touch.bodies}
        return tuple(name for name in bodies if name not in touched)

    def over(
        self, body: str, points: np.ndarray, bodies: Mapping[str, Body], gap: float
    ) -> str | None:
        """The body that touches this one at one of the points (n, 3) of its surface, if any."""
        faces = (face for touch in self.touching for face in touch.covers(body))
        return next(
            (name for name, tag in faces for p in points if bodies[name].distance(p, tag) <= gap),
            None,
        )


def require_apart(found: Neighbours) -> None:
    """Raises InvalidGeometry for bodies that overlap, with the volume and what to do."""
    for overlap in found.overlaps:
        a, b = overlap.bodies
        if overlap.inside:
            outer = b if overlap.inside == a else a
            raise InvalidGeometry(
                f'"{overlap.inside}" lies inside "{outer}", which is solid there; cut it out of '
                f'"{outer}" or remove it.'
            )
        raise InvalidGeometry(
            f'"{a}" and "{b}" overlap by {1e9 * overlap.volume:.4g} mm^3; cut one out of the '
            "other or move it."
        )


def told(miss: NearMiss) -> str:
    """A pair that nearly touches, in a sentence."""
    a, b = miss.bodies
    at = "[{:.4g}, {:.4g}, {:.4g}] m".format(*(miss.at.round(9) + 0.0))
    if miss.distance < SAME:
        return (
            f'"{a}" and "{b}" meet along a line or at a point, near {at}, and touch over no area: '
            "nothing can be tied there."
        )
    return (
        f'"{a}" and "{b}" miss each other by {1e3 * miss.distance:.4g} mm, near {at}; '
        "faces closer than gap touch."
    )


def neighbours(bodies: Mapping[str, Body], gap: float) -> Neighbours:
    """Every pair of bodies nearer than NEAR; to call in the ``with model(...)`` of the bodies."""
    touching, misses, overlaps = [], [], []
    for a, b in combinations(bodies.values(), 2):
        if not _boxes_meet(a, b, NEAR + gap):
            continue
        with failing(f'"{a.name}" and "{b.name}" could not be intersected'):
            contacts, overlap = tuple(_contacts(a, b, gap)), _overlap(a, b, gap)
            if overlap:
                overlaps.append(overlap)
            if contacts:
                touching.append(Touch((a.name, b.name), contacts))
            elif not overlap:
                misses += [m for m in [_miss(a, b)] if m.distance <= NEAR]
    return Neighbours(tuple(touching), tuple(misses), tuple(overlaps))


def _boxes_meet(a: Body | Face, b: Body | Face, within: float) -> bool:
    return bool(np.all(a.lower - within <= b.upper) and np.all(b.lower - within <= a.upper))


def _contacts(a: Body, b: Body, gap: float) -> Iterator[Contact]:
    for one in a.faces:
        for other in b.faces:
            distance = _apart(one, other) if _boxes_meet(one, other, gap) else None
            if distance is None or distance > gap:
                continue
            regions = _common(one, other, gap)
            area = sum(gmsh.model.occ.getMass(2, tag) for tag in regions)
            if area > FRACTION * min(one.area, other.area):
                flush = area > (1 - FRACTION) * max(one.area, other.area)
                yield Contact((one.tag, other.tag), area, distance, regions, flush)


def _apart(one: Face, other: Face) -> float | None:
    """Distance of two faces that look at each other, None of two that cannot touch flush.

    0 where whether they are one surface is for their intersection to say.
    """
    if one.kind != other.kind:
        return 0.0 if "other" in (one.kind, other.kind) else None
    if one.normal is not None:
        if one.normal @ other.normal > ALIGNED - 1:
            return None
        return abs(float((other.centre - one.centre) @ one.normal))
    if one.axis is not None:
        if not parallel(one.axis, other.axis):
            return None
        eccentric = off_axis(other.on_axis, one.on_axis, one.axis)
        return eccentric + abs(one.radius - other.radius)
    return 0.0


def _common(one: Face, other: Face, gap: float) -> tuple[int, ...]:
    occ = gmsh.model.occ
    copies = [occ.copy([(2, face.tag)]) for face in (one, other)]
    with boolean_tolerance(2 * gap):
        shared, _ = occ.intersect(*copies)
    return tuple(tag for dimension, tag in shared if dimension == 2)


def _overlap(a: Body, b: Body, gap: float) -> Overlap | None:
    """The volume that both fill; a shell no thicker than the gap is none."""
    if not _boxes_meet(a, b, -gap):
        return None
    occ = gmsh.model.occ
    keep = {"removeObject": False, "removeTool": False}
    shared, _ = occ.intersect([(3, a.tag)], [(3, b.tag)], **keep)
    volume = sum(occ.getMass(*entity) for entity in shared if entity[0] == 3)
    occ.remove(shared, recursive=True)
    if volume <= gap * min(a.area, b.area):
        return None
    whole = [body.name for body in (a, b) if volume > (1 - 1e-6) * body.volume]
    return Overlap((a.name, b.name), volume, whole[0] if whole else None)


def _miss(a: Body, b: Body) -> NearMiss:
    distance, *points = gmsh.model.occ.getDistance(3, a.tag, 3, b.tag)
    return NearMiss((a.name, b.name), distance, np.mean(np.reshape(points, (2, 3)), axis=0))
