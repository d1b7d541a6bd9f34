"""How far apart the waves are that two walls send back through the same chain.

    D_k(a, b)^2 = sum_s int (v_a - v_b)^2 dt  /  1/2 sum_s int (v_a^2 + v_b^2) dt

over the observed spheres s and, at each, the time in which the k-th reflected wave of either run
passes: 0 for equal waves, sqrt(2) for waves that do not meet.
"""

from collections.abc import Mapping, Sequence
from itertools import combinations
from math import isnan
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dem.waves.fit import Guess, apart
from dem.waves.labels import Label
from dem.waves.solitary import WIDTH, speed
from workflows.evidence.thesis.observed_run import Observed

NOTICED = 0.01  # of the striker's velocity: a difference


def distance(one: Observed, other: Observed, number: int, spheres: tuple[int, ...]) -> float:
    """D_k of the reflected wave `number`; nan where neither run has it."""
    apart = energy = 0.0
    for sphere in spheres:
        window = _window(one, sphere, number) | _window(other, sphere, number)
        v, u = one.velocity(sphere)[window], other.velocity(sphere)[window]
        apart += np.sum((v - u) ** 2)
        energy += 0.5 * np.sum(v**2 + u**2)
    return float(np.sqrt(apart / energy)) if energy else np.nan


def _window(run: Observed, sphere: int, number: int) -> NDArray[np.bool_]:
    """Where the wave is at the sphere: the full width at half maximum of one of its peak."""
    t, label = run.trajectory.t, run.wave(sphere, "reflected", number)
    if label is None:
        return np.zeros(len(t), bool)
    width = WIDTH / abs(speed(label.arrival.peak_velocity, run.chain.mass[0], run.chain.A[0]))
    return np.abs(t - label.arrival.time) < 0.5 * width


def overall(one: Observed, other: Observed, spheres: tuple[int, ...]) -> float:
    """The same over all that comes back, from the wall's first touch on."""
    back = one.trajectory.t > one.contact.contact_time.start
    v, u = (
        np.concatenate([run.velocity(sphere)[back] for sphere in spheres]) for run in (one, other)
    )
    return float(np.sqrt(np.sum((v - u) ** 2) / (0.5 * np.sum(v**2 + u**2))))


def spread(runs: list[Observed], number: int, spheres: tuple[int, ...]) -> float:
    """Largest D_k between any two of the runs."""
    found = [distance(a, b, number, spheres) for a, b in combinations(runs, 2)]
    return float(np.nanmax(found)) if np.isfinite(found).any() else np.nan


def separation(run: Observed, spheres: tuple[int, ...]) -> float:
    """Smallest distance of neighbouring reflected waves at these spheres, in widths."""
    gaps = [
        apart(_guess(one), _guess(other))
        for sphere in spheres
        for one, other in zip(run.reflected(sphere), run.reflected(sphere)[1:], strict=False)
    ]
    return min(gaps, default=0.0)


def _guess(label: Label) -> Guess:
    wave = label.arrival
    width = wave.width if wave.width == wave.width else 0.0
    return Guess(wave.time, wave.peak_velocity, width or 1e-4)


class Similarity(NamedTuple):
    """Whether the one-mass wall `other` is the nearest to `one`, by the fourth wave's arrival."""

    one: str
    other: str
    times: dict[str, float]  # [s] of the fourth waves, of `one` and of the one-mass walls
    distance: dict[str, float]  # over all that comes back, of the one-mass walls to `one`

    @property
    def missing(self) -> str | None:
        """The wall that sends no fourth wave, if one of the two does not."""
        return next((name for name in (self.one, self.other) if name not in self.times), None)

    @property
    def nearest(self) -> str:
        """The one-mass wall whose fourth wave comes nearest to that of `one`."""
        at = self.times[self.one]
        others = (name for name in self.times if name != self.one)
        return min(others, key=lambda name: abs(at - self.times[name]))

    @property
    def ranked(self) -> list[str]:
        """One-mass walls from the least distance on."""
        return sorted(self.distance, key=self.distance.get)

    @property
    def chooses(self) -> bool:
        """Whether the distance tells the first of them from the second."""
        first, second, *_ = self.ranked
        return self.distance[first] < 0.5 * self.distance[second]


def similarity(
    runs: Mapping[str, Observed],
    one: str,
    other: str,
    *,
    masses: Sequence[str],
    number: int,
    spheres: tuple[int, ...],
) -> Similarity:
    """Of the one-mass walls named `masses` to `one`, by the reflected wave `number` at the last of
    the spheres."""
    masses = [name for name in masses if name in runs]
    there = [name for name in (one, *masses) if name in runs]
    found = {name: runs[name].wave(spheres[-1], "reflected", number) for name in there}
    times = {name: label.arrival.time for name, label in found.items() if label}
    compared = [name for name in masses if name in times and one in times]
    apart = {name: overall(runs[one], runs[name], spheres) for name in compared}
    return Similarity(one, other, times, apart)


class Dependence(NamedTuple):
    """Largest distance of two walls in a reflected wave; None, and no sphere, if none sends it."""

    distance: float | None
    by_sphere: dict[int, float]


def dependence(runs: list[Observed], number: int, spheres: tuple[int, ...]) -> Dependence:
    found = {sphere: spread(runs, number, (sphere,)) for sphere in spheres}
    seen = {sphere: value for sphere, value in found.items() if not isnan(value)}
    return Dependence(None if isnan(far := spread(runs, number, spheres)) else far, seen)


class Felt(NamedTuple):
    """Largest velocity differences of two runs over the striker's velocity."""

    first: float  # until the first reflected wave has passed
    later: float
    at: float  # [s] where the later ones first exceed the threshold, nan where they do not


def felt(free: Observed, other: Observed) -> Felt:
    """How far two runs differ at the observed spheres, before and after the first wave's end."""
    t, v0, largest = free.trajectory.t, np.abs(free.trajectory.v[0]).max(), []
    for sphere in free.labels:
        off = np.abs(other.velocity(sphere) - free.velocity(sphere)) / v0
        largest.append((off, t <= _end_of_first(free, sphere)))
    later = np.max([np.where(first, 0.0, off) for off, first in largest], axis=0)
    at = float(t[np.argmax(later > NOTICED)]) if later.max() > NOTICED else float("nan")
    return Felt(max(float(off[first].max()) for off, first in largest), float(later.max()), at)


def _end_of_first(run: Observed, sphere: int) -> float:
    """[s] when the first reflected wave has passed a sphere, the contact's end without one."""
    wave = run.wave(sphere, "reflected", 1)
    if wave is None:
        return run.contact.contact_time.end
    passing = abs(speed(wave.arrival.peak_velocity, run.chain.mass[0], run.chain.A[0]))
    return float(wave.arrival.time + WIDTH / passing)
