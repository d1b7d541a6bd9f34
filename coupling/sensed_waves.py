"""Waves in the signal of a sensor: the named waves of its sphere, found again as the sensor shows
them.

A wave presses a bead on either way: forces have one sign, velocities turn with the way. What is
searched is the force of a rate and the velocity of a displacement.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from coupling.sensors import Sensor
from dem.waves.labels import Label

TOP = 0.15  # widths to both sides of a crest, through which a parabola is laid
EARLY, LATE = 0.7, 1.3  # widths of a wave around its time: a band delays what it shows


class SensedWave(NamedTuple):
    """A wave as a sensor shows it: the crest of the force or velocity in the signal's unit, times s
    where the sensor shows its rate, over s where its integral."""

    name: str
    time: float  # [s]
    height: float


def sensed_waves(
    sensor: Sensor, t: NDArray[np.float64], y: NDArray[np.float64], named: Sequence[Label]
) -> tuple[SensedWave, ...]:
    """The waves named at the sensor's sphere that have a crest of their own in its signal (k,)."""
    if not named:
        return ()
    times = [label.arrival.time for label in named]
    between = [-np.inf, *(0.5 * (a + b) for a, b in pairwise(times)), np.inf]
    shown = np.sign(sensor.gain) * y
    each = (_crest(sensor.quantity, t, shown, one, ends) for one, ends in
            zip(named, pairwise(between), strict=True))  # fmt: skip
    return tuple(wave for wave in each if wave)


def _crest(quantity, t, y, label, ends):
    """The highest point near the wave's time, None where it lies at the end of what is searched."""
    at, velocity, width, _ = label.arrival
    if not np.isfinite(width):
        return None
    reach = max(1, round(TOP * width / (t[1] - t[0])))  # samples
    way = 1.0 if quantity.startswith("force") else np.sign(velocity)
    shown = way * _wave_like(quantity, t, y, reach)
    early, late = max(at - EARLY * width, ends[0]), min(at + LATE * width, ends[1])
    inside = np.flatnonzero((t > early) & (t < late))
    k = inside[shown[inside].argmax()] if len(inside) else None
    if k is None or k - reach <= inside[0] or k + reach >= inside[-1] or shown[k] <= 0.0:
        return None
    top = slice(k - reach, k + reach + 1)
    a, b, c = np.polyfit(t[top] - t[k], shown[top], 2)
    if a >= 0.0:
        return None
    return SensedWave(label.name, float(t[k] - 0.5 * b / a), float(way * (c - 0.25 * b * b / a)))


def _wave_like(quantity, t, y, reach):
    """The force of a rate, the velocity of a displacement over a few samples."""
    if quantity == "force-rate":
        dt = t[1] - t[0]
        return np.concatenate([[0.0], np.cumsum(0.5 * dt * (y[1:] + y[:-1]))])
    if quantity == "displacement":
        ends = np.pad(y, reach, mode="edge")
        return (ends[2 * reach :] - ends[: -2 * reach]) / (2 * reach * (t[1] - t[0]))
    return y


def flight(waves: Sequence[SensedWave]) -> tuple[float | None, float | None]:
    """Time [s] from the incident to the first reflected wave and the ratio of their heights; None
    where the sensor does not show both."""
    by_name = {wave.name: wave for wave in waves}
    one, two = (by_name.get(name) for name in ("incident", "reflected 1"))
    if one is None or two is None:
        return None, None
    return two.time - one.time, abs(two.height / one.height)
