"""The least-squares problem of an inspection: residuals over the noise, unknown gains eliminated.

    r = W (y - g f(theta)),   g = <W f, W y> / <W f, W f>   of each sensor without a known gain
    r = (theta - c) / s                                       of numbers between bounds

g follows theta (variable projection; the derivative is L. Kaufman's, BIT 15 (1975) 49).
An instrument of steps D rounds off (D/2)^2 at most, three times its mean D^2/12 wherever a signal
stands still; noise of a standard deviation sigma before it makes that less,

    <e^2> <= D^2/12 (1 + 2 exp(-(2 pi sigma / D)^2 / 2))

by the first term of B. Widrow and I. Kollar, Quantization Noise (2008), sec. 4.
What records do not tell stays near c, the middle of its bounds or where a record's own number
starts, with the standard deviation s of a number that lies anywhere between them.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from workflows.fit.core.calibration.fitting import rms
from workflows.fit.core.inspection.forward import IMPOSSIBLE, Shot, StructureForward, Unknowns

CONVERGED = 1e-9
HUGE = 1e3  # residual of a run that cannot be, in noise
LEAST_ROUNDING = 1e-3  # share of the noise's square: nothing below it is seen
MARGIN = 1e-9  # of the bounds' distance, inside of them


class Fitted(NamedTuple):
    """Where a fit ended; misfit is the rms of the residual over the noise."""

    theta: NDArray[np.float64]
    misfit: float
    evaluations: int
    converged: bool


class RecordFit(NamedTuple):
    """Model and records; sensors of the same `gain` (m,) share one that follows, -1 is known."""

    forward: StructureForward
    unknowns: Unknowns
    shots: tuple[Shot, ...]
    gain: NDArray[np.int64]

    @property
    def data(self) -> NDArray[np.float64]:
        """(S, k, m)"""
        return np.array([shot.y for shot in self.shots])

    @property
    def weight(self) -> NDArray[np.float64]:
        """(S, 1, m) one over the noise."""
        return 1.0 / np.array([shot.noise for shot in self.shots])[:, None]

    @property
    def rounded(self) -> float:
        """What rounding may add to the mean square of a residual over the noise, see above."""
        share = [np.max((shot.rounding / shot.noise) ** 2) for shot in self.shots]
        q = np.clip(max(share), LEAST_ROUNDING, 1.0)
        return float(2.0 * q * np.exp(-(np.pi**2) / 6.0 * (1.0 / q - 1.0)))

    def of_shots(self, shots: Sequence[int], every: int = 1) -> "RecordFit":
        """The same on some of the records, on every so many samples of them."""
        kept = (self.shots[s] for s in shots)
        thinned = tuple(one._replace(t=one.t[::every], y=one.y[::every]) for one in kept)
        return self._replace(unknowns=self.unknowns.only(shots), shots=thinned)

    def until(self, n: int) -> "RecordFit":
        """The same on the first n samples of the records."""
        shots = tuple(one._replace(t=one.t[:n], y=one.y[:n]) for one in self.shots)
        return self._replace(shots=shots)

    def gains(self, shown: NDArray[np.float64]) -> NDArray[np.float64]:
        """(m,) of signals (S, k, m) computed with the gains that the sensors say."""
        model, data = shown * self.weight, self.data * self.weight
        size, along = self._over_gains(model**2), self._over_gains(model * data)
        return np.where(self.gain >= 0, along / np.maximum(size, 1e-300), 1.0)

    def _over_gains(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """(m, ...) sums of values (S, k, m, ...) over all that has a sensor's gain."""
        return (self.gain[:, None] == self.gain) @ values.sum(axis=(0, 1))

    def residual(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """(S k m,) over the noise; huge where no run is possible."""
        try:
            shown = self.forward.signals(self.unknowns, theta, self.shots)
        except IMPOSSIBLE:
            return np.full(self.data.size, HUGE)
        return self.off(shown).ravel()

    def off(self, shown: NDArray[np.float64]) -> NDArray[np.float64]:
        """(S, k, m) residual of signals computed, the gains following."""
        return (self.gains(shown) * shown - self.data) * self.weight

    def jacobian(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """(S k m, p) by theta in scales, the gains following."""
        shown, slopes = self.forward.jacobian(self.unknowns, theta, self.shots)
        moved = (self.gains(shown) * self.weight)[..., None] * slopes
        model = shown * self.weight
        size = np.maximum(self._over_gains(model**2), 1e-300)
        share = self._over_gains(model[..., None] * moved) / size[:, None]
        share[self.gain < 0] = 0.0
        return (moved - model[..., None] * share).reshape(-1, moved.shape[-1])

    def misfit(self, theta: NDArray[np.float64]) -> float:
        """rms of the residual over the noise."""
        return rms(self.residual(theta))

    def solved(
        self,
        theta: NDArray[np.float64],
        most: int = 40,
        tolerance: float = CONVERGED,
        about: NDArray[np.float64] | None = None,
    ) -> Fitted:
        """The least misfit from theta (p,) on, over the numbers that the records take; what they
        do not tell is drawn to `about` (p,) in place of the middle of the bounds."""
        scale, (low, high) = self.unknowns.scale, self.unknowns.ends()
        free = np.unique([*self.unknowns.of_system.ravel(), *self.unknowns.trigger])
        centre = (self.unknowns.centre if about is None else about) / scale
        pull = np.diag(self.unknowns.pull * scale)[:, free]
        margin = MARGIN * (high - low)
        begin = np.clip(theta, low + margin, high - margin)

        def whole(part):
            full = begin.copy()
            full[free] = part * scale[free]
            return full

        def residual(part):
            return np.concatenate([self.residual(whole(part)), pull @ (part - centre[free])])

        found = least_squares(
            residual,
            begin[free] / scale[free],
            lambda part: np.vstack([self.jacobian(whole(part))[:, free], pull]),
            bounds=(low[free] / scale[free], high[free] / scale[free]),
            xtol=tolerance, ftol=tolerance, gtol=1e-15, max_nfev=most,
        )  # fmt: skip
        return Fitted(
            whole(found.x), rms(found.fun[: self.data.size]), found.nfev, found.status > 0
        )
