"""How large and how fine a plate must be for the bending waves of one contact.

It is so large that waves come back from its edges after the contact, and its elements and modes
resolve the shortest waves that the contact sends.
"""

from typing import NamedTuple

import numpy as np

from coupling.plate import Plate, group_speed, shear_speed, wavenumber

CARRIED = 3.0  # half periods in a contact of the waves that must not come back from an edge
RESOLVED = 6.0  # half periods in a contact of the finest waves: modes that move, elements
ELEMENTS = 4  # quadratic ones in a wavelength of those
MARGIN = 1.25  # of the plate's size
COARSEST_PATCH, COARSEST_SEED = 2e-3, 6e-3  # m


class Sizes(NamedTuple):
    """Of a plate's mesh [m], and the highest frequency [Hz] whose modes move one by one."""

    reach: float  # from the contact to the edges
    seed: float
    contact_seed: float
    patch: float
    cutoff_hz: float


def sizes(plate: Plate, rise: float, until: float) -> Sizes:
    """A mesh for the waves of a push that takes `rise` [s] on a half-space, so large that echoes
    come back after `until` [s].
    """
    carried = group_speed(plate, CARRIED * np.pi / rise)
    omega = RESOLVED * np.pi / rise
    bending = 2 * np.pi / wavenumber(plate, omega)
    shear = 2 * np.pi * shear_speed(plate) / omega
    return Sizes(
        reach=MARGIN * carried * until / 2,
        seed=min(bending, shear) / ELEMENTS,
        contact_seed=min(COARSEST_SEED, plate.thickness / 3),
        patch=min(COARSEST_PATCH, plate.thickness / 4),
        cutoff_hz=RESOLVED / (2 * rise),
    )


def refined(size: Sizes) -> Sizes:
    """Elements of half the size, everything else the same."""
    return size._replace(seed=size.seed / 2, contact_seed=size.contact_seed / 2)


def with_more_modes(size: Sizes) -> Sizes:
    """Modes up to twice the frequency: in a plate twice as many."""
    return size._replace(cutoff_hz=2 * size.cutoff_hz)


def widened(size: Sizes) -> Sizes:
    """Edges half as far away again."""
    return size._replace(reach=1.5 * size.reach)


def with_half_the_patch(size: Sizes) -> Sizes:
    """A patch of half the radius."""
    return size._replace(patch=size.patch / 2)
