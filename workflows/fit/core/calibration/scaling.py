"""Records of sensors as a calibration fits them: as velocities, and the gains to be found.

Each signal counts as much as the velocity of its sphere: what the start model shows for 1 m/s is
its scale. A voltage whose gain nobody knows is scaled by what the record shows.
"""

from typing import NamedTuple

import numpy as np

from dem.sensitivities import march_with_sensitivities, usual_step
from workflows.files.record import Record, UnusableRecord
from workflows.fit.core.calibration.impulse import Impulse, incident_impulse
from workflows.fit.core.calibration.parameters import Parameter, Rig
from workflows.fit.core.calibration.sensed import Channels, sensed
from workflows.fit.core.calibration.signals import noise_between_waves

WRONG, DOUBTFUL = 20.0, 3.0  # times what the start model shows
RISEN = 0.3  # of the largest value: the first excursion, which tells the sign
REACH, SCALE = 30.0, 0.1  # of a gain: bounds, and a change that counts as large
CUT = 0.02  # of an impulse: what lies beyond the end of its wave
CORRELATED = 4.0  # samples of noise that go together


class Scaled(NamedTuple):
    """A record in velocities, what they stand for, the gains to be found, what is doubtful."""

    record: Record
    channels: Channels | None
    gains: tuple[Parameter, ...]
    remarks: tuple[str, ...]


def scaled(
    rig: Rig, record: Record, bare: Channels, gain_units: dict[str, str], momentum: float
) -> Scaled:
    """The record of channels with a scale of 1 in velocities; raises UnusableRecord where a signal
    cannot be one. `gain_units` are by quantity, the striker's momentum is in N s."""
    data = record.v.mean(axis=0)
    model, speed = _start_model(rig, bare, record.t)
    gain = _unknown_gains(bare, data, model)
    ratio = np.abs(data).max(axis=0) / np.maximum(np.abs(gain * model).max(axis=0), 1e-300)
    remarks = [*_plausible(bare, ratio, data, model), *_impulses(momentum, bare, record, model)]
    scale = np.abs(gain * model).max(axis=0) / speed
    fitted = tuple(
        one._replace(gain=float(one.gain * g / s))
        for one, g, s in zip(bare.sensors, gain, scale, strict=True)
    )
    in_velocities = record._replace(v=record.v / scale)
    found = bare._replace(sensors=fitted, scale=scale)
    return Scaled(in_velocities, found, _gains(found, gain, gain_units), tuple(remarks))


def _start_model(rig: Rig, channels: Channels, t) -> tuple[np.ndarray, np.ndarray]:
    """Signals (k, m) of the scene as it is, from its first touch on, and the largest velocity (m,)
    of each sensor's sphere."""
    duration = t[-1] - t[0]
    run = march_with_sensitivities(
        rig.chain, rig.wall, rig.v0, duration=duration, dt=usual_step(rig.chain, rig.wall, rig.v0),
        observed=channels.observed,
    )  # fmt: skip
    spheres = [sensor.sphere for sensor in channels.sensors]
    return sensed(run, rig, channels, (), t - t[0])[0], np.abs(run.v[:, spheres]).max(axis=0)


def _unknown_gains(channels: Channels, data: np.ndarray, model: np.ndarray) -> np.ndarray:
    """(m,) 1 where the gain is known; the sign is that of the first excursion."""
    found = np.ones(len(channels.groups))
    for group in {name for name in channels.groups if name}:
        own = [i for i, name in enumerate(channels.groups) if name == group]
        ratio = np.abs(data[:, own]).max(axis=0) / np.abs(model[:, own]).max(axis=0)
        signs = [_first_sign(data[:, i]) * _first_sign(model[:, i]) for i in own]
        found[own] = np.median(ratio) * np.sign(np.sum(signs) or 1.0)
    return found


def _first_sign(y: np.ndarray) -> float:
    return float(np.sign(y[(np.abs(y) > RISEN * np.abs(y).max()).argmax()]))


def _gains(channels: Channels, gain: np.ndarray, units: dict[str, str]) -> tuple[Parameter, ...]:
    """A parameter for each gain that is not known."""
    found = {}
    for i, group in enumerate(channels.groups):
        if group and group not in found:
            size, unit = abs(float(gain[i])), units[channels.sensors[i].quantity]
            ends = size / REACH, size * REACH
            sign = int(np.sign(gain[i]))
            found[group] = Parameter(f"gain {group}", "gain", size, *ends, SCALE * size, unit, sign)
    return tuple(found.values())


def _plausible(channels: Channels, ratio: np.ndarray, data: np.ndarray, model: np.ndarray):
    """Sentences on signals of a known gain that are far from the start model's, refused farther."""
    for i, label in enumerate(channels.labels):
        largest = f"{np.abs(data[:, i]).max():.3g} {channels.units[i]}"
        if not np.abs(data[:, i]).max() > 0.0:
            raise UnusableRecord(f"{label} is 0 all the time; leave its column out.")
        told = (
            f"{label} reaches {largest}, the scene as it is "
            f"{np.abs(data[:, i]).max() / ratio[i]:.3g} {channels.units[i]}"
        )
        if not 1 / WRONG < ratio[i] < WRONG:
            raise UnusableRecord(f"{told}; correct the unit in the data's header, or the gain.")
        if not 1 / DOUBTFUL < ratio[i] < DOUBTFUL:
            yield f"{told}: check units, gain and the striker's velocity."


def _impulses(momentum: float, channels: Channels, record: Record, model: np.ndarray):
    """A sentence where the first wave of a force file carries another momentum than the scene's."""
    t, data = record.t, record.v.mean(axis=0)
    for i, sensor in enumerate(channels.sensors):
        if sensor.quantity != "force" or channels.groups[i]:
            continue
        found, own = (incident_impulse(t, y[:, i] / sensor.gain) for y in (data, model))
        if found is None or own is None:
            continue
        off = found.impulse / own.impulse - 1.0
        bar = np.hypot(CUT, _noise(record, i, found) / abs(sensor.gain) / own.impulse)
        if abs(off) > bar:
            yield (
                f"The first wave of {channels.labels[i]} carries an impulse of "
                f"{1e3 * found.impulse:.3g} mN s, the scene's "
                f"{1e3 * own.impulse:.3g} mN s of the striker's momentum "
                f"{1e3 * momentum:.3g} mN s: {100 * off:+.2g} % off, {100 * bar:.2g} % is "
                "its bar; check the gain, the file's unit, the striker's velocity and mass."
            )


def _noise(record: Record, i: int, wave: Impulse) -> float:
    """Two sigma of the impulse by the noise of the record, in its unit times s."""
    dt = record.t[1] - record.t[0]
    mean = record.v.mean(axis=0)[:, [i]]
    if len(record.v) > 1:
        rms = float(record.v[:, :, i].std(axis=0, ddof=1).mean() / np.sqrt(len(record.v)))
    else:
        rms = noise_between_waves(record.t, mean, 50 * dt) or 0.0
    return 2.0 * rms * dt * float(np.sqrt(CORRELATED * wave.samples))
