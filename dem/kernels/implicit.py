"""Implicit march: in each part h = b_s dt of a step every contact acts with its mean force.

Spheres and modes answer a constant force exactly, so energy is kept to rounding (discrete gradient
of O. Gonzalez, J. Nonlinear Sci. 6 (1996) 449, contact by contact):

    x_i = free_i + compliance_i (F_{i-1} - F_i + load_i),   F_i = (U(d_1) - U(d_0)) / (d_1 - d_0)

with the potential U of a contact and its overlaps d_0, d_1 at both ends; the last body is the wall.
Newton's method solves for the positions, in O(n) as its tangent is tridiagonal.
"""

import math
from typing import NamedTuple

import numpy as np

from beadwave.dem.kernels.arguments import (
    DASH,
    IN_CONTACTS,
    IN_WALL,
    WORK,
    Array,
    ChainArrays,
    Damping,
    ForceShape,
    LeafSprings,
    Motion,
    SavedStates,
    Steps,
    U,
    V,
    WallModes,
)
from beadwave.dem.kernels.compiled import ieee, ieee_inline, ieee_march
from beadwave.dem.kernels.laws import (
    STOPPED,
    contact_stiffness,
    elastic_force,
    elastic_indentation,
    grows,
    mean_elastic,
    mean_stiffness,
    never_pulls,
    spring_share,
    stored_energy,
)
from beadwave.dem.kernels.ledger import save

LEAD = 55.0  # in `lead`: a damper of z = 4 leaves exp(-4) of the velocity


class StepStates(NamedTuple):
    """Spheres and the wall over a part of a step, (n + 1,) each."""

    start: Array  # [m] position at the start
    end: Array  # and the one sought
    free: Array  # [m] where it goes without contact
    compliance: Array  # [m/N] what a mean force adds
    speed: Array  # [m/s] at the start


class Newton(NamedTuple):
    """Workspace of a Newton iteration."""

    elastic: Array  # (n_contacts,) [N] part of the mean force
    slope: Array  # (n + 1,) [N/m] of the mean force in the overlap, 0 behind the last contact
    residual: Array  # (n + 1,) [m] what the equations miss, then the change of positions
    diagonal: Array  # (n + 1,) of the tangent
    upper: Array  # (n + 1,) of the tangent
    change: Array  # (n + 1,) [m] of the positions in the last iteration


class Passage(NamedTuple):
    """A contact over a part of a step."""

    i: int
    last: bool  # is it that at the wall?
    g0: float  # [m] overlap before
    g1: float  # [m] and after
    w0: float  # [m/s] approach velocity before
    compliance: float  # [m/N] of both bodies, by which a mean force moves them apart


def workspace(n: int, n_contacts: int) -> tuple[StepStates, Newton]:
    """Room for a part of a step of a chain of n spheres."""
    newton = Newton(np.empty(n_contacts), *np.zeros((5, n + 1)))
    return StepStates(*np.empty((5, n + 1))), newton


@ieee_march
def march_implicit(
    motion: Motion, snapshot: Motion, chain: ChainArrays, states: StepStates, newton: Newton,
    b: Array, steps: Steps, saved: SavedStates,
) -> int:  # fmt: skip
    """As `explicit.march`, by steps of the parts b[s] dt, with b (n_parts,) of sum 1.

    Friction of guides and yield have no mean force here, and are refused before.
    """
    dt, n_save, stride = steps
    f, wall, ledger = motion.f, motion.wall, motion.ledger
    last = f.size - 1
    for k in range(n_save + 1):
        for _step in range(stride if k > 0 else 0):
            for s in range(b.size):
                h = b[s] * dt

                # x_i = free_i + compliance_i (mean force), solved for positions and mean forces
                predict_spheres(s, h, motion, chain.mass, chain.leaf, states)
                predict_wall(s, h, wall, chain.offset, chain.mobility, chain.modes, states)
                implicit_step(h, f, chain, states, newton)

                # velocities and modes that these mean forces leave, and what the dampers take
                ledger[IN_CONTACTS] += damping_work(states, f, newton.elastic)
                update_spheres(s, h, motion, chain, chain.load, chain.leaf, states)
                update_modes(s, f[last], wall, chain.modes)
                update_dashpot(h, f[last], wall, ledger, chain.mobility)
        if not save(k, dt, snapshot, chain, saved, chain.mobility):
            return k
    return n_save


# --- where bodies go without contact -------------------------------------------------------------


