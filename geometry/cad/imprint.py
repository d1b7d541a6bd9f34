"""A body's faces split along lines before it is meshed, so that elements end on these lines.

Imprinted are the outlines of bodies that touch it, washers, patches that are struck, and the shares
of a common face that belong to its bolts. A surface that lies on the body splits the faces under
it; OpenCASCADE's general fuse returns which faces of the split body each face or imprint became.

    fitted        patches whose rims leave no sliver, which could not be meshed
    regions       surfaces to imprint
    imprinted     the body with its faces split along them
"""

from collections.abc import Iterable, Mapping, Sequence
from math import pi
from typing import NamedTuple

import gmsh
import numpy as np

from beadwave.geometry.cad.contacts import TouchingPair
from beadwave.geometry.cad.patches import CurvedDisc, Disc, Patch, Share, Spots, ThreadBand
from beadwave.geometry.cad.selectors import FaceSelection
from beadwave.geometry.cad.solids import SAME, Body, Face, Vector
from beadwave.geometry.errors import InvalidGeometry
from beadwave.geometry.meshing.gmsh_session import boolean_tolerance

# How near to an edge of its face, or to another rim, the rim of a disc may come.
#
# r is the radius of the disc, step = 2 pi / n the angle of one of the n edges around it. Nearer
# than these distances, the rim is drawn through the edge instead. Chosen by the reasons given, not
# varied.
# from the rim to an edge beyond it, over r step^2: corners of a polygon of the circle's area
# lie r step^2 / 12 outside the circle (`geometry.meshing.roundness`); twice that leaves an element
SLIVER = 1 / 6
# by which the disc reaches over an edge, over r step^2: at d = r step^2 / 32 the edge cuts it
# along a chord of 2 sqrt(2 r d) = r step / 2, half an element
CHORD = 1 / 32
# either way, over the gap that counts as touching: an intersection with a tolerance of twice
# the gap merges edges that are closer than that
MERGED = 4
MAX_ROOM = 1 / 4  # either way, over r: limits what a large gap would ask for


class ImprintedBody(NamedTuple):
    """A body with its faces split."""

    tag: int  # of the new volume in the CAD model
    faces: dict[str, tuple[int, ...]]  # tags of the faces that each name consists of now


class Region(NamedTuple):
    """A surface in the CAD model that lies on a face of a body."""

    tag: int
    on: int  # tag of the face
    sharp: bool = False  # a tied body ends on this face: stresses are singular along the rim


def fitted(body: Body, patches: Mapping[str, Patch], gap: float, around: float) -> dict[str, Patch]:
    """The body's patches by name; discs with radii at which rims of `around` edges can be meshed.

    A rim that would leave a sliver at an edge of its face or at an earlier disc, or reach
    over that edge by less than an element, is drawn through it; `geometry.meshing.roundness.rimmed`
    restores the area. `gap` [m] is the distance up to which bodies count as touching.
    """
    occ = gmsh.model.occ
    fitting: dict[str, Patch] = {}
    for name, patch in patches.items():
        if patch.on.body != body.name:
            continue
        if not isinstance(patch, Disc):
            fitting[name] = patch
            continue

        # critical radii, at which the topology of the imprint changes: the circle touches an edge
        # of its faces, passes through a corner, encloses a hole that lies in it, or touches a disc
        # that was fitted earlier
        radii: list[float] = []
        centre = occ.addPoint(*patch.centre)
        faces = [(2, tag) for tag in patch.on.tags]
        for _, curve in gmsh.model.getBoundary(faces, oriented=False):
            start, end = gmsh.model.getParametrizationBounds(1, curve)
            points = gmsh.model.getValue(1, curve, np.linspace(*start, *end, 201)).reshape(-1, 3)
            distance = np.linalg.norm(points - patch.centre, axis=1)
            if np.ptp(distance) > SAME:  # else the rim of a hole in the middle of the disc
                radii.append(occ.getDistance(0, centre, 1, curve)[0])
                if np.linalg.norm(points[0] - points[-1]) > SAME:
                    radii += distance[[0, -1]].tolist()
                if gmsh.model.getType(1, curve) == "Circle":
                    radii.append(float(distance.max()))
        occ.remove([(0, centre)])
        discs = [d for d in fitting.values() if isinstance(d, Disc) and d.on == patch.on]
        radii += [float(np.linalg.norm(patch.centre - d.centre)) - d.radius for d in discs]

        # the nearest critical radius replaces the radius where it is too near
        ends, r, step = np.array(radii), patch.radius, 2 * pi / around
        inside, outside = (
            min(max(share * r * step**2, MERGED * gap), MAX_ROOM * r) for share in (SLIVER, CHORD)
        )
        too_near = ends[(ends > r - outside) & (ends < r + inside)]
        if len(too_near):
            r = too_near[np.argmin(abs(too_near - r))]
            merged = ends[abs(ends - r) < MERGED * gap]
            if np.ptp(merged) > SAME:  # several edges: the intersection would merge them all
                r = merged.min() - MERGED * gap
            patch = patch._replace(radius=float(r))
        fitting[name] = patch
    return fitting


