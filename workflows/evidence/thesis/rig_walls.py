"""The walls that the thesis sets before its chain."""

from collections.abc import Iterator

import dem
from workflows.evidence.thesis.observed_run import Observed, Setup, observed
from workflows.files.scene import scene as built_in
from workflows.scene import HalfSpaceWall, RigidWall, Scene
from workflows.stages.chain import chain, initial_velocity
from workflows.stages.pipeline import Progress, pipeline_of

ONE_DOF_HZ = (269.0, 907.0, 8425.0, 700.0, 240.0)  # thesis, sections 7.2 and 7.3
ROMS = {"ROM 269": "rig-rom-269", "ROM 907": "rig-rom-907", "ROM all four": "rig-rom"}
HALF_SPACE, RIGID = "half-space", "rigid"
N_WAVES = 4  # reflected ones that the thesis speaks of
UNMOVED = 0.1  # distance below which a wave does not depend on its wall
SLIGHT = STRONG = 0.5  # below it does slightly, above strongly


def one_dof(hz: float) -> str:
    """Name of a one-mass wall."""
    return f"1-DOF {hz:g}"


def rig_walls(scene: Scene, progress: Progress) -> Iterator[Setup]:
    """All walls before the scene's chain; one-mass walls as in rig-1dof, reduced ones built in."""
    plain = chain(scene.but(wall=HalfSpaceWall(kind="half-space")))
    yield Setup(HALF_SPACE, plain, dem.rigid_wall())
    yield Setup(RIGID, chain(scene.but(wall=RigidWall(kind="rigid"))), dem.rigid_wall())
    mass = built_in("rig-1dof").wall
    for hz in ONE_DOF_HZ:
        yield Setup(one_dof(hz), plain, dem.one_dof_wall(hz, mass.mass, mass.damping_ratio))
    for name, known in ROMS.items():
        with progress(name):
            yield Setup(name, plain, pipeline_of(_meshed_as(scene, known), progress)("wall"))


def _meshed_as(scene: Scene, name: str) -> Scene:
    """A built-in scene with the mesh, patch and reduction of this one."""
    known = built_in(name)
    same = ("mesh", "patch", "reduction")
    return known.but(**{key: getattr(scene, key) or getattr(known, key) for key in same})


def impact_run(scene: Scene, standing: Setup, spheres: tuple[int, ...], error: float) -> Observed:
    """The chain against one of the walls, for the scene's duration."""
    return observed(
        standing, initial_velocity(scene), duration=scene.time.duration, spheres=spheres,
        error=error,
    )  # fmt: skip
