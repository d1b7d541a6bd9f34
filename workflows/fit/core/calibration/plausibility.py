"""What measured velocities must be like before a chain is fitted to them."""

from collections.abc import Iterator

import numpy as np

from workflows.files.record import Record, UnusableRecord
from workflows.fit.core.calibration.signals import Aligned, Filter, Signals

LOWEST = 0.05  # low-pass times the contact time scale
TRIGGERS = (-0.5, 1.0)  # of the record: where the first touch may be said to be
WRONG_UNITS = 20.0  # peak velocity over the striker's
DOUBTFUL_UNITS = 3.0
ARRIVED = 0.5  # of the largest velocity
COARSEST = 0.5  # sampling interval in contact time scales: refused above, flagged above half
SHORTEST = 2.0  # record in contact time scales
OFFSET = 0.02  # of the largest velocity
STILL = 0.05  # of the largest velocity: no wave
FLAT = 0.15  # of a contact time scale, that no wave stays at its largest velocity
LEAST_FLAT = 5  # samples
SAME_VALUE = 1e-6  # of the largest velocity
ALIKE = 0.5  # correlation with the start model


def plausible(measured: Record, v0: np.ndarray) -> Iterator[str]:
    """Raise UnusableRecord for data that cannot be what it says of a chain that starts with v0 (n,)
    [m/s]; sentences on what is doubtful."""
    for n in measured.spheres:
        if not 1 <= n <= len(v0):
            raise UnusableRecord(
                f"the data has sphere {n}, allowed are 1 to chain.count = {len(v0)}; "
                "correct its header or the scene."
            )
    speed = np.abs(v0).max()
    ratio = np.abs(measured.v).max() / speed
    told = f"velocities reach {np.abs(measured.v).max():.3g} m/s, the scene's striker {speed:g} m/s"
    if not 1 / WRONG_UNITS < ratio < WRONG_UNITS:
        raise UnusableRecord(f"{told}; correct the unit in the data's header or striker.velocity.")
    if not 1 / DOUBTFUL_UNITS < ratio < DOUBTFUL_UNITS:
        yield f"{told}: check units and striker.velocity."
    _require_start(measured)
    _require_waves(measured)
    yield from _offsets(measured, v0)


def _offsets(measured: Record, v0: np.ndarray):
    begin = measured.v.mean(axis=0)[:5].mean(axis=0)
    for n, v in zip(measured.spheres, begin, strict=True):
        if v0[n - 1] == 0.0 and abs(v) > OFFSET * np.abs(measured.v).max():
            yield (
                f"Sphere {n} begins at {v:.3g} m/s, the scene has it at rest: take the "
                "instrument's offset off the data."
            )


def _require_start(measured: Record) -> None:
    """Sphere 1 is the striker, on its way to the wall."""
    v = measured.v.mean(axis=0)[:, 0]
    begin = v[:5].mean()
    if measured.spheres[0] != 1 or begin > ARRIVED * np.abs(v).max():
        return
    if begin < -ARRIVED * np.abs(v).max():
        raise UnusableRecord(
            f"sphere 1, the striker, starts at {begin:.3g} m/s, away from the wall; velocities "
            "towards the wall must be positive, turn the sign of the data or check its columns."
        )
    raise UnusableRecord(
        f"sphere 1, the striker, starts at {begin:.3g} m/s: the record begins after it has hit, or "
        "the columns are swapped; begin earlier or correct the header."
    )


def _require_waves(measured: Record) -> None:
    """Every sphere has moved by the end of the record."""
    v = measured.v.mean(axis=0)
    change = np.abs(v - v[:5].mean(axis=0)).max(axis=0)
    for n, moved in zip(measured.spheres, change, strict=True):
        if moved < STILL * np.abs(v).max():
            last = 1e3 * (measured.t[-1] - measured.t[0])
            raise UnusableRecord(
                f"no wave comes by sphere {n} within the {last:.4g} ms of the record, its velocity "
                f"changes by {moved:.2g} m/s; record longer, leave the sphere out or check its "
                "column."
            )


