"""Signals that the sensors on a chain record, and the waves in them."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import dem
from coupling.sensed_waves import SensedWave, sensed_waves
from coupling.sensors import Sensor, instants, measured, recorded, signals
from dem.waves.labels import labels
from dem.waves.tracks import WaveTrack


class SensorRecord(NamedTuple):
    """Signals (k, m) at the instrument's instants t (k,) [s], and the waves that each shows."""

    t: NDArray[np.float64]
    y: NDArray[np.float64]
    waves: tuple[tuple[SensedWave, ...], ...]


def sensor_record(
    sensors: Sequence[Sensor],
    run: dem.Trajectory,
    tracks: Sequence[WaveTrack],
    *,
    sampling: float,
    bits: int | None,
    seed: int,
) -> SensorRecord:
    """Signals of a run at a sampling rate [Hz], rounded to `bits` (None: not rounded), with noise
    from `seed`, and the waves in them."""
    at = instants(run.t, sampling)
    quantities = measured(sensors, run.t, run.x, run.v, run.contact_force)
    y = recorded(sensors, signals(sensors, run.t, quantities, at), bits, seed)
    waves = []
    for sensor, signal in zip(sensors, y.T, strict=True):
        named = labels(tracks, run.t, run.v[:, sensor.sphere], sensor.sphere + 1)
        waves.append(sensed_waves(sensor, at, signal, named))
    return SensorRecord(at, y, tuple(waves))
