"""A chain at a beam or plate of bending theory: functions that the studies of these share."""

import numpy as np

import coupling
import dem
from dem.waves.measures import WallContact
from workflows.evidence.thesis.observed_run import Observed, RecordOptions, Setup, seen
from workflows.scene import InvalidScene, Scene
from workflows.scene.parts import with_chain
from workflows.stages import bending
from workflows.stages.chain import chain, initial_velocity
from workflows.stages.walls import wall_of


def require(scene: Scene, table: str) -> None:
    """Raise InvalidScene unless a chain strikes a beam or a plate, as the study wants it."""
    if getattr(scene, table) is None:
        raise InvalidScene(f"the scene {scene.name} has no [{table}]; add one, or take {table}.")
    with_chain(scene)


def wall(scene: Scene) -> dem.Wall:
    """The wall that the scene's beam or plate makes, its receptance reduced to an error of 1e-3:
    studies compare theories, not reductions."""
    exact = scene.but(reduction={"modes": None, "error": 1e-3})
    return wall_of(exact, bending.reduction(exact, bending.model(exact)))


def first_mode(scene: Scene) -> float:
    """The lowest frequency [Hz] of the beam or plate that is no rigid motion."""
    omega = bending.modes(scene, bending.model(scene)).omega
    return float(omega[omega > 1.0][0] / (2 * np.pi))


def run(scene: Scene, before_wall: dem.Wall) -> Observed:
    """The scene's chain before a wall, its waves named."""
    setup = Setup(scene.name, chain(scene), before_wall)
    spheres = scene.output.spheres or (1, scene.chain.count - 3)
    duration = scene.time.duration
    # in the last 0.3 of a run spheres move chaotically, and only the energy is controlled
    impact = coupling.impact(
        setup.chain, before_wall, initial_velocity(scene), duration=duration, n_save=8000,
        error=RecordOptions().error, horizon=0.7 * duration,
    )  # fmt: skip
    return seen(setup, impact.trajectory, spheres=spheres)


def tof_and_arr(contact: WallContact) -> tuple[float, float]:
    """Time of flight [s] and amplitude ratio of the first reflected wave, nan without one."""
    nan = float("nan")
    return (
        nan if contact.tof is None else contact.tof,
        nan if contact.arr is None else contact.arr,
    )