@ieee_inline
def predict_spheres(
    s: int, h: float, motion: Motion, mass: Array, leaf: LeafSprings | None, states: StepStates
) -> None:
    """Write into `states` the motion of the spheres in the s-th part of a step, h [s], without
    contact, and what a mean force adds: h^2 / 2m of free flight, less on a leaf spring. mass (n,)
    [kg]."""
    x, v = motion.x, motion.v
    for i in range(x.size):
        states.start[i] = x[i]
        states.speed[i] = v[i]
        if leaf is None:
            states.free[i] = x[i] + h * v[i]
            states.compliance[i] = 0.5 * h * h / mass[i]
        else:
            rest, swing = leaf.rest, leaf.propagator
            states.free[i] = rest[i] + swing[s, 0, i] * (x[i] - rest[i]) + swing[s, 1, i] * v[i]
            states.compliance[i] = leaf.step_response[s, i] / mass[i]


@ieee_inline
def predict_wall(
    s: int, h: float, wall: Array, offset: float, mobility: float | None, modes: WallModes | None,
    states: StepStates,
) -> None:  # fmt: skip
    """Write into `states` the motion of the wall in the s-th part of a step, h [s], without
    contact, and what a mean force adds: phi^2 times the step response of each mode, and what the
    dashpot gives way by. wall (4,), offset [m] of the wall at rest, mobility [m/(N s)]."""
    free, compliance = states.free, states.compliance
    n = free.size - 1
    states.start[n] = wall[U] + wall[DASH] + offset
    states.speed[n] = wall[V]
    free[n], compliance[n] = states.start[n], 0.0
    if modes is not None:
        q, p, phi, E, response = (
            modes.q, modes.p, modes.phi, modes.propagator, modes.step_response,
        )  # fmt: skip
        free[n] -= wall[U]
        for j in range(q.size):
            q_free = E[s, 0, j] * q[j] + E[s, 1, j] * p[j]
            free[n] += phi[j] * (q_free - response[s, j] * phi[j] * modes.rest_force)
            compliance[n] += phi[j] ** 2 * response[s, j]
    if mobility is not None:
        compliance[n] += mobility * h


# --- mean contact forces by Newton's method, in O(n) ---------------------------------------------


@ieee_inline
def implicit_step(
    dt: float, f: Array, chain: ChainArrays, states: StepStates, newton: Newton
) -> None:
    """Positions at the end of dt [s] that the mean contact forces f (n + 1,) [N] lead to, by
    Newton's method; a step that leaves more residual than before is halved. Ends where the residual
    is 0 or no step, however short, makes it less: at rounding."""
    x0, x1, free, compliance, _ = states
    r, change = newton.residual, newton.change
    for i in range(x1.size):
        x1[i] = free[i]
    norm = math.inf
    share = 1.0
    for _ in range(200):
        new_norm = imbalance(
            dt, f, chain, chain.shape, chain.load, chain.residual, chain.damping, (states, newton)
        )

        # worse than before: back by half of the step, unless that is rounding of the positions
        if new_norm >= norm and share > 1e-9:
            share *= 0.5
            for i in range(x1.size):
                x1[i] -= share * change[i]
            rounding = max(1e-15 * largest(x1, x0), 1e-16 * largest(x1, None))
            if share * largest(change, None) > rounding:
                continue
            break
        if new_norm == 0.0 or share <= 1e-9:
            break

        # better: the next step, whole
        norm = new_norm
        share = 1.0
        newton_change(compliance, newton)
        for i in range(x1.size):
            change[i] = r[i]
            x1[i] += r[i]


@ieee_inline
def imbalance(
    dt: float, f: Array, chain: ChainArrays, shape: ForceShape | None, load: Array,
    residual: float | None, damping: Damping | None, room: tuple[StepStates, Newton],
) -> float:  # fmt: skip
    """Fill forces f (n + 1,) [N], slopes and what the equations miss at the positions at the end of
    dt [s]; the sum of its squares [m^2]. load (n,) [N], residual [m/N]."""
    (x0, x1, free, compliance, speed), newton = room
    n = x0.size - 1
    per_dt = 1.0 / dt  # a division in every contact would be half the price of the damping
    for i in range(chain.A.size):
        over = Passage(
            i, i == n - 1, x0[i] - x0[i + 1], x1[i] - x1[i + 1], speed[i] - speed[i + 1],
            compliance[i] + compliance[i + 1],
        )  # fmt: skip
        f[i + 1], newton.slope[i], newton.elastic[i] = mean_force(
            over, per_dt, chain.A, shape, residual, damping
        )
    square = 0.0
    for i in range(n + 1):
        net = f[i] - (f[i + 1] if i < n else 0.0)
        if i < n:
            net += load[i]
        newton.residual[i] = free[i] + compliance[i] * net - x1[i]
        square += newton.residual[i] * newton.residual[i]
    return square


