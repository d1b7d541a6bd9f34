"""What the marches take: the state that they change, the parts of a chain, where saves go."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

U, V, DASH, WORK = range(4)  # of Motion.wall
IN_CONTACTS, IN_WALL, IN_GUIDES = range(3)  # of Motion.ledger


class Motion(NamedTuple):
    """The moving state, changed in place."""

    x: Array  # (n,)
    v: Array  # (n,)
    f: Array  # (n + 1,) contact forces: f[0] = 0 before the first sphere, f[n] at the wall
    wall: Array  # (4,) u_w = phi q, v_w = phi p, way of the dashpot, work on the modes
    ledger: Array  # (3,) energy lost in the contacts, in the dashpot and in the guides


class Modes(NamedTuple):
    """A wall's modes, (k,) each, and how they move in each part of a step."""

    q: Array
    p: Array
    phi: Array
    omega: Array
    static: Array  # displacement at rest
    propagator: Array  # (n_parts, 4, k) rows qq, qp, pq, pp
    step_response: Array | None  # (n_parts, k) displacement under unit force, implicit only
    square: float  # phi phi, velocity of the wall after unit impulse
    rest_force: float  # [N] at the wall


class LeafSprings(NamedTuple):
    """Springs of the spheres to the ground, (n,) each."""

    stiffness: Array
    anchor: Array
    rest: Array  # position in the static state
    propagator: Array  # (n_parts, 3, n) rows qq = pp, qp, pq
    step_response: Array | None  # (n_parts, n), implicit only


class Damping(NamedTuple):
    """A damping law of the contacts, (n_contacts,) each."""

    gamma: Array
    law: int
    inverse_mass: Array  # of both bodies at a contact


class Plastic(NamedTuple):
    """Elastic-plastic contacts, (n_contacts,) each."""

    limit: Array  # overlap where they yield
    top: Array  # largest overlap so far, or the limit
    coefficient: Array  # of the flattened surface
    crater: Array


class Correction(NamedTuple):
    """A scheme as a quadrature: what its end correction is made of, see `events`."""

    weights: Array
    nodes: Array
    tail: Array  # (3, m)


class Parts(NamedTuple):
    """A chain and its wall; absent parts are None."""

    mass: Array
    inverse_mass: Array
    A: Array
    preload: float
    weight: Array | None  # (n,) [N]
    friction: Array | None  # (n,) [N]
    offset: float  # [m] of the wall at rest
    load: Array | None  # what holds every sphere against its contacts at rest
    leaf: LeafSprings | None
    residual: float | None
    mobility: float | None
    modes: Modes | None
    damping: Damping | None
    plastic: Plastic | None
    bare: tuple | None  # () without load, leaf springs, damping, yield and friction


class Steps(NamedTuple):
    """Equal steps between equal saves."""

    h: float  # [s]
    n_save: int
    stride: int


class Saved(NamedTuple):
    """States, forces and energies at every save."""

    x: Array
    v: Array
    force: Array
    wall: Array  # (k, 2) displacement, velocity
    energy: Array  # (k, 11) in the order of Trajectory
    modes: Array  # (k, n_modes) q of the modes; (k, 0) saves none
    speeds: Array  # (k, n_modes) p of the modes; (k, 0) saves none
