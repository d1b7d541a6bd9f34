"""The chain of spheres, the wall it leans on, and the static state both start from.

Positions x are measured from the chain in which all neighbours just touch, velocities are positive
towards the wall. Contact i has the overlap delta = x_i - x_{i+1}; the last one, at the wall,
delta = x_N - u_w - s F with the modes' displacement u_w and the residual compliance s.
"""

import math
from typing import NamedTuple

import numpy as np

from dem import kernels
from dem.spheres import hertz_coefficient, mass

REGULAR = 1e-8  # of a closed contact's stiffness, in the static state's tangent
SMALLEST, LARGEST = 5e-324, 1.7976931348623157e308  # of all positive numbers

LAWS = {
    "none": kernels.NONE,
    "linear": kernels.LINEAR,
    "linear-clipped": kernels.LINEAR_CLIPPED,
    "hunt-crossley": kernels.HUNT_CROSSLEY,
}


class InvalidChain(ValueError):
    """A chain, wall or initial velocity that no run can start from."""


class NoEquilibrium(ValueError):
    """No static state carries the preload or the leaf springs."""


class Chain(NamedTuple):
    """Spheres 1..n from the striker to the wall; the absent parts are None.

    Damping force of a contact: "linear" and "linear-clipped" gamma delta' [N s/m] while it is
    closed, "hunt-crossley" gamma delta' A delta^(3/2), gamma in [s/m]. Only "linear" can pull.
    Beyond its yield overlap a contact follows C. Thornton, J. Appl. Mech. 64 (1997) 383.
    """

    mass: np.ndarray  # (n,) [kg]
    radius: np.ndarray  # (n,) [m]
    A: np.ndarray  # (n,) [N/m^1.5], the last one at the wall; (n - 1,) for a free chain
    dissipation: str = "none"
    gamma: np.ndarray | None = None  # one per contact
    leaf_stiffness: np.ndarray | None = None  # (n,) [N/m]
    leaf_anchor: np.ndarray | None = None  # (n,) [m] offset towards the wall; None: 0
    preload: float = 0.0  # [N] on the last sphere, towards the wall
    yield_overlap: np.ndarray | None = None  # [m] one per contact, where it turns plastic


class Wall(NamedTuple):
    """n_modes oscillators q'' + 2 zeta omega q' + omega^2 q = phi F in parallel, u_w = phi q.

    No modes: immovable. `residual_compliance` is a massless spring in series with the last contact,
    `mobility` a dashpot that gives way at  mobility * F  (Zener's infinite plate).
    """

    omega: np.ndarray  # (n_modes,) [rad/s]
    zeta: np.ndarray  # (n_modes,)
    phi: np.ndarray  # (n_modes,) [kg^-1/2] participation, mass-normalised
    residual_compliance: float = 0.0  # [m/N], may be slightly negative
    mobility: float = 0.0  # [m/(N s)]


class State(NamedTuple):
    """Where a march stands; modes q, p are measured from the static state."""

    x: np.ndarray  # (n,)
    v: np.ndarray  # (n,)
    q: np.ndarray  # (n_modes,)
    p: np.ndarray  # (n_modes,)
    wall: np.ndarray  # (4,) u_w, v_w of the modes, displacement of the dashpot, work on the modes
    deepest: np.ndarray | None = None  # (n_contacts,) largest overlap so far, of plastic contacts

    def reversed(self):
        """The same place with all velocities turned round."""
        wall = self.wall * [1.0, -1.0, 1.0, 1.0]
        return State(self.x, -self.v, self.q, -self.p, wall, self.deepest)


class Equilibrium(NamedTuple):
    """Static state: sphere positions, contact forces, displacement of each wall mode."""

    x: np.ndarray  # (n,)
    force: np.ndarray  # (n_contacts,)
    q: np.ndarray  # (n_modes,)