@ieee_inline
def newton_change(compliance: Array, newton: Newton) -> None:
    """Solve the tridiagonal tangent system for the residual, in place; compliance (n + 1,) [m/N].

    Row i is  -c_i s_{i-1},  1 + c_i (s_{i-1} + s_i),  -c_i s_i  with compliances c and slopes s:
    diagonally dominant while no slope is negative, so that elimination needs no pivots.
    """
    slope, r, diagonal, upper = newton.slope, newton.residual, newton.diagonal, newton.upper
    n = compliance.size - 1
    for i in range(n + 1):
        previous = slope[i - 1] if i > 0 else 0.0
        diagonal[i] = 1.0 + compliance[i] * (previous + slope[i])
        upper[i] = -compliance[i] * slope[i]
    for i in range(1, n + 1):
        factor = -compliance[i] * slope[i - 1] / diagonal[i - 1]
        diagonal[i] -= factor * upper[i - 1]
        r[i] -= factor * r[i - 1]
    r[n] /= diagonal[n]
    for i in range(n - 1, -1, -1):
        r[i] = (r[i] - upper[i] * r[i + 1]) / diagonal[i]


@ieee
def largest(a: Array, b: Array | None) -> float:
    """Largest |a|, or |a - b|, of arrays (n,)."""
    largest_value = 0.0
    for i in range(a.size):
        difference = a[i] if b is None else a[i] - b[i]
        largest_value = max(largest_value, abs(difference))
    return largest_value


# --- mean force of a contact ---------------------------------------------------------------------


@ieee_inline
def mean_force(
    over: Passage, per_dt: float, A: Array, shape: ForceShape | None, residual: float | None,
    damping: Damping | None,
) -> tuple[float, float, float]:  # fmt: skip
    """Mean total force [N] of a contact over the step 1 / per_dt [s], its slope in g1 [N/m], its
    elastic part [N]. A (n_contacts,), residual [m/N].

    The damping part is c times the share of the step in which the contact is closed times a rate of
    approach, read in the middle of the step or, of a strong damper, later (`lead`). c is gamma, or
    gamma times the mean elastic force.
    """
    i, last, g0, g1, w0, compliance = over
    if residual is not None and last:
        elastic, slope = mean_series(i, g0, g1, residual, A, shape)
    else:
        elastic, slope = mean_elastic(i, g0, g1, A, shape)
    if damping is None:
        return elastic, slope, elastic

    # c = strength, and its slope in g1; less of it behind a spring in series
    gamma, law, inverse_mass = damping
    closed, closing = 1.0, 0.0
    strength, strengthening = gamma[i] * elastic, gamma[i] * slope
    if not grows(law):
        strength, strengthening = gamma[i], 0.0
        closed, closing = closed_share(g0, g1)
    if residual is not None and last:
        share, falling = spring_share(contact_stiffness(i, elastic, A, shape, None), residual)
        strength *= share
        strengthening *= share * (1.0 - falling)

    # c dt / m = c stops, of free bodies: beyond STOPPED it is capped, as nothing is left to stop
    stops = 2.0 * compliance * abs(per_dt)
    c = strength
    if c * stops > STOPPED:
        c, strengthening = STOPPED / stops, 0.0
    ahead, bend = 0.0, 0.0
    # 0.75 of the way of a free body: what springs hold more is not led, see `lead`
    if compliance * per_dt * per_dt > 0.75 * 0.5 * inverse_mass[i]:
        stops = math.copysign(stops, per_dt)
        ahead, bend = lead(c * stops)

    # under a constant force the rate is 2 mean - w0 at the end: it is read at the share
    # 1/2 + ahead of the step
    mean = (g1 - g0) * per_dt
    rate = mean + 2.0 * ahead * (mean - w0)
    force = elastic + c * closed * rate
    if never_pulls(law) and force <= 0.0:
        return 0.0, 0.0, elastic
    growth = c * (closed * (1.0 + 2.0 * ahead) * per_dt + closing * rate)
    growth += strengthening * (rate + 2.0 * c * stops * bend * (mean - w0))
    return force, slope + growth, elastic


