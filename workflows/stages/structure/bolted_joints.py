"""Joints that are known from their drawing: places of bolts -> springs, discs held, masses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave import fem
from beadwave.geometry.cad.contacts import TouchingPair
from beadwave.geometry.cad.joints import JointPlace, NamedParts
from beadwave.geometry.cad.patches import CurvedDisc, Disc
from beadwave.geometry.cad.selectors import FaceSelection
from beadwave.geometry.cad.solids import ALIGNED, SAME, Body, Face, off_axis
from beadwave.geometry.drawing import Drawing
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.scene.tables.bodies import Bolts
from beadwave.workflows.scene.tables.bolts import CONTACT

# of K in T = K F d from bolt to bolt: +-30 % are two deviations
TORQUE_DEVIATION = 0.15
CHAMFER = 0.25  # depth of a hole's chamfer over its diameter, at most
FRICTION = 0.15  # of steel on steel, where the scene gives none: assumed


class BoltedPlace(NamedTuple):
    """One bolt at one pair of faces."""

    number: int  # of the joint among all of the model's
    joint: str  # name of its table
    pair: str  # "left|right", from the head on
    faces: tuple[str, str]  # "body:face" of the discs held
    centre: NDArray[np.float64]  # (3,) of the discs [m]
    bolt: str  # its name, or its diameter
    preload: float  # [N]
    preload_deviation: float  # [N]
    proof_load: float  # [N]
    stiffness: fem.JointStiffness
    springs: fem.Bushing  # of the model: by formula, or as the scene has them
    deviation: NDArray[np.float64]  # (6,) of ln; 0 of springs that the scene gives
    # masses of head and nut, each with the face that it moves with and its centre (3,) [m]
    fasteners: tuple[tuple[str, fem.Fastener, NDArray[np.float64]], ...]

    axis: NDArray[np.float64]  # (3,) from head to nut
    hole: float  # [m] diameter, the wider of both
    in_contact: bool  # its faces are in contact, and a rod from head to nut presses them
    rod: fem.Rod | None  # of a contact, at the faces next to the head

    @property
    def utilisation(self) -> float:
        """Preload over proof load."""
        return self.preload / self.proof_load


def bolted_places(
    scene: Scene, selection: NamedParts, bodies: Mapping[str, Body],
    touching: Sequence[TouchingPair],
) -> dict[int, BoltedPlace]:  # fmt: skip
    """The places of joints with a bolt, by their numbers in the selection, whose discs get the
    radius of the foot; raises InvalidScene for a bolt that does not fit, and for one whose hole
    has a rod of [[loads]] as well."""
    tables = {joint.name: joint for joint in scene.joints or () if joint.bolt is not None}
    numbered = [(i, p) for i, p in enumerate(selection.joints) if p.joint in tables]
    placed = {}
    for i, place in numbered:
        table = tables[place.joint]
        key = f"{scene.name}: joints.{place.joint}"

        # pairs of faces along one bolt, from its head to its nut
        along = [place]
        if table.stack:
            along = [
                p for pair in pairwise(table.stack) for _, p in numbered
                if p.joint == place.joint and p.bodies == pair
                and off_axis(p.centre, place.centre, place.axis) < SAME
            ]  # fmt: skip
        if table.stack and [p.bodies for p in along] != list(pairwise(table.stack)):
            found = " and ".join("|".join(p.bodies) for p in along)
            raise InvalidScene(
                f"{key}.stack = {list(table.stack)}: the bolt near "
                f"{np.round(place.centre, 6).tolist()} m goes through {found} alone; let the holes "
                "of all bodies stand about one axis, in the order of the stack."
            )
        members = [_member(scene, key, table, along[0], 0, bodies, end=True)]
        members += [_member(scene, key, table, p, 1, bodies, end=p is along[-1]) for p in along]
        interface = next(n for n, p in enumerate(along) if p is place)
        _require_no_rod(key, place, selection, bodies)
        _require_no_cone(key, table, place, touching, bodies)

        preload, deviation = _preload(table)
        others = [p for _, p in numbered if p.faces != place.faces and p.bodies == place.bodies]
        apart = [np.linalg.norm(p.centre - place.centre) for p in others]
        bolt = fem.Bolt(*table.fastener)
        friction, rms = _surface(table)
        faces = fem.PressedFaces(
            interface,
            friction,
            rms,
            table.washer or 0.0,
            min(apart, default=np.inf) / 2,
            table.sides,
        )
        stiffness = fem.joint_stiffness_by_formula(bolt, members, faces, preload)
        for face in place.faces:
            name = face.partition(":")[2]
            disc = selection.patches[name]
            assert isinstance(disc, Disc | CurvedDisc)
            selection.patches[name] = disc._replace(radius=stiffness.held)

        # a key of the scene replaces its spring
        given = [getattr(table, name) for name in fem.DIRECTIONS]
        springs = fem.Bushing(
            *(k if own is None else own for own, k in zip(given, stiffness.springs, strict=True))
        )
        spread = np.where([own is None for own in given], stiffness.deviation, 0.0)

        # in a contact head and nut press discs of the outer faces
        in_contact, rod = table.model == CONTACT, None
        first, last = place.faces
        if in_contact:
            ends_of_bolt = []
            for p, side, what in ((along[0], 0, "head"), (along[-1], 1, "nut")):
                face, outer, away = _bearing_face(table, p, side, bodies)
                name, body = f"bearing-{place.joint}-{i - interface}-{what}", p.bodies[side]
                disc = Disc(FaceSelection(body, (face.tag,)), outer, away, bolt.bearing / 2)
                selection.patches[name] = disc
                ends_of_bolt.append(f"{body}:{name}")
            first, last = ends_of_bolt
            if interface == 0:
                rod = fem.Rod(first, last, preload, stiffness.bolt)

        # masses of head and nut move with the first and the last face
        grip = sum(member.thickness for member in members)
        ends = fem.fastener_masses(bolt, grip)
        before = sum(member.thickness for member in members[: interface + 1])
        fasteners = []
        if interface == 0:
            at = place.centre - (before + ends[0].height) * place.axis
            fasteners.append((first, ends[0], at))
        if interface == len(along) - 1:
            at = place.centre + (grip - before + ends[1].height) * place.axis
            fasteners.append((last, ends[1], at))
        placed[i] = BoltedPlace(
            i, place.joint, "|".join(place.bodies), (place.faces[0], place.faces[1]), place.centre,
            table.bolt_name, preload, deviation, bolt.proof_load, stiffness, springs, spread,
            tuple(fasteners),
            place.axis,
            max(diameter for diameter, _ in place.holes),
            in_contact,
            rod,
        )  # fmt: skip
    return placed


class FacesInContact(NamedTuple):
    """A touching pair whose faces are in contact under preload."""

    joint: str  # name of its table
    pair: str  # "left|right", as the touching pair is named
    friction: float
    rms: float  # [m] of the heights of both faces
    flatness: float  # [m] height of their crown
    least_gap: float | None  # [m] between round faces, None of a mesh that is given
    is_round: bool = False  # they touch at a point or along a line


def faces_in_contact(
    scene: Scene, layout: Drawing, jointed: Mapping[str, str]
) -> tuple[FacesInContact, ...]:
    """The touching pairs of joints in contact; `jointed` has the joint's name by the pair's."""
    tables = scene.bushings
    faces = []
    for touch in layout.near.touching:
        table = tables.get(jointed.get(touch.name, ""))
        if table is None or table.model != CONTACT:
            continue
        rounds = layout.round_contacts.get(touch.name, ())
        gaps = [one.distance for one in rounds]
        for contact in () if rounds else touch.contacts:
            # of cylinders in each other where they are closest
            a, b = (
                layout.bodies[body].face(tag)
                for body, tag in zip(touch.bodies, contact.faces, strict=True)
            )
            if a.axis is not None and b.axis is not None:
                off = float(off_axis(b.on_axis, a.on_axis, a.axis))
                gaps.append(max(abs(a.radius - b.radius) - off, 0.0))
        least = min(gaps) if gaps and layout.own is None else None
        faces.append(
            FacesInContact(
                table.name, touch.name, *_surface(table), table.flatness or 0.0, least,
                bool(rounds),
            )
        )  # fmt: skip
    return tuple(faces)


def _surface(table: Bolts) -> tuple[float, float]:
    """Friction, and rms [m] of the heights of both faces."""
    friction = FRICTION if table.friction is None else table.friction
    return friction, table.roughness.of_both if table.roughness else 0.0


def _preload(table: Bolts) -> tuple[float, float]:
    """[N] of the bolt, and its standard deviation."""
    if table.preload is not None:
        return table.tension, 0.0
    relative = TORQUE_DEVIATION if table.torque_deviation is None else table.torque_deviation
    return table.tension, relative * table.tension


def _member(
    scene: Scene, key: str, table: Bolts, place: JointPlace, side: int,
    bodies: Mapping[str, Body], *, end: bool,
) -> fem.Member:  # fmt: skip
    """The body on one side of a place, between head and nut; raises InvalidScene for a bolt that
    does not fit its hole, for a hole that ends inside a body, and for an orthotropic one."""
    body, (hole, length), bolt = place.bodies[side], place.holes[side], table.fastener
    at = f"{np.round(place.centre, 6).tolist()} m"
    if hole < bolt.diameter * (1 - 1e-9):
        raise InvalidScene(
            f"{key}.bolt = {table.bolt_name!r} is {1e3 * bolt.diameter:g} mm thick, its hole in "
            f"{body} at {at} is {1e3 * hole:g} mm wide; take a thinner bolt, or widen the hole."
        )
    if hole >= bolt.bearing:
        raise InvalidScene(
            f"{key}.bolt = {table.bolt_name!r} bears on {1e3 * bolt.bearing:g} mm, its hole in "
            f"{body} at {at} is {1e3 * hole:g} mm wide; take a thicker bolt, or a narrower hole."
        )

    stands = _bearing_face(table, place, side, bodies)[0] is not None
    if length <= SAME or (end and not stands):
        raise InvalidScene(
            f"{key}.bolt = {table.bolt_name!r}: its hole in {body} at {at} has no plane face at "
            "its other end for a head or nut, so that the bolt has no grip; drill it through, or "
            "give the springs in place of the bolt."
        )
    solid = scene.made_of(body)
    if not solid.is_isotropic:
        raise InvalidScene(
            f"{key}.bolt presses {body}, whose material {scene.material_name(body)!r} is "
            "orthotropic; its cones are known of isotropic ones alone; give the springs in place "
            "of the bolt."
        )
    return fem.Member(length, fem.Material(solid.young, solid.poisson, solid.density), hole)


def _bearing_face(
    table: Bolts, place: JointPlace, side: int, bodies: Mapping[str, Body]
) -> tuple[Face | None, NDArray[np.float64], NDArray[np.float64]]:
    """The plane face at the other end of a hole that looks away from the pair, on which head or nut
    stand, None where there is none or the hole is blind; the middle of that end (3,) [m], and the
    direction (3,) away."""
    hole, length = place.holes[side]
    away = place.axis if side else -place.axis
    # the face of the pair itself is no end of the hole, however thin the body
    outer, near = place.centre + length * away, min(CHAMFER * hole, length / 2)
    at_end = [
        face
        for face in bodies[place.bodies[side]].faces
        if face.normal is not None and abs((face.centre - outer) @ away) <= near
    ]
    # the bottom of a blind hole is a small face that looks back
    blind = any(
        f.normal @ away < ALIGNED - 1 and np.linalg.norm(f.centre - outer) < near for f in at_end
    )
    # of several faces in one plane that around the hole
    standing = [face for face in at_end if face.normal @ away > 1 - ALIGNED]
    around = [
        face
        for face in standing
        if np.all(np.abs(outer - np.clip(outer, face.lower, face.upper)) <= hole)
    ]
    return (None if blind or not around else around[0]), outer, away


def _require_no_cone(
    key: str, table: Bolts, place: JointPlace, touching: Sequence[TouchingPair],
    bodies: Mapping[str, Body],
) -> None:  # fmt: skip
    """Raise InvalidScene for springs of a bolt that presses conical faces: a cone in its seat is
    held across the bolt by pressure too, twice as high in frequency as the formulas say."""
    if table.model == CONTACT:
        return
    for touch in touching:
        if set(touch.bodies) != set(place.bodies):
            continue
        pairs = [zip(touch.bodies, contact.faces, strict=True) for contact in touch.contacts]
        if any(bodies[body].face(tag).kind == "cone" for pair in pairs for body, tag in pair):
            raise InvalidScene(
                f"{key}.bolt presses conical faces of {' and '.join(place.bodies)}, whose springs "
                'no formula gives; take model = "contact", or give the springs in place of the '
                "bolt."
            )


def _require_no_rod(
    key: str, place: JointPlace, selection: NamedParts, bodies: Mapping[str, Body]
) -> None:
    """Raise InvalidScene for a rod of [[loads]] along the axis of a bolt."""
    for name, face in selection.faces.items():
        if not name.startswith("rod-"):
            continue
        load = name.removeprefix("rod-")
        centres = []
        for end in (face, selection.faces[f"load-{load}"]):
            of_end = [bodies[end.body].face(tag) for tag in end.tags]
            areas = np.array([f.area for f in of_end])
            centres.append(areas @ np.array([f.centre for f in of_end]) / areas.sum())
        off = off_axis(np.array(centres), place.centre, place.axis)
        if np.all(off < max(diameter for diameter, _ in place.holes) / 2):
            raise InvalidScene(
                f"{key}.bolt and the tension of loads.{load} are two bolts in one hole, at "
                f"{np.round(place.centre, 6).tolist()} m; drop one of them."
            )
