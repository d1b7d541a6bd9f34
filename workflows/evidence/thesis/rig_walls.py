"""The walls that the thesis sets before its chain."""

from collections.abc import Iterator

import dem
from workflows.evidence.thesis.observed_run import Observed, RecordOptions, Setup, observed
from workflows.files.scene import scene as built_in
from workflows.scene import HalfSpaceWall, RigidWall, Scene
from workflows.stages.chain import chain, initial_velocity
from workflows.stages.pipeline import pipeline_of
from workflows.stages.progress import Progress

ONE_DOF_HZ = (269.0, 907.0, 8425.0, 700.0, 240.0)  # thesis, sections 7.2 and 7.3
ROMS = {"ROM 269": "rig-rom-269", "ROM 907": "rig-rom-907", "ROM all four": "rig-rom"}
SHARED = ("mesh", "patch", "reduction")  # tables that reduced walls take from the user's scene
HALF_SPACE, RIGID = "half-space", "rigid"
N_WAVES = 4  # reflected waves that the thesis speaks of


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
    for name, scene_name in ROMS.items():
        # a built-in scene with the mesh, patch and reduction of this one
        reduced = built_in(scene_name)
        tables = {key: getattr(scene, key) or getattr(reduced, key) for key in SHARED}
        with progress(name):
            yield Setup(name, plain, pipeline_of(reduced.but(**tables), progress)("wall"))


def impact_run(
    scene: Scene,
    standing: Setup,
    spheres: tuple[int, ...],
    options: RecordOptions = RecordOptions(),
) -> Observed:
    """The chain against one of the walls, for the scene's duration."""
    v0, duration = initial_velocity(scene), scene.time.duration
    return observed(standing, v0, duration=duration, spheres=spheres, options=options)
