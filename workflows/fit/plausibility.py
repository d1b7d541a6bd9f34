"""Checks of records before anything is fitted to them, and their own properties: sizes, sampling,
noise, the first touch."""

from collections.abc import Iterator, Sequence

import numpy as np

from beadwave.workflows.files.record import MeanRecord, Record, UnusableRecord
from beadwave.workflows.fit.aligned_signals import (
    AlignedRepeats,
    Filter,
    Signals,
    noise_between_waves,
    rise,
)
from beadwave.workflows.fit.parameter import Parameter, trigger

# Limits beyond which a record is refused or flagged; not varied systematically. Velocities are over
# the largest of the record, times over the contact time scale.
# sizes
WRONG_UNITS = 20.0  # largest signal over the scene's, or one over it: refused beyond
DOUBTFUL_UNITS = 3.0  # the same: flagged beyond
ARRIVED = 0.5  # velocity of a wave, or of the striker on its way
OFFSET = 0.02  # velocity at rest: an offset of the instrument
STILL = 0.05  # change of velocity: no wave has come by

# times
COARSEST_SAMPLING = 0.5  # sampling interval: refused above, flagged above half
SHORTEST_RECORD = 2.0  # record: refused below
LOWEST_CUT_OFF = 0.05  # of a low-pass, times the time scale: refused below
TRIGGER_RANGE = (-0.5, 1.0)  # of the record: where the first touch may be
SHIFTED_TRIGGER = 5e-6  # [s] between the triggers of repeats: worth a sentence

# velocities that stay at the end of an instrument's range
FLAT_TIME = 0.15  # time for which no wave stays at its largest velocity
MIN_FLAT_SAMPLES = 5  # samples, that noise does not repeat
SAME_VALUE = 1e-6  # difference of two samples at the same value

ALIKE_CORRELATION = 0.5  # correlation with the start model: flagged below


def plausible(record: Record, v0: np.ndarray) -> Iterator[str]:
    """Raise UnusableRecord for data that cannot be what it says of a chain that starts with v0 (n,)
    [m/s]; sentences on what is doubtful."""
    for n in record.spheres:
        if not 1 <= n <= len(v0):
            raise UnusableRecord(
                f"the data has sphere {n}, allowed are 1 to chain.count = {len(v0)}; "
                "correct its header or the scene."
            )

    # units: the size of the velocities against the striker's
    speed, largest = np.abs(v0).max(), np.abs(record.v).max()
    ratio = largest / speed
    sizes = f"velocities reach {largest:.3g} m/s, the scene's striker {speed:g} m/s"
    if not 1 / WRONG_UNITS < ratio < WRONG_UNITS:
        raise UnusableRecord(f"{sizes}; correct the unit in the data's header or striker.velocity.")
    if not 1 / DOUBTFUL_UNITS < ratio < DOUBTFUL_UNITS:
        yield f"{sizes}: check units and striker.velocity."

    # sphere 1 is the striker, on its way to the wall
    mean = record.v.mean(axis=0)
    begin = mean[:5].mean(axis=0)
    arrived = ARRIVED * np.abs(mean[:, 0]).max()
    if record.spheres[0] == 1 and begin[0] < -arrived:
        raise UnusableRecord(
            f"sphere 1, the striker, starts at {begin[0]:.3g} m/s, away from the wall; velocities "
            "towards the wall must be positive, turn the sign of the data or check its columns."
        )
    if record.spheres[0] == 1 and not begin[0] > arrived:
        raise UnusableRecord(
            f"sphere 1, the striker, starts at {begin[0]:.3g} m/s: the record begins after it has "
            "hit, or the columns are swapped; begin earlier or correct the header."
        )

    # every sphere has moved by the end of the record
    change = np.abs(mean - begin).max(axis=0)
    for n, moved in zip(record.spheres, change, strict=True):
        if moved < STILL * np.abs(mean).max():
            length = 1e3 * (record.t[-1] - record.t[0])
            raise UnusableRecord(
                f"no wave comes by sphere {n} within the {length:.4g} ms of the record, its "
                f"velocity changes by {moved:.2g} m/s; record longer, leave the sphere out or "
                "check its column."
            )

    for n, v in zip(record.spheres, begin, strict=True):
        if v0[n - 1] == 0.0 and abs(v) > OFFSET * largest:
            yield (
                f"Sphere {n} begins at {v:.3g} m/s, the scene has it at rest: take the "
                "instrument's offset off the data."
            )


