"""Walls of the same structure that are better in one respect: what a fit knows of its model's
errors.
"""

from collections.abc import Mapping
from contextlib import suppress

import numpy as np

from beadwave.workflows.fit.model_errors import BetterModel
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.engine.progress import Progress, quiet
from beadwave.workflows.stages.engine.stage_table import needs_structure

FAILURES = (InvalidScene, ValueError, ArithmeticError, np.linalg.LinAlgError)  # of one wall
# of the difference to another theory in the bars, at least, so that records made with any of the
# theories are met. At 0.5 two bars just hold the difference; 0.5 and 0.6 each left 6 % of 80
# numbers of records made with the usual theory farther off than two bars, at most by 2.5
LEAST_SHARE_OF_THEORY = 0.6


def better_walls(scene: Scene, progress: Progress = quiet) -> Mapping[str, list[BetterModel]]:
    """By cause: "reduction", "mesh", and "theory" of a beam or a plate, up to the first that cannot
    be computed; none where the scene builds no structure. The systems are walls."""
    walls: dict[str, list[BetterModel]] = {}
    if not needs_structure(scene):
        return walls
    of = pipeline_of(scene, progress)
    with suppress(*FAILURES):  # bars name the causes that they hold
        for cause in ("reduction", "mesh", *(("theory",) if scene.bending else ())):
            least = LEAST_SHARE_OF_THEORY if cause == "theory" else 0.0
            walls[cause] = [
                BetterModel(one.wall, max(one.share, least), one.poorer)
                for one in of(f"better-{cause}").walls
            ]
    return walls
