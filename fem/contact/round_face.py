"""The cylinder or the sphere that the corners of a face lie on.

    |x - c| = R,    or of a cylinder along a    |(1 - a a^T) (x - c)| = R.

A mesh has chords of it, h^2 / 8 R inside; a gap between round faces is as small as that.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

# of the chord height h^2 / 8 R of the facets, by which corners may miss the surface
MISFIT = 0.01


class RoundFace(NamedTuple):
    """A sphere, or with an axis a cylinder."""

    centre: NDArray[np.float64]  # (3,) [m]
    radius: float  # [m]
    axis: NDArray[np.float64] | None = None  # (3,)

    def across(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        """The parts of vectors (k, 3) that leave the axis."""
        if self.axis is None:
            return vectors
        return vectors - (vectors @ self.axis)[:, None] * self.axis

    def distance(
        self, points: NDArray[np.float64], n: NDArray[np.float64], near: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Distances t (k,) [m] along n (k, 3) from points (k, 3) to the surface, of two the one
        next to `near` (k,); of a line that passes it by, where it comes nearest."""
        x, d = self.across(points - self.centre), self.across(n)
        a, b = np.einsum("ij,ij->i", d, d), np.einsum("ij,ij->i", x, d)
        root = np.sqrt(np.maximum(b**2 - a * (np.einsum("ij,ij->i", x, x) - self.radius**2), 0.0))
        both = (-b + np.array([[-1.0], [1.0]]) * root) / a
        return np.where(np.abs(both[0] - near) < np.abs(both[1] - near), *both)


def fitted(corners: NDArray[np.float64], normals: NDArray[np.float64]) -> RoundFace | None:
    """The surface that the corners (k, n, 3) of facets with unit normals (k, 3) lie on; None of a
    plane, and where they lie on neither a sphere nor a cylinder."""
    points, size = corners.reshape(-1, 3), np.ptp(corners, axis=1).max()
    turn = 1 - np.linalg.norm(normals.mean(axis=0))
    if turn < 1e-9:
        return None

    # a sphere: |x|^2 = 2 c . x + R^2 - |c|^2, about the mean of the points
    middle = points.mean(axis=0)
    x = points - middle
    columns = np.column_stack([2 * x, np.ones(len(x))])
    (*c, rest), *_ = np.linalg.lstsq(columns, np.einsum("ij,ij->i", x, x), rcond=None)
    sphere = RoundFace(middle + c, float(np.sqrt(max(rest + np.dot(c, c), 0.0))))

    # a cylinder: its axis is across all normals; two turns, two shifts and the radius from there
    axis = np.linalg.eigh(normals.T @ normals)[1][:, 0]
    across = np.linalg.svd(axis[None])[2][1:]
    flat = x @ across.T
    columns = np.column_stack([2 * flat, np.ones(len(x))])
    (*c, rest), *_ = np.linalg.lstsq(columns, np.einsum("ij,ij->i", flat, flat), rcond=None)
    start = np.array([0.0, 0.0, *c, np.sqrt(max(rest + np.dot(c, c), 0.0))])

    def cylinder(q: NDArray[np.float64]) -> RoundFace:
        along = axis + q[:2] @ across
        return RoundFace(middle + q[2:4] @ across, float(q[4]), along / np.linalg.norm(along))

    def misfit(surface: RoundFace) -> NDArray[np.float64]:
        return np.linalg.norm(surface.across(points - surface.centre), axis=1) - surface.radius

    q = least_squares(lambda q: misfit(cylinder(q)), start, x_scale=np.maximum(np.abs(start), 1e-3))
    for surface in (sphere, cylinder(q.x)):
        if surface.radius > 0:
            allowed = MISFIT * size**2 / (8 * surface.radius)
            if np.abs(misfit(surface)).max() < allowed:
                return surface
    return None
