"""The ends of steps: from what is saved there, accelerations, their rates and those of the forces.

Of a contact with the overlap d, F = A d^(3/2) (1 + gamma w), with w = d' where nothing gives way
behind it:  F' = 3/2 A d^(1/2) w (1 + gamma w) + gamma A d^(3/2) w'.
"""

import math
from typing import NamedTuple

import numpy as np

from dem.kernels.arguments import Array, Saved
from dem.kernels.compiled import fastmath_entry, fastmath_inline

CONTACTS, WALL, GUIDES, DASHPOT = range(4)  # of StepEnds.slow; the first three are energies lost


class ChainAndWall(NamedTuple):
    """A chain and its wall; what is absent is 0."""

    inverse_mass: Array  # (n,)
    A: Array  # (n_contacts,)
    gamma: Array  # of Hunt and Crossley's damping
    load: Array  # (n,) that holds every sphere against its contacts at rest
    leaf: Array  # (n,) stiffness
    rest: Array  # (n,)
    phi: Array  # (n_modes,)
    stiffness: Array  # omega^2
    decay: Array  # 2 zeta omega
    static: Array  # (n_modes,) displacement at rest
    residual: float
    mobility: float
    rest_force: float  # at the wall


class Ends(NamedTuple):
    """Spheres, modes or slow quantities at the ends of steps, (k, m) each."""

    x: Array
    v: Array
    a: Array
    j: Array  # rate of the acceleration


class Gaps(NamedTuple):
    """Overlaps of the contacts at the ends of steps, (k, n_contacts), and their derivatives."""

    overlap: Array
    rate: Array
    bend: Array


class StepEnds(NamedTuple):
    """Everything that polynomials between the ends of steps need there."""

    spheres: Ends
    modes: Ends  # from their static state
    slow: Ends  # (k, 4) energies lost and the way of a dashpot
    gaps: Gaps
    force_rate: Array  # (k, n_contacts)


def empty_step_ends(saved: Saved) -> StepEnds:
    """Room for the derivatives at the ends of a march's steps."""
    k, n_modes = saved.speeds.shape
    shape = saved.force.shape
    x, v = saved.x, saved.v
    spheres = Ends(x, v, np.empty_like(x), np.empty_like(x))
    slow = Ends(*np.zeros((4, k, 4)))
    gaps = Gaps(np.empty(shape), np.empty(shape), np.empty(shape))
    modes = Ends(np.empty((k, n_modes)), saved.speeds, *np.empty((2, k, n_modes)))
    return StepEnds(spheres, modes, slow, gaps, np.empty(shape))


@fastmath_inline
def accelerate(k: int, saved: Saved, bodies: ChainAndWall, ends: StepEnds) -> float:
    """Accelerations of spheres and modes; that of the modes' wall comes out."""
    x, force, n = saved.x, saved.force, saved.x.shape[1]
    count = bodies.A.size
    previous = 0.0  # force between the spheres i - 1 and i
    for i in range(n):
        force_behind = force[k, i] if i < count else 0.0
        leaf_force = bodies.leaf[i] * (x[k, i] - bodies.rest[i])
        push = previous - force_behind + bodies.load[i] - leaf_force
        ends.spheres.a[k, i] = bodies.inverse_mass[i] * push
        previous = force_behind
    modes, wall = ends.modes, 0.0
    for m in range(bodies.phi.size):
        q = saved.modes[k, m] - bodies.static[m]
        a = bodies.phi[m] * (previous - bodies.rest_force) - bodies.stiffness[m] * q
        a -= bodies.decay[m] * saved.speeds[k, m]
        modes.x[k, m], modes.a[k, m] = q, a
        wall += bodies.phi[m] * a
    return wall


