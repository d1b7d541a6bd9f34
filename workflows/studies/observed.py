"""A chain before a wall, run and looked at: its waves by name, its blow at the wall."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import coupling
import dem
from dem.labels import Label, labels
from dem.trains import Train, trains
from dem.wave_measures import WallContact, wall_contact
from workflows.chain_stages import chain
from workflows.scene import InvalidScene, Scene

ERROR = 1e-4  # of the velocities
N_SAVE = 3000


class Observed(NamedTuple):
    """A run and what it shows at the spheres that are watched, counted from 1."""

    name: str
    chain: dem.Chain
    trajectory: dem.Trajectory
    trains: tuple[Train, ...]
    labels: dict[int, tuple[Label, ...]]
    contact: WallContact

    @property
    def milliseconds(self) -> NDArray[np.float64]:
        return 1e3 * self.trajectory.t

    def velocity(self, sphere: int) -> NDArray[np.float64]:
        """(k,) [m/s]"""
        return self.trajectory.v[:, sphere - 1]

    def wave(self, sphere: int, kind: str, number: int) -> Label | None:
        """A wave by its name, None if it does not pass the sphere."""
        named = (label for label in self.labels[sphere] if label[:2] == (kind, number))
        return next(named, None)

    def reflected(self, sphere: int) -> tuple[Label, ...]:
        """What comes back to a sphere, in order of time."""
        return tuple(label for label in self.labels[sphere] if label.kind == "reflected")


def observed(
    name: str,
    row: dem.Chain,
    wall: dem.Wall,
    v0: NDArray[np.float64],
    *,
    duration: float,
    spheres: tuple[int, ...],
    error: float = ERROR,
    n_save: int = N_SAVE,
    faint: float = 0.03,
    visible: float = 0.0,
) -> Observed:
    """Run the chain with velocities v0 (n,) for duration [s] and follow its waves, those of more
    than `faint` times the largest one's velocity.

    A sphere that a wave moves by less than `visible` times the largest of v0 does not see it.
    """
    run = coupling.impact(
        row, wall, v0, duration=duration, error=error, n_save=n_save
    ).trajectory  # fmt: skip
    found = trains(run.t, run.v, run.contact_force, row.mass, row.A, threshold=faint)
    least = visible * np.abs(v0).max()
    named = {s: _seen(labels(found, run.t, run.v[:, s - 1], s), least) for s in spheres}
    blow = wall_contact(run.t, run.v, run.contact_force, row, found)
    return Observed(name, row, run, found, named, blow)


def _seen(named: tuple[Label, ...], least: float) -> tuple[Label, ...]:
    return tuple(label for label in named if abs(label.arrival.peak_velocity) >= least)


def bare(scene: Scene, **wall: float) -> dem.Chain:
    """The scene's spheres alone against a flat of wall_young, wall_poisson (default: its own)."""
    row = scene.chain
    own = {"wall_young": _last(row.young), "wall_poisson": _last(row.poisson)}
    return dem.row_of_spheres(
        row.radius, row.density, row.young, row.poisson, count=row.count, **own | wall
    )


def held(scene: Scene) -> dem.Chain:
    """The scene's chain with all that holds it."""
    return chain(scene)


def require_echo(scene: Scene, run: Observed) -> Observed:
    """The run; raises InvalidScene where it ends before a reflected wave passes a sphere."""
    if any(run.reflected(sphere) for sphere in run.labels):
        return run
    watched = ", ".join(map(str, run.labels))
    raise InvalidScene(
        f"time.duration = {scene.time.duration:g} s ends before a wave is back from the wall "
        f"({run.name}) at the spheres watched ({watched}); take a longer one, 3e-3 s for 17 "
        "spheres, or output.spheres nearer to the wall."
    )


def require_chain(scene: Scene, *, longest: int = 14) -> tuple[int, ...]:
    """The spheres to watch; raises InvalidScene unless a chain reaches that far."""
    if scene.chain is None:
        raise InvalidScene(f"the scene {scene.name} has no [chain]; add one, or take rig-rom.")
    if scene.chain.count <= longest:
        raise InvalidScene(
            f"chain.count = {scene.chain.count} is too short for this study; take at least "
            f"{longest + 1} spheres."
        )
    return scene.output.spheres or (1, 4, 14)


def _last(value) -> float:
    return float(np.atleast_1d(value)[-1])


def exponent(x, y) -> float:
    """Slope of log y over log x."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])
