"""The first collision of a chain with its wall: the reflected wave, and the wall's energy.

The amplitude ratio of the reflected wave (ARR) is (2.9) of the thesis, velocities to the power 6/5.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.coupling.march import impact
from beadwave.dem.chain import Chain
from beadwave.dem.spheres import time_scale
from beadwave.dem.trajectory import Trajectory
from beadwave.dem.walls import Wall
from beadwave.dem.waves import solitary
from beadwave.dem.waves.arrivals import crest, peaks
from beadwave.dem.waves.measures import CONTACT, ContactTime, contact_time, force_ratio


class CollisionRun(NamedTuple):
    """How a collision is marched, and which reflected wave counts; not varied."""

    error: float = 1e-5  # of the velocities, relative to the striker's
    n_save: int = 6000  # instants of the record
    per_sphere: float = 4.0  # natural times: to the wall and slowly back past one sphere
    at_wall: float = 10.0  # natural times that the contact with the wall may take
    faint: float = 0.02  # of the incident wave's velocity: a fainter reflected wave counts as none

    @property
    def faintest_arr(self) -> float:
        """ARR of the faintest wave that counts."""
        return self.faint**1.2


class Collision(NamedTuple):
    """The first collision of a chain with its wall."""

    arr: float  # (2.9) at the observed sphere, 0 where no wave comes back
    lost: float  # share of the striker's energy that the spheres have not when the contact ends
    contact: ContactTime  # the first
    peak_force: float  # [N] of it
    trajectory: Trajectory


def collision(
    chain: Chain,
    wall: Wall,
    v0: NDArray[np.float64],
    sphere: int,
    options: CollisionRun = CollisionRun(),
) -> Collision:
    """The chain against a wall from v0 (n,) [m/s], until even a slow wave is back at the striker;
    ARR at a sphere, counted from 1."""
    passing = time_scale(chain.mass.max(), chain.A.min(), np.abs(v0).max())
    duration = (options.per_sphere * len(chain.mass) + options.at_wall) * passing
    march = {"error": options.error, "n_save": options.n_save}
    run = impact(chain, wall, v0, duration=duration, **march).trajectory

    # what the spheres have not when the first contact ends is the wall's
    contact, second_start = first_contact(run.t, run.contact_force[:, -1])
    remaining = np.interp(contact.end, run.t, run.energy_kinetic + run.energy_contact)
    lost = float(1 - remaining / run.energy_kinetic[0])
    peak_force = float(run.contact_force[run.t <= contact.end, -1].max())

    # the incident wave at the sphere, and the first crest away from the wall behind it
    v, arr = run.v[:, sphere - 1], 0.0
    incident = peaks(v, 0.5 * v.max())[0]
    reflected = [k for k in peaks(-v, options.faint * v[incident]) if k > incident and v[k] < 0]

    # it belongs to this collision if it left the wall before the next one's wave could
    if reflected:
        time, speed = crest(run.t, -v, reflected[0])
        passing = 1 / solitary.speed(speed, chain.mass[-1], chain.A[-2])
        if time - (len(chain.mass) - sphere) * passing <= second_start + contact.seconds:
            arr = float(force_ratio(crest(run.t, v, incident)[1], speed))
    return Collision(arr, lost, contact, peak_force, run)


def first_contact(t: NDArray[np.float64], force: NDArray[np.float64]) -> tuple[ContactTime, float]:
    """The first collision in a record of the force (k,), and when [s] the next one starts.

    An echo from a plate's edge may make the next one the harder.
    """
    closed = force > CONTACT * force.max()
    turns = np.flatnonzero(np.diff(closed, prepend=False))
    second = turns[2] if len(turns) > 2 else len(t)
    again = t[second] if len(turns) > 2 else np.inf
    return contact_time(t[:second], force[:second]), float(again)


def restitution(
    chain: Chain, wall: Wall, speed: float, options: CollisionRun = CollisionRun()
) -> float:
    """Of the chain's last sphere alone, thrown at the wall: its speed after over before."""
    last = Chain(chain.mass[-1:], chain.radius[-1:], chain.A[-1:])
    duration = options.at_wall * time_scale(last.mass[0], last.A[0], speed)
    march = {"error": options.error, "n_save": options.n_save}
    run = impact(last, wall, [speed], duration=duration, **march).trajectory
    end = contact_time(run.t, run.contact_force[:, -1], threshold=0.0).end
    return -float(np.interp(end, run.t, run.v[:, 0])) / speed
