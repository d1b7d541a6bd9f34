"""The receptance u_w / F at the contact: reduced models compared with solutions of the full one."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave import rom
from beadwave.coupling.damping import Damping, damping_ratios

BAND_HZ = (20.0, 20e3)
CHECKED_HZ = (400.0, 2200.0, 9000.0, 18e3)  # between modes, where a wrong model shows


class ContactResponse(NamedTuple):
    """Receptance at the contact, and of the full model where the reduced one is checked."""

    frequency_hz: NDArray[np.float64]  # (n,)
    reduced: NDArray[np.complex128]  # (n,) [m/N] with the run's damping
    finer: NDArray[np.complex128]  # (n,) [m/N] the same of the finer reduced model
    checked_hz: NDArray[np.float64]  # (k,)
    full: NDArray[np.float64]  # (k,) [m/N] of the full model, undamped
    reduced_checked: NDArray[np.float64]  # (k,) [m/N] undamped


def contact_response(
    reduction: rom.ReducedModel, full: NDArray[np.float64], law: Damping | None
) -> ContactResponse:
    """The reduced model's response over BAND_HZ with its damping, and undamped at CHECKED_HZ,
    where the full model's is `full` (k,) [m/N]. Without C there, so that both are real and a
    difference is that of the reduction alone. Raises CouplingError as of `damping_ratios`."""
    checked, f = np.array(CHECKED_HZ), np.geomspace(*BAND_HZ, 1200)
    undamped = rom.receptance(reduction._replace(C=None), None, checked).real
    reduced, finer = (
        rom.receptance(model, None, f, zeta=damping_ratios(law, rom.modal(model).omega))
        for model in (reduction, reduction.finer)
    )
    return ContactResponse(f, reduced, finer, checked, full, undamped)
