"""A body without its features below a size: holes, roundings, chamfers, slots and small faces,
which its mesh would resolve for nothing.

Each feature is removed by itself first (OpenCASCADE's defeaturing extends the faces around it), and
the volume between the body with and without it is what the mesh leaves out there; features that
cannot be removed stay.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import combinations
from typing import NamedTuple

import gmsh
import numpy as np
from numpy.typing import NDArray

from beadwave.geometry.cad.holes import bores
from beadwave.geometry.cad.occ import body_of, face_of
from beadwave.geometry.cad.removals import Removal, Zone
from beadwave.geometry.cad.solids import ALIGNED, Body, Face
from beadwave.geometry.meshing.gmsh_session import silent
from beadwave.geometry.meshing.sizes import curvatures

# energy of what is left out over that of its volume in the body without it: a round hole in a
# plate under tension takes 3 times that of its area, under shear 4 / (1 + nu) times (Timoshenko and
# Goodier, Theory of Elasticity, sec. 35)
FACTOR = 3.0  # of an ellipse 1 + 2 a / b across its long axis a (Inglis), also of slots
SAME_SIZE = 1e-6  # of a size: what the CAD measures is off by rounding
LONG = 1.5  # of its width: edges of a narrow face along it
# cosines of the angle between the normals of a chamfer and of its neighbours, from 80 to 10 degrees
BLUNT = 0.17, 0.985
# times the length, of a crack that is open at an end: with its mirror image it is twice as long,
# and its energy 1.12^2 times as large (Tada, Paris and Irwin, Stress Analysis of Cracks Handbook)
AT_EDGE = 2 * 1.12**2
N_PLACES = 5  # along each parameter of a face, at which what is left out is evaluated


def simplified(
    bodies: Mapping[str, Body], size: float, kept: Collection[int], zones: Sequence[Zone]
) -> tuple[dict[str, Body], tuple[Removal, ...]]:
    """The bodies without features below a size [m], and what is removed; faces `kept` (tags) stay,
    and all in `zones`. To be called inside the bodies' ``with model(...)``."""
    new, removals = {}, []
    for name, body in bodies.items():
        nearby = [zone for zone in zones if zone.body == name]
        features = [
            feature
            for feature in features_below(body, size)
            if not set(feature.tags) & set(kept)
            and not any(_reaches(body, feature.tags, zone) for zone in nearby)
        ]
        of_body = [
            (feature.tags, removal)
            for feature in features
            if (removal := _removal(body, feature)) is not None
        ]
        new[name] = body
        if (
            of_body
            and (tag := _without(body, [t for tags, _ in of_body for t in tags])) is not None
        ):
            gmsh.model.occ.remove([(3, body.tag)])
            gmsh.model.occ.synchronize()
            _name_faces(body, tag)
            new[name] = body_of(name, tag)
            removals += [removal for _, removal in of_body]
    return new, tuple(removals)


class Feature(NamedTuple):
    """Faces of a body that are removed together."""

    tags: tuple[int, ...]
    size: float  # m
    factor: float = FACTOR  # of the strain energy of its volume
    mouth: tuple[int, ...] = ()  # edges (tags) of a slot that is open at a side


