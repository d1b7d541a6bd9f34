"""Bars that a record would leave, before it is made: by a run of the model and its derivatives."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from workflows.fit.core.calibration.parameters import Parameter, scales
from workflows.fit.core.inspection.forward import Shot, StructureForward, Unknowns
from workflows.fit.core.inspection.information import bars_over_time, bounds_information
from workflows.fit.core.inspection.inversion import GAIN_SCALE
from workflows.fit.core.inspection.reading import TRIGGER_REACH, TRIGGER_SCALE
from workflows.fit.core.model_errors import NOISE, BetterModel, biases, changes

INSTANTS = 80  # record lengths at which bars are computed
ENOUGH = 2.0  # times the bar of the whole record: a record that is long enough has no longer one


def foreseen(
    forward: StructureForward,
    unknowns: Unknowns,
    theta: NDArray[np.float64],
    t: NDArray[np.float64],
    *,
    noise: float,
    unknown_gain: bool,
    models: Mapping[str, Sequence[BetterModel]],
) -> tuple[Mapping[str, NDArray[np.float64]], NDArray[np.float64]]:
    """Parts (m, p) of the two-sigma bars of the unknowns by each of m sensors alone, by noise and
    by each error of the model, and the record (m, p) [s] after which those by noise are at most
    ENOUGH times as long.

    theta are the values of all but the trigger; noise is over the largest signal; `models` are
    those that are better in what a cause names.
    """
    m, theta = len(forward.sensors), np.append(theta, 0.0)
    shot = Shot(t, np.zeros((len(t), m)), np.ones(m))
    signals, slopes = forward.jacobian(unknowns, theta, [shot])
    rms = noise * np.maximum(np.abs(signals[0]).max(axis=0), 1e-300)
    signals, slopes = signals[0] / rms, slopes[0] / rms[:, None]

    def shown(forward):
        """(k, m) over the noise."""
        return forward.signals(unknowns, theta, [shot])[0] / rms

    by_cause = changes(forward, signals, shown, models)

    # an unknown gain is one more number, without bounds
    if unknown_gain:
        slopes = np.concatenate([slopes, GAIN_SCALE * signals[..., None]], axis=-1)
    p, n = slopes.shape[-1], len(unknowns.parameters)
    B = np.zeros((p, p))
    B[:n, :n] = bounds_information(unknowns.parameters)

    ends = np.unique(np.linspace(len(t) / INSTANTS, len(t), INSTANTS).astype(int))
    causes = {cause: np.zeros((m, n)) for cause in (NOISE, *by_cause)}
    records = np.zeros((m, n))
    for i in range(m):
        bars = bars_over_time(slopes[None, :, i, None], B, ends)[:, :n]
        causes[NOISE][i] = bars[-1] * scales(unknowns.parameters)
        records[i] = t[ends[np.argmax(bars <= ENOUGH * bars[-1], axis=0)] - 1]
        for cause, of_cause in by_cause.items():
            differences = np.array([change.share * change.signals[:, i] for change in of_cause])
            b = biases(slopes[:, i], differences.T, B)
            causes[cause][i] = np.linalg.norm(b[:n], axis=1) * scales(unknowns.parameters)
    return causes, records


def trigger() -> Parameter:
    """The first touch at 0, as loosely known as that of a record."""
    return Parameter("trigger", "trigger", 0.0, -TRIGGER_REACH, TRIGGER_REACH, TRIGGER_SCALE, "s")
