"""Waves followed through the chain: the incident ones, and those that the wall sends back.

Every collision of two neighbours is a pulse of their contact force. A wave is a track of pulses
from contact to contact, each one sphere's passing time after the one before; that time follows
from the pulse's force, and is longer where a gap must close first. Contact i lies between the
spheres i and i + 1, counted from 1.
"""

from typing import NamedTuple

import numpy as np

from dem.kernels.arguments import Array
from dem.waves.arrivals import crest, peaks
from dem.waves.solitary import force, speed, velocity_of_force


class TrackOptions(NamedTuple):
    """When pulses are one wave; ranges are not on record."""

    early: float = 0.7  # before the expected time, in passing times of a sphere for each contact
    late: float = 5.0  # after the expected time, in passing times of a sphere
    skipped: int = 3  # contacts at which a track may be hidden in another one
    shortest: int = 3  # contacts that make a track


USUAL_TRACKS = TrackOptions()


class Pulse(NamedTuple):
    """A collision of two neighbours."""

    time: float  # [s] of the largest force
    contact: int
    force: float  # [N] largest
    velocity: float  # [m/s] of the spheres in a wave of this force, negative away from the wall
    passing_time: float  # [s] of one sphere in such a wave


class WaveTrack(NamedTuple):
    """A wave along the chain, by its number in order of time at the wall's end, from 1."""

    kind: str  # "incident" or "reflected"
    number: int
    pulses: tuple[Pulse, ...]  # in order of time

    @property
    def name(self) -> str:
        """As in the thesis: incident, reflected 1, reflected 2, ..."""
        first = self.kind == "incident" and self.number == 1
        return self.kind if first else f"{self.kind} {self.number}"

    def time_at(self, contact: int) -> float:
        """When the largest force is at a contact [s]; beyond the ends by the speed there."""
        way = 1 if self.kind == "incident" else -1
        places = np.array([way * pulse.contact for pulse in self.pulses])
        if places[0] <= way * contact <= places[-1]:
            return float(np.interp(way * contact, places, [pulse.time for pulse in self.pulses]))
        end = self.pulses[0 if way * contact < places[0] else -1]
        return end.time + way * (contact - end.contact) * end.passing_time


def wave_tracks(
    t: Array, v: Array, contact_force: Array, mass: Array, A: Array, *, threshold: float = 0.03,
    options: TrackOptions = USUAL_TRACKS,
) -> tuple[WaveTrack, ...]:  # fmt: skip
    """Wave tracks in the records v (k, n) and contact_force (k, n_contacts) of all spheres.

    A pulse counts if the spheres in its wave reach `threshold` of those in the largest one, and a
    track if it passes three contacts. Incident ones first, then reflected ones, each in order of
    time at the wall.
    """
    t, v, contact_force = np.asarray(t), np.asarray(v), np.asarray(contact_force)

    # pulses: collisions of neighbours above the threshold; the force at rest is no wave's
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
            # the wave that the sphere makes of it that passes it on: a heavy striker waits for no
            # other
            time, height = crest(t, F[:, i], k)
            way = 1 if v[k, i] + v[k, i + 1] > 0.0 else -1
            m_passing = mass[i + 1] if way > 0 else mass[i]
            size = velocity_of_force(height, m_passing, A[i])
            passing_time = float(1.0 / speed(size, m_passing, A[i]))
            pulses.append(Pulse(time, i + 1, height, float(way * size), passing_time))

    inward = _linked([pulse for pulse in pulses if pulse.velocity > 0.0], 1, options)
    outward = _linked([pulse for pulse in pulses if pulse.velocity < 0.0], -1, options)

    # in order of time at the wall: a reflected track first seen on its way came out of a faster one
    fastest = min((track[0].passing_time for track in outward), default=0.0)
    inward.sort(key=lambda track: track[0].time)
    outward.sort(key=lambda track: track[0].time - (len(mass) - track[0].contact) * fastest)
    return (
        *(WaveTrack("incident", i, tuple(track)) for i, track in enumerate(inward, 1)),
        *(WaveTrack("reflected", i, tuple(track)) for i, track in enumerate(outward, 1)),
    )


def _linked(pulses, way, options):
    """Lists of pulses that one wave makes on its way, +1 towards the wall or -1."""
    tracks, at_contact = [], {}
    for pulse in pulses:
        at_contact.setdefault(pulse.contact, []).append(pulse)
    for contact, candidates in sorted(at_contact.items(), reverse=way < 0):
        recent = [
            track for track in tracks if abs(contact - track[-1].contact) <= 1 + options.skipped
        ]

        # how late a pulse comes after a track's last one, in passing times, where it may be its
        offers = []
        for i, track in enumerate(recent):
            for j, pulse in enumerate(candidates):
                last = track[-1]
                contacts = way * (pulse.contact - last.contact)
                late = (pulse.time - last.time) / last.passing_time - contacts
                in_time = -options.early * contacts <= late <= options.late
                if 1 <= contacts <= 1 + options.skipped and in_time:
                    offers.append((abs(late), i, j))

        # the best pair first, each track and each pulse once; a pulse without a track begins one
        extended, matched = set(), set()
        for _, i, j in sorted(offers):
            if i not in extended and j not in matched:
                extended.add(i)
                matched.add(j)
                recent[i].append(candidates[j])
        tracks += [[pulse] for j, pulse in enumerate(candidates) if j not in matched]
    return [track for track in tracks if len(track) >= options.shortest]
