"""Faces, touching pairs and places of joints that a scene names.

A joint sits where a bolt goes through holes of two bodies about one axis, at points of the plane
in which two bodies touch, where a shank of one body sits in a bore of another, or at holes that are
fixed to the ground. At each place it holds one named face of each body: the disc under a washer,
the bolt's share of the common face, the engaged length of a thread, or the wall of a hole.
"""

from collections.abc import Mapping, Sequence
from itertools import combinations, product
from typing import Literal, NamedTuple

import numpy as np

from beadwave.geometry.cad.contacts import TouchingPair
from beadwave.geometry.cad.holes import (
    THREAD_DEPTH,
    bores,
    concentric,
    crossed,
    engaged,
    misaligned,
)
from beadwave.geometry.cad.patches import CurvedDisc, Disc, Patch, Share, Spots, ThreadBand
from beadwave.geometry.cad.selectors import FaceSelection, bodies_named, faces, touches
from beadwave.geometry.cad.solids import Body, Vector
from beadwave.geometry.errors import InvalidGeometry


class JointWords(NamedTuple):
    """A joint as its table gives it."""

    name: str  # of its places, numbered from 1
    key: str  # that messages call it by
    first: str  # body, with * bodies; of a joint to the ground faces
    second: str | None  # None is the ground
    at: Literal["holes", "thread"] | Sequence[Sequence[float]] = "holes"  # or points [m]
    washer: float | None = None  # m, radius; None: the larger diameter of the two holes
    shares: tuple[int, ...] = ()  # sides that hold the bolt's share of the common face, if any
    patches: str | None = None  # before the numbers of what it holds; None: its name
    only_touches: bool = False  # faces in contact without a bolt: it holds nothing of them


class Under(NamedTuple):
    """Parts of a plane face: discs or rectangles around points."""

    at: Sequence[Sequence[float]]  # [m], moved onto the face
    radius: float | None = None  # m
    sides: tuple[float, float] | None = None  # m, along the two global axes that span the face


class TieWords(NamedTuple):
    """A tie as its table gives it."""

    between: str  # "a|b"
    under: Under | None = None  # None: all that touches


class Words(NamedTuple):
    """All bodies and faces that a scene names, as it writes them (`geometry.cad.selectors`)."""

    bodies: Sequence[str] = ()  # patterns that some body must fit
    groups: Mapping[str, str] = {}  # patterns of bodies by the key that messages call them by
    faces: Mapping[str, str] = {}  # selectors by the name of the face
    keys: Mapping[str, str] = {}  # that messages call selectors by, by selector
    struck: str | None = None  # selector
    under: Mapping[str, Under] = {}  # parts of these faces that are meant, by the face's name
    ties: Sequence[TieWords] = ()
    joints: Sequence[JointWords] = ()


class JointPlace(NamedTuple):
    """A joint at one place: one bolt, thread or hole."""

    joint: str  # name of the joint
    bodies: tuple[str, ...]  # the first and the second; the first alone is held to the ground
    faces: tuple[str, ...]  # "body:face" of either
    centre: Vector  # (3,) [m]
    axis: Vector  # (3,) of the bolt or hole
    # for each side, the other side's face whose footprint the mean motion is taken over; None: all
    # of its own face
    over: tuple[str | None, ...] = (None, None)
    # diameter and length [m] of the hole in either body; none of points, threads and the ground
    holes: tuple[tuple[float, float], ...] = ()


class NamedParts(NamedTuple):
    """Bodies, faces and joints that a scene's words refer to."""

    groups: dict[str, list[str]]  # bodies by the key of their pattern
    faces: dict[str, FaceSelection]  # those of the words, and those that joints hold as they are
    patches: dict[str, Patch]  # what joints hold of a face, to be imprinted
    struck: FaceSelection | None
    tied: dict[str, TouchingPair]  # by the pair's name "a|b"
    # slave and master, "body:face", of those that are tied under parts alone, by the pair's name
    partly: dict[str, tuple[str, str]]
    jointed: dict[str, str]  # the joint's name by the pair's, of threads both ways round
    joints: list[JointPlace]


