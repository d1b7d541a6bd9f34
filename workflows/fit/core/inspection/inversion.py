"""Numbers of a structure from records of its waves, with what the records do not tell.

Bars hold noise that is correlated from sample to sample, see
`workflows.fit.core.calibration.uncertainty`; gains that nobody knows count among the numbers there.
What the records do not tell lies anywhere between its bounds: a number that has run into one keeps
its bar, and lengthens those of others.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from coupling.errors import CouplingError
from workflows.fit.core.calibration.fitting import rms
from workflows.fit.core.calibration.parameters import Parameter
from workflows.fit.core.calibration.uncertainty import Uncertainty, uncertainty
from workflows.fit.core.inspection.fitting import RecordFit
from workflows.fit.core.inspection.information import bounds_information
from workflows.fit.core.inspection.profile import stretched
from workflows.fit.core.inspection.search import Searched, searched

GAIN_SCALE = 0.1  # of a gain: a change that counts as large
AT_BOUND = 1e-6  # of the bounds' distance
PARTS = 50  # of a record, in which what is left must be noise
KNOWN = 1.15  # of the noise's square: its rms is known to some per cent
DEVIATIONS = 5.0  # of what noise leaves
RIVAL = 16.0  # squares of the noise: answers that records do not tell apart
REFINED = 0.5  # steps of the run that tells the error of the answer's


class RecordPart(NamedTuple):
    """What is left in a part of a record."""

    record: int  # counted from 0
    begin: float  # [s]
    end: float  # [s]
    misfit: float  # rms over the noise


class Inversion(NamedTuple):
    """What was found; gains follow the numbers in `parameters` and `value`."""

    parameters: tuple[Parameter, ...]  # (p,)
    value: NDArray[np.float64]  # (p,)
    at_bound: NDArray[np.bool_]  # (p,)
    uncertainty: Uncertainty
    gains: NDArray[np.float64]  # (m,)
    model: NDArray[np.float64]  # (S, k, m) with what was found
    misfit: NDArray[np.float64]  # (S, m) rms of the residual over the noise
    slopes: NDArray[np.float64]  # (S, k, m, p) by the numbers in scales, over the noise
    memory: float  # variance of the residual over that of its differences: 1 of white noise
    parts: tuple[RecordPart, ...]  # of all records
    step_error: float  # largest change of the model with half the step, over the noise
    search: Searched
    rounded: float = 0.0  # what rounding may add to the mean square, over the noise's
    stretch: float = 1.0  # largest, of a bar by the profile of the misfit

    @property
    def whole_misfit(self) -> float:
        """rms over the noise, of all records."""
        return float(np.sqrt(np.mean(self.misfit**2)))

    @property
    def explained(self) -> bool:
        """Whether all that is left, and what is left in every part of a record, may be noise."""
        worst = max(part.misfit for part in self.parts)
        n = self.model.size
        return self._noise(self.whole_misfit, n) and self._noise(worst, n // len(self.parts))

    def _noise(self, misfit: float, n: int) -> bool:
        deviation = np.sqrt(2.0 * max(self.memory, 1.0) / max(n, 1))
        return misfit**2 <= KNOWN + self.rounded + DEVIATIONS * deviation

    def rivals(self, others: Sequence["Inversion"], n_shared: int) -> tuple["Inversion", ...]:
        """Those of other answers, farther off than their bars, that leave as little."""
        found: list[Inversion] = []
        for other in others:
            excess = self.model.size * (other.whole_misfit**2 / self.whole_misfit**2 - 1.0)
            near = excess <= RIVAL * max(self.memory, 1.0)
            if near and all(other.apart(one, n_shared) for one in (self, *found)):
                found.append(other)
        return tuple(found)

    def apart(self, other: "Inversion", n_shared: int) -> bool:
        """Whether a number of the structure differs by more than the bars hold."""
        bars = self.uncertainty.two_sigma
        return bool((np.abs(self.value - other.value) > bars)[:n_shared].any())


def inverted(
    fit: RecordFit,
    *,
    n_shared: int,
    starts: int = 6,
    seed: int = 0,
    gains: Sequence[str] = (),
    begin: NDArray[np.float64] | None = None,
) -> Inversion:
    """The numbers that leave the least, of up to so many starts, or from `begin` (p,) on.

    `gains` names those that follow. Raises CouplingError where nothing can be computed.
    """
    if fit.data.size <= len(fit.unknowns.parameters):
        raise CouplingError(
            f"{fit.data.size} samples do not determine {len(fit.unknowns.parameters)} numbers."
        )
    if begin is None:
        return _answer(fit, searched(fit, n_shared=n_shared, starts=starts, seed=seed), gains)
    return _answer(fit, Searched((fit.solved(begin),), 1, fit.forward), gains)


def profiled(fit: RecordFit, found: Inversion, n_shared: int) -> Inversion:
    """The same with bars of the structure's numbers as long as the misfit says."""
    theta = found.value[: len(fit.unknowns.parameters)]
    bars, stretch = stretched(fit, theta, fit.jacobian(theta), found.uncertainty, n_shared)
    return found._replace(uncertainty=bars, stretch=stretch)


