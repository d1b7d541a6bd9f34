"""The spot where a face is struck: point, inward normal, tangent plane, radii of curvature."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from skfem import Mesh

from beadwave.fem.assembly.chord_height import area_vectors
from beadwave.fem.assembly.elasticity import Structure

PLANE_TOLERANCE = 1e-6  # of a face's size: by which a plane face may leave its mean plane
ROUND_TOLERANCE = 0.02  # of a radius: by which corners of a mesh may leave a round face
MAX_PATCH_SHARE = 0.1  # of the smallest radius of curvature: the largest patch on a half-space


class SurfacePoint(NamedTuple):
    """A point of a face, and the surface around it to second order."""

    point: NDArray[np.float64]  # (3,) [m]
    inward: NDArray[np.float64]  # (3,) unit normal into the body
    axes: NDArray[np.float64]  # (2, 3) unit vectors that span the tangent plane
    radii: tuple[float, float] = (np.inf, np.inf)  # [m] of curvature along them, > 0 where convex
    gap: float = 0.0  # [m] by which the mesh may miss the tangent plane under a patch


def require_flat(radii: tuple[float, float], patch_radius: float) -> None:
    """Raise ValueError for a patch of a radius [m] too large for the half-space of the contact law
    on a face with these principal radii of curvature [m], inf of a plane."""
    smallest = min(map(abs, radii))
    if patch_radius > MAX_PATCH_SHARE * smallest:
        raise ValueError(
            f"a patch of radius {patch_radius:g} m on a face of curvature radius {smallest:g} m "
            f"is {patch_radius / smallest:.2g} of it, allowed is {MAX_PATCH_SHARE:g}: the local "
            "law of a half-space does not hold; take a smaller patch."
        )


def planar_spot(
    structure: Structure,
    face: str,
    at: tuple[float, float],
) -> SurfacePoint:
    """The spot `at` [m] from the middle of a plane face "body:face" along the two axes that span
    it. Raises ValueError for a face that is not plane."""
    body, facets = structure.facets(face)
    return plane_spot(structure.basis[body].mesh, facets, face, at)


def plane_spot(
    mesh: Mesh,
    facets: NDArray[np.int64],
    face: str,
    at: tuple[float, float],
) -> SurfacePoint:
    """The spot `at` [m] from the middle of the plane face that some facets of a mesh make up,
    called `face`, along the two axes that span it.

    facets (k,) are numbers in the mesh. The axes are the two global ones farthest from the normal,
    in their order, laid into the plane. Raises ValueError for a face that is not plane.
    """
    corners, middles = _corners_and_middles(mesh, facets)
    points = corners.reshape(3, -1).T

    # the mean normal; facets may be numbered either way round: all turned like the largest one
    vectors = area_vectors(corners)
    areas = np.linalg.norm(vectors, axis=1)
    mean = (vectors * np.sign(vectors @ vectors[areas.argmax()])[:, None]).sum(axis=0)
    normal = mean / np.linalg.norm(mean)
    normal[np.abs(normal) < 1e-9] = 0.0  # else a contact along x would read y and z as well
    normal /= np.linalg.norm(normal)
    off, size = float(np.ptp(points @ normal)), np.ptp(points, axis=0).max()
    if off > PLANE_TOLERANCE * size:
        raise ValueError(
            f"the face {face!r} is not plane: it leaves its mean plane by {off:.2g} m of "
            f"{size:.2g} m; name a plane face, or a cylinder's or sphere's point and radii."
        )

    axes = spanning(normal)
    along = points @ axes.T
    middle = (along.min(axis=0) + along.max(axis=0)) / 2 + np.asarray(at, dtype=float)
    height = points.mean(axis=0) @ normal
    side = np.sign(np.mean(middles @ normal) - height)  # of the plane on which the body lies
    return SurfacePoint(middle @ axes + height * normal, side * normal, axes)


def round_spot(
    structure: Structure,
    face: str,
    near: tuple[float, float, float],
    centre: NDArray[np.float64],
    radius: float,
    axis: NDArray[np.float64] | None = None,
) -> SurfacePoint:
    """The spot nearest to a point (3,) [m] on a cylinder of an axis (3,) through `centre` (3,) [m],
    or without one on a sphere around it.

    `radius` [m] is positive; whether the face is convex or hollow follows from the elements behind
    it. Raises ValueError for a point on the axis, and where the mesh of the face is not as round.
    """
    body, facets = structure.facets(face)
    corners, middles = _corners_and_middles(structure.basis[body].mesh, facets)
    point = np.asarray(near, dtype=float)
    away = _across(point - centre, axis)
    if np.linalg.norm(away) < 1e-9 * radius:
        raise ValueError(
            f"{list(near)} m lies in the middle of {face!r}: the struck side is not defined."
        )

    # the mesh's corners must lie at the radius; elements behind lie inside of it where it is convex
    outward = away / np.linalg.norm(away)
    rims = np.linalg.norm(_across(corners.reshape(3, -1).T - centre, axis), axis=1)
    if np.abs(rims / radius - 1).max() > ROUND_TOLERANCE:
        raise ValueError(
            f"the face {face!r} is not of radius {radius:g} m about its middle: its mesh has "
            f"{rims.min():g} to {rims.max():g} m."
        )
    depths = np.linalg.norm(_across(middles - centre, axis), axis=1)
    convex = 1.0 if depths.mean() < rims.mean() else -1.0
    along = spanning(outward) if axis is None else np.array([axis, np.cross(outward, axis)])
    along = along / np.linalg.norm(along, axis=1)[:, None]
    radii = (convex * radius if axis is None else np.inf, convex * radius)
    # the sagitta of a facet, and by how much the face leaves its tangent plane under a patch
    facet = np.ptp(corners, axis=1).max()
    gap = (facet**2 / 4 + (MAX_PATCH_SHARE * radius) ** 2) / (2 * radius)
    return SurfacePoint(point - away + radius * outward, -convex * outward, along, radii, gap)


def _corners_and_middles(
    mesh: Mesh, facets: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Corners (3, n_corners, n) of facets and middles (n, 3) of the elements behind."""
    cells = mesh.t[:, mesh.f2t[0, facets]]
    return mesh.p[:, mesh.facets[:, facets]], mesh.p[:, cells].mean(axis=1).T


def _across(vectors: NDArray[np.float64], axis: NDArray[np.float64] | None) -> NDArray[np.float64]:
    """The components of vectors (..., 3) normal to an axis; all of them without an axis."""
    if axis is None:
        return vectors
    unit = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    return vectors - (vectors @ unit)[..., None] * unit


def spanning(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit vectors (2, 3): the global axes farthest from a normal, in order, in its plane."""
    first, second = np.eye(3)[np.sort(np.argsort(np.abs(normal), kind="stable")[:2])]
    first = first - (first @ normal) * normal
    first /= np.linalg.norm(first)
    across = np.cross(normal, first)
    return np.array([first, np.sign(across @ second) * across])
