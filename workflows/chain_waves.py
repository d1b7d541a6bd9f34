"""The waves of a run as a stage: followed through the chain, named, and measured at the wall."""

from typing import NamedTuple

from coupling import Impact
from dem.labels import Label, labels
from dem.trains import Train, trains
from dem.wave_measures import WallContact, train_speed, wall_contact
from dem.waves import Arrival, arrivals, passage
from workflows.chain_stages import chain
from workflows.scene import Scene
from workflows.summary import ChainContact, SphereWaves, WaveArrival, WaveTrain

TRUSTED = 0.7  # quality below which a wave's numbers are not to be believed
NAMED = 20  # waves of a kind that are followed; after a few dozen impacts there are none to name


class ChainWaves(NamedTuple):
    """Waves along the chain, at the observed spheres, and the blow at the wall, if there is one."""

    trains: tuple[Train, ...]
    labels: dict[int, tuple[Label, ...]]
    contact: WallContact | None


def waves(scene: Scene, impact: Impact) -> ChainWaves:
    """What the run's trajectory holds of waves."""
    run, row = impact.trajectory, chain(scene)
    found = trains(run.t, run.v, run.contact_force, row.mass, row.A)
    found = tuple(train for train in found if train.number <= NAMED)
    return ChainWaves(
        found,
        {s: labels(found, run.t, run.v[:, s - 1], s) for s in scene.output.spheres},
        None if scene.wall is None else wall_contact(run.t, run.v, run.contact_force, row, found),
    )


def doubtful(found: ChainWaves) -> tuple[str, ...]:
    """A sentence where waves at the observed spheres have numbers that nobody should believe."""
    named = [label.arrival for labels in found.labels.values() for label in labels]
    poor = sum(wave.quality < TRUSTED for wave in named)
    if not poor:
        return ()
    return (
        f"{poor} of {len(named)} waves at the observed spheres have a quality below {TRUSTED:g}: "
        "they overlap too much to be taken apart, or their spheres differ; do not trust their "
        "velocities.",
    )


def sphere_waves(found: ChainWaves, t, v, sphere: int) -> SphereWaves:
    """The waves at a sphere with record v (k,); unnamed where the chain is too short for trains."""
    named = found.labels[sphere]
    passed = passage(t, v)
    listed = [_arrival(label.arrival, label.name, label.alone) for label in named]
    return SphereWaves(
        arrivals=tuple(listed or [_arrival(wave) for wave in arrivals(t, v)]),
        tof_s=passed and passed.tof,
        arr=passed and passed.arr,
    )


def _arrival(wave: Arrival, name: str | None = None, alone: bool = True) -> WaveArrival:
    return WaveArrival(
        time_s=wave.time,
        peak_velocity_m_s=wave.peak_velocity,
        width_s=wave.width,
        quality=wave.quality,
        name=name,
        alone=alone,
    )


def chain_contact(found: ChainWaves, radius: float) -> ChainContact | None:
    """The blow at the wall in the words of the thesis' section 2.2.1."""
    wall = found.contact
    if wall is None:
        return None
    return ChainContact(
        contact_time_s=wall.contact_time.seconds,
        threshold_N=wall.contact_time.threshold,
        tau_c=wall.tau_c,
        speed_in_m_s=wall.speed_in,
        speed_back_m_s=wall.speed_back,
        travelling_time_s=wall.travelling_time,
        tof_s=wall.tof,
        arr_2_9=wall.arr,
        velocity_sum_ratio_2_8=wall.velocity_sum_ratio,
        energy_restitution=wall.energy_restitution,
        trains=tuple(_train(train, radius) for train in found.trains),
    )


def _train(train: Train, radius: float) -> WaveTrain:
    first, last = train.pulses[0], train.pulses[-1]
    return WaveTrain(
        name=train.name,
        from_contact=first.contact,
        to_contact=last.contact,
        start_s=first.time,
        end_s=last.time,
        speed_m_s=train_speed(train, radius),
        peak_force_N=max(pulse.force for pulse in train.pulses),
    )
