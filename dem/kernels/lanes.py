"""Chains side by side in the lanes of vector registers: sphere i of lane l is i * LANES + l.

The march of `explicit` with its forces, dampers and corrections, written as loops over lanes. The
wall is one more sphere without mass, moved by its modes alone. Steps do not stop at the samples:
those lie on the polynomials of `dense`.
"""

import math
from typing import NamedTuple

import numpy as np

from beadwave.dem.kernels.arguments import Array, Correction, ForceShape
from beadwave.dem.kernels.compiled import (
    fastmath,
    fastmath_allocating,
    fastmath_allocating_march,
    fastmath_inline,
    ieee,
)
from beadwave.dem.kernels.dense import StepEnd, cubic, cubic_slope, quintic, quintic_slope
from beadwave.dem.kernels.events import missed_impulse
from beadwave.dem.kernels.laws import (
    STOPPED,
    contact_stiffness,
    damper_coefficient,
    damping_impulse,
    elastic_force,
    elastic_indentation,
    grows,
    never_pulls,
    spring_share,
    stored_energy,
)

LANES = 16
NO_GAP = 1e-300  # [m] below any, above what a root makes 0


class LaneSteps(NamedTuple):
    """Equal steps, and equal samples that need not lie at their ends."""

    h: float  # [s]
    n_steps: int
    n_save: int


class RestingForces(NamedTuple):
    """Static states and steady forces, (n_blocks, m, LANES) each; m = 0 where nothing acts."""

    rest: Array  # m = n: [m] of the spheres
    load: Array  # m = n: [N] balances the contact forces at rest
    wall_offset: Array  # m = 1: [m] of the wall at rest
    wall_force: Array  # m = 1: [N] at the wall at rest
    static: Array  # m = n_modes: [kg^1/2 m] of the modes at rest
    preload: Array  # m = 1: [N]
    weight: Array  # m = n: [N]; 0 without any
    stiffness: Array  # m = n: [N/m] of the leaf springs; 0 without any
    anchor: Array  # m = n: [m]


class WallSprings(NamedTuple):
    """Springs in series with the walls, (n_blocks, 1, LANES) each; (n_blocks, 0, LANES) without."""

    residual: Array  # [m/N]
    fold: Array  # [m^0.5] root of the indentation beyond which no force answers, or inf


class Dampers(NamedTuple):
    """Damping of the contacts, (n_blocks, n, LANES) each; n = 0 without any."""

    gamma: Array  # [N s/m], or [s/m] of Hunt and Crossley's law
    inverse_mass: Array  # [1/kg] of both bodies at a contact
    law: Array  # (n_blocks,) the same for all


class Blocks(NamedTuple):
    """Chains by LANES; (n_blocks, m, LANES) each."""

    v0: Array  # m = n: [m/s]
    mass: Array  # m = n: [kg]
    A: Array  # m = n: as `dem.elastic.ElasticLaw.A`, 0 behind the last sphere of a free chain
    shape: ForceShape | None  # of the force of the one block that there is then; None: Hertz
    phi: Array  # m = n_modes: [kg^-1/2]
    omega: Array  # m = n_modes: [rad/s]
    propagator: Array  # (n_blocks, n_drifts, 4, n_modes * LANES)
    resting: RestingForces
    swing: Array  # (n_blocks, n_drifts, 4, n * LANES) of the leaf springs; n = 0 without any
    springs: WallSprings
    dampers: Dampers


class SavedLanes(NamedTuple):
    """Saved values of every chain."""

    v: Array  # (n_blocks, n_save + 1, n_observed, LANES)
    wall_force: Array  # (n_blocks, n_save + 1, LANES)
    energy_error: Array  # (n_blocks, LANES) worst change over the energy at the start


class LaneDamping(NamedTuple):
    """Damping of one block's contacts, (n LANES,) each; n = 0 without any."""

    gamma: Array  # [N s/m], or [s/m] of Hunt and Crossley's law
    inverse_mass: Array  # [1/kg] of both bodies
    law: int
    lost: Array  # (LANES,) [J] so far
    rate: Array  # [N s/m] coefficient at the forces of now