@ieee
def mean_series(
    i: int, g0: float, g1: float, residual: float, A: Array, shape: ForceShape | None
) -> tuple[float, float]:
    """`mean_elastic` of contact i and a spring of the compliance `residual` [m/N] in series, in
    terms of the gap [m] of both; A (n_contacts,). NaN as of `elastic_indentation`.

    Both hold U + s F^2 / 2, and the gap changes by 1 + s K times the change of the overlap, with
    the secant stiffness K of the contact: the quotient of these changes, free of cancellation.
    """
    d0 = elastic_indentation(i, g0, residual, A, shape)
    d1 = elastic_indentation(i, g1, residual, A, shape)
    contact, slope = mean_elastic(i, d0, d1, A, shape)
    f0, f1 = elastic_force(i, d0, A, shape), elastic_force(i, d1, A, shape)
    if d0 > 0.0 and d1 > 0.0:
        secant = mean_stiffness(i, d0, d1, A, shape)
        stretch = 1.0 + residual * secant
        mean = (contact + 0.5 * residual * (f0 + f1) * secant) / stretch
        return mean, slope / stretch
    if d0 <= 0.0 and d1 <= 0.0:
        return 0.0, 0.0

    # one end is open: energies of like size are not subtracted
    stored = stored_energy(i, d1, f1, A, shape) - stored_energy(i, d0, f0, A, shape)
    stored += 0.5 * residual * (f1 * f1 - f0 * f0)
    mean = stored / (g1 - g0)
    return mean, (f1 - mean) / (g1 - g0) if g1 > 0.0 else -mean / (g1 - g0)


@ieee_inline
def closed_share(g0: float, g1: float) -> tuple[float, float]:
    """Share of a step in which a contact of the overlap g0, then g1 [m], is closed, taken linear in
    time, and its slope in g1 [1/m]."""
    if g0 > 0.0 and g1 > 0.0:
        return 1.0, 0.0
    if g0 <= 0.0 and g1 <= 0.0:
        return 0.0, 0.0
    per = 1.0 / abs(g1 - g0)
    return max(g0, g1) * per, abs(g0) * per * per


@ieee_inline
def lead(z: float) -> tuple[float, float]:
    """Distance past the middle of a step at which a damper of z, its rate times the step, reads the
    velocity: read in the middle, a strong one would throw two bodies back with the speed that it
    takes from them. 0 for a weak one, which keeps the order and the symmetry of the step, 1/2 for
    one that stops them within the step, between them about what leaves exp(-z). Also its slope in
    z."""
    square = z * z
    cube = abs(z) * square
    share = 1.0 / (cube + LEAD)
    return 0.5 * z * square * share, 1.5 * LEAD * square * share * share


# --- the end of a part of a step -----------------------------------------------------------------


@ieee_inline
def update_spheres(
    s: int, h: float, motion: Motion, chain: ChainArrays, load: Array,
    leaf: LeafSprings | None, states: StepStates,
) -> None:  # fmt: skip
    """Positions and velocities at the end of the s-th part of a step, h [s], under the mean forces
    `motion.f`; load (n,) [N]."""
    x, v, f, _, _ = motion
    for i in range(x.size):
        net = f[i] - f[i + 1] + load[i]
        if leaf is None:
            v[i] += h * net / chain.mass[i]
        else:
            rest, swing = leaf.rest, leaf.propagator
            swung = swing[s, 2, i] * (x[i] - rest[i]) + swing[s, 0, i] * v[i]
            v[i] = swung + swing[s, 1, i] * net / chain.mass[i]
        x[i] = states.end[i]


@ieee_inline
def update_modes(s: int, force: float, wall: Array, modes: WallModes | None) -> None:
    """Modes at the end of the s-th part of a step under a mean force [N] at the wall (4,), and its
    work on them."""
    if modes is None:
        return
    q, p, phi, E, response = (
        modes.q, modes.p, modes.phi, modes.propagator, modes.step_response,
    )  # fmt: skip
    net = force - modes.rest_force
    u = 0.0
    w = 0.0
    for j in range(q.size):
        q_old, speed, kick = q[j], p[j], phi[j] * net
        q[j] = E[s, 0, j] * q_old + E[s, 1, j] * speed + response[s, j] * kick
        p[j] = E[s, 2, j] * q_old + E[s, 3, j] * speed + E[s, 1, j] * kick
        u += phi[j] * q[j]
        w += phi[j] * p[j]
    wall[WORK] += net * (u - wall[U])
    wall[U], wall[V] = u, w


@ieee_inline
def update_dashpot(
    h: float, force: float, wall: Array, ledger: Array, mobility: float | None
) -> None:
    """Way of the dashpot in h [s] under a mean force [N], and the energy that it takes; wall (4,),
    ledger (3,), mobility [m/(N s)]."""
    if mobility is not None:
        wall[DASH] += mobility * h * force
        ledger[IN_WALL] += mobility * h * force * force


@ieee_inline
def damping_work(states: StepStates, f: Array, elastic: Array) -> float:
    """Work [J] that the damping parts of the mean forces f (n + 1,) [N] take from the contacts: f
    less its elastic part (n_contacts,) times the change of the overlap."""
    x0, x1 = states.start, states.end
    lost = 0.0
    for i in range(elastic.size):
        change = (x1[i] - x1[i + 1]) - (x0[i] - x0[i + 1])
        lost += (f[i + 1] - elastic[i]) * change
    return lost
