"""Which wave passes a sphere when, how fast it makes it, and how much it looks like a wave.

A wave that passes alone is measured on the record itself; waves that overlap are taken apart by
their shape. What a wave must look like there, and when, is known from its train.
"""

from typing import NamedTuple

import numpy as np

from dem.solitary import WIDTH
from dem.wave_fit import Guess, apart, fit, groups
from dem.waves import Arrival, crest, full_width

CLEAR = 1.5  # widths between crests from which on waves do not touch
STAYS = 0.9  # of the crest, left behind by a wave that leaves its sphere moving
HIDDEN = 3  # contacts before its first pulse at which a train is still looked for


class Label(NamedTuple):
    """A wave at a sphere; `alone` if it was measured, not taken out of others."""

    kind: str  # "incident" or "reflected"
    number: int
    name: str
    arrival: Arrival
    alone: bool


class _Passage(NamedTuple):
    guess: Guess
    number: int  # in the list of trains
    leaves: float  # [s] when the sphere passes the wave on


def labels(trains, t, v, sphere):
    """Waves at a sphere (counted from 1) with record v (k,), in order of time.

    The striker's own start is no arrival. The time of a wave that leaves its sphere moving, as the
    last one does with the first sphere, is that of the steepest rise, its peak what it leaves.
    """
    passages = sorted(_passages(trains, sphere))
    together = groups([passage.guess for passage in passages])
    found = []
    for group in together:
        own = [passages.pop(0) for _ in group]
        arrivals = fit(t, v, group).arrivals
        for passage, arrival in zip(own, arrivals, strict=False):
            train = trains[passage.number]
            alone = all(apart(passage.guess, g) > CLEAR for g in group if g is not passage.guess)
            if alone:
                arrival = _measured(t, v, passage, arrival)
            found.append(Label(*train[:2], train.name, _credible(passage, arrival), alone))
    return tuple(sorted(found, key=lambda label: label.arrival.time))


def _passages(trains, sphere):
    for i, train in enumerate(trains):
        way = 1 if train.kind == "incident" else -1
        enters, leaves = (sphere - 1, sphere) if way > 0 else (sphere, sphere - 1)
        first, last = train.pulses[0].contact, train.pulses[-1].contact
        if way * (enters - first) < -HIDDEN or way * (last - enters) < 0 or enters < 1:
            continue
        near = min(train.pulses, key=lambda pulse: abs(pulse.contact - enters))
        at, width = train.time_at(enters), WIDTH * near.passing_time
        out = train.time_at(leaves)
        yield _Passage(Guess(0.5 * (at + out), near.velocity, width), i, out)


def _credible(passage, arrival):
    """The arrival, or what the train says with quality 0 where the record hides the wave."""
    guess = passage.guess
    if arrival.peak_velocity * guess.peak_velocity > 0.0:
        return arrival
    return Arrival(*guess, 0.0)


def _measured(t, v, passage, fitted):
    """The crest in the record, or what the fit says where the record has none."""
    guess = passage.guess
    sign = np.sign(guess.peak_velocity)
    from_, to = guess.time - 0.7 * guess.width, max(passage.leaves, guess.time) + 0.7 * guess.width
    inside = np.flatnonzero((t >= from_) & (t <= to))
    k = inside[(sign * v[inside]).argmax()] if inside.size else 0
    if k in (0, len(v) - 1, *inside[[0, -1]]) or sign * v[k] <= 0.0:
        return fitted
    time, height = crest(t, sign * v, k)
    if sign * v[inside[-1]] > STAYS * height:
        return fitted._replace(peak_velocity=float(sign * height), width=np.nan)
    return Arrival(time, float(sign * height), full_width(t, sign * v, k), fitted.quality)
