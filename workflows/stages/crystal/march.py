"""The march of a crystal as a stage."""

import numpy as np

from beadwave.dem import space
from beadwave.dem.space.march import MOST_WORK, first_step, work
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.stages.crystal.packing import CrystalStart, start, wall


def require_crystal(scene: Scene) -> None:
    """Raise InvalidScene for a crystal that cannot be, one with spheres to observe that it has not,
    and a run of too many steps."""
    first = start(scene)
    for sphere in scene.output.spheres:
        if sphere not in first.number:
            raise InvalidScene(
                f"{scene.name}: output.spheres has {sphere}, which is no sphere of the crystal; "
                "change it."
            )
    packing = first.packing
    time = scene.time
    step = time.dt or first_step(packing, first.velocity, time.duration)
    least = work(packing, time.duration, step)
    if least > MOST_WORK:
        raise InvalidScene(
            f"{scene.name}: time.duration = {time.duration:g} s takes {least:.1e} contacts "
            f"computed at least, allowed are {MOST_WORK:.0e}; take less, or fewer spheres."
        )


def march(
    scene: Scene, start: CrystalStart, structure: space.Structure | None = None
) -> space.SpaceTrajectory:
    """The march to the scene's error or at its step, before a structure where there is one; raises
    dem.InvalidChain and dem.UnstableStep, which name what cannot be marched."""
    time, observed = scene.time, scene.output.spheres
    saved = np.flatnonzero(np.isin(start.number, observed)) if observed else None
    run = {"duration": time.duration, "n_save": scene.output.samples - 1, "saved": saved}
    if structure is not None:
        from beadwave.workflows.stages.crystal.structure import require_unique  # loads fem

        require_unique(scene, start, structure)
    arguments = (start.packing, wall(scene) if structure is None else structure, start.velocity)
    if time.dt is not None:
        return space.march(*arguments, dt=time.dt, **run)
    return space.march_to_error(*arguments, error=time.error, **run)