def require_samples(t: np.ndarray, time_scale: float) -> None:
    """Raise UnusableRecord where waves pass between two samples of t (k,) [s], or a record ends
    within one; `time_scale` [s] is that within which the stiffest contact moves."""
    dt, length = t[1] - t[0], t[-1] - t[0]
    if dt > COARSEST_SAMPLING * time_scale:
        lowest_rate = 1 / (COARSEST_SAMPLING * time_scale)
        raise UnusableRecord(
            f"a sample every {1e6 * dt:.3g} us is too seldom for contacts that move within "
            f"{1e6 * time_scale:.3g} us; measure with {lowest_rate:.3g} Hz or more, or correct the "
            "unit of time."
        )
    if length < SHORTEST_RECORD * time_scale:
        raise UnusableRecord(
            f"the record lasts {1e6 * length:.3g} us, contacts move within {1e6 * time_scale:.3g} "
            "us; correct the unit of time or record longer."
        )


def cut_off(record: Record, time_scale: float) -> Iterator[str]:
    """Sentences on spheres that stay at their largest velocity, as beyond a laser's range."""
    longest = max(MIN_FLAT_SAMPLES, FLAT_TIME * time_scale / (record.t[1] - record.t[0]))
    for i, n in enumerate(record.spheres):
        largest = np.abs(record.v[:, :, i]).max()
        for sign in (1.0, -1.0):
            v = sign * record.v[:, :, i]
            at_end = v > v.max() - SAME_VALUE * largest
            flat = max(map(_longest_run, at_end))
            if v.max() > ARRIVED * largest and flat > longest:
                yield (
                    f"Sphere {n} stays at {sign * v.max():.3g} m/s, the end of what it shows, for "
                    f"{flat} samples: beyond the instrument's range?"
                )


def _longest_run(is_flat: np.ndarray) -> int:
    """Samples of the longest run of True in (k,) that neither begins nor ends the record."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], is_flat, [False]]).astype(int)))
    begin, end = edges[::2], edges[1::2]
    inside = (begin > 0) & (end < len(is_flat))
    return int((end - begin)[inside].max(initial=0))


def unlike_the_model(
    signals: Signals,
    data: np.ndarray,
    model: np.ndarray,
    lag: float,
    dt: float,
    time_scale: float,
) -> Iterator[str]:
    """Sentences on data (k, m) that is unlike the model (k, m) it starts from, `lag` [s] later;
    raises UnusableRecord for a first touch off the record."""
    t = signals.t
    if abs(lag) > 0.5 * (t[-1] - t[0]):
        raise UnusableRecord(
            f"the first touch would be at {1e3 * (t[0] + lag):.3g} ms, in the second half of the "
            f"record or before it; shift the record, or give --trigger."
        )
    if lag < -2 * dt:
        early = 1e6 * -lag
        yield f"The first touch is {early:.3g} us before the record starts: the trigger came late."
    if dt > 0.5 * COARSEST_SAMPLING * time_scale:
        yield f"A sample every {1e6 * dt:.3g} us is seldom for waves of {1e6 * time_scale:.3g} us."
    late = np.array([np.interp(t - lag, t, column) for column in model.T]).T
    for i, sphere in enumerate(signals.spheres):
        correlation = np.corrcoef(late[:, i], data[:, i])[0, 1]
        if correlation < ALIKE_CORRELATION:
            yield (
                f"Sphere {sphere + 1} does not look like the model it starts from (correlation "
                f"{correlation:.2f}): check its column, sign and time base."
            )


def on_repeats(raw: AlignedRepeats) -> Iterator[str]:
    """Sentences on repeats that were left out or shifted."""
    for i in raw.outliers:
        yield f"Repeat {i + 1} is unlike the others and was left out."
    spread = np.ptp(np.delete(raw.shift, raw.outliers))
    if spread > SHIFTED_TRIGGER:
        yield f"Repeats were shifted against each other by up to {1e6 * spread:.3g} us; undone."


def filters_of(
    band: float | None, instrument: float | None, t: np.ndarray, time_scale: float
) -> Filter:
    """Low-passes [Hz] of data and model; raises UnusableRecord for one that leaves nothing of the
    waves, or lies beyond what the samples t (k,) [s] and the model's finer ones hold."""
    nyquist, lowest = 0.5 / (t[1] - t[0]), LOWEST_CUT_OFF / time_scale
    for name, value in (("band", band), ("instrument", instrument)):
        highest = nyquist if name == "band" else 10 * nyquist
        if value is not None and not lowest < value < highest:
            raise UnusableRecord(
                f"--{name} {value:g} Hz must be between {lowest:.4g} Hz, below which nothing is "
                f"left of the waves, and {highest:g} Hz, given the data's {2 * nyquist:.4g} "
                "samples in a second; change it."
            )
    return Filter(band, instrument)


