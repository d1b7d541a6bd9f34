"""Arguments of the marches: the state that they change, the arrays of a chain, the saved arrays.

A drift or a part of a step is one of a scheme's fractions of the step; its exact propagators are
computed once a march, for each of the n_fractions.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

U, V, DASH, WORK = range(4)  # of Motion.wall
IN_CONTACTS, IN_WALL, IN_GUIDES = range(3)  # of Motion.ledger


class Motion(NamedTuple):
    """The moving state, changed in place."""

    x: Array  # (n,) [m]
    v: Array  # (n,) [m/s]
    f: Array  # (n + 1,) [N] contact forces: f[0] = 0 before the first sphere, f[n] at the wall
    wall: Array  # (4,) u_w = phi q, v_w = phi p, way of the dashpot, work on the modes
    ledger: Array  # (3,) [J] energy lost in the contacts, in the dashpot and in the guides


class WallModes(NamedTuple):
    """A wall's modes q'' + 2 zeta omega q' + omega^2 q = phi F, (k,) each; q, p from rest."""

    q: Array  # [kg^1/2 m]
    p: Array  # [kg^1/2 m/s] dq/dt
    phi: Array  # [kg^-1/2]
    omega: Array  # [rad/s]
    static: Array  # [kg^1/2 m] displacement at rest
    propagator: Array  # (n_fractions, 4, k) rows qq, qp, pq, pp
    step_response: Array | None  # (n_fractions, k) [s^2] q under unit modal force, implicit only
    square: float  # [1/kg] phi phi, velocity of the wall after unit impulse
    rest_force: float  # [N] at the wall


class LeafSprings(NamedTuple):
    """Springs of the spheres to the ground, (n,) each."""

    stiffness: Array  # [N/m]
    anchor: Array  # [m]
    rest: Array  # [m] position in the static state
    propagator: Array  # (n_fractions, 3, n) rows qq = pp, qp, pq
    step_response: Array | None  # (n_fractions, n) [s^2] of unit mass, implicit only


class ForceTable(NamedTuple):
    """A force over the overlap as a cubic behind each of m knots, with t the overlap behind it:
    force + slope t + square t^2 + cube t^3; a straight line behind the last one."""

    overlap: Array  # (m,) [m] of the knots, from 0
    force: Array  # (m,) [N], from 0
    slope: Array  # (m,) [N/m]
    square: Array  # (m,) [N/m^2]
    cube: Array  # (m,) [N/m^3]
    energy: Array  # (m,) [J] integral of the force up to the knot


class ForceShape(NamedTuple):
    """Shape phi of a force A phi(d) that is not Hertz'."""

    law: int  # number of a row of `laws.ELASTIC_LAWS`
    parameters: Array  # (n_parameters, n_contacts) in the order of that row
    table: ForceTable  # the same for all contacts, empty for other laws than a table


class Damping(NamedTuple):
    """A damping law of the contacts, (n_contacts,) each."""

    gamma: Array  # [N s/m], or [s/m] of Hunt and Crossley's law
    law: int  # number of a row of `laws.DAMPING_LAWS`
    inverse_mass: Array  # [1/kg] of both bodies at a contact


class Plastic(NamedTuple):
    """Elastic-plastic contacts, (n_contacts,) each."""

    limit: Array  # [m] overlap where they yield
    top: Array  # [m] largest overlap so far, or the limit
    coefficient: Array  # [N/m^1.5] of the flattened surface; A before they yield
    crater: Array  # [m] overlap that stays when the force is gone; 0 before they yield


class Correction(NamedTuple):
    """A scheme as a quadrature: what its end correction is made of, see `events`."""

    weights: Array  # (n_kicks,) b of the kicks
    nodes: Array  # (n_kicks,) c, where in the step they are, 0 to 1
    tail: Array  # (3, m) coefficients, highest power first, for p = 3/2, 5/2, 7/2


class ChainArrays(NamedTuple):
    """A chain and its wall as a march reads them. What a chain lacks is None, and compiled out; a
    load and weights that it lacks are 0, which costs nothing and leaves a fifth fewer variants."""

    mass: Array  # (n,) [kg]
    inverse_mass: Array  # (n,) [1/kg]
    A: Array  # (n_contacts,) [N/m^1.5] of Hertz' law, else as `dem.elastic.ElasticLaw.A`
    shape: ForceShape | None  # of the elastic force; None: Hertz
    preload: float  # [N]
    weight: Array  # (n,) [N]
    friction: Array | None  # (n,) [N]
    offset: float  # [m] of the wall at rest
    load: Array  # (n,) [N] balances the contact forces at rest
    leaf: LeafSprings | None
    residual: float | None  # [m/N]
    mobility: float | None  # [m/(N s)]
    modes: WallModes | None
    damping: Damping | None
    plastic: Plastic | None
    bare: tuple | None  # () without load, leaf springs, damping, yield and friction


class Steps(NamedTuple):
    """Equal steps between equal saves."""

    h: float  # [s]
    n_save: int
    stride: int  # steps from save to save


class SavedStates(NamedTuple):
    """States, forces and energies at every save, k of them."""

    x: Array  # (k, n) [m]
    v: Array  # (k, n) [m/s]
    force: Array  # (k, n_contacts) [N], dampers included
    wall: Array  # (k, 2) displacement [m], velocity [m/s]
    energy: Array  # (k, 11) [J] in the order of Trajectory
    modes: Array  # (k, n_modes) q of the modes; (k, 0) saves none
    speeds: Array  # (k, n_modes) p of the modes; (k, 0) saves none