class Lanes(NamedTuple):
    """One block: what moves, and what it is made of."""

    x: Array  # ((n + 1) LANES,) [m], the last row that of the wall
    v: Array  # ((n + 1) LANES,) [m/s]
    f: Array  # ((n + 1) LANES,) [N] elastic, in front of each sphere and of the wall
    q: Array  # (n_modes * LANES,) from rest
    p: Array  # (n_modes * LANES,)
    inverse_mass: Array  # ((n + 1) LANES,) [1/kg] 0 of the wall
    mass: Array  # (n LANES,) [kg]
    A: Array  # (n LANES,) as in `Blocks`
    shape: ForceShape | None  # of the elastic force; None: Hertz
    phi: Array  # (n_modes * LANES,)
    omega: Array  # (n_modes * LANES,)
    propagator: Array  # (n_drifts, 4, n_modes * LANES)
    resting: RestingForces  # (m LANES,) each
    swing: Array  # (n_drifts, 4, n LANES)
    springs: WallSprings  # (LANES,) each
    damping: LaneDamping


class WallPush(NamedTuple):
    """Impulses on the wall's modes, (LANES,)."""

    impulse: Array  # [N s] of the contact at the wall
    shift: Array  # [kg m] displacement times mass, of `correct_lanes`
    square: Array  # [1/kg] phi phi of each lane, velocity of the wall after unit impulse
    work: Array  # [J] on the modes so far
    pending: Array  # [N s] impulses that the modes get before they move on


class LaneEnds(NamedTuple):
    """Observed spheres, the last one and the wall at an end of a step, (rows, LANES) each; the
    last two rows are those of the last sphere and of the wall."""

    x: Array  # [m]
    v: Array  # [m/s]
    a: Array  # [m/s^2], unused of the wall, which moves on a cubic between the ends


@fastmath_allocating_march
def march_lanes(
    blocks: Blocks, a: Array, b: Array, correction: Correction | None, steps: LaneSteps,
    observed: Array, saved: SavedLanes,
) -> None:  # fmt: skip
    """March LANES chains side by side, block after block, into `saved`, by kicks b (n_kicks,) and
    drifts a (n_drifts,) of the step; observed (n_observed,) are indices of spheres.

    Raises nothing: a lane that is not finite keeps its NaN in velocities and energy error.
    """
    n_blocks, n = blocks.v0.shape[:2]
    size, modes = n * LANES, blocks.phi.shape[1] * LANES
    padded = size + LANES
    for block in range(n_blocks):
        mass = blocks.mass[block].reshape(size)
        minv, x, v = np.zeros(padded), np.zeros(padded), np.zeros(padded)
        minv[:size] = 1.0 / mass
        v[:size] = blocks.v0[block].reshape(size)
        resting = resting_of(blocks.resting, block)
        x[: resting.rest.size] = resting.rest
        lanes = Lanes(
            x, v, np.zeros(padded), np.zeros(modes), np.zeros(modes), minv, mass,
            blocks.A[block].reshape(size), blocks.shape,
            blocks.phi[block].reshape(modes),
            blocks.omega[block].reshape(modes), blocks.propagator[block], resting,
            blocks.swing[block], springs_of(blocks.springs, block),
            dampers_of(blocks.dampers, block),
        )  # fmt: skip
        if resting.wall_offset.size > 0:
            x[size:] = resting.wall_offset
        rows = SavedLanes(saved.v[block], saved.wall_force[block], saved.energy_error[block])
        march_block(lanes, a, b, correction, steps, observed, rows)


@fastmath_allocating
def march_block(
    lanes: Lanes, a: Array, b: Array, correction: Correction | None, steps: LaneSteps,
    observed: Array, saved: SavedLanes,
) -> None:  # fmt: skip
    """March one block by the kicks b (n_kicks,) and drifts a (n_drifts,) of `explicit`, and sample
    its steps at the observed spheres (n_observed,)."""
    dt, n_steps, n_save = steps

    # room for states, impulses and the ends of a step; total forces have an array of their own
    # where dampers act, as what is marched by is elastic
    x_old, v_old = np.zeros_like(lanes.x), np.zeros_like(lanes.v)
    zeros = np.zeros((5, LANES))
    wall = WallPush(zeros[0], zeros[1], zeros[2], zeros[3], zeros[4])
    squares_of_lanes(lanes.phi, wall.square)
    start, energy, scale = np.zeros(LANES), np.zeros(LANES), np.zeros(LANES)
    shape = (observed.size + 2, LANES)
    step_start = LaneEnds(np.zeros(shape), np.zeros(shape), np.zeros(shape))
    step_end = LaneEnds(np.zeros(shape), np.zeros(shape), np.zeros(shape))
    forces = np.zeros_like(lanes.f) if lanes.damping.gamma.size > 0 else lanes.f
    stale = n_save >= 0  # a literal True would compile what takes it once more

    # the start: energies that errors are relative to, and the first sample
    stale = note_fresh(dt, stale, lanes, forces, observed, step_end)
    energy_of_lanes(lanes, lanes.shape, wall.work, start)
    kinetic_energy(lanes, scale)
    k = sample_step(-1, 0, steps, step_end, step_end, lanes, saved)

    # only steps that pass a sample need their ends; whole numbers decide which, without rounding
    for step in range(n_steps):
        due = k * n_steps <= (step + 1) * n_save
        if due:
            stale = note_fresh(dt, stale, lanes, forces, observed, step_start)
        if correction is not None:
            x_old[:], v_old[:] = lanes.x, lanes.v
        stale = step_of_lanes(dt, stale, a, b, lanes, wall)
        stale |= correct_step_of_lanes(dt, lanes, x_old, v_old, correction, wall)
        if not due:
            continue
        stale = note_fresh(dt, stale, lanes, forces, observed, step_end)
        k = sample_step(step, k, steps, step_start, step_end, lanes, saved)
        energy_of_lanes(lanes, lanes.shape, wall.work, energy)
        note_energy(energy, start, scale, saved.energy_error)


