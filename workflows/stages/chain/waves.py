"""The waves of a run as a stage (`dem.waves`), and as the summary has them."""

import numpy as np
from numpy.typing import NDArray

from beadwave.coupling import Impact
from beadwave.dem.waves.arrivals import Arrival, arrivals, passage
from beadwave.dem.waves.chain_waves import ChainWaves, chain_waves
from beadwave.dem.waves.measures import track_speed
from beadwave.workflows.report.summary import ChainContact, SphereWaves, TrackedWave, WaveArrival
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.chain.chain import Start

# of the largest speed of any sphere: what moves less waits for its first wave, in rounding and the
# tail that a modal wall or the step sends ahead
QUIET = 1e-6


def waves(scene: Scene, start: Start, impact: Impact) -> ChainWaves:
    """Waves along the chain, at the observed spheres and at the wall."""
    return chain_waves(
        impact.trajectory, start.chain, scene.output.spheres,
        at_wall=scene.wall is not None and bool(start.velocity.any()),
    )  # fmt: skip


def sphere_waves(
    waves: ChainWaves, t: NDArray[np.float64], v: NDArray[np.float64], sphere: int
) -> SphereWaves:
    """Waves at a sphere (counted from 1) of velocities v (k, n) [m/s] at times t (k,) [s]; all
    peaks, unnamed, where the chain is too short for tracks or its spheres are unlike."""
    smallest, v = QUIET * np.abs(v).max(), v[:, sphere - 1]
    labels, pair = waves.labels[sphere], passage(t, v, smallest=smallest)
    listed = [_arrival(label.arrival, label.name, label.alone) for label in labels]
    return SphereWaves(
        arrivals=tuple(listed or [_arrival(wave) for wave in arrivals(t, v, smallest=smallest)]),
        echo_delay_s=pair and pair.echo_delay,
        echo_ratio=pair and pair.echo_ratio,
    )


def _arrival(wave: Arrival, name: str | None = None, alone: bool = True) -> WaveArrival:
    """A row of the summary; a wave that is not `alone` was separated from others by a fit."""
    return WaveArrival(
        time_s=wave.time,
        peak_velocity_m_s=wave.peak_velocity,
        width_s=wave.width,
        quality=wave.quality,
        name=name,
        alone=alone,
    )


def chain_contact(scene: Scene, waves: ChainWaves) -> ChainContact | None:
    """The impact at the wall by the quantities of the thesis' section 2.2.1, and the speed [m/s]
    and largest force [N] of every wave along its track; None without a wall."""
    wall = waves.contact
    if wall is None:
        return None
    radius = np.broadcast_to(scene.chain.radius, scene.chain.count)
    trains = []
    for track in waves.tracks:
        first, last = track.pulses[0], track.pulses[-1]
        trains.append(
            TrackedWave(
                name=track.name,
                from_contact=first.contact,
                to_contact=last.contact,
                start_s=first.time,
                end_s=last.time,
                speed_m_s=track_speed(track, radius),
                peak_force_N=max(pulse.force for pulse in track.pulses),
            )
        )
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
        trains=tuple(trains),
    )
