"""Which wave passes a sphere when, how fast it makes it, and how much it looks like a wave.

A wave that passes alone is measured on the record itself; waves that overlap are taken apart by
their shape. What a wave must look like there, and when, is known from its track.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dem.kernels.arguments import Array
from dem.waves.arrivals import Arrival, crest, full_width
from dem.waves.fit import Guess, apart, fit, groups
from dem.waves.solitary import WIDTH
from dem.waves.tracks import WaveTrack

SEPARABLE = 0.6  # widths between crests from which on a fit shares waves out as they are
CLEAR = 1.5  # widths between crests from which on waves do not touch
WIDEST = 3.0  # of what a track's force says; a wider crest is that of several waves
STAYS = 0.9  # of the crest, left behind by a wave that leaves its sphere moving
HIDDEN = 3  # contacts before its first pulse at which a track is still looked for
TWICE = 2.0  # of what a track's force says: what is taken out of overlapping waves beyond it is
# several large waves that cancel, a fit without meaning
FAR = 5.0  # the same for a wave that passes alone: beyond it the crest belongs to something else


class Label(NamedTuple):
    """A wave at a sphere; `alone` if it was measured, not taken out of others."""

    kind: str  # "incident" or "reflected"
    number: int
    name: str
    arrival: Arrival
    alone: bool


class _Passage(NamedTuple):
    guess: Guess
    number: int  # in the list of tracks
    leaves: float  # [s] when the sphere passes the wave on


def labels(tracks: Sequence[WaveTrack], t: Array, v: Array, sphere: int) -> tuple[Label, ...]:
    """Waves at a sphere (counted from 1) with record v (k,), in order of time.

    The striker's own start is no arrival. The time of a wave that leaves its sphere moving, as the
    last one does with the first sphere, is that of the steepest rise, its peak what it leaves.
    """
    passages = sorted(_passages(tracks, sphere))
    found = []
    for group in groups([passage.guess for passage in passages]):
        own = [passages.pop(0) for _ in group]
        for passage, alone, arrival in _arrivals(t, v, own):
            track = tracks[passage.number]
            found.append(Label(*track[:2], track.name, arrival, alone))
    return tuple(sorted(found, key=lambda label: label.arrival.time))


def _arrivals(t, v, passages):
    """Passages of one group, each with whether it is alone and its arrival."""
    guesses = [passage.guess for passage in passages]
    fitted = fit(t, v, guesses).arrivals
    alone = [all(apart(g, other) > CLEAR for other in guesses if other is not g) for g in guesses]
    each = tuple(zip(passages, alone, fitted, strict=False))
    cancel = any(_ratio(p.guess, wave) > TWICE for p, one, wave in each if not one)
    for passage, one, wave in each:
        if one:
            yield passage, one, _credible(passage.guess, _measured(t, v, passage, wave), FAR)
        else:
            taken = _credible(passage.guess, wave, 0.0 if cancel else TWICE)
            share = _separability(passage.guess, guesses)
            yield passage, one, taken._replace(quality=share * taken.quality)


def _separability(guess, guesses):
    """1 for a crest far enough from the next, less the closer they are: a sum fits any share."""
    nearest = min(apart(guess, other) for other in guesses if other is not guess)
    return min(1.0, nearest / SEPARABLE) ** 2


def _ratio(guess, arrival):
    return arrival.peak_velocity / guess.peak_velocity


def _passages(tracks, sphere):
    for i, track in enumerate(tracks):
        way = 1 if track.kind == "incident" else -1
        enters, leaves = (sphere - 1, sphere) if way > 0 else (sphere, sphere - 1)
        first, last = track.pulses[0].contact, track.pulses[-1].contact
        if way * (enters - first) < -HIDDEN or way * (last - enters) < 0 or enters < 1:
            continue
        near = min(track.pulses, key=lambda pulse: abs(pulse.contact - enters))
        at, width = track.time_at(enters), WIDTH * near.passing_time
        out = track.time_at(leaves)
        yield _Passage(Guess(0.5 * (at + out), near.velocity, width), i, out)


def _credible(guess, arrival, most):
    """The arrival, or what the track says with quality 0 where the two differ too much."""
    if most and 1.0 / most <= _ratio(guess, arrival) <= most:
        return arrival
    return Arrival(*guess, 0.0)


def _measured(t, v, passage, fitted):
    """The crest in the record, or what the fit says where the record has none."""
    guess = passage.guess
    sign = np.sign(guess.peak_velocity)
    from_, to = guess.time - 0.7 * guess.width, max(passage.leaves, guess.time) + 0.7 * guess.width
    inside = np.flatnonzero((t >= from_) & (t <= to))
    if inside.size < 3:
        return fitted
    k = inside[(sign * v[inside]).argmax()]
    if k in (0, len(v) - 1, *inside[[0, -1]]) or sign * v[k] <= 0.0:
        return fitted
    time, height = crest(t, sign * v, k)
    if sign * v[inside[-1]] > STAYS * height:
        return fitted._replace(peak_velocity=float(sign * height), width=np.nan)
    width = full_width(t, sign * v, k)
    own = width if width < WIDEST * guess.width else np.nan
    return Arrival(time, float(sign * height), own, fitted.quality)
