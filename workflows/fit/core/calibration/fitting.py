"""One least-squares problem of a calibration, on any windows of the signals and any parameters.

What varies is z, the parameters in their scales (`parameters.coordinates`). While a wave has not
come by yet, contacts ahead of it are kept near where they were by a weak spring: a change of one
scale counts as a misfit of PRIOR of the fastest sphere.
"""

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from dem import InvalidChain, NoEquilibrium
from workflows.fit.core import least_squares
from workflows.fit.core.calibration.forward import ChainForward
from workflows.fit.core.calibration.parameters import coordinates, ends, slopes, values
from workflows.fit.core.least_squares import Solution, rms

PRIOR = 3e-5  # rms of a parameter one scale off its start, over the fastest sphere
CONVERGED = 1e-10  # relative fall of the misfit, or step, at which a fit ends
IMPOSSIBLE = 1e3  # residual over the fastest sphere that stands for a run that is impossible
CLOSE = 4  # contacts between the ends of a cycle of three, at most
DISTINCT = 0.1  # scales between two contacts below which a swap changes nothing


class WindowFit:
    """Data, weights and model; a problem is these on windows (k, m) with free parameters (p,)."""

    def __init__(self, forward: ChainForward) -> None:
        self.forward, self.parameters = forward, forward.parameters
        self.data, self.weights = forward.signals.v, weights(forward.signals.spread)
        self.low, self.high = (coordinates(self.parameters, end) for end in ends(self.parameters))
        self.largest = float(np.abs(self.data).max())

    def residual(self, z: np.ndarray, windows: np.ndarray) -> np.ndarray:
        """(samples,) weighted difference of model and data inside the windows [m/s]; huge where no
        run is possible."""
        k = self.forward.needed(windows)
        try:
            model = self.forward.velocities(values(self.parameters, z), k)
        except (InvalidChain, NoEquilibrium):
            return np.full(int(windows.sum()), IMPOSSIBLE * self.largest)
        return ((model - self.data[:k]) * self.weights)[windows[:k]]

    def jacobian(self, z: np.ndarray, windows: np.ndarray) -> np.ndarray:
        """(samples, p) derivatives of the residual by z."""
        k, theta = self.forward.needed(windows), values(self.parameters, z)
        dv = self.forward.velocities_and_sensitivities(theta, k)[1] * self.weights[:, None]
        return dv[windows[:k]] * slopes(self.parameters, theta)

    def misfit(self, z: np.ndarray, windows: np.ndarray) -> float:
        """rms of the residual [m/s]."""
        return rms(self.residual(z, windows))

    def solved(
        self,
        z: np.ndarray,
        free: np.ndarray,
        windows: np.ndarray,
        *,
        max_runs: int = 60,
        prior: bool = False,
        tolerance: float = CONVERGED,
    ) -> Solution:
        """The least misfit on the windows from z (p,) on, by `max_runs` of the model at most;
        parameters that are not free stay. With a prior, a weak spring pulls each to its start."""
        if not free.any():
            return Solution(z, self.misfit(z, windows), 0, True)
        spring = PRIOR * self.largest * np.sqrt(windows.sum()) if prior else 0.0
        return least_squares.solved(
            lambda z: self.residual(z, windows), lambda z: self.jacobian(z, windows),
            z, free, (self.low, self.high), np.full(len(z), spring), z,
            max_runs=max_runs, tolerance=tolerance,
        )  # fmt: skip

    def swapped(
        self, z: np.ndarray, free: np.ndarray, windows: np.ndarray, *, cycles: bool = False
    ) -> list[tuple[float, np.ndarray]]:
        """Every swap of two contacts, or every cycle of three that lie close: the misfit to
        first order once the rest has followed, and z (p,) with the swap; the best first.

        The rest takes with it what lies in the span of the Jacobian: r - Q Q^T r is left.
        """
        Q, _ = np.linalg.qr(self.jacobian(z, windows)[:, free])
        contacts = [i for i, p in enumerate(self.parameters) if p.kind == "contact" and free[i]]
        swaps = []
        for order in three_cycles(contacts) if cycles else combinations(contacts, 2):
            z_swapped = z.copy()
            z_swapped[list(order)] = z[[*order[1:], order[0]]]
            if np.abs(z_swapped - z).max() < DISTINCT:
                continue
            r = self.residual(z_swapped, windows)
            swaps.append((rms(r - Q @ (Q.T @ r)), z_swapped))
        return sorted(swaps, key=lambda pair: pair[0])


def three_cycles(contacts: list[int]) -> Iterator[tuple[int, int, int]]:
    """Both cycles of any three contacts within CLOSE of each other."""
    for i, j, k in combinations(contacts, 3):
        if k - i <= CLOSE:
            yield i, j, k
            yield i, k, j


def weights(spread: np.ndarray) -> np.ndarray:
    """Weight of each sphere (m,): one over its noise, relative to the rms; 1 where it is unknown.
    No sphere counts as less noisy than a tenth of the noisiest."""
    if not np.all(np.isfinite(spread)) or spread.min(initial=np.inf) <= 0.0:
        return np.ones(len(spread))
    return np.sqrt(np.mean(spread**2)) / np.maximum(spread, 0.1 * spread.max())
