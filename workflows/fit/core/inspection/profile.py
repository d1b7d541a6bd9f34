"""Bars where the valley of the misfit is no parabola: its profile over each number.

    t:  min_v |r(theta + t u + v)|^2 - |r(theta)|^2  =  |r + J u|^2 - |r|^2,   v_i = 0

u moves number i by two standard deviations and the others along with it; the bounds' information
counts in all squares. t is 1 in a parabola and above where the misfit rises more slowly on either
side, as at a number for which a wave only just comes into the record: the bar is made so many times
as long. D. J. Venzon, S. H. Moolgavkar, Appl. Stat. 37 (1988) 87.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflows.fit.core.calibration.uncertainty import Uncertainty, combinations
from workflows.fit.core.inspection.fitting import RecordFit

LONGER = 1.5  # of a step, until the misfit has risen enough


class Valley(NamedTuple):
    """The ground at theta (p,), J (n, p) of the residual there, in scales."""

    fit: RecordFit
    theta: NDArray[np.float64]
    J: NDArray[np.float64]

    @property
    def parabola(self) -> NDArray[np.float64]:
        """(p, p) squares of data and bounds together."""
        return self.J.T @ self.J + np.diag(self._pull**2)

    @property
    def _pull(self) -> NDArray[np.float64]:
        return self.fit.unknowns.pull * self.fit.unknowns.scale

    def left(self, step: NDArray[np.float64]) -> NDArray[np.float64]:
        """Residual and what the bounds say, a step (p,) in scales away."""
        low, high = self.fit.unknowns.ends()
        theta = np.clip(self.theta + step * self.fit.unknowns.scale, low, high)
        off = (theta - self.fit.unknowns.centre) / self.fit.unknowns.scale
        return np.concatenate([self.fit.residual(theta), self._pull * off])

    def rise(self, step: NDArray[np.float64], i: int) -> float:
        """Of the squares where number i has moved by a step, the others along with it or not at
        all, and then following."""
        alone = np.where(np.arange(len(step)) == i, step, 0.0)
        ground = np.sum(self.left(0.0 * step) ** 2)
        return float(min(self._followed(begin, i) for begin in (step, alone)) - ground)

    def _followed(self, step: NDArray[np.float64], i: int) -> float:
        across = np.delete(np.eye(len(step)), i, axis=1)  # (p, p - 1)
        J = np.vstack([self.J, np.diag(self._pull)])
        follow = across @ np.linalg.solve(across.T @ self.parabola @ across, (J @ across).T)
        left = self.left(step)
        return min(np.sum(left**2), np.sum(self.left(step - follow @ left) ** 2))

    def room(self, step: NDArray[np.float64], i: int) -> float:
        """Steps that the bounds of number i leave."""
        low, high = self.fit.unknowns.ends()
        end = high[i] if step[i] > 0 else low[i]
        return float((end - self.theta[i]) / (step[i] * self.fit.unknowns.scale[i]))


def stretched(
    fit: RecordFit,
    theta: NDArray[np.float64],
    J: NDArray[np.float64],
    found: Uncertainty,
    n_shared: int,
) -> tuple[Uncertainty, float]:
    """The uncertainty of theta (p,), gains behind it, with the bars of the first numbers as long as
    the misfit says, and the largest t. J (n, p) of the fit's residual in scales."""
    p, valley = len(theta), Valley(fit, theta, J)
    scale = np.ones(len(found.two_sigma))
    scale[:p] = fit.unknowns.scale
    covariance = found.covariance / np.outer(scale, scale)
    sigma = np.sqrt(np.diag(covariance))
    steps = [2.0 * covariance[:p, i] / sigma[i] for i in range(n_shared)]
    factors = [max(_factor(valley, way * u, i) for way in (1, -1)) for i, u in enumerate(steps)]
    for i, factor in enumerate(factors):
        covariance[i, i] *= factor**2
    if max(factors) == 1.0:
        return found, 1.0
    return found._replace(
        covariance=covariance * np.outer(scale, scale),
        two_sigma=2.0 * np.sqrt(np.diag(covariance)) * scale,
        combinations=combinations(covariance, covariance[:0], np.ones(len(scale), bool)),
    ), max(factors)


def _factor(valley: Valley, step: NDArray[np.float64], i: int) -> float:
    """How many steps raise the misfit as much as one raises the parabola, at least one; as many as
    the bounds leave where those are fewer."""
    room = valley.room(step, i)
    if room <= 1.0:
        return 1.0
    enough = step @ valley.parabola @ step
    t, before, rise = 1.0, (0.0, 0.0), valley.rise(step, i)
    while rise < enough and t < room:
        before, t = (t, rise), min(LONGER * t, room)
        rise = valley.rise(t * step, i)
    if rise < enough:
        return t
    return max(1.0, float(np.interp(enough, (before[1], rise), (before[0], t))))
