from coupling.coupled_march import (
    EnergyGain,
    energy_gain,
    longest_step,
    march_coupled,
    with_coupled_error,
)
from coupling.coupled_wall import CoupledWall, as_coupled
from coupling.damping import (
    UNCOUPLED,
    Damping,
    ModalDamping,
    RayleighDamping,
    damping_ratios,
    modal_coupling,
    rayleigh,
)
from coupling.errors import CouplingError
from coupling.march import Impact, impact
from coupling.plate import (
    Plate,
    group_speed,
    inelasticity,
    infinite_plate,
    slenderness,
)
from coupling.pruning import LeftOut, Pruning, mode_costs, prune
from coupling.radiation import radiated_energy
from coupling.series_law import half_space_compliance, largest_monotone_force, require_monotone
from coupling.verdict import Verdict, predicted_peak_force, verdict

__all__ = [
    "UNCOUPLED",
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
    "as_coupled",
    "damping_ratios",
    "energy_gain",
    "group_speed",
    "half_space_compliance",
    "impact",
    "inelasticity",
    "infinite_plate",
    "largest_monotone_force",
    "longest_step",
    "march_coupled",
    "modal_coupling",
    "mode_costs",
    "predicted_peak_force",
    "prune",
    "radiated_energy",
    "rayleigh",
    "require_monotone",
    "slenderness",
    "verdict",
    "with_coupled_error",
]