@fastmath_inline
def note_fresh(
    dt: float, stale: bool, lanes: Lanes, forces: Array, observed: Array, end: LaneEnds
) -> bool:
    """`note_end` of the observed spheres (n_observed,) with total forces ((n + 1) LANES,) [N],
    after the elastic ones are brought up to date; whether they are stale now: no."""
    if stale:
        forces_of_lanes(lanes.x, lanes.A, lanes.shape, lanes.springs, lanes.f)
    if lanes.damping.gamma.size > 0:
        damped_forces(dt, lanes, forces)
    note_end(lanes, forces, observed, end)
    return observed.size < 0


@fastmath
def note_energy(energy: Array, start: Array, scale: Array, worst: Array) -> None:
    """Largest change of the energy from that at the start, over the scale, into worst so far;
    (LANES,) each."""
    for lane in range(LANES):
        change = abs(energy[lane] - start[lane]) / scale[lane]
        if not change <= worst[lane]:  # keeps a NaN
            worst[lane] = change


# --- a step: kicks and drifts --------------------------------------------------------------------


@fastmath_inline
def step_of_lanes(dt: float, stale: bool, a: Array, b: Array, lanes: Lanes, wall: WallPush) -> bool:
    """A step of dt [s] by kicks b (n_kicks,) and drifts a (n_drifts,), as `explicit.march` takes
    it; are the forces stale at the end?"""
    for i in range(b.size):
        if b[i] != 0.0:
            if stale:
                forces_of_lanes(lanes.x, lanes.A, lanes.shape, lanes.springs, lanes.f)
            if lanes.damping.gamma.size > 0:
                damped_kick(b[i] * dt, lanes, wall)
            else:
                kick_lanes(b[i] * dt, lanes, wall)
            stale = False
        if i < a.size and a[i] != 0.0:
            drift_lanes(i, a[i] * dt, lanes, wall)
            stale = True
    return stale


@fastmath_inline
def kick_lanes(kick: float, lanes: Lanes, wall: WallPush) -> None:
    """v_i <- v_i + kick (f_{i-1} - f_i + load_i) / m_i, and the impulse at the wall."""
    v, f, minv, load = lanes.v, lanes.f, lanes.inverse_mass, lanes.resting.load
    size = lanes.A.size
    for j in range(size):
        v[j] += kick * minv[j] * (f[j] - f[j + LANES])
    for j in range(load.size):
        v[j] += kick * minv[j] * load[j]
    if lanes.q.size > 0:
        for lane in range(LANES):
            wall.impulse[lane] = kick * f[size + lane]
        for lane in range(lanes.resting.wall_force.size):
            wall.impulse[lane] -= kick * lanes.resting.wall_force[lane]
        push_walls(lanes.v, wall)


@fastmath
def damped_kick(kick: float, lanes: Lanes, wall: WallPush) -> None:
    """Damping between two halves of the elastic kick [s], in the order of `explicit.flow`: half of
    the even contacts, the odd ones, the other half of the even ones."""
    kick_lanes(0.5 * kick, lanes, wall)
    rate_dampers(lanes)
    for first, share in ((0, 0.5), (1, 1.0), (0, 0.5)):
        damp_lanes(first, share * kick, lanes, wall)
    kick_lanes(0.5 * kick, lanes, wall)