def row_of_spheres(
    radius,
    density,
    young,
    poisson,
    *,
    count=None,
    wall_young=np.inf,
    wall_poisson=0.0,
    free=False,
    stiffness_factor=1.0,
    **parts,
):
    """Chain of elastic spheres against a flat of the given material (default: rigid).

    Material values are scalars or one per sphere; `free` leaves the flat out; `parts` are the
    further fields of `Chain`, scalars or one per sphere or contact. Raises InvalidChain.
    """
    n = count or np.broadcast(radius, density, young, poisson).size
    R, rho, E, nu = (
        np.broadcast_to(np.asarray(p, float), n) for p in (radius, density, young, poisson)
    )
    for name, values in (("radius", R), ("density", rho), ("young", E)):
        _vector(name, values, n, positive=True)
    _vector("poisson", nu, n, at_least=-1.0)
    A = hertz_coefficient(R[:-1], E[:-1], nu[:-1], R[1:], E[1:], nu[1:])
    if not free:
        A = np.append(A, hertz_coefficient(R[-1], E[-1], nu[-1], np.inf, wall_young, wall_poisson))
    sizes = {"gamma": A.size, "leaf_stiffness": n, "leaf_anchor": n, "yield_overlap": A.size}
    for name in sizes.keys() & parts.keys():
        if parts[name] is not None:
            parts[name] = np.broadcast_to(np.asarray(parts[name], float), sizes[name]).copy()
    chain = Chain(mass(R, rho), R.copy(), A * stiffness_factor, **parts)
    validate(chain, None if free else rigid_wall(), np.zeros(n))
    return chain


def rigid_wall():
    """A wall that does not move."""
    return Wall(np.zeros(0), np.zeros(0), np.zeros(0))


def one_dof_wall(frequency, mass, damping_ratio=0.0):
    """One mass on a spring to the ground; frequency in Hz (0: a free mass). Raises InvalidChain."""
    _scalar("wall frequency", frequency, at_least=0.0)
    _above_0("wall mass", mass)
    _scalar("wall damping_ratio", damping_ratio, at_least=0.0)
    omega = 2.0 * np.pi * frequency
    return Wall(np.array([omega]), np.array([damping_ratio]), np.array([mass**-0.5]))


def dashpot_wall(coefficient):
    """A wall that resists with coefficient * velocity [N s/m]. Raises InvalidChain."""
    _above_0("dashpot coefficient", coefficient)
    return rigid_wall()._replace(mobility=1.0 / coefficient)


def plate_wall(young, poisson, density, thickness):
    """Infinite thin plate, a dashpot of 8 sqrt(D rho h) (Zener, Phys. Rev. 59 (1941) 669)."""
    for name, value in (("young", young), ("density", density), ("thickness", thickness)):
        _above_0(f"plate {name}", value)
    D = young * thickness**3 / (12.0 * (1.0 - poisson**2))
    return dashpot_wall(8.0 * np.sqrt(D * density * thickness))


def validate(chain, wall, v0):
    """Raise InvalidChain with one sentence if anything is missing, not finite or out of range."""
    n = np.size(chain.mass)
    n_contacts = n - 1 if wall is None else n
    _require(n >= 1, "the chain has no sphere; give at least one mass")
    mass = _vector("mass", chain.mass, n, positive=True)
    _vector("radius", chain.radius, n, positive=True)
    _vector("A", chain.A, n_contacts, positive=True)
    v0 = _vector("initial velocity", v0, n)
    _scalar("kinetic energy of the start", 0.5 * kernels.weighted_square(mass, v0))
    _require(
        chain.dissipation in LAWS,
        f"dissipation {chain.dissipation!r} is unknown; take one of {', '.join(LAWS)}",
    )
    if chain.dissipation != "none":
        _vector("gamma", chain.gamma, n_contacts, at_least=0.0)
    if chain.leaf_stiffness is not None:
        _vector("leaf_stiffness", chain.leaf_stiffness, n, at_least=0.0)
    if chain.leaf_anchor is not None:
        _vector("leaf_anchor", chain.leaf_anchor, n)
        _require(chain.leaf_stiffness is not None, "leaf_anchor needs leaf_stiffness beside it")
    _scalar("preload", chain.preload)
    if chain.yield_overlap is not None:
        _vector("yield_overlap", chain.yield_overlap, n_contacts, positive=True)
    if wall is not None:
        _validate_wall(chain, wall)


def _validate_wall(chain, wall):
    n_modes = np.size(wall.omega)
    _vector("wall omega", wall.omega, n_modes, at_least=0.0)
    _vector("wall zeta", wall.zeta, n_modes, at_least=0.0)
    _vector("wall phi", wall.phi, n_modes)
    _scalar("residual_compliance", wall.residual_compliance)
    _scalar("mobility", wall.mobility, at_least=0.0)
    _require(
        wall.mobility == 0.0 or chain.yield_overlap is None,
        "a dashpot wall takes no plastic contacts; leave out yield_overlap or the dashpot",
    )
    _require(
        wall.mobility == 0.0 or chain.dissipation == "none" or chain.gamma[-1] == 0.0,
        f"a dashpot wall takes no damping at the last contact, found gamma = "
        f"{0.0 if chain.gamma is None else chain.gamma[-1]:g}; set it to 0",
    )


def _require(condition, sentence):
    if not condition:
        raise InvalidChain(sentence)


