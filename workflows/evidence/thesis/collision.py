"""The first collision of a chain with its wall: the wave that comes back, what the wall takes.

The amplitude ratio of the reflected wave (ARR) is (2.9) of the thesis, velocities to the power 6/5.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from coupling.march import impact
from dem import march
from dem.chain import Chain, Wall
from dem.spheres import time_scale
from dem.trajectory import Trajectory
from dem.waves import solitary
from dem.waves.arrivals import crest, peaks
from dem.waves.measures import CONTACT, ContactTime, contact_time, force_ratio, leading_share

ERROR = 1e-5  # of the velocities
N_SAVE = 6000
BACK, AT_WALL = 4.0, 10.0  # natural times of a sphere: there and slowly back, and at the wall
FAINT = 0.02  # of the incident wave: below it there is no reflected one
FAINTEST_ARR = FAINT**1.2


class Collision(NamedTuple):
    """What the first collision does to a chain."""

    arr: float  # (2.9) at the observed sphere, 0 where no wave comes back
    lost: float  # share of the striker's energy that the spheres have not when the contact ends
    contact: ContactTime  # the first
    peak_force: float  # [N] of it
    trajectory: Trajectory


def collision(chain: Chain, wall: Wall, v0: NDArray[np.float64], sphere: int) -> Collision:
    """The chain against a wall, until even a slow wave is back at the striker; ARR at a sphere."""
    passing = time_scale(chain.mass.max(), chain.A.min(), np.abs(v0).max())
    duration = (BACK * len(chain.mass) + AT_WALL) * passing
    run = impact(chain, wall, v0, duration=duration, error=ERROR, n_save=N_SAVE).trajectory
    contact, again = first_contact(run.t, run.contact_force[:, -1])
    kept = np.interp(contact.end, run.t, run.energy_kinetic + run.energy_contact)
    lost = float(1 - kept / run.energy_kinetic[0])
    peak = run.contact_force[run.t <= contact.end, -1].max()
    arr = _amplitude_ratio(chain, run, sphere, again + contact.seconds)
    return Collision(arr, lost, contact, float(peak), run)


def first_contact(t: NDArray[np.float64], force: NDArray[np.float64]) -> tuple[ContactTime, float]:
    """The first collision in a record of the force (k,), and when [s] the next one starts.

    An echo from a plate's edge may make the next one the harder.
    """
    closed = force > CONTACT * force.max()
    turns = np.flatnonzero(np.diff(closed, prepend=False))
    second = turns[2] if len(turns) > 2 else len(t)
    again = t[second] if len(turns) > 2 else np.inf
    return contact_time(t[:second], force[:second]), float(again)


def _amplitude_ratio(chain: Chain, run: Trajectory, sphere: int, latest: float) -> float:
    """ARR of the first wave that comes back, 0 if its crest left the wall after `latest` [s]."""
    v = run.v[:, sphere - 1]
    there = peaks(v, 0.5 * v.max())[0]
    back = [k for k in peaks(-v, FAINT * v[there]) if k > there and v[k] < 0]
    if not back:
        return 0.0
    time, speed = crest(run.t, -v, back[0])
    passing = 1 / solitary.speed(speed, chain.mass[-1], chain.A[-2])
    if time - (len(chain.mass) - sphere) * passing > latest:
        return 0.0
    return float(force_ratio(crest(run.t, v, there)[1], speed))


def restitution(chain: Chain, wall: Wall, speed: float) -> float:
    """Of the chain's last sphere alone, thrown at the wall."""
    last = Chain(chain.mass[-1:], chain.radius[-1:], chain.A[-1:])
    natural = time_scale(last.mass[0], last.A[0], speed)
    run = impact(last, wall, [speed], duration=10 * natural, error=ERROR, n_save=N_SAVE).trajectory
    end = contact_time(run.t, run.contact_force[:, -1], threshold=0.0).end
    return -float(np.interp(end, run.t, run.v[:, 0])) / speed


class HeavyStriker(NamedTuple):
    """A striker of another mass before a long free chain."""

    ratio: float
    trajectory: Trajectory
    share: float  # of the energy, in the leading wave
    recoil: float  # its velocity at the end over that at the start


def heavy_striker(chain: Chain, ratio: float, speed: float) -> HeavyStriker:
    """A free chain of equal spheres whose first one is `ratio` times as heavy and has a speed, for
    55 natural times."""
    mass = chain.mass.copy()
    mass[0] *= ratio
    chain, unit = chain._replace(mass=mass), time_scale(chain.mass[1], chain.A[0], speed)
    run = march(
        chain, None, np.eye(len(mass))[0] * speed, duration=55 * unit, dt=0.05 * unit, n_save=1100
    )
    return HeavyStriker(ratio, run, leading_share(run, chain), float(run.v[-1, 0] / speed))
