"""Runs of a chain before a wall, their waves by name, and how far two runs differ.

The scripts of this folder share it. The distance of the k-th reflected waves of runs a and b is

    D_k(a, b)^2 = sum_s int (v_a - v_b)^2 dt  /  1/2 sum_s int (v_a^2 + v_b^2) dt

over the observed spheres s and, at each, the time in which the wave of either run passes: 0 for
equal waves, sqrt(2) for waves that do not meet.
"""

from collections.abc import Iterable, Sequence
from itertools import combinations
from textwrap import fill
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave import coupling, dem
from beadwave.dem.spheres import time_scale
from beadwave.dem.waves.labels import Label, labels
from beadwave.dem.waves.measures import WallContact, wall_contact
from beadwave.dem.waves.solitary import WIDTH, speed
from beadwave.dem.waves.tracks import WaveTrack, wave_tracks
from beadwave.workflows.report.plots import Line, Panel
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.chain.chain import chain, initial_velocity
from beadwave.workflows.stages.chain.walls import wall_of
from beadwave.workflows.stages.structure import bending

Array = NDArray[np.float64]

SPHERES = (1, 4, 14)  # observed in the thesis, counted from the striker
ERROR = 1e-4  # of the velocities, relative to the striker's
N_SAVE = 3000  # instants of a record
FAINT = 0.03  # of the largest wave's velocity: waves above it are followed


class Observed(NamedTuple):
    """A run with its waves along the chain, at the observed spheres (from 1) and at the wall."""

    name: str
    chain: dem.Chain
    trajectory: dem.Trajectory
    tracks: list[WaveTrack]
    labels: dict[int, list[Label]]  # by sphere
    contact: WallContact

    @property
    def milliseconds(self) -> Array:
        """Times of the record, (k,) [ms]."""
        return 1e3 * self.trajectory.t

    def velocity(self, sphere: int) -> Array:
        """Velocity of a sphere over time, (k,) [m/s], positive towards the wall."""
        return self.trajectory.v[:, sphere - 1]

    def wave(self, sphere: int, kind: str, number: int) -> Label | None:
        """A wave by its name, None if it does not pass the sphere."""
        named = (label for label in self.labels[sphere] if label[:2] == (kind, number))
        return next(named, None)

    def reflected(self, sphere: int) -> list[Label]:
        """Reflected waves at a sphere, in order of time."""
        return [label for label in self.labels[sphere] if label.kind == "reflected"]


def say(text: str) -> None:
    """Print a text below a blank line, each of its paragraphs filled to lines of 96 letters."""
    for paragraph in text.strip().split("\n\n"):
        print("\n" + fill(" ".join(paragraph.split()), 96))


def bare_chain(scene: Scene, flat: dem.Flat | None = None) -> dem.Chain:
    """The scene's spheres without arm, springs and damping, against a flat of their own material
    unless another one is given."""
    row = scene.chain
    flat = flat or dem.Flat(last(row.young), last(row.poisson))
    return dem.row_of_spheres(
        row.radius, row.density, row.young, row.poisson, count=row.count, flat=flat
    )


def last(value: float | Sequence[float]) -> float:
    """The last sphere's value of a key that has one value for all spheres, or one each."""
    return float(np.atleast_1d(value)[-1])


def round_trip(chain: dem.Chain, speed: float) -> float:
    """Time [s] in which a wave that a striker of this speed [m/s] sends through a chain of equal
    spheres is back at the striker: 2.8 natural times a sphere, contact with the wall included."""
    return 2.8 * len(chain.mass) * time_scale(chain.mass[0], chain.A[0], speed)


def impact(
    chain: dem.Chain, wall: dem.Wall, v0: Array, duration: float, error: float = ERROR,
    n_save: int = N_SAVE,
) -> dem.Trajectory:  # fmt: skip
    """The chain's run from velocities v0 (n,) [m/s] for duration [s]."""
    return coupling.impact(
        chain, wall, v0, duration=duration, error=error, n_save=n_save
    ).trajectory


def observed(
    name: str, chain: dem.Chain, run: dem.Trajectory, spheres: Iterable[int],
    faint: float = FAINT, visible: float = 0.0,
) -> Observed:  # fmt: skip
    """A run with its waves named at the spheres: those above `faint` of the largest wave, without
    those that move a sphere by less than `visible` of the striker's speed."""
    tracks = wave_tracks(run.t, run.v, run.contact_force, chain.mass, chain.A, threshold=faint)
    threshold = visible * np.abs(run.v[0]).max()
    named = {
        sphere: [
            label
            for label in labels(tracks, run.t, run.v[:, sphere - 1], sphere)
            if abs(label.arrival.peak_velocity) >= threshold
        ]
        for sphere in spheres
    }
    contact = wall_contact(run.t, run.v, run.contact_force, chain, tracks)
    return Observed(name, chain, run, tracks, named, contact)


