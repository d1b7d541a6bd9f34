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

EARLY, LATE = 0.7, 5.0  # of a pulse against the expected time, in passing times of a sphere
SKIPPED = 3  # contacts at which a track may be hidden in another one
SHORTEST = 3  # contacts that make a track


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
    t: Array, v: Array, contact_force: Array, mass: Array, A: Array, *, threshold: float = 0.03
) -> tuple[WaveTrack, ...]:
    """Wave tracks in the records v (k, n) and contact_force (k, n_contacts) of all spheres.

    A pulse counts if the spheres in its wave reach `threshold` of those in the largest one, and a
    track if it passes three contacts. Incident ones first.
    """
    found = _pulses(np.asarray(t), np.asarray(v), np.asarray(contact_force), mass, A, threshold)
    inward = _linked([p for p in found if p.velocity > 0.0], 1)
    outward = _linked([p for p in found if p.velocity < 0.0], -1)
    wall = len(mass)
    return (*_numbered("incident", inward, wall), *_numbered("reflected", outward, wall))


def _pulses(t, v, contact_force, mass, A, threshold):
    """All collisions above the threshold; the force at rest is no wave's."""
    n = len(mass) - 1
    F, m, A = contact_force[:, :n] - contact_force[0, :n], 0.5 * (mass[:-1] + mass[1:]), A[:n]
    largest = velocity_of_force(F.max(axis=0, initial=0.0), m, A).max(initial=0.0)
    level = force(threshold * largest, m, A)
    return [
        _pulse(t, v, F, mass, A, i, k)
        for i in range(n)
        for k in peaks(F[:, i], level[i])
        if F[k, i] >= level[i]
    ]


def _pulse(t, v, F, mass, A, i, k):
    """What the sphere makes of it that passes it on: a heavy striker waits for no other."""
    time, height = crest(t, F[:, i], k)
    way = 1 if v[k, i] + v[k, i + 1] > 0.0 else -1
    m = mass[i + 1] if way > 0 else mass[i]
    size = velocity_of_force(height, m, A[i])
    return Pulse(time, i + 1, height, float(way * size), float(1.0 / speed(size, m, A[i])))


def _linked(pulses, way):
    """Lists of pulses that one wave makes on its way, +1 towards the wall or -1."""
    found, at = [], {}
    for pulse in pulses:
        at.setdefault(pulse.contact, []).append(pulse)
    for contact, here in sorted(at.items(), reverse=way < 0):
        near = [track for track in found if abs(contact - track[-1].contact) <= 1 + SKIPPED]
        matched = list(_matches(near, here, way))
        for track, pulse in matched:
            track.append(pulse)
        found += [[pulse] for pulse in here if pulse not in [p for _, p in matched]]
    return [track for track in found if len(track) >= SHORTEST]


def _matches(found, here, way):
    """Pairs of a track and its next pulse, the best first, each taken once."""
    offers = []
    for i, track in enumerate(found):
        for j, pulse in enumerate(here):
            late = _lateness(track[-1], pulse, way)
            if late is not None:
                offers.append((abs(late), i, j))
    taken_tracks, taken_pulses = set(), set()
    for _, i, j in sorted(offers):
        if i not in taken_tracks and j not in taken_pulses:
            taken_tracks.add(i)
            taken_pulses.add(j)
            yield found[i], here[j]


def _lateness(last, pulse, way):
    """How late a pulse comes after a track's last one, in passing times; None: it cannot be his."""
    contacts = way * (pulse.contact - last.contact)
    late = (pulse.time - last.time) / last.passing_time - contacts
    fits = 1 <= contacts <= 1 + SKIPPED and -EARLY * contacts <= late <= LATE
    return late if fits else None


def _numbered(kind, found, wall):
    """In order of time at the wall; a track first seen on its way came out of a faster one."""
    fastest = min((track[0].passing_time for track in found), default=0.0)

    def start(pulses):
        return pulses[0].time - (wall - pulses[0].contact) * fastest

    order = sorted(found, key=start if kind == "reflected" else lambda pulses: pulses[0].time)
    return (WaveTrack(kind, number, tuple(pulses)) for number, pulses in enumerate(order, 1))