def _vector(name, values, size, *, positive=False, at_least=None):
    try:
        values = np.array(values, float)
    except (TypeError, ValueError):
        raise InvalidChain(f"{name} is {values!r}; give {size} numbers") from None
    if values.shape != (size,):
        raise InvalidChain(f"{name} has shape {values.shape}; give {size} numbers")
    lowest = SMALLEST if positive else -LARGEST if at_least is None else at_least
    i = kernels.first_outside(values, lowest)
    if i >= 0:
        least = "" if lowest == -LARGEST else f" and at least {lowest:g}"
        allowed = "finite" + (" and above 0" if positive else least)
        raise InvalidChain(f"{name}[{i}] is {values[i]:g}; it must be {allowed}")
    return values


def _scalar(name, value, *, at_least=None):
    lowest = -math.inf if at_least is None else at_least
    if not (isinstance(value, float) and math.isfinite(value) and value >= lowest):
        _vector(name, np.atleast_1d(value), 1, at_least=at_least)


def _above_0(name, value):
    _vector(name, np.atleast_1d(value), 1, positive=True)


def equilibrium(chain, wall):
    """Static state under preload and leaf springs; spheres that nothing holds just touch the next.

    Raises InvalidChain, NoEquilibrium.
    """
    validate(chain, wall, np.zeros(np.size(chain.mass)))
    return static_state(chain, wall)


def static_state(chain, wall):
    """`equilibrium` of what is validated."""
    n = chain.mass.size
    n_modes = 0 if wall is None else wall.omega.size
    stiffness = np.zeros(n) if chain.leaf_stiffness is None else chain.leaf_stiffness
    anchor = np.zeros(n) if chain.leaf_anchor is None else chain.leaf_anchor
    if chain.preload == 0.0 and not (stiffness * anchor).any():
        return Equilibrium(np.zeros(n), np.zeros(chain.A.size), np.zeros(n_modes))
    compliance = static_compliance(wall)
    x, force = _rest(chain, wall, stiffness, anchor, compliance)
    q = np.zeros(n_modes)
    if n_modes and force[-1] > 0.0:
        moving = wall.phi != 0.0
        q[moving] = wall.phi[moving] * force[-1] / wall.omega[moving] ** 2
    return Equilibrium(x, force, q)


def static_compliance(wall):
    """Static compliance [m/N] of the wall behind the last contact; inf for a wall that drifts."""
    if wall is None:
        return 0.0
    moving = wall.phi != 0.0
    if wall.mobility > 0.0 or (wall.omega[moving] == 0.0).any():
        return np.inf
    modes = (wall.phi[moving] / wall.omega[moving]) ** 2
    return float(modes.sum() + wall.residual_compliance)


def _rest(chain, wall, stiffness, anchor, compliance):
    n, A, P = chain.mass.size, chain.A, float(chain.preload)
    carried = abs(P) + float(np.abs(stiffness * anchor).sum())
    held = stiffness > 0.0
    yields = wall is None or not np.isfinite(compliance)
    if not held.any() and (yields or P < 0.0):
        raise NoEquilibrium(
            f"a preload of {P:g} N finds no support; add leaf springs or a wall that holds it"
        )
    first = int(held.argmax()) if held.any() else n - 1  # spheres before it just touch
    overlap = (carried / A.min(initial=np.inf)) ** (2.0 / 3.0)
    x = np.where(held, anchor, overlap)
    walled = wall is not None and np.isfinite(compliance)
    contacts = np.ascontiguousarray(A if walled else A[: n - 1])[first:]
    floor = REGULAR * 1.5 * A.max(initial=0.0) * np.sqrt(overlap)
    bearing = (x[first:], contacts, stiffness[first:], anchor[first:], P)
    left = kernels.rest(*bearing, compliance if walled else 0.0, floor, 500)
    force = np.zeros(n + 1)
    kernels.static_residual(
        *bearing, compliance if walled else 0.0, force[first:], np.zeros(n - first)
    )
    if left > 1e-9 * carried:
        raise NoEquilibrium(
            f"no static state found: {left:.3g} N of {carried:.3g} N stay unbalanced; "
            "check preload, leaf springs and the wall's residual compliance"
        )
    if not walled and wall is not None and x[-1] > 0.0:
        raise NoEquilibrium(
            "the preload presses on a wall that nothing holds; fix the wall or remove the preload"
        )
    for i in range(n - 2, -1, -1):
        if not held[i] and force[i] == 0.0 and force[i + 1] == 0.0:
            x[i] = x[i + 1]
    return x, force[1 : A.size + 1]
