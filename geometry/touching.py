"""Where bodies touch, found on the CAD before anything is meshed.

Two faces touch where they lie within `gap` of each other over an area: coplanar planes that look
at each other, a pin in its bore, any two faces on one surface. The area is that of their common
part, by OpenCASCADE's intersection with `gap` as its tolerance. Bodies that overlap, and bodies
that nearly touch or meet along a line only, are reported with numbers: a user has to decide.
"""

from collections.abc import Iterator, Mapping
from itertools import combinations, product
from typing import NamedTuple

import gmsh
import numpy as np

from geometry.assembly import InvalidGeometry
from geometry.gmsh_session import boolean_tolerance, failing
from geometry.solids import ALIGNED, SAME, Body, Face, off_axis, parallel


class Closeness(NamedTuple):
    """When bodies touch or nearly touch."""

    near: float = 1e-3  # m, bodies closer than this that do not touch are reported; not varied
    # of the smaller face: a smaller common area is the rounding of an intersection, and faces whose
    # areas differ by less end together; not varied
    fraction: float = 1e-6


CLOSENESS = Closeness()


class FaceContact(NamedTuple):
    """Two faces that touch."""

    faces: tuple[int, int]  # tags
    area: float  # m^2
    gap: float  # m, mean distance of the two
    regions: tuple[int, ...]  # tags of their common part, surfaces in the CAD model
    flush: bool  # both faces end where the other does


class TouchingPair(NamedTuple):
    """Two bodies that touch."""

    bodies: tuple[str, str]
    contacts: tuple[FaceContact, ...]

    @property
    def name(self) -> str:
        """Names of both bodies, "a|b"."""
        return "|".join(self.bodies)

    @property
    def area(self) -> float:
        """Area in common [m^2]."""
        return sum(contact.area for contact in self.contacts)

    @property
    def gap(self) -> float:
        """Largest mean distance of two faces that touch [m]."""
        return max(contact.gap for contact in self.contacts)

    def covers(self, body: str) -> Iterator[tuple[str, int]]:
        """Faces (body, tag) of the partner that touch one of this body."""
        if body in self.bodies:
            i = 1 - self.bodies.index(body)
            yield from ((self.bodies[i], contact.faces[i]) for contact in self.contacts)


class NearMiss(NamedTuple):
    """Two bodies that do not touch over an area: a line or a point where the distance is 0."""

    bodies: tuple[str, str]
    distance: float  # m
    at: np.ndarray  # (3,) [m], where they are closest

    @property
    def sentence(self) -> str:
        """The pair, its distance and where, as a sentence."""
        a, b = self.bodies
        at = "[{:.4g}, {:.4g}, {:.4g}] m".format(*(self.at.round(9) + 0.0))
        if self.distance < SAME:
            return (
                f'"{a}" and "{b}" meet along a line or at a point, near {at}, and touch over no '
                "area: nothing can be tied there."
            )
        return (
            f'"{a}" and "{b}" miss each other by {1e3 * self.distance:.4g} mm, near {at}; '
            "faces closer than gap touch."
        )


class Overlap(NamedTuple):
    """Two bodies of which one fills part of the other."""

    bodies: tuple[str, str]
    volume: float  # m^3
    inside: str | None  # the body that lies wholly in the other


class Neighbours(NamedTuple):
    """All pairs of bodies that touch, nearly touch, or overlap."""

    touching: tuple[TouchingPair, ...]
    misses: tuple[NearMiss, ...]
    overlaps: tuple[Overlap, ...]

    def free(self, bodies: Mapping[str, Body]) -> tuple[str, ...]:
        """Bodies that touch none."""
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


def require_apart(neighbours: Neighbours) -> None:
    """Raises InvalidGeometry for bodies that overlap, with the volume and what to do."""
    for overlap in neighbours.overlaps:
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


def neighbours(
    bodies: Mapping[str, Body], gap: float, closeness: Closeness = CLOSENESS
) -> Neighbours:
    """Every pair of bodies that touch across at most `gap` [m], overlap, or nearly touch; to be
    called in the ``with model(...)`` of the bodies."""
    occ = gmsh.model.occ
    touching, misses, overlaps = [], [], []
    for a, b in combinations(bodies.values(), 2):
        if not _boxes_meet(a, b, closeness.near + gap):
            continue
        with failing(f'"{a.name}" and "{b.name}" could not be intersected'):
            contacts = tuple(_contacts(a, b, gap, closeness))

            # the volume that both fill; a shell no thicker than the gap is none
            volume = 0.0
            if _boxes_meet(a, b, -gap):
                keep = {"removeObject": False, "removeTool": False}
                common, _ = occ.intersect([(3, a.tag)], [(3, b.tag)], **keep)
                volume = sum(occ.getMass(*entity) for entity in common if entity[0] == 3)
                occ.remove(common, recursive=True)
            overlapping = volume > gap * min(a.area, b.area)

            if overlapping:
                inner = [body.name for body in (a, b) if volume > (1 - 1e-6) * body.volume]
                overlaps.append(Overlap((a.name, b.name), volume, inner[0] if inner else None))
            if contacts:
                touching.append(TouchingPair((a.name, b.name), contacts))
            elif not overlapping:
                distance, *points = occ.getDistance(3, a.tag, 3, b.tag)
                if distance <= closeness.near:
                    at = np.mean(np.reshape(points, (2, 3)), axis=0)
                    misses.append(NearMiss((a.name, b.name), distance, at))
    return Neighbours(tuple(touching), tuple(misses), tuple(overlaps))


def _contacts(a: Body, b: Body, gap: float, closeness: Closeness) -> Iterator[FaceContact]:
    """Pairs of faces with an area in common, found by OpenCASCADE's intersection of their
    copies."""
    occ = gmsh.model.occ
    for first, second in product(a.faces, b.faces):
        distance = facing_distance(first, second) if _boxes_meet(first, second, gap) else None
        if distance is None or distance > gap:
            continue
        copies = [occ.copy([(2, face.tag)]) for face in (first, second)]
        with boolean_tolerance(2 * gap):
            common, _ = occ.intersect(*copies)
        regions = tuple(tag for dimension, tag in common if dimension == 2)
        area = sum(occ.getMass(2, tag) for tag in regions)
        if area > closeness.fraction * min(first.area, second.area):
            flush = area > (1 - closeness.fraction) * max(first.area, second.area)
            yield FaceContact((first.tag, second.tag), area, distance, regions, flush)


def facing_distance(first: Face, second: Face) -> float | None:
    """Distance [m] of two faces that face each other; None for two that cannot touch over an area,
    0 where only their intersection can tell."""
    if first.kind != second.kind:
        return 0.0 if "other" in (first.kind, second.kind) else None
    if first.normal is not None:
        if first.normal @ second.normal > ALIGNED - 1:
            return None
        return abs(float((second.centre - first.centre) @ first.normal))
    if first.axis is not None:
        if not parallel(first.axis, second.axis):
            return None
        eccentricity = off_axis(second.on_axis, first.on_axis, first.axis)
        return eccentricity + abs(first.radius - second.radius)
    return 0.0


def _boxes_meet(a: Body | Face, b: Body | Face, within: float) -> bool:
    return bool(np.all(a.lower - within <= b.upper) and np.all(b.lower - within <= a.upper))
