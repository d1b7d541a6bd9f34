"""Signals of the scene's sensors in a run, as its instrument records them."""

import numpy as np

from coupling import Impact
from coupling.band import Band
from coupling.sensors import Sensor, SensorRecord, flight, sensor_record
from dem.waves.chain_waves import ChainWaves
from workflows.files.record import SYNTHETIC
from workflows.report.summary import SensedArrival, SensorWaves
from workflows.scene import Instrument, Scene


def sensors(scene: Scene) -> tuple[Sensor, ...]:
    """The scene's sensors; a sensor of unknown gain has 1 V per unit of its quantity."""
    return tuple(
        Sensor(
            sensor.sphere - 1,
            sensor.quantity,
            sensor.gain if isinstance(sensor.gain, float) else 1.0,
            Band(sensor.low_pass, sensor.high_pass, sensor.order),
            sensor.noise,
            sensor.range,
        )
        for sensor in scene.output.sensors or ()
    )


def record(scene: Scene, impact: Impact, waves: ChainWaves) -> SensorRecord:
    """Signals of the sensors (k, m) with noise, filters and rounding, and the waves in them."""
    instrument = scene.output.instrument or Instrument()
    settings = instrument.model_dump(include={"sampling", "bits", "seed"})
    return sensor_record(sensors(scene), impact.trajectory, waves.tracks, **settings)


def csv_text(scene: Scene, record: SensorRecord) -> str:
    """The record as CSV, time [s] and a column for each sensor, as `calibrate` reads it."""
    names = [f"sphere {s.sphere} {s.quantity} [{s.unit}]" for s in scene.output.sensors]
    rows = np.column_stack([record.t, record.y])
    lines = [",".join([f"{row[0]:.9g}", *(f"{x:.9g}" for x in row[1:])]) for row in rows]
    return "\n".join([f"# {SYNTHETIC}", ", ".join(["time [s]", *names]), *lines, ""])


def sensor_waves(scene: Scene, record: SensorRecord) -> dict[str, SensorWaves]:
    """Largest value, time of flight and amplitude ratio of every sensor, by its label."""
    measured = {}
    for i, sensor in enumerate(scene.output.sensors):
        tof, arr = flight(record.waves[i])
        measured[sensor.label] = SensorWaves(
            unit=sensor.unit,
            largest=float(np.abs(record.y[:, i]).max()),
            arrivals=tuple(
                SensedArrival(name=wave.name, time_s=wave.time, height=wave.height)
                for wave in record.waves[i]
            ),
            tof_s=tof,
            arr=arr,
        )
    return measured
