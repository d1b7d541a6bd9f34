"""A chain before a wall, run and observed: its waves by name, its collision with the wall."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.coupling.march import impact
from beadwave.dem.chain import Chain
from beadwave.dem.spheres import max_pressure, modulus_of_contact, radii_of_contacts, time_scale
from beadwave.dem.trajectory import Trajectory
from beadwave.dem.walls import Wall
from beadwave.dem.waves.labels import Label, labels
from beadwave.dem.waves.measures import WallContact, wall_contact
from beadwave.dem.waves.tracks import WaveTrack, wave_tracks
from beadwave.workflows.report.plots import Line, Panel


class RecordOptions(NamedTuple):
    """How a run is marched and saved, and which of its waves are followed; not varied."""

    error: float = 1e-4  # of the velocities, relative
    n_save: int = 3000  # instants of a record
    faint: float = 0.03  # of the largest wave's velocity: waves above it are followed
    visible: float = 0.0  # of the fastest sphere's at the start: what a wave moves a sphere by


class Setup(NamedTuple):
    """A named wall and the chain before it, whose last contact knows the wall's surface."""

    name: str
    chain: Chain
    wall: Wall


class Observed(NamedTuple):
    """A run with its waves along the chain, at the observed spheres (from 1) and at the wall."""

    name: str
    chain: Chain
    trajectory: Trajectory
    tracks: tuple[WaveTrack, ...]
    labels: dict[int, tuple[Label, ...]]
    contact: WallContact

    @property
    def milliseconds(self) -> NDArray[np.float64]:
        """Times of the record, (k,) [ms]."""
        return 1e3 * self.trajectory.t

    def velocity(self, sphere: int) -> NDArray[np.float64]:
        """Velocity of a sphere over time, (k,) [m/s], positive towards the wall."""
        return self.trajectory.v[:, sphere - 1]

    def wave(self, sphere: int, kind: str, number: int) -> Label | None:
        """A wave by its name, None if it does not pass the sphere."""
        named = (label for label in self.labels[sphere] if label[:2] == (kind, number))
        return next(named, None)

    def reflected(self, sphere: int) -> tuple[Label, ...]:
        """Reflected waves at a sphere, in order of time."""
        return tuple(label for label in self.labels[sphere] if label.kind == "reflected")

    def largest(self, number: int) -> float:
        """Largest velocity of a reflected wave in any contact over the fastest sphere's at the
        start, 0 without one."""
        back = [
            track for track in self.tracks if (track.kind, track.number) == ("reflected", number)
        ]
        sizes = [abs(pulse.velocity) for track in back for pulse in track.pulses]
        return max(sizes, default=0.0) / np.abs(self.trajectory.v[0]).max()

    @property
    def parted(self) -> float:
        """Time [s] for which the last spheres do not touch while the wall is touched."""
        contact, t = self.contact.contact_time, self.trajectory.t
        inside = (t > contact.start) & (t < contact.end)
        return float((self.trajectory.contact_force[inside, -2] == 0.0).sum() * (t[1] - t[0]))

    @property
    def pressures(self) -> NDArray[np.float64]:
        """Largest pressure [Pa] ever in each contact (n,), the last one at the wall."""
        R = radii_of_contacts(self.chain.radius)
        modulus = modulus_of_contact(self.chain.A, R)
        return max_pressure(self.trajectory.contact_force.max(axis=0), R, modulus)


def round_trip(chain: Chain, speed: float) -> float:
    """Time [s] in which a wave that a striker of this speed [m/s] sends through a chain of equal
    spheres is back at the striker: 2.8 natural times a sphere, contact with the wall included."""
    return 2.8 * len(chain.mass) * time_scale(chain.mass[0], chain.A[0], speed)


def observed(
    setup: Setup,
    v0: NDArray[np.float64],
    *,
    duration: float,
    spheres: tuple[int, ...],
    options: RecordOptions = RecordOptions(),
) -> Observed:
    """Run its chain with velocities v0 (n,) [m/s] for duration [s], follow its waves and name them
    at the spheres."""
    run = impact(
        setup.chain, setup.wall, v0, duration=duration, error=options.error, n_save=options.n_save
    )
    return seen(setup, run.trajectory, spheres=spheres, options=options)


def seen(
    setup: Setup,
    run: Trajectory,
    *,
    spheres: tuple[int, ...],
    options: RecordOptions = RecordOptions(),
) -> Observed:
    """A run that is there, observed; arguments as in `observed`."""
    name, row, _ = setup
    tracks = wave_tracks(run.t, run.v, run.contact_force, row.mass, row.A, threshold=options.faint)

    # waves by their names at each observed sphere, without those that hardly move it
    threshold = options.visible * np.abs(run.v[0]).max()
    named = {
        sphere: tuple(
            label
            for label in labels(tracks, run.t, run.v[:, sphere - 1], sphere)
            if abs(label.arrival.peak_velocity) >= threshold
        )
        for sphere in spheres
    }

    contact = wall_contact(run.t, run.v, run.contact_force, row, tracks)
    return Observed(name, row, run, tracks, named, contact)


def record(title: str, runs: Iterable[Observed], sphere: int) -> Panel:
    """Velocity of a sphere over time, a curve for each run."""
    lines = [Line(run.name, run.milliseconds, run.velocity(sphere)) for run in runs]
    return Panel(title, "time [ms]", "velocity [m/s]", lines)


def wave_columns(numbers: Iterable[int]) -> list[str]:
    """Headings of `wave_cells`: time and peak velocity of each reflected wave."""
    return [f"{what}{k}" for k in numbers for what in ("t_ms_", "v_m_s_")]


def wave_cells(run: Observed, sphere: int, numbers: Iterable[int]) -> list[float | None]:
    """Time [ms] and peak velocity [m/s] of the reflected waves, None for one that is not seen."""
    waves = [run.wave(sphere, "reflected", k) for k in numbers]
    pairs = [(1e3 * w.arrival.time, w.arrival.peak_velocity) if w else (None, None) for w in waves]
    return [value for pair in pairs for value in pair]
