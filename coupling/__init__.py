from coupling.coupled_march import (
    EnergyGain,
    energy_gain,
    longest_step,
    march_coupled,
    with_coupled_error,
)
from coupling.coupled_wall import CoupledWall
from coupling.damping import (
    Damping,
    ModalDamping,
    RayleighDamping,
    damping_ratios,
    rayleigh,
)
from coupling.errors import CouplingError
from coupling.march import Impact, impact
from coupling.plate import (
    Plate,
    group_speed,
    infinite_plate,
    slenderness,
)
from coupling.pruning import LeftOut, Pruning, mode_costs, prune
from coupling.radiation import radiated_energy
from coupling.verdict import Verdict, largest_monotone_force, predicted_peak_force, verdict

__all__ = [
    "CoupledWall",
    "CouplingError",
    "Damping",
    "EnergyGain",
    "Impact",
    "LeftOut",
    "ModalDamping",
    "Plate",
    "Pruning",
    "RayleighDamping",
    "Verdict",
    "damping_ratios",
    "energy_gain",
    "group_speed",
    "impact",
    "infinite_plate",
    "largest_monotone_force",
    "longest_step",
    "march_coupled",
    "mode_costs",
    "predicted_peak_force",
    "prune",
    "radiated_energy",
    "rayleigh",
    "slenderness",
    "verdict",
    "with_coupled_error",
]
