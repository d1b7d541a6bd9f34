"""Solitary waves picked from the velocity of one sphere; echo delay and echo ratio.

Incident waves are peaks of positive velocity (towards the wall), reflected ones of negative
velocity. J. Yang, C. Silvestro, D. Khatri, L. De Nardo, C. Daraio, Phys. Rev. E 83 (2011) 046606.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from beadwave.dem.kernels.arguments import Array
from beadwave.dem.kernels.passages import LASTING, PLATEAU, fill_passages


class Arrival(NamedTuple):
    """One wave passing a sphere."""

    time: float  # [s] of the peak
    peak_velocity: float  # [m/s], negative for a reflected wave
    width: float  # [s] full width at half maximum, nan if the record ends within it
    quality: float = float("nan")  # 1: a solitary wave, 0: nothing like it; nan: not judged


class WavePair(NamedTuple):
    """Incident and first reflected wave at one sphere."""

    incident: Arrival
    reflected: Arrival
    echo_delay: float  # [s] between the two peaks; TOF, of the whole chain, is in `measures`
    echo_ratio: float  # |reflected| / incident peak velocity; ARR is its power 6/5, along the chain


def arrivals(
    t: ArrayLike, v: ArrayLike, *, threshold: float = 0.2, smallest: float = 0.0
) -> list[Arrival]:
    """Waves in the velocity v (k,) [m/s] of a sphere at equally spaced times t (k,) [s], in order
    of time.

    Each stretch in which |v| stays above `threshold` times its largest value is one wave; time
    and height are those of the parabola through its highest sample and the two next to it. A wave
    that leaves its sphere moving, as the last one of a free chain, arrives when the velocity no
    longer changes. A sphere that never exceeds `smallest` [m/s] has none.
    """
    t, v = np.asarray(t, float), np.asarray(v, float)
    largest = np.abs(v).max(initial=0.0)
    if largest <= smallest:
        return []

    # runs of samples above the level, of one sign each; a crest at either end of the record is no
    # wave, since what comes before or after it is unknown
    above = np.where(np.abs(v) >= threshold * largest, np.sign(v), 0.0)
    edges = np.flatnonzero(np.diff(above)) + 1
    waves = []
    for run in np.split(np.arange(v.size), edges):
        sign = above[run[0]]
        first, k = (run[0] + place for place in plateau(sign * v[run]))
        if sign == 0.0 or not 0 < first < v.size - 1:
            continue
        if first < k:
            time, height = float(t[first]), sign * v[k]
        else:
            time, height = crest(t, sign * v, k)
        waves.append(Arrival(time, float(sign * height), full_width(t, sign * v, k)))
    return waves


def plateau(y: Array) -> tuple[int, int]:
    """First sample of the plateau around the highest sample of y (n,), and that one, which rounding
    chooses among those of a plateau; twice the highest where it is a crest. A plateau lasts for a
    good part of the rise that leads to it, a crest for a hundredth."""
    k = int(y.argmax())
    lower = np.flatnonzero(y < y[k] * (1.0 - PLATEAU))
    before, after = lower[lower < k], lower[lower > k]
    first = int(before[-1]) + 1 if before.size else 0
    end = int(after[0]) if after.size else y.size
    half = np.flatnonzero(y[:first] < 0.5 * y[k])
    rise = first - (int(half[-1]) if half.size else 0)
    return (first if end - first > LASTING * rise else k), k


def crest(t: Array, y: Array, k: int) -> tuple[float, float]:
    """Time [s] and height of the vertex of the parabola through the samples k - 1, k and k + 1 of
    y (n,); sample k itself where the three have no maximum."""
    y0, y1, y2 = y[k - 1 : k + 2]
    curvature = y0 - 2.0 * y1 + y2
    if curvature >= 0.0:  # no crest, but a plateau
        return float(t[k]), float(y1)
    offset = 0.5 * (y0 - y2) / curvature
    height = y1 - 0.25 * (y0 - y2) * offset
    return float(t[k] + offset * (t[1] - t[0])), float(height)


def peaks(y: ArrayLike, prominence: float) -> list[int]:
    """Samples where y (n,) has a peak that stands `prominence` above the lowest value on either
    side, up to the next higher sample or the end of the record."""
    y = np.asarray(y, float)
    tops = np.flatnonzero((y[1:-1] > y[:-2]) & (y[1:-1] >= y[2:])) + 1
    if not tops.size:
        return []
    heights = y[tops].tolist()
    valleys = np.minimum.reduceat(y, np.r_[0, tops]).tolist()  # n + 1, around and between the peaks
    before = _feet(heights, valleys[:-1])
    after = _feet(heights[::-1], valleys[:0:-1])[::-1]
    foot = np.maximum(before, after)
    return [int(k) for k in tops[y[tops] - foot >= prominence]]


def _feet(heights, valleys):
    """Lowest value between each peak of `heights` (n,) and the last higher one before it, from the
    lowest value (n,) just before each. Peaks that are passed by a higher one are looked at once."""
    feet, higher = [], []
    for height, foot in zip(heights, valleys, strict=True):
        while higher and higher[-1][0] <= height:
            foot = min(foot, higher.pop()[1])
        higher.append((height, foot))
        feet.append(foot)
    return feet


def full_width(t: Array, y: Array, k: int) -> float:
    """Full width [s] at half the height of the crest near sample k of y (n,), between samples by
    linear interpolation; nan if y does not fall to half on both sides within the record."""
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
    """First incident wave at a sphere and the first reflected one after it, from its velocity
    v (k,) [m/s] at times t (k,) [s]; None if either is missing. `options` are those of `arrivals`.
    """
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
        echo_delay(incident, reflected),
        echo_ratio(incident, reflected),
    )


def echo_delay(incident: Arrival, reflected: Arrival) -> float:
    """Time [s] at one sphere from the peak of the incident wave to that of the reflected one."""
    return reflected.time - incident.time


def echo_ratio(incident: Arrival, reflected: Arrival) -> float:
    """|reflected| over incident peak velocity at one sphere, without unit."""
    return abs(reflected.peak_velocity / incident.peak_velocity)


def velocity_sum_ratio(v_before: Array, v_after: Array) -> float:
    """|sum of final| over |sum of initial velocities| of spheres (n,), (2.8) of the thesis.

    No measure of loss: 17 elastic beads on a rigid wall give 1.36 (E. Falcon, C. Laroche, S. Fauve,
    C. Coste, Eur. Phys. J. B 3 (1998) 45). nan where the initial velocities cancel.
    """
    start = abs(np.sum(v_before))
    if start <= 1e-12 * np.sum(np.abs(v_before)):  # they cancel but for rounding
        return float("nan")
    return float(abs(np.sum(v_after)) / start)


def energy_restitution(mass: Array, v_before: Array, v_after: Array) -> float:
    """Square root of final over initial kinetic energy of spheres of mass (n,) [kg] with velocities
    (n,) [m/s]: a coefficient of restitution of the chain, 1 without loss."""
    return float(np.sqrt((mass @ np.square(v_after)) / (mass @ np.square(v_before))))


def passages(t: Array, v: Array, *, threshold: float = 0.2) -> Array:
    """`passage` for many records v (m, k) [m/s] at equally spaced times t (k,) [s], compiled.

    Returns (m, 4): time [s] and peak velocity [m/s] of the incident wave, then of the first
    reflected one; nan where a wave is missing.
    """
    waves = np.empty((len(v), 4))
    fill_passages(np.ascontiguousarray(v, float), threshold, waves)
    waves[:, ::2] = t[0] + waves[:, ::2] * (t[1] - t[0])
    return waves
