from rom.craig_bampton import craig_bampton
from rom.exchange import load_h5, load_mat, load_npz, save_full, save_h5, save_mat, save_npz
from rom.factorisation import Factor, Factorise, ReductionError, superlu
from rom.free_modes import free_modes
from rom.health import (
    EffectiveMass,
    Health,
    effective_mass,
    fixed_interface_hz,
    health,
    is_indefinite,
)
from rom.reduced_model import (
    Contact,
    MassProperties,
    ModalWall,
    ReducedModel,
    Surface,
    full_order,
    modal,
    modal_compliance,
    receptance,
    static_compliance,
)
from rom.selection import Selection
from rom.substructure_file import Substructure, load_mtx, substructure
from rom.truncation import LOSS

__all__ = [
    "LOSS",
    "Contact",
    "EffectiveMass",
    "Factor",
    "Factorise",
    "Health",
    "MassProperties",
    "ModalWall",
    "ReducedModel",
    "ReductionError",
    "Selection",
    "Substructure",
    "Surface",
    "craig_bampton",
    "effective_mass",
    "fixed_interface_hz",
    "free_modes",
    "full_order",
    "health",
    "is_indefinite",
    "load_h5",
    "load_mat",
    "load_mtx",
    "load_npz",
    "modal",
    "modal_compliance",
    "receptance",
    "save_full",
    "save_h5",
    "save_mat",
    "save_npz",
    "static_compliance",
    "substructure",
    "superlu",
]
