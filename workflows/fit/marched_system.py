"""The system that a fit marches: a chain, its wall and the impact."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from beadwave.dem import Chain, Wall
from beadwave.dem.sensitivities import STEPS_PER_TIME_SCALE, usual_step

if TYPE_CHECKING:
    from beadwave.coupling.continuation import SteadyState
    from beadwave.coupling.spatial_march import ShakerForces
    from beadwave.coupling.spatial_wall import SpatialWall
    from beadwave.dem.lateral import LastSphere


class RubbingSurface(NamedTuple):
    """The surface that the last sphere rubs on, and its shakers."""

    wall: SpatialWall
    last: LastSphere | None  # None until a chain stands before it
    shakers: ShakerForces | None
    upstream_held: bool
    substeps: int = 1  # of a step
    near: SteadyState | None = None  # periodic state of the scene's own values


class Rig(NamedTuple):
    """The marched system: chain, wall and impact."""

    chain: Chain
    wall: Wall | None
    v0: np.ndarray  # (n,) [m/s] before the impact
    damping: np.ndarray | None = None  # (d, k) derivative of the wall's zeta by each damping ratio
    trigger: float = 0.0  # [s] first touch on the record's clock
    across: RubbingSurface | None = None  # a last sphere with friction on a structure

    @property
    def step(self) -> float:
        """Usual step of time of a march [s]."""
        return usual_step(self.chain, self.wall, self.v0)

    @property
    def time_scale(self) -> float:
        """Time within which the stiffest contact moves [s]."""
        return STEPS_PER_TIME_SCALE * self.step
