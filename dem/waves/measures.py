"""Contact time, wave speeds, time of flight and ratios of a chain's impact on a wall.

J. Yang, C. Silvestro, D. Khatri, L. De Nardo, C. Daraio, Phys. Rev. E 83 (2011) 046606;
J. Yang, C. Silvestro, S. N. Sangiorgio, S. L. Borkowski, E. Ebramzadeh, L. De Nardo, C. Daraio,
Smart Mater. Struct. 21 (2012) 015008; thesis, section 2.2.1, whose equations are named.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from beadwave.dem.chain import Chain
from beadwave.dem.kernels.arguments import Array
from beadwave.dem.trajectory import Trajectory
from beadwave.dem.waves.arrivals import energy_restitution, velocity_sum_ratio
from beadwave.dem.waves.tracks import WaveTrack

CONTACT = 0.01  # of the peak force: above it a contact counts as closed; a convention, not varied


class ContactTime(NamedTuple):
    """The largest collision with the wall; nan if there is none."""

    seconds: float  # end - start
    start: float  # [s]
    end: float  # [s], inf if the contact does not open within the record
    threshold: float  # [N] force above which the contact counts as closed


class WallContact(NamedTuple):
    """A chain's collision with its wall; equations of the thesis in brackets; nan where the record
    ends too early, or no wave reaches the wall."""

    contact_time: ContactTime
    tau_c: float  # (2.5), dimensionless contact time
    speed_in: float  # [m/s] of the incident wave, mean along the chain
    speed_back: float  # [m/s] of the first reflected one
    travelling_time: float  # [s] (2.6)
    tof: float  # [s] (2.7), contact time and travelling time
    arr: float  # (2.9), |reflected / incident| velocity to the power 6/5, mean along the chain
    velocity_sum_ratio: float  # (2.8), of the whole record: no measure of loss
    energy_restitution: float  # of the whole record, sqrt of the ratio of kinetic energies


def exponent(x: ArrayLike, y: ArrayLike) -> float:
    """p of a power law y ~ x^p: the slope of log y (k,) over log x (k,) by least squares."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def contact_time(t: ArrayLike, force: ArrayLike, *, threshold: float = CONTACT) -> ContactTime:
    """ContactTime of the collision with the largest force (k,) [N] at times t (k,) [s].

    The contact counts as closed while the force exceeds its first value, the preload, by
    `threshold` times the rise from there to the peak; both ends are interpolated between samples.
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
    """tau_c of (2.5), T_c = tau_c m^(2/5) V^(-1/5) A_w^(-2/5), for a contact of T_c [s], the mass m
    [kg] of the last sphere, the striker's speed V [m/s] and Hertz' A_w [N/m^1.5] at the wall."""
    return seconds / (mass**0.4 * speed**-0.2 * A_wall**-0.4)


def travelling_time(n: int, radius: float, speed_in: float, speed_back: float) -> float:
    """(2.6) [s]: through n spheres of a radius [m] at speed_in [m/s] and back at speed_back."""
    return 2.0 * n * radius * (1.0 / speed_in + 1.0 / speed_back)


def force_ratio(incident: float, reflected: float) -> float:
    """ARR of (2.9) by peak velocities [m/s]: |reflected / incident|^(6/5), which is the ratio of
    contact forces, since F ~ v^(6/5) in a solitary wave."""
    return abs(reflected / incident) ** 1.2


def track_speed(track: WaveTrack, radius: Array) -> float:
    """Speed [m/s] of a track past spheres of radius (n,) [m]: the slope of place over time by least
    squares through all its pulses."""
    times = np.array([pulse.time for pulse in track.pulses])
    places = 2.0 * np.cumsum(radius)[[pulse.contact - 1 for pulse in track.pulses]]
    return float(abs(np.polyfit(times - times[0], places, 1)[0]))


def wall_contact(
    t: Array, v: Array, contact_force: Array, chain: Chain, tracks: Sequence[WaveTrack]
) -> WallContact:
    """WallContact of a chain's run by its velocities v (k, n) [m/s] and contact_force (k, n) [N],
    the last column at the wall, at times t (k,) [s], and by the `tracks` of its waves."""
    n, nan = len(chain.mass), float("nan")

    # no collision before a wave arrives: the foot of a wave presses the wall long before its crest
    rise = (contact_force - contact_force[0]).max(axis=0)
    arrived = rise[-1] > CONTACT * rise.max()
    collision = contact_time(t, contact_force[:, -1] if arrived else np.zeros(len(t)))
    v_striker = float(np.abs(v[0]).max())
    A_wall = chain.elastic.at(-1).hertz(contact_force[:, -1].max(initial=0.0))
    tau_c = dimensionless_contact_time(collision.seconds, chain.mass[-1], v_striker, float(A_wall))

    # the first wave each way belongs to the collision if its track comes within 4 contacts of the
    # wall; otherwise it began or ended elsewhere in the chain
    first = {
        track.kind: track
        for track in tracks
        if track.number == 1 and max(track.pulses[0].contact, track.pulses[-1].contact) >= n - 4
    }
    incident, reflected = first.get("incident"), first.get("reflected")
    speed_in = nan if incident is None else track_speed(incident, chain.radius)
    speed_back = nan if reflected is None else track_speed(reflected, chain.radius)
    travelling = travelling_time(n, float(np.mean(chain.radius)), speed_in, speed_back)

    # (2.9) as a ratio of forces, mean over the contacts that both waves pass
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
    """Shares of the striker's kinetic energy while the wave runs, and at the wall's peak force."""

    moving_on_the_way: float  # kinetic energy, mean from the third contact to the wall's vicinity
    moving_at_the_wall: float  # kinetic energy when the wall is pressed hardest
    last_contact: float  # elastic energy of the contact at the wall, at that instant


def wave_energy(run: Trajectory, chain: Chain) -> WaveEnergy:
    """WaveEnergy of the first wave of a chain of at least eight spheres at a wall."""
    force, energy = run.contact_force, run.energy_kinetic[0]
    k = int(force[:, -1].argmax())
    # from the third contact on the wave has its shape, until it comes near the wall
    way = slice(int(force[:k, 2].argmax()), int(force[:k, -4].argmax()))
    return WaveEnergy(
        float(run.energy_kinetic[way].mean() / energy),
        float(run.energy_kinetic[k] / energy),
        float(chain.elastic.at(-1).energy(force[k, -1]) / energy),
    )


def leading_share(run: Trajectory, chain: Chain) -> float:
    """Energy of the leading wave at the end of a run over the striker's: that of all spheres and
    contacts ahead of the first gap behind the fastest sphere. The wave has to be inside of the
    chain then, clear of the striker."""
    v, F = run.v[-1], run.contact_force[-1]
    gap = int(v.argmax()) - 1  # contact behind the fastest sphere; on to where no force is left
    while F[gap] > 1e-3 * F.max() and F[gap] >= F[gap - 1]:
        gap -= 1
    stored = chain.elastic.energy(F)
    moving = 0.5 * chain.mass[gap + 1 :] @ v[gap + 1 :] ** 2
    return float((moving + stored[gap:].sum()) / run.energy_kinetic[0])
