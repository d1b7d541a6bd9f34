"""Parameters of a chain and its wall fitted to measured velocities.

    minimise  sum over windows  ((model(theta) - data) / noise)^2,   low <= theta <= high

by Gauss-Newton steps in a trust region (M. A. Branch, T. F. Coleman, Y. Li, SIAM J. Sci. Comput. 21
(1999) 1) with the exact derivatives of the discrete model.
"""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from beadwave.coupling.errors import CouplingError
from beadwave.workflows.fit import model_errors
from beadwave.workflows.fit.aligned_signals import Filter, Signals
from beadwave.workflows.fit.forward import ChainForward
from beadwave.workflows.fit.least_squares import WindowFit, weights
from beadwave.workflows.fit.marched_system import Rig
from beadwave.workflows.fit.model_errors import BetterModel
from beadwave.workflows.fit.parameter import Parameter, at_bound, coordinates, scales, values
from beadwave.workflows.fit.uncertainty import Uncertainty, uncertainty
from beadwave.workflows.fit.windows import CoarseToFine, FitStage, Options, Scan

OTHER_STARTS = "other starts"  # a cause of bars, in tables

NO_FILTER = Filter()
USUAL = Options()


class CalibrationResult(NamedTuple):
    """The parameters of least misfit. Misfits are rms [m/s] of each sphere over all samples."""

    parameters: tuple[Parameter, ...]
    value: np.ndarray  # (p,) in SI units
    at_bound: np.ndarray  # (p,) bool
    uncertainty: Uncertainty
    data: np.ndarray  # (k, m) [m/s] as it was fitted, filtered
    model: np.ndarray  # (k, m) [m/s] at `value`
    start: np.ndarray  # (k, m) [m/s] at what the parameters start from
    misfit: np.ndarray  # (m,)
    start_misfit: np.ndarray  # (m,)
    first_waves: np.ndarray  # (m,) [s] where the first windows end
    step_error: float  # [m/s] of the model: largest change with half the step
    same_starts: int  # how many starts of those tried found the same
    starts: int
    stages: tuple[FitStage, ...]
    scan: Scan | None
    # part (p,) of the bars by noise and by each error of the model, in quadrature
    causes: Mapping[str, np.ndarray] = MappingProxyType({})
    confirmed: bool = True  # the answer, by its misfit or by other starts
    others: np.ndarray = np.empty((0, 0))  # (p, k) further answers less this one, in scales


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
    z = search.solution(coordinates(fit.parameters, forward.start))
    theta = values(fit.parameters, z)
    model, dv = forward.velocities_and_sensitivities(theta)
    start = forward.velocities(forward.start)

    # parameters at a bound are fixed there: the covariance is that of the others
    fixed = at_bound(fit.parameters, theta)
    residual, J = (model - v) * fit.weights, dv * fit.weights[:, None]
    return CalibrationResult(
        parameters=fit.parameters,
        value=theta,
        at_bound=fixed,
        uncertainty=uncertainty(fit.parameters, residual, J, fixed),
        data=v,
        model=model,
        start=start,
        misfit=np.sqrt(np.mean((model - v) ** 2, axis=0)),
        start_misfit=np.sqrt(np.mean((start - v) ** 2, axis=0)),
        first_waves=search.first_waves,
        step_error=float(np.abs(forward.with_steps(0.5).velocities(theta) - model).max()),
        same_starts=search.same_starts,
        starts=search.starts,
        stages=tuple(search.stages),
        scan=search.scan,
        confirmed=search.confirmed,
        others=search.others,
    )


def widened(
    fit: CalibrationResult, forward: ChainForward, models: Mapping[str, Sequence[BetterModel]]
) -> CalibrationResult:
    """The result with bars that hold the errors of its model, and with the part of each in them.

    `models` are rigs that are better in what a cause names; smaller steps of time are added here,
    and the further answers of a search that is not sure of its own: as likely as it, their second
    moment about it.
    """
    weight = weights(forward.signals.spread)

    def shown(forward):
        """(k m,) at what was found, weighted."""
        return (forward.velocities(fit.value) * weight).ravel()

    of_fit, dv = forward.velocities_and_sensitivities(fit.value)
    by_cause = model_errors.changes(forward, (of_fit * weight).ravel(), shown, models)
    scale = scales(fit.parameters)
    J = np.where(fit.at_bound, 0.0, dv * weight[:, None] * scale).reshape(-1, len(scale))
    biases = {
        cause: model_errors.biases(J, np.array([c.share * c.signals for c in changes]).T)
        for cause, changes in by_cause.items()
    }
    if fit.others.size:
        biases[OTHER_STARTS] = 2.0 * fit.others / np.sqrt(fit.others.shape[1] + 1.0)
    bars, causes = model_errors.widened(fit.uncertainty, scale, biases, fit.at_bound)
    return fit._replace(uncertainty=bars, causes=causes)