def _answer(fit: RecordFit, search: Searched, names: Sequence[str]) -> Inversion:
    fit = fit._replace(forward=search.forward)
    theta = search.fitted.theta
    shown, slopes = fit.forward.jacobian(fit.unknowns, theta, fit.shots)
    gains = fit.gains(shown)
    of_gains = [_gain(name, gains[fit.gain == i][0]) for i, name in enumerate(names)]
    parameters = (*fit.unknowns.parameters, *of_gains)
    value = np.array([*theta, *(p.start for p in of_gains)])
    of_sensor = GAIN_SCALE * (fit.gain[:, None] == np.arange(len(names)))
    by_gains = (gains * shown)[..., None] * of_sensor
    whole = np.concatenate([gains[:, None] * slopes, by_gains], axis=-1)
    whole *= fit.weight[..., None]
    residual = (gains * shown - fit.data) * fit.weight
    finer = fit.forward.with_steps(REFINED).signals(fit.unknowns, theta, fit.shots)
    return Inversion(
        parameters, value, _at_bound(parameters, value),
        uncertainty(
            parameters, _columns(residual), _columns(whole) / scales(parameters),
            np.zeros(len(parameters), bool), bounds_information(parameters),
        ),
        gains, gains * shown, np.sqrt(np.mean(residual**2, axis=1)), whole, _memory(residual),
        _parts(fit, residual), float(np.abs(gains * (finer - shown) * fit.weight).max()), search,
        fit.rounded,
    )  # fmt: skip


def scales(parameters: Sequence[Parameter]) -> NDArray[np.float64]:
    """(p,)"""
    return np.array([p.scale for p in parameters])


def _gain(name: str, found: float) -> Parameter:
    """A gain that nobody knew as a number that was found."""
    return Parameter(name, "gain", float(found), 0.0, np.inf, GAIN_SCALE * abs(found) or 1.0)


def _columns(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """(k, S m, ...) of values (S, k, m, ...)."""
    moved = np.moveaxis(values, 0, 1)
    return moved.reshape(moved.shape[0], -1, *values.shape[3:])


def _at_bound(parameters, value) -> NDArray[np.bool_]:
    low, high = (np.array([getattr(p, end) for p in parameters]) for end in ("low", "high"))
    near = AT_BOUND * (high - low)
    return np.isfinite(near) & ((value - low <= near) | (high - value <= near))


def _parts(fit: RecordFit, residual: NDArray[np.float64]) -> tuple[RecordPart, ...]:
    """What is left of each record, from first to last, in parts of equal lengths."""
    cuts = np.array_split(np.arange(residual.shape[1]), min(PARTS, residual.shape[1]))
    return tuple(
        RecordPart(s, float(shot.t[cut[0]]), float(shot.t[cut[-1]]), rms(residual[s, cut]))
        for s, shot in enumerate(fit.shots)
        for cut in cuts
    )


def _memory(residual: NDArray[np.float64]) -> float:
    """J. von Neumann, Ann. Math. Stat. 12 (1941) 367."""
    steps = rms(np.diff(residual, axis=1)) ** 2 / 2.0
    return rms(residual) ** 2 / steps if steps > 0 else np.inf
