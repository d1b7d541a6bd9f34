"""A STEP file as second-order tetrahedra, body by body, for a program that ties bodies itself.

Faces that touch are imprinted on both bodies and meshed on each independently, so that the meshes
do not match. Elements are smallest at the rims of the imprints and grow away from them.
"""

from collections.abc import Mapping
from itertools import combinations, product
from pathlib import Path
from typing import NamedTuple

import gmsh
import numpy as np
from numpy.typing import NDArray

from beadwave.geometry.meshing.gmsh_session import session, silent

TETRAHEDRON, TRIANGLE = 11, 9  # gmsh's types of second order
ORDER = [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]  # of Abaqus' C3D10 among gmsh's nodes


class ElementSizes(NamedTuple):
    """Element sizes [m]."""

    inside: Mapping[str, float]  # by body
    rim: float  # at the edges of touching faces
    disc: float  # at the disc's
    growth: float = 0.5  # per distance from there


class StepPatch(NamedTuple):
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
    disc: NDArray[np.int64]  # (k, 6) of the patch


def step_tetrahedra(step: Path, sizes: ElementSizes, patch: StepPatch) -> Tetrahedra:
    """The solids that `sizes` names, meshed; all others only leave their imprints on them.

    Raises ValueError where gmsh cannot read or mesh the file.
    """
    with session(f"gmsh could not mesh {step}"):
        occ, mesh = gmsh.model.occ, gmsh.model.mesh
        with silent():
            entities = occ.importShapes(str(step))
        occ.synchronize()
        bodies = {gmsh.model.getEntityName(*solid).split("/")[-1]: solid[1] for solid in entities}

        # faces that lie on both bodies of a pair; of copies, since an intersection does not return
        # a face that was there
        common = {}
        for pair in combinations(bodies, 2):
            sides = (gmsh.model.getBoundary([(3, bodies[b])], oriented=False) for b in pair)
            copies = (map(occ.copy, ([a], [b])) for a, b in product(*sides))
            common[pair] = [tag for a, b in copies for tag in occ.intersect(a, b)[0] if tag[0] == 2]

        # each body's faces cut along those of its neighbours, and along the patch, named ""
        faces: dict[tuple[str, str], list[int]] = {}
        for body in sizes.inside:
            tools = {b: common[pair] for pair in common if body in pair for b in pair if b != body}
            if body == patch.body:
                radii = patch.radius, patch.radius
                tools[""] = [(2, occ.addDisk(*patch.centre, *radii, zAxis=list(patch.normal)))]
            copies = {name: occ.copy(surfaces) for name, surfaces in tools.items() if surfaces}
            if not copies:
                continue
            cutting = [surface for surfaces in copies.values() for surface in surfaces]
            _, became = occ.fragment([(3, bodies[body])], cutting)
            bodies[body] = became[0][0][1]
            pieces = iter(became[1:])
            for name, surfaces in copies.items():
                tags = [tag for _ in surfaces for _, tag in next(pieces)]
                if tags:
                    faces[body, name] = tags
        occ.remove([(3, bodies[b]) for b in bodies if b not in sizes.inside], True)
        occ.synchronize()

        # element sizes: the least of each body's own and of what grows from the rims
        fields = []
        for (_, partner), tags in faces.items():
            edges = gmsh.model.getBoundary([(2, t) for t in tags], combined=False, oriented=False)
            rim = _field("Distance", CurvesList=sorted({tag for _, tag in edges}), Sampling=200)
            at_rim = sizes.rim if partner else sizes.disc
            fields.append(_field("MathEval", F=f"{at_rim} + {sizes.growth} * F{rim}"))
        for body, size in sizes.inside.items():
            fields.append(_field("Constant", VolumesList=[bodies[body]], VIn=size, VOut=1e22))
        mesh.field.setAsBackgroundMesh(_field("Min", FieldsList=fields))
        for name in ("ExtendFromBoundary", "FromPoints"):
            gmsh.option.setNumber(f"Mesh.MeshSize{name}", 0)

        # quadratic elements, middles of edges on the curved faces; gmsh's tags become rows
        mesh.generate(3)
        mesh.setOrder(2)
        tags, points, _ = mesh.getNodes()
        number = np.zeros(int(tags.max()) + 1, np.int64)
        number[tags.astype(np.int64)] = np.arange(len(tags))

        def elements(kind: int, entity: int, n: int) -> NDArray[np.int64]:
            """Nodes (., n) of an entity's elements of one of gmsh's types."""
            return number[mesh.getElementsByType(kind, entity)[1].astype(int)].reshape(-1, n)

        cells = {b: elements(TETRAHEDRON, bodies[b], 10)[:, ORDER] for b in sizes.inside}
        lying = {
            pair: np.concatenate([elements(TRIANGLE, tag, 6) for tag in tags])
            for pair, tags in faces.items()
        }
        disc = next(triangles for (_, partner), triangles in lying.items() if not partner)
        touching = {pair: triangles for pair, triangles in lying.items() if pair[1]}
        return Tetrahedra(points.reshape(-1, 3), cells, touching, disc)


def _field(kind: str, **options) -> int:
    """Tag of a field of gmsh with these options."""
    field = gmsh.model.mesh.field
    tag = field.add(kind)
    for name, value in options.items():
        write = {str: field.setString, list: field.setNumbers}.get(type(value), field.setNumber)
        write(tag, name, value)
    return tag