def regions(
    body: Body, touching: Sequence[TouchingPair], patches: Mapping[str, Patch], gap: float
) -> dict[str, list[Region]]:
    """Surfaces to imprint on a body, by name: "a|b" where it touches another one, and its patches.

    They are new surfaces in the CAD model. Raises InvalidGeometry for a patch that does not lie on
    its faces.
    """
    occ = gmsh.model.occ

    def copied(surfaces: Sequence[int], face: Face) -> list[tuple[int, int]]:
        """Copies of common surfaces, those of a plane moved onto the body's own across the gap."""
        copies = occ.copy([(2, tag) for tag in surfaces])
        for _, tag in copies if face.normal is not None else ():
            off = (face.centre - occ.getCenterOfMass(2, tag)) @ face.normal
            occ.translate([(2, tag)], *(off * face.normal))
        return copies

    # where other bodies touch: the common surfaces of each pair of faces
    imprints: dict[str, list[Region]] = {}
    for touch in touching:
        over_area = any(contact.regions for contact in touch.contacts)
        if body.name not in touch.bodies or not over_area:
            continue
        side = touch.bodies.index(body.name)
        imprints[touch.name] = [
            Region(tag, face.tag, sharp=not contact.flush)
            for contact in touch.contacts
            for face in [body.face(contact.faces[side])]
            for _, tag in copied(contact.regions, face)
        ]

    # patches: the parts of a share, a band or a disc that lie on the faces
    for name, patch in patches.items():
        if patch.on.body != body.name:
            continue
        lying: list[Region] = []
        match patch:
            case Share():
                # the common face on this side of the lines half-way to the other bolts
                what = "bolt's share"
                face = body.face(patch.on.tags[0])
                surfaces = copied(patch.regions, face)
                for other_bolt in patch.others:
                    if surfaces:
                        half_plane = _half_plane(
                            face, patch.centre, other_bolt, reach=4 * body.extent
                        )
                        surfaces, _ = occ.intersect(surfaces, [(2, half_plane)])
                lying = [Region(tag, face.tag) for dimension, tag in surfaces if dimension == 2]
            case ThreadBand():
                # the cylinder's faces inside a slab across its axis, wide enough to hold them
                what = "thread"
                foot = patch.centre - patch.length / 2 * patch.axis
                for face_tag in patch.on.tags:
                    slab = occ.addCylinder(
                        *foot, *(patch.length * patch.axis), 4 * body.face(face_tag).radius
                    )
                    common, _ = occ.intersect(occ.copy([(2, face_tag)]), [(3, slab)])
                    lying += [Region(tag, face_tag) for dimension, tag in common if dimension == 2]
            case Spots():
                # all discs or rectangles, each where it lies on one of the faces; an intersection
                # consumes its tools, so that it is given copies
                what = "pad"
                spots = []
                for centre in patch.centres:
                    if patch.radius is not None:
                        radii = patch.radius, patch.radius
                        spots.append(occ.addDisk(*centre, *radii, zAxis=list(patch.normal)))
                        continue
                    u, v = patch.axes * np.reshape(patch.sides, (2, 1)) / 2
                    corners = centre - u - v, centre + u - v, centre + u + v, centre - u + v
                    spots.append(_polygon(corners))
                for face_tag in patch.on.tags:
                    for spot in spots:
                        with boolean_tolerance(2 * gap):
                            common, _ = occ.intersect(
                                occ.copy([(2, spot)]), occ.copy([(2, face_tag)])
                            )
                        lying += [Region(t, face_tag) for dimension, t in common if dimension == 2]
            case CurvedDisc():
                # the faces inside a cylinder about the axis, as long as it is wide
                what = f"disc of radius {patch.radius:.6g} m"
                foot = patch.centre - patch.radius * patch.normal
                for face_tag in patch.on.tags:
                    rod = occ.addCylinder(*foot, *(2 * patch.radius * patch.normal), patch.radius)
                    common, _ = occ.intersect(occ.copy([(2, face_tag)]), [(3, rod)])
                    lying += [Region(tag, face_tag) for dimension, tag in common if dimension == 2]
            case Disc():
                # its parts on all faces of the plane: an edge may run under a washer
                what = f"disc of radius {patch.radius:.6g} m"
                for face_tag in patch.on.tags:
                    radii = patch.radius, patch.radius
                    disc = occ.addDisk(*patch.centre, *radii, zAxis=list(patch.normal))
                    with boolean_tolerance(2 * gap):
                        common, _ = occ.intersect([(2, disc)], occ.copy([(2, face_tag)]))
                    lying += [Region(tag, face_tag) for dimension, tag in common if dimension == 2]
        if not lying:
            place = patch.centres[0] if isinstance(patch, Spots) else patch.centre
            raise InvalidGeometry(
                f'"{name}": a {what} at {np.round(place, 6).tolist()} m does not lie on the '
                f"faces of {patch.on.body} it belongs to; move the point."
            )
        imprints[name] = lying
    occ.synchronize()
    return imprints


