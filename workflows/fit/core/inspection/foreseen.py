"""Bars that a record would leave, before it is made: by a run of the model and its derivatives."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from workflows.fit.core.calibration.parameters import Parameter
from workflows.fit.core.inspection.forward import Shot, StructureForward, Unknowns
from workflows.fit.core.inspection.information import bars_over_time, bounds_information
from workflows.fit.core.inspection.inversion import GAIN_SCALE, scales
from workflows.fit.core.inspection.reading import TRIGGER_REACH, TRIGGER_SCALE
from workflows.fit.core.model_errors import NOISE, TIME, TIME_SHARE, BetterModel, biases

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

    # what better models change, over the noise
    def shown(forward):
        return forward.signals(unknowns, theta, [shot])[0] / rms

    differences = {TIME: [TIME_SHARE * (shown(forward.with_steps(0.5)) - signals)]}
    for cause, better in models.items():
        differences[cause] = []
        for model in better:
            beside = signals
            if model.beside is not None:
                beside = shown(forward._replace(system=model.beside))
            change = shown(forward._replace(system=model.system)) - beside
            differences[cause].append(model.share * change)

    # an unknown gain is one more number, without bounds
    if unknown_gain:
        slopes = np.concatenate([slopes, GAIN_SCALE * signals[..., None]], axis=-1)
    p, n = slopes.shape[-1], len(unknowns.parameters)
    B = np.zeros((p, p))
    B[:n, :n] = bounds_information(unknowns.parameters)

    ends = np.unique(np.linspace(len(t) / INSTANTS, len(t), INSTANTS).astype(int))
    causes = {cause: np.zeros((m, n)) for cause in (NOISE, *differences)}
    records = np.zeros((m, n))
    for i in range(m):
        bars = bars_over_time(slopes[None, :, i, None], B, ends)[:, :n]
        causes[NOISE][i] = bars[-1] * scales(unknowns.parameters)
        records[i] = t[ends[np.argmax(bars <= ENOUGH * bars[-1], axis=0)] - 1]
        for cause, better in differences.items():
            b = biases(slopes[:, i], np.array([d[:, i] for d in better]).T, B)
            causes[cause][i] = np.linalg.norm(b[:n], axis=1) * scales(unknowns.parameters)
    return causes, records


def trigger() -> Parameter:
    """The first touch at 0, as loosely known as that of a record."""
    return Parameter("trigger", "trigger", 0.0, -TRIGGER_REACH, TRIGGER_REACH, TRIGGER_SCALE, "s")
