"""Friction between a sphere and the body that it touches: the contact's law, empty contacts.

    1/E* = (1-nu1^2)/E1 + (1-nu2^2)/E2,     1/G* = (2-nu1)/(4 G1) + (2-nu2)/(4 G2)

The contact under any history is in `dem.kernels.tangential`. K. L. Johnson, Contact Mechanics,
Cambridge 1985, sec. 7.2 and 7.4.
"""

import numpy as np
from numpy.typing import ArrayLike

from beadwave.dem.checks import above_0, scalar
from beadwave.dem.kernels.arguments import Array
from beadwave.dem.kernels.tangential import WIDTH, SpringCells, SpringRow, TangentialLaw
from beadwave.dem.spheres import contact_modulus, contact_radius, relative_radius


def tangential_modulus(E1: float, nu1: float, E2: float = np.inf, nu2: float = 0.0) -> float:
    """G* [Pa], such that a contact of radius a that sticks has the stiffness 2 a G*; E2 = inf is
    rigid."""
    G1, G2 = E1 / (2.0 * (1.0 + nu1)), E2 / (2.0 * (1.0 + nu2))
    return 4.0 / ((2.0 - nu1) / G1 + (2.0 - nu2) / G2)


def tangential_law(
    coefficient: float,
    R1: float,
    E1: float,
    nu1: float,
    R2: float = np.inf,
    E2: float = np.inf,
    nu2: float = 0.0,
    **options: float,
) -> TangentialLaw:
    """Law of the contact of two spheres, or of one with a flat (R2 = inf), rigid for E2 = inf.

    `coefficient` is that of friction, radii are in m, moduli in Pa; `options` are further fields of
    the law. Raises InvalidChain for a coefficient below 0, and R1 or E1 that are not above 0.
    """
    scalar("friction coefficient", coefficient, at_least=0.0)
    for name, value in (("R1", R1), ("E1", E1)):
        above_0(name, value)
    G = tangential_modulus(E1, nu1, E2, nu2)
    c = coefficient * float(contact_modulus(E1, nu1, E2, nu2)) / G
    return TangentialLaw(G, c, float(relative_radius(R1, R2)), **options)


def open_row(capacity: int = 1024) -> SpringRow:
    """A contact that has not closed yet, with room for `capacity` nodes; half of them are used
    before any are merged.

    Merges change the force of an oblique impact by 4000 steps by up to 2e-6 of its largest (4e-5
    with room for 256, 1e-5 with 512), and the velocity after it by 2e-6.
    """
    state = np.zeros(7)
    state[1] = 1.0  # the pressure is that of the elastic law
    return SpringRow(np.zeros(capacity), np.zeros(capacity), np.zeros(1, np.int64), state)


def open_cells(n_cells: int = 256) -> SpringCells:
    """A contact in two directions that has not closed yet, in n_cells equal cells of xi = x^2.

    Along one direction under constant load, 256 cells give the force to 1e-5 of itself, and the
    energy of a loop at a quarter of gross slip to 2e-3 of itself (6e-6 of the loop at gross slip).
    """
    state = np.zeros(7)
    state[1] = 1.0
    return SpringCells(np.zeros((n_cells + 1, 2)), state)


def redivided(cells: SpringCells, n_cells: int) -> SpringCells:
    """The same displacements, linear between the ends of `n_cells` cells over the same width, in
    arrays of its own. Kinks inside of a new cell are cut, that at the contact's edge too: the force
    changes by the error of the cells."""
    n, state = cells.u.shape[0] - 1, cells.state.copy()
    if n == n_cells:
        return SpringCells(cells.u.copy(), state)
    places = np.arange(n_cells + 1) * (n / n_cells)
    u = np.stack([np.interp(places, np.arange(n + 1), values) for values in cells.u.T], axis=1)
    state[WIDTH] *= n / n_cells
    return SpringCells(u, state)


def stick_stiffness(law: TangentialLaw, a: ArrayLike) -> Array:
    """2 a G* [N/m] of contacts of radii a (...) [m] that stick all over (R. D. Mindlin, J. Appl.
    Mech. 16 (1949) 259)."""
    return 2.0 * np.asarray(a) * law.modulus


def gross_slip(law: TangentialLaw, overlap: ArrayLike) -> Array:
    """Displacement c d = mu E*/G* d [m], from the unsheared state, at which the whole contact of
    the overlap d (...) [m] slips."""
    return law.bound * np.asarray(overlap)


def contact_of_load(law: TangentialLaw, coefficient: float, load: float) -> tuple[float, float]:
    """Radius [m] and overlap [m] of a contact under a normal load [N] by Hertz' law; E* follows
    from the law's bound c = mu E*/G*, so that the coefficient mu must be that of the law, and not
    0."""
    E_star = law.bound * law.modulus / coefficient
    a = float(contact_radius(load, law.radius, E_star))
    return a, a * a / law.radius