def _half_plane(face: Face, centre: Vector, partner: Vector, reach: float) -> int:
    """Tag of a rectangle in the plane of a face, on the side of `centre` of the line half-way to
    `partner` (3,) [m]: `reach` [m] wide and twice as long."""
    away = (partner - centre) / np.linalg.norm(partner - centre)
    along, middle = reach * np.cross(face.normal, away), (centre + partner) / 2
    middle = middle + ((face.centre - middle) @ face.normal) * face.normal
    ends = middle + along, middle - along
    return _polygon((*ends, ends[1] - reach * away, ends[0] - reach * away))


def _polygon(corners: Sequence[Vector]) -> int:
    """Tag of a plane surface with these corners (3,) [m]."""
    occ = gmsh.model.occ
    points = [occ.addPoint(*corner) for corner in corners]
    lines = [occ.addLine(*pair) for pair in zip(points, points[1:] + points[:1], strict=True)]
    return occ.addPlaneSurface([occ.addCurveLoop(lines)])


def imprinted(
    body: Body,
    wanted: Mapping[str, Sequence[Region]],
    named: Mapping[str, FaceSelection],
    gap: float,
) -> ImprintedBody:
    """The body with the regions `wanted` imprinted, and the faces of both `named` and imprints.

    The surfaces of the regions are consumed. Raises ValueError when an imprint would cut the body
    in pieces.
    """
    occ = gmsh.model.occ
    volume, old = body.tag, {face.tag: [face.tag] for face in body.faces}
    tools = [region.tag for imprint in wanted.values() for region in imprint]
    new: dict[int, list[int]] = {}
    if tools:
        # the general fuse of body, faces and imprints; `became` lists what each of them turned into
        with boolean_tolerance(2 * gap):
            pieces, became = occ.fragment([(3, body.tag)], [(2, tag) for tag in [*old, *tools]])
        occ.synchronize()
        volumes = sorted({tag for dimension, tag in pieces if dimension == 3})
        if len(volumes) != 1:
            raise ValueError(f"imprints would cut {body.name} into {len(volumes)} pieces.")
        (volume,) = volumes
        surfaces = (
            [tag for dimension, tag in entities if dimension == 2] for entities in became[1:]
        )
        split = dict(zip([*old, *tools], surfaces, strict=True))
        old, new = {tag: split[tag] for tag in old}, {tag: split[tag] for tag in tools}

        # faces that nothing split get new tags too, which gmsh does not return: they are the faces
        # left over, assigned by centre and area
        followed = {tag for tags in old.values() for tag in tags}
        boundary = gmsh.model.getBoundary([(3, volume)], oriented=False)
        forgotten = [tag for _, tag in boundary if tag not in followed]
        centres = np.array([occ.getCenterOfMass(2, tag) for tag in forgotten]).reshape(-1, 3)
        areas = np.array([occ.getMass(2, tag) for tag in forgotten])
        for face in (face for face in body.faces if not old[face.tag]):
            mismatch = np.linalg.norm(centres - face.centre, axis=1)
            mismatch += abs(areas - face.area) / np.sqrt(face.area)
            old[face.tag] = [forgotten[int(np.argmin(mismatch))]]

    faces = {
        name: flat(old[tag] for tag in selected.tags)
        for name, selected in named.items()
        if selected.body == body.name
    }
    for name, imprint in wanted.items():
        faces[name] = flat(new[region.tag] for region in imprint)
    return ImprintedBody(volume, faces)


def flat(lists: Iterable[Sequence[int]]) -> tuple[int, ...]:
    """The tags of several lists in their order, without repetition."""
    return tuple(dict.fromkeys(tag for tags in lists for tag in tags))
