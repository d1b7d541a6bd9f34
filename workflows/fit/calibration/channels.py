"""What the sensors of a record are in the words of a scene, and the record in velocities."""

import numpy as np

import dem.spheres
from workflows.files.record import Record
from workflows.fit.core.calibration import scaling
from workflows.fit.core.calibration.parameters import Rig
from workflows.fit.core.calibration.scaling import Scaled
from workflows.fit.core.calibration.sensed import Channels
from workflows.fit.records import sensor_of
from workflows.scene import Scene
from workflows.scene.sensors import KINDS
from workflows.scene.units import GAINS, VOLTAGE
from workflows.stages.chain import initial_velocity


def scaled(scene: Scene, rig: Rig, record: Record) -> Scaled:
    """The record of any sensors in velocities; raises UnusableRecord where a signal cannot be
    one, InvalidScene where the scene does not have its sphere."""
    if record.channels is None:
        return Scaled(record, None, (), ())
    plain, groups = zip(*(sensor_of(scene, one) for one in record.channels), strict=True)
    groups = tuple(name and name.removeprefix("sphere ") for name in groups)
    units = tuple(VOLTAGE.unit if c.in_volts else KINDS[c.quantity].unit for c in record.channels)
    labels = tuple(f"{c.quantity} {c.sphere}" for c in record.channels)
    bare = Channels(plain, np.ones(len(plain)), labels, units, groups)
    spheres = dem.spheres.mass(scene.chain.radius, scene.chain.density)
    momentum = float(np.sum(spheres * initial_velocity(scene)))
    gain_units = {quantity: kind.unit for quantity, kind in GAINS.items()}
    return scaling.scaled(rig, record, bare, gain_units, momentum)
