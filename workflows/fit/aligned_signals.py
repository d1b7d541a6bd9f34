"""Measured velocities as a calibration takes them: repeats laid over each other and averaged, the
same filter on data and model, and the waves told apart.

Repeats that the trigger has shifted are moved onto their mean by the least-squares shift of all
spheres together, which for small shifts is the maximum of the cross-correlation.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfilt, sosfilt_zi, sosfiltfilt

from beadwave.workflows.fit.sensed import Channels

ORDER = 4  # of both filters, Butterworth
DELAY = 1.0 / np.sin(np.pi / 8.0)  # at low frequency, times the angular cut-off, of order 4


# Alignment of repeats; not varied systematically
ALIGNMENT_ROUNDS = 6  # of least-squares shifts to the mean
N_CHANGES = 200  # of a record over which changes are taken: plateaus do not count
ALIKE_CORRELATION = 0.9  # correlation with the median of all below which a repeat is left out


# Limits of waves and calm; not varied systematically
REFLECTED_PEAK = 0.1  # of the largest velocity: a reflected wave has arrived
QUIET_ACCELERATION = 0.02  # of the largest acceleration: a wave has passed
CALM_SLOPE = 0.05  # of the largest slope: no wave, noise included
MIN_QUIET = 20  # half contact time scales without waves, that show the noise at least


class Signals(NamedTuple):
    """Mean velocities of m spheres over equal times."""

    t: np.ndarray  # (k,) [s]
    v: np.ndarray  # (k, m) [m/s] towards the wall
    spheres: tuple[int, ...]  # (m,) counted from 0
    spread: np.ndarray  # (m,) [m/s] standard deviation of one repeat; nan of a single one
    repeats: int = 1
    channels: Channels | None = None  # sensors that v stands for; None: velocities of the spheres

    @property
    def names(self) -> tuple[str, ...]:
        """Names (m,) of the sensors, or the numbers of the spheres, counted from 1."""
        return self.channels.labels if self.channels else tuple(str(n + 1) for n in self.spheres)

    def only(self, columns) -> "Signals":
        """These columns alone."""
        chosen = tuple(self.spheres[c] for c in columns)
        channels = self.channels and self.channels.only(columns)
        return self._replace(
            v=self.v[:, columns], spheres=chosen, spread=self.spread[columns], channels=channels
        )


class AlignedRepeats(NamedTuple):
    """Repeats laid over each other, and by how much each was late."""

    signals: Signals
    shift: np.ndarray  # (r,) [s]
    outliers: tuple[int, ...]  # repeats that are unlike the others, left out of the mean


class Filter(NamedTuple):
    """Low-pass filters: `band` without phase on data and model, `instrument` causal on the model
    alone, since the data has passed the instrument's own. None: no filter. [Hz]"""

    band: float | None = None
    instrument: float | None = None

    def refinement(self, dt: float) -> int:
        """Samples of the model per sample of the data that the instrument's filter needs."""
        return 1 if self.instrument is None else int(np.ceil(10.0 * self.instrument * dt))

    def lag(self, dt: float) -> float:
        """Time [s] by which the instrument is later than its digital filter at low frequency."""
        if self.instrument is None:
            return 0.0
        omega, rate = 2.0 * np.pi * self.instrument, self.refinement(dt) / dt
        return DELAY * (1.0 / omega - 0.5 / (rate * np.tan(0.5 * omega / rate)))

    def of_data(self, v: np.ndarray, dt: float) -> np.ndarray:
        """v (k, ..) filtered along its first axis."""
        if self.band is None:
            return v
        return sosfiltfilt(low_pass(self.band, 1.0 / dt)[0], v, axis=0)

    def of_model(self, v: np.ndarray, dt: float) -> np.ndarray:
        """v (k * refinement, ..) at refined times as the instrument and the filter show it."""
        fine = self.refinement(dt)
        if self.instrument is not None:
            sos, start = low_pass(self.instrument, fine / dt)
            start = start.reshape(*start.shape, *[1] * (v.ndim - 1)) * v[0]
            v = sosfilt(sos, v, axis=0, zi=start)[0][::fine]
        return self.of_data(v, dt)


