"""The wall that a reduced model makes, of this scene's assembly or from a file."""

from collections.abc import Sequence
from pathlib import Path

import coupling
import dem
import rom
from coupling import wall as reduced_walls
from workflows.files.wall import measured
from workflows.scene import Damping, ModalDampingTable, RayleighDampingTable, Scene
from workflows.thesis import HAMMER_TEST_HZ


def wall_of(scene: Scene, reduction: rom.ReducedModel | None) -> dem.Wall | coupling.CoupledWall:
    """The wall with the damping and up to the cutoff of the scene."""
    reduced, modes = reduction, None
    if reduction is None:
        reduced, health = measured(scene.wall)
        modes = health.modes
    law, cutoff = damping(scene.damping, reduced), scene.wall.cutoff
    return reduced_walls.wall_of(reduced, damping=law, cutoff_hz=cutoff, modes=modes)


def damping(table: Damping, reduced: rom.ReducedModel) -> coupling.Damping | None:
    """The scene's damping; ratios of the hammer-test modes go to the modes nearest to them."""
    return damping_law(table, reduced.contact.modes_hz or HAMMER_TEST_HZ)


def damping_law(table: Damping, hammer_modes_hz: Sequence[float]) -> coupling.Damping | None:
    """The same for hammer-test modes at these frequencies [Hz]."""
    match table:
        case RayleighDampingTable(frequency=(f1, f2), ratio=(zeta1, zeta2)):
            return coupling.rayleigh(f1, zeta1, f2, zeta2)
        case RayleighDampingTable(alpha=alpha, beta=beta):
            return coupling.RayleighDamping(alpha, beta)
        case ModalDampingTable(ratio=float(ratio)):
            return coupling.ModalDamping(ratio)
        case ModalDampingTable(ratio=ratio):
            return coupling.ModalDamping(ratio, hammer_modes_hz, "nearest")
    return None


def save(path: Path, reduced: rom.ReducedModel, table: Damping) -> None:
    """Write a reduced model in the format of the ending, with what the scene's damping adds."""
    write = {".npz": rom.save_npz, ".mat": rom.save_mat, ".h5": rom.save_h5}[path.suffix]
    write(path, reduced, C_damping=reduced_walls.damping_matrix(reduced, damping(table, reduced)))
