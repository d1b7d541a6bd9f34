"""Contacts of bodies, found on the CAD before anything is meshed.

Two faces touch where they lie within `gap` of each other over an area: coplanar planes that look
at each other, a pin in its bore, any two faces on one surface. The area is that of their common
part, by OpenCASCADE's intersection with `gap` as its tolerance. Bodies that overlap, and bodies
that nearly touch or meet along a line only, are reported with numbers: a user has to decide.
"""

from collections.abc import Iterator, Mapping
from itertools import combinations, product

import gmsh
import numpy as np

from beadwave.geometry.cad.contacts import (
    MIN_COMMON_AREA,
    NEARLY_TOUCHING,
    FaceContact,
    NearMiss,
    Neighbours,
    Overlap,
    TouchingPair,
)
from beadwave.geometry.cad.round_contacts import RoundContact, is_round, round_contact
from beadwave.geometry.cad.solids import ALIGNED, Body, Face, off_axis, parallel
from beadwave.geometry.meshing.gmsh_session import boolean_tolerance, failing


def neighbours(bodies: Mapping[str, Body], gap: float) -> Neighbours:
    """Every pair of bodies that touch across at most `gap` [m], overlap, or nearly touch; to be
    called in the ``with model(...)`` of the bodies. Raises ValueError, naming both bodies, where
    the kernel cannot intersect them."""
    occ = gmsh.model.occ
    touching, misses, overlaps = [], [], []
    for a, b in combinations(bodies.values(), 2):
        if not _boxes_meet(a, b, NEARLY_TOUCHING + gap):
            continue
        with failing(f'"{a.name}" and "{b.name}" could not be intersected'):
            contacts = tuple(_contacts(a, b, gap))

            # the volume that both fill; a shell no thicker than the gap is none
            volume = 0.0
            if _boxes_meet(a, b, -gap):
                keep = {"removeObject": False, "removeTool": False}
                common, _ = occ.intersect([(3, a.tag)], [(3, b.tag)], **keep)
                volume = sum(occ.getMass(*entity) for entity in common if entity[0] == 3)
                occ.remove(common, recursive=True)
            overlapping = volume > gap * min(a.area, b.area)

            # bodies that overlap may touch as well; those that do neither may have been meant to
            if overlapping:
                inner = [body.name for body in (a, b) if volume > (1 - 1e-6) * body.volume]
                overlaps.append(Overlap((a.name, b.name), volume, inner[0] if inner else None))
            if contacts:
                touching.append(TouchingPair((a.name, b.name), contacts))
            elif not overlapping:
                distance, *points = occ.getDistance(3, a.tag, 3, b.tag)
                if distance <= NEARLY_TOUCHING:
                    at = np.mean(np.reshape(points, (2, 3)), axis=0)
                    misses.append(NearMiss((a.name, b.name), distance, at))
    return Neighbours(tuple(touching), tuple(misses), tuple(overlaps))


def _contacts(a: Body, b: Body, gap: float) -> Iterator[FaceContact]:
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
        if area > MIN_COMMON_AREA * min(first.area, second.area):
            flush = area > (1 - MIN_COMMON_AREA) * max(first.area, second.area)
            yield FaceContact((first.tag, second.tag), area, distance, regions, flush)


def round_neighbours(a: Body, b: Body, gap: float) -> Iterator[RoundContact]:
    """Faces of two bodies that touch at a point or along a line, across at most `gap` [m]; to be
    called as `neighbours`."""
    for first, second in product(a.faces, b.faces):
        if is_round(first, second) and _boxes_meet(first, second, gap):
            distance, *ends = gmsh.model.occ.getDistance(2, first.tag, 2, second.tag)
            if distance <= gap:
                at = np.reshape(ends, (2, 3))
                contact = round_contact(a, b, first, second, at, gap)
                yield from () if contact is None else (contact,)


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
    """True if the boxes around both come within a distance [m] of each other along every axis; with
    a negative one, whether they overlap by more than that."""
    return bool(np.all(a.lower - within <= b.upper) and np.all(b.lower - within <= a.upper))
