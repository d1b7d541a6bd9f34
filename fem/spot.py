"""Where a face is struck: the point, the way in, the tangent plane, and how the face curves."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fem.elasticity import Structure

PLANE = 1e-6  # of a face's size: what a plane face may leave its plane by
ROUNDING = 1e-9  # of a normal's length
FLAT = 0.1  # of the smallest radius of curvature: the largest patch that a half-space is under


class Spot(NamedTuple):
    """A point of a face, and the surface around it to second order."""

    point: NDArray[np.float64]  # (3,) [m]
    inward: NDArray[np.float64]  # (3,) unit normal into the body
    axes: NDArray[np.float64]  # (2, 3) unit vectors that span the tangent plane
    radii: tuple[float, float] = (np.inf, np.inf)  # [m] of curvature along them, > 0 where convex
    gap: float = 0.0  # [m] by which the mesh may miss the tangent plane under a patch

    def require_flat(self, patch_radius: float) -> None:
        """Raise ValueError for a patch that no half-space is under."""
        smallest = min(map(abs, self.radii))
        if patch_radius > FLAT * smallest:
            raise ValueError(
                f"a patch of radius {patch_radius:g} m on a face of curvature radius {smallest:g} "
                f"m is {patch_radius / smallest:.2g} of it, allowed is {FLAT:g}: the local law of "
                "a half-space does not hold; take a smaller patch."
            )


def planar_spot(structure: Structure, face: str, at: tuple[float, float]) -> Spot:
    """The spot `at` [m] from the middle of a plane face along the two axes that span it.

    These are the two global axes farthest from the normal, in their order, laid into the plane.
    Raises ValueError for a face that is not plane.
    """
    body, facets = structure.facets(face)
    mesh = structure.basis[body].mesh
    corners = np.unique(mesh.facets[:, facets])
    points = mesh.p[:, corners].T
    normal = _normal(mesh.p[:, mesh.facets[:, facets]])
    off = np.ptp(points @ normal)
    size = np.ptp(points, axis=0).max()
    if off > PLANE * size:
        raise ValueError(
            f"the face {face!r} is not plane: it leaves its mean plane by {off:.2g} m of "
            f"{size:.2g} m; name a plane face, or a cylinder's or sphere's point and radii."
        )
    axes = spanning(normal)
    along = points @ axes.T
    middle = (along.min(axis=0) + along.max(axis=0)) / 2 + np.asarray(at, dtype=float)
    cells = mesh.t[:, mesh.f2t[0, facets]]
    depth = (mesh.p[:, cells].mean(axis=(1, 2)) - points.mean(axis=0)) @ normal
    point = middle @ axes + points.mean(axis=0) @ normal * normal
    return Spot(point, float(np.sign(depth)) * normal, axes)


def spanning(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit vectors (2, 3): the global axes farthest from a normal, in order, in its plane."""
    first, second = np.eye(3)[np.sort(np.argsort(np.abs(normal), kind="stable")[:2])]
    first = first - (first @ normal) * normal
    first /= np.linalg.norm(first)
    across = np.cross(normal, first)
    return np.array([first, np.sign(across @ second) * across])


def _normal(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit normal (3,) of facets (3, n_corners, n) taken together."""
    n = len(corners[0])
    vectors = np.cross((corners[:, 1] - corners[:, 0]).T, (corners[:, n - 1] - corners[:, 0]).T)
    areas = np.linalg.norm(vectors, axis=1)
    # facets may turn either way round: all are brought to that of the largest
    mean = (vectors * np.sign(vectors @ vectors[areas.argmax()])[:, None]).sum(axis=0)
    normal = mean / np.linalg.norm(mean)
    normal[np.abs(normal) < ROUNDING] = 0.0  # else a contact along x would read y and z as well
    return normal / np.linalg.norm(normal)
