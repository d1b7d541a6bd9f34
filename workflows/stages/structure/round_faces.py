"""Faces in contact that touch at a point or along a line: where, how far apart faces are looked at
for them, and the elements there, by Hertz' half width of the contact.

    line    a = sqrt(4 F R / (pi L E*)),    point    a = (3 F R / (4 E*))^(1/3),

with all of the force F that bolts and loads press with, which is more than falls to one of several
contacts. K. L. Johnson, Contact Mechanics (1985), sec. 4.2.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from beadwave.geometry.cad.contacts import TouchingPair
from beadwave.geometry.cad.round_contacts import RoundContact, is_round, round_contact
from beadwave.geometry.cad.selectors import bodies_named
from beadwave.geometry.cad.solids import Body
from beadwave.geometry.drawing import Drawing, FinePoint, extruded_along
from beadwave.workflows.scene import Scene
from beadwave.workflows.scene.tables.bolts import CONTACT
from beadwave.workflows.stages.structure.bolted_joints import BoltedPlace

WIDTHS = 2.5  # half widths from the point or line, to which faces are looked at
FINEST = {"point": 1 / 4, "line": 1 / 3}  # size of elements over the half width
FINE_WITHIN = 1.3  # half widths from the point or line, in which elements are so fine
# squares on a line in tetrahedra: each has two facets, with three columns of the compliance each
MOST_FACETS = 500
# of the relative radius: the half width where what presses is heat, whose force is not known; steel
# has yielded long before
BY_HEAT = 0.03


class HertzianContact(NamedTuple):
    """A contact at a point or along a line."""

    half_width: float  # [m] of the zone, by all of the force
    reach: float  # [m] apart, to which faces are looked at
    fine: list[FinePoint]
    graded: tuple[str, ...]  # bodies that are to be meshed in tetrahedra


def with_round_contacts(scene: Scene, drawing: Drawing) -> Drawing:
    """The drawing with the pairs of bodies that joints in contact name and that touch at points or
    along lines as touching pairs without an area, and these contacts by the name of the pair."""
    bodies, near = drawing.bodies, drawing.near
    touching, found = list(near.touching), {}
    for joint in scene.joints or ():
        if joint.model != CONTACT:
            continue
        for first, second in joint.pairs:
            sides = (bodies_named(side, bodies) for side in (first, second))
            for pair in product(*sides):
                touch = next((t for t in touching if {*t.bodies} == {*pair}), None)
                if pair[0] == pair[1] or (touch and touch.name in found):
                    continue
                contacts = tuple(_round_contacts(drawing, pair, touch, scene.assembly.gap))
                if touch is None and contacts:
                    touch = TouchingPair(pair, tuple(c.contact for c in contacts))
                    touching.append(touch)
                if contacts:
                    found[touch.name] = contacts
    if not found:
        return drawing
    names = {frozenset(touch.bodies) for touch in touching}
    misses = tuple(miss for miss in near.misses if frozenset(miss.bodies) not in names)
    near = near._replace(touching=tuple(touching), misses=misses)
    return drawing._replace(near=near, round_contacts=found)


def _round_contacts(
    drawing: Drawing, pair: tuple[str, str], touch: TouchingPair | None, gap: float
) -> Iterator[RoundContact]:
    """Contacts of two bodies at points and along lines, of a mesh where facets of round faces
    touch."""
    if drawing.own is None:
        if touch is None:
            from beadwave.geometry.cad.touching import round_neighbours

            yield from round_neighbours(*(drawing.bodies[name] for name in pair), gap)
        return
    if touch is None:
        return
    a, b = (drawing.bodies[name] for name in touch.bodies)
    for contact in touch.contacts:
        faces = a.face(contact.faces[0]), b.face(contact.faces[1])
        if is_round(*faces):
            at, size = drawing.own.closest(touch, contact)
            round_one = round_contact(a, b, *faces, at, gap + size)
            yield from () if round_one is None else (round_one,)


def hertzian_contacts(
    scene: Scene,
    bodies: Mapping[str, Body],
    touch: TouchingPair,
    contacts: Sequence[RoundContact],
    bolted: Sequence[BoltedPlace],
) -> list[HertzianContact]:
    """The contacts of a touching pair under what bolts and loads press with."""
    force = sum(place.preload for place in bolted if place.rod is not None)
    force += sum(abs(load.force or 0.0) + abs(load.tension or 0.0) for load in scene.loads or ())
    by_heat = any(load.temperature for load in scene.loads or ())
    compliance = 0.0  # 1 / E*
    for name in touch.bodies:
        solid = scene.made_of(name)
        nu = solid.poisson if solid.is_isotropic else 0.0
        compliance += (1 - nu**2) / float(np.min(solid.young))

    result = []
    for contact in contacts:
        R, L = 1 / contact.curvature, contact.length
        if by_heat:
            half = BY_HEAT * R
        elif L:
            half = float(np.sqrt(4 * force * R * compliance / (np.pi * L)))
        else:
            half = float(np.cbrt(0.75 * force * R * compliance))
        # a gap of (WIDTHS half)^2 / 2 R at the last of these, at most as a hollow face has it
        reach = contact.distance + (WIDTHS * half) ** 2 / (2 * R)
        fine, graded = [], []
        for name in touch.bodies if half else ():
            size, points = FINEST["line" if L else "point"] * half, contact.points
            # elements along a line: as long as others in an extrusion, else as wide as long
            long = L and extruded_along(bodies[name], contact.along)
            if L and not long:
                size = max(size, float(np.sqrt(2 * WIDTHS * half * L / MOST_FACETS)))
            if not long:
                graded.append(name)
            if L:
                n = int(np.ceil(L / (2 * size))) + 1
                points = np.linspace(points[0], points[-1], 1 if long else n)
            along, within = contact.along if long else None, FINE_WITHIN * half
            fine += [FinePoint(name, point, size, along, within) for point in points]
        result.append(HertzianContact(half, reach, fine, tuple(graded)))
    return result
