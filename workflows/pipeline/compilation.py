"""The machine code of an impact on the assembly, compiled while the assembly is computed."""

import numpy as np

import rom
from workflows.pipeline.chain import start
from workflows.pipeline.impact import impact
from workflows.pipeline.wall import wall_of
from workflows.scene import Scene

HALF_SPACE = 1e-9  # [m/N] of the block's patch, some
BRIEF = {"duration": 20e-6, "horizon": 20e-6}  # [s] some steps


def compilation(scene: Scene) -> int:
    """Steps of a brief impact on a wall of two modes, all of whose functions numba then keeps."""
    K, M = 1e7 * np.array([[2.0, -1.0], [-1.0, 2.0]]), np.eye(2)
    whole = rom.full_order(K, M, np.array([1.0, 0.0]))
    # without a half-space there is no residual, and functions without one are others
    stand_in = whole._replace(contact=whole.contact._replace(half_space=HALF_SPACE))
    brief = {
        "time": scene.time.model_copy(update=BRIEF),
        "output": scene.output.model_copy(update={"samples": 5}),
    }
    wall = wall_of(scene, stand_in)
    return impact(scene.model_copy(update=brief), start(scene), wall).trajectory.n_steps
