"""Lines drawn on a body's faces before it is meshed: outlines of partners, washers, shares.

A surface that lies on the body splits the faces under it, so that elements end on its rim. Which
faces of the split body a face or an imprint became is what OpenCASCADE's general fuse tells.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from math import pi
from typing import NamedTuple

import gmsh
import numpy as np

from geometry.assembly import InvalidGeometry
from geometry.gmsh_session import boolean_tolerance
from geometry.holes import Concentric
from geometry.selectors import Selected
from geometry.solids import SAME, Body, Face, Vector
from geometry.touching import Touch

SLIVER = 1 / 6  # of r step^2: twice what a rim is moved out by for its area
CHORD = 1 / 32  # of r step^2: cuts off half an element, 2 sqrt(2 r d) = r step / 2
MERGED = 4  # times the gap: an intersection makes edges closer than twice the gap one
MOST = 1 / 4  # of a radius, however large the gap


class Disc(NamedTuple):
    """A round patch on faces of a body: under a washer, around a strike."""

    on: Selected
    centre: Vector  # (3,) [m]
    normal: Vector  # of the disc, as of the faces or against it
    radius: float  # m


class Share(NamedTuple):
    """The part of a common face that is nearer to one bolt than to the others of it."""

    on: Selected
    regions: tuple[int, ...]  # the common face in the CAD model
    centre: Vector  # (3,) of the bolt [m]
    others: Sequence[Vector]


class Band(NamedTuple):
    """The part of a cylinder's faces between two planes across its axis: of a thread."""

    on: Selected
    centre: Vector  # (3,) half-way between the planes [m]
    axis: Vector
    length: float  # m


Patch = Disc | Share | Band


def share_of(
    place: Concentric, places: Sequence[Concentric], pairs: Sequence[Touch]
) -> Callable[[Selected], Share]:
    """Makes a bolt's share of a face: nearer to it than to the others of the touching pairs."""
    others = [p.centre for p in places if p.faces == place.faces and p is not place]
    regions = next(c.regions for t in pairs for c in t.contacts if c.faces == place.faces)
    return lambda on: Share(on, regions, place.centre, others)


class Imprinted(NamedTuple):
    """A body with its faces split: the new volume, and what each name became."""

    tag: int
    faces: dict[str, tuple[int, ...]]


class Region(NamedTuple):
    """A surface in the CAD model that lies on a face of a body."""

    tag: int
    on: int  # tag of the face
    sharp: bool = False  # bodies that are tied end on it: stresses are singular along its rim


def fitted(body: Body, patches: Mapping[str, Patch], gap: float, around: float) -> dict[str, Patch]:
    """The body's patches, discs with radii at which their rims of `around` edges can be meshed.

    A rim that would leave a sliver beside an edge of its face, or beside a disc before it, or cut
    off less of one than an element, ends on it: `geometry.roundness.rimmed` restores the area.
    """
    drawn: dict[str, Patch] = {}
    for name, patch in patches.items():
        if patch.on.body != body.name:
            continue
        if isinstance(patch, Disc):
            before = [d for d in drawn.values() if isinstance(d, Disc) and d.on == patch.on]
            apart = [float(np.linalg.norm(patch.centre - d.centre)) - d.radius for d in before]
            ends = np.array([*_radii_to_edges(patch), *apart])
            r, step = patch.radius, 2 * pi / around
            inside, outside = (
                min(max(part * r * step**2, MERGED * gap), MOST * r) for part in (SLIVER, CHORD)
            )
            near = ends[(ends > r - outside) & (ends < r + inside)]
            if len(near):
                r = near[np.argmin(abs(near - r))]
                merged = ends[abs(ends - r) < MERGED * gap]
                apart = np.ptp(merged) > SAME  # then the rim would bend one edge to the other
                patch = patch._replace(radius=float(merged.min() - MERGED * gap if apart else r))
        drawn[name] = patch
    return drawn


