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

LONGER = 1.5  # factor from one trial of t to the next, until the misfit has risen enough


class Valley(NamedTuple):
    """The bottom of a valley at theta (p,), with J (n, p) of the residual there, in scales."""

    fit: RecordFit
    theta: NDArray[np.float64]
    J: NDArray[np.float64]

    @property
    def parabola(self) -> NDArray[np.float64]:
        """J^T J + B (p, p): squares of data and bounds together rise as u^T (..) u."""
        return self.J.T @ self.J + np.diag(self._pull**2)

    @property
    def _pull(self) -> NDArray[np.float64]:
        """(p,) one over the standard deviation that the bounds leave, in scales."""
        return self.fit.unknowns.pull * self.fit.unknowns.scale

    def residual(self, step: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n + p,) residual of the data and of the bounds, a step (p,) in scales away; the step
        ends at the bounds."""
        low, high = self.fit.unknowns.ends()
        theta = np.clip(self.theta + step * self.fit.unknowns.scale, low, high)
        off = (theta - self.fit.unknowns.centre) / self.fit.unknowns.scale
        return np.concatenate([self.fit.residual(theta), self._pull * off])

    def rise(self, step: NDArray[np.float64], i: int) -> float:
        """Rise of the squares where number i has moved by a step (p,) and the others follow.

        The others begin where the step puts them and where they were, and from both take one
        Gauss-Newton step with number i fixed; the profile is the least of these four sums.
        """
        others = np.delete(np.eye(len(step)), i, axis=1)  # (p, p - 1) directions of the others
        J = np.vstack([self.J, np.diag(self._pull)])
        gauss_newton = others @ np.linalg.solve(
            others.T @ self.parabola @ others, (J @ others).T
        )  # (p, n + p)
        bottom = np.sum(self.residual(0.0 * step) ** 2)
        squares = []
        for begin in (step, np.where(np.arange(len(step)) == i, step, 0.0)):
            r = self.residual(begin)
            squares.append(min(np.sum(r**2), np.sum(self.residual(begin - gauss_newton @ r) ** 2)))
        return float(min(squares) - bottom)

    def room(self, step: NDArray[np.float64], i: int) -> float:
        """How many such steps the bounds of number i leave."""
        low, high = self.fit.unknowns.ends()
        end = high[i] if step[i] > 0 else low[i]
        return float((end - self.theta[i]) / (step[i] * self.fit.unknowns.scale[i]))


def stretched(
    fit: RecordFit,
    theta: NDArray[np.float64],
    J: NDArray[np.float64],
    bars: Uncertainty,
    n_shared: int,
) -> tuple[Uncertainty, float]:
    """The uncertainty of theta (p,), gains behind it, with the bars of the first n_shared numbers
    as long as the misfit says, and the largest t. J (n, p) of the fit's residual in scales."""
    p, valley = len(theta), Valley(fit, theta, J)
    scale = np.ones(len(bars.two_sigma))
    scale[:p] = fit.unknowns.scale
    covariance = bars.covariance / np.outer(scale, scale)
    sigma = np.sqrt(np.diag(covariance))

    # number i by two sigma, the others by what goes along with it: u = 2 cov_i / sigma_i
    factors = []
    for i in range(n_shared):
        u = 2.0 * covariance[:p, i] / sigma[i]
        factors.append(max(stretch_factor(valley, way * u, i) for way in (1, -1)))
    if max(factors) == 1.0:
        return bars, 1.0
    for i, factor in enumerate(factors):
        covariance[i, i] *= factor**2
    longer = bars._replace(
        covariance=covariance * np.outer(scale, scale),
        two_sigma=2.0 * np.sqrt(np.diag(covariance)) * scale,
        combinations=combinations(covariance, covariance[:0], np.ones(len(scale), bool)),
    )
    return longer, max(factors)


def stretch_factor(valley: Valley, step: NDArray[np.float64], i: int) -> float:
    """t: how many steps (p,) raise the misfit as much as one raises the parabola, at least one; as
    many as the bounds leave where those are fewer."""
    room = valley.room(step, i)
    if room <= 1.0:
        return 1.0
    enough = step @ valley.parabola @ step
    t, t_before, rise_before, rise = 1.0, 0.0, 0.0, valley.rise(step, i)
    while rise < enough and t < room:
        t_before, rise_before = t, rise
        t = min(LONGER * t, room)
        rise = valley.rise(t * step, i)
    if rise < enough:
        return t
    return max(1.0, float(np.interp(enough, (rise_before, rise), (t_before, t))))