@fastmath_inline
def drift_lanes(i: int, drift: float, lanes: Lanes, wall: WallPush) -> None:
    """The i-th drift: free flight or the swing on leaf springs; modes exactly."""
    x, v, rest = lanes.x, lanes.v, lanes.resting.rest
    if lanes.swing.shape[2] > 0:
        E = lanes.swing[i]
        for j in range(lanes.A.size):
            u = x[j] - rest[j]
            x[j] = rest[j] + E[0, j] * u + E[1, j] * v[j]
            v[j] = E[2, j] * u + E[3, j] * v[j]
    else:
        for j in range(lanes.A.size):
            x[j] += drift * v[j]
    if lanes.q.size > 0:
        push_modes_of_lanes(wall.pending, lanes.p, lanes.phi)
        wall.pending[:] = 0.0
        drift_modes_of_lanes(lanes.q, lanes.p, lanes.propagator[i])
        read_modes_of_lanes(lanes)


@fastmath
def drift_modes_of_lanes(q: Array, p: Array, E: Array) -> None:
    """Exact free motion (q, p) <- E (q, p), q and p (n_modes LANES,), E (4, n_modes LANES)."""
    for j in range(q.size):
        q_new = E[0, j] * q[j] + E[1, j] * p[j]
        p[j] = E[2, j] * q[j] + E[3, j] * p[j]
        q[j] = q_new


@fastmath
def read_modes_of_lanes(lanes: Lanes) -> None:
    """The modes' displacement and velocity into those of the wall."""
    q, p, phi = lanes.q, lanes.p, lanes.phi
    u, w = lanes.x[lanes.A.size :], lanes.v[lanes.A.size :]
    u[:] = 0.0
    w[:] = 0.0
    for lane in range(lanes.resting.wall_offset.size):
        u[lane] = lanes.resting.wall_offset[lane]
    for j in range(0, q.size, LANES):
        for lane in range(LANES):
            u[lane] += phi[j + lane] * q[j + lane]
            w[lane] += phi[j + lane] * p[j + lane]


# --- contact forces ------------------------------------------------------------------------------


@fastmath
def forces_of_lanes(
    x: Array, A: Array, shape: ForceShape | None, springs: WallSprings, f: Array
) -> None:
    """Elastic forces [N] at x ((n + 1) LANES,) into f[LANES:], f ((n + 1) LANES,); A (n LANES,)."""
    for j in range(A.size):
        d = x[j] - x[j + LANES]
        f[j + LANES] = elastic_force(j, d if d > 0.0 else 0.0, A, shape)

    # at a wall with a spring in series the overlap is less than the gap
    if springs.residual.size > 0:
        last = A.size - LANES
        if shape is None:
            spring_forces(x[last:], A[last:], springs, f[A.size :])
        else:
            for lane in range(LANES):
                j = last + lane
                d = elastic_indentation(j, x[j] - x[j + LANES], springs.residual[lane], A, shape)
                f[j + LANES] = elastic_force(j, d, A, shape)


@fastmath
def spring_forces(x: Array, A: Array, springs: WallSprings, f: Array) -> None:
    """Forces f (LANES,) [N] at walls with springs in series, where f is that without them; x
    (2 LANES,) [m] of the last spheres and the walls, A (LANES,).

    `hertz_indentation` of all lanes at once; f has the roots of the indentations meanwhile.
    """
    s, fold = springs
    touching = 0.0
    for lane in range(LANES):
        touching += f[lane]
    if touching == 0.0:
        return

    # open lanes take part with a gap of NO_GAP: no branch parts the lanes of a register
    for lane in range(LANES):
        root = math.sqrt(max(x[lane] - x[lane + LANES], NO_GAP))
        f[lane] = root / math.sqrt(max(1.0 + s[lane] * A[lane] * root, 1.0 / 3.0))
    for _ in range(60):
        moved = 0.0
        for lane in range(LANES):
            e, y = s[lane] * A[lane], f[lane]
            gap = max(x[lane] - x[lane + LANES], NO_GAP)
            change = (gap - y * y * (1.0 + e * y)) / (y * (2.0 + 3.0 * e * y))
            # 0.999999 of the way to where no force answers
            f[lane] = min(y + change, 0.999999 * fold[lane])
            # 1e-9: change of a root after which the next one is below rounding
            moved += 1.0 if abs(change) > 1e-9 * y else 0.0
        if moved == 0.0:
            break
    for lane in range(LANES):
        gap, y = x[lane] - x[lane + LANES], f[lane]
        force = A[lane] * y * y * y
        beyond = 3.0 * gap >= fold[lane] * fold[lane]
        f[lane] = math.nan if beyond else force if gap > 0.0 else 0.0


# --- dampers -------------------------------------------------------------------------------------


