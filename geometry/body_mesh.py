"""Every body meshed on its own, in straight tetrahedra for quadratic shape functions.

Elements have the body's seed, less where it is bent or thin, and grow by GRADING of the distance
from a fine point. Nodes on full cylinders are moved out so that the facets enclose the
cylinder's volume: chords alone make holes and pins too small by 2 pi^2 / (3 n^2) for n edges
around.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import gmsh
import numpy as np
from numpy.typing import NDArray
from skfem import Basis, Mesh, MeshTet

from geometry.imprint import Disc, Imprinted, imprinted
from geometry.roundness import enclosing, full_cylinders
from geometry.selectors import Selected
from geometry.solids import Body, Vector
from geometry.touching import Touch

TRIANGLE, TETRAHEDRON = 2, 4  # gmsh's element types
GRADING = 0.35  # growth of the element size per distance from a fine point
ACROSS, LAYERS = 15, 1 / 3  # elements along a body's diagonal, and through a thin one, at least


class Fine(NamedTuple):
    """Elements of this size at a point of a body."""

    body: str
    point: Vector  # (3,) [m]
    size: float  # m


def body_meshes(
    bodies: Mapping[str, Body],
    touching: Sequence[Touch] = (),
    *,
    gap: float,
    seeds: Mapping[str, float] | None = None,
    fine: Sequence[Fine] = (),
    named: Mapping[str, Selected] | None = None,
    discs: Mapping[str, Disc] | None = None,
) -> dict[str, Mesh]:
    """A mesh for every body, in metres, to call in the bodies' ``with model(...)``.

    Its boundaries are the `named` faces and the `discs` of the body, and "a|b" where it touches
    another, under the same key in both. Raises ValueError, naming the body, for what gmsh cannot
    mesh.
    """
    split = {b.name: imprinted(b, touching, discs, named, gap=gap) for b in bodies.values()}
    gmsh.model.occ.synchronize()
    meshes = {}
    for name, body in bodies.items():
        size = (seeds or {}).get(name) or default_seed(body)
        _meshed(body, split[name], size, [f for f in fine if f.body == name])
        meshes[name] = _tetrahedra(split[name], gap)
        gmsh.model.mesh.clear()
    return meshes


def default_seed(body: Body) -> float:
    """Element size from a body's extent, less for a thin one [m]."""
    thickness = 2 * body.volume / body.area
    return float(min(np.linalg.norm(body.upper - body.lower) / ACROSS, thickness / LAYERS))


def facet_error(mesh: Mesh, body: Body) -> float:
    """Relative difference of the mesh's volume from the body's, which straight facets leave."""
    return float(Basis(mesh, mesh.elem(), intorder=3).dx.sum() / body.volume - 1)


def _meshed(body: Body, split: Imprinted, size: float, fine: Sequence[Fine]) -> None:
    gmsh.model.setVisibility(gmsh.model.getEntities(), 0)
    gmsh.model.setVisibility([(3, split.tag)], 1, recursive=True)
    gmsh.option.setNumber("Mesh.MeshOnlyVisible", 1)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    _refine(fine, size)
    try:
        gmsh.model.mesh.generate(3)
    except Exception as error:
        raise ValueError(
            f'"{body.name}" could not be meshed with elements of {size:.3g} m: {error}'
        ) from error


def _refine(fine: Sequence[Fine], coarse: float) -> None:
    """Size f.size at each point, growing by GRADING to the seed; none without points."""
    field = gmsh.model.mesh.field
    for tag in field.list():
        field.remove(tag)
    balls = []
    for point, size in ((f.point, f.size) for f in fine if f.size < coarse):
        tag = field.add("Ball")
        numbers = dict(zip(("XCenter", "YCenter", "ZCenter"), point, strict=True))
        numbers |= {"VIn": size, "VOut": coarse, "Radius": size}
        for name, value in (numbers | {"Thickness": (coarse - size) / GRADING}).items():
            field.setNumber(tag, name, value)
        balls.append(tag)
    least = field.add("Min")
    field.setNumbers(least, "FieldsList", balls)
    field.setAsBackgroundMesh(least)


def _tetrahedra(split: Imprinted, gap: float) -> MeshTet:
    tags, points, _ = gmsh.model.mesh.getNodes()
    _, cells = gmsh.model.mesh.getElementsByType(TETRAHEDRON, split.tag)
    used, cells = np.unique(cells, return_inverse=True)
    row = np.argsort(tags)
    p = points.reshape(-1, 3)[row[np.searchsorted(tags, used, sorter=row)]]
    p = _enclosing(p, used, split.tag, gap)
    mesh = MeshTet(np.ascontiguousarray(p.T), np.ascontiguousarray(cells.reshape(-1, 4).T))
    return mesh.with_boundaries(
        {name: _facets(mesh, _corners(faces, used)) for name, faces in split.faces.items()}
    )


def _enclosing(p, used, volume: int, gap: float) -> NDArray[np.float64]:
    cylinders = full_cylinders(volume, gap)
    tags = [face.tag for cylinder in cylinders for face in cylinder.faces]
    return enclosing(p, {tag: _corners([tag], used) for tag in tags}, cylinders)


def _corners(faces: Sequence[int], used: NDArray) -> NDArray[np.int64]:
    """(n, 3) node numbers of the triangles on faces."""
    nodes = [gmsh.model.mesh.getElementsByType(TRIANGLE, tag)[1] for tag in faces]
    return np.searchsorted(used, np.concatenate([*nodes, []])).reshape(-1, 3)


def _facets(mesh: Mesh, corners: NDArray[np.int64]) -> NDArray[np.int64]:
    """Numbers of the facets with these corners."""
    outer = mesh.boundary_facets()
    both = np.concatenate([np.sort(mesh.facets[:, outer].T), np.sort(corners)])
    _, same = np.unique(both, axis=0, return_inverse=True)
    at = np.empty(same.max() + 1, dtype=np.int64)
    at[same[: len(outer)]] = outer
    return at[same[len(outer) :]]
