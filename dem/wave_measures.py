"""What the literature reads off waves and the wall they strike: times, speeds, ratios.

J. Yang, C. Silvestro, D. Khatri, L. De Nardo, C. Daraio, Phys. Rev. E 83 (2011) 046606;
J. Yang, C. Silvestro, S. N. Sangiorgio, S. L. Borkowski, E. Ebramzadeh, L. De Nardo, C. Daraio,
Smart Mater. Struct. 21 (2012) 015008; thesis, section 2.2.1, whose equations are named.
"""

from typing import NamedTuple

import numpy as np

from dem.waves import energy_restitution, velocity_sum_ratio

CONTACT = 0.01  # of the peak force, where a contact counts as closed


class ContactTime(NamedTuple):
    """How long the largest collision with the wall lasts."""

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


def contact_time(t, force, *, threshold=CONTACT):
    """ContactTime of the collision with the largest force (k,); above the force at its start.

    It counts while the force is above `threshold` times its peak; ends are interpolated.
    """
    t, F = np.asarray(t, float), np.asarray(force, float)
    k, level = int(F.argmax()), F[0] + threshold * (F.max() - F[0])
    if F.max() <= F[0]:
        return ContactTime(0.0, np.nan, np.nan, float(level))
    before, after = np.flatnonzero(F[:k] <= level), np.flatnonzero(F[k:] <= level) + k
    start = _crossing(t, F, before[-1], level) if before.size else t[0]
    end = _crossing(t, F, after[0] - 1, level) if after.size else np.inf
    return ContactTime(float(end - start), float(start), float(end), float(level))


def _crossing(t, F, i, level):
    """Time between the samples i and i + 1 at which F passes the level."""
    return t[i] + (level - F[i]) / (F[i + 1] - F[i]) * (t[i + 1] - t[i])


def dimensionless_contact_time(seconds, mass, speed, A_wall):
    """tau_c of (2.5), T_c = tau_c m^(2/5) V^(-1/5) A_w^(-2/5) with the striker's speed V."""
    return seconds / (mass**0.4 * speed**-0.2 * A_wall**-0.4)


def travelling_time(n, radius, speed_in, speed_back):
    """(2.6) [s]: through n spheres and back."""
    return 2.0 * n * radius * (1.0 / speed_in + 1.0 / speed_back)


def force_ratio(incident, reflected):
    """ARR of (2.9): |reflected / incident peak velocity|^(6/5), the ratio of forces."""
    return abs(reflected / incident) ** 1.2


def train_speed(train, radius):
    """Speed [m/s] of a train past spheres of one radius [m], the slope through all its pulses."""
    times = np.array([pulse.time for pulse in train.pulses])
    places = 2.0 * radius * np.array([pulse.contact for pulse in train.pulses])
    return float(abs(np.polyfit(times - times[0], places, 1)[0]))


def wall_contact(t, v, contact_force, chain, trains):
    """WallContact of a chain's run; v (k, n), contact_force (k, n), its `trains`."""
    closed = contact_time(t, contact_force[:, -1])
    speed = float(np.abs(v[0]).max())
    inward, outward = (_first(trains, kind) for kind in ("incident", "reflected"))
    n, R = len(chain.mass), float(np.mean(chain.radius))
    there = np.nan if inward is None else train_speed(inward, R)
    back = np.nan if outward is None else train_speed(outward, R)
    travelling = travelling_time(n, R, there, back)
    return WallContact(
        closed,
        dimensionless_contact_time(closed.seconds, chain.mass[-1], speed, chain.A[-1]),
        there,
        back,
        travelling,
        closed.seconds + travelling,
        np.nan if inward is None or outward is None else _mean_ratio(inward, outward),
        velocity_sum_ratio(v[0], v[-1]),
        energy_restitution(chain.mass, v[0], v[-1]),
    )


def _first(trains, kind):
    """The largest of the first train of a kind and what comes out of it on the way."""
    return next((train for train in trains if train.kind == kind and train.number == 1), None)


def _mean_ratio(inward, outward):
    """Mean of (2.9) over the contacts that both pass; forces are what (2.9) compares."""
    there = {pulse.contact: pulse.force for pulse in inward.pulses}
    ratios = [p.force / there[p.contact] for p in outward.pulses if p.contact in there]
    return float(np.mean(ratios)) if ratios else np.nan