@fastmath
def damp_lanes(first: int, dt: float, lanes: Lanes, wall: WallPush) -> None:
    """`damp_contacts` for lanes: every second contact, from `first` on, over dt [s]."""
    v, minv, impulse = lanes.v, lanes.inverse_mass, wall.impulse
    _, inverse_mass, _, lost, rate = lanes.damping
    for row in range(first * LANES, lanes.A.size, 2 * LANES):
        total = 0.0
        for lane in range(LANES):
            total += rate[row + lane]
        if total == 0.0:
            continue
        damping_impulses(row, dt, lanes, impulse)
        # each loop writes one array: more would have to be looked at for overlaps
        for lane in range(LANES):
            j = row + lane
            w = v[j] - v[j + LANES] - 0.5 * inverse_mass[j] * impulse[lane]
            lost[lane] += impulse[lane] * w
        for lane in range(LANES):
            v[row + lane] -= minv[row + lane] * impulse[lane]
        for lane in range(LANES):
            v[row + LANES + lane] += minv[row + LANES + lane] * impulse[lane]
        if row + LANES == lanes.A.size and lanes.q.size > 0:
            push_walls(v, wall)


@fastmath
def rate_dampers(lanes: Lanes) -> None:
    """Coefficients [N s/m] of the dampers of all contacts at the elastic forces that are there,
    `laws.damper` for lanes."""
    f, residual, (gamma, _, law, _, rate) = lanes.f, lanes.springs.residual, lanes.damping
    size = gamma.size
    if grows(law):
        for j in range(size):
            rate[j] = gamma[j] * f[j + LANES]
    else:
        for j in range(size):
            rate[j] = gamma[j] if f[j + LANES] > 0.0 else 0.0
    for lane in range(residual.size):
        j = size - LANES + lane
        if rate[j] > 0.0:
            rate[j] *= share_of_damper(j, f[size + lane], lanes.A, lanes.shape, residual[lane])


@ieee
def share_of_damper(
    j: int, force: float, A: Array, shape: ForceShape | None, residual: float
) -> float:
    """Share that a spring of the compliance `residual` [m/N] in series leaves of a damper under a
    force [N], see `spring_share`; A (n LANES,)."""
    return spring_share(contact_stiffness(j, force, A, shape, None), residual)[0]


@fastmath
def damping_impulses(row: int, dt: float, lanes: Lanes, impulse: Array) -> None:
    """`damping_impulse` (LANES,) [N s] of a row of contacts over dt [s]; all of them by a series if
    all are weak and none would pull."""
    v, f, damping = lanes.v, lanes.f, lanes.damping
    inverse_mass, rate, clipped = damping.inverse_mass, damping.rate, never_pulls(damping.law)
    strong = 0.0
    for lane in range(LANES):
        j = row + lane
        c, w = rate[j], v[j] - v[j + LANES]
        z = c * inverse_mass[j] * dt
        share = 1.0 / 40320.0 - z * (1.0 / 362880.0 - z * (1.0 / 3628800.0))
        share = 1.0 / 24.0 - z * (1.0 / 120.0 - z * (1.0 / 720.0 - z * (1.0 / 5040.0 - z * share)))
        impulse[lane] = c * w * dt * (1.0 - z * (0.5 - z * (1.0 / 6.0 - z * share)))
        pulls = 1.0 if c * w + f[j + LANES] < 0.0 else 0.0
        # 0.1: damping rate times step up to which ten terms of the exponential are exact
        strong += (1.0 if abs(z) > 0.1 else 0.0) + (pulls if clipped else 0.0)
    if strong == 0.0:
        return
    for lane in range(LANES):
        j = row + lane
        if rate[j] > 0.0:
            w = v[j] - v[j + LANES]
            impulse[lane] = damping_impulse(w, dt, f[j + LANES], rate[j], inverse_mass[j], clipped)


@fastmath
def damped_forces(dt: float, lanes: Lanes, forces: Array) -> None:
    """Contact forces ((n + 1) LANES,) [N] at an instant, as `ledger.total_forces` has them, of
    steps of dt [s]."""
    rate_dampers(lanes)
    for j in range(lanes.A.size):
        w, force = lanes.v[j] - lanes.v[j + LANES], lanes.f[j + LANES]
        extra = damping_force(w, dt, force, lanes.damping.rate[j], j, lanes.damping)
        forces[j + LANES] = force + extra


@fastmath_inline
def damping_force(
    w: float, dt: float, force: float, c: float, j: int, damping: LaneDamping
) -> float:
    """Force of a damper c, no stronger than steps of dt can tell, which may not pull if clipped."""
    extra = w * min(c, STOPPED / (dt * damping.inverse_mass[j]))
    return max(extra, -force) if never_pulls(damping.law) else extra


# --- impulses at the walls -----------------------------------------------------------------------


