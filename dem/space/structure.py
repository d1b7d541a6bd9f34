"""Structures that packings lean on: modes that move the points where spheres touch them.

    q'' + 2 zeta omega q' + omega^2 q = Phi F + load f(t),    U = Phi^T q + S F

Shakers push by forces f. Each point moves along its directions, one or more rows of Phi. What
points feel of each other, the static response included, is in the modes; S is in series with each
contact: minus the half-space that Hertz' law holds along the normal, and Mindlin's across it.
"""

from typing import NamedTuple

import numpy as np

from beadwave.dem.checks import InvalidChain, require, vector
from beadwave.dem.kernels import oscillators
from beadwave.dem.kernels.arguments import Array
from beadwave.dem.shakers import Oscillators, ShakerForces, modal_shaker_forces
from beadwave.dem.space.kernel import Numbers, StructureModes
from beadwave.dem.space.packing import MOVING, Packing
from beadwave.dem.walls import Wall


class Structure(NamedTuple):
    """k modes that move p points along r directions."""

    omega: Array  # (k,) [rad/s]
    zeta: Array  # (k,)
    phi: Array  # (r, k) [kg^-1/2] mass-normalised
    point: Numbers  # (r,) whose direction it is, from 0, ascending
    direction: Array  # (r, 3) unit vectors, those of a point orthogonal
    residual: Array  # (p, 2) [m/N] in series with the contact at a point, normal and tangential
    # (p, 3, 3) [m/N] what S has besides at points with three directions whose contacts rub by exact
    # springs: of a half-space on a mesh, whose directions the mesh couples
    residual_besides: Array | None = None
    load: Array | None = None  # (k, s) [kg^-1/2] participations of its shakers
    shakers: ShakerForces | None = None

    @property
    def n_points(self) -> int:
        """Points that spheres may touch."""
        return len(self.residual)


def structure_of_wall(wall: Wall, normal: Array) -> Structure:
    """The structure of one point that moves along a normal (3,) as a wall of modes."""
    return Structure(
        np.asarray(wall.omega, float),
        np.asarray(wall.zeta, float),
        np.ascontiguousarray(np.atleast_2d(wall.phi), float),
        np.zeros(1, np.int64),
        np.atleast_2d(np.asarray(normal, float)),
        np.array([[wall.residual_compliance, 0.0]]),
    )


def structure_behind(packing: Packing, wall: Wall | Structure | None) -> Structure | None:
    """The structure that a packing leans on; of a wall one with one point, along the normal of its
    contacts. None where nothing moves. Raises InvalidChain for numbers that do not fit together."""
    leaning = packing.pairs[:, 1] <= MOVING
    if isinstance(wall, Wall):
        require(
            wall.mobility == 0.0,
            "a packing leans on a wall of modes alone; leave out mobility",
        )
        if not wall.omega.size or not leaning.any():
            return None
        wall = structure_of_wall(wall, packing.arm[leaning][0])
    if wall is None:
        return None
    r, k = wall.phi.shape
    vector("omega of the structure", wall.omega, k, at_least=0.0)
    vector("zeta of the structure", wall.zeta, k, at_least=0.0)
    vector("phi of the structure", wall.phi.ravel(), r * k)
    vector("residual of the structure", wall.residual.ravel(), 2 * wall.n_points)
    if wall.residual_besides is not None:
        vector("residual of the structure", wall.residual_besides.ravel(), 9 * wall.n_points)
    if wall.load is not None:
        vector("load of the structure", wall.load.ravel(), k * len(wall.shakers.force))
    if leaning.any() and MOVING - packing.pairs[:, 1].min() >= wall.n_points:
        raise InvalidChain(
            f"spheres touch the point {MOVING - packing.pairs[:, 1].min()} of a structure that has "
            f"{wall.n_points}, counted from 0"
        )
    return wall


def residuals(packing: Packing, structure: Structure | None) -> Array:
    """(2, c) [m/N] in series with each contact, normal and tangential; 0 of two spheres."""
    of_contacts = np.zeros((2, len(packing.A)))
    if structure is not None:
        second = packing.pairs[:, 1]
        leaning = second <= MOVING
        of_contacts[:, leaning] = structure.residual[MOVING - second[leaning]].T
    return of_contacts


def residual_matrices(packing: Packing, structure: Structure | None, contacts: Numbers) -> Array:
    """(m, 3, 3) [m/N] in series with these contacts, along the normal and the two directions across
    it of their points; 0 of two spheres."""
    normal, tangential = residuals(packing, structure)[:, contacts]
    S = np.zeros((len(contacts), 3, 3))
    S[:, 0, 0], S[:, 1, 1], S[:, 2, 2] = normal, tangential, tangential
    if structure is not None and structure.residual_besides is not None:
        second = packing.pairs[contacts, 1]
        leaning = second <= MOVING
        S[leaning] += structure.residual_besides[MOVING - second[leaning]]
    return S


def rest_forces(packing: Packing, structure: Structure) -> Array:
    """Forces (r,) [N] of the contacts at rest on the points along their directions."""
    force, pressed = np.zeros(len(structure.phi)), contact_forces_at_rest(packing, structure)
    for c in np.flatnonzero(packing.pairs[:, 1] <= MOVING):
        rows = structure.point == MOVING - packing.pairs[c, 1]
        force[rows] += pressed[c] * structure.direction[rows] @ packing.arm[c]
    return force


def contact_forces_at_rest(packing: Packing, structure: Structure | None) -> Array:
    """(c,) [N] of the Hertz contacts at rest, whose overlaps include the residual compliance."""
    from beadwave.dem.kernels.laws import hertz_indentation

    residual, d = residuals(packing, structure)[0], np.maximum(packing.overlap, 0.0)
    for c in np.flatnonzero((residual != 0.0) & (d > 0.0)):
        d[c] = hertz_indentation.py_func(d[c], packing.A[c], residual[c])
    return packing.A * d**1.5


def modes_in_march(packing: Packing, structure: Structure, spans: Array) -> StructureModes:
    """The structure as the kernel moves it, about its displacement at rest; spans [s] of drifts."""
    omega, phi = structure.omega, np.ascontiguousarray(structure.phi)
    r, k = phi.shape
    rest = rest_forces(packing, structure)
    with np.errstate(divide="ignore", invalid="ignore"):
        static = np.where(omega > 0.0, rest @ phi / omega**2, 0.0)
    start = np.searchsorted(structure.point, np.arange(structure.n_points + 1))
    load = np.zeros((k, 0)) if structure.load is None else structure.load
    modes = Oscillators(omega, structure.zeta, load, np.zeros((1, load.shape[1])))
    return StructureModes(
        np.zeros(k), np.zeros(k), phi, np.ascontiguousarray(omega), static,
        oscillators.propagators(spans, omega, structure.zeta), phi @ phi.T,
        np.ascontiguousarray(structure.direction), start.astype(np.int64), rest, np.zeros(r),
        np.zeros(r), np.zeros((2, r)), np.zeros(1),
        modal_shaker_forces(modes, structure.shakers, spans), np.zeros(1),
    )  # fmt: skip
