"""Walls of one structure struck at many points: modes in common, one oscillator each for the rest.

The same wall as `coupling.wall` makes of a reduced model, u_w = sum phi_j q_j + phi_r q_r + s F,
with omega_r^2 = first / second, phi_r^2 = first^2 / second and s minus the half-space's compliance.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from coupling.damping import Damping, damping_ratios
from coupling.wall import wall_from_reduced
from dem import Wall
from rom import Face, ManyContacts


def walls_of(
    contacts: ManyContacts, *, half_space: ArrayLike, damping: Damping | None = None
) -> Wall:
    """The walls of p contacts, as arrays (p, k + 1) of one Wall for `dem.Chains`.

    half_space (p,) [m/N] is taken out of the static compliances. Raises CouplingError.
    """
    moving = contacts.first > 0.0
    second = np.where(moving, contacts.second, 1.0)
    first = np.where(moving, contacts.first, 0.0)
    rest = np.sqrt(np.where(moving, first / second, contacts.omega.max(initial=1.0) ** 2))
    shared = np.broadcast_to(contacts.omega, contacts.phi.shape)
    omega = np.column_stack([shared, rest])
    phi = np.column_stack([contacts.phi, first / np.sqrt(second)])
    zeta = damping_ratios(damping, omega.ravel()).reshape(omega.shape)
    return Wall(omega, zeta, phi, -np.asarray(half_space, float), 0.0)


class Walls(NamedTuple):
    """Walls of one structure at p points."""

    face: Face
    to_hz: float
    half_space: NDArray[np.float64]  # (p,) [m/N]
    damping: Damping | None
    finer_hz: float  # of what stands for the full model

    def all(self, share: float = 1.0) -> Wall:
        """Of all points as arrays, with the modes below a share of the highest frequency."""
        contacts = self.face.contacts.below(share * self.to_hz)
        return walls_of(contacts, half_space=self.half_space, damping=self.damping)

    def finer(self, i: int) -> Wall:
        """Of one point, by a reduction of its own that stands for the full model."""
        own = self.face.finer(i, self.finer_hz)
        return wall_from_reduced(own, half_space=self.half_space[i], damping=self.damping)
