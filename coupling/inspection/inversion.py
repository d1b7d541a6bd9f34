"""Numbers of a structure from records of its waves, with what the records do not tell.

Bars hold noise that is correlated from sample to sample, see `coupling.calibration.uncertainty`;
gains that nobody knows count among the numbers there. What the records do not tell lies anywhere
between its bounds: a number that has run into one keeps its bar, and lengthens those of others.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from coupling.calibration.fitting import rms
from coupling.calibration.parameters import Parameter
from coupling.calibration.uncertainty import Uncertainty, uncertainty
from coupling.errors import CouplingError
from coupling.inspection.fitting import Fit
from coupling.inspection.information import bounds_information
from coupling.inspection.search import Searched, searched

GAIN_SCALE = 0.1  # of a gain: a change that counts as large
AT_BOUND = 1e-6  # of the bounds' distance
REFINED = 0.5  # steps of the run that tells the error of the answer's


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
    step_error: float  # largest change of the model with half the step, over the noise
    search: Searched

    @property
    def whole_misfit(self) -> float:
        """rms over the noise, of all records."""
        return float(np.sqrt(np.mean(self.misfit**2)))


def inverted(
    fit: Fit,
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
    found = fit.solved(begin)
    none = np.zeros((0, n_shared)), np.zeros(0)
    return _answer(fit, Searched(found, 1, 1, *none), gains)


def _answer(fit: Fit, search: Searched, names: Sequence[str]) -> Inversion:
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
        float(np.abs(gains * (finer - shown) * fit.weight).max()), search,
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


def _memory(residual: NDArray[np.float64]) -> float:
    """J. von Neumann, Ann. Math. Stat. 12 (1941) 367."""
    steps = rms(np.diff(residual, axis=1)) ** 2 / 2.0
    return rms(residual) ** 2 / steps if steps > 0 else np.inf
