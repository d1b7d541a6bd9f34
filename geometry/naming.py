"""Names on a mesh of the assembly: bodies as subdomains, faces "body:face" as boundaries.

Faces are found by where their facets lie, so that any mesher's mesh gets the same names.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

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

if TYPE_CHECKING:  # see `hex_mesh`
    from skfem import Mesh

AnyMesh = TypeVar("AnyMesh", bound="Mesh")
Test = Callable[[NDArray[np.float64]], NDArray[np.bool_]]  # of corners (3, corners, facets)
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


def by_body(mesh: Mesh) -> dict[str, Mesh]:
    """The mesh of every subdomain, its boundaries "body:face" as "face".

    Nodes that bodies share are doubled: nothing is joined by its mesh.
    """
    meshes = {}
    for name in mesh.subdomains:
        body = mesh.restrict(mesh.subdomains[name], skip_subdomains=True)
        faces = {}
        for boundary, facets in (body.boundaries or {}).items():
            owner, _, face = boundary.partition(":")
            if owner == name and len(facets):
                faces[face] = facets
        meshes[name] = body.with_boundaries(faces)
    return meshes


def _box_faces(assembly: Assembly, name: str) -> dict[str, Test]:
    """Which facets of a part lie on its sides, and in the squares at its corners."""
    box = boxes(assembly)[name]
    faces = {}
    for axis, letter in enumerate("xyz"):
        faces[f"-{letter}"] = _on_plane(axis, box.lower[axis])
        faces[f"+{letter}"] = _on_plane(axis, box.upper[axis])

    def in_corner(near: float, far: float) -> Test:
        """Between two distances from both edges of a corner, seen along z."""

        def test(corners):
            # a facet's middle tells one that spans from corner to corner of the part
            points = np.concatenate([corners[:2], corners[:2].mean(axis=1, keepdims=True)], axis=1)
            middle, half = (box.upper + box.lower) / 2, (box.upper - box.lower) / 2
            inset = half[:2, None, None] - np.abs(points - middle[:2, None, None])
            inside = (inset > near - TOLERANCE) & (inset < far + TOLERANCE)
            return np.all(inside, axis=(0, 1))

        return test

    for square, (face, near, far) in corner_squares(assembly, name).items():
        faces[square] = _both(faces[face], in_corner(near, far))
    return faces


def _sheet_faces(assembly: Assembly, name: str) -> dict[str, Test]:
    """Which facets of a sheet lie on the bodies it is bolted to, and under each screw."""
    a = assembly

    def within(axis: int, lower: float, upper: float) -> Test:
        return lambda corners: np.all(
            (corners[axis] > lower - TOLERANCE) & (corners[axis] < upper + TOLERANCE), axis=0
        )

    def under_washer(x: float, z: float) -> Test:
        return lambda corners: (
            np.hypot(*(corners.mean(axis=1)[[0, 2]] - [[x], [z]])) < a.washer_radius
        )

    inner = _on_plane(1, sheets(a)[name])
    faces = {}
    for joint in ("head", "foot"):
        strip = _both(inner, within(2, *washer_z_range(a, joint)))
        faces[joint] = strip
        for i, (x, cell) in enumerate(zip(a.screw_x, screw_cells(a), strict=True), start=1):
            washer = under_washer(x, screw_z(a)[joint])
            faces[f"{joint}-share-{i}"] = _both(strip, within(0, *cell))
            faces[f"{joint}-washer-{i}"] = _both(strip, washer)
    return faces


def _on_plane(axis: int, value: float) -> Test:
    return lambda corners: np.all(np.abs(corners[axis] - value) < TOLERANCE, axis=0)


def _both(first: Test, second: Test) -> Test:
    return lambda corners: first(corners) & second(corners)
