"""The wall that a reduced model makes, of this scene's assembly or from a file."""

from pathlib import Path

import numpy as np

import coupling
import dem
import rom
from coupling.wall import coupled_wall, wall_from_reduced
from workflows.scene import Damping, ModalDamping, RayleighDamping, Scene
from workflows.summary import HAMMER_TEST_HZ
from workflows.wall_file import HALF_SPACE, loaded


def wall_of(scene: Scene, reduction: rom.ReducedModel | None) -> dem.Wall | coupling.CoupledWall:
    """Oscillators below the cutoff, one for the rest, the half-space taken out.

    A model that is read elsewhere than it is pushed makes a coupled wall, and so does one whose
    damping couples its modes.
    """
    reduced = loaded(scene.wall) if reduction is None else reduction
    if "reading_weights" in reduced.provenance:
        return coupled_wall(
            reduced,
            half_space=half_space(reduced),
            damping=damping(scene.damping, reduced),
            cutoff_hz=scene.wall.cutoff or np.inf,  # the thesis takes its matrices whole
            w_force=reduced.w,
            w_reading=_reading_weights(reduced),
        )
    make = coupled_wall if _coupled(reduced) else wall_from_reduced
    return make(
        reduced,
        half_space=half_space(reduced),
        damping=damping(scene.damping, reduced),
        cutoff_hz=scene.wall.cutoff,
    )


def _coupled(reduced: rom.ReducedModel) -> bool:
    """Whether C couples the modes, so that no ratios stand for it."""
    if reduced.C is None or not np.any(reduced.C):
        return False
    return coupling.modal_coupling(rom.modal(reduced).damping) > coupling.UNCOUPLED


def _reading_weights(reduced: rom.ReducedModel) -> np.ndarray:
    """(r,) on the reduced coordinates; nothing but the boundary is read."""
    weights = np.zeros(len(reduced.w))
    noted = [float(w) for w in reduced.provenance["reading_weights"].split()]
    weights[: len(noted)] = noted
    return weights


def half_space(reduced: rom.ReducedModel) -> float:
    """What the Hertz law holds already [m/N], as the model's maker wrote it; 0 if unsaid."""
    return float(reduced.provenance.get(HALF_SPACE, 0.0))


def damping(table: Damping, reduced: rom.ReducedModel) -> coupling.Damping | None:
    """The scene's damping; ratios of the hammer-test modes go to the modes nearest to them."""
    return damping_law(table, _hammer_modes_hz(reduced))


def damping_law(table: Damping, hammer_modes_hz: list[float]) -> coupling.Damping | None:
    """The same for hammer-test modes at these frequencies [Hz]."""
    match table:
        case RayleighDamping(frequency=(f1, f2), ratio=(zeta1, zeta2)):
            return coupling.rayleigh(f1, zeta1, f2, zeta2)
        case RayleighDamping(alpha=alpha, beta=beta):
            return coupling.RayleighDamping(alpha, beta)
        case ModalDamping(ratio=float(ratio)):
            return coupling.ModalDamping(ratio)
        case ModalDamping(ratio=ratio):
            return coupling.ModalDamping(ratio, hammer_modes_hz, "nearest")
    return None


def _hammer_modes_hz(reduced: rom.ReducedModel) -> list[float]:
    noted = reduced.provenance.get("hammer_modes_hz")
    return [float(hz) for hz in noted.split()] if noted else list(HAMMER_TEST_HZ)


def save(path: Path, reduced: rom.ReducedModel) -> None:
    """Write a reduced model in the format of the ending."""
    {".npz": rom.save_npz, ".mat": rom.save_mat, ".h5": rom.save_h5}[path.suffix](path, reduced)
