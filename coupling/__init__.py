"""A reduced model as the wall of a chain, and the coupled run. SI units.

    reduced_wall.wall_of    rom.ReducedModel -> dem.Wall: its modes, its residual compliance
    impact     (chain, wall, v0, duration=..., error=...): the march, after its verdict
    rayleigh, ModalDamping, RayleighDamping    damping for wall_of
    verdict    whether chain and wall can work together, in sentences
    infinite_plate    a thin plate as a dashpot

Three things are easily left out of a wall made by hand, each some percent of the force:

1. The residual compliance. Modes left out of a wall answer statically. `wall_of` puts them into an
   oscillator of the same static compliance, and sets Wall.residual_compliance to minus the
   compliance of the half-space under the patch, `ReducedModel.contact.half_space`: K holds it, and
   Hertz' law holds it once more.
2. The preload. `Chain.preload` [N] presses the last sphere to the wall; the run starts from the
   state of rest of chain and wall under it. A scene's [preload] mass is the arm's: it is added to
   chain.mass[-1].
3. The surface. `flat` of dem.row_of_spheres is what the body struck is made of; without it the
   flat is rigid.

    from beadwave import coupling, dem
    from beadwave.coupling import reduced_wall  # loads rom, which other walls need not

    row = dem.row_of_spheres(0.0127, 7800.0, 210e9, 0.3, count=17, preload=15.0,
                             flat=dem.Flat(210e9, 0.3))
    row.mass[-1] += 0.134
    wall = reduced_wall.wall_of(reduced)
    result = coupling.impact(row, wall, [0.31] + 16 * [0.0], duration=3e-3, error=1e-4)
    result.trajectory.contact_force[:, -1].max()

`beadwave.impact(scene, rom=reduced)` does all of it.
"""

from beadwave.coupling.coupled_march import (
    EnergyGain,
    energy_gain,
    longest_step,
    march_coupled,
    with_coupled_error,
)
from beadwave.coupling.coupled_wall import CoupledWall
from beadwave.coupling.damping import (
    Damping,
    ModalDamping,
    RayleighDamping,
    damping_ratios,
    rayleigh,
)
from beadwave.coupling.elliptical_contact import PLANE, EllipticalContact, elliptical_contact
from beadwave.coupling.errors import CouplingError
from beadwave.coupling.infinite_plate import (
    Plate,
    group_speed,
    infinite_plate,
    slenderness,
)
from beadwave.coupling.march import Impact, impact
from beadwave.coupling.radiation import radiated_energy
from beadwave.coupling.verdict import Verdict, largest_monotone_force, predicted_peak_force, verdict

__all__ = [
    "PLANE",
    "CoupledWall",
    "CouplingError",
    "Damping",
    "EllipticalContact",
    "EnergyGain",
    "Impact",
    "ModalDamping",
    "Plate",
    "RayleighDamping",
    "Verdict",
    "damping_ratios",
    "elliptical_contact",
    "energy_gain",
    "group_speed",
    "impact",
    "infinite_plate",
    "largest_monotone_force",
    "longest_step",
    "march_coupled",
    "predicted_peak_force",
    "radiated_energy",
    "rayleigh",
    "slenderness",
    "verdict",
    "with_coupled_error",
]
