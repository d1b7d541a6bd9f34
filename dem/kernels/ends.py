"""The ends of steps: from what is saved there, accelerations, their rates and those of the forces.

Of a contact with the overlap d, F = A d^(3/2) (1 + gamma w), with w = d' where nothing gives way
behind it:  F' = 3/2 A d^(1/2) w (1 + gamma w) + gamma A d^(3/2) w'.
"""

import math
from typing import NamedTuple

import numpy as np

from beadwave.dem.kernels.arguments import Array, SavedStates
from beadwave.dem.kernels.compiled import fastmath_inline

CONTACTS, WALL, GUIDES, DASHPOT = range(4)  # of StepEnds.slow; the first three are energies lost


class ChainAndWall(NamedTuple):
    """A chain and its wall; what is absent is 0."""

    inverse_mass: Array  # (n,) [1/kg]
    A: Array  # (n_contacts,) [N/m^1.5]
    gamma: Array  # (n_contacts,) [s/m] of Hunt and Crossley's damping
    load: Array  # (n,) [N] that holds every sphere against its contacts at rest
    leaf: Array  # (n,) [N/m] stiffness
    rest: Array  # (n,) [m]
    phi: Array  # (n_modes,) [kg^-1/2]
    stiffness: Array  # (n_modes,) [1/s^2] omega^2
    decay: Array  # (n_modes,) [1/s] 2 zeta omega
    static: Array  # (n_modes,) [kg^1/2 m] displacement at rest
    residual: float  # [m/N]
    mobility: float  # [m/(N s)]
    rest_force: float  # [N] at the wall


class Ends(NamedTuple):
    """Spheres, modes or slow quantities at the ends of steps, (k, m) each."""

    x: Array
    v: Array
    a: Array
    j: Array  # rate of the acceleration


class Gaps(NamedTuple):
    """Overlaps of the contacts at the ends of steps, (k, n_contacts) [m], and their first and
    second derivative by time; at the wall that of contact and spring together."""

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


def empty_step_ends(saved: SavedStates) -> StepEnds:
    """Room for the derivatives at the k ends of a march's steps; positions and velocities of the
    spheres and speeds of the modes are those of `saved`, not copied."""
    k, n_modes = saved.speeds.shape
    shape = saved.force.shape
    x, v = saved.x, saved.v
    spheres = Ends(x, v, np.empty_like(x), np.empty_like(x))
    slow = Ends(*np.zeros((4, k, 4)))
    gaps = Gaps(np.empty(shape), np.empty(shape), np.empty(shape))
    modes = Ends(np.empty((k, n_modes)), saved.speeds, *np.empty((2, k, n_modes)))
    return StepEnds(spheres, modes, slow, gaps, np.empty(shape))


@fastmath_inline
def fill_ends(saved: SavedStates, bodies: ChainAndWall, h: float, ends: StepEnds) -> None:
    """Derivatives at the ends of steps h [s], from what a march has saved there, into `ends`.

    Energies lost and the way of the dashpot (`slow`) have power and rate in closed form; the third
    derivative that the polynomials take as well is a central difference of the second.
    """
    # names for arrays: each field that is read hands the compiler the whole tuple once more
    x, v, force, wall, energy, q, p = saved
    inverse_mass, A, gamma, load, leaf, rest, phi, stiffness, decay, static, s, mobility, f_rest = (
        bodies
    )
    spheres, modes, slow, gaps, force_rate = ends
    a, j, q_off, a_modes, j_modes = spheres.a, spheres.j, modes.x, modes.a, modes.j
    lost, lost_v, lost_a, lost_j = slow
    overlap, approach, bend = gaps
    n, count, n_modes, last = x.shape[1], A.size, phi.size, x.shape[0] - 1
    for k in range(last + 1):
        # accelerations of spheres and modes, and that of the modes' wall
        previous = 0.0  # force between the spheres i - 1 and i
        for i in range(n):
            behind = force[k, i] if i < count else 0.0
            push = previous - behind + load[i] - leaf[i] * (x[k, i] - rest[i])
            a[k, i] = inverse_mass[i] * push
            previous = behind
        wall_a = 0.0
        for m in range(n_modes):
            q_off[k, m] = q[k, m] - static[m]
            acceleration = phi[m] * (previous - f_rest) - stiffness[m] * q_off[k, m]
            a_modes[k, m] = acceleration - decay[m] * p[k, m]
            wall_a += phi[m] * a_modes[k, m]

        # overlaps with their derivatives, the rates of the forces, and what the dampers take
        power, rate = 0.0, 0.0
        for i in range(count):
            if i < n - 1:
                gap, w = x[k, i] - x[k, i + 1], v[k, i] - v[k, i + 1]
                w_rate, series = a[k, i] - a[k, i + 1], 0.0
            else:
                gap, w = x[k, i] - wall[k, 0], v[k, i] - wall[k, 1]
                w_rate, series = a[k, i] - wall_a, s
            # behind a residual spring s the overlap is gap - s F, the tangent k / (1 + s k)
            d = gap - series * force[k, i]
            d = d if d > 0.0 else 0.0
            tangent = 1.5 * A[i] * math.sqrt(d)
            tangent /= 1.0 + series * tangent
            elastic, elastic_rate = A[i] * d * math.sqrt(d), tangent * w
            share = 1.0 + gamma[i] * w
            if share > 0.0:
                force_rate[k, i] = elastic_rate * share + gamma[i] * elastic * w_rate
                power += gamma[i] * elastic * w * w
                rate += gamma[i] * w * (2.0 * w_rate * elastic + w * elastic_rate)
            else:  # the damper takes all of the force
                force_rate[k, i] = 0.0
                power -= elastic * w
                rate -= elastic_rate * w + elastic * w_rate
            overlap[k, i], approach[k, i], bend[k, i] = gap, w, w_rate
        lost_v[k, CONTACTS], lost_a[k, CONTACTS] = power, rate

        # rates of the accelerations of spheres and modes, and what the wall takes
        previous = 0.0  # rate of the force between the spheres i - 1 and i
        for i in range(n):
            behind = force_rate[k, i] if i < count else 0.0
            j[k, i] = inverse_mass[i] * (previous - behind - leaf[i] * v[k, i])
            previous = behind
        u, power, rate = 0.0, 0.0, 0.0
        for m in range(n_modes):
            speed, acceleration = p[k, m], a_modes[k, m]
            jerk = phi[m] * previous - decay[m] * acceleration - stiffness[m] * speed
            j_modes[k, m] = jerk
            u += phi[m] * q[k, m]
            power += decay[m] * speed * speed
            rate += 2.0 * decay[m] * speed * acceleration
        if mobility > 0.0:
            pushing = force[k, count - 1]
            lost[k, DASHPOT] = wall[k, 0] - u
            lost_v[k, DASHPOT] = mobility * pushing
            lost_a[k, DASHPOT] = mobility * previous
            power += mobility * pushing * pushing
            rate += 2.0 * mobility * pushing * previous
        lost_v[k, WALL], lost_a[k, WALL] = power, rate
        for i in range(3):
            lost[k, i] = energy[k, 5 + i]

    for k in range(last + 1):
        first, end = k - 1 if k > 0 else 0, k + 1 if k < last else last
        for i in range(4):
            lost_j[k, i] = (lost_a[end, i] - lost_a[first, i]) / ((end - first) * h)