@cache
def low_pass(cut: float, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Second-order sections (n_sections, 6) of a low-pass [Hz], and their state (n_sections, 2) at
    rest at a constant input of 1; `rate` in samples per second."""
    sos = butter(ORDER, cut, fs=rate, output="sos")
    return sos, sosfilt_zi(sos)


def aligned(
    t: np.ndarray, v: np.ndarray, spheres: tuple[int, ...], move: bool = True
) -> AlignedRepeats:
    """The mean of repeats v (r, k, m) [m/s], each first moved onto the others unless `move` is
    False; t (k,) [s] has equal steps, the spheres (m,) are counted from 0."""
    n = len(v)
    if n == 1:
        none = np.full(v.shape[2], np.nan)
        return AlignedRepeats(Signals(t, v[0], spheres, none), np.zeros(1), ())

    # to a sample of the first repeat, then by least squares to the mean, which moves with them:
    # a repeat that is ds late is mean - slope ds, so ds = -<slope, repeat - mean> / <slope, slope>
    shift = np.zeros(n)
    if move:
        shift = np.array([shift_to_a_sample(t, v[0], repeat) for repeat in v])
        for _ in range(ALIGNMENT_ROUNDS):
            moved = shifted(t, v, shift)
            mean = moved.mean(axis=0)
            slope = np.gradient(mean, t, axis=0)
            products = np.array([np.sum(slope * (repeat - mean)) for repeat in moved])
            shift = shift - products / np.sum(slope**2)

    # repeats unlike the median of all are left out, unless most are
    moved = shifted(t, v, shift)
    median = np.median(moved, axis=0).ravel()
    correlation = np.array([np.corrcoef(repeat.ravel(), median)[0, 1] for repeat in moved])
    alike = correlation >= ALIKE_CORRELATION
    if alike.sum() < max(2, n / 2):
        alike = correlation > -2.0  # all but those that have none

    # times of the mean are those of the mean repeat: shifts of those that count have the mean 0
    shift -= shift[alike].mean()
    moved = shifted(t, v, shift)[alike]
    spread = moved.std(axis=0, ddof=1)
    spread = np.sqrt((spread**2).mean(axis=0))
    signals = Signals(t, moved.mean(axis=0), spheres, spread, len(moved))
    return AlignedRepeats(signals, shift, tuple(int(i) for i in np.flatnonzero(~alike)))


def shift_to_a_sample(t: np.ndarray, reference: np.ndarray, v: np.ndarray) -> float:
    """Lag [s] of v (k, m) behind the reference (k, m), to a sample: where the cross-correlation of
    their changes over k / `changes` samples is largest."""
    q = max(1, len(t) // N_CHANGES)
    v, reference = v[q:] - v[:-q], reference[q:] - reference[:-q]
    k = len(v)
    product = np.fft.rfft(v, 2 * k, axis=0) * np.conj(np.fft.rfft(reference, 2 * k, axis=0))
    correlation = np.fft.irfft(product.sum(axis=1), 2 * k)
    lag = int(correlation.argmax())
    return (lag - 2 * k if lag >= k else lag) * (t[1] - t[0])


def shifted(t: np.ndarray, v: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """Repeats v (r, k, m) read at t + shift (r,) [s], held constant beyond their ends."""
    if not shift.any():
        return v
    at = [np.clip(t + s, t[0], t[-1]) for s in shift]
    return np.array([CubicSpline(t, x, axis=0)(times) for x, times in zip(v, at, strict=True)])


def lag_of(t: np.ndarray, v: np.ndarray, model: np.ndarray) -> float:
    """Lag [s] of the data v (k, m) behind the model (k, m), to a fraction of a sample."""
    coarse = shift_to_a_sample(t, model, v)
    late = shifted(t, model[None], np.array([-coarse]))[0]
    slope = np.gradient(late, t, axis=0)
    return coarse - float(np.sum(slope * (v - late)) / np.sum(slope**2))


def rise(t: np.ndarray, y: np.ndarray) -> float:
    """Time [s] at which the first of the signals y (k, m) has risen to its first wave."""
    share = np.abs(y - y[0]).max(axis=1) / np.abs(y - y[0]).max()
    level = 0.3  # of the largest signal: the level at which a first wave has arrived
    i = max(int(np.argmax(share > level)), 1)
    return float(np.interp(level, share[i - 1 : i + 1], t[i - 1 : i + 1]))


def noise_between_waves(t: np.ndarray, v: np.ndarray, time_scale: float) -> float | None:
    """rms [m/s] of the noise in velocities v (k, m), from where no wave passes; None where there
    are too few such samples. `time_scale` [s] is that of a contact.

    A second difference v_i+q - 2 v_i + v_i-q over half of that time leaves noise that is no longer
    correlated after q samples, with six times its variance, and nothing of a steady motion.
    """
    q = max(1, round(0.5 * time_scale / (t[1] - t[0])))
    if len(t) <= 8 * q:
        return None
    differences = np.concatenate([calm_second_differences(column, q) for column in v.T])
    if differences.size < MIN_QUIET * q:
        return None
    return float(np.sqrt(np.mean(differences**2) / 6.0))


def calm_second_differences(v: np.ndarray, q: int) -> np.ndarray:
    """Second differences over q samples of v (k,) in the middle of a calm of 6 q samples, along
    which the running mean of 2 q samples changes by little."""
    smooth = np.convolve(v, np.ones(2 * q) / (2 * q), mode="same")
    smooth[:q], smooth[-q:] = v[: 2 * q].mean(), v[-2 * q :].mean()
    slope = np.abs(smooth[q:] - smooth[:-q])
    calm = slope < CALM_SLOPE * slope.max()
    calm = np.convolve(calm, np.ones(5 * q), mode="valid") > 5 * q - 0.5
    difference = v[2 * q :] - 2.0 * v[q:-q] + v[: -2 * q]
    return difference[2 * q : 2 * q + len(calm)][calm]


def first_waves_end(t: np.ndarray, v: np.ndarray, pause: float) -> np.ndarray:
    """(m,) times [s] at which the first reflected wave has passed each sphere, by a model v (k, m).

    It arrives when the velocity first turns away from the wall by a share `REFLECTED_PEAK` of the
    largest, and has passed when the acceleration has stayed below a share `QUIET_ACCELERATION` of
    the largest for `pause` [s]; the end of the record where it does not.
    """
    ends = np.full(v.shape[1], float(t[-1]))
    width = max(1, round(pause / (t[1] - t[0])))
    for i, column in enumerate(v.T):
        arrived = np.flatnonzero(column < -REFLECTED_PEAK * np.abs(column).max())
        if not arrived.size:
            continue
        acceleration = np.abs(np.gradient(column, t))
        quiet = (acceleration < QUIET_ACCELERATION * acceleration.max()).astype(float)
        calm = np.convolve(quiet, np.ones(width), mode="valid") >= width - 0.5
        passed = np.flatnonzero(calm[arrived[0] :])
        if passed.size:
            ends[i] = t[arrived[0] + passed[0]]
    return ends


def noise_of_mean(signals: Signals, filters: Filter, time_scale: float) -> float | None:
    """rms [m/s] of the noise in the mean signals, by the repeats or by what lies between waves."""
    if signals.repeats > 1 and np.isfinite(signals.spread).all():
        return float(np.sqrt(np.mean(signals.spread**2) / signals.repeats))
    dt = signals.t[1] - signals.t[0]
    return noise_between_waves(signals.t, filters.of_data(signals.v, dt), time_scale)
