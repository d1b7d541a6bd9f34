"""The impact as a stage: the check that it can be run, and the coupled march."""

import numpy as np

from beadwave import coupling, dem
from beadwave.workflows.scene import InvalidScene, RomWall, Scene
from beadwave.workflows.stages.chain.chain import Start, start
from beadwave.workflows.stages.chain.walls import wall_of

MOST_WORK = 1e10  # steps times spheres, minutes to an hour


def require_start(scene: Scene) -> None:
    """Raise InvalidScene for a chain without a state of rest, an unstable step, and a run of too
    many steps; for a reduced wall, which is not there yet, where a steady force presses an assembly
    without supports."""
    if isinstance(scene.wall, RomWall):
        springs, preload = scene.leaf_springs, scene.preload
        offset = springs.offset if springs and np.max(springs.stiffness) else 0.0
        pressing = {
            "preload.force": preload.force if preload else 0.0,
            "leaf_springs.offset": offset,
        }
        for key, value in pressing.items():
            if scene.wall.file is None and scene.floats and np.max(value) > 0:
                raise InvalidScene(
                    f"{scene.name}: {key} = {value} acts on an assembly without supports; set it "
                    "to 0, or hold the assembly."
                )
        return

    first, leant_on = start(scene), wall_of(scene)
    try:
        dem.require_march(first.chain, leant_on, first.velocity, dt=scene.time.dt)
        longest = dem.stability_limit(first.chain, leant_on, first.velocity)
    except (dem.InvalidChain, dem.NoEquilibrium, dem.UnstableStep) as error:
        raise InvalidScene(f"{scene.name}: {str(error).rstrip('.')}.") from None
    # fewest steps, each at the limit of stability
    steps, n = scene.time.duration / longest, scene.chain.count
    if steps * n > MOST_WORK:
        raise InvalidScene(
            f"{scene.name}: time.duration = {scene.time.duration:g} s takes more than {steps:.1e} "
            f"steps of {longest:.2g} s, allowed for {n} spheres are {MOST_WORK / n:.1e}; take less."
        )


def impact(
    scene: Scene, start: Start, wall: dem.Wall | coupling.CoupledWall | None
) -> coupling.Impact:
    """The coupled run, to the scene's error or at its step. The error of a run at a CoupledWall,
    which is not read where it is pushed, is estimated by a second march. Raises dem.InvalidChain,
    dem.NoEquilibrium and dem.UnstableStep, which name what cannot be marched."""
    time, coupled = scene.time, isinstance(wall, coupling.CoupledWall)
    wanted = {"dt": time.dt} if time.dt is not None else {"error": time.error}
    if time.dt is None and not coupled:
        wanted["observed"] = [sphere - 1 for sphere in scene.output.spheres] or None
        wanted["horizon"] = time.horizon
    run = {"duration": time.duration, "n_save": scene.output.samples - 1}
    result = coupling.impact(start.chain, wall, start.velocity, **run, **wanted)
    if not coupled:
        return result
    estimated = coupling.with_coupled_error(
        start.chain, wall, start.velocity, result.trajectory, error=time.error
    )
    return result._replace(trajectory=estimated)