def _radii_to_edges(disc: Disc) -> Iterator[float]:
    """Radii [m] at which a circle touches an edge of its faces, or passes through a corner."""
    occ, faces = gmsh.model.occ, [(2, tag) for tag in disc.on.tags]
    centre = occ.addPoint(*disc.centre)
    for _, curve in gmsh.model.getBoundary(faces, oriented=False):
        first, last = gmsh.model.getParametrizationBounds(1, curve)
        points = gmsh.model.getValue(1, curve, np.linspace(*first, *last, 201)).reshape(-1, 3)
        away = np.linalg.norm(points - disc.centre, axis=1)
        if np.ptp(away) > SAME:  # else the rim of a hole in the middle of the disc
            yield occ.getDistance(0, centre, 1, curve)[0]
            if np.linalg.norm(points[0] - points[-1]) > SAME:
                yield from away[[0, -1]]
            if gmsh.model.getType(1, curve) == "Circle":  # a hole that lies in the disc
                yield away.max()
    occ.remove([(0, centre)])


def regions(
    body: Body, touching: Sequence[Touch], patches: Mapping[str, Patch], gap: float
) -> dict[str, list[Region]]:
    """What to imprint on a body, by name: where it touches others "a|b", and its patches.

    Raises ValueError for a patch that falls beside its faces.
    """
    found = {t.name: list(_touched(body, t)) for t in touching if body.name in t.bodies}
    for name, patch in patches.items():
        if patch.on.body == body.name:
            match patch:
                case Share():
                    parts = _nearest(body, patch)
                case Band():
                    parts = _between(body, patch)
                case Disc():
                    parts = _on_faces(patch, gap)
            found[name] = list(parts)
            _require_some(name, patch, found[name])
    gmsh.model.occ.synchronize()
    return found


def imprinted(
    body: Body, wanted: Mapping[str, Sequence[Region]], named: Mapping[str, Selected], gap: float
) -> Imprinted:
    """The body with regions imprinted, and `named` faces followed; the regions are used up.

    Raises ValueError when an imprint would cut the body.
    """
    picked = {name: s.tags for name, s in named.items() if s.body == body.name}
    tags = {name: [region.tag for region in parts] for name, parts in wanted.items()}
    tag, old, new = _split(body, [tag for parts in tags.values() for tag in parts], gap)
    found = {name: flat(old[tag] for tag in parts) for name, parts in picked.items()}
    return Imprinted(tag, found | {n: flat(new[tag] for tag in parts) for n, parts in tags.items()})


def flat(lists: Iterable[Sequence[int]]) -> tuple[int, ...]:
    """All of several lists, each once."""
    return tuple(dict.fromkeys(tag for tags in lists for tag in tags))


def _touched(body: Body, touch: Touch) -> Iterator[Region]:
    """The common regions, those of planes moved onto the body's own face across the gap."""
    side = touch.bodies.index(body.name)
    for contact in touch.contacts:
        face = body.face(contact.faces[side])
        for tag in _copied(contact.regions, face):
            yield Region(tag, face.tag, sharp=not contact.flush)


def _copied(regions: Sequence[int], face: Face) -> Iterator[int]:
    occ = gmsh.model.occ
    for _, tag in occ.copy([(2, tag) for tag in regions]):
        if face.normal is not None:
            off = (face.centre - occ.getCenterOfMass(2, tag)) @ face.normal
            occ.translate([(2, tag)], *(off * face.normal))
        yield tag


def _nearest(body: Body, share: Share) -> Iterator[Region]:
    """The common face on this side of the lines half-way to the other bolts."""
    face = body.face(share.on.tags[0])
    parts = [(2, tag) for tag in _copied(share.regions, face)]
    for other in share.others:
        if parts:
            half = _half_plane(face, share.centre, other, reach=4 * body.extent)
            parts, _ = gmsh.model.occ.intersect(parts, [(2, half)])
    return (Region(tag, face.tag) for dimension, tag in parts if dimension == 2)