def first_touch(text: str, estimate: float, t: np.ndarray) -> float:
    """The time [s] that the text of --trigger gives, or the estimate; raises UnusableRecord for one
    off the record t (k,) [s]."""
    if text in ("fit", "estimate"):
        return estimate
    try:
        trigger = float(text)
    except ValueError:
        trigger = np.nan
    low, high = (t[0] + share * (t[-1] - t[0]) for share in TRIGGER_RANGE)
    if not low < trigger < high:
        raise UnusableRecord(
            f"--trigger {text!r} must be fit, estimate, or the time of the first touch between "
            f"{low:.4g} and {high:.4g} s, given the record."
        )
    return trigger


USUAL_NOISE = 0.01  # of the largest signal, taken where a record does not show its noise


def with_distinct_names(records: tuple[MeanRecord, ...]) -> tuple[MeanRecord, ...]:
    """Records whose files have the same name, named by their numbers."""
    if len({record.name for record in records}) == len(records):
        return records
    return tuple(record._replace(name=f"record {i}") for i, record in enumerate(records, 1))


def of_same_channels(records: tuple[MeanRecord, ...]) -> tuple[MeanRecord, ...]:
    """Records of the same channels, cut to the shortest; raises UnusableRecord for others."""
    for record in records[1:]:
        if record.channels != records[0].channels:
            raise UnusableRecord(
                f"{record.name} has {_sensors_of(record)}, {records[0].name} has "
                f"{_sensors_of(records[0])}; give records of the same sensors."
            )
    k = min(len(record.t) for record in records)
    return tuple(record._replace(t=record.t[:k], y=record.y[:k]) for record in records)


def _sensors_of(record: MeanRecord) -> str:
    return ", ".join(channel.name for channel in record.channels)


def size_comparison(
    labels: Sequence[str], units: Sequence[str], data: np.ndarray, model: np.ndarray
) -> list[str]:
    """Sentences on signals (k, m) whose size is doubtful against that of the model's (k, m); raises
    UnusableRecord for those that cannot be in their units."""
    doubts = []
    for label, unit, y, y_model in zip(labels, units, data.T, model.T, strict=True):
        largest, expected = np.abs(y).max(), np.abs(y_model).max()
        if not largest > 0.0:
            raise UnusableRecord(f"{label} is 0 all the time; leave its column out.")
        ratio = largest / max(expected, 1e-300)
        sizes = f"{label} reaches {largest:.3g} {unit}, the scene as it is {expected:.3g} {unit}"
        if not 1 / WRONG_UNITS < ratio < WRONG_UNITS:
            raise UnusableRecord(
                f"{sizes}; correct the unit in the data's header, the gain or the scene."
            )
        if not 1 / DOUBTFUL_UNITS < ratio < DOUBTFUL_UNITS:
            doubts.append(f"{sizes}: check units, gain and the striker's velocity.")
    return doubts


def trigger_of(record: MeanRecord, model: np.ndarray, name: str) -> Parameter:
    """Time at which the chain is first touched on the record's clock, by the rise of its first wave
    compared with that of the model (k, m)."""
    estimate = rise(record.t, record.y) - rise(record.t - record.t[0], model)
    return trigger(name, estimate)


def noise_of(record: MeanRecord, time_scale: float) -> tuple[np.ndarray, bool]:
    """rms (m,) of the mean signals' noise, in their units, and whether the record shows it: by the
    spread of its repeats, else by what is left between its waves. Raises UnusableRecord for a
    signal of zeros."""
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
    # 1e-4 of the largest signal: noise below this is below what the model resolves
    floor = np.maximum(1e-4 * largest, rounding(record.y))
    return np.maximum(rms, floor), is_known


def rounding(y: np.ndarray) -> np.ndarray:
    """rms (m,) of what an instrument of few levels rounds off signals (k, m): D / sqrt(12) of its
    step D, 0 of a signal that takes more values than such an instrument has."""
    levels = [np.unique(column) for column in y.T]
    # a record of no more than 4096 values, 12 bits, has been rounded by its instrument
    steps = [np.median(np.diff(u)) if 1 < len(u) <= 4096 else 0.0 for u in levels]
    return np.array(steps) / np.sqrt(12.0)
