"""Walls of one structure struck at many points: modes in common, oscillators of each for the rest.

The same wall as `coupling.reduced_wall` makes of a reduced model, u_w = sum phi_j q_j + s F, where
the oscillators beyond the common modes are those of `rom.ManyContacts`, and s is minus the
half-space's compliance.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from beadwave.coupling.damping import Damping, damping_ratios
from beadwave.dem import Wall
from beadwave.rom import ManyContacts


def walls_of(
    contacts: ManyContacts,
    n_beyond: int,
    *,
    half_space: ArrayLike,
    damping: Damping | None = None,
    lumped_above_hz: float = np.inf,
) -> Wall:
    """The walls of p contacts, as arrays (p, k + n_beyond) of one Wall for `dem.Chains`.

    half_space (p,) [m/N] is taken out of the static compliances. Of the oscillators beyond the
    common modes those above lumped_above_hz [Hz] are one. Raises CouplingError for damping ratios
    that are missing or negative.
    """
    beyond = contacts.beyond(n_beyond).lumped(lumped_above_hz)
    shared = np.broadcast_to(contacts.omega, contacts.phi.shape)
    omega = np.column_stack([shared, beyond.omega])
    phi = np.column_stack([contacts.phi, beyond.phi])
    zeta = damping_ratios(damping, omega.ravel()).reshape(omega.shape)
    return Wall(omega, zeta, phi, -np.asarray(half_space, float), 0.0)


class Walls(NamedTuple):
    """Walls of one structure at p points."""

    contacts: ManyContacts
    half_space: NDArray[np.float64]  # (p,) [m/N]
    damping: Damping | None

    def all(self, n_beyond: int, lumped_above_hz: float = np.inf) -> Wall:
        """The walls of all points as arrays of one Wall, each with n_beyond oscillators beyond the
        common modes, of which those above lumped_above_hz [Hz] are one."""
        contacts, half_space, damping = self
        return walls_of(
            contacts, n_beyond, half_space=half_space, damping=damping,
            lumped_above_hz=lumped_above_hz,
        )  # fmt: skip
