"""Numbers of a structure from records of its waves, with what the records do not determine.

Bars hold noise that is correlated from sample to sample, see `workflows.fit.uncertainty`, and the
known errors of the model; gains that nobody knows count among the numbers there. What the records
do not determine lies anywhere between its bounds: a number that has run into one has a bar all the
same, and lengthens those of others.
"""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.coupling.errors import CouplingError
from beadwave.workflows.fit import model_errors
from beadwave.workflows.fit.candidates import SearchResult, searched
from beadwave.workflows.fit.least_squares import RecordFit, rms
from beadwave.workflows.fit.model_errors import BetterModel
from beadwave.workflows.fit.parameter import Parameter, at_bound, scales
from beadwave.workflows.fit.uncertainty import (
    Uncertainty,
    bounds_information,
    profile_likelihood_bars,
    uncertainty,
)

GAIN_SCALE = 0.1  # of a gain: a change that counts as large


# Limits of a residual that may be noise, and of answers that may not be told apart; not varied
# systematically
N_PARTS = 50  # of a record, in each of which the residual must be noise
NOISE_SQUARE = 1.15  # mean square over the noise's, whose rms is known to some per cent
NOISE_DEVIATIONS = 5.0  # standard deviations of the mean square of noise
RIVAL_SQUARES = 16.0  # squares of the noise by which an answer may leave more and be a rival


class RecordPart(NamedTuple):
    """The residual in a part of a record."""

    record: int  # counted from 0
    begin: float  # [s]
    end: float  # [s]
    misfit: float  # rms over the noise


