"""Bars that a record would leave, before it is made: by a run of the model and its derivatives."""

import numpy as np
from numpy.typing import NDArray

from workflows.fit.core.calibration.parameters import Parameter
from workflows.fit.core.inspection.forward import Shot, StructureForward, Unknowns
from workflows.fit.core.inspection.information import bars_over_time, bounds_information
from workflows.fit.core.inspection.inversion import GAIN_SCALE, scales
from workflows.fit.core.inspection.reading import TRIGGER

INSTANTS = 80  # record lengths that are looked at
ENOUGH = 2.0  # times its last bar: a record that is long enough


def foreseen(
    forward: StructureForward,
    sought: Unknowns,
    theta: NDArray[np.float64],
    t: NDArray[np.float64],
    *,
    noise: float,
    unknown_gain: bool,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Two-sigma bars (m, p) of the numbers sought by each of m sensors alone, and the record (m, p)
    [s] after which they are not much longer.

    theta are the values of all but the trigger; noise is over the largest signal.
    """
    m = len(forward.sensors)
    shot = Shot(t, np.zeros((len(t), m)), np.ones(m))
    shown, slopes = forward.jacobian(sought, np.append(theta, 0.0), [shot])
    rms = noise * np.maximum(np.abs(shown[0]).max(axis=0), 1e-300)
    shown, slopes = shown[0] / rms, slopes[0] / rms[:, None]
    if unknown_gain:
        slopes = np.concatenate([slopes, GAIN_SCALE * shown[..., None]], axis=-1)
    p, n = slopes.shape[-1], len(sought.parameters)
    B = np.zeros((p, p))
    B[:n, :n] = bounds_information(sought.parameters)
    told = [_by_sensor(slopes[:, i], B, t) for i in range(m)]
    bars, needed = (np.array(one)[:, :n] for one in zip(*told, strict=True))
    return bars * scales(sought.parameters), needed


def trigger() -> Parameter:
    """The first touch at 0, as loosely known as that of a record."""
    reach, scale = TRIGGER
    return Parameter("trigger", "trigger", 0.0, -reach, reach, scale, "s")


def _by_sensor(slopes, B, t) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(p,) bars in scales by the slopes (k, p) of one sensor, and the record [s] after which they
    are not much longer than at the end."""
    ends = np.unique(np.linspace(len(t) / INSTANTS, len(t), INSTANTS).astype(int))
    bars = bars_over_time(slopes[None, :, None], B, ends)
    return bars[-1], t[ends[np.argmax(bars <= ENOUGH * bars[-1], axis=0)] - 1]
