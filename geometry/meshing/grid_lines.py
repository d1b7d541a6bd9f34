"""Grid lines of boxes, closer where stresses are steep: at a contact, at the edge of an interface.

From a stop on, the element size grows with the distance d as h(d) = s + b d, up to that of the
body; neighbouring elements then differ by a factor of exp(b). The number of elements within d is

    n(d) = int_0^d dx / h(x) = ln(1 + b d / s) / b,

which is stretched to a whole number between every two stops.
"""

from collections.abc import Sequence
from itertools import pairwise
from math import log, log1p
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Coordinates = NDArray[np.float64]
GROWTH = 1.7  # size of an element over that of its neighbour nearer to a contact; not varied


class Stop(NamedTuple):
    """A coordinate that a grid line must pass, and the sizes around it."""

    at: float  # [m]
    size: float = np.inf  # h(0) [m], at most the body's
    slope: float = 0.0  # b


def refined(at: float, first: float, growth: float = GROWTH) -> Stop:
    """A stop whose nearest elements have the size `first` [m], each next one `growth` > 1 times
    that: b = ln growth, and n(first) = 1 gives s = first b / (growth - 1)."""
    slope = log(growth)
    return Stop(at, first * slope / (growth - 1), slope)


def lines_through(stops: Sequence[Stop], size: float) -> Coordinates:
    """Ascending grid lines (k,) [m] that pass all stops, which ascend, at most about `size` [m]
    apart: about, since each stretch is divided into a whole number of cells."""
    pieces = [_Stretch.between(*pair, size).lines() for pair in pairwise(stops)]
    return np.concatenate([[stops[0].at], *(piece[1:] for piece in pieces)])


def n_cells(stops: Sequence[Stop], size: float) -> int:
    """Number of cells between the lines of `lines_through`, without making them."""
    return sum(_Stretch.between(*pair, size).n_cells for pair in pairwise(stops))


def graded(lower: float, upper: float, point: float, fine: float, coarse: float) -> Coordinates:
    """Grid lines (k,) [m] from `lower` to `upper`, spaced `fine` at `point`, which may be one of
    them, and growing by GROWTH up to `coarse`."""
    ends = [Stop(at) for at in (lower, upper) if not np.isclose(at, point, rtol=0, atol=1e-12)]
    return lines_through(sorted([*ends, refined(point, fine)]), coarse)


class _Side(NamedTuple):
    """One end of a stretch: elements that grow from `size` with `slope` up to `most`."""

    size: float  # [m] at the stop
    slope: float  # b
    most: float  # [m] size of the body's elements
    length: float  # [m] up to where elements grown from the other end have the same size

    @property
    def grown(self) -> float:
        """Distance at which the elements have their full size."""
        return (self.most - self.size) / self.slope if self.slope else 0.0

    def cells(self, d):
        """Number of cells within the distance d [m], not whole."""
        graded = min(d, self.grown)
        growing = log1p(self.slope * graded / self.size) / self.slope if graded > 0 else 0.0
        return growing + (d - graded) / self.most

    def distance(self, cells):
        """Distance [m] within which there are so many cells (k,); inverse of `cells`."""
        n = self.cells(self.grown)
        graded = np.minimum(cells, n)
        growing = self.size * np.expm1(self.slope * graded) / self.slope if self.slope else 0.0
        return growing + (cells - graded) * self.most


class _Stretch(NamedTuple):
    """The elements between two stops."""

    start: float  # m
    end: float  # m
    lower: _Side
    upper: _Side

    @classmethod
    def between(cls, first: Stop, second: Stop, most: float) -> "_Stretch":
        """The stretch between two stops with elements up to the size `most` [m]; elements of both
        ends meet where they have the same size, s + b x = t + c (length - x)."""
        length = second.at - first.at
        s, t = min(first.size, most), min(second.size, most)
        slopes = first.slope + second.slope
        meeting = (t - s + second.slope * length) / slopes if slopes else length / 2
        meeting = min(max(meeting, 0.0), length)
        lower = _Side(s, first.slope, most, meeting)
        upper = _Side(t, second.slope, most, length - meeting)
        return cls(first.at, second.at, lower, upper)

    @property
    def shares(self) -> tuple[float, float]:
        """Number of cells that grow from either end, not whole."""
        return self.lower.cells(self.lower.length), self.upper.cells(self.upper.length)

    @property
    def n_cells(self) -> int:
        """Number of cells: the sum of both shares, rounded, at least one."""
        return max(1, round(sum(self.shares)))

    def lines(self) -> Coordinates:
        """Grid lines [m] from start to end, both included: the shares stretched to whole cells."""
        first, second = self.shares
        place = np.linspace(0.0, first + second, self.n_cells + 1)
        below = self.start + self.lower.distance(np.minimum(place, first))
        above = self.end - self.upper.distance(np.minimum(place[::-1], second))
        return np.where(place <= first, below, above)
