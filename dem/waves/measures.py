"""What the literature reads off waves and the wall they strike: times, speeds, ratios.

J. Yang, C. Silvestro, D. Khatri, L. De Nardo, C. Daraio, Phys. Rev. E 83 (2011) 046606;
J. Yang, C. Silvestro, S. N. Sangiorgio, S. L. Borkowski, E. Ebramzadeh, L. De Nardo, C. Daraio,
Smart Mater. Struct. 21 (2012) 015008; thesis, section 2.2.1, whose equations are named.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dem.chain import Chain
from dem.kernels.arguments import Array
from dem.spheres import hertz_energy
from dem.trajectory import Trajectory
from dem.waves.arrivals import energy_restitution, velocity_sum_ratio
from dem.waves.tracks import WaveTrack

CONTACT = 0.01  # of the peak force, where a contact counts as closed


class ContactTime(NamedTuple):
    """How long the largest collision with the wall lasts; nan if there is none."""

    seconds: float
    start: float  # [s]
    end: float  # [s], inf if it does not open within the record
    threshold: float  # [N] above which it counts


class WallContact(NamedTuple):
    """A chain's collision with its wall in numbers; nan where the record does not say."""

    contact_time: ContactTime
    tau_c: float  # (2.5)
    speed_in: float  # [m/s] of the incident wave, mean along the chain
    speed_back: float  # [m/s] of the first reflected one
    travelling_time: float  # [s] (2.6)
    tof: float  # [s] (2.7), contact time and travelling time
    arr: float  # (2.9), |reflected / incident| velocity to the power 6/5, mean along the chain
    velocity_sum_ratio: float  # (2.8), of the whole record: no measure of loss
    energy_restitution: float  # of the whole record, sqrt of the ratio of kinetic energies


def exponent(x: ArrayLike, y: ArrayLike) -> float:
    """p of a power law y ~ x^p, the slope of log y over log x by least squares."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def contact_time(t: ArrayLike, force: ArrayLike, *, threshold: float = CONTACT) -> ContactTime:
    """ContactTime of the collision with the largest force (k,); above the force at its start.

    It counts while the force is above `threshold` times its peak; ends are interpolated.
    """
    t, F = np.asarray(t, float), np.asarray(force, float)
    k, level = int(F.argmax()), F[0] + threshold * (F.max() - F[0])
    if F.max() <= F[0]:
        return ContactTime(np.nan, np.nan, np.nan, float(level))

    def crossing(i):
        """Time between the samples i and i + 1 at which F passes the level."""
        return t[i] + (level - F[i]) / (F[i + 1] - F[i]) * (t[i + 1] - t[i])

    rising, falling = np.flatnonzero(F[:k] <= level), np.flatnonzero(F[k:] <= level) + k
    start = crossing(rising[-1]) if rising.size else t[0]
    end = crossing(falling[0] - 1) if falling.size else np.inf
    return ContactTime(float(end - start), float(start), float(end), float(level))


def dimensionless_contact_time(seconds: float, mass: float, speed: float, A_wall: float) -> float:
    """tau_c of (2.5), T_c = tau_c m^(2/5) V^(-1/5) A_w^(-2/5) with the striker's speed V."""
    return seconds / (mass**0.4 * speed**-0.2 * A_wall**-0.4)


def travelling_time(n: int, radius: float, speed_in: float, speed_back: float) -> float:
    """(2.6) [s]: through n spheres and back."""
    return 2.0 * n * radius * (1.0 / speed_in + 1.0 / speed_back)


def force_ratio(incident: float, reflected: float) -> float:
    """ARR of (2.9): |reflected / incident peak velocity|^(6/5), the ratio of forces."""
    return abs(reflected / incident) ** 1.2


def track_speed(track: WaveTrack, radius: Array) -> float:
    """Speed [m/s] of a track past spheres of radius (n,) [m], the slope through all its pulses."""
    times = np.array([pulse.time for pulse in track.pulses])
    places = 2.0 * np.cumsum(radius)[[pulse.contact - 1 for pulse in track.pulses]]
    return float(abs(np.polyfit(times - times[0], places, 1)[0]))


def wall_contact(
    t: Array, v: Array, contact_force: Array, chain: Chain, tracks: Sequence[WaveTrack]
) -> WallContact:
    """WallContact of a chain's run; v (k, n), contact_force (k, n), its `tracks`."""
    n, nan = len(chain.mass), float("nan")

    # the collision; none before a wave is there, whose foot reaches far ahead
    rise = (contact_force - contact_force[0]).max(axis=0)
    arrived = rise[-1] > CONTACT * rise.max()
    collision = contact_time(t, contact_force[:, -1] if arrived else np.zeros(len(t)))
    v_striker = float(np.abs(v[0]).max())
    tau_c = dimensionless_contact_time(collision.seconds, chain.mass[-1], v_striker, chain.A[-1])

    # the first wave each way is that of the collision if it is seen within 4 contacts of the wall
    first = {
        track.kind: track
        for track in tracks
        if track.number == 1 and max(track.pulses[0].contact, track.pulses[-1].contact) >= n - 4
    }
    incident, reflected = first.get("incident"), first.get("reflected")
    speed_in = nan if incident is None else track_speed(incident, chain.radius)
    speed_back = nan if reflected is None else track_speed(reflected, chain.radius)
    travelling = travelling_time(n, float(np.mean(chain.radius)), speed_in, speed_back)

    # (2.9), mean over the contacts that both pass; forces are what it compares
    arr = nan
    if incident is not None and reflected is not None:
        force_in = {pulse.contact: pulse.force for pulse in incident.pulses}
        ratios = [p.force / force_in[p.contact] for p in reflected.pulses if p.contact in force_in]
        arr = float(np.mean(ratios)) if ratios else nan

    return WallContact(
        collision,
        tau_c,
        speed_in,
        speed_back,
        travelling,
        collision.seconds + travelling,
        arr,
        velocity_sum_ratio(v[0], v[-1]),
        energy_restitution(chain.mass, v[0], v[-1]),
    )


class WaveEnergy(NamedTuple):
    """Shares of the striker's energy: on the way, and when the wall is pressed hardest."""

    moving_on_the_way: float  # mean
    moving_at_the_wall: float
    last_contact: float  # elastic, at the wall


def wave_energy(run: Trajectory, chain: Chain) -> WaveEnergy:
    """Of the first wave of a chain before a wall, one of at least eight spheres."""
    force, energy = run.contact_force, run.energy_kinetic[0]
    k = int(force[:, -1].argmax())
    # from the third contact on the wave has its shape, until it comes near the wall
    way = slice(int(force[:k, 2].argmax()), int(force[:k, -4].argmax()))
    return WaveEnergy(
        float(run.energy_kinetic[way].mean() / energy),
        float(run.energy_kinetic[k] / energy),
        float(hertz_energy(force[k, -1], chain.A[-1]) / energy),
    )


def leading_share(run: Trajectory, chain: Chain) -> float:
    """Energy of the leading wave at the end of a run, from the gap behind it on, over the
    striker's."""
    v, F = run.v[-1], run.contact_force[-1]
    gap = int(v.argmax()) - 1  # contact behind the fastest sphere; on to where no force is left
    while F[gap] > 1e-3 * F.max() and F[gap] >= F[gap - 1]:
        gap -= 1
    stored = hertz_energy(F, chain.A)
    moving = 0.5 * chain.mass[gap + 1 :] @ v[gap + 1 :] ** 2
    return float((moving + stored[gap:].sum()) / run.energy_kinetic[0])