@fastmath
def push_walls(v: Array, wall: WallPush) -> None:
    """`modes.push_wall` for lanes: work of the impulses on the modes, and the velocity that they
    leave the wall with, the last row of v ((n + 1) LANES,). The modes get them all at once, before
    they move on (`pending`)."""
    w = v[v.size - LANES :]
    for lane in range(LANES):
        impulse = wall.impulse[lane]
        wall.work[lane] += impulse * (w[lane] + 0.5 * wall.square[lane] * impulse)
        w[lane] += wall.square[lane] * impulse
        wall.pending[lane] += impulse


@fastmath
def push_modes_of_lanes(impulse: Array, p: Array, phi: Array) -> None:
    """p += phi impulse for every lane; p and phi (n_modes LANES,), impulse (LANES,) [N s]."""
    for j in range(0, p.size, LANES):
        for lane in range(LANES):
            p[j + lane] += phi[j + lane] * impulse[lane]


@fastmath
def shift_modes_of_lanes(lanes: Lanes, wall: WallPush) -> None:
    """`shift_modes` for lanes."""
    u = lanes.x[lanes.A.size :]
    for lane in range(LANES):
        u[lane] += wall.square[lane] * wall.shift[lane]
    for j in range(0, lanes.q.size, LANES):
        for lane in range(LANES):
            lanes.q[j + lane] += lanes.phi[j + lane] * wall.shift[lane]


@fastmath
def squares_of_lanes(phi: Array, square: Array) -> None:
    """phi phi of every lane into square (LANES,) [1/kg], phi (n_modes LANES,)."""
    square[:] = 0.0
    for j in range(0, phi.size, LANES):
        for lane in range(LANES):
            square[lane] += phi[j + lane] * phi[j + lane]


# --- contacts that open or close in a step -------------------------------------------------------


@ieee
def correct_step_of_lanes(
    dt: float, lanes: Lanes, x_old: Array, v_old: Array, correction: Correction | None,
    wall: WallPush,
) -> bool:  # fmt: skip
    """Correct the contacts that opened or closed in a step of dt [s] from x_old, v_old
    ((n + 1) LANES,), and push the modes by it; was there anything to correct?"""
    if correction is None:
        return False
    if not correct_lanes(dt, lanes, x_old, v_old, correction, wall):
        return False
    if lanes.q.size > 0:
        push_walls(lanes.v, wall)
        shift_modes_of_lanes(lanes, wall)
    return True


@ieee
def correct_lanes(
    dt: float, lanes: Lanes, x_old: Array, v_old: Array, correction: Correction, wall: WallPush
) -> bool:
    """`correct_events` for lanes, of a step of dt [s] from x_old, v_old ((n + 1) LANES,); what the
    wall's modes get is left in `wall`. Says whether there was any.
    """
    x, v, minv, A, damping = lanes.x, lanes.v, lanes.inverse_mass, lanes.A, lanes.damping
    corrected = False
    wall.impulse[:] = 0.0
    wall.shift[:] = 0.0
    for row in range(0, A.size, LANES):
        if not crossed_row(x, x_old, row):
            continue
        corrected = True

        # lane by lane: each crossing is found by iteration, in a number of rounds of its own
        for j in range(row, row + LANES):
            k = j + LANES
            g0, g1 = x_old[j] - x_old[k], x[j] - x[k]
            if (g0 > 0.0) == (g1 > 0.0) or A[j] == 0.0:
                continue
            impulse, shift, rate = missed_impulse(
                A[j], dt, g0, v_old[j] - v_old[k], g1, v[j] - v[k], correction
            )
            if damping.gamma.size > 0 and grows(damping.law):
                factor = max(damping.gamma[j] * rate, -1.0)
                damping.lost[j - row] += factor * impulse * rate
                impulse *= 1.0 + factor
                shift *= 1.0 + factor
            v[j] -= minv[j] * impulse
            x[j] -= minv[j] * shift
            v[k] += minv[k] * impulse
            x[k] += minv[k] * shift
            if k >= A.size:
                wall.impulse[k - A.size] = impulse
                wall.shift[k - A.size] = shift
    return corrected


@fastmath
def crossed_row(x: Array, x_old: Array, row: int) -> bool:
    """Did a contact of any lane in this row open or close in the last step, from x_old to x,
    ((n + 1) LANES,) each? `row` is the index of its first lane."""
    count = 0.0
    for j in range(row, row + LANES):
        was_closed = 1.0 if x_old[j] > x_old[j + LANES] else 0.0
        is_closed = 1.0 if x[j] > x[j + LANES] else 0.0
        count += abs(is_closed - was_closed)
    return count > 0.0


# --- samples between the ends of steps -----------------------------------------------------------


