"""What the marches take: the state that they change, the parts of a chain, where saves go."""

from typing import NamedTuple

import numpy as np

U, V, DASH, WORK = range(4)  # of Motion.wall
IN_CONTACTS, IN_WALL = range(2)  # of Motion.ledger


class Motion(NamedTuple):
    """The moving state, changed in place."""

    x: np.ndarray  # (n,)
    v: np.ndarray  # (n,)
    f: np.ndarray  # (n + 1,) contact forces: f[0] = 0 before the first sphere, f[n] at the wall
    wall: np.ndarray  # (4,) u_w = phi q, v_w = phi p, way of the dashpot, work on the modes
    ledger: np.ndarray  # (2,) energy lost in the contacts and in the dashpot


class Modes(NamedTuple):
    """A wall's modes, (k,) each, and how they move in each part of a step."""

    q: np.ndarray
    p: np.ndarray
    phi: np.ndarray
    omega: np.ndarray
    static: np.ndarray  # displacement at rest
    propagator: np.ndarray  # (n_parts, 4, k) rows qq, qp, pq, pp
    step_response: np.ndarray | None  # (n_parts, k) displacement under unit force, implicit only
    square: float  # phi phi, velocity of the wall after unit impulse
    rest_force: float  # [N] at the wall


class LeafSprings(NamedTuple):
    """Springs of the spheres to the ground, (n,) each."""

    stiffness: np.ndarray
    anchor: np.ndarray
    rest: np.ndarray  # position in the static state
    propagator: np.ndarray  # (n_parts, 3, n) rows qq = pp, qp, pq
    step_response: np.ndarray | None  # (n_parts, n), implicit only


class Damping(NamedTuple):
    """A damping law of the contacts, (n_contacts,) each."""

    gamma: np.ndarray
    law: int
    inverse_mass: np.ndarray  # of both bodies at a contact


class Plastic(NamedTuple):
    """Elastic-plastic contacts, (n_contacts,) each."""

    limit: np.ndarray  # overlap where they yield
    top: np.ndarray  # largest overlap so far, or the limit
    coefficient: np.ndarray  # of the flattened surface
    crater: np.ndarray


class Correction(NamedTuple):
    """A scheme as a quadrature: what its end correction is made of, see `events`."""

    weights: np.ndarray
    nodes: np.ndarray
    tail: np.ndarray  # (3, m)


class Parts(NamedTuple):
    """A chain and its wall; absent parts are None."""

    mass: np.ndarray
    inverse_mass: np.ndarray
    A: np.ndarray
    preload: float
    offset: float  # [m] of the wall at rest
    load: np.ndarray | None  # what holds every sphere against its contacts at rest
    leaf: LeafSprings | None
    residual: float | None
    mobility: float | None
    modes: Modes | None
    damping: Damping | None
    plastic: Plastic | None
    bare: tuple | None  # () without load, leaf springs, damping and yield


class Steps(NamedTuple):
    """Equal steps between equal saves."""

    h: float  # [s]
    n_save: int
    stride: int


class Saved(NamedTuple):
    """States, forces and energies at every save."""

    x: np.ndarray
    v: np.ndarray
    force: np.ndarray
    wall: np.ndarray  # (k, 2) displacement, velocity
    energy: np.ndarray  # (k, 9) in the order of Trajectory
