"""The impact: checked before anything is computed, marched, and what it did to the contacts."""

from typing import NamedTuple

import numpy as np

import coupling
import dem
from workflows.scene import InvalidScene, RomWall, Scene
from workflows.stages.chain import Start, start, wall

PRUNED_AT = 1e-4  # error of the velocities where the scene gives a step instead
MOST_WORK = 1e10  # steps of spheres, minutes to an hour


def require_start(scene: Scene) -> None:
    """Raise InvalidScene where the chain has no state of rest, the step no meaning or the run no
    end; of walls that are yet to be reduced where they float under a steady force."""
    if isinstance(scene.wall, RomWall):
        _require_support(scene)
        return
    begun, leant_on = start(scene), wall(scene)
    try:
        dem.require_march(begun.chain, leant_on, begun.velocity, dt=scene.time.dt)
        _require_end(scene, dem.stability_limit(begun.chain, leant_on, begun.velocity))
    except (dem.InvalidChain, dem.NoEquilibrium, dem.UnstableStep) as error:
        raise InvalidScene(f"{scene.name}: {str(error).rstrip('.')}.") from None


def _require_support(scene: Scene) -> None:
    springs, preload = scene.leaf_springs, scene.preload
    pressing = {
        "preload.force": preload.force if preload else 0.0,
        "leaf_springs.offset": springs.offset if springs and np.max(springs.stiffness) else 0.0,
    }
    for key, value in pressing.items():
        if scene.wall.file is None and scene.floats and np.max(value) > 0:
            raise InvalidScene(
                f"{scene.name}: {key} = {value} acts on an assembly without supports; set it "
                "to 0, or hold the assembly."
            )


def _require_end(scene: Scene, longest: float) -> None:
    """The same where steps as long [s] as they may be make more work than days hold."""
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
    found = coupling.impact(start.chain, wall, start.velocity, **run, **wanted)
    if not coupled:
        return found
    estimated = coupling.with_coupled_error(
        start.chain, wall, start.velocity, found.trajectory, error=time.error
    )
    return found._replace(trajectory=estimated)


class PrunedWall(NamedTuple):
    """A wall of fewer modes, and what was left out in sentences."""

    wall: dem.Wall
    sentences: tuple[str, ...]


def pruning(scene: Scene, start: Start, whole_wall: dem.Wall) -> PrunedWall:
    """The wall without the modes that do not matter at the error asked for."""
    if isinstance(whole_wall, coupling.CoupledWall):
        raise ValueError("wall.prune needs a wall that is read where it is pushed; drop the key.")
    time = scene.time
    error = PRUNED_AT if time.error is None else time.error
    found = coupling.prune(
        start.chain, whole_wall, start.velocity, duration=time.duration, error=error
    )
    return PrunedWall(found.wall, found.sentences)


def pruned_wall(scene: Scene, pruning: PrunedWall) -> dem.Wall:
    """What is left of the wall."""
    return pruning.wall