@fastmath
def note_end(lanes: Lanes, f: Array, observed: Array, end: LaneEnds) -> None:
    """Save what the polynomials of a step need of one of its ends, where the contact forces are f
    ((n + 1) LANES,) [N], of the observed spheres (n_observed,), the last one and the wall."""
    x, v, minv, resting = lanes.x, lanes.v, lanes.inverse_mass, lanes.resting
    n = lanes.A.size // LANES
    for i in range(observed.size + 2):
        sphere = observed[i] if i < observed.size else n - 1 + i - observed.size
        for lane in range(LANES):
            j = sphere * LANES + lane
            end.x[i, lane] = x[j]
            end.v[i, lane] = v[j]
            if sphere == n:
                continue
            pushed = f[j] - f[j + LANES]
            if resting.load.size > 0:
                pushed += resting.load[j]
            if resting.stiffness.size > 0:
                pushed -= resting.stiffness[j] * (x[j] - resting.rest[j])
            end.a[i, lane] = minv[j] * pushed


@fastmath_inline
def sample_step(
    step: int, k: int, steps: LaneSteps, start: LaneEnds, end: LaneEnds, lanes: Lanes,
    saved: SavedLanes,
) -> int:  # fmt: skip
    """All samples from the k-th on that a step passes; the next one after it."""
    dt, n_steps, n_save = steps
    while k <= n_save and k * n_steps <= (step + 1) * n_save:
        s = (k * n_steps - step * n_save) / n_save
        sample_lanes(s, dt, start, end, lanes, lanes.shape, saved.v[k], saved.wall_force[k])
        if lanes.springs.residual.size > 0 or lanes.damping.gamma.size > 0:
            sample_springs_and_dampers(s, dt, start, end, lanes, lanes.shape, saved.wall_force[k])
        k += 1
    return k


@fastmath
def sample_lanes(
    s: float, h: float, start: LaneEnds, end: LaneEnds, lanes: Lanes, shape: ForceShape | None,
    v: Array, wall_force: Array,
) -> None:  # fmt: skip
    """Observed velocities v (n_observed, LANES) [m/s] and the elastic force at the wall (LANES,)
    [N] at the share s of a step of h [s]."""
    rows = v.shape[0]
    last = lanes.A.size - LANES
    for lane in range(LANES):
        for i in range(rows):
            sphere = StepEnd(start.x[i, lane], start.v[i, lane], start.a[i, lane])
            moved = StepEnd(end.x[i, lane], end.v[i, lane], end.a[i, lane])
            v[i, lane] = quintic_slope(s, h, sphere, moved)
        d = overlap_between(s, h, start, end, lane)[0]
        wall_force[lane] = elastic_force(last + lane, d if d > 0.0 else 0.0, lanes.A, shape)


@fastmath_inline
def overlap_between(
    s: float, h: float, start: LaneEnds, end: LaneEnds, lane: int
) -> tuple[float, float]:
    """Overlap [m] of the last sphere and the wall at the share s of a step of h [s], and its rate
    [m/s]: of the sphere the quintic of `dense`, of the wall the cubic."""
    i = start.x.shape[0] - 2
    sphere = StepEnd(start.x[i, lane], start.v[i, lane], start.a[i, lane])
    moved = StepEnd(end.x[i, lane], end.v[i, lane], end.a[i, lane])
    k = i + 1
    wall = start.x[k, lane], start.v[k, lane], end.x[k, lane], end.v[k, lane]
    return (
        quintic(s, h, sphere, moved) - cubic(s, h, *wall),
        quintic_slope(s, h, sphere, moved) - cubic_slope(s, h, *wall),
    )


@fastmath
def sample_springs_and_dampers(
    s: float, h: float, start: LaneEnds, end: LaneEnds, lanes: Lanes, shape: ForceShape | None,
    wall_force: Array,
) -> None:  # fmt: skip
    """Forces (LANES,) [N] at walls with springs in series, or behind damped contacts, at the share
    s of a step of h [s]; replaces those of `sample_lanes`, elastic and without springs."""
    residual, damping = lanes.springs.residual, lanes.damping
    for lane in range(LANES):
        j = lanes.A.size - LANES + lane
        gap, w = overlap_between(s, h, start, end, lane)
        if residual.size > 0:
            d = elastic_indentation(j, gap, residual[lane], lanes.A, shape)
            wall_force[lane] = elastic_force(j, d, lanes.A, shape)
        force = wall_force[lane]
        if damping.gamma.size > 0 and force > 0.0:
            c = damper_coefficient(damping.gamma[j], force, damping.law)
            if residual.size > 0:
                c *= share_of_damper(j, force, lanes.A, shape, residual[lane])
            wall_force[lane] += damping_force(w, h, force, c, j, damping)


