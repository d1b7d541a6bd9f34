"""Reduced models: K, M, C, w in, smaller ones out. SI units.

    free_modes       (K, M, w, Selection(n_modes=40)): free modes + the residual vector K^-1 w
    craig_bampton    (K, M, w, boundary, Selection(...)): boundary dofs + fixed-interface modes
    many_contacts    (pencil, modes, W): modes for many contacts, what each has beyond them
    several_contacts (K, M, W, error, to_hz): free modes for contacts that are loaded at once
    with_columns     (model, K, M, B): further functionals of a model, as of shakers and sensors
    full_order       the unreduced structure as a ReducedModel, up to 5000 unknowns
    modal            ModalWall: omega (k,) [rad/s], phi (k,) = w @ mode [kg^-1/2]
    receptance       w^T (K - omega^2 M + i omega C)^-1 w [m/N] at frequencies [Hz]
    static_compliance, health, effective_mass   what a reduced model is like
    joined_receptance   parts, measured or computed, joined by their receptances
    joined_by_fits      fitted parts joined, with the error of the whole
    passive_fit      oscillators of measured receptances at points of a part, which create no
                     energy; coupled: joined to matrices
    save_npz, save_mat, save_h5, load_npz, load_mat, load_h5, load_mtx   files

A ReducedModel holds K (r, r) [N/m], M (r, r) [kg], C (r, r) [N s/m] or None, and w (r,): the wall
is read as u_w = w @ q [m] and loaded by w F. `contact.half_space` [m/N] is the compliance of the
patch on a half-space: it is still in K, and `coupling.reduced_wall.wall_of` takes it off.

>>> import numpy as np
>>> reduced = full_order(np.array([[4e6]]), np.array([[0.1]]), [1.0])
>>> f"{static_compliance(reduced):.2e} m/N"
'2.50e-07 m/N'
"""

from beadwave.rom.columns import ColumnOptions, with_columns
from beadwave.rom.contact_modes import krylov_space
from beadwave.rom.contact_space import Space
from beadwave.rom.craig_bampton import craig_bampton
from beadwave.rom.exchange import (
    load_h5,
    load_mat,
    load_npz,
    save_full,
    save_h5,
    save_mat,
    save_npz,
)
from beadwave.rom.factorisation import Factorise, Pencil, ReductionError, Solver, superlu
from beadwave.rom.free_modes import free_modes
from beadwave.rom.health import (
    EffectiveMass,
    Health,
    effective_mass,
    fixed_interface_hz,
    health,
    is_indefinite,
)
from beadwave.rom.lanczos import no_modes
from beadwave.rom.many_contacts import ManyContacts, many_contacts, static_responses
from beadwave.rom.passive_fit import (
    CoupledMatrices,
    ModalFit,
    coupled,
    modal_receptance,
    passive_fit,
)
from beadwave.rom.reduced_model import (
    Columns,
    Contact,
    MassProperties,
    ModalWall,
    ReducedModel,
    StrainShares,
    Surface,
    full_order,
    modal,
    modal_compliance,
    modes_alone,
    receptance,
    static_compliance,
)
from beadwave.rom.selection import Selection
from beadwave.rom.several_contacts import several_contacts
from beadwave.rom.substructure_file import Substructure, load_mtx, substructure
from beadwave.rom.substructuring import (
    compatibility,
    joined_by_fits,
    joined_receptance,
    joint_receptance,
)
from beadwave.rom.truncation import LOSS

__all__ = [
    "LOSS",
    "ColumnOptions",
    "Columns",
    "Contact",
    "CoupledMatrices",
    "EffectiveMass",
    "Factorise",
    "Health",
    "ManyContacts",
    "MassProperties",
    "ModalFit",
    "ModalWall",
    "Pencil",
    "ReducedModel",
    "ReductionError",
    "Selection",
    "Solver",
    "Space",
    "StrainShares",
    "Substructure",
    "Surface",
    "compatibility",
    "coupled",
    "craig_bampton",
    "effective_mass",
    "fixed_interface_hz",
    "free_modes",
    "full_order",
    "health",
    "is_indefinite",
    "joined_by_fits",
    "joined_receptance",
    "joint_receptance",
    "krylov_space",
    "load_h5",
    "load_mat",
    "load_mtx",
    "load_npz",
    "many_contacts",
    "modal",
    "modal_compliance",
    "modal_receptance",
    "modes_alone",
    "no_modes",
    "passive_fit",
    "receptance",
    "save_full",
    "save_h5",
    "save_mat",
    "save_npz",
    "several_contacts",
    "static_compliance",
    "static_responses",
    "substructure",
    "superlu",
    "with_columns",
]
