"""Parameters of a chain and its wall fitted to measured velocities.

    minimise  sum over windows  ((model(theta) - data) / noise)^2,   low <= theta <= high

by Gauss-Newton steps in a trust region (M. A. Branch, T. F. Coleman, Y. Li, SIAM J. Sci. Comput. 21
(1999) 1) with the exact derivatives of the discrete model.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from coupling.errors import CouplingError
from workflows.fit.core.calibration.fitting import WindowFit
from workflows.fit.core.calibration.forward import ChainForward
from workflows.fit.core.calibration.parameters import Parameter, Rig, coordinates, values
from workflows.fit.core.calibration.scan import Scan
from workflows.fit.core.calibration.search import CoarseToFine, FitStage, Options
from workflows.fit.core.calibration.signals import Filter, Signals
from workflows.fit.core.calibration.uncertainty import Uncertainty, uncertainty

NO_FILTER = Filter()
USUAL = Options()


class CalibrationResult(NamedTuple):
    """What was found. Misfits are rms [m/s] of each sphere over all samples."""

    parameters: tuple[Parameter, ...]
    value: np.ndarray  # (p,)
    at_bound: np.ndarray  # (p,) bool
    uncertainty: Uncertainty
    data: np.ndarray  # (k, m) as it was fitted, filtered
    model: np.ndarray  # (k, m) with what was found
    start: np.ndarray  # (k, m) with what it started from
    misfit: np.ndarray  # (m,)
    start_misfit: np.ndarray  # (m,)
    first_waves: np.ndarray  # (m,) [s] where the first windows end
    step_error: float  # [m/s] of the model: largest change with half the step
    same_starts: int  # how many starts of those tried found the same
    starts: int
    stages: tuple[FitStage, ...]
    scan: Scan | None


def calibrate(
    rig: Rig,
    parameters: Sequence[Parameter],
    signals: Signals,
    filters: Filter = NO_FILTER,
    options: Options = USUAL,
) -> CalibrationResult:
    """Parameters fitted to signals; raises CouplingError where there is nothing to fit.

    The filters are applied to the signals here.
    """
    v = filters.of_data(signals.v, signals.t[1] - signals.t[0])
    if v.size <= len(parameters):
        raise CouplingError(f"{v.size} samples do not determine {len(parameters)} parameters.")
    forward = ChainForward(rig, parameters, signals._replace(v=v), filters)
    fit = WindowFit(forward)
    search = CoarseToFine(fit, options)
    theta = values(fit.parameters, search.found(coordinates(fit.parameters, forward.start)))
    model, dv = forward.velocities_and_sensitivities(theta)
    begun = forward.velocities(forward.start)
    held = _at_bound(fit.parameters, theta)
    weighted = fit.weights[:, None]
    return CalibrationResult(
        fit.parameters,
        theta,
        held,
        uncertainty(fit.parameters, (model - v) * fit.weights, dv * weighted, held),
        v,
        model,
        begun,
        _rms_of_columns(model - v),
        _rms_of_columns(begun - v),
        search.first_waves,
        float(np.abs(forward.with_steps(0.5).velocities(theta) - model).max()),
        search.same_starts,
        search.starts,
        tuple(search.stages),
        search.scan,
    )


def _at_bound(parameters: Sequence[Parameter], theta: np.ndarray) -> np.ndarray:
    low, high = (np.array([getattr(p, b) for p in parameters]) for b in ("low", "high"))
    near = 1e-6 * (high - low)
    return (theta - low <= near) | (high - theta <= near)


def _rms_of_columns(residual: np.ndarray) -> np.ndarray:
    return np.sqrt(np.mean(residual**2, axis=0))
