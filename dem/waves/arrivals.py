"""Solitary waves picked from the velocity of one sphere, and what the literature reads off them.

Incident waves are peaks of positive velocity (towards the wall), reflected ones of negative
velocity. J. Yang, C. Silvestro, D. Khatri, L. De Nardo, C. Daraio, Phys. Rev. E 83 (2011) 046606.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dem.kernels.arguments import Array
from dem.kernels.passages import fill_passages

CANCEL = 1e-12  # of their sum without signs: below, velocities cancel but for rounding


class Arrival(NamedTuple):
    """One wave passing a sphere."""

    time: float  # [s] of the peak
    peak_velocity: float  # [m/s], negative for a reflected wave
    width: float  # [s] full width at half maximum, nan if the record cuts it
    quality: float = float("nan")  # 1: a solitary wave, 0: nothing like it; nan: not judged


class Passage(NamedTuple):
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
    above = np.where(np.abs(v) >= threshold * largest, np.sign(v), 0.0)
    edges = np.flatnonzero(np.diff(above)) + 1
    pieces = np.split(np.arange(v.size), edges)
    return [_arrival(t, v, piece) for piece in pieces if above[piece[0]] and _peaks(v, piece)]


def _peaks(v, piece):
    k = piece[np.abs(v[piece]).argmax()]
    return 0 < k < v.size - 1


def _arrival(t, v, piece):
    sign = np.sign(v[piece[0]])
    k = piece[np.abs(v[piece]).argmax()]
    time, height = crest(t, sign * v, k)
    return Arrival(time, float(sign * height), full_width(t, sign * v, k))


def crest(t: Array, y: Array, k: int) -> tuple[float, float]:
    """Time and height of the parabola through the samples k - 1, k, k + 1 of y (k,)."""
    offset, height = _vertex(y[k - 1 : k + 2])
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


def _vertex(y):
    curvature = y[0] - 2.0 * y[1] + y[2]
    if curvature >= 0.0:
        return 0.0, y[1]
    offset = 0.5 * (y[0] - y[2]) / curvature
    return offset, y[1] - 0.25 * (y[0] - y[2]) * offset


def full_width(t: Array, y: Array, k: int) -> float:
    """Full width [s] at half the height of the crest near sample k of y (k,), nan if cut off."""
    level = 0.5 * crest(t, y, k)[1]
    below = np.flatnonzero(y < level)
    before, after = below[below < k], below[below > k]
    if not before.size or not after.size:
        return float("nan")
    i, j = before[-1], after[0]
    left = t[i] + (level - y[i]) / (y[i + 1] - y[i]) * (t[i + 1] - t[i])
    right = t[j] - (level - y[j]) / (y[j - 1] - y[j]) * (t[j] - t[j - 1])
    return float(right - left)


def passage(t: Array, v: Array, **options) -> Passage | None:
    """Incident wave and the first reflected one after it, None if either is missing."""
    waves = arrivals(t, v, **options)
    incident = next((w for w in waves if w.peak_velocity > 0.0), None)
    if incident is None:
        return None
    after = (w for w in waves if w.peak_velocity < 0.0 and w.time > incident.time)
    reflected = next(after, None)
    if reflected is None:
        return None
    return Passage(
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
    if start <= CANCEL * np.sum(np.abs(v_before)):
        return float("nan")
    return float(abs(np.sum(v_after)) / start)


def energy_restitution(mass: Array, v_before: Array, v_after: Array) -> float:
    """sqrt of final over initial kinetic energy: 1 without loss."""
    before, after = mass @ np.square(v_before), mass @ np.square(v_after)
    return float(np.sqrt(after / before))


def passages(t: Array, v: Array, *, threshold: float = 0.2) -> Array:
    """(m, 4) time [s] and peak velocity [m/s] of the incident wave and of the first reflected one
    of `passage` for records v (m, k) at equal times t (k,); nan for a wave that there is not."""
    found = np.empty((len(v), 4))
    fill_passages(np.ascontiguousarray(v, float), threshold, found)
    found[:, ::2] = t[0] + found[:, ::2] * (t[1] - t[0])
    return found
