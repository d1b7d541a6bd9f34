"""Round faces that touch at a point or along a line, with what Hertz' formulas need of them.

Two faces that look at each other where they touch leave the gap x . A x / 2 around there, A the sum
of their curvatures in the common tangent plane, a convex face's > 0. Both principal curvatures of A
above 0 is a point, one of them 0 a line.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.geometry.cad.contacts import FaceContact
from beadwave.geometry.cad.solids import Body, Face, Vector

ROUND = ("plane", "cylinder", "sphere")
# cosine of the angle between the normals where faces touch, at most: at an edge they differ
TANGENT = -0.999
STRAIGHT = 1e-3  # of the larger principal curvature: a smaller one is a line's
N_ALONG = 161  # points of a line that are tried


class RoundContact(NamedTuple):
    """Two faces that touch at a point or along a line."""

    faces: tuple[int, int]  # tags
    distance: float  # [m]
    curvature: float  # [1/m] 1/R of the relative radius; of a point sqrt(kappa_1 kappa_2)
    points: NDArray[np.float64]  # (n, 3) [m] along the line, or the point
    length: float  # [m] of the line, 0 of a point
    along: Vector | None = None  # (3,) of the line

    @property
    def contact(self) -> FaceContact:
        """As faces that touch over no area."""
        return FaceContact(self.faces, 0.0, self.distance, (), flush=False)


def is_round(first: Face, second: Face) -> bool:
    """True of faces of which one is a cylinder or a sphere, and the other one too, or a plane."""
    kinds = {first.kind, second.kind}
    return kinds <= {*ROUND} and kinds != {"plane"}


def round_contact(
    a: Body, b: Body, first: Face, second: Face, at: NDArray[np.float64], within: float
) -> RoundContact | None:
    """The contact of two faces that are closest at points (2, 3) [m]; None of faces that do not
    look at each other there, and of those that fit each other. A line goes on as far as both faces
    are at most `within` [m] off it."""
    n = [_normal(face, point) for face, point in zip((first, second), at, strict=True)]
    if n[0] @ n[1] > TANGENT:
        return None
    tangents = np.linalg.svd(n[0][None])[2][1:]
    A = tangents @ (_curvatures(first, n[0]) + _curvatures(second, n[1])) @ tangents.T
    (low, high), directions = np.linalg.eigh(A)
    if high <= 0 or low < -STRAIGHT * high:
        return None

    points, length = at.mean(axis=0)[None], 0.0
    distance = float(np.linalg.norm(at[1] - at[0]))
    if low > STRAIGHT * high:
        kappa = float(np.sqrt(low * high))
        return RoundContact((first.tag, second.tag), distance, kappa, points, length)
    along = directions[:, 0] @ tangents
    reach = min(np.linalg.norm(face.upper - face.lower) for face in (first, second))
    s = np.linspace(-reach, reach, N_ALONG)
    line, off = points + s[:, None] * along, 2 * within + distance
    on_both = [
        a.distance(point, first.tag) <= off and b.distance(point, second.tag) <= off
        for point in line
    ]
    if any(on_both):
        points = line[on_both]
        length = float(np.ptp(s[on_both]) + s[1] - s[0])
    return RoundContact((first.tag, second.tag), distance, float(high), points, length, along)


def _normal(face: Face, point: Vector) -> Vector:
    """(3,) out of the body, at a point of a plane, a cylinder or a sphere."""
    if face.normal is not None:
        return face.normal
    x = point - face.on_axis
    if face.axis is not None:
        x = x - (x @ face.axis) * face.axis
    return (-x if face.hollow else x) / np.linalg.norm(x)


def _curvatures(face: Face, n: Vector) -> NDArray[np.float64]:
    """Tensor (3, 3) [1/m] of the curvatures of a face with the outward normal n (3,)."""
    if face.radius is None:
        return np.zeros((3, 3))
    tangent = np.eye(3) - np.outer(n, n)
    if face.axis is not None:
        tangent = tangent - np.outer(face.axis, face.axis)
    return (-tangent if face.hollow else tangent) / face.radius
