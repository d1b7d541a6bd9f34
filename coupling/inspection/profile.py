"""Bars where the valley of the misfit is no parabola: its profile along the direction least told.

    t:  min_v |r(theta + t u + v)|^2 - |r(theta)|^2  =  |r + J u|^2 - |r|^2,   v perpendicular to u

u has two standard deviations of the longest axis of the covariance, the bounds' information counts
in all squares. t is 1 in a parabola and above where the misfit rises more slowly on either side:
the axis is made so many times as long. D. J. Venzon, S. H. Moolgavkar, Appl. Stat. 37 (1988) 87.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from coupling.calibration.uncertainty import Uncertainty, combinations
from coupling.inspection.fitting import Fit

LONGER = 1.25  # of a step, until the misfit has risen enough
FOLLOWED = 2  # times that other numbers follow a step
CUT = 0.5  # of two standard deviations within the bounds, that tell how the misfit rises


class Valley(NamedTuple):
    """The ground at theta (p,), and the squares (p, p) and slopes of a parabola there, in scales;
    data and bounds together."""

    fit: Fit
    theta: NDArray[np.float64]
    J: NDArray[np.float64]

    @property
    def parabola(self) -> NDArray[np.float64]:
        """(p, p)"""
        return self.J.T @ self.J + np.diag(self._pull**2)

    @property
    def _pull(self) -> NDArray[np.float64]:
        return self.fit.unknowns.pull * self.fit.unknowns.scale

    def left(self, step: NDArray[np.float64]) -> NDArray[np.float64]:
        """Residual and what the bounds say, a step (p,) in scales away."""
        theta = self.theta + step * self.fit.unknowns.scale
        off = (theta - self.fit.unknowns.centre) / self.fit.unknowns.scale
        return np.concatenate([self.fit.residual(theta), self._pull * off])

    def rise(self, step: NDArray[np.float64]) -> float:
        """Of the squares a step away, all numbers beside it following."""
        across = np.linalg.svd(step[None])[2][1:].T  # (p, p - 1)
        J = np.vstack([self.J, np.diag(self._pull)])
        follow = across @ np.linalg.solve(across.T @ self.parabola @ across, (J @ across).T)
        ground, there = np.sum(self.left(0.0 * step) ** 2), np.inf
        for _ in range(FOLLOWED + 1):
            left = self.left(step)
            there = min(there, np.sum(left**2))
            step = step - follow @ left
        return float(there - ground)

    def room(self, step: NDArray[np.float64]) -> float:
        """Steps that the bounds leave."""
        low, high = self.fit.unknowns.ends()
        away = step * self.fit.unknowns.scale
        room = np.where(away > 0, high - self.theta, self.theta - low)
        return float((room / np.maximum(np.abs(away), 1e-300)).min())


def stretched(
    fit: Fit, theta: NDArray[np.float64], J: NDArray[np.float64], found: Uncertainty
) -> tuple[Uncertainty, float]:
    """The uncertainty of theta (p,), gains behind it, with the longest axis as long as the misfit
    says, and the factor t. J (n, p) of the fit's residual in scales."""
    p, valley = len(theta), Valley(fit, theta, J)
    scale = np.ones(len(found.two_sigma))
    scale[:p] = fit.unknowns.scale
    covariance = found.covariance / np.outer(scale, scale)
    values, vectors = np.linalg.eigh(covariance[:p, :p])
    axis = 2.0 * np.sqrt(values[-1]) * vectors[:, -1]
    factor = max(_factor(valley, axis), _factor(valley, -axis))
    if factor == 1.0:
        return found, 1.0
    covariance[:p, :p] += (factor**2 - 1.0) / 4.0 * np.outer(axis, axis)
    whole = covariance * np.outer(scale, scale)
    return found._replace(
        covariance=whole,
        two_sigma=2.0 * np.sqrt(np.diag(whole)),
        combinations=combinations(covariance, vectors[:0], np.ones(len(scale), bool)),
    ), factor


def _factor(valley: Valley, step: NDArray[np.float64]) -> float:
    """How many steps raise the misfit as much as one raises the parabola, at least one."""
    room = valley.room(step)
    if room < CUT:
        return 1.0
    begin = min(1.0, room)
    enough = begin**2 * step @ valley.parabola @ step
    t, before, rise = begin, (0.0, 0.0), valley.rise(begin * step)
    while rise < enough and t < room:
        before, t = (t, rise), min(LONGER * t, room)
        rise = valley.rise(t * step)
    if rise < enough:
        return t / begin
    at = np.interp(enough, (before[1], rise), (before[0], t))
    return max(1.0, float(at) / begin)
