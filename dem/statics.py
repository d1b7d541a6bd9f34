"""The static state under weight, preload and leaf springs: where spheres and wall start from.

    f_{i-1} - f_i - k_i (x_i - a_i) + m_i g = 0,     f_i = A_i d_i^(3/2),     preload on the last

A column that leans on a wall is statically determinate: each contact carries all that is above it.
All other states are found by Newton's method. Contacts that are open have no stiffness, so that the
tangent would be singular; a small stiffness is added to it, which changes the path of the
iterations and not their end.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from beadwave.dem.chain import Chain, validate
from beadwave.dem.elastic import ElasticLaw
from beadwave.dem.kernels.arguments import Array
from beadwave.dem.kernels.equilibrium import Bearing, NewtonRoom, rest
from beadwave.dem.walls import Wall, static_compliance


class NoEquilibrium(ValueError):
    """No static state carries the weight, the preload or the leaf springs."""


class Equilibrium(NamedTuple):
    """Static state: sphere positions, contact forces, displacement of each wall mode."""

    x: Array  # (n,) [m]
    force: Array  # (n_contacts,) [N]
    q: Array  # (n_modes,) [kg^1/2 m]


def equilibrium(chain: Chain, wall: Wall | None) -> Equilibrium:
    """Static state under weight, preload and leaf springs; spheres that nothing presses, and those
    in flight, just touch the next.

    Raises InvalidChain; NoEquilibrium where nothing carries a force, as of a preload on a free
    chain or a wall that drifts, or where Newton's method finds no balance.
    """
    validate(chain, wall, np.zeros(np.size(chain.mass)))
    return static_state(chain, wall)


def static_state(chain: Chain, wall: Wall | None) -> Equilibrium:
    """`equilibrium` of a validated chain and wall; raises NoEquilibrium."""
    n = chain.mass.size
    n_modes = 0 if wall is None else wall.omega.size
    stiffness, anchor = chain.springs
    steady = chain.steady
    steady[: chain.n_falling] = 0.0
    if not steady.any() and not (stiffness * anchor).any():
        return Equilibrium(np.zeros(n), np.zeros(chain.A.size), np.zeros(n_modes))
    compliance = static_compliance(wall)

    # a column that weight and preload press on a wall: every contact carries what is above it
    carried = np.cumsum(steady)
    column = wall is not None and (carried >= 0.0).all() and not stiffness.any()
    if column and 0.0 <= compliance < np.inf:
        x, force = _pressed(chain.elastic, carried, compliance), carried
    else:
        # what carries the forces otherwise: leaf springs, or a wall that holds
        sprung = stiffness > 0.0
        walled = wall is not None and bool(np.isfinite(compliance))
        pressing = f"a preload of {chain.preload:g} N"
        if chain.gravity:
            weight = abs(chain.gravity) * np.sum(chain.mass[chain.n_falling :])
            preload = f" and {pressing}" if chain.preload else ""
            pressing = f"a weight of {weight:g} N{preload}"
        if not sprung.any() and (not walled or (np.cumsum(steady) < 0.0).any()):
            if walled and chain.gravity < 0.0:
                raise NoEquilibrium(
                    f"a weight of {weight:g} N pulls the spheres off the wall, where a preload "
                    "presses the last one alone; add leaf springs"
                )
            raise NoEquilibrium(
                f"nothing supports {pressing}; add leaf springs or a wall that holds it"
            )
        x, force = _balance(chain, n if walled else n - 1, steady, compliance)
        if not walled and wall is not None and x[-1] > 0.0:
            raise NoEquilibrium(
                f"{pressing} presses on a wall that nothing holds; fix the wall or remove the force"
            )

        # spheres that nothing presses or holds just touch the next
        for i in range(n - 2, -1, -1):
            if not sprung[i] and force[i] == 0.0 and force[i + 1] == 0.0:
                x[i] = x[i + 1]
        force = force[1 : chain.A.size + 1]

    q = np.zeros(n_modes)
    if n_modes and force[-1] > 0.0:
        moving = wall.phi != 0.0
        q[moving] = wall.phi[moving] * force[-1] / wall.omega[moving] ** 2
    return Equilibrium(x, force, q)


def approach(law: ElasticLaw, force: ArrayLike, compliance: ArrayLike) -> Array:
    """Way [m] of a body that a force [N] presses on a wall of a static compliance s [m/N], by a
    contact of this law:  delta(F) + s F; element by element, (..., n_contacts)."""
    return law.overlap(force) + np.multiply(compliance, force)


def largest_approach(law: ElasticLaw, compliance: float) -> Array:
    """Approach [m] of every contact (n_contacts,) at the fold  1 + s k = 0  of a wall of negative
    compliance s [m/N]: no force answers more. 4 / (27 (s A)^2) of Hertz' law."""
    return approach(law, law.force(law.fold(compliance)), compliance)


def _pressed(law, carried, compliance):
    """Positions (n,) of a column whose contacts carry these forces."""
    first, last = law.at(np.s_[:-1]), law.at(-1)
    gap = np.append(first.overlap(carried[:-1]), approach(last, carried[-1], compliance))
    return np.cumsum(gap[::-1])[::-1].copy()


def _balance(chain, n_contacts, steady, compliance):
    """Positions (n,) at which all forces balance, and the contact forces (n + 1,), 0 in front of
    the first sphere; of the first n_contacts contacts only."""
    law, (stiffness, anchor) = chain.elastic, chain.springs
    sprung = stiffness > 0.0
    n = sprung.size
    first = int(((steady != 0.0) | sprung).argmax())  # spheres before it just touch

    # start: on the anchors, or where one contact would carry all forces
    carried = float(np.abs(steady).sum()) + float(np.abs(stiffness * anchor).sum())
    overlap = law.overlap(carried).max(initial=0.0)
    x, force = np.where(sprung, anchor, overlap), np.zeros(n + 1)
    if n_contacts == n and compliance < 0:  # half of the largest approach that a force answers
        x = np.minimum(x, 0.5 * largest_approach(law.at(-1), compliance))
    bearing = Bearing(
        np.ascontiguousarray(chain.A[:n_contacts])[first:], stiffness[first:], anchor[first:],
        steady[first:], compliance if n_contacts == n else 0.0,
        law.at(np.s_[first:n_contacts]).shape,
    )  # fmt: skip

    # 1e-8 of a closed contact's stiffness keeps the tangent regular while contacts are open
    floor = 1e-8 * law.stiffness(overlap).max(initial=0.0)
    room = NewtonRoom(np.zeros(n - first + 1), *np.zeros((5, n - first)))
    unbalanced = rest(x[first:], bearing, floor, 500, room)
    pushed = np.cumsum(stiffness * anchor + steady)
    if not unbalanced <= 1e-9 * carried and n_contacts == n and (pushed[first:] > 0).all():
        # of a long chain: from where the springs' forces at x = 0 would press it
        x[:] = _pressed(law, np.maximum(pushed, 0), max(compliance, 0.0))
        room = NewtonRoom(np.zeros(n - first + 1), *np.zeros((5, n - first)))
        unbalanced = rest(x[first:], bearing, floor, 500, room)
    if not unbalanced <= 1e-9 * carried:
        raise NoEquilibrium(
            f"no static state found: {unbalanced:.3g} N of {carried:.3g} N stay unbalanced; "
            "check preload, leaf springs and the wall's residual compliance"
        )
    force[first:] = room.f
    return x, force
