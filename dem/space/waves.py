"""Arrivals of a wave at the spheres of a packing, and the speed of its front."""

from typing import NamedTuple

import numpy as np

from beadwave.dem.kernels.arguments import Array

FAINT = 1e-3  # of the largest speed: below it nothing arrives
FIRST = (
    0.1  # of a sphere's largest speed: a crest of less is none; beside a striker waves are faint
)


class Arrivals(NamedTuple):
    """Arrival of the wave at each of s spheres; nan where none arrives."""

    time: Array  # (s,) [s] of the first crest of the speed that is more than FIRST of the largest
    peak: Array  # (s,) [m/s] largest speed


def arrivals(t: Array, velocity: Array) -> Arrivals:
    """Arrivals of velocities (k, s, 3) [m/s] at equal times t (k,) [s]; a crest lies at the top of
    the parabola through the three samples about it."""
    speed = np.sqrt(np.einsum("ksx,ksx->ks", velocity, velocity))
    peak = speed.max(axis=0)
    time = np.full(len(peak), np.nan)
    for i in np.flatnonzero(peak > FAINT * peak.max(initial=0.0)):
        v = speed[:, i]
        before = np.insert(v[:-1], 0, -np.inf)
        crests = (v[:-1] >= v[1:]) & (v > before)[:-1] & (v[:-1] >= FIRST * peak[i])
        if not crests.any():  # it still rises when the record ends
            continue
        crest = int(np.argmax(crests))
        time[i] = t[crest]
        if crest > 0:
            a, b, c = v[crest - 1 : crest + 2]
            top = 0.5 * (a - c) / (a - 2.0 * b + c) if a + c < 2.0 * b else 0.0
            time[i] += top * (t[1] - t[0])
            peak[i] = max(peak[i], b - 0.25 * (a - c) * top)
    return Arrivals(time, peak)


def front_speed(centre: Array, struck: Array, arrival: Array, spacing: float) -> list[float | None]:
    """Speed [m/s] of the front along x, y and z: slope of the distance over the arrivals (s,) [s]
    of the spheres in line with the struck ones (indices), with centres (s, 3) [m]. In line are
    those beside them by less than half a spacing [m]; None along an axis with fewer than three."""
    low, high = centre[struck].min(axis=0), centre[struck].max(axis=0)
    speeds: list[float | None] = []
    for axis in range(3):
        across = [k for k in range(3) if k != axis]
        beside = np.maximum(low - centre, centre - high)[:, across].max(axis=1)
        along = np.maximum(low - centre, centre - high)[:, axis]
        line = (beside < 0.51 * spacing) & (along > 0.1 * spacing) & np.isfinite(arrival)
        time, way = arrival[line], along[line]
        if line.sum() < 3 or np.ptp(time) <= 0.0 or np.ptp(way) <= 0.0:
            speeds.append(None)
            continue
        speeds.append(float(abs(np.polyfit(time - time.mean(), way, 1)[0])))
    return speeds
