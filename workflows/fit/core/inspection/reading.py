"""What records say before they are inspected: sensors, sizes, noise, the first touch."""

import numpy as np

from workflows.files.record import Recorded, UnusableRecord
from workflows.fit.core.calibration.parameters import Parameter
from workflows.fit.core.calibration.plausibility import WRONG_UNITS
from workflows.fit.core.calibration.signals import noise_between_waves
from workflows.fit.core.inspection.search import rise

TRIGGER = (1e-4, 3e-6)  # to either side of the estimate, scale [s]
RESOLVED = 1e-4  # of the largest signal: noise below what the model resolves
USUAL_NOISE = 0.01  # of the largest signal, where a record does not tell
LEVELS = 4096  # different values of a record, below which an instrument has rounded them


def called_apart(records: tuple[Recorded, ...]) -> tuple[Recorded, ...]:
    """Records whose files have the same name called by their numbers."""
    if len({one.name for one in records}) == len(records):
        return records
    return tuple(one._replace(name=f"record {i}") for i, one in enumerate(records, 1))


def alike(records: tuple[Recorded, ...]) -> tuple[Recorded, ...]:
    """Records of the same channels, cut to the shortest; raises UnusableRecord for others."""
    for one in records[1:]:
        if one.channels != records[0].channels:
            raise UnusableRecord(
                f"{one.name} has {_named(one)}, {records[0].name} has {_named(records[0])}; give "
                "records of the same sensors."
            )
    k = min(len(one.t) for one in records)
    return tuple(one._replace(t=one.t[:k], y=one.y[:k]) for one in records)


def _named(one: Recorded) -> str:
    return ", ".join(channel.name for channel in one.channels)


def require_size(one: Recorded, shown: np.ndarray, known: np.ndarray) -> None:
    """Raise UnusableRecord where signals of known gains are far from the size of the model's."""
    sizes = zip(one.channels, np.abs(one.y).max(axis=0), np.abs(shown).max(axis=0), strict=True)
    for (channel, largest, own), told in zip(sizes, known, strict=True):
        if told and not own / WRONG_UNITS < largest < own * WRONG_UNITS:
            raise UnusableRecord(
                f"{one.name}: {channel.name} reaches {largest:.3g}, the scene's model {own:.3g} in "
                "SI units; correct the unit in the record's header, the gain or the scene."
            )


def trigger_of(one: Recorded, shown: np.ndarray, name: str) -> Parameter:
    """When the chain is first touched on the record's clock, from the rise of its first wave."""
    reach, scale = TRIGGER
    estimate = rise(one.t, one.y) - rise(one.t - one.t[0], shown)
    return Parameter(name, "trigger", estimate, estimate - reach, estimate + reach, scale, "s")


def noise_of(one: Recorded, time_scale: float) -> tuple[np.ndarray, bool]:
    """(m,) rms of the mean signals' noise, and whether the record tells it."""
    largest = np.abs(one.y).max(axis=0)
    if not largest.all():
        raise UnusableRecord(f"{one.name}: {_named(one)} holds a signal of zeros; drop its column.")
    if one.repeats > 1:
        found = list(one.spread / np.sqrt(one.repeats))
    else:
        found = [noise_between_waves(one.t, y[:, None], time_scale) for y in one.y.T]
    guessed = [share if share is not None else np.nan for share in found]
    known = bool(np.isfinite(guessed).all())
    rms = np.where(np.isfinite(guessed), guessed, USUAL_NOISE * largest)
    least = np.maximum(RESOLVED * largest, rounding(one.y))
    return np.maximum(rms, least), known


def rounding(y: np.ndarray) -> np.ndarray:
    """(m,) rms of what an instrument of few levels rounds off signals (k, m)."""
    levels = [np.unique(column) for column in y.T]
    steps = [np.median(np.diff(u)) if 1 < len(u) <= LEVELS else 0.0 for u in levels]
    return np.array(steps) / np.sqrt(12.0)
