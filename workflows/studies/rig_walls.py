"""The walls that the thesis sets before its chain, and how far two of them are apart in the waves.

    D_k(a, b)^2 = sum_s int (v_a - v_b)^2 dt  /  1/2 sum_s int (v_a^2 + v_b^2) dt

over the observed spheres s and, at each, the time in which the k-th reflected wave of either run
passes: 0 for equal waves, sqrt(2) for waves that do not meet.
"""

from collections.abc import Iterator
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import dem
from dem.solitary import WIDTH, speed
from workflows.chain_stages import chain, initial_velocity
from workflows.scene import HalfSpaceWall, RigidWall, Scene
from workflows.scene_file import scene as built_in
from workflows.stages import Watch, pipeline_of
from workflows.studies.observed import Observed, observed

ONE_DOF_HZ = (269.0, 907.0, 8425.0, 700.0, 240.0)  # thesis, sections 7.2 and 7.3
ROMS = {"ROM 269": "rig-rom-269", "ROM 907": "rig-rom-907", "ROM all four": "rig-rom"}
HALF_SPACE, RIGID = "half-space", "rigid"
N_WAVES = 4  # reflected ones that the thesis speaks of
UNMOVED = 0.1  # distance below which a wave does not depend on its wall
SLIGHT = STRONG = 0.5  # below it does slightly, above strongly


class Standing(NamedTuple):
    """A wall, and the chain before it: a rigid surface is a stiffer last contact."""

    name: str
    chain: dem.Chain
    wall: dem.Wall


def one_dof(hz: float) -> str:
    """Name of a one-mass wall."""
    return f"1-DOF {hz:g}"


def rig_walls(scene: Scene, watch: Watch) -> Iterator[Standing]:
    """All walls before the scene's chain; one-mass walls as in rig-1dof, reduced ones built in."""
    plain = chain(_with(scene, HalfSpaceWall(kind="half-space")))
    yield Standing(HALF_SPACE, plain, dem.rigid_wall())
    yield Standing(RIGID, chain(_with(scene, RigidWall(kind="rigid"))), dem.rigid_wall())
    mass = built_in("rig-1dof").wall
    for hz in ONE_DOF_HZ:
        yield Standing(one_dof(hz), plain, dem.one_dof_wall(hz, mass.mass, mass.damping_ratio))
    for name, known in ROMS.items():
        with watch(name):
            yield Standing(name, plain, pipeline_of(_meshed_as(scene, known), watch)("wall"))


def _with(scene: Scene, wall) -> Scene:
    return scene.model_copy(update={"wall": wall})


def _meshed_as(scene: Scene, name: str) -> Scene:
    """A built-in scene with the mesh, patch and reduction of this one."""
    known = built_in(name)
    same = ("mesh", "patch", "reduction")
    return known.model_copy(
        update={key: getattr(scene, key) or getattr(known, key) for key in same}
    )


def struck(scene: Scene, standing: Standing, spheres: tuple[int, ...], error: float) -> Observed:
    """The chain against one of the walls, for the scene's duration."""
    return observed(
        standing.name, standing.chain, standing.wall, initial_velocity(scene),
        duration=scene.time.duration, spheres=spheres, error=error,
    )  # fmt: skip


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
