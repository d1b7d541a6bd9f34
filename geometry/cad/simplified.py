"""A body without its features below a size: holes, roundings and small faces, which its mesh would
resolve for nothing.

Each feature is removed by itself first (OpenCASCADE's defeaturing extends the faces around it), and
the volume between the body with and without it is what the mesh leaves out there; features that
cannot be removed stay.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence

import gmsh
import numpy as np
from numpy.typing import NDArray

from beadwave.geometry.cad.holes import bores
from beadwave.geometry.cad.occ import body_of, face_of
from beadwave.geometry.cad.removals import Removal, Zone
from beadwave.geometry.cad.solids import Body, Face
from beadwave.geometry.meshing.gmsh_session import silent
from beadwave.geometry.meshing.sizes import curvatures

# energy of what is left out over that of its volume in the body without it: a round hole in a
# plate under tension takes 3 times that of its area, under shear 4 / (1 + nu) times (Timoshenko and
# Goodier, Theory of Elasticity, sec. 35)
FACTOR = 3.0
SAME_SIZE = 1e-6  # of a size: what the CAD measures is off by rounding
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
            (tags, largest)
            for tags, largest in features_below(body, size)
            if not set(tags) & set(kept) and not any(_reaches(body, tags, zone) for zone in nearby)
        ]
        of_body = [
            (tags, removal)
            for tags, largest in features
            if (removal := _removal(body, tags, largest)) is not None
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


def features_below(body: Body, size: float) -> list[tuple[tuple[int, ...], float]]:
    """Faces (tags) of each feature of a body that is smaller than a size [m], and its own size:
    holes and pins by their diameter, roundings by their radius, other faces by their diagonal.
    Faces that share an edge are of one feature, as is what they enclose."""
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
    small = {tag for tag, of_face in sizes.items() if of_face < size * (1 - SAME_SIZE)}

    # groups of faces that share an edge, and the faces that such a group bounds alone
    edges = {face.tag: set(gmsh.model.getAdjacencies(2, face.tag)[1]) for face in body.faces}
    features = []
    while small:
        group, border = set(), {min(small)}
        while border:
            group |= border
            small -= border
            around = set().union(*(edges[tag] for tag in border))
            border = {tag for tag in small if edges[tag] & around}
        # the bottom of a blind hole has no edge but that of the wall
        of_group = set().union(*(edges[tag] for tag in group))
        ends = {tag for tag, of_face in edges.items() if tag not in group and of_face <= of_group}
        if len(group | ends) < len(edges):
            features.append((tuple(sorted(group | ends)), max(sizes[tag] for tag in group)))
    return features


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


def _removal(body: Body, tags: Sequence[int], size: float) -> Removal | None:
    """The feature of these faces, removed by itself; None where it cannot be."""
    occ = gmsh.model.occ
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
    points = np.concatenate([_points_of(t) for t in tags])
    return Removal(body.name, places, size, volume, FACTOR, points)


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
