"""The impact: checked before anything is computed, marched, and what it did to the contacts."""

from typing import NamedTuple

import numpy as np

import coupling
import dem
from workflows.scene import InvalidScene, RomWall, Scene
from workflows.stages.chain import Start, start, wall

PRUNED_AT = 1e-4  # error of the velocities where the scene gives a step instead
MOST_WORK = 1e10  # steps times spheres, minutes to an hour


def require_start(scene: Scene) -> None:
    """Raise InvalidScene where the chain has no state of rest, the step no meaning or the run no
    end; of walls that are yet to be reduced where they float under a steady force."""
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

    first, leant_on = start(scene), wall(scene)
    try:
        dem.require_march(first.chain, leant_on, first.velocity, dt=scene.time.dt)
        longest = dem.stability_limit(first.chain, leant_on, first.velocity)
    except (dem.InvalidChain, dem.NoEquilibrium, dem.UnstableStep) as error:
        raise InvalidScene(f"{scene.name}: {str(error).rstrip('.')}.") from None
    # steps as long as they may be
    steps, n = scene.time.duration / longest, scene.chain.count
    if steps * n > MOST_WORK:
        raise InvalidScene(
            f"{scene.name}: time.duration = {scene.time.duration:g} s takes more than {steps:.1e} "
            f"steps of {longest:.2g} s, allowed for {n} spheres are {MOST_WORK / n:.1e}; take less."
        )


def impact(
    scene: Scene, start: Start, wall: dem.Wall | coupling.CoupledWall | None
) -> coupling.Impact:
    """The coupled run to the error asked for, or at the step given."""
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


class PrunedWall(NamedTuple):
    """A wall of fewer modes, and what it lacks in sentences."""

    wall: dem.Wall
    sentences: tuple[str, ...]


def pruning(scene: Scene, start: Start, whole_wall: dem.Wall) -> PrunedWall:
    """The wall without the modes that do not matter at the error asked for."""
    if isinstance(whole_wall, coupling.CoupledWall):
        raise ValueError("wall.prune needs a wall that is read where it is pushed; drop the key.")
    time = scene.time
    error = PRUNED_AT if time.error is None else time.error
    pruned = coupling.prune(
        start.chain, whole_wall, start.velocity, duration=time.duration, error=error
    )
    return PrunedWall(pruned.wall, pruned.sentences)


def pruned_wall(scene: Scene, pruning: PrunedWall) -> dem.Wall:
    """The wall without those modes."""
    return pruning.wall