def bending_wall(scene: Scene) -> dem.Wall:
    """The wall that the scene's beam or plate makes, its receptance reduced to an error of 1e-3:
    the scripts compare theories, not reductions."""
    exact = scene.but(reduction={"modes": None, "error": 1e-3})
    return wall_of(exact, bending.reduction(exact, bending.model(exact)))


def bending_run(scene: Scene, wall: dem.Wall) -> Observed:
    """The scene's chain before a wall of bending theory, observed."""
    duration = scene.time.duration
    # in the last 0.3 of a run spheres move chaotically, and only the energy is controlled
    run = coupling.impact(
        chain(scene), wall, initial_velocity(scene), duration=duration, n_save=8000, error=ERROR,
        horizon=0.7 * duration,
    ).trajectory  # fmt: skip
    spheres = scene.output.spheres or (1, scene.chain.count - 3)
    return observed(scene.name, chain(scene), run, spheres)


def first_mode(scene: Scene) -> float:
    """Lowest frequency [Hz] of the scene's beam or plate that is no rigid motion."""
    omega = bending.modes(scene, bending.model(scene)).omega
    return float(omega[omega > 1.0][0] / (2 * np.pi))


def record(title: str, runs: Iterable[Observed], sphere: int) -> Panel:
    """Velocity of a sphere over time, a curve for each run."""
    lines = [Line(run.name, run.milliseconds, run.velocity(sphere)) for run in runs]
    return Panel(title, "time [ms]", "velocity [m/s]", lines)


def wave_cells(run: Observed, sphere: int, numbers: Iterable[int]) -> list[float | None]:
    """Time [ms] and peak velocity [m/s] of the reflected waves, None for one that is not there."""
    waves = [run.wave(sphere, "reflected", k) for k in numbers]
    pairs = [(1e3 * w.arrival.time, w.arrival.peak_velocity) if w else (None, None) for w in waves]
    return [value for pair in pairs for value in pair]


def distance(a: Observed, b: Observed, number: int, spheres: Iterable[int]) -> float:
    """D_k of the reflected wave `number`; nan where neither run has it."""
    difference = energy = 0.0
    for sphere in spheres:
        # the full width at half maximum of the wave's peak, in either run
        window = np.zeros(len(a.trajectory.t), bool)
        for run in (a, b):
            if label := run.wave(sphere, "reflected", number):
                arrival, first = label.arrival, run.chain
                width = WIDTH / abs(speed(arrival.peak_velocity, first.mass[0], first.A[0]))
                window |= np.abs(run.trajectory.t - arrival.time) < 0.5 * width
        v, u = a.velocity(sphere)[window], b.velocity(sphere)[window]
        difference += np.sum((v - u) ** 2)
        energy += 0.5 * np.sum(v**2 + u**2)
    return float(np.sqrt(difference / energy)) if energy else np.nan


def overall(a: Observed, b: Observed, spheres: Iterable[int]) -> float:
    """Distance of all that comes back, from the first contact with the wall in run a on."""
    back = a.trajectory.t > a.contact.contact_time.start
    v, u = (np.concatenate([run.velocity(sphere)[back] for sphere in spheres]) for run in (a, b))
    return float(np.sqrt(np.sum((v - u) ** 2) / (0.5 * np.sum(v**2 + u**2))))


def spread(runs: Iterable[Observed], number: int, spheres: Iterable[int]) -> float:
    """Largest D_k between any two of the runs; nan where none has the wave."""
    distances = [distance(a, b, number, spheres) for a, b in combinations(runs, 2)]
    return float(np.nanmax(distances)) if np.isfinite(distances).any() else np.nan


def first_and_later(a: Observed, b: Observed) -> tuple[float, Array]:
    """Largest velocity difference [m/s] of two runs at the observed spheres until the first
    reflected wave of run a has passed each, and that over time (k,) [m/s] after it."""
    t, first, later = a.trajectory.t, [], []
    for sphere in a.labels:
        # the wave ends its width behind its crest; without one, with the contact at the wall
        wave, end = a.wave(sphere, "reflected", 1), a.contact.contact_time.end
        if wave is not None:
            passing = abs(speed(wave.arrival.peak_velocity, a.chain.mass[0], a.chain.A[0]))
            end = float(wave.arrival.time + WIDTH / passing)
        difference = np.abs(b.velocity(sphere) - a.velocity(sphere))
        first.append(float(difference[t <= end].max()))
        later.append(np.where(t <= end, 0.0, difference))
    return max(first), np.max(later, axis=0)
