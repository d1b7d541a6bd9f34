"""Element sizes that vary over a body, at points of an earlier mesh of it.

Between the points the nearest one counts, on the base of an extrusion and along an axis linear
interpolation; sizes grow from a point to the next by `GRADING` at most. A body in layers has a size
across its axis and one along it, a box one along each of its edges: elements may stay long along an
edge.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.geometry.cad.solids import Vector, parallel

GRADING = 0.35  # growth of the element size per distance
N_PLACES = 400  # along an axis, at which sizes are told apart
SAME_FOOT = (
    0.1  # of the smallest size: points closer than this across an axis are one above another
)
SAME_BOX = 1e-6  # of the largest side: the kernel's boxes differ by its tolerance
STEP = 2**0.25  # of sizes: rounding does not make another mesh


class SizeField(NamedTuple):
    """Sizes at points: one, across an axis and along it, or along each of three axes."""

    points: NDArray[np.float64]  # (n, 3) [m]
    sizes: NDArray[np.float64]  # (n, m) [m] along each axis
    # (m, 3) unit vectors; a row of zeros stands for all directions that are no other row's
    axes: NDArray[np.float64]
    plane: NDArray[np.float64] | None = (
        None  # (2, 3) unit vectors of the plane that holds all points
    )

    def of(self, axis: Vector) -> NDArray[np.float64]:
        """Sizes (n,) [m] along an axis (3,): those of the row that is parallel to it, else the
        smallest of the others."""
        for row, along in enumerate(self.axes):
            if np.any(along) and parallel(along, axis):
                return self.sizes[:, row]
        others = [not np.any(along) for along in self.axes]
        return self.sizes[:, others if any(others) else slice(None)].min(axis=1)

    def across(self, axis: Vector) -> NDArray[np.float64]:
        """Smallest sizes (n,) [m] across an axis (3,)."""
        other = [not (np.any(along) and parallel(along, axis)) for along in self.axes]
        return self.sizes[:, other].min(axis=1)

    def stretched(self, box: NDArray[np.float64], onto: NDArray[np.float64]) -> "SizeField":
        """The field of a body in a box (2, 3) [m], lower and upper corner, for the body in another
        one: points keep their place in the box; a size grows as the box does along its axis, one of
        all other directions as it does where it grows least."""
        if np.allclose(box, onto, rtol=0.0, atol=SAME_BOX * np.ptp(box, axis=0).max()):
            return self
        times = np.ptp(onto, axis=0) / np.ptp(box, axis=0)
        sizes = self.sizes.copy()
        for row, along in enumerate(self.axes):
            if np.any(along):
                sizes[:, row] *= np.linalg.norm(along * times)
            else:
                others = self.axes[np.any(self.axes, axis=1)]
                within = ~np.any(np.abs(others) > 1 - SAME_BOX, axis=0)
                sizes[:, row] *= times[within if within.any() else slice(None)].min()
        points = onto[0] + (self.points - box[0]) * times
        return self._replace(points=points, sizes=rounded(sizes))

    def at(self, x: NDArray[np.float64], axis: Vector) -> NDArray[np.float64]:
        """Smallest sizes (k,) [m] along an axis (3,) at the coordinates x (k,) [m] along it."""
        return smallest_at(self.points @ axis, self.of(axis), x)

    def on_base(self, axis: Vector) -> "SizeField":
        """The smallest sizes across an axis (3,) of all points above each other, at the lowest."""
        height = self.points @ axis
        foot = self.points - height[:, None] * axis
        across = self.across(axis)
        place = np.round(foot / (SAME_FOOT * across.min()))
        _, first, column = np.unique(place, axis=0, return_index=True, return_inverse=True)
        smallest = np.full(len(first), np.inf)
        np.minimum.at(smallest, column.ravel(), across)
        points = foot[first] + height.min() * axis
        u = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        u /= np.linalg.norm(u)
        plane = np.array([u, np.cross(axis, u)])
        return SizeField(points, smallest[:, None], np.zeros((1, 3)), plane)


def smallest_at(
    coordinate: NDArray[np.float64], size: NDArray[np.float64], x: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Sizes at x (k,), on lines through the smallest of those (n,) at coordinates (n,), grown from
    there: sizes that grow from a single layer's middle on make one of 1.6 layers."""
    low, high = coordinate.min(), coordinate.max()
    place = np.round((coordinate - low) / max(high - low, 1e-12) * N_PLACES).astype(int)
    smallest = np.full(N_PLACES + 1, np.inf)
    np.minimum.at(smallest, place, size)
    there = np.isfinite(smallest)
    at = np.linspace(low, high, N_PLACES + 1)[there]
    grown = np.min(smallest[there] + GRADING * np.abs(at[:, None] - at), axis=1)
    return np.interp(x, at, grown)


def rounded(sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """The nearest sizes of steps of `STEP` from 1 m on."""
    return STEP ** np.round(np.log(sizes) / np.log(STEP))
