"""The least-squares problem of an inspection: residuals over the noise, unknown gains eliminated.

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

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflows.fit.core import least_squares
from workflows.fit.core.inspection.forward import Shot, StructureForward, Unknowns
from workflows.fit.core.least_squares import IMPOSSIBLE, Solution, rms

HUGE = 1e3  # residual over the noise that stands for a run that is impossible
LEAST_ROUNDING = 1e-3  # share of the noise's square below which exp(..) has long vanished


class RecordFit(NamedTuple):
    """Model and records; sensors of the same `gain` (m,) share one that follows, -1 is known."""

    forward: StructureForward
    unknowns: Unknowns
    shots: tuple[Shot, ...]
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
        """What rounding may add to the mean square of a residual over the noise, of the record that
        shows most of it: 2 q exp(-pi^2/6 (1/q - 1)) with q the share of D^2/12 in the noise, whose
        square is sigma^2 + D^2/12."""
        shares = [np.max((shot.rounding / shot.noise) ** 2) for shot in self.shots]
        q = np.clip(max(shares), LEAST_ROUNDING, 1.0)
        return float(2.0 * q * np.exp(-(np.pi**2) / 6.0 * (1.0 / q - 1.0)))

    def of_shots(self, shots: Sequence[int], stride: int = 1) -> "RecordFit":
        """The same problem on these records, on every stride-th sample of them."""
        chosen = (self.shots[s] for s in shots)
        thinned = tuple(shot._replace(t=shot.t[::stride], y=shot.y[::stride]) for shot in chosen)
        return self._replace(unknowns=self.unknowns.only(shots), shots=thinned)

    def until(self, n: int) -> "RecordFit":
        """The same problem on the first n samples of the records."""
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
        free = np.zeros(len(scale), bool)
        free[self.unknowns.of_system] = free[self.unknowns.trigger] = True
        centre = self.unknowns.centre if about is None else about
        solution = least_squares.solved(
            lambda z: self.residual(z * scale), lambda z: self.jacobian(z * scale),
            theta / scale, free, (low / scale, high / scale),
            self.unknowns.pull * scale, centre / scale, max_runs=max_runs, tolerance=tolerance,
        )  # fmt: skip
        return solution._replace(point=solution.point * scale)
