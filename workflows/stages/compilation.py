"""The machine code of an impact, compiled by a brief one: while the assembly is computed where
there is one, and with a time of its own in any case."""

from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

import dem
from workflows.scene import Scene
from workflows.stages.chain import start
from workflows.stages.chain import wall as wall_of
from workflows.stages.impact import impact
from workflows.stages.pipeline import couples, needs_structure

HALF_SPACE = 1e-9  # [m/N] of the block's patch, some
BRIEF = {"duration": 20e-6, "horizon": 20e-6}  # [s] some steps


def compilation(scene: Scene) -> NDArray[np.float64]:
    """Times (k,) [s] of a brief impact, all of whose functions numba then keeps; none where it is
    not done."""
    brief = scene.but(time=BRIEF, output={"samples": 5})
    if couples(scene):
        return np.empty(0)
    wall = _stand_in(scene) if needs_structure(scene) else wall_of(scene)
    with suppress(ValueError):  # the run itself says what is wrong
        return impact(brief, start(scene, _face(scene)), wall).trajectory.t
    return np.empty(0)


def _face(scene: Scene) -> Any:
    """Of the assembly, some material: times to compile do not depend on it."""
    return dem.Flat(210e9, 0.3) if needs_structure(scene) else None


def _stand_in(scene: Scene) -> dem.Wall:
    """A wall of two modes with all that a reduced one has."""
    import rom
    from workflows.stages.wall import wall_of as reduced_wall

    K, M = 1e7 * np.array([[2.0, -1.0], [-1.0, 2.0]]), np.eye(2)
    whole = rom.full_order(K, M, np.array([1.0, 0.0]))
    # without a half-space there is no residual, and functions without one are others
    stand_in = whole._replace(contact=whole.contact._replace(half_space=HALF_SPACE))
    return reduced_wall(scene, stand_in)
