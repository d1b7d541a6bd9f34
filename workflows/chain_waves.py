"""The waves of a run as a stage: followed through the chain, named, and measured at the wall."""

from math import isnan
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from coupling import Impact
from dem.labels import Label, labels
from dem.trains import Train, trains
from dem.wave_measures import WallContact, train_speed, wall_contact
from dem.waves import Arrival, arrivals, passage
from workflows.chain_stages import chain
from workflows.scene import Scene
from workflows.summary import ChainContact, SphereWaves, WaveArrival, WaveTrain

TRUSTED = 0.7  # quality below which a wave's numbers are not to be believed
UNEQUAL = 1.25  # ratio of masses from which on waves are not those of equal spheres
PRESSED = 0.05  # of the striker's energy, still elastic when the record ends
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


def doubtful(scene: Scene, found: ChainWaves, impact: Impact) -> tuple[str, ...]:
    """A sentence on each thing that makes numbers of the waves that nobody should believe."""
    said = (_unequal(scene), _poor(found), _unfinished(scene, found, impact))
    return tuple(sentence for sentence in said if sentence)


def _poor(found: ChainWaves) -> str | None:
    named = [label.arrival for labels in found.labels.values() for label in labels]
    poor = sum(wave.quality < TRUSTED for wave in named)
    if not poor:
        return None
    has, it, its = ("has", "it overlaps", "its") if poor == 1 else ("have", "they overlap", "their")
    return (
        f"{poor} of {len(named)} waves at the observed spheres {has} a quality below {TRUSTED:g}: "
        f"{it} with others too much to be taken apart, or the spheres differ; do not trust {its} "
        f"velocit{'y' if poor == 1 else 'ies'}."
    )


def _unequal(scene: Scene) -> str | None:
    """The striker and what is fixed to the last sphere may well be heavier."""
    mass = chain(scene).mass[1:-1]
    spread = float(mass.max() / mass.min()) if mass.size else 1.0
    if spread < UNEQUAL:
        return None
    return (
        f"The spheres' masses differ by a factor of {spread:.3g}: waves are followed and named by "
        "the solitary wave of equal spheres, which theirs are not; do not trust names, speeds, ARR "
        "and TOF."
    )


def _unfinished(scene: Scene, found: ChainWaves, impact: Impact) -> str | None:
    """What the end of the record cuts off."""
    if found.contact is None:
        return None
    run, ends = impact.trajectory, f"time.duration = {scene.time.duration:g} s ends"
    pressed = run.energy_contact[-1] - run.energy_contact[0]
    share = float(pressed / run.energy_kinetic[0]) if run.energy_kinetic[0] else 0.0
    if isnan(found.contact.contact_time.seconds):
        return f"{ends} before a wave is at the wall: nothing is measured there; take a longer one."
    if share < PRESSED:
        return None
    return (
        f"{ends} while contacts hold {100 * share:.0f} % of the striker's energy more than at "
        "rest: the sum of velocities (2.8) and the restitution are not those of spheres that have "
        "parted; take a longer one."
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


def chain_contact(scene: Scene, found: ChainWaves) -> ChainContact | None:
    """The blow at the wall in the words of the thesis' section 2.2.1."""
    wall = found.contact
    if wall is None:
        return None
    radius = np.broadcast_to(scene.chain.radius, scene.chain.count)
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


def _train(train: Train, radius: NDArray[np.float64]) -> WaveTrain:
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
