"""The arrays that are saved of a run: those over time, and the wall modes they belong to."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from beadwave.coupling.coupled_wall import CoupledWall
from beadwave.dem import Trajectory, Wall

if TYPE_CHECKING:  # a run without friction loads no motion across
    from beadwave.dem.lateral import LateralTrajectory


def arrays(
    trajectory: Trajectory,
    wall: Wall | CoupledWall | None,
    lateral: LateralTrajectory | None = None,
) -> dict[str, np.ndarray]:
    """Saved arrays of a run, by name: each (k, ...) over the k saved times, with the units of
    `dem.Trajectory` and `dem.lateral.LateralTrajectory`; wall_omega (n_modes,) [rad/s] and wall_phi
    (n_modes,) [kg^-1/2] of the modes whose coordinates are among them; arrays of the cycle before
    the striker as cycle_*. energy_total is that of both motions, along the chain and across it.
    error_x, error_v (n,), error_contact_force (c,): errors of these arrays by the time step, the
    largest over time, where they are known."""
    k = len(trajectory.t)
    fields = trajectory._asdict().items()
    saved = {name: a for name, a in fields if isinstance(a, np.ndarray) and len(a) == k and a.size}
    if trajectory.errors is not None:
        errors = trajectory.errors._asdict().items()
        saved |= {f"error_{name}": values for name, values in errors}
    if lateral is not None:
        saved |= {name: a for name, a in lateral._asdict().items() if isinstance(a, np.ndarray)}
        if lateral.cycle is not None:
            fields = lateral.cycle._asdict().items()
            saved |= {f"cycle_{name}": a for name, a in fields if isinstance(a, np.ndarray)}
        saved["energy_total"] = trajectory.energy_total + lateral.energy
    if trajectory.wall_q.size:
        reading = wall.reading if isinstance(wall, CoupledWall) else wall.phi
        saved |= {"wall_omega": wall.omega, "wall_phi": reading}
    return saved
