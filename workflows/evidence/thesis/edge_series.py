"""Collisions with one plate at growing distances from its clamped edge."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from coupling.plate import Plate, group_speed
from workflows.evidence.thesis.collision import FAINTEST_ARR, Collision

CLOSE = 0.05  # of the ARR far from the edge: where the edge no longer matters


class Series(NamedTuple):
    """One plate struck at all distances."""

    ratio: float  # D/t
    plate: Plate
    distance: NDArray[np.float64]  # (k,) [m]
    collisions: list[Collision]

    @property
    def arr(self) -> NDArray[np.float64]:
        """(k,)"""
        return np.array([one.arr for one in self.collisions])

    @property
    def far(self) -> float:
        """ARR at the largest distance."""
        return self.collisions[-1].arr

    @property
    def edge(self) -> float:
        """ARR at the smallest distance."""
        return self.collisions[0].arr

    @property
    def edge_over_far(self) -> float:
        """ARR at the smallest distance over that at the largest."""
        return float(self.over_far[0])

    @property
    def over_far(self) -> NDArray[np.float64]:
        """ARR over that far away, or over what could just be seen (k,)."""
        return self.arr / max(self.far, FAINTEST_ARR)

    @property
    def remaining(self) -> NDArray[np.float64]:
        """What is left of the edge's effect on ARR (k,), 1 at the edge."""
        return (self.arr - self.far) / (self.arr[0] - self.far)

    def reach(self, deep: Collision) -> float:
        """Half the way [m] that bending waves make while a contact with a half-space lasts."""
        seconds = deep.contact.seconds
        return group_speed(self.plate, np.pi / seconds) * seconds / 2

    @property
    def critical(self) -> float:
        """Distance [m] beyond which ARR stays within CLOSE of that far away."""
        away = np.abs(self.over_far - self.over_far[-1])
        last = int(np.flatnonzero(away > CLOSE).max(initial=-1))
        if last < 0:
            return 0.0
        x, y = self.distance[last : last + 2], away[last : last + 2]
        return float(x[0] + (y[0] - CLOSE) / (y[0] - y[1]) * (x[1] - x[0]))

    @property
    def half_way(self) -> float:
        """Distance [m] at which ARR has fallen half of its way from the edge to far away."""
        middle = (self.arr[0] + self.far) / 2
        beyond = int((self.arr < middle).argmax())
        x, y = self.distance[beyond - 1 : beyond + 1], self.arr[beyond - 1 : beyond + 1]
        return float(x[0] + (y[0] - middle) / (y[0] - y[1]) * (x[1] - x[0]))
