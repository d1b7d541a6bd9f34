"""What records say before they are inspected: sensors, sizes, noise, the first touch."""

import numpy as np

from workflows.files.record import Recorded, UnusableRecord
from workflows.fit.core.calibration.parameters import Parameter
from workflows.fit.core.calibration.plausibility import WRONG_UNITS
from workflows.fit.core.calibration.signals import noise_between_waves
from workflows.fit.core.inspection.search import rise

TRIGGER_REACH = 1e-4  # [s] bounds of a trigger to either side of its estimate
TRIGGER_SCALE = 3e-6  # [s] a change of a trigger that counts as large
RESOLVED = 1e-4  # of the largest signal: noise below this is below what the model resolves
USUAL_NOISE = 0.01  # of the largest signal, taken where a record does not show its noise
LEVELS = 4096  # of 12 bits: a record of no more different values has been rounded by its instrument


def called_apart(records: tuple[Recorded, ...]) -> tuple[Recorded, ...]:
    """Records whose files have the same name, named by their numbers."""
    if len({record.name for record in records}) == len(records):
        return records
    return tuple(record._replace(name=f"record {i}") for i, record in enumerate(records, 1))


def alike(records: tuple[Recorded, ...]) -> tuple[Recorded, ...]:
    """Records of the same channels, cut to the shortest; raises UnusableRecord for others."""
    for record in records[1:]:
        if record.channels != records[0].channels:
            raise UnusableRecord(
                f"{record.name} has {_sensors_of(record)}, {records[0].name} has "
                f"{_sensors_of(records[0])}; give records of the same sensors."
            )
    k = min(len(record.t) for record in records)
    return tuple(record._replace(t=record.t[:k], y=record.y[:k]) for record in records)


def _sensors_of(record: Recorded) -> str:
    return ", ".join(channel.name for channel in record.channels)


def require_size(record: Recorded, model: np.ndarray, gain_known: np.ndarray) -> None:
    """Raise UnusableRecord where signals of known gains (m,) are far from the size of the model's
    (k, m)."""
    peaks, model_peaks = (np.abs(y).max(axis=0) for y in (record.y, model))
    for channel, peak, expected, is_known in zip(
        record.channels, peaks, model_peaks, gain_known, strict=True
    ):
        if is_known and not expected / WRONG_UNITS < peak < expected * WRONG_UNITS:
            raise UnusableRecord(
                f"{record.name}: {channel.name} reaches {peak:.3g}, the scene's model "
                f"{expected:.3g} in SI units; correct the unit in the record's header, the gain or "
                "the scene."
            )


def trigger_of(record: Recorded, model: np.ndarray, name: str) -> Parameter:
    """When the chain is first touched on the record's clock, by the rise of its first wave beside
    that of the model (k, m)."""
    estimate = rise(record.t, record.y) - rise(record.t - record.t[0], model)
    low, high = estimate - TRIGGER_REACH, estimate + TRIGGER_REACH
    return Parameter(name, "trigger", estimate, low, high, TRIGGER_SCALE, "s")


def noise_of(record: Recorded, time_scale: float) -> tuple[np.ndarray, bool]:
    """rms (m,) of the mean signals' noise, and whether the record shows it."""
    largest = np.abs(record.y).max(axis=0)
    if not largest.all():
        raise UnusableRecord(
            f"{record.name}: {_sensors_of(record)} holds a signal of zeros; drop its column."
        )
    if record.repeats > 1:
        estimates = list(record.spread / np.sqrt(record.repeats))
    else:
        estimates = [noise_between_waves(record.t, y[:, None], time_scale) for y in record.y.T]
    rms = np.array([np.nan if estimate is None else estimate for estimate in estimates])
    is_known = bool(np.isfinite(rms).all())
    rms = np.where(np.isfinite(rms), rms, USUAL_NOISE * largest)
    floor = np.maximum(RESOLVED * largest, rounding(record.y))
    return np.maximum(rms, floor), is_known


def rounding(y: np.ndarray) -> np.ndarray:
    """rms (m,) of what an instrument of few levels rounds off signals (k, m): D / sqrt(12) of its
    step D, 0 of a signal that takes more values than such an instrument has."""
    levels = [np.unique(column) for column in y.T]
    steps = [np.median(np.diff(u)) if 1 < len(u) <= LEVELS else 0.0 for u in levels]
    return np.array(steps) / np.sqrt(12.0)
