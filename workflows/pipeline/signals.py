"""What the scene's sensors show of a run, as its instrument records it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from coupling import Impact
from coupling.band import Band
from coupling.records.record import SYNTHETIC
from coupling.sensed_waves import SensedWave, flight, sensed_waves
from coupling.sensors import Sensor, instants, measured, recorded, signals
from dem.waves.chain_waves import ChainWaves
from dem.waves.labels import labels
from workflows.results.summary import SensedArrival, SensorWaves
from workflows.scene import Instrument, Scene


class Recorded(NamedTuple):
    """Signals (k, m) at the instrument's instants t (k,) [s], and the waves that each shows."""

    t: NDArray[np.float64]
    y: NDArray[np.float64]
    waves: tuple[tuple[SensedWave, ...], ...]


def sensors(scene: Scene) -> tuple[Sensor, ...]:
    """The scene's sensors; a gain that is not known is 1 V per unit."""
    return tuple(
        Sensor(
            one.sphere - 1,
            one.quantity,
            one.gain if isinstance(one.gain, float) else 1.0,
            Band(one.low_pass, one.high_pass, one.order),
            one.noise,
            one.range,
        )
        for one in scene.output.sensors or ()
    )


def record(scene: Scene, impact: Impact, waves: ChainWaves) -> Recorded:
    """What the sensors record of the run."""
    run, own = impact.trajectory, sensors(scene)
    instrument = scene.output.instrument or Instrument()
    at = instants(run.t, instrument.sampling)
    quantities = measured(own, run.t, run.x, run.v, run.contact_force)
    y = recorded(own, signals(own, run.t, quantities, at), instrument.bits, instrument.seed)
    each = zip(own, y.T, strict=True)
    return Recorded(at, y, tuple(_waves(one, at, shown, run, waves) for one, shown in each))


def _waves(sensor: Sensor, t, y, run, waves: ChainWaves) -> tuple[SensedWave, ...]:
    named = labels(waves.tracks, run.t, run.v[:, sensor.sphere], sensor.sphere + 1)
    return sensed_waves(sensor, t, y, named)


def csv_text(scene: Scene, found: Recorded) -> str:
    """The record with a column for each sensor, as `calibrate` reads it."""
    names = [f"sphere {s.sphere} {s.quantity} [{s.unit}]" for s in scene.output.sensors]
    rows = np.column_stack([found.t, found.y])
    lines = [",".join([f"{row[0]:.9g}", *(f"{x:.9g}" for x in row[1:])]) for row in rows]
    return "\n".join([f"# {SYNTHETIC}", ", ".join(["time [s]", *names]), *lines, ""])


def sensor_waves(scene: Scene, found: Recorded) -> dict[str, SensorWaves]:
    """Largest value, time of flight and amplitude ratio of every sensor."""
    told = {}
    for i, one in enumerate(scene.output.sensors):
        tof, arr = flight(found.waves[i])
        told[one.label] = SensorWaves(
            unit=one.unit,
            largest=float(np.abs(found.y[:, i]).max()),
            arrivals=tuple(
                SensedArrival(name=wave.name, time_s=wave.time, height=wave.height)
                for wave in found.waves[i]
            ),
            tof_s=tof,
            arr=arr,
        )
    return told
