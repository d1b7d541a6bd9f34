"""The wall that a reduced model makes, of this scene's assembly or from a file."""

from importlib.util import find_spec
from pathlib import Path

import numpy as np

import coupling
import dem
import rom
from workflows.scene import Damping, InvalidScene, ModalDamping, RayleighDamping, Scene
from workflows.summary import HAMMER_TEST_HZ


def wall_of(scene: Scene, reduction: rom.ReducedModel | None) -> dem.Wall | coupling.CoupledWall:
    """Oscillators below the cutoff, one for the rest, the half-space taken out.

    A model that is read elsewhere than it is pushed makes a coupled wall.
    """
    reduced = loaded(Path(scene.wall.file)) if reduction is None else reduction
    if "reading_weights" in reduced.provenance:
        return coupling.coupled_wall(
            reduced,
            half_space=half_space(reduced),
            damping=damping(scene.damping, reduced),
            cutoff_hz=scene.wall.cutoff or np.inf,  # the thesis takes its matrices whole
            w_force=reduced.w,
            w_reading=_reading_weights(reduced),
        )
    return coupling.wall_from_reduced(
        reduced,
        half_space=half_space(reduced),
        damping=damping(scene.damping, reduced),
        cutoff_hz=scene.wall.cutoff,
    )


def _reading_weights(reduced: rom.ReducedModel) -> np.ndarray:
    """(r,) on the reduced coordinates; nothing but the boundary is read."""
    weights = np.zeros(len(reduced.w))
    noted = [float(w) for w in reduced.provenance["reading_weights"].split()]
    weights[: len(noted)] = noted
    return weights


def half_space(reduced: rom.ReducedModel) -> float:
    """What the Hertz law holds already [m/N], as the model's maker wrote it; 0 if unsaid."""
    return float(reduced.provenance.get("half_space_compliance_m_per_N", 0.0))


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


def loaded(path: Path) -> rom.ReducedModel:
    """A reduced model from .npz, .mat or .h5; raises InvalidScene where it is none."""
    load = {".npz": rom.load_npz, ".mat": rom.load_mat, ".h5": rom.load_h5}.get(path.suffix)
    if load is None:
        raise InvalidScene(f"wall.file = {str(path)!r} must end in .npz, .mat or .h5.")
    require_reader(path)
    try:
        return load(path)
    except rom.ReductionError as error:
        raise InvalidScene(f"wall.file: {error}") from None


def require_reader(path: Path) -> None:
    """Raises InvalidScene for HDF5 where the extra that reads and writes it is not installed."""
    if path.suffix == ".h5" and find_spec("h5py") is None:
        raise InvalidScene(f"{path} needs h5py; ./install.sh h5 adds it, or take .npz or .mat.")


def save(path: Path, reduced: rom.ReducedModel) -> None:
    """Write a reduced model in the format of the ending."""
    {".npz": rom.save_npz, ".mat": rom.save_mat, ".h5": rom.save_h5}[path.suffix](path, reduced)
