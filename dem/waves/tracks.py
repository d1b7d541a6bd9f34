"""Waves tracked through the chain: incident ones, and those that the wall reflects.

Every collision of two neighbours is a pulse of their contact force. The pulses of one wave follow
each other from contact to contact, one passing time apart, which is the time that a solitary wave
of the pulse's force takes over one sphere; it is longer where a gap must close first. Contact i
lies between the spheres i and i + 1, counted from 1.
"""

from typing import NamedTuple

import numpy as np

from beadwave.dem.kernels.arguments import Array
from beadwave.dem.waves.arrivals import crest, peaks
from beadwave.dem.waves.solitary import force, speed, velocity_of_force

# Limits for pulses at successive contacts that belong to one wave; ranges are not on record
EARLIEST = 0.7  # passing times for each contact by which a pulse may be too early
LATEST = 5.0  # passing times by which a pulse may be too late: gaps close first
MAX_SKIPPED = 3  # successive contacts at which a larger wave may hide a wave's pulse
MIN_PULSES = 3  # pulses that make a track


class Pulse(NamedTuple):
    """A collision of two neighbours, and the solitary wave of its force."""

    time: float  # [s] of the largest force
    contact: int  # from 1
    force: float  # [N] largest
    velocity: float  # [m/s] of the spheres in a wave of this force, negative away from the wall
    passing_time: float  # [s] of one sphere in such a wave


class WaveTrack(NamedTuple):
    """A wave along the chain."""

    kind: str  # "incident" or "reflected"
    number: int  # of its kind, from 1, in order of time at the wall
    pulses: tuple[Pulse, ...]  # in order of time

    @property
    def name(self) -> str:
        """As in the thesis: incident, reflected 1, reflected 2, ..."""
        first = self.kind == "incident" and self.number == 1
        return self.kind if first else f"{self.kind} {self.number}"

    def time_at(self, contact: int) -> float:
        """Time [s] at which the wave's force peaks at a contact: interpolated between its pulses,
        extrapolated beyond the first and last one by their passing times."""
        way = 1 if self.kind == "incident" else -1
        places = np.array([way * pulse.contact for pulse in self.pulses])
        if places[0] <= way * contact <= places[-1]:
            return float(np.interp(way * contact, places, [pulse.time for pulse in self.pulses]))
        end = self.pulses[0 if way * contact < places[0] else -1]
        return end.time + way * (contact - end.contact) * end.passing_time


def wave_tracks(
    t: Array, v: Array, contact_force: Array, mass: Array, A: Array, *, threshold: float = 0.03,
    ) -> tuple[WaveTrack, ...]:  # fmt: skip
    """Wave tracks in the velocities v (k, n) [m/s] and contact_force (k, n_contacts) [N] of all
    spheres at times t (k,) [s]; spheres of mass (n,) [kg] with Hertz' A (n_contacts,) [N/m^1.5].

    A pulse counts if spheres in a solitary wave of its force reach `threshold` times the velocity
    of those in the largest one; a track has at least `MIN_PULSES` pulses. Incident tracks
    first, then reflected ones, each in order of time at the wall.
    """
    t, v, contact_force = np.asarray(t), np.asarray(v), np.asarray(contact_force)

    # pulses: peaks of a contact's force above the threshold, less its force at rest (preload)
    n = len(mass) - 1
    F = contact_force[:, :n] - contact_force[0, :n]
    m = 0.5 * (mass[:-1] + mass[1:])
    largest = velocity_of_force(F.max(axis=0, initial=0.0), m, A[:n]).max(initial=0.0)
    level = force(threshold * largest, m, A[:n])
    pulses = []
    for i in range(n):
        for k in peaks(F[:, i], level[i]):
            if F[k, i] < level[i]:
                continue
            # the wave that this pulse becomes has the mass of the sphere that passes it on, not the
            # mean of both: a heavy striker would make it too slow
            time, height = crest(t, F[:, i], k)
            way = 1 if v[k, i] + v[k, i + 1] > 0.0 else -1
            m_passing = mass[i + 1] if way > 0 else mass[i]
            size = velocity_of_force(height, m_passing, A[i])
            passing_time = float(1.0 / speed(size, m_passing, A[i]))
            pulses.append(Pulse(time, i + 1, height, float(way * size), passing_time))

    inward = _linked([pulse for pulse in pulses if pulse.velocity > 0.0], 1)
    outward = _linked([pulse for pulse in pulses if pulse.velocity < 0.0], -1)

    # in order of time at the wall; a reflected track whose first pulse is away from the wall was
    # hidden by a faster wave until then, whose passing time leads back to the wall
    fastest = min((track[0].passing_time for track in outward), default=0.0)
    inward.sort(key=lambda track: track[0].time)
    outward.sort(key=lambda track: track[0].time - (len(mass) - track[0].contact) * fastest)
    return (
        *(WaveTrack("incident", i, tuple(track)) for i, track in enumerate(inward, 1)),
        *(WaveTrack("reflected", i, tuple(track)) for i, track in enumerate(outward, 1)),
    )


def _linked(pulses, way):
    """Lists of the pulses of one wave each, in order along its way; +1: to the wall, -1: back."""
    tracks, at_contact = [], {}
    for pulse in pulses:
        at_contact.setdefault(pulse.contact, []).append(pulse)
    for contact, candidates in sorted(at_contact.items(), reverse=way < 0):
        recent = [track for track in tracks if abs(contact - track[-1].contact) <= 1 + MAX_SKIPPED]

        # every track and pulse that may belong together, by how late the pulse comes, in passing
        # times: behind the track's last pulse, in its direction, within the contacts it may skip
        offers = []
        for i, track in enumerate(recent):
            for j, pulse in enumerate(candidates):
                last = track[-1]
                contacts = way * (pulse.contact - last.contact)
                late = (pulse.time - last.time) / last.passing_time - contacts
                in_time = -EARLIEST * contacts <= late <= LATEST
                if 1 <= contacts <= 1 + MAX_SKIPPED and in_time:
                    offers.append((abs(late), i, j))

        # pairs in order of |lateness|, each track and each pulse once; a pulse that fits no track
        # begins one
        extended, matched = set(), set()
        for _, i, j in sorted(offers):
            if i not in extended and j not in matched:
                extended.add(i)
                matched.add(j)
                recent[i].append(candidates[j])
        tracks += [[pulse] for j, pulse in enumerate(candidates) if j not in matched]
    return [track for track in tracks if len(track) >= MIN_PULSES]