def features_below(body: Body, size: float) -> list[Feature]:
    """The features of a body that are smaller than a size [m]: holes and pins by their diameter,
    roundings by their radius, slots by the distance of their walls and, if open at a side, by their
    depth, chamfers by their width, other faces by their diagonal.

    Faces that share an edge are of one feature, as is what they enclose.
    """
    sizes = {}
    for hollow in (True, False):
        for bore in bores(body, hollow=hollow):
            sizes |= dict.fromkeys(bore.tags, bore.diameter)
    for face in body.faces:
        diagonal = float(np.linalg.norm(face.upper - face.lower))
        usual = diagonal
        if face.kind != "plane" and face.tag not in sizes:
            usual = min(diagonal, 1 / max(curvatures(face.tag).min(), 1e-12))
        sizes[face.tag] = min(sizes.get(face.tag, usual), diagonal)

    # walls of slots face each other across nothing
    gaps = {}
    planes = [face for face in body.faces if face.normal is not None]
    for first, second in combinations(planes, 2):
        gap = float((second.centre - first.centre) @ first.normal)
        if not (0 < gap < size and first.normal @ second.normal < ALIGNED - 1):
            continue
        shift = gap * first.normal
        lower = np.maximum(first.lower, second.lower - shift)
        upper = np.minimum(first.upper, second.upper - shift)
        across = np.abs(first.normal) < 1 - ALIGNED
        if np.all((lower < upper)[across]):
            for wall in (first, second):
                sizes[wall.tag] = gaps[wall.tag] = min(sizes[wall.tag], gap)

    # narrow faces: chamfers, whose long edges are blunt, and bottoms between the walls of slots
    edges = {face.tag: set(gmsh.model.getAdjacencies(2, face.tag)[1]) for face in body.faces}
    narrow = set()
    for face in body.faces:
        lengths = {tag: gmsh.model.occ.getMass(1, tag) for tag in edges[face.tag]}
        width = 2 * face.area / sum(lengths.values())
        narrow |= {face.tag} if width < size else set()
        if face.kind not in ("plane", "cone") or not width < size <= sizes[face.tag]:
            continue
        others = {
            other
            for tag, length in lengths.items()
            for other in gmsh.model.getAdjacencies(1, tag)[0]
            if length > LONG * width and other != face.tag
        }
        of_slot = others <= gaps.keys()
        if others and (of_slot or all(_is_blunt(face.tag, other, edges) for other in others)):
            sizes[face.tag] = width
    small = {tag for tag, of_face in sizes.items() if of_face < size * (1 - SAME_SIZE)}

    # groups of faces that share an edge, and the faces that such a group bounds alone
    features = []
    while small:
        group, border = set(), {min(small)}
        while border:
            group |= border
            small -= border
            around = set().union(*(edges[tag] for tag in border))
            border = {tag for tag in small if edges[tag] & around}
        # the bottom of a blind hole has no edge but that of the wall, as a face has whose edges
        # are all rounded
        of_group = set().union(*(edges[tag] for tag in group))
        ends = {tag for tag in narrow if tag not in group and edges[tag] <= of_group}
        if len(group | ends) < len(edges):
            largest, factor, mouth = max(sizes[tag] for tag in group), FACTOR, ()
            inner = [edge for edge in of_group if sum(edge in edges[tag] for tag in group) > 1]
            for tag in group & gaps.keys():
                length, depth, open_at = _crack(body.face(tag), inner)
                # of an ellipse of these axes, at least that of a circle
                largest, factor = max(largest, depth), max(factor, 1 + 2 * length / gaps[tag])
                mouth += open_at
            if largest < size:
                features.append(Feature(tuple(sorted(group | ends)), largest, factor, mouth))
    return features


def _crack(wall: Face, of_feature: Collection[int]) -> tuple[float, float, tuple[int, ...]]:
    """Length [m] of the crack that a slot is to stresses across this wall of it; its depth [m] from
    the side at which it is open, and the edges (tags) there; 0 and none of one that is closed.

    The length is the shorter side of the wall, where one that is open at an end counts with its
    mirror image, and one that is open at both has no end; `of_feature` are the tags of the
    feature's inner edges.
    """
    points = {}
    for tag in gmsh.model.getAdjacencies(2, wall.tag)[1]:
        (start,), (end,) = gmsh.model.getParametrizationBounds(1, tag)
        at = [start, (start + end) / 2, end]
        points[tag] = np.reshape(gmsh.model.getValue(1, tag, at), (3, 3)) - wall.centre
    chords = [p[2] - p[0] for p in points.values()]
    u = max(chords, key=lambda chord: float(np.linalg.norm(chord)))
    u = u / np.linalg.norm(u)

    lengths, depth, mouth = [], 0.0, ()
    for axis in (u, np.cross(wall.normal, u)):
        reach = float(np.ptp([p @ axis for p in points.values()]))
        open_at = {
            side: [
                tag
                for tag, p in points.items()
                if tag not in of_feature and np.all(side * p @ axis > reach / 4)
            ]
            for side in (1, -1)
        }
        n_open = sum(bool(tags) for tags in open_at.values())
        lengths.append(reach * (1, AT_EDGE, np.inf)[n_open])
        if n_open == 1:
            depth, mouth = reach, tuple(open_at[1] + open_at[-1])
    return min(lengths), depth if np.isfinite(min(lengths)) else np.inf, mouth


def _is_blunt(first: int, second: int, edges: Mapping[int, set[int]]) -> bool:
    """True if two faces meet at an angle that is neither right nor flat, by their normals at the
    middle of the first edge that they share."""
    shared = edges[first] & edges[second]
    edge = min(shared)
    (start,), (end,) = gmsh.model.getParametrizationBounds(1, edge)
    normals = []
    for face in (first, second):
        at = gmsh.model.reparametrizeOnSurface(1, edge, [(start + end) / 2], face)
        normals.append(np.asarray(gmsh.model.getNormal(face, at)))
    cosine = float(normals[0] @ normals[1])
    return BLUNT[0] < cosine < BLUNT[1]


