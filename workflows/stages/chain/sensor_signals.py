"""Signals of the scene's sensors in a run, as its instrument records them."""

from collections.abc import Sequence
from itertools import count
from typing import TYPE_CHECKING, Any

import numpy as np

from beadwave.coupling import Impact
from beadwave.coupling.band import Band
from beadwave.coupling.sensors import Sensor, SensorRecord, echo, sensor_record
from beadwave.dem.waves.chain_waves import ChainWaves
from beadwave.workflows.files.record import SYNTHETIC, csv_of_signals
from beadwave.workflows.report.summary import SensedArrival, SensorWaves
from beadwave.workflows.scene import Instrument, Scene
from beadwave.workflows.scene.places import sensor_places
from beadwave.workflows.scene.tables.sensors import low_pass_of
from beadwave.workflows.stages.chain.damping import damping

if TYPE_CHECKING:
    from beadwave.coupling.modes_at_amplitude import SettledRun
    from beadwave.coupling.structure_sensors import SensorSignals
    from beadwave.dem.space import RowRun
    from beadwave.rom import ReducedModel
    from beadwave.workflows.stages.structure.several import ChainContacts


def sensors(scene: Scene) -> tuple[Sensor, ...]:
    """The scene's sensors; a sensor of unknown gain has 1 V per unit of its quantity, one on the
    structure without a low pass that of the reduced model's band."""
    column, chains = count(), [row.name for row in scene.chains or ()]
    return tuple(
        Sensor(
            None if sensor.sphere is None else sensor.sphere - 1,
            sensor.quantity,
            sensor.gain if isinstance(sensor.gain, float) else 1.0,
            Band(low_pass_of(sensor, scene.reduction), sensor.high_pass, sensor.order),
            sensor.noise,
            sensor.range,
            next(column) if sensor.sphere is None else None,
            0 if sensor.chain is None else chains.index(sensor.chain),
        )
        for sensor in scene.output.sensors or ()
    )


def record(
    scene: Scene,
    impact: Impact,
    waves: ChainWaves,
    reduced: "ReducedModel | None" = None,
    amplitudes: "SettledRun | None" = None,
    *,
    structure: "SensorSignals | None" = None,
) -> SensorRecord:
    """Signals of the sensors (k, m) with noise, filters and rounding, and the waves in them; of
    those on the structure as it moves, or by its reduced model, which the contact force drives."""
    if reduced is not None:
        from beadwave.coupling.structure_sensors import sensed_in_run

        run, law = impact.trajectory, damping(scene.damping, reduced)
        force, at = run.contact_force[:, -1], amplitudes.largest if amplitudes else ()
        structure = sensed_in_run(reduced, run.t, force, damping=law, at_amplitude=at)
    return _recorded(scene, [(impact.trajectory, waves.tracks)], structure)


def record_of_chains(
    scene: Scene,
    runs: Sequence["tuple[RowRun, ChainWaves]"],
    reduced: "ReducedModel",
    places: "ChainContacts",
) -> SensorRecord:
    """`record` of several chains, whose forces drive the structure together."""
    structure = None
    if sensor_places(scene):
        from beadwave.coupling.structure_sensors import sensed_in_run

        contacts = np.column_stack([reduced.w, reduced.columns.load])
        force = np.column_stack(
            [run.contact_force[:, -1] for run, _ in runs]
            + [runs[i][0].across.friction_force for i in places.rubbing]
        )
        structure = sensed_in_run(
            reduced, runs[0][0].t, force, contacts=contacts, damping=damping(scene.damping, reduced)
        )
    return _recorded(scene, [(run, waves.tracks) for run, waves in runs], structure)


def _recorded(
    scene: Scene, runs: Sequence[tuple[Any, Any]], structure: "SensorSignals | None"
) -> SensorRecord:
    """Runs with their waves, as the scene's instrument records them."""
    instrument = scene.output.instrument or Instrument()
    settings = instrument.model_dump(include={"sampling", "bits", "seed"})
    return sensor_record(sensors(scene), runs, structure=structure, **settings)


def csv_text(scene: Scene, record: SensorRecord) -> str:
    """The record as CSV, time [s] and a column for each sensor, as `calibrate` reads it."""
    names = [
        f"{f'{s.chain} ' if s.chain else ''}sphere {s.sphere} {s.quantity} [{s.unit}]"
        if s.on is None
        else f"{s.label} [{s.unit}]"
        for s in scene.output.sensors
    ]
    return csv_of_signals(SYNTHETIC, names, record.t, record.y)


def sensor_waves(scene: Scene, record: SensorRecord) -> dict[str, SensorWaves]:
    """Largest value, echo delay and echo ratio of every sensor, by its label."""
    measured = {}
    for i, sensor in enumerate(scene.output.sensors):
        delay, ratio = echo(record.waves[i])
        measured[sensor.label] = SensorWaves(
            unit=sensor.unit,
            largest=float(np.abs(record.y[:, i]).max()),
            arrivals=tuple(
                SensedArrival(name=wave.name, time_s=wave.time, height=wave.height)
                for wave in record.waves[i]
            ),
            echo_delay_s=delay,
            echo_ratio=ratio,
        )
    return measured