def picked(
    words: Words, bodies: Mapping[str, Body], touching: Sequence[TouchingPair], gap: float
) -> NamedParts:
    """Bodies, faces and joints that a scene's words refer to; call it in the bodies' ``with
    model(...)``. `gap` [m] is the distance up to which bodies touch and axes of holes are one.

    Raises InvalidGeometry for words that pick nothing or leave a choice, with what there is.
    """
    # patterns of bodies, pairs that are tied, faces by name, and the face that is struck
    for pattern in words.bodies:
        bodies_named(pattern, bodies)
    groups = {}
    for key, pattern in words.groups.items():
        try:
            groups[key] = bodies_named(pattern, bodies)
        except InvalidGeometry as error:
            raise InvalidGeometry(f"{key}: {error}") from None
    pairs = [(tie, t) for tie in words.ties for t in touches(tie.between, bodies, touching)]
    tied = {touch.name: touch for _, touch in pairs}
    selected = {}
    for selector in (*words.faces.values(), *([words.struck] if words.struck else ())):
        try:
            selected[selector] = faces(selector, bodies)
        except InvalidGeometry as error:
            key = words.keys.get(selector)
            raise InvalidGeometry(f"{key}: {error}" if key else str(error)) from None
    named = {name: selected[selector] for name, selector in words.faces.items()}
    patches = {
        name: _spots(named[name], under, bodies, words.keys.get(words.faces[name], name))
        for name, under in words.under.items()
    }
    struck = selected[words.struck] if words.struck else None
    result = NamedParts(groups, named, dict(patches), struck, tied, {}, {}, [])

    # a tie of parts: the smaller body follows under these the whole face of the larger one
    for tie, touch in pairs:
        if tie.under is None:
            continue
        slave, master = sorted(touch.bodies, key=lambda name: bodies[name].volume)
        in_mesh = []
        for body in (slave, master):
            side = touch.bodies.index(body)
            tags = tuple(dict.fromkeys(contact.faces[side] for contact in touch.contacts))
            name, on = f"under-{touch.name}-{body}", FaceSelection(body, tags)
            if body == slave:
                result.patches[name] = _spots(on, tie.under, bodies, f"ties {touch.name}")
            else:
                result.faces[name] = on
            in_mesh.append(f"{body}:{name}")
        result.partly[touch.name] = (in_mesh[0], in_mesh[1])

    # names of faces and joints are numbered by kind: bolts, then threads, then holes to the ground
    for joint in words.joints:
        if joint.second is not None and joint.at != "thread":
            _place_bolts(joint, result, bodies, touching, gap)
    n_threads = 0
    for joint in words.joints:
        if joint.second is not None and joint.at == "thread":
            n_threads = _place_threads(joint, result, bodies, n_threads)
    for joint in words.joints:
        if joint.second is not None:
            continue
        selected = faces(joint.first, bodies)
        walls = [b for b in bores(bodies[selected.body]) if set(b.tags) <= set(selected.tags)]
        for i, bore in enumerate(walls, start=1):
            name, body = f"{joint.name}-{i}", selected.body
            result.faces[name] = FaceSelection(body, bore.tags)
            centre = bore.ends.mean(axis=0)
            result.joints.append(
                JointPlace(joint.name, (body,), (f"{body}:{name}",), centre, bore.axis)
            )
    return result


def _spots(on: FaceSelection, under: Under, bodies: Mapping[str, Body], key: str) -> Spots:
    """The parts of a plane face that are meant, on it; `key` is what messages call it by."""
    face = bodies[on.body].face(on.tags[0])
    if face.normal is None:
        raise InvalidGeometry(f"{key}: under names parts of a plane, this face is none; drop it.")
    at = np.array(under.at, dtype=float)
    off = (face.centre - at) @ face.normal
    return Spots(on, at + np.outer(off, face.normal), face.normal, under.radius, under.sides)


