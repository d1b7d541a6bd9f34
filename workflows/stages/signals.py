"""What the scene's sensors show of a run, as its instrument records it."""

import numpy as np

from coupling import Impact
from coupling.band import Band
from coupling.sensed_waves import flight
from coupling.sensor_record import SensorRecord, sensor_record
from coupling.sensors import Sensor
from dem.waves.chain_waves import ChainWaves
from workflows.files.record import SYNTHETIC
from workflows.report.summary import SensedArrival, SensorWaves
from workflows.scene import Instrument, Scene


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


def record(scene: Scene, impact: Impact, waves: ChainWaves) -> SensorRecord:
    """What the sensors record of the run."""
    instrument = scene.output.instrument or Instrument()
    taken = instrument.model_dump(include={"sampling", "bits", "seed"})
    return sensor_record(sensors(scene), impact.trajectory, waves.tracks, **taken)


def csv_text(scene: Scene, found: SensorRecord) -> str:
    """The record with a column for each sensor, as `calibrate` reads it."""
    names = [f"sphere {s.sphere} {s.quantity} [{s.unit}]" for s in scene.output.sensors]
    rows = np.column_stack([found.t, found.y])
    lines = [",".join([f"{row[0]:.9g}", *(f"{x:.9g}" for x in row[1:])]) for row in rows]
    return "\n".join([f"# {SYNTHETIC}", ", ".join(["time [s]", *names]), *lines, ""])


def sensor_waves(scene: Scene, found: SensorRecord) -> dict[str, SensorWaves]:
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
