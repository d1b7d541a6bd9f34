"""A chain before beams and plates told in one table: what the studies of them share."""

from collections.abc import Sequence

import numpy as np

import coupling
import dem
from workflows.evidence.thesis.observed_run import ERROR, Observed, Setup, seen
from workflows.scene import InvalidScene, Scene
from workflows.scene.parts import with_chain
from workflows.stages import bending
from workflows.stages.chain import chain, initial_velocity
from workflows.stages.wall import wall_of

REDUCED = {"modes": None, "error": 1e-3}  # of the receptance
SAVED = 8000  # instants of a run
HELD = 0.7  # of a run: later spheres move chaotically, and only the energy is held


def require(scene: Scene, table: str) -> None:
    """Raise InvalidScene unless a chain strikes a beam or a plate, as the study wants it."""
    if getattr(scene, table) is None:
        raise InvalidScene(f"the scene {scene.name} has no [{table}]; add one, or take {table}.")
    with_chain(scene)


def wall(scene: Scene) -> dem.Wall:
    """The wall that the scene's beam or plate makes."""
    exact = scene.but(reduction=REDUCED)
    return wall_of(exact, bending.reduction(exact, bending.model(exact)))


def first_mode(scene: Scene) -> float:
    """[Hz]"""
    omega = bending.modes(scene, bending.model(scene)).omega
    return float(omega[omega > 1.0][0] / (2 * np.pi))


def run(scene: Scene, leant_on: dem.Wall) -> Observed:
    """The scene's chain before a wall, its waves named."""
    setup = Setup(scene.name, chain(scene), leant_on)
    spheres = scene.output.spheres or (1, scene.chain.count - 3)
    duration = scene.time.duration
    held = {"error": ERROR, "horizon": HELD * duration}
    v0 = initial_velocity(scene)
    done = coupling.impact(setup.chain, leant_on, v0, duration=duration, n_save=SAVED, **held)
    return seen(setup, done.trajectory, spheres=spheres)


def slope(x: Sequence[float], y: Sequence[float], at: int) -> float:
    """d ln y / d ln x at a value between its neighbours."""
    x, y = np.log(x), np.log(y)
    return float((y[at + 1] - y[at - 1]) / (x[at + 1] - x[at - 1]))
