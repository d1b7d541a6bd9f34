from rom.craig_bampton import craig_bampton
from rom.exchange import load_h5, load_mat, load_npz, save_h5, save_mat, save_npz
from rom.factorisation import Factor, Factorise, ReductionError, superlu
from rom.free_modes import free_modes
from rom.health import (
    EffectiveMass,
    Health,
    RigidBody,
    effective_mass,
    fixed_interface_hz,
    health,
    require_rigid_motion,
    rigid_body,
)
from rom.reduced_model import (
    ModalWall,
    ReducedModel,
    full_order,
    modal,
    modal_compliance,
    receptance,
    reconstruct,
    static_compliance,
)
from rom.substructure_file import Substructure, load_mtx, substructure

__all__ = [
    "EffectiveMass",
    "Factor",
    "Factorise",
    "Health",
    "ModalWall",
    "ReducedModel",
    "ReductionError",
    "RigidBody",
    "Substructure",
    "craig_bampton",
    "effective_mass",
    "fixed_interface_hz",
    "free_modes",
    "full_order",
    "health",
    "load_h5",
    "load_mat",
    "load_mtx",
    "load_npz",
    "modal",
    "modal_compliance",
    "receptance",
    "reconstruct",
    "require_rigid_motion",
    "rigid_body",
    "save_h5",
    "save_mat",
    "save_npz",
    "static_compliance",
    "substructure",
    "superlu",
]
