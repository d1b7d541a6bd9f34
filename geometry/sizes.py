"""Element sizes of a body: a seed, less at fine points, growing away from them."""

from collections.abc import Sequence
from typing import NamedTuple

import gmsh
import numpy as np
from numpy.typing import NDArray

from geometry.solids import Body, Vector

GRADING = 0.35  # growth of the element size per distance from a fine point
ACROSS, LAYERS = 15, 1 / 3  # elements along a body's diagonal, and through a thin one, at least


class Fine(NamedTuple):
    """Elements of this size at a point of a body."""

    body: str
    point: Vector  # (3,) [m]
    size: float  # m


class Size(NamedTuple):
    """Of one body [m]."""

    seed: float
    fine: tuple[Fine, ...] = ()


def default_seed(body: Body) -> float:
    """Element size from a body's extent, less for a thin one [m]."""
    thickness = 2 * body.volume / body.area
    return float(min(np.linalg.norm(body.upper - body.lower) / ACROSS, thickness / LAYERS))


def size_at(size: Size, x: NDArray[np.float64], axis: Vector) -> NDArray[np.float64]:
    """Sizes along a line of an axis, at its coordinates x [m]."""
    grown = [f.size + GRADING * np.abs(x - f.point @ axis) for f in size.fine]
    return np.minimum.reduce([np.full_like(x, size.seed), *grown])


def mesh_visible(entities: Sequence[tuple[int, int]], size: Size) -> None:
    """Lines, faces and volumes meshed of these entities alone; all others left out."""
    gmsh.model.mesh.clear()
    gmsh.model.setVisibility(gmsh.model.getEntities(), 0)
    gmsh.model.setVisibility(entities, 1, recursive=True)
    gmsh.option.setNumber("Mesh.MeshOnlyVisible", 1)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size.seed)
    _refine(size)
    gmsh.model.mesh.generate(max(dimension for dimension, _ in entities))


def _refine(size: Size) -> None:
    field = gmsh.model.mesh.field
    for tag in field.list():
        field.remove(tag)
    balls = [_ball(f, size.seed) for f in size.fine if f.size < size.seed]
    least = field.add("Min")
    field.setNumbers(least, "FieldsList", balls)
    field.setAsBackgroundMesh(least)


def _ball(fine: Fine, coarse: float) -> int:
    field = gmsh.model.mesh.field
    tag = field.add("Ball")
    numbers = dict(zip(("XCenter", "YCenter", "ZCenter"), fine.point, strict=True))
    numbers |= {"VIn": fine.size, "VOut": coarse, "Radius": fine.size}
    for name, value in (numbers | {"Thickness": (coarse - fine.size) / GRADING}).items():
        field.setNumber(tag, name, value)
    return tag
