"""How large and how fine a plate must be for the bending waves of one contact.

It is so large that waves come back from its edges after the contact, and its elements and modes
resolve the shortest waves that the contact sends.
"""

from typing import NamedTuple

import numpy as np

from coupling.plate import Plate, group_speed, shear_speed, wavenumber


class PlateSizeRules(NamedTuple):
    """Rules for size and mesh of a plate; the effects named are those that the study wall-thickness
    prints for D/t = 4, where ARR is 0.316."""

    # waves of so many half periods in a contact must not come back from an edge; the plate is
    # `margin` times as wide as these need. A plate 1.5 times as wide changes the ARR by 1.5e-5
    carried: float = 3.0
    margin: float = 1.25
    # half periods in a contact of the finest waves, and quadratic elements in a wavelength of
    # them: modes up to twice the frequency change ARR by 3.6e-5, halved elements by 5.7e-4
    resolved: float = 6.0
    elements: int = 4
    # [m] radius of the patch, a quarter of a thinner plate: halved, ARR changes by 1.7e-4
    coarsest_patch: float = 2e-3
    coarsest_seed: float = 6e-3  # [m] elements at the contact, a third of a thinner plate


class PlateSizes(NamedTuple):
    """Of a plate's mesh [m], and the highest frequency [Hz] whose modes move one by one."""

    reach: float  # from the contact to the edges
    seed: float
    contact_seed: float
    patch: float
    cutoff_hz: float

    def scaled(self, **factors: float) -> "PlateSizes":
        """Sizes times factors by name, the others as they are."""
        return self._replace(
            **{name: factor * getattr(self, name) for name, factor in factors.items()}
        )


def sizes(
    plate: Plate, rise: float, until: float, rules: PlateSizeRules = PlateSizeRules()
) -> PlateSizes:
    """A mesh for the waves of a push that takes `rise` [s] on a half-space, so large that echoes
    come back after `until` [s].
    """
    carried = group_speed(plate, rules.carried * np.pi / rise)
    omega = rules.resolved * np.pi / rise
    bending = 2 * np.pi / wavenumber(plate, omega)
    shear = 2 * np.pi * shear_speed(plate) / omega
    return PlateSizes(
        reach=rules.margin * carried * until / 2,
        seed=min(bending, shear) / rules.elements,
        contact_seed=min(rules.coarsest_seed, plate.thickness / 3),
        patch=min(rules.coarsest_patch, plate.thickness / 4),
        cutoff_hz=rules.resolved / (2 * rise),
    )
