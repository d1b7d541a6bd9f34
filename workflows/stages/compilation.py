"""The machine code of an impact, compiled by a brief one: while the assembly is computed where
there is one, and with a time of its own in any case."""

from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

import dem
from workflows.scene import Scene
from workflows.stages.chain import start
from workflows.stages.chain import wall as wall_of
from workflows.stages.impact import impact
from workflows.stages.pipeline import couples, needs_structure

BRIEF = {"duration": 20e-6, "horizon": 20e-6}  # [s] some steps


def compilation(scene: Scene) -> NDArray[np.float64]:
    """Times (k,) [s] of a brief impact, all of whose functions numba then keeps; none where it is
    not done."""
    brief = scene.but(time=BRIEF, output={"samples": 5})
    if couples(scene):
        return np.empty(0)
    if needs_structure(scene):
        # in place of the reduced model one of two modes with all that it has, and some material:
        # times to compile do not depend on it
        import rom
        from workflows.stages.wall import wall_of as reduced_wall

        K, M = 1e7 * np.array([[2.0, -1.0], [-1.0, 2.0]]), np.eye(2)
        reduced = rom.full_order(K, M, np.array([1.0, 0.0]))
        # a wall with a residual compliance calls other compiled functions than one without, and a
        # half-space gives it one; 1e-9 m/N is about that of the block's patch
        contact = reduced.contact._replace(half_space=1e-9)
        wall = reduced_wall(scene, reduced._replace(contact=contact))
        surface = dem.Flat(210e9, 0.3)
    else:
        wall, surface = wall_of(scene), None
    with suppress(ValueError):  # the run itself says what is wrong
        return impact(brief, start(scene, surface), wall).trajectory.t
    return np.empty(0)
