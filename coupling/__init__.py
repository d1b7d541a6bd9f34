from coupling.calibration import Calibration, calibrate
from coupling.coupled_wall import (
    CoupledWall,
    EnergyGain,
    as_coupled,
    coupled_wall,
    energy_gain,
    march_coupled,
)
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
from coupling.forward import Forward
from coupling.march import Impact, impact
from coupling.parameters import Parameter, Rig, rig_at
from coupling.plate import (
    Plate,
    group_speed,
    inelasticity,
    infinite_plate,
    slenderness,
)
from coupling.pruning import LeftOut, Pruning, mode_costs, prune
from coupling.radiation import radiated_energy
from coupling.search import Options
from coupling.signals import Aligned, Filter, Signals, aligned, lag_of
from coupling.uncertainty import Combination, Uncertainty
from coupling.verdict import Verdict, predicted_peak_force, verdict
from coupling.wall import (
    half_space_compliance,
    largest_monotone_force,
    require_monotone,
    wall_from_reduced,
)

__all__ = [
    "UNCOUPLED",
    "Aligned",
    "Calibration",
    "Combination",
    "CoupledWall",
    "CouplingError",
    "Damping",
    "EnergyGain",
    "Filter",
    "Forward",
    "Impact",
    "LeftOut",
    "ModalDamping",
    "Options",
    "Parameter",
    "Plate",
    "Pruning",
    "RayleighDamping",
    "Rig",
    "Signals",
    "Uncertainty",
    "Verdict",
    "aligned",
    "as_coupled",
    "calibrate",
    "coupled_wall",
    "damping_ratios",
    "energy_gain",
    "group_speed",
    "half_space_compliance",
    "impact",
    "inelasticity",
    "infinite_plate",
    "lag_of",
    "largest_monotone_force",
    "march_coupled",
    "modal_coupling",
    "mode_costs",
    "predicted_peak_force",
    "prune",
    "radiated_energy",
    "rayleigh",
    "require_monotone",
    "rig_at",
    "slenderness",
    "verdict",
    "wall_from_reduced",
]
