"""The compilation of an impact's kernels, by a brief impact of the same kind.

It is a stage so that it runs in the second process while an assembly is computed, and so that its
time is listed apart from the march's.
"""

from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from beadwave import dem
from beadwave.workflows.scene import LossFactorsTable, ModalDampingTable, Scene
from beadwave.workflows.stages.chain.chain import start
from beadwave.workflows.stages.chain.impact import impact
from beadwave.workflows.stages.chain.walls import wall_of
from beadwave.workflows.stages.engine.pipeline import couples
from beadwave.workflows.stages.engine.stage_table import needs_structure

BRIEF = {"duration": 20e-6, "horizon": 20e-6}  # [s] a few steps


def compilation(scene: Scene) -> NDArray[np.float64]:
    """Compiles the kernels that the scene's impact needs; returns the times (k,) [s] of the brief
    impact, empty where there was none."""
    brief = scene.but(time=BRIEF, output={"samples": 5})

    # numba compiles for the types of arguments: the brief impact must have the run's wall, law and
    # damping, not its values. A CoupledWall is marched by an integrator of its own
    if couples(scene):
        return np.empty(0)
    if needs_structure(scene):
        # a model of two modes with the same fields as the reduced one calls the same kernels
        from beadwave import rom

        K, M = 1e7 * np.array([[2.0, -1.0], [-1.0, 2.0]]), np.eye(2)
        reduced = rom.full_order(K, M, np.array([1.0, 0.0]))
        # walls with and without residual compliance call different kernels; the half-space makes
        # this one have it, 1e-9 m/N is about that of the rig's patch
        contact = reduced.contact._replace(half_space=1e-9)
        if isinstance(scene.damping, LossFactorsTable):  # of parts, which these two modes have not
            scene = scene.but(damping=ModalDampingTable(kind="modal", ratio=0.01))
        wall = wall_of(scene, reduced._replace(contact=contact))
        surface = dem.Flat(210e9, 0.3)
    else:
        wall, surface = wall_of(scene), None
    with suppress(ValueError):  # the run itself says what is wrong
        return impact(brief, start(scene, surface), wall).trajectory.t
    return np.empty(0)
