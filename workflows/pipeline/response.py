"""The frequency response at the contact, reduced model against direct solutions of the full one."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import fem
import rom
from workflows.files.run_folder import Picture
from workflows.results.plots import Line, Panel, panels
from workflows.scene import Scene

BAND_HZ = (20.0, 20e3)
CHECKED_HZ = (400.0, 2200.0, 9000.0, 18e3)  # between modes, where a wrong model shows
UNDAMPED = "without damping"


class Response(NamedTuple):
    """Receptance at the contact, and how far the reduced model is off where it was checked."""

    checked_hz: NDArray[np.float64]  # (k,)
    full: NDArray[np.float64]  # (k,) [m/N]
    reduced: NDArray[np.float64]  # (k,) [m/N]
    picture: Picture

    @property
    def error(self) -> float:
        """rms of the difference over the rms of the full response."""
        return float(np.linalg.norm(self.reduced - self.full) / np.linalg.norm(self.full))


def full_response(scene: Scene, model: fem.Model, contact: fem.ContactPatch) -> NDArray[np.float64]:
    """Undamped receptance (k,) [m/N] of the full model where the reduced one is checked."""
    return fem.receptance(model.K, model.M, contact.w, np.array(CHECKED_HZ)).real


def response(scene: Scene, full: NDArray[np.float64], reduction: rom.ReducedModel) -> Response:
    """Both responses, undamped."""
    checked, reduction = np.array(CHECKED_HZ), reduction._replace(C=None)
    reduced = rom.receptance(reduction, None, checked).real
    f = np.geomspace(*BAND_HZ, 2000)
    curve = rom.receptance(reduction, None, f).real
    lines = [
        Line("reduced model", f, np.abs(curve), "-"),
        Line("full model, direct solution", checked, np.abs(full), "s"),
    ]
    panel = Panel(UNDAMPED, "frequency [Hz]", "displacement per force [m/N]", lines, "xy")
    picture = Picture("frequency_response", panels([panel], size=(8, 4.2)))
    return Response(checked, full, reduced, picture)
