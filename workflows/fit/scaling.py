"""Records of sensors as a calibration fits them: as velocities, and the gains to be found.

Each signal counts as much as the velocity of its sphere: what the start model shows for 1 m/s is
its scale. A voltage whose gain nobody knows is scaled by what the record shows. The impulse of the
first wave in a record of a force checks it: what a bead hands on is momentum, which contacts do not
change.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.dem.sensitivities import march_with_sensitivities
from beadwave.dem.waves.arrivals import peaks
from beadwave.workflows.files.record import Record
from beadwave.workflows.fit.aligned_signals import noise_between_waves
from beadwave.workflows.fit.marched_system import Rig
from beadwave.workflows.fit.parameter import Parameter
from beadwave.workflows.fit.plausibility import size_comparison
from beadwave.workflows.fit.sensed import Channels, sensed

# Numbers of the checks and of the unknown gains; not varied systematically
RISEN = 0.3  # of the largest value: the first excursion, which tells the sign
GAIN_REACH = 30.0  # factor from a gain to its bounds
GAIN_SCALE = 0.1  # of a gain: a change that counts as large
CUT_IMPULSE = 0.02  # of an impulse: what lies beyond the end of its wave
N_CORRELATED = 4.0  # samples over which noise is correlated


class ScaledRecord(NamedTuple):
    """A record in velocities, what they stand for, the gains to be found, what is doubtful."""

    record: Record
    channels: Channels | None
    gains: tuple[Parameter, ...]
    remarks: tuple[str, ...]


def scaled(
    rig: Rig, record: Record, bare: Channels, gain_units: dict[str, str], momentum: float
) -> ScaledRecord:
    """The record of channels with a scale of 1 in velocities; raises UnusableRecord where a signal
    cannot be one. `gain_units` are by quantity, the striker's momentum is in N s."""
    t, data = record.t, record.v.mean(axis=0)

    # signals (k, m) of the scene as it is, from its first touch on, and the largest velocity (m,)
    # of each sensor's sphere
    run = march_with_sensitivities(
        rig.chain, rig.wall, rig.v0, duration=t[-1] - t[0],
        dt=rig.step, observed=bare.observed,
    )  # fmt: skip
    model = sensed(run, rig, bare, (), t - t[0])[0]
    speed = np.abs(run.v[:, [sensor.sphere for sensor in bare.sensors]]).max(axis=0)

    # gains (m,): 1 where known, else by the sizes, with the sign of the first excursion
    gain = np.ones(len(bare.groups))
    for group in {name for name in bare.groups if name}:
        columns = [i for i, name in enumerate(bare.groups) if name == group]
        sizes = np.abs(data[:, columns]).max(axis=0) / np.abs(model[:, columns]).max(axis=0)
        signs = [_first_sign(data[:, i]) * _first_sign(model[:, i]) for i in columns]
        gain[columns] = np.median(sizes) * np.sign(np.sum(signs) or 1.0)

    remarks = [
        *size_comparison(bare.labels, bare.units, data, gain * model),
        *_on_impulses(momentum, bare, record, data, model),
    ]
    scale = np.abs(gain * model).max(axis=0) / speed
    sensors = tuple(
        sensor._replace(gain=float(sensor.gain * g / s))
        for sensor, g, s in zip(bare.sensors, gain, scale, strict=True)
    )

    # a parameter for each gain that is not known, by its size; its sign is kept apart
    gains: dict[str, Parameter] = {}
    for sensor, group, g in zip(sensors, bare.groups, gain, strict=True):
        if group and group not in gains:
            size, unit = abs(float(g)), gain_units[sensor.quantity]
            low, high = size / GAIN_REACH, size * GAIN_REACH
            step, sign = GAIN_SCALE * size, int(np.sign(g))
            name = f"gain {group}"
            gains[group] = Parameter(name, "gain", size, low, high, step, unit, sign)
    channels = bare._replace(sensors=sensors, scale=scale)
    in_velocities = record._replace(v=record.v / scale)
    return ScaledRecord(in_velocities, channels, tuple(gains.values()), tuple(remarks))


def _first_sign(y: np.ndarray) -> float:
    """Sign of the first excursion of a signal (k,)."""
    return float(np.sign(y[(np.abs(y) > RISEN * np.abs(y).max()).argmax()]))


def _on_impulses(
    momentum: float, channels: Channels, record: Record, data: np.ndarray, model: np.ndarray
) -> Iterator[str]:
    """A sentence where the first wave of a force of known gain carries another momentum than the
    model's; data and model (k, m)."""
    t, dt = record.t, record.t[1] - record.t[0]
    for i, sensor in enumerate(channels.sensors):
        if sensor.quantity != "force" or channels.groups[i]:
            continue
        wave, model_wave = (incident_impulse(t, y[:, i] / sensor.gain) for y in (data, model))
        if wave is None or model_wave is None:
            continue

        # two sigma of the impulse by the noise of the mean record: a sum of n samples, of which
        # n over the samples of correlation are independent, dt noise sqrt(correlated n)
        if len(record.v) > 1:
            spread = record.v[:, :, i].std(axis=0, ddof=1).mean()
            noise = float(spread / np.sqrt(len(record.v)))
        else:
            noise = noise_between_waves(t, data[:, [i]], 50 * dt) or 0.0
        two_sigma = 2.0 * noise * dt * float(np.sqrt(N_CORRELATED * wave.samples))
        bar = np.hypot(CUT_IMPULSE, two_sigma / abs(sensor.gain) / model_wave.impulse)
        off = wave.impulse / model_wave.impulse - 1.0
        if abs(off) > bar:
            yield (
                f"The first wave of {channels.labels[i]} carries an impulse of "
                f"{1e3 * wave.impulse:.3g} mN s, the scene's "
                f"{1e3 * model_wave.impulse:.3g} mN s of the striker's momentum "
                f"{1e3 * momentum:.3g} mN s: {100 * off:+.2g} % off, {100 * bar:.2g} % is "
                "its bar; check the gain, the file's unit, the striker's velocity and mass."
            )


class Impulse(NamedTuple):
    """Of the first wave."""

    impulse: float  # [N s]
    end: float  # [s] when it has passed
    samples: int  # from the start of the record to there


def incident_impulse(t: NDArray[np.float64], force: NDArray[np.float64]) -> Impulse | None:
    """Integral of a force (k,) [N] over t (k,) [s] from the start of a record to where its first
    wave has passed; None without a wave, or where the next one comes before that."""
    # 0.3 of the largest force: crests above it are waves
    crests = peaks(force, 0.3 * force.max(initial=0.0))
    if not crests:
        return None
    crest = crests[0]
    falling = force[crest : crests[1] if len(crests) > 1 else None]
    # 0.02 of the crest: a wave has passed when the force is below it
    passed = np.flatnonzero(falling < 0.02 * force[crest])
    end = crest + int(passed[0] if passed.size else falling.argmin())
    # 0.1 of the crest: a force that stays above it before the next wave belongs to both
    if force[end] > 0.1 * force[crest]:
        return None
    return Impulse(float(np.trapezoid(force[: end + 1], t[: end + 1])), float(t[end]), end + 1)
