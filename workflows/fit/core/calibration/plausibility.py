"""What measured velocities must be like before a chain is fitted to them."""

from collections.abc import Iterator

import numpy as np

from workflows.files.record import Record, UnusableRecord
from workflows.fit.core.calibration.signals import Aligned, Filter, Signals

WRONG_UNITS = 20.0  # largest velocity over the striker's, or one over it: refused beyond
DOUBTFUL_UNITS = 3.0  # the same: flagged beyond
ARRIVED = 0.5  # of the largest velocity: a wave, or the striker on its way
OFFSET = 0.02  # of the largest velocity: an offset of the instrument
STILL = 0.05  # of the largest velocity: no wave has come by
COARSEST = 0.5  # sampling interval over the contact time scale: refused above, flagged above half
SHORTEST = 2.0  # record over the contact time scale: refused below
LOWEST = 0.05  # cut-off of a low-pass times the contact time scale: refused below
TRIGGERS = (-0.5, 1.0)  # of the record: where the first touch may be said to be
FLAT = 0.15  # of a contact time scale, that no wave stays at its largest velocity
LEAST_FLAT = 5  # samples, that noise does not repeat
SAME_VALUE = 1e-6  # of the largest velocity: two samples are at the same value
ALIKE = 0.5  # correlation with the start model: flagged below
SHIFTED = 5e-6  # [s] between the triggers of repeats: worth a sentence


def plausible(record: Record, v0: np.ndarray) -> Iterator[str]:
    """Raise UnusableRecord for data that cannot be what it says of a chain that starts with v0 (n,)
    [m/s]; sentences on what is doubtful."""
    for n in record.spheres:
        if not 1 <= n <= len(v0):
            raise UnusableRecord(
                f"the data has sphere {n}, allowed are 1 to chain.count = {len(v0)}; "
                "correct its header or the scene."
            )

    # units: the size of the velocities beside the striker's
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
    """Raise UnusableRecord where waves pass between two samples, or a record ends within one."""
    dt, length = t[1] - t[0], t[-1] - t[0]
    if dt > COARSEST * time_scale:
        raise UnusableRecord(
            f"a sample every {1e6 * dt:.3g} us is too seldom for contacts that move within "
            f"{1e6 * time_scale:.3g} us; measure with {1 / (COARSEST * time_scale):.3g} Hz or "
            "more, or correct the unit of time."
        )
    if length < SHORTEST * time_scale:
        raise UnusableRecord(
            f"the record lasts {1e6 * length:.3g} us, contacts move within {1e6 * time_scale:.3g} "
            "us; correct the unit of time or record longer."
        )


def cut_off(record: Record, time_scale: float) -> Iterator[str]:
    """Sentences on spheres that stay at their largest velocity, as beyond a laser's range."""
    longest = max(LEAST_FLAT, FLAT * time_scale / (record.t[1] - record.t[0]))
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
    if dt > 0.5 * COARSEST * time_scale:
        yield f"A sample every {1e6 * dt:.3g} us is seldom for waves of {1e6 * time_scale:.3g} us."
    late = np.array([np.interp(t - lag, t, column) for column in model.T]).T
    for i, sphere in enumerate(signals.spheres):
        correlation = np.corrcoef(late[:, i], data[:, i])[0, 1]
        if correlation < ALIKE:
            yield (
                f"Sphere {sphere + 1} does not look like the model it starts from (correlation "
                f"{correlation:.2f}): check its column, sign and time base."
            )


def on_repeats(raw: Aligned) -> Iterator[str]:
    """Sentences on repeats that were left out or shifted."""
    for i in raw.outliers:
        yield f"Repeat {i + 1} is unlike the others and was left out."
    spread = np.ptp(np.delete(raw.shift, raw.outliers))
    if spread > SHIFTED:
        yield f"Repeats were shifted against each other by up to {1e6 * spread:.3g} us; undone."


def filters_of(
    band: float | None, instrument: float | None, t: np.ndarray, time_scale: float
) -> Filter:
    """Low-passes [Hz] of data and model; raises UnusableRecord for one that leaves nothing."""
    nyquist, lowest = 0.5 / (t[1] - t[0]), LOWEST / time_scale
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
    """The time [s] that is given, or the estimate; raises UnusableRecord for one off the record."""
    if text in ("fit", "estimate"):
        return estimate
    try:
        trigger = float(text)
    except ValueError:
        trigger = np.nan
    low, high = (t[0] + share * (t[-1] - t[0]) for share in TRIGGERS)
    if not low < trigger < high:
        raise UnusableRecord(
            f"--trigger {text!r} must be fit, estimate, or the time of the first touch between "
            f"{low:.4g} and {high:.4g} s, given the record."
        )
    return trigger
