"""Distance of the waves that two walls reflect into the same chain.

    D_k(a, b)^2 = sum_s int (v_a - v_b)^2 dt  /  1/2 sum_s int (v_a^2 + v_b^2) dt

over the observed spheres s and, at each, the time in which the k-th reflected wave of either run
passes: 0 for equal waves, sqrt(2) for waves that do not meet.
"""

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.dem.waves.fit import Guess, apart
from beadwave.dem.waves.labels import Label
from beadwave.dem.waves.solitary import WIDTH, speed
from beadwave.workflows.evidence.thesis.observed_run import Observed


def distance(a: Observed, b: Observed, number: int, spheres: tuple[int, ...]) -> float:
    """D_k of the reflected wave `number`; nan where neither run has it."""
    difference = energy = 0.0
    for sphere in spheres:
        window = _window(a, sphere, number) | _window(b, sphere, number)
        v, u = a.velocity(sphere)[window], b.velocity(sphere)[window]
        difference += np.sum((v - u) ** 2)
        energy += 0.5 * np.sum(v**2 + u**2)
    return float(np.sqrt(difference / energy)) if energy else np.nan


def _window(run: Observed, sphere: int, number: int) -> NDArray[np.bool_]:
    """Where the wave is at the sphere: the full width at half maximum of one of its peak."""
    t, label = run.trajectory.t, run.wave(sphere, "reflected", number)
    if label is None:
        return np.zeros(len(t), bool)
    width = WIDTH / abs(speed(label.arrival.peak_velocity, run.chain.mass[0], run.chain.A[0]))
    return np.abs(t - label.arrival.time) < 0.5 * width


def overall(a: Observed, b: Observed, spheres: tuple[int, ...]) -> float:
    """The distance of all reflected waves together, from the first contact with the wall in run a
    on."""
    back = a.trajectory.t > a.contact.contact_time.start
    v, u = (np.concatenate([run.velocity(sphere)[back] for sphere in spheres]) for run in (a, b))
    return float(np.sqrt(np.sum((v - u) ** 2) / (0.5 * np.sum(v**2 + u**2))))


def spread(runs: list[Observed], number: int, spheres: tuple[int, ...]) -> float:
    """Largest D_k between any two of the runs; nan where none has the wave."""
    distances = [distance(a, b, number, spheres) for a, b in combinations(runs, 2)]
    return float(np.nanmax(distances)) if np.isfinite(distances).any() else np.nan


def separation(run: Observed, spheres: tuple[int, ...]) -> float:
    """Smallest distance of neighbouring reflected waves at these spheres, in widths; 0 where no
    sphere has two."""

    def guess(label: Label) -> Guess:
        wave = label.arrival
        width = wave.width if wave.width == wave.width else 0.0
        return Guess(wave.time, wave.peak_velocity, width or 1e-4)  # s, of a wave without a width

    gaps = [
        apart(guess(earlier), guess(later))
        for sphere in spheres
        for earlier, later in zip(run.reflected(sphere), run.reflected(sphere)[1:], strict=False)
    ]
    return min(gaps, default=0.0)


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
        arrival = self.times[self.one]
        masses = (name for name in self.times if name != self.one)
        return min(masses, key=lambda name: abs(arrival - self.times[name]))

    @property
    def ranked(self) -> list[str]:
        """Names of the one-mass walls in order of their distance, the nearest first."""
        return sorted(self.distance, key=self.distance.get)

    @property
    def chooses(self) -> bool:
        """Whether the distance tells the first of them from the second: it is less than half."""
        first, second, *_ = self.ranked
        return self.distance[first] < 0.5 * self.distance[second]


def similarity(
    runs: Mapping[str, Observed],
    wall: str,
    mass: str,
    *,
    masses: Sequence[str],
    number: int,
    spheres: tuple[int, ...],
) -> Similarity:
    """Of the one-mass walls named `masses`, `mass` among them, to `wall`, by the reflected wave
    `number` at the last of the spheres."""
    masses = [name for name in masses if name in runs]
    names = [name for name in (wall, *masses) if name in runs]
    waves = {name: runs[name].wave(spheres[-1], "reflected", number) for name in names}
    times = {name: label.arrival.time for name, label in waves.items() if label}
    compared = [name for name in masses if name in times and wall in times]
    distances = {name: overall(runs[wall], runs[name], spheres) for name in compared}
    return Similarity(wall, mass, times, distances)


class DependenceLimits(NamedTuple):
    """Distances of the waves before two walls by which the thesis' words are judged; not varied."""

    unmoved: float = 0.1  # below it a wave does not depend on its wall
    slight: float = 0.5  # below it a wave depends slightly on it
    strong: float = 0.5  # above it a wave depends strongly on it


def felt(free: Observed, loaded: Observed, noticed: float) -> tuple[float, float, float]:
    """Largest velocity differences of two runs at the observed spheres, over the striker's
    velocity, until the first reflected wave has passed and later; and when [s] the later ones
    first exceed `noticed`, nan where they do not."""
    t, v0 = free.trajectory.t, np.abs(free.trajectory.v[0]).max()
    first, later = [], []
    for sphere in free.labels:
        # the wave's end: its width behind its crest, the contact's end without one
        wave = free.wave(sphere, "reflected", 1)
        end = free.contact.contact_time.end
        if wave is not None:
            passing = abs(speed(wave.arrival.peak_velocity, free.chain.mass[0], free.chain.A[0]))
            end = float(wave.arrival.time + WIDTH / passing)

        difference = np.abs(loaded.velocity(sphere) - free.velocity(sphere)) / v0
        first.append(float(difference[t <= end].max()))
        later.append(np.where(t <= end, 0.0, difference))

    largest = np.max(later, axis=0)
    at = float(t[np.argmax(largest > noticed)]) if largest.max() > noticed else float("nan")
    return max(first), float(largest.max()), at
