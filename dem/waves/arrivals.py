"""Solitary waves picked from the velocity of one sphere, and what the literature reads off them.

Incident waves are peaks of positive velocity (towards the wall), reflected ones of negative
velocity. J. Yang, C. Silvestro, D. Khatri, L. De Nardo, C. Daraio, Phys. Rev. E 83 (2011) 046606.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dem.kernels.arguments import Array
from dem.kernels.passages import fill_passages


class Arrival(NamedTuple):
    """One wave passing a sphere."""

    time: float  # [s] of the peak
    peak_velocity: float  # [m/s], negative for a reflected wave
    width: float  # [s] full width at half maximum, nan if the record cuts it
    quality: float = float("nan")  # 1: a solitary wave, 0: nothing like it; nan: not judged


class WavePair(NamedTuple):
    """Incident and first reflected wave at one sphere."""

    incident: Arrival
    reflected: Arrival
    tof: float  # [s] between the two peaks
    arr: float  # |reflected| / incident peak velocity


def arrivals(t: ArrayLike, v: ArrayLike, *, threshold: float = 0.2) -> list[Arrival]:
    """Waves in a record v (k,) at equal times t (k,), in order of time.

    A wave is a peak of |v| above `threshold` times the largest, the highest between two passages
    of |v| through that level; its time and height are those of a parabola through three samples.
    """
    t, v = np.asarray(t, float), np.asarray(v, float)
    largest = np.abs(v).max(initial=0.0)
    if largest == 0.0:
        return []

    # runs of samples above the level, of one sign each; no wave is cut by the ends of the record
    above = np.where(np.abs(v) >= threshold * largest, np.sign(v), 0.0)
    edges = np.flatnonzero(np.diff(above)) + 1
    waves = []
    for run in np.split(np.arange(v.size), edges):
        sign = above[run[0]]
        k = run[np.abs(v[run]).argmax()]
        if sign == 0.0 or not 0 < k < v.size - 1:
            continue
        time, height = crest(t, sign * v, k)
        waves.append(Arrival(time, float(sign * height), full_width(t, sign * v, k)))
    return waves


def crest(t: Array, y: Array, k: int) -> tuple[float, float]:
    """Time and height of the parabola through the samples k - 1, k, k + 1 of y (k,)."""
    y0, y1, y2 = y[k - 1 : k + 2]
    curvature = y0 - 2.0 * y1 + y2
    if curvature >= 0.0:  # no crest, but a plateau
        return float(t[k]), float(y1)
    offset = 0.5 * (y0 - y2) / curvature
    height = y1 - 0.25 * (y0 - y2) * offset
    return float(t[k] + offset * (t[1] - t[0])), float(height)


def peaks(y: ArrayLike, prominence: float) -> list[int]:
    """Samples where y (k,) has a peak that stands out by `prominence` on both sides."""
    y = np.asarray(y, float)
    tops = np.flatnonzero((y[1:-1] > y[:-2]) & (y[1:-1] >= y[2:])) + 1
    return [int(k) for k in tops if y[k] - max(_foot(y[k::-1]), _foot(y[k:])) >= prominence]


def _foot(y):
    """Lowest of the values from y[0] on to the first one above it."""
    higher = y > y[0]
    return y[: higher.argmax()].min() if higher.any() else y.min()


def full_width(t: Array, y: Array, k: int) -> float:
    """Full width [s] at half the height of the crest near sample k of y (k,), nan if cut off."""
    level = 0.5 * crest(t, y, k)[1]
    below = np.flatnonzero(y < level)
    rising, falling = below[below < k], below[below > k]
    if not rising.size or not falling.size:
        return float("nan")
    i, j = rising[-1], falling[0]
    rise = t[i] + (level - y[i]) / (y[i + 1] - y[i]) * (t[i + 1] - t[i])
    fall = t[j] - (level - y[j]) / (y[j - 1] - y[j]) * (t[j] - t[j - 1])
    return float(fall - rise)


def passage(t: Array, v: Array, **options) -> WavePair | None:
    """Incident wave and the first reflected one after it, None if either is missing."""
    waves = arrivals(t, v, **options)
    incident = next((w for w in waves if w.peak_velocity > 0.0), None)
    if incident is None:
        return None
    later = (w for w in waves if w.peak_velocity < 0.0 and w.time > incident.time)
    reflected = next(later, None)
    if reflected is None:
        return None
    return WavePair(
        incident,
        reflected,
        time_of_flight(incident, reflected),
        amplitude_ratio(incident, reflected),
    )


def time_of_flight(incident: Arrival, reflected: Arrival) -> float:
    """Time between the peaks of two arrivals [s]."""
    return reflected.time - incident.time


def amplitude_ratio(incident: Arrival, reflected: Arrival) -> float:
    """|reflected| over incident peak velocity."""
    return abs(reflected.peak_velocity / incident.peak_velocity)


def velocity_sum_ratio(v_before: Array, v_after: Array) -> float:
    """|sum of final| over sum of initial velocities: no measure of loss, 1.36 for 17 elastic beads
    on a rigid wall (E. Falcon, C. Laroche, S. Fauve, C. Coste, Eur. Phys. J. B 3 (1998) 45); nan
    where the initial ones cancel."""
    start = abs(np.sum(v_before))
    if start <= 1e-12 * np.sum(np.abs(v_before)):  # they cancel but for rounding
        return float("nan")
    return float(abs(np.sum(v_after)) / start)


def energy_restitution(mass: Array, v_before: Array, v_after: Array) -> float:
    """sqrt of final over initial kinetic energy: 1 without loss."""
    return float(np.sqrt((mass @ np.square(v_after)) / (mass @ np.square(v_before))))


def passages(t: Array, v: Array, *, threshold: float = 0.2) -> Array:
    """(m, 4) time [s] and peak velocity [m/s] of the incident wave and of the first reflected one
    of `passage` for records v (m, k) at equal times t (k,); nan for a wave that there is not."""
    waves = np.empty((len(v), 4))
    fill_passages(np.ascontiguousarray(v, float), threshold, waves)
    waves[:, ::2] = t[0] + waves[:, ::2] * (t[1] - t[0])
    return waves
