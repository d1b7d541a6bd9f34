"""The frequency response at the contact, reduced model against solutions of the full one."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave import fem, rom
from beadwave.coupling.contact_response import CHECKED_HZ, ContactResponse, contact_response
from beadwave.workflows.files.run_folder import Picture
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.chain.damping import damping


class Response(NamedTuple):
    """The receptance at the contact and its picture."""

    found: ContactResponse
    picture: Picture


def full_response(
    scene: Scene,
    model: fem.Model,
    contact: fem.ContactPatch,
    factor: fem.Factor | None = None,
    space: rom.Space | None = None,
) -> NDArray[np.float64]:
    """Undamped receptance (k,) [m/N] of the full model at the frequencies where the reduced one is
    checked: by the Krylov space where its residual forces bound the error, else by a solution each
    (`fem.receptance`)."""
    basis = None if space is None else fem.Modes(*space.pairs)
    H = fem.receptance(
        model.K, model.M, contact.w, np.array(CHECKED_HZ), basis=basis, factor=factor
    )
    return H.real


def response(scene: Scene, full: NDArray[np.float64], reduction: rom.ReducedModel) -> Response:
    """The reduced model's response with the run's damping, and undamped where it is checked, beside
    that of the full model (k,) [m/N]."""
    # a run whose results are kept reads this module's results and draws nothing
    from beadwave.workflows.report.plots import Line, Panel, panels

    law = damping(scene.damping, reduction)
    curves = contact_response(reduction, full, law)
    lines = [
        Line("reduced model", curves.frequency_hz, np.abs(curves.reduced), "-"),
        Line("finer reduced model", curves.frequency_hz, np.abs(curves.finer), (0, (2, 3))),
        Line("full model, undamped", curves.checked_hz, np.abs(full), "s"),
    ]
    title = "undamped" if law is None and reduction.C is None else "with the damping of the run"
    panel = Panel(title, "frequency [Hz]", "receptance |u_w / F| [m/N]", lines, "xy")
    return Response(curves, Picture("frequency_response", panels([panel], size=(8, 4.2))))
