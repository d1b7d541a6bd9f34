"""Walls of the same structure that are better in one respect: what a fit knows of its model's
errors."""

from collections.abc import Mapping
from contextlib import suppress
from typing import NamedTuple

import numpy as np

import coupling
import dem
from workflows.scene import InvalidScene, Scene
from workflows.stages.errors import MARGIN as REDUCTION_SHARE
from workflows.stages.pipeline import needs_structure, pipeline_of
from workflows.stages.progress import Progress, quiet
from workflows.stages.walls import wall_of

# share of the difference to another theory in the bars, at least, so that records made with any of
# the theories are met. At 0.5 two bars just hold the difference; 0.5 and 0.6 each left 6 % of 80
# numbers of records made with the usual theory farther off than two bars, at most by 2.5
OTHER_THEORY = 0.6
FAILURES = (InvalidScene, ValueError, ArithmeticError, np.linalg.LinAlgError)  # of one wall


class BetterWall(NamedTuple):
    """A wall, and how much of its difference to a poorer one counts as the error of that."""

    wall: dem.Wall | coupling.CoupledWall
    share: float
    beside: dem.Wall | coupling.CoupledWall | None = None  # None is the wall of the fit


def better_walls(scene: Scene, progress: Progress = quiet) -> Mapping[str, list[BetterWall]]:
    """By cause: "reduction", "mesh", and "theory" of a beam or a plate, up to the first that cannot
    be computed; none where the scene builds no structure."""
    walls: dict[str, list[BetterWall]] = {}
    if not needs_structure(scene):
        return walls
    whole, of = scene.but(wall={"cutoff": None}), pipeline_of(scene, progress)
    with suppress(*FAILURES):  # bars name the causes that they hold
        reduced = of("reduction")
        walls["reduction"] = [BetterWall(wall_of(whole, reduced.finer), REDUCTION_SHARE)]
        if scene.bending is None:
            missed = of("missed-energy")
            on_mesh, without = (wall_of(whole, wall) for wall in missed.walls(reduced.contact))
            walls["mesh"] = [BetterWall(without, missed.share, on_mesh)]
        else:
            second = of("second-mesh")
            walls["mesh"] = [BetterWall(wall_of(scene, second.reduced), second.left)]
            walls["theory"] = [
                BetterWall(wall_of(scene, other.reduced), max(other.left, OTHER_THEORY))
                for other in of("other-theories")
            ]
    return walls