@fastmath_inline
def approach(k: int, wall_a: float, saved: Saved, bodies: ChainAndWall, ends: StepEnds) -> None:
    """Overlaps with their derivatives, the rates of the forces, and what the dampers take."""
    x, v, a, n = saved.x, saved.v, ends.spheres.a, saved.x.shape[1]
    power, rate = 0.0, 0.0
    for i in range(bodies.A.size):
        inner = i < n - 1
        gap = x[k, i] - (x[k, i + 1] if inner else saved.wall[k, 0])
        w = v[k, i] - (v[k, i + 1] if inner else saved.wall[k, 1])
        bend = a[k, i] - (a[k, i + 1] if inner else wall_a)
        s = 0.0 if inner else bodies.residual
        d = max(gap - s * saved.force[k, i], 0.0)
        root, A, gamma = math.sqrt(d), bodies.A[i], bodies.gamma[i]
        stiffness = 1.5 * A * root
        stiffness /= 1.0 + s * stiffness
        elastic, elastic_rate = A * d * root, stiffness * w
        share = 1.0 + gamma * w
        if share > 0.0:
            ends.force_rate[k, i] = elastic_rate * share + gamma * elastic * bend
            power += gamma * elastic * w * w
            rate += gamma * w * (2.0 * bend * elastic + w * elastic_rate)
        else:  # the damper takes all of the force
            ends.force_rate[k, i] = 0.0
            power -= elastic * w
            rate -= elastic_rate * w + elastic * bend
        ends.gaps.overlap[k, i], ends.gaps.rate[k, i], ends.gaps.bend[k, i] = gap, w, bend
    ends.slow.v[k, CONTACTS], ends.slow.a[k, CONTACTS] = power, rate


@fastmath_inline
def jerk(k: int, saved: Saved, bodies: ChainAndWall, ends: StepEnds) -> None:
    """Rates of the accelerations of spheres and modes; what the wall takes."""
    slow, count, modes = ends.slow, bodies.A.size, ends.modes
    previous = 0.0  # rate of the force between the spheres i - 1 and i
    for i in range(saved.x.shape[1]):
        rate_behind = ends.force_rate[k, i] if i < count else 0.0
        push = previous - rate_behind - bodies.leaf[i] * saved.v[k, i]
        ends.spheres.j[k, i] = bodies.inverse_mass[i] * push
        previous = rate_behind
    u, power, rate = 0.0, 0.0, 0.0
    for m in range(bodies.phi.size):
        p, a, decay = saved.speeds[k, m], modes.a[k, m], bodies.decay[m]
        modes.j[k, m] = bodies.phi[m] * previous - decay * a - bodies.stiffness[m] * p
        u += bodies.phi[m] * saved.modes[k, m]
        power += decay * p * p
        rate += 2.0 * decay * p * a
    if bodies.mobility > 0.0:
        force = saved.force[k, count - 1]
        slow.x[k, DASHPOT] = saved.wall[k, 0] - u
        slow.v[k, DASHPOT] = bodies.mobility * force
        slow.a[k, DASHPOT] = bodies.mobility * previous
        power += bodies.mobility * force * force
        rate += 2.0 * bodies.mobility * force * previous
    slow.v[k, WALL], slow.a[k, WALL] = power, rate


@fastmath_entry
def fill_ends(saved: Saved, bodies: ChainAndWall, h: float, ends: StepEnds) -> None:
    """Derivatives at the ends of steps h, from what a march has saved there, into `ends`."""
    slow, steps = ends.slow, saved.x.shape[0] - 1
    for k in range(steps + 1):
        wall_a = accelerate(k, saved, bodies, ends)
        approach(k, wall_a, saved, bodies, ends)
        jerk(k, saved, bodies, ends)
        for i in range(3):
            slow.x[k, i] = saved.energy[k, 5 + i]
    for k in range(steps + 1):
        first, last = max(k - 1, 0), min(k + 1, steps)
        for i in range(4):
            slow.j[k, i] = (slow.a[last, i] - slow.a[first, i]) / ((last - first) * h)