def _half_plane(face: Face, centre: Vector, other: Vector, reach: float) -> int:
    """A rectangle in the plane of a face, from half-way between two points on to the first."""
    occ = gmsh.model.occ
    away = (other - centre) / np.linalg.norm(other - centre)
    along, middle = reach * np.cross(face.normal, away), (centre + other) / 2
    middle = middle + ((face.centre - middle) @ face.normal) * face.normal
    ends = middle + along, middle - along
    corners = [occ.addPoint(*p) for p in (*ends, ends[1] - reach * away, ends[0] - reach * away)]
    lines = [occ.addLine(*pair) for pair in zip(corners, corners[1:] + corners[:1], strict=True)]
    return occ.addPlaneSurface([occ.addCurveLoop(lines)])


def _on_faces(disc: Disc, gap: float) -> Iterator[Region]:
    """The parts of a disc that lie on the faces it is meant for."""
    occ = gmsh.model.occ
    for face in disc.on.tags:
        drawn = occ.addDisk(*disc.centre, disc.radius, disc.radius, zAxis=list(disc.normal))
        with boolean_tolerance(2 * gap):
            common, _ = occ.intersect([(2, drawn)], occ.copy([(2, face)]))
        yield from (Region(tag, face) for dimension, tag in common if dimension == 2)


def _between(body: Body, band: Band) -> Iterator[Region]:
    """The parts of a band's faces."""
    occ = gmsh.model.occ
    for tag in band.on.tags:
        reach = 4 * body.face(tag).radius
        foot, along = band.centre - band.length / 2 * band.axis, band.length * band.axis
        slab = occ.addCylinder(*foot, *along, reach)
        common, _ = occ.intersect(occ.copy([(2, tag)]), [(3, slab)])
        yield from (Region(part, tag) for dimension, part in common if dimension == 2)


def _require_some(name: str, patch: Patch, parts: list[Region]) -> None:
    if not parts:
        words = {
            Disc: f"disc of radius {getattr(patch, 'radius', 0.0):.6g} m",
            Share: "bolt's share",
            Band: "thread",
        }
        raise InvalidGeometry(
            f'"{name}": a {words[type(patch)]} at {np.round(patch.centre, 6).tolist()} m does not '
            f"lie on the faces of {patch.on.body} it belongs to; move the point."
        )


def _split(body: Body, tools: list[int], gap: float):
    """The new volume, and for every old face and tool the new faces."""
    tags = [face.tag for face in body.faces]
    if not tools:
        return body.tag, {tag: [tag] for tag in tags}, {}
    with boolean_tolerance(2 * gap):
        out, became = gmsh.model.occ.fragment([(3, body.tag)], [(2, tag) for tag in tags + tools])
    gmsh.model.occ.synchronize()
    volumes = sorted({tag for dimension, tag in out if dimension == 3})
    if len(volumes) != 1:
        raise ValueError(f"imprints would cut {body.name} into {len(volumes)} pieces.")
    parts = ([tag for dimension, tag in new if dimension == 2] for new in became[1:])
    split = dict(zip(tags + tools, parts, strict=True))
    old = _with_unsplit(body, {tag: split[tag] for tag in tags}, volumes[0])
    return volumes[0], old, {tag: split[tag] for tag in tools}


def _with_unsplit(body: Body, split: dict[int, list[int]], volume: int) -> dict[int, list[int]]:
    """gmsh gives faces that stayed whole new tags and forgets them: found by area and centre."""
    occ = gmsh.model.occ
    known = {tag for tags in split.values() for tag in tags}
    boundary = gmsh.model.getBoundary([(3, volume)], oriented=False)
    rest = [tag for _, tag in boundary if tag not in known]
    centres = np.array([occ.getCenterOfMass(2, tag) for tag in rest]).reshape(-1, 3)
    areas = np.array([occ.getMass(2, tag) for tag in rest])
    for face in body.faces:
        if not split[face.tag]:
            off = np.linalg.norm(centres - face.centre, axis=1)
            off += abs(areas - face.area) / np.sqrt(face.area)
            split[face.tag] = [rest[int(np.argmin(off))]]
    return split
