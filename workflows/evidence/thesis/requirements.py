"""Parts that a scene must have for a study, and values that studies take from it."""

import numpy as np

from beadwave import dem
from beadwave.workflows.evidence.thesis.observed_run import Observed
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.scene.parts import with_chain

FEWEST = 5  # spheres that make a wave
SPHERES = (1, 4, 14)  # observed unless the scene says otherwise


def bare(scene: Scene, flat: dem.Flat | None = None) -> dem.Chain:
    """The scene's spheres alone against a flat, of their own material unless another is given."""
    row = scene.chain
    flat = flat or dem.Flat(last(row.young), last(row.poisson))
    return dem.row_of_spheres(
        row.radius, row.density, row.young, row.poisson, count=row.count, flat=flat
    )


def last(value: float | tuple[float, ...]) -> float:
    """The last sphere's value of a key that has one value for all, or one each."""
    return float(np.atleast_1d(value)[-1])


def require_chain(scene: Scene, fewest: int = SPHERES[-1] + 1) -> tuple[int, ...]:
    """The spheres to observe; raises InvalidScene unless the scene has a chain that long."""
    if with_chain(scene).chain.count < fewest:
        raise InvalidScene(
            f"chain.count = {scene.chain.count} is too short for this study; take at least "
            f"{fewest} spheres."
        )
    return scene.output.spheres or SPHERES


def require_rig(scene: Scene) -> None:
    """Raise InvalidScene unless a chain strikes an assembly."""
    if scene.assembly is None or scene.chain is None:
        raise InvalidScene(f"the scene {scene.name} has no chain before an assembly; take rig-rom.")


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