def _place_bolts(
    joint: JointWords,
    result: NamedParts,
    bodies: Mapping[str, Body],
    touching: Sequence[TouchingPair],
    gap: float,
) -> None:
    """Adds the bolts of a joint between two bodies, and what each holds on both faces."""
    between = f"{joint.first}|{joint.second}"
    pairs = touches(between, bodies, touching)
    result.jointed.update({touch.name: joint.name for touch in pairs})
    if joint.only_touches:
        return

    # where its bolts go: through holes about one axis, or at points moved onto the common plane.
    # Two holes that open into each other about two axes are no joint, but a mistake in the drawing
    places = []
    for touch in pairs:
        if joint.at == "holes":
            places += concentric(touch, bodies, gap)
            for pair in misaligned(touch, bodies, gap):
                at = ", ".join(f"{x:.4g}" for x in pair.centres[0].round(6) + 0.0)
                raise InvalidGeometry(
                    f'{joint.key}: two holes of "{touch.name}" near [{at}] m miss each other by '
                    f"{1e3 * pair.distance:.3g} mm; align them, or give the bolts by at = "
                    "[[x, y, z], ...] and washer."
                )
            continue
        bolts = crossed(touch, bodies, joint.at)
        if not bolts:
            raise InvalidGeometry(
                f'{joint.key} has points, but "{touch.name}" touch on no plane; tie them.'
            )
        # bolts without a washer of their own are 2 mm apart at least
        radius = 1e-3 if joint.washer is None else joint.washer
        for i, j in combinations(range(len(bolts)), 2):
            distance = np.linalg.norm(bolts[i].centre - bolts[j].centre)
            if distance < 2 * radius * (1 - 1e-9):
                raise InvalidGeometry(
                    f"points {i + 1} and {j + 1} of {joint.key}.at are {distance:.4g} m apart, "
                    f"where washers need {2 * radius:g} m; name each bolt once, or take a smaller "
                    "washer."
                )
        places += bolts
    if not places:
        raise InvalidGeometry(
            f'{joint.key} finds no hole through both of "{between}"; give at = [[x, y, z], ...] '
            "and washer."
        )

    # each bolt and what it holds of either face: the disc under its washer, or its share
    first, second = (bodies_named(side, bodies) for side in (joint.first, joint.second))
    for i, place in enumerate(places, start=1):
        # the joint's first body first, z from it to the second
        sides, axis = list(zip(place.bodies, place.faces, strict=True)), place.axis
        holes = list(zip(place.diameters, place.lengths, strict=True))
        if not (place.bodies[0] in first and place.bodies[1] in second):
            sides, axis, holes = sides[::-1], -axis, holes[::-1]
        is_plane = bodies[place.bodies[0]].face(place.faces[0]).normal is not None
        if joint.shares and not is_plane:
            raise InvalidGeometry(
                f'{joint.key}.washer = "share" parts plane faces, "{between}" touch on curved ones '
                "there; give a radius, or tie them."
            )
        # a disc on curved faces lies on all of them, as a seam may run through it
        touch = next(t for t in pairs if t.bodies == place.bodies)
        tags = {
            body: (tag,)
            if is_plane
            else tuple(dict.fromkeys(c.faces[side] for c in touch.contacts))
            for side, (body, tag) in enumerate(zip(place.bodies, place.faces, strict=True))
        }
        on = [FaceSelection(body, tags[body]) for body, _ in sides]
        names = [f"{joint.patches or joint.name}-{i}-{body}" for body, _ in sides]
        in_mesh = [f"{body}:{name}" for (body, _), name in zip(sides, names, strict=True)]
        over: list[str | None] = [None, None]
        if not joint.shares:
            radius = joint.washer or max(place.diameters)
            for name, selected in zip(names, on, strict=True):
                patch = Disc if is_plane else CurvedDisc
                result.patches[name] = patch(selected, place.centre, place.axis, radius)
        else:
            # nearer to this bolt than to the other bolts on the face; on a side where the share is
            # not imprinted the mean is taken over the footprint of the side where it is
            others = [p.centre for p in places if p.faces == place.faces and p is not place]
            contacts = (c for touch in pairs for c in touch.contacts)
            regions = next(c.regions for c in contacts if c.faces == place.faces)
            for side in joint.shares:
                result.patches[names[side]] = Share(
                    on[side], regions, place.centre, others, "|".join(place.bodies)
                )
            for side in {0, 1} - set(joint.shares):
                result.faces[names[side]] = on[side]
                over[side] = in_mesh[joint.shares[0]]
        pair = tuple(body for body, _ in sides)
        result.joints.append(
            JointPlace(
                joint.name,
                pair,
                tuple(in_mesh),
                place.centre,
                axis,
                tuple(over),
                tuple(holes) if joint.at == "holes" else (),
            )
        )


def _place_threads(
    joint: JointWords, result: NamedParts, bodies: Mapping[str, Body], n_before: int
) -> int:
    """Adds the threads of a joint, numbered on from those before; how many there are now."""
    firsts, seconds = (bodies_named(side, bodies) for side in (joint.first, joint.second))
    pairs = {frozenset(pair): pair for pair in product(firsts, seconds) if len({*pair}) == 2}

    # a shank in a bore of each pair of bodies; several cylinders in common leave a choice
    threads = []
    for pair in pairs.values():
        in_pair = engaged(*(bodies[name] for name in pair))
        if len(in_pair) > 1:
            places = " and ".join(f"{np.round(t.centre, 6).tolist()} m" for t in in_pair)
            raise InvalidGeometry(
                f'{joint.key}.at = "thread": "{"|".join(pair)}" have {len(in_pair)} cylinders in '
                f"common, at {places}, and a thread is one; make the other one wider than its "
                "shank, or draw it as a body of its own."
            )
        threads += in_pair

    # none: the sentence has the cylinders that there are, so that the wrong diameter shows
    if not threads:
        sizes = [
            f'"{name}" has a {what} of {1e3 * cylinder.diameter:.4g} mm'
            for name in dict.fromkeys([*firsts, *seconds])
            for what, hollow in (("shank", False), ("bore", True))
            for cylinder in bores(bodies[name], hollow=hollow)
        ]
        raise InvalidGeometry(
            f'{joint.key}.at = "thread" finds no shank of one of "{joint.first}|{joint.second}" in '
            f"a bore of the other, on one axis, up to {100 * THREAD_DEPTH:g} % of the bore's "
            f"radius apart: {', '.join(sizes[:6]) or 'neither has a cylinder'}; move them onto "
            "each other, or give at = [[x, y, z], ...] and washer."
        )

    # both bodies hold the engaged length of their cylinder; the thread joins the touching pair
    for i, thread in enumerate(threads, start=n_before + 1):
        names = [f"{joint.name}-{i}-{body}" for body in thread.bodies]
        for name, body, tags in zip(names, thread.bodies, thread.tags, strict=True):
            on = FaceSelection(body, tags)
            result.patches[name] = ThreadBand(on, thread.centre, thread.axis, thread.length)
        in_mesh = tuple(f"{b}:{n}" for b, n in zip(thread.bodies, names, strict=True))
        result.joints.append(
            JointPlace(joint.name, thread.bodies, in_mesh, thread.centre, thread.axis)
        )
        for a, b in (thread.bodies, thread.bodies[::-1]):
            result.jointed[f"{a}|{b}"] = joint.name
    return n_before + len(threads)
