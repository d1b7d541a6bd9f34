"""What is saved of a run: its arrays over time, and the modes of the wall that they belong to."""

from pathlib import Path

import numpy as np

from coupling.coupled_wall import CoupledWall
from dem import Trajectory, Wall


def save_trajectory(path: Path, trajectory: Trajectory, wall: Wall | CoupledWall | None) -> None:
    """Write every array of a trajectory over its saved times, and the modes of the wall."""
    np.savez_compressed(path, **arrays(trajectory, wall))


def arrays(trajectory: Trajectory, wall: Wall | CoupledWall | None) -> dict[str, np.ndarray]:
    """What is saved of a run, by name."""
    return _over_time(trajectory) | _wall_modes(trajectory, wall)


def _over_time(trajectory: Trajectory) -> dict[str, np.ndarray]:
    """The arrays of a trajectory over its saved times, by name."""
    k = len(trajectory.t)
    named = trajectory._asdict().items()
    return {name: a for name, a in named if isinstance(a, np.ndarray) and len(a) == k and a.size}


def _wall_modes(trajectory: Trajectory, wall: Wall | CoupledWall | None) -> dict[str, np.ndarray]:
    """Frequencies and participations of the modes whose coordinates are saved."""
    if not trajectory.wall_q.size:
        return {}
    read = wall.reading if isinstance(wall, CoupledWall) else wall.phi
    return {"wall_omega": wall.omega, "wall_phi": read}
