"""A STEP file as second-order tetrahedra, body by body, for a program that ties them itself.

Faces that touch are imprinted on both bodies, and meshed on each as it comes: the meshes do not
match. Elements are as small as `seed` at the rims of the imprints and grow away from them.
"""

from collections.abc import Mapping
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import gmsh
import numpy as np
from numpy.typing import NDArray

from geometry.gmsh_session import session, silent

TETRAHEDRON, TRIANGLE = 11, 9  # gmsh's types of second order
ORDER = [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]  # of Abaqus' C3D10 among gmsh's nodes


class Sizes(NamedTuple):
    """Of elements [m]."""

    inside: Mapping[str, float]  # by body
    rim: float  # at the edges of touching faces
    disc: float  # at the disc's
    growth: float = 0.5  # per distance from there


class Disc(NamedTuple):
    """A round spot to imprint on a plane face of a body."""

    body: str
    centre: NDArray[np.float64]  # (3,) [m]
    normal: NDArray[np.float64]  # (3,)
    radius: float  # [m]


class Tetrahedra(NamedTuple):
    """Bodies that share no node, and their touching faces, each as the triangles of one side."""

    points: NDArray[np.float64]  # (n, 3) [m]
    cells: dict[str, NDArray[np.int64]]  # (m, 10) by body, in the order of Abaqus' C3D10
    touching: dict[tuple[str, str], NDArray[np.int64]]  # (k, 6) on the first body, at the second
    disc: NDArray[np.int64]  # (k, 6)


def step_tetrahedra(step: Path, sizes: Sizes, disc: Disc) -> Tetrahedra:
    """The solids that `sizes` names; all others only leave their imprint on them.

    Raises ValueError where gmsh cannot read or mesh the file.
    """
    with session(f"gmsh could not mesh {step}"):
        bodies = _solids(step)
        tools = {pair: _common(bodies, *pair) for pair in combinations(bodies, 2)}
        faces: dict[tuple[str, str], list[int]] = {}
        for body in sizes.inside:
            beside = {o: tools[p] for p in tools if body in p for o in p if o != body}
            round_one = {"": _drawn(disc)} if body == disc.body else {}
            bodies[body], imprints = _imprinted(bodies[body], beside | round_one)
            faces |= {(body, other): found for other, found in imprints.items() if found}
        gmsh.model.occ.remove([(3, bodies[b]) for b in bodies if b not in sizes.inside], True)
        gmsh.model.occ.synchronize()
        _sized(bodies, sizes, faces)
        return _meshed({body: bodies[body] for body in sizes.inside}, faces)


def _solids(step: Path) -> dict[str, int]:
    with silent():
        read = gmsh.model.occ.importShapes(str(step))
    gmsh.model.occ.synchronize()
    return {gmsh.model.getEntityName(*solid).split("/")[-1]: solid[1] for solid in read}


def _common(bodies: Mapping[str, int], one: str, other: str) -> list[tuple[int, int]]:
    """Faces that lie on both; of copies, since gmsh does not tell of a face that was there."""
    ours, theirs = (gmsh.model.getBoundary([(3, bodies[b])], oriented=False) for b in (one, other))
    pairs = (map(gmsh.model.occ.copy, ([a], [b])) for a in ours for b in theirs)
    return [tag for a, b in pairs for tag in gmsh.model.occ.intersect(a, b)[0] if tag[0] == 2]


def _drawn(disc: Disc) -> list[tuple[int, int]]:
    r = disc.radius
    return [(2, gmsh.model.occ.addDisk(*disc.centre, r, r, zAxis=list(disc.normal)))]


def _imprinted(
    solid: int, tools: Mapping[str, list[tuple[int, int]]]
) -> tuple[int, dict[str, list[int]]]:
    """The solid with its faces cut along those of the tools, and the pieces on each."""
    copies = {name: gmsh.model.occ.copy(faces) for name, faces in tools.items() if faces}
    flat = [face for faces in copies.values() for face in faces]
    if not flat:
        return solid, {}
    _, became = gmsh.model.occ.fragment([(3, solid)], flat)
    pieces = iter(became[1:])
    lying = {
        name: [tag for _ in faces for _, tag in next(pieces)] for name, faces in copies.items()
    }
    return became[0][0][1], lying


def _sized(
    bodies: Mapping[str, int], sizes: Sizes, faces: Mapping[tuple[str, str], list[int]]
) -> None:
    """The least of each body's own size and of what grows from the rims."""
    parts = []
    for (_, other), found in faces.items():
        from_rim = _field("Distance", CurvesList=_rims(found), Sampling=200)
        least = sizes.rim if other else sizes.disc
        parts.append(_field("MathEval", F=f"{least} + {sizes.growth} * F{from_rim}"))
    for body, size in sizes.inside.items():
        parts.append(_field("Constant", VolumesList=[bodies[body]], VIn=size, VOut=1e22))
    gmsh.model.mesh.field.setAsBackgroundMesh(_field("Min", FieldsList=parts))
    for name in ("ExtendFromBoundary", "FromPoints"):
        gmsh.option.setNumber(f"Mesh.MeshSize{name}", 0)


def _rims(faces: list[int]) -> list[int]:
    edges = gmsh.model.getBoundary([(2, face) for face in faces], combined=False, oriented=False)
    return sorted({tag for _, tag in edges})


def _field(kind: str, **options) -> int:
    field = gmsh.model.mesh.field
    tag = field.add(kind)
    for name, value in options.items():
        write = {str: field.setString, list: field.setNumbers}.get(type(value), field.setNumber)
        write(tag, name, value)
    return tag


def _meshed(bodies: Mapping[str, int], faces: Mapping[tuple[str, str], list[int]]) -> Tetrahedra:
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.setOrder(2)
    tags, points, _ = gmsh.model.mesh.getNodes()
    number = np.zeros(int(tags.max()) + 1, np.int64)
    number[tags.astype(np.int64)] = np.arange(len(tags))

    def elements(kind: int, entity: int, n: int) -> NDArray[np.int64]:
        return number[gmsh.model.mesh.getElementsByType(kind, entity)[1].astype(int)].reshape(-1, n)

    cells = {name: elements(TETRAHEDRON, tag, 10)[:, ORDER] for name, tag in bodies.items()}
    lying = {
        pair: np.concatenate([elements(TRIANGLE, tag, 6) for tag in found])
        for pair, found in faces.items()
    }
    disc = next(found for (_, other), found in lying.items() if not other)
    touching = {pair: found for pair, found in lying.items() if pair[1]}
    return Tetrahedra(points.reshape(-1, 3), cells, touching, disc)
