"""Waves in the signal of a sensor: crests of the waves that are named at its sphere.

A force has the same sign for a wave of either direction, a velocity that of the direction. A force
rate is integrated to a force and a displacement differentiated to a velocity before crests are
sought, since only these have one crest a wave.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from coupling.sensors import Sensor
from dem.waves.labels import Label


class CrestSearch(NamedTuple):
    """Where a wave's crest is sought, in widths of the wave; not varied."""

    top: float = 0.15  # to both sides of the crest, through which a parabola is laid
    early: float = 0.7  # before the wave's time
    late: float = 1.3  # behind it: a band delays what it shows


class SensedWave(NamedTuple):
    """A wave as a sensor shows it: the crest of the force or velocity in the signal's unit, times s
    where the sensor shows its rate, over s where its integral."""

    name: str
    time: float  # [s]
    height: float


def sensed_waves(
    sensor: Sensor,
    t: NDArray[np.float64],
    y: NDArray[np.float64],
    named: Sequence[Label],
    search: CrestSearch = CrestSearch(),
) -> tuple[SensedWave, ...]:
    """The waves named at the sensor's sphere that have a crest of their own in its signal (k,).

    A crest at the end of what is searched belongs to another wave, or to none.
    """
    if not named:
        return ()
    times = [label.arrival.time for label in named]
    midways = [-np.inf, *(0.5 * (a + b) for a, b in pairwise(times)), np.inf]
    dt, signal, waves = t[1] - t[0], np.sign(sensor.gain) * y, []
    for label, (start, end) in zip(named, pairwise(midways), strict=True):
        time, velocity, width, _ = label.arrival
        if not np.isfinite(width):
            continue

        # one crest a wave, positive in either direction
        reach = max(1, round(search.top * width / dt))  # samples
        direction = 1.0 if sensor.quantity.startswith("force") else np.sign(velocity)
        shape = direction * _force_or_velocity(sensor.quantity, t, signal, reach)

        # the highest sample near the wave's time, no nearer to another wave's
        low, high = max(time - search.early * width, start), min(time + search.late * width, end)
        inside = np.flatnonzero((t > low) & (t < high))
        if not len(inside):
            continue
        k = inside[shape[inside].argmax()]
        if k - reach <= inside[0] or k + reach >= inside[-1] or shape[k] <= 0.0:
            continue

        # a parabola through the top, between samples and less of the noise
        top = slice(k - reach, k + reach + 1)
        a, b, c = np.polyfit(t[top] - t[k], shape[top], 2)
        if a >= 0.0:
            continue
        crest, height = float(t[k] - 0.5 * b / a), float(direction * (c - 0.25 * b * b / a))
        waves.append(SensedWave(label.name, crest, height))
    return tuple(waves)


def _force_or_velocity(
    quantity: str, t: NDArray[np.float64], y: NDArray[np.float64], reach: int
) -> NDArray[np.float64]:
    """The signal with one crest a wave (k,): of a force rate its integral by trapezoids, of a
    displacement its slope over `reach` samples to both sides."""
    dt = t[1] - t[0]
    if quantity == "force-rate":
        return np.concatenate([[0.0], np.cumsum(0.5 * dt * (y[1:] + y[:-1]))])
    if quantity == "displacement":
        ends = np.pad(y, reach, mode="edge")
        return (ends[2 * reach :] - ends[: -2 * reach]) / (2 * reach * dt)
    return y


def flight(waves: Sequence[SensedWave]) -> tuple[float | None, float | None]:
    """Time [s] from the incident to the first reflected wave and the ratio of their heights; None
    where the sensor does not show both."""
    by_name = {wave.name: wave for wave in waves}
    incident, reflected = (by_name.get(name) for name in ("incident", "reflected 1"))
    if incident is None or reflected is None:
        return None, None
    return reflected.time - incident.time, abs(reflected.height / incident.height)
