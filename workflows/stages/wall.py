"""The reduced wall of a scene, of its assembly or from a file, with its damping."""

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
    """The wall of a reduced model, or of `wall.file` where that is None, with the scene's damping
    and its modes up to the scene's cutoff [Hz]."""
    reduced, modes = reduction, None
    if reduction is None:
        reduced, health = measured(scene.wall)
        modes = health.modes
    law, cutoff = damping(scene.damping, reduced), scene.wall.cutoff
    return reduced_walls.wall_of(reduced, damping=law, cutoff_hz=cutoff, modes=modes)


def damping(table: Damping, reduced: rom.ReducedModel) -> coupling.Damping | None:
    """Damping law of a scene's table; ratios measured in the hammer test apply to the computed
    modes that are paired with it, else to those nearest to the thesis' frequencies."""
    return damping_law(table, reduced.contact.modes_hz or HAMMER_TEST_HZ)


def damping_law(table: Damping, hammer_modes_hz: Sequence[float]) -> coupling.Damping | None:
    """Damping law of a scene's table for hammer-test modes at these frequencies [Hz]; None for no
    damping."""
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
    """Write a reduced model as .npz, .mat or .h5, by the ending, with the matrix of the scene's
    damping."""
    write = {".npz": rom.save_npz, ".mat": rom.save_mat, ".h5": rom.save_h5}[path.suffix]
    write(path, reduced, C_damping=reduced_walls.damping_matrix(reduced, damping(table, reduced)))
