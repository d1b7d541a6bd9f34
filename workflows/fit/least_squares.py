"""Least squares between bounds: the wrapper that every fit uses, and the two problems.

    minimise  |r(z)|^2 + |pull (z - centre)|^2,   low <= z <= high

by Gauss-Newton steps in a trust region (M. A. Branch, T. F. Coleman, Y. Li, SIAM J. Sci. Comput. 21
(1999) 1). The second term is what is known besides the data: a number that the data say nothing of
stays at its centre, where it would otherwise take any value.

`WindowFit` is the problem of a calibration on any windows of the signals; z are the parameters in
their scales (`coordinates`). While a wave has not come by yet, contacts ahead of it are kept near
where they were by a weak spring: a change of one scale counts as a misfit of PRIOR of the fastest
sphere.

`RecordFit` is the problem of an inspection, its residuals over the noise, unknown gains eliminated:

    r = W (y - g f(theta)),   g = <W f, W y> / <W f, W f>   of each sensor without a known gain
    r = (theta - c) / s                                       of numbers between bounds

g follows theta (variable projection; the derivative is L. Kaufman's, BIT 15 (1975) 49).
An instrument of steps D rounds off (D/2)^2 at most, three times its mean D^2/12 wherever a signal
stands still; noise of a standard deviation sigma before it makes that less,

    <e^2> <= D^2/12 (1 + 2 exp(-(2 pi sigma / D)^2 / 2))

by the first term of B. Widrow and I. Kollar, Quantization Noise (2008), sec. 4.
What records do not determine stays near c, the middle of its bounds or where a record's own number
starts, with the standard deviation s of a number that lies anywhere between them.
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from beadwave.coupling.errors import CouplingError
from beadwave.dem import InvalidChain, NoEquilibrium, UnstableStep
from beadwave.workflows.fit.forward import ChainForward, MeasuredRecord, StructureForward, Unknowns
from beadwave.workflows.fit.parameter import coordinates, ends, slopes, values

# what a model raises for values that cannot be marched: a run that is impossible, not an error
IMPOSSIBLE = (CouplingError, InvalidChain, NoEquilibrium, UnstableStep)
MARGIN = 1e-9  # of the bounds' distance: least_squares must begin strictly inside


class Solution(NamedTuple):
    """End of a fit, and whether it converged before its largest number of runs."""

    point: NDArray[np.float64]  # (p,) in the coordinates of the problem
    misfit: float  # rms of the residual, without the pull
    evaluations: int  # of the residual
    converged: bool


class Pull(NamedTuple):
    """Knowledge besides the data: springs that pull each coordinate to a centre."""

    stiffness: NDArray[np.float64]  # (p,) residual of a coordinate that is 1 off; 0 of a free one
    centre: NDArray[np.float64]  # (p,)


def solved(
    residual: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    jacobian: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    start: NDArray[np.float64],
    free: NDArray[np.bool_],
    bounds: tuple[NDArray[np.float64], NDArray[np.float64]],
    pull: Pull,
    *,
    max_runs: int,
    tolerance: float,
) -> Solution:
    """The least misfit from z = `start` (p,) on, by `max_runs` of the model at most.

    `residual` (n,) and `jacobian` (n, p) are functions of z; what is not `free` (p,) stays where it
    starts. Ends where misfit or step fall by less than `tolerance`, relative.
    """
    low, high = (end[free] for end in bounds)
    margin = MARGIN * (high - low)

    # the pull as further rows of the residual, S (x - c), whose squares least_squares adds
    springs, centre = np.diag(pull.stiffness[free]), pull.centre[free]

    def full(x):
        """z (p,) of the free coordinates x."""
        z = start.copy()
        z[free] = x
        return z

    # gtol is out of reach: a gradient has the unit of the squares, so no one value of it fits all
    solution = least_squares(
        lambda x: np.concatenate([residual(full(x)), springs @ (x - centre)]),
        np.clip(start[free], low + margin, high - margin),
        lambda x: np.vstack([jacobian(full(x))[:, free], springs]),
        bounds=(low, high), xtol=tolerance, ftol=tolerance, gtol=1e-15, max_nfev=max_runs,
    )  # fmt: skip
    misfit = rms(solution.fun[: len(solution.fun) - len(springs)])
    return Solution(full(solution.x), misfit, solution.nfev, solution.status > 0)


def rms(residual: NDArray[np.float64]) -> float:
    """Root mean square; 0 for an empty array."""
    return float(np.sqrt(np.mean(residual**2))) if residual.size else 0.0


PRIOR = 3e-5  # rms of a parameter one scale off its start, over the fastest sphere
IMPOSSIBLE_RESIDUAL = (
    1e3  # residual over the fastest sphere that stands for a run that is impossible
)
CLOSE = 4  # contacts between the ends of a cycle of three, at most


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
            return np.full(int(windows.sum()), IMPOSSIBLE_RESIDUAL * self.largest)
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
        tolerance: float = 1e-10,  # relative fall of the misfit, or step, at which it ends
    ) -> Solution:
        """The least misfit on the windows from z (p,) on, by `max_runs` of the model at most;
        parameters that are not free stay. With a prior, a weak spring pulls each to its start."""
        if not free.any():
            return Solution(z, self.misfit(z, windows), 0, True)

        # sqrt(samples): the square of the spring is next to the sum over all samples of the windows
        spring = PRIOR * self.largest * np.sqrt(windows.sum()) if prior else 0.0
        return solved(
            lambda z: self.residual(z, windows), lambda z: self.jacobian(z, windows),
            z, free, (self.low, self.high), Pull(np.full(len(z), spring), z),
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
            # a swap of contacts that differ by less than 0.1 scales changes nothing
            if np.abs(z_swapped - z).max() < 0.1:
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


HUGE = 1e3  # residual over the noise that stands for a run that is impossible


class RecordFit(NamedTuple):
    """Model and records; sensors of the same `gain` (m,) share one that follows, -1 is known."""

    forward: StructureForward
    unknowns: Unknowns
    shots: tuple[MeasuredRecord, ...]
    gain: NDArray[np.int64]

    @property
    def data(self) -> NDArray[np.float64]:
        """Signals of the S records, (S, k, m), in the sensors' units."""
        return np.array([shot.y for shot in self.shots])

    @property
    def weight(self) -> NDArray[np.float64]:
        """(S, 1, m) one over the noise of each record and sensor."""
        return 1.0 / np.array([shot.noise for shot in self.shots])[:, None]

    @property
    def rounded(self) -> float:
        """Largest effect of rounding on the mean square of a residual over the noise, of the record
        that shows most of it: 2 q exp(-pi^2/6 (1/q - 1)) with q the share of D^2/12 in the noise,
        whose square is sigma^2 + D^2/12."""
        shares = [np.max((shot.rounding / shot.noise) ** 2) for shot in self.shots]
        # 1e-3: share of the noise's square below which exp(..) has long vanished
        q = np.clip(max(shares), 1e-3, 1.0)
        return float(2.0 * q * np.exp(-(np.pi**2) / 6.0 * (1.0 / q - 1.0)))

    def of_shots(self, shots: Sequence[int], stride: int = 1) -> "RecordFit":
        """The problem on these records, on every stride-th sample of them."""
        chosen = (self.shots[s] for s in shots)
        thinned = tuple(shot._replace(t=shot.t[::stride], y=shot.y[::stride]) for shot in chosen)
        return self._replace(unknowns=self.unknowns.only(shots), shots=thinned)

    def until(self, n: int) -> "RecordFit":
        """The problem on the first n samples of the records."""
        shots = tuple(shot._replace(t=shot.t[:n], y=shot.y[:n]) for shot in self.shots)
        return self._replace(shots=shots)

    def gains(self, signals: NDArray[np.float64]) -> NDArray[np.float64]:
        """(m,) least-squares gains of signals (S, k, m) computed with the sensors' nominal ones;
        1 where the gain is known."""
        model, data = signals * self.weight, self.data * self.weight
        size, product = self._over_gains(model**2), self._over_gains(model * data)
        return np.where(self.gain >= 0, product / np.maximum(size, 1e-300), 1.0)

    def _over_gains(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """(m, ...) sums of values (S, k, m, ...) over all records, samples and sensors that have
        the gain of each sensor."""
        return (self.gain[:, None] == self.gain) @ values.sum(axis=(0, 1))

    def residual(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """(S k m,) over the noise; HUGE where no run is possible."""
        try:
            signals = self.forward.signals(self.unknowns, theta, self.shots)
        except IMPOSSIBLE:
            return np.full(self.data.size, HUGE)
        return self.off(signals).ravel()

    def off(self, signals: NDArray[np.float64]) -> NDArray[np.float64]:
        """(S, k, m) residual over the noise of computed signals (S, k, m), the gains following."""
        return (self.gains(signals) * signals - self.data) * self.weight

    def jacobian(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """(S k m, p) derivatives of the residual by theta in scales, the gains following."""
        signals, slopes = self.forward.jacobian(self.unknowns, theta, self.shots)
        J = (self.gains(signals) * self.weight)[..., None] * slopes

        # Kaufman: less what a change of the gain itself would undo, f <f, J> / <f, f>
        model = signals * self.weight
        size = np.maximum(self._over_gains(model**2), 1e-300)
        share = self._over_gains(model[..., None] * J) / size[:, None]
        share[self.gain < 0] = 0.0
        return (J - model[..., None] * share).reshape(-1, J.shape[-1])

    def misfit(self, theta: NDArray[np.float64]) -> float:
        """rms of the residual over the noise."""
        return rms(self.residual(theta))

    def solved(
        self,
        theta: NDArray[np.float64],
        max_runs: int = 40,
        tolerance: float = 1e-9,
        about: NDArray[np.float64] | None = None,
    ) -> Solution:
        """The least misfit from theta (p,) on, over the numbers that the records depend on.

        `max_runs` of the model at most; ends where misfit or step fall by less than `tolerance`,
        relative. What the records do not determine is drawn to `about` (p,) in place of the middle
        of the bounds.
        """
        scale, (low, high) = self.unknowns.scale, self.unknowns.ends()

        # numbers of records that are not among these stay: they would only follow the pull
        free = np.zeros(len(scale), bool)
        free[self.unknowns.of_system] = free[self.unknowns.trigger] = True
        centre = self.unknowns.centre if about is None else about
        solution = solved(
            lambda z: self.residual(z * scale), lambda z: self.jacobian(z * scale),
            theta / scale, free, (low / scale, high / scale),
            Pull(self.unknowns.pull * scale, centre / scale),
            max_runs=max_runs, tolerance=tolerance,
        )  # fmt: skip
        return solution._replace(point=solution.point * scale)
