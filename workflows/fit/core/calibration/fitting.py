"""One least-squares problem of a calibration, on any windows of the signals and any parameters.

What varies is z, the parameters in their scales (`parameters.coordinates`). While a wave has not
come by yet, contacts ahead of it are held near where they were by a weak spring: PRIOR of the noise
for a change of one scale.
"""

from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from dem import InvalidChain, NoEquilibrium
from workflows.fit.core.calibration.forward import ChainForward
from workflows.fit.core.calibration.parameters import coordinates, slopes, values

PRIOR = 3e-5  # of the fastest sphere, in the rms misfit
CONVERGED = 1e-10
IMPOSSIBLE = 1e3  # residual of a run that cannot be, over the fastest sphere
CLOSE = 4  # contacts, between the ends of a cycle
DISTINCT = 0.1  # scales between two contacts that are worth a swap


class Solution(NamedTuple):
    """Where a fit ended: z (p,), rms misfit of the windows [m/s], model runs, whether it ended of
    itself."""

    z: np.ndarray
    misfit: float
    evaluations: int
    converged: bool


class WindowFit:
    """Data, weights and model; a problem is these on windows (k, m) with free parameters (p,)."""

    def __init__(self, forward: ChainForward) -> None:
        self.forward, self.parameters = forward, forward.parameters
        self.data, self.weights = forward.signals.v, weights(forward.signals.spread)
        ends = (np.array([getattr(p, b) for p in self.parameters]) for b in ("low", "high"))
        self.low, self.high = (coordinates(self.parameters, end) for end in ends)
        self.largest = float(np.abs(self.data).max())

    def residual(self, z: np.ndarray, windows: np.ndarray) -> np.ndarray:
        """Weighted difference to the data inside the windows; huge where no run is possible."""
        k = self.forward.needed(windows)
        try:
            model = self.forward.velocities(values(self.parameters, z), k)
        except (InvalidChain, NoEquilibrium):
            return np.full(int(windows.sum()), IMPOSSIBLE * self.largest)
        return ((model - self.data[:k]) * self.weights)[windows[:k]]

    def jacobian(self, z: np.ndarray, windows: np.ndarray) -> np.ndarray:
        """(samples, p) by z."""
        k, theta = self.forward.needed(windows), values(self.parameters, z)
        dv = self.forward.velocities_and_sensitivities(theta, k)[1] * self.weights[:, None]
        return dv[windows[:k]] * slopes(self.parameters, theta)

    def misfit(self, z: np.ndarray, windows: np.ndarray) -> float:
        """rms [m/s]"""
        return rms(self.residual(z, windows))

    def solved(
        self,
        z: np.ndarray,
        free: np.ndarray,
        windows: np.ndarray,
        *,
        most: int = 60,
        prior: bool = False,
        tolerance: float = CONVERGED,
    ) -> Solution:
        """The least misfit on the windows from z on; parameters that are not free stay."""
        if not free.any():
            return Solution(z, self.misfit(z, windows), 0, True)
        low, high, begin = self.low[free], self.high[free], z[free]
        spring = PRIOR * self.largest * np.sqrt(windows.sum()) if prior else 0.0

        def whole(part):
            full = z.copy()
            full[free] = part
            return full

        def residual(part):
            return np.concatenate([self.residual(whole(part), windows), spring * (part - begin)])

        def slope(part):
            J = self.jacobian(whole(part), windows)[:, free]
            return np.vstack([J, spring * np.eye(len(part))])

        margin = 1e-9 * (high - low)
        found = least_squares(
            residual, np.clip(begin, low + margin, high - margin), slope, bounds=(low, high),
            xtol=tolerance, ftol=tolerance, gtol=1e-15, max_nfev=most,
        )  # fmt: skip
        misfit = rms(found.fun[: windows.sum()])
        return Solution(whole(found.x), misfit, found.nfev, found.status > 0)

    def swapped(
        self, z: np.ndarray, free: np.ndarray, windows: np.ndarray, *, cycles: bool = False
    ) -> list[tuple[float, np.ndarray]]:
        """Every swap of two contacts, or every cycle of three that lie close: the misfit to
        first order once the rest has followed, and z with the swap; the best first."""
        Q, _ = np.linalg.qr(self.jacobian(z, windows)[:, free])
        contacts = [i for i, p in enumerate(self.parameters) if p.kind == "contact" and free[i]]
        found = []
        for order in _cycles(contacts) if cycles else combinations(contacts, 2):
            other = z.copy()
            other[list(order)] = z[[*order[1:], order[0]]]
            if np.abs(other - z).max() < DISTINCT:
                continue
            r = self.residual(other, windows)
            found.append((rms(r - Q @ (Q.T @ r)), other))
        return sorted(found, key=lambda pair: pair[0])


def _cycles(contacts: list[int]):
    """Both cycles of any three contacts within CLOSE of each other."""
    for i, j, k in combinations(contacts, 3):
        if k - i <= CLOSE:
            yield i, j, k
            yield i, k, j


def weights(spread: np.ndarray) -> np.ndarray:
    """(m,) one over the noise of each sphere, relative to the rms; equal where it is unknown."""
    if not np.all(np.isfinite(spread)) or spread.min(initial=np.inf) <= 0.0:
        return np.ones(len(spread))
    return np.sqrt(np.mean(spread**2)) / np.maximum(spread, 0.1 * spread.max())


def rms(residual: np.ndarray) -> float:
    """0 of nothing."""
    return float(np.sqrt(np.mean(residual**2))) if residual.size else 0.0