class Inversion(NamedTuple):
    """The numbers of least misfit; gains follow the numbers in `parameters` and `value`."""

    parameters: tuple[Parameter, ...]  # (p,)
    value: NDArray[np.float64]  # (p,) in SI units
    at_bound: NDArray[np.bool_]  # (p,)
    uncertainty: Uncertainty
    gains: NDArray[np.float64]  # (m,) factors on the sensors' nominal gains
    model: NDArray[np.float64]  # (S, k, m) signals at `value`
    misfit: NDArray[np.float64]  # (S, m) rms of the residual over the noise
    slopes: NDArray[np.float64]  # (S, k, m, p) by the numbers in scales, over the noise
    memory: float  # variance of the residual over that of its differences: 1 of white noise
    parts: tuple[RecordPart, ...]  # of all records
    step_error: float  # largest change of the model with half the step, over the noise
    search: SearchResult
    rounded: float = 0.0  # what rounding may add to the mean square, over the noise's
    lengthening: float = 1.0  # largest factor on a bar by the profile of the misfit
    # part (p,) of the bars by noise and by each error of the model, in quadrature
    causes: Mapping[str, NDArray[np.float64]] = MappingProxyType({})
    # what the model errors leave of the records at the best numbers
    model_error_parts: tuple[RecordPart, ...] = ()

    @property
    def whole_misfit(self) -> float:
        """rms over the noise, of all records."""
        return float(np.sqrt(np.mean(self.misfit**2)))

    @property
    def explained(self) -> bool:
        """True if the residual as a whole, and in every part of a record, may be noise.

        The mean square of n samples may exceed 1 by what the noise is uncertain, by what rounding
        adds, by standard deviations sqrt(2 c / n) of the mean, c the memory of the residual, and by
        what the model errors leave at two bars.
        """
        return bool(np.all(self.excess <= 4.0 * self._model_error_squares))

    @property
    def noisy(self) -> bool:
        """True if it may be noise alone."""
        return bool(np.all(self.excess <= 0.0))

    @property
    def excess(self) -> NDArray[np.float64]:
        """(1 + parts,) mean square of the residual, as a whole and in each part, above what noise
        and rounding allow; inf where it is no number.

        The mean square of n independent normal samples has the standard deviation sqrt(2 / n); of
        samples that go on from one to the next so many fewer count as `memory` says.
        """
        n = self.model.size
        squares = np.array([self.whole_misfit, *(part.misfit for part in self.parts)]) ** 2
        samples = np.array([n] + [n // len(self.parts)] * len(self.parts))
        deviation = np.sqrt(2.0 * max(self.memory, 1.0) / np.maximum(samples, 1))
        limit = NOISE_SQUARE + self.rounded + NOISE_DEVIATIONS * deviation
        return np.nan_to_num(squares - limit, nan=np.inf, posinf=np.inf)

    @property
    def _model_error_squares(self) -> NDArray[np.float64]:
        """(1 + parts,) mean squares of what the model errors leave, over the noise's."""
        if not self.model_error_parts:
            return np.zeros(1 + len(self.parts))
        squares = np.array([part.misfit for part in self.model_error_parts]) ** 2
        return np.append(squares.mean(), squares)

    def rivals(self, others: Sequence["Inversion"], n_shared: int) -> tuple["Inversion", ...]:
        """Other answers that leave as little, farther off than their bars from this one and from
        each other."""
        rivals: list[Inversion] = []
        for other in others:
            excess = self.model.size * (other.whole_misfit**2 / self.whole_misfit**2 - 1.0)
            as_small = excess <= RIVAL_SQUARES * max(self.memory, 1.0)
            if as_small and all(other.differs_from(a, n_shared) for a in (self, *rivals)):
                rivals.append(other)
        return tuple(rivals)

    def differs_from(self, other: "Inversion", n_shared: int) -> bool:
        """True if a number of the structure differs by more than its bar here."""
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
    """The numbers of least misfit: by a search with so many candidates, or from `begin` (p,) on.

    `gains` names the unknown gains. Raises CouplingError where nothing can be computed.
    """
    if fit.data.size <= len(fit.unknowns.parameters):
        raise CouplingError(
            f"{fit.data.size} samples do not determine {len(fit.unknowns.parameters)} numbers."
        )
    if begin is None:
        search = searched(fit, n_shared=n_shared, starts=starts, seed=seed)
    else:
        search = SearchResult((fit.solved(begin),), 1, fit.forward)
    fit = fit._replace(forward=search.forward)
    theta = search.fitted.point
    signals, by_theta = fit.forward.jacobian(fit.unknowns, theta, fit.shots)

    # the gains that followed theta count as numbers of their own from here on
    factors = fit.gains(signals)
    of_gains = []
    for i, name in enumerate(gains):
        gain = float(factors[fit.gain == i][0])
        scale = GAIN_SCALE * abs(gain) or 1.0
        of_gains.append(Parameter(name, "gain", gain, 0.0, np.inf, scale))
    parameters = (*fit.unknowns.parameters, *of_gains)
    value = np.array([*theta, *(p.start for p in of_gains)])

    # residual and Jacobian by theta and gains, over the noise
    of_sensor = GAIN_SCALE * (fit.gain[:, None] == np.arange(len(gains)))
    by_gains = (factors * signals)[..., None] * of_sensor
    slopes = np.concatenate([factors[:, None] * by_theta, by_gains], axis=-1)
    slopes *= fit.weight[..., None]
    residual = (factors * signals - fit.data) * fit.weight

    # a bar of what no record determines is that of a number anywhere between its bounds
    bars = uncertainty(
        parameters, sensors_side_by_side(residual),
        sensors_side_by_side(slopes) / scales(parameters), np.zeros(len(parameters), bool),
        bounds_information(parameters),
    )  # fmt: skip

    # half the step: the change is the error of the model's march
    finer = fit.forward.with_steps(0.5).signals(fit.unknowns, theta, fit.shots)
    return Inversion(
        parameters=parameters,
        value=value,
        at_bound=at_bound(parameters, value),
        uncertainty=bars,
        gains=factors,
        model=factors * signals,
        misfit=np.sqrt(np.mean(residual**2, axis=1)),
        slopes=slopes,
        memory=memory(residual),
        parts=residual_parts(fit, residual),
        step_error=float(np.abs(factors * (finer - signals) * fit.weight).max()),
        search=search,
        rounded=fit.rounded,
    )


def profiled(fit: RecordFit, inversion: Inversion, n_shared: int) -> Inversion:
    """The inversion with bars of the structure's numbers as long as the profile of the misfit
    says."""
    theta = inversion.value[: len(fit.unknowns.parameters)]
    bars, lengthening = profile_likelihood_bars(
        fit, theta, fit.jacobian(theta), inversion.uncertainty, n_shared
    )
    return inversion._replace(uncertainty=bars, lengthening=lengthening)


def sensors_side_by_side(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """(k, S m, ...) of values (S, k, m, ...): every sensor of every record is a column."""
    moved = np.moveaxis(values, 0, 1)
    return moved.reshape(moved.shape[0], -1, *values.shape[3:])


def residual_parts(fit: RecordFit, residual: NDArray[np.float64]) -> tuple[RecordPart, ...]:
    """The residual (S, k, m) of each record in parts of equal lengths, from first to last."""
    n_parts = min(N_PARTS, residual.shape[1])
    cuts = np.array_split(np.arange(residual.shape[1]), n_parts)
    return tuple(
        RecordPart(s, float(shot.t[cut[0]]), float(shot.t[cut[-1]]), rms(residual[s, cut]))
        for s, shot in enumerate(fit.shots)
        for cut in cuts
    )


def memory(residual: NDArray[np.float64]) -> float:
    """Variance of a residual (S, k, m) over half the variance of its differences: 1 of white noise,
    more where the residual goes on from sample to sample. J. von Neumann, Ann. Math. Stat. 12
    (1941) 367."""
    steps = rms(np.diff(residual, axis=1)) ** 2 / 2.0
    return rms(residual) ** 2 / steps if steps > 0 else np.inf


def widened(
    fit: RecordFit, inversion: Inversion, models: Mapping[str, Sequence[BetterModel]]
) -> Inversion:
    """The inversion with bars that hold the model errors, with the part of each cause in every bar,
    and with what the errors leave of the records at the best numbers.

    `models` are those that are better in what a cause names; smaller steps of time are added here.
    The model is fitted to what each of them shows at the best numbers: where numbers move along a
    valley of the misfit, derivatives at its end told a sixth of it. Raises what a system raises for
    values that cannot be marched.
    """
    scale, n = scales(inversion.parameters), len(fit.unknowns.parameters)
    theta = inversion.value[:n]

    def signals(forward):
        """(S, k, m) by the gains that were found."""
        return inversion.gains * forward.signals(fit.unknowns, theta, fit.shots)

    # records f + d that a better model would make, and what the fit to them moves the numbers by
    by_cause = model_errors.changes(fit.forward, inversion.model, signals, models)
    biases, squares = {}, np.zeros_like(inversion.model)
    for cause, changes in by_cause.items():
        biases[cause] = np.zeros((len(scale), len(changes)))
        for i, (change, share) in enumerate(changes):
            shots = tuple(
                shot._replace(y=y)
                for shot, y in zip(fit.shots, inversion.model + change, strict=True)
            )
            moved_fit = fit._replace(shots=shots)
            moved = moved_fit.solved(theta, about=theta).point
            of_model = fit.forward.signals(fit.unknowns, moved, fit.shots)
            biases[cause][:n, i] = share * (moved - theta) / scale[:n]
            # gains follow the numbers, in the order of their sensors
            gains = moved_fit.gains(of_model) - inversion.gains
            for g in range(len(scale) - n):
                biases[cause][n + g, i] = share * gains[fit.gain == g][0] / scale[n + g]
            # what no numbers of the model take up of d: records may be off by it, and explained
            squares += (share * moved_fit.off(of_model)) ** 2

    bars, causes = model_errors.widened(inversion.uncertainty, scale, biases)
    parts = residual_parts(fit, np.sqrt(squares))
    return inversion._replace(uncertainty=bars, causes=causes, model_error_parts=parts)