# --- energies ------------------------------------------------------------------------------------


@fastmath
def energy_of_lanes(lanes: Lanes, shape: ForceShape | None, work: Array, energy: Array) -> None:
    """Energy (LANES,) [J] of the motion and what was lost of it, less what preload and weight have
    done: constant if exact. Forces are fresh; work (LANES,) [J] on the modes."""
    x, v, f, mass, A, q, resting = (
        lanes.x, lanes.v, lanes.f, lanes.mass, lanes.A, lanes.q, lanes.resting
    )  # fmt: skip
    for lane in range(LANES):
        energy[lane] = lanes.damping.lost[lane]
    for row in range(0, A.size, LANES):
        for lane in range(LANES):
            j = row + lane
            d = x[j] - x[j + LANES]
            d = d if d > 0.0 else 0.0
            stored = stored_energy(j, d, f[j + LANES], A, shape)
            energy[lane] += stored + 0.5 * mass[j] * v[j] * v[j]

    # the contact before a spring s is s F shallower, the spring holds s F^2 / 2: together, of
    # Hertz' law, 2/5 F (gap - s F) + s F^2 / 2 = 2/5 F gap + s F^2 / 10
    for lane in range(lanes.springs.residual.size):
        force, residual = f[A.size + lane], lanes.springs.residual[lane]
        if shape is None:
            energy[lane] += 0.1 * residual * force * force
        else:
            j = A.size - LANES + lane
            gap = x[j] - x[j + LANES]
            gap = gap if gap > 0.0 else 0.0
            energy[lane] += stored_energy(j, gap - residual * force, force, A, shape)
            energy[lane] += 0.5 * residual * force * force
            energy[lane] -= stored_energy(j, gap, force, A, shape)

    # of the modes the work of all force beyond that at rest, which is their swing about the static
    # state and what they lose; with the static deflection s, omega^2 s (q + s/2) comes on top
    for row in range(0, resting.static.size, LANES):
        for lane in range(LANES):
            j = row + lane
            bent = resting.static[j] * (q[j] + 0.5 * resting.static[j])
            energy[lane] += lanes.omega[j] * lanes.omega[j] * bent
    for lane in range(LANES if q.size > 0 else 0):
        energy[lane] += work[lane]

    # leaf springs, and the work of preload and weight since the static state
    for row in range(0, resting.stiffness.size, LANES):
        for lane in range(LANES):
            j = row + lane
            bent = x[j] - resting.anchor[j]
            energy[lane] += 0.5 * resting.stiffness[j] * bent * bent
    last = A.size - LANES
    for lane in range(resting.preload.size):
        energy[lane] -= resting.preload[lane] * (x[last + lane] - resting.rest[last + lane])
    for row in range(0, resting.weight.size, LANES):
        for lane in range(LANES):
            j = row + lane
            energy[lane] -= resting.weight[j] * (x[j] - resting.rest[j])


@fastmath
def kinetic_energy(lanes: Lanes, energy: Array) -> None:
    """Kinetic energy (LANES,) [J] of the spheres; 1 where none moves, as errors are relative to
    it."""
    energy[:] = 0.0
    for row in range(0, lanes.A.size, LANES):
        for lane in range(LANES):
            j = row + lane
            energy[lane] += 0.5 * lanes.mass[j] * lanes.v[j] * lanes.v[j]
    for lane in range(LANES):
        if energy[lane] == 0.0:
            energy[lane] = 1.0


# --- one block of many ---------------------------------------------------------------------------


@fastmath_allocating
def springs_of(springs: WallSprings, block: int) -> WallSprings:
    """Wall springs of one block."""
    return WallSprings(springs.residual[block].ravel(), springs.fold[block].ravel())


@fastmath_allocating
def dampers_of(dampers: Dampers, block: int) -> LaneDamping:
    """Dampers of one block."""
    gamma, pair = dampers.gamma[block].ravel(), dampers.inverse_mass[block].ravel()
    return LaneDamping(gamma, pair, dampers.law[block], np.zeros(LANES), np.zeros_like(gamma))


@fastmath_allocating
def resting_of(resting: RestingForces, block: int) -> RestingForces:
    """Static states and steady forces of one block."""
    return RestingForces(
        resting.rest[block].ravel(), resting.load[block].ravel(),
        resting.wall_offset[block].ravel(), resting.wall_force[block].ravel(),
        resting.static[block].ravel(), resting.preload[block].ravel(),
        resting.weight[block].ravel(), resting.stiffness[block].ravel(),
        resting.anchor[block].ravel(),
    )  # fmt: skip
