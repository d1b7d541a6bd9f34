"""Waves that pass a sphere: time, peak velocity, and quality as a solitary wave.

The track of a wave says when it passes and how large it should be. A wave that passes alone is
measured on the record itself; overlapping waves are separated by a fit of their shape (`fit`).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from beadwave.dem.kernels.arguments import Array
from beadwave.dem.waves.arrivals import Arrival, crest, full_width
from beadwave.dem.waves.fit import Guess, apart, fit, groups
from beadwave.dem.waves.solitary import WIDTH
from beadwave.dem.waves.tracks import WaveTrack

# Limits for accepting a measured or fitted wave; ranges are not on record
# distance of two crests, in widths, below which a fit cannot separate them: quality is lowered
SEPARABLE = 0.6
CLEAR = 1.5  # distance of two crests, in widths, beyond which waves do not overlap
MAX_WIDTH_RATIO = 3.0  # width over that of the track's force; a wider crest is of several waves
# velocity at the end of a wave's window over its crest, from which on the wave is taken to
# leave its sphere moving
STAYS = 0.9
HIDDEN_CONTACTS = 3  # contacts before its first pulse at which a track is still looked for
# fitted peak of one of several overlapping waves, over that of the track's force: a larger one
# comes of waves that cancel each other in the fit, and means nothing
MAX_SHARED_PEAK = 2.0
MAX_SINGLE_PEAK = 5.0  # the same of a wave that passes alone: beyond it, the crest is another's


class Label(NamedTuple):
    """A wave at a sphere."""

    kind: str  # "incident" or "reflected"
    number: int  # of its track, from 1
    name: str  # of its track, "reflected 1" for instance
    arrival: Arrival
    alone: bool  # measured on the record; False: separated from overlapping waves by a fit


class _Passage(NamedTuple):
    """A track at a sphere."""

    guess: Guess
    track: int  # in the list of tracks
    leaves: float  # [s] when the sphere passes the wave on


def labels(
    tracks: Sequence[WaveTrack],
    t: Array,
    v: Array,
    sphere: int,
) -> tuple[Label, ...]:
    """Waves at a sphere (counted from 1) with velocity v (k,) [m/s] at times t (k,) [s], in order
    of time.

    The striker's own start is no arrival. A wave that leaves its sphere moving, as the last one
    does with the first sphere, has the time of its steepest rise and the velocity that it leaves.
    """
    # where and when each track passes the sphere, between its contacts on both sides
    passages = []
    for i, track in enumerate(tracks):
        way = 1 if track.kind == "incident" else -1
        enters, leaves = (sphere - 1, sphere) if way > 0 else (sphere, sphere - 1)
        first, last = track.pulses[0].contact, track.pulses[-1].contact
        hidden = way * (enters - first) < -HIDDEN_CONTACTS
        if hidden or way * (last - enters) < 0 or enters < 1:
            continue
        pulse = min(track.pulses, key=lambda pulse: abs(pulse.contact - enters))
        t_in, t_out = track.time_at(enters), track.time_at(leaves)
        guess = Guess(0.5 * (t_in + t_out), pulse.velocity, WIDTH * pulse.passing_time)
        passages.append(_Passage(guess, i, t_out))
    passages.sort()

    labelled = []
    for group in groups([passage.guess for passage in passages]):
        members, passages = passages[: len(group)], passages[len(group) :]
        waves = fit(t, v, group).arrivals
        others = [[guess for guess in group if guess is not passage.guess] for passage in members]
        alone = [
            all(apart(passage.guess, guess) > CLEAR for guess in guesses)
            for passage, guesses in zip(members, others, strict=True)
        ]

        # a wave that is fitted far larger than its track is cancelled by another one of the group,
        # so that no wave of the group can be trusted
        cancel = any(
            wave.peak_velocity / passage.guess.peak_velocity > MAX_SHARED_PEAK
            for passage, wave, single in zip(members, waves, alone, strict=False)
            if not single
        )
        for passage, wave, single, guesses in zip(members, waves, alone, others, strict=False):
            if single:
                arrival = _measured(t, v, passage, wave)
                arrival = _credible(passage.guess, arrival, MAX_SINGLE_PEAK)
            else:
                # two crests that nearly coincide can share their sum in any proportion, and the fit
                # is as good: quality falls with the square of their distance
                arrival = _credible(passage.guess, wave, 0.0 if cancel else MAX_SHARED_PEAK)
                closest = min(apart(passage.guess, guess) for guess in guesses)
                share = min(1.0, closest / SEPARABLE) ** 2
                arrival = arrival._replace(quality=share * arrival.quality)
            track = tracks[passage.track]
            labelled.append(Label(track.kind, track.number, track.name, arrival, single))
    return tuple(sorted(labelled, key=lambda label: label.arrival.time))


def _credible(guess, arrival, bound):
    """The arrival if its peak is within a factor `bound` of the track's, else the time and peak of
    the track itself with quality 0; bound = 0 accepts no arrival."""
    if bound and 1.0 / bound <= arrival.peak_velocity / guess.peak_velocity <= bound:
        return arrival
    return Arrival(*guess, 0.0)


def _measured(t, v, passage, fitted):
    """The crest of a wave that passes alone, on the record between its contacts; the fitted wave
    where the record has no crest there."""
    guess = passage.guess
    sign = np.sign(guess.peak_velocity)
    margin = 0.7 * guess.width
    window = (t >= guess.time - margin) & (t <= max(passage.leaves, guess.time) + margin)
    inside = np.flatnonzero(window)
    if inside.size < 3:
        return fitted
    k = inside[(sign * v[inside]).argmax()]
    if k == len(v) - 1 and sign * v[k] > sign * fitted.peak_velocity:
        # the record ends before the crest: the wave is at least as large as what is recorded, as it
        # would be had the crest come just before the end. Of a slow wave from which the sphere
        # flies off, the fit alone gave 0.017 m/s where the record ended at 0.026
        return fitted._replace(peak_velocity=float(v[k]), width=np.nan)
    if k in inside[[0, -1]] or sign * v[k] <= 0.0:
        return fitted
    time, height = crest(t, sign * v, k)
    if sign * v[inside[-1]] > STAYS * height:
        return fitted._replace(peak_velocity=float(sign * height), width=np.nan)
    width = full_width(t, sign * v, k)
    if not width < MAX_WIDTH_RATIO * guess.width:
        width = np.nan
    return Arrival(time, float(sign * height), width, fitted.quality)
