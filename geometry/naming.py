"""Names on a mesh of the assembly: bodies as subdomains, faces "body:face" as boundaries.

Faces are found by where their facets lie, so that any mesher's mesh gets the same names.
"""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from skfem import Mesh

from geometry.assembly import (
    SIDES,
    Assembly,
    boxes,
    corner_squares,
    screw_cells,
    screw_z,
    sheets,
    washer_z_range,
)

AnyMesh = TypeVar("AnyMesh", bound=Mesh)
TOLERANCE = 1e-7  # m


def named(mesh: AnyMesh, assembly: Assembly, body: dict[str, NDArray[np.int64]]) -> AnyMesh:
    """The mesh with subdomains `body` (elements of each) and every face of the assembly named."""
    faces: dict[str, NDArray[np.int64]] = {}
    for name, elements in body.items():
        facets = np.intersect1d(mesh.t2f[:, elements], mesh.boundary_facets())
        corners = mesh.p[:, mesh.facets[:, facets]]  # (3, corners, facets)
        tests = _sheet_faces(assembly, name) if name in SIDES else _box_faces(assembly, name)
        faces |= {f"{name}:{face}": facets[test(corners)] for face, test in tests.items()}
    return mesh.with_subdomains(body).with_boundaries(faces)


def _box_faces(assembly: Assembly, name: str) -> dict:
    box = boxes(assembly)[name]
    faces = {}
    for axis, letter in enumerate("xyz"):
        faces[f"-{letter}"] = _on_plane(axis, box.lower[axis])
        faces[f"+{letter}"] = _on_plane(axis, box.upper[axis])
    for square, (face, near, far) in corner_squares(assembly, name).items():
        faces[square] = _both(faces[face], _in_corner(box, near, far))
    return faces


def _sheet_faces(assembly: Assembly, name: str) -> dict:
    inner = _on_plane(1, sheets(assembly)[name])
    faces = {}
    for joint in ("head", "foot"):
        lower, upper = washer_z_range(assembly, joint)
        strip = _both(inner, _within(2, lower, upper))
        faces[joint] = strip
        for i, (x, cell) in enumerate(
            zip(assembly.screw_x, screw_cells(assembly), strict=True), start=1
        ):
            faces[f"{joint}-share-{i}"] = _both(strip, _within(0, *cell))
            faces[f"{joint}-washer-{i}"] = _both(
                strip, _inside_circle(x, screw_z(assembly)[joint], assembly.washer_radius)
            )
    return faces


def _on_plane(axis: int, value: float):
    return lambda corners: np.all(np.abs(corners[axis] - value) < TOLERANCE, axis=0)


def _within(axis: int, lower: float, upper: float):
    def test(corners):
        return np.all(
            (corners[axis] > lower - TOLERANCE) & (corners[axis] < upper + TOLERANCE), axis=0
        )

    return test


def _inside_circle(x: float, z: float, radius: float):
    return lambda corners: np.hypot(*(corners.mean(axis=1)[[0, 2]] - [[x], [z]])) < radius


def _in_corner(box, near: float, far: float):
    """Facets that lie between two distances from both edges of a corner, seen along z."""

    def test(corners):
        # a facet's middle tells one that spans from corner to corner of the part
        points = np.concatenate([corners[:2], corners[:2].mean(axis=1, keepdims=True)], axis=1)
        middle, half = (box.upper + box.lower) / 2, (box.upper - box.lower) / 2
        inset = half[:2, None, None] - np.abs(points - middle[:2, None, None])
        inside = (inset > near - TOLERANCE) & (inset < far + TOLERANCE)
        return np.all(inside, axis=(0, 1))

    return test


def _both(one, other):
    return lambda corners: one(corners) & other(corners)