def _reaches(body: Body, tags: Iterable[int], zone: Zone) -> bool:
    """True if the box of any of these faces lies within a zone in part."""
    for face in (body.face(tag) for tag in tags):
        nearest = np.clip(zone.centre, face.lower, face.upper)
        if np.linalg.norm(nearest - zone.centre) <= zone.radius:
            return True
    return False


def _without(body: Body, tags: Sequence[int]) -> int | None:
    """Tag of the solid that a body is without these faces; None where there is none."""
    try:
        with silent():
            found = gmsh.model.occ.defeature([body.tag], list(tags), removeVolume=False)
            gmsh.model.occ.synchronize()
    except Exception:  # gmsh raises bare exceptions, of features that nothing around can close
        return None
    solids = [tag for dimension, tag in found if dimension == 3 and tag != body.tag]
    if len(solids) == 1:
        n_faces = len(gmsh.model.getBoundary([(3, solids[0])], oriented=False))
        if n_faces <= len(body.faces) - len(tags) and gmsh.model.occ.getMass(3, solids[0]) > 0:
            return solids[0]
    gmsh.model.occ.remove([(3, tag) for tag in solids], recursive=True)
    gmsh.model.occ.synchronize()
    return None


def _name_faces(body: Body, tag: int) -> None:
    """Names in the CAD for the faces of a solid: of each the name of the body's face of its kind
    whose box is the nearest to its own, as features may have been cut out of that face."""
    if not any(face.name for face in body.faces):
        return
    for _, face_tag in gmsh.model.getBoundary([(3, tag)], oriented=False):
        new = face_of(face_tag)

        def off(old: Face, new: Face = new) -> float:
            return float(np.abs([old.lower - new.lower, old.upper - new.upper]).sum())

        before = min((face for face in body.faces if face.kind == new.kind), key=off)
        gmsh.model.setEntityName(2, face_tag, before.name)


def _removal(body: Body, feature: Feature) -> Removal | None:
    """The feature removed by itself; None where it cannot be."""
    occ, tags = gmsh.model.occ, feature.tags
    if (tag := _without(body, tags)) is None:
        return None
    filled, taken = (_volume_of_cut(*pair) for pair in ((tag, body.tag), (body.tag, tag)))
    occ.remove([(3, tag)], recursive=True)
    occ.synchronize()
    volume = filled + taken
    if not volume > 0:
        return None
    centres = [body.face(t).centre for t in tags]
    places = tuple(f"{body.name}@{','.join(f'{x:.4g}' for x in c.round(6) + 0.0)}" for c in centres)
    # a slot in the surface of a plate that bends takes the stresses at its mouth
    points = np.concatenate([_points_on(t) for t in feature.mouth] or [_points_of(t) for t in tags])
    return Removal(body.name, places, feature.size, volume, feature.factor, points)


def _volume_of_cut(of: int, without: int) -> float:
    """Volume [m^3] of one solid outside of another one; both stay."""
    occ = gmsh.model.occ
    pieces, _ = occ.cut([(3, of)], [(3, without)], removeObject=False, removeTool=False)
    volume = sum(occ.getMass(*piece) for piece in pieces if piece[0] == 3)
    occ.remove(pieces, recursive=True)
    return float(volume)


def _points_of(tag: int) -> NDArray[np.float64]:
    """Points (n, 3) [m] of a face, its centre among them."""
    lower, upper = gmsh.model.getParametrizationBounds(2, tag)
    at = (np.arange(N_PLACES) + 0.5) / N_PLACES
    u, v = (a + (b - a) * at for a, b in zip(lower, upper, strict=True))
    grid = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    inside = [gmsh.model.isInside(2, tag, pair, parametric=True) > 0 for pair in grid]
    points = np.reshape(gmsh.model.getValue(2, tag, grid[inside].ravel()), (-1, 3))
    return np.concatenate([[gmsh.model.occ.getCenterOfMass(2, tag)], points])


def _points_on(edge: int) -> NDArray[np.float64]:
    """Points (n, 3) [m] of an edge."""
    (start,), (end,) = gmsh.model.getParametrizationBounds(1, edge)
    at = start + (end - start) * (np.arange(N_PLACES) + 0.5) / N_PLACES
    return np.reshape(gmsh.model.getValue(1, edge, at), (-1, 3))
