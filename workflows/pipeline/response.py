"""The frequency response at the contact, reduced model against solutions of the full one."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import coupling
import fem
import rom
from workflows.files.run_folder import Picture
from workflows.pipeline.wall import damping
from workflows.results.plots import Line, Panel, panels
from workflows.scene import Scene

BAND_HZ = (20.0, 20e3)
CHECKED_HZ = (400.0, 2200.0, 9000.0, 18e3)  # between modes, where a wrong model shows
N_FREQUENCIES = 1200


class Response(NamedTuple):
    """Receptance at the contact, and how far the reduced model is off where it was checked."""

    frequency_hz: NDArray[np.float64]  # (n,)
    reduced: NDArray[np.complex128]  # (n,) [m/N] with the run's damping
    finer: NDArray[np.complex128]  # (n,) [m/N] the same of the finer reduced model
    checked_hz: NDArray[np.float64]  # (k,)
    full: NDArray[np.float64]  # (k,) [m/N] of the full model, undamped
    reduced_checked: NDArray[np.float64]  # (k,) [m/N] undamped
    picture: Picture

    @property
    def error(self) -> float:
        """rms of the undamped difference over the rms of the full response."""
        off = self.reduced_checked - self.full
        return float(np.linalg.norm(off) / np.linalg.norm(self.full))


def full_response(scene: Scene, model: fem.Model, contact: fem.ContactPatch) -> NDArray[np.float64]:
    """Undamped receptance (k,) [m/N] of the full model where the reduced one is checked."""
    return fem.receptance(model.K, model.M, contact.w, np.array(CHECKED_HZ)).real


def response(scene: Scene, full: NDArray[np.float64], reduction: rom.ReducedModel) -> Response:
    """The reduced model's response with the run's damping, and undamped where it is checked."""
    checked, f = np.array(CHECKED_HZ), np.geomspace(*BAND_HZ, N_FREQUENCIES)
    undamped = rom.receptance(reduction._replace(C=None), None, checked).real
    law = damping(scene.damping, reduction)
    curve, finer = (_damped(one, law, f) for one in (reduction, reduction.finer))
    lines = [
        Line("reduced model", f, np.abs(curve), "-"),
        Line("finer reduced model", f, np.abs(finer), (0, (2, 3))),
        Line("full model, undamped", checked, np.abs(full), "s"),
    ]
    title = "undamped" if law is None and reduction.C is None else "with the damping of the run"
    panel = Panel(title, "frequency [Hz]", "receptance |u_w / F| [m/N]", lines, "xy")
    picture = Picture("frequency_response", panels([panel], size=(8, 4.2)))
    return Response(f, curve, finer, checked, full, undamped, picture)


def _damped(
    reduced: rom.ReducedModel, law: coupling.Damping | None, f: NDArray[np.float64]
) -> NDArray[np.complex128]:
    zeta = coupling.damping_ratios(law, rom.modal(reduced).omega)
    return rom.receptance(reduced, None, f, zeta=zeta)


def save_response(path: Path, found: Response) -> None:
    """Write the arrays of a response."""
    arrays = {key: value for key, value in found._asdict().items() if key != "picture"}
    np.savez_compressed(path, **arrays)
