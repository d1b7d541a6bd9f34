"""The systems that a fit marches: a chain, its wall and the impact, or several chains."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from beadwave.dem import Chain, Wall, space
from beadwave.dem.sensitivities import STEPS_PER_TIME_SCALE, usual_step

if TYPE_CHECKING:
    from beadwave.coupling.continuation import SteadyState
    from beadwave.coupling.spatial_wall import SpatialWall
    from beadwave.dem.lateral import LastSphere
    from beadwave.dem.shakers import ShakerForces


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


class ChainsRun(NamedTuple):
    """A march of several chains, each as a run of its own at the times t (k,) [s]."""

    t: np.ndarray
    rows: tuple[space.RowRun, ...]


class ChainsRig(NamedTuple):
    """The marched system of several chains: each alone, all together, and what they strike."""

    chains: tuple[tuple[Chain, np.ndarray], ...]  # each with its velocities (n,) [m/s]
    rows: space.Rows
    structure: space.Structure

    @property
    def step(self) -> float:
        """Shortest of the usual steps of time [s] of each chain alone."""
        omega, zeta, phi = self.structure.omega, self.structure.zeta, self.structure.phi
        return min(
            usual_step(chain, Wall(omega, zeta, phi[i]), v0)
            for i, (chain, v0) in enumerate(self.chains)
        )

    @property
    def time_scale(self) -> float:
        """Time within which the stiffest contact moves [s]."""
        return STEPS_PER_TIME_SCALE * self.step

    def march(self, duration: float, dt: float) -> ChainsRun:
        """A run of whole steps of dt [s], the last of which may end after the duration [s]; saved
        at each."""
        n = int(np.ceil(duration / dt))
        run = space.march(
            self.rows.packing, self.structure, self.rows.velocity,
            duration=n * dt, dt=dt, n_save=n,
        )  # fmt: skip
        return ChainsRun(run.t, space.row_runs(self.rows, self.structure, run))