def require_samples(t: np.ndarray, time_scale: float) -> None:
    """Raise UnusableRecord where waves pass between two samples, or a record ends within one."""
    dt, last = t[1] - t[0], t[-1] - t[0]
    if dt > COARSEST * time_scale:
        raise UnusableRecord(
            f"a sample every {1e6 * dt:.3g} us is too seldom for contacts that move within "
            f"{1e6 * time_scale:.3g} us; measure with {1 / (COARSEST * time_scale):.3g} Hz or "
            "more, or correct the unit of time."
        )
    if last < SHORTEST * time_scale:
        raise UnusableRecord(
            f"the record lasts {1e6 * last:.3g} us, contacts move within {1e6 * time_scale:.3g} "
            "us; correct the unit of time or record longer."
        )


def cut_off(measured: Record, time_scale: float):
    """Sentences on spheres that stay at the end of what they show, as beyond a laser's range."""
    most = max(LEAST_FLAT, FLAT * time_scale / (measured.t[1] - measured.t[0]))
    for i, n in enumerate(measured.spheres):
        largest = np.abs(measured.v[:, :, i]).max()
        for sign in (1.0, -1.0):
            v = sign * measured.v[:, :, i]
            same = v > v.max() - SAME_VALUE * largest
            flat = max(map(_longest_run, same))
            if v.max() > ARRIVED * largest and flat > most:
                yield (
                    f"Sphere {n} stays at {sign * v.max():.3g} m/s, the end of what it shows, for "
                    f"{flat} samples: beyond the instrument's range?"
                )


def _longest_run(there: np.ndarray) -> int:
    """Samples of the longest run inside the record."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], there, [False]]).astype(int)))
    begin, end = edges[::2], edges[1::2]
    inside = (begin > 0) & (end < len(there))
    return int((end - begin)[inside].max(initial=0))


def unlike_the_model(signals: Signals, data, model, lag: float, dt: float, time_scale: float):
    """Sentences on data (k, m) that is unlike the model (k, m) it starts from, `lag` [s] later."""
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
        alike = np.corrcoef(late[:, i], data[:, i])[0, 1]
        if alike < ALIKE:
            yield (
                f"Sphere {sphere + 1} does not look like the model it starts from (correlation "
                f"{alike:.2f}): check its column, sign and time base."
            )


def on_repeats(raw: Aligned) -> Iterator[str]:
    """Sentences on repeats that were left out or shifted."""
    for i in raw.outliers:
        yield f"Repeat {i + 1} is unlike the others and was left out."
    spread = np.ptp(np.delete(raw.shift, raw.outliers))
    if spread > 5e-6:
        yield f"Repeats were shifted against each other by up to {1e6 * spread:.3g} us; undone."


def filters_of(
    band: float | None, instrument: float | None, t: np.ndarray, time_scale: float
) -> Filter:
    """Low-passes [Hz] of data and model; raises UnusableRecord for one that leaves nothing."""
    nyquist, least = 0.5 / (t[1] - t[0]), LOWEST / time_scale
    for name, value in (("band", band), ("instrument", instrument)):
        most = nyquist if name == "band" else 10 * nyquist
        if value is not None and not least < value < most:
            raise UnusableRecord(
                f"--{name} {value:g} Hz must be between {least:.4g} Hz, below which nothing is "
                f"left of the waves, and {most:g} Hz, given the data's {2 * nyquist:.4g} samples "
                "in a second; change it."
            )
    return Filter(band, instrument)


def first_touch(text: str, estimate: float, t: np.ndarray) -> float:
    """The time [s] that is given, or the estimate; raises UnusableRecord for one off the record."""
    if text in ("fit", "estimate"):
        return estimate
    try:
        found = float(text)
    except ValueError:
        found = np.nan
    low, high = (t[0] + share * (t[-1] - t[0]) for share in TRIGGERS)
    if not low < found < high:
        raise UnusableRecord(
            f"--trigger {text!r} must be fit, estimate, or the time of the first touch between "
            f"{low:.4g} and {high:.4g} s, given the record."
        )
    return found
