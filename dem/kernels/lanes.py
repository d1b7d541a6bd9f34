"""Chains side by side in the lanes of vector registers: sphere i of lane l is i * LANES + l.

The wall is one more sphere without mass, moved by its modes alone. Steps do not stop at the samples
that are kept: those lie on the polynomials of `dense`.
"""

from typing import NamedTuple

import numpy as np

from dem.kernels.arguments import Array, Correction
from dem.kernels.compiled import (
    fastmath,
    fastmath_allocating,
    fastmath_allocating_march,
    fastmath_inline,
    ieee,
)
from dem.kernels.dense import Place, cubic, quintic, quintic_slope
from dem.kernels.events import missed_impulse
from dem.kernels.laws import hertz_force

LANES = 16


class LaneSteps(NamedTuple):
    """Equal steps, and equal samples that need not lie at their ends."""

    h: float  # [s]
    n_steps: int
    n_save: int


class Held(NamedTuple):
    """What chains at rest are held by, (n_blocks, m, LANES) each; m = 0 where nothing does."""

    rest: Array  # (n) [m] of the spheres
    load: Array  # (n) [N] balances the contact forces at rest
    wall_offset: Array  # (1) [m] of the wall at rest
    wall_force: Array  # (1) [N]
    static: Array  # (n_modes) of the modes at rest
    preload: Array  # (1) [N]
    weight: Array  # (n) [N], m = 0 without any
    stiffness: Array  # (n) [N/m] of the leaf springs, m = 0 without any
    anchor: Array  # (n) [m]


class Blocks(NamedTuple):
    """Chains by LANES; (n_blocks, m, LANES) each."""

    v0: Array
    mass: Array
    A: Array  # 0 behind the last sphere of a free chain
    phi: Array
    omega: Array
    propagator: Array  # (n_blocks, n_drifts, 4, n_modes * LANES)
    held: Held
    swing: Array  # (n_blocks, n_drifts, 4, n * LANES) of the leaf springs; n = 0 without any


class SavedLanes(NamedTuple):
    """What is kept of every chain."""

    v: Array  # (n_blocks, n_save + 1, n_observed, LANES)
    wall_force: Array  # (n_blocks, n_save + 1, LANES)
    energy_error: Array  # (n_blocks, LANES) worst change over the energy at the start


class Lanes(NamedTuple):
    """One block: what moves, and what it is made of."""

    x: Array  # ((n + 1) LANES,)
    v: Array
    f: Array
    q: Array  # (n_modes * LANES,) from rest
    p: Array
    inverse_mass: Array  # ((n + 1) LANES,) 0 of the wall
    mass: Array  # (n LANES,)
    A: Array
    phi: Array
    omega: Array
    propagator: Array  # (n_drifts, 4, n_modes * LANES)
    held: Held  # (m LANES,) each
    swing: Array  # (n_drifts, 4, n LANES)


class WallPush(NamedTuple):
    """What the wall's modes get, (LANES,)."""

    impulse: Array
    shift: Array
    square: Array  # phi phi of each lane, velocity of the wall after unit impulse
    work: Array  # on the modes so far


@fastmath
def forces_of_lanes(x: Array, A: Array, f: Array) -> None:
    for j in range(A.size):
        d = x[j] - x[j + LANES]
        f[j + LANES] = hertz_force(d if d > 0.0 else 0.0, A[j])


@fastmath
def push_modes_of_lanes(
    impulse: Array, q: Array, p: Array, phi: Array, shift: Array | None
) -> None:
    """p += phi impulse for every lane; with a shift, q += phi shift as well."""
    for j in range(0, q.size, LANES):
        for lane in range(LANES):
            p[j + lane] += phi[j + lane] * impulse[lane]
            if shift is not None:
                q[j + lane] += phi[j + lane] * shift[lane]


@fastmath
def book_work(v: Array, wall: WallPush) -> None:
    """Work of the impulses on the modes, and the velocity that they leave the wall with."""
    w = v[v.size - LANES :]
    for lane in range(LANES):
        impulse = wall.impulse[lane]
        wall.work[lane] += impulse * (w[lane] + 0.5 * wall.square[lane] * impulse)
        w[lane] += wall.square[lane] * impulse


@fastmath
def squares_of_lanes(phi: Array, square: Array) -> None:
    square[:] = 0.0
    for j in range(0, phi.size, LANES):
        for lane in range(LANES):
            square[lane] += phi[j + lane] * phi[j + lane]


@fastmath
def read_modes_of_lanes(lanes: Lanes) -> None:
    """The modes' displacement and velocity into those of the wall."""
    q, p, phi = lanes.q, lanes.p, lanes.phi
    u, w = lanes.x[lanes.A.size :], lanes.v[lanes.A.size :]
    u[:] = 0.0
    w[:] = 0.0
    for lane in range(lanes.held.wall_offset.size):
        u[lane] = lanes.held.wall_offset[lane]
    for j in range(0, q.size, LANES):
        for lane in range(LANES):
            u[lane] += phi[j + lane] * q[j + lane]
            w[lane] += phi[j + lane] * p[j + lane]


@fastmath
def drift_modes_of_lanes(q: Array, p: Array, E: Array) -> None:
    for j in range(q.size):
        q_new = E[0, j] * q[j] + E[1, j] * p[j]
        p[j] = E[2, j] * q[j] + E[3, j] * p[j]
        q[j] = q_new


@fastmath
def crossed_row(x: Array, x_old: Array, row: int) -> bool:
    count = 0.0
    for j in range(row, row + LANES):
        before = 1.0 if x_old[j] > x_old[j + LANES] else 0.0
        after = 1.0 if x[j] > x[j + LANES] else 0.0
        count += abs(after - before)
    return count > 0.0


@ieee
def correct_lanes(
    dt: float, lanes: Lanes, x_old: Array, v_old: Array, correction: Correction, wall: WallPush
) -> bool:
    """`correct_events` for lanes; what the wall's modes get is left in `wall`.

    Says whether there was any.
    """
    x, v, minv, A = lanes.x, lanes.v, lanes.inverse_mass, lanes.A
    found = False
    wall.impulse[:] = 0.0
    wall.shift[:] = 0.0
    for row in range(0, A.size, LANES):
        if not crossed_row(x, x_old, row):
            continue
        found = True
        for j in range(row, row + LANES):
            k = j + LANES
            g0, g1 = x_old[j] - x_old[k], x[j] - x[k]
            if (g0 > 0.0) == (g1 > 0.0) or A[j] == 0.0:
                continue
            impulse, shift, _ = missed_impulse(
                A[j], dt, g0, v_old[j] - v_old[k], g1, v[j] - v[k], correction
            )
            v[j] -= minv[j] * impulse
            x[j] -= minv[j] * shift
            v[k] += minv[k] * impulse
            x[k] += minv[k] * shift
            if k >= A.size:
                wall.impulse[k - A.size] = impulse
                wall.shift[k - A.size] = shift
    return found


@fastmath
def energy_of_lanes(lanes: Lanes, work: Array, energy: Array) -> None:
    """Energy of the motion, and what preload and weight have left to do."""
    x, v, mass, A, q, held = lanes.x, lanes.v, lanes.mass, lanes.A, lanes.q, lanes.held
    energy[:] = 0.0
    for row in range(0, A.size, LANES):
        for lane in range(LANES):
            j = row + lane
            d = x[j] - x[j + LANES]
            d = d if d > 0.0 else 0.0
            energy[lane] += 0.4 * hertz_force(d, A[j]) * d + 0.5 * mass[j] * v[j] * v[j]
    # of the modes what the work on them says: it knows of their damping
    for row in range(0, held.static.size, LANES):
        for lane in range(LANES):
            j = row + lane
            bent = held.static[j] * (q[j] + 0.5 * held.static[j])
            energy[lane] += lanes.omega[j] * lanes.omega[j] * bent
    for lane in range(LANES if q.size > 0 else 0):
        energy[lane] += work[lane]
    for row in range(0, held.stiffness.size, LANES):
        for lane in range(LANES):
            j = row + lane
            bent = x[j] - held.anchor[j]
            energy[lane] += 0.5 * held.stiffness[j] * bent * bent
    last = A.size - LANES
    for lane in range(held.preload.size):
        energy[lane] -= held.preload[lane] * (x[last + lane] - held.rest[last + lane])
    for row in range(0, held.weight.size, LANES):
        for lane in range(LANES):
            j = row + lane
            energy[lane] -= held.weight[j] * (x[j] - held.rest[j])


@fastmath_inline
def kick_lanes(kick: float, lanes: Lanes, wall: WallPush) -> None:
    v, f, minv, load = lanes.v, lanes.f, lanes.inverse_mass, lanes.held.load
    size = lanes.A.size
    for j in range(size):
        v[j] += kick * minv[j] * (f[j] - f[j + LANES])
    for j in range(load.size):
        v[j] += kick * minv[j] * load[j]
    if lanes.q.size > 0:
        for lane in range(LANES):
            wall.impulse[lane] = kick * f[size + lane]
        for lane in range(lanes.held.wall_force.size):
            wall.impulse[lane] -= kick * lanes.held.wall_force[lane]
        book_work(lanes.v, wall)
        push_modes_of_lanes(wall.impulse, lanes.q, lanes.p, lanes.phi, None)


@fastmath_inline
def drift_lanes(i: int, drift: float, lanes: Lanes) -> None:
    x, v, rest = lanes.x, lanes.v, lanes.held.rest
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
        drift_modes_of_lanes(lanes.q, lanes.p, lanes.propagator[i])
        read_modes_of_lanes(lanes)


@fastmath_inline
def step_of_lanes(dt: float, stale: bool, a: Array, b: Array, lanes: Lanes, wall: WallPush) -> bool:
    """`take_step` for lanes; are the forces stale at the end?"""
    for i in range(b.size):
        if b[i] != 0.0:
            if stale:
                forces_of_lanes(lanes.x, lanes.A, lanes.f)
            kick_lanes(b[i] * dt, lanes, wall)
            stale = False
        if i < a.size and a[i] != 0.0:
            drift_lanes(i, a[i] * dt, lanes)
            stale = True
    return stale


@ieee
def correct_step_of_lanes(
    dt: float, lanes: Lanes, x_old: Array, v_old: Array, correction: Correction | None,
    wall: WallPush,
) -> bool:  # fmt: skip
    """Correct the contacts and push the modes by it; was there anything to correct?"""
    if correction is None:
        return False
    if not correct_lanes(dt, lanes, x_old, v_old, correction, wall):
        return False
    if lanes.q.size > 0:
        book_work(lanes.v, wall)
        push_modes_of_lanes(wall.impulse, lanes.q, lanes.p, lanes.phi, wall.shift)
        read_modes_of_lanes(lanes)
    return True


class Ends(NamedTuple):
    """Observed spheres, the last one and the wall at an end of a step, (rows, LANES) each; the
    last two rows are those of the last sphere and of the wall."""

    x: Array
    v: Array
    a: Array


@fastmath
def note_end(lanes: Lanes, observed: Array, end: Ends) -> None:
    """What the polynomials of a step need of one of its ends; forces are fresh."""
    x, v, f, minv, held = lanes.x, lanes.v, lanes.f, lanes.inverse_mass, lanes.held
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
            if held.load.size > 0:
                pushed += held.load[j]
            if held.stiffness.size > 0:
                pushed -= held.stiffness[j] * (x[j] - held.rest[j])
            end.a[i, lane] = minv[j] * pushed


@fastmath
def sample_lanes(
    s: float, h: float, one: Ends, two: Ends, A: Array, v: Array, wall_force: Array
) -> None:
    """Observed velocities and the force at the wall at the share s of a step."""
    rows = v.shape[0]
    last = A.size - LANES
    for lane in range(LANES):
        for i in range(rows):
            here = Place(one.x[i, lane], one.v[i, lane], one.a[i, lane])
            there = Place(two.x[i, lane], two.v[i, lane], two.a[i, lane])
            v[i, lane] = quintic_slope(s, h, here, there)
        i = rows
        here = Place(one.x[i, lane], one.v[i, lane], one.a[i, lane])
        there = Place(two.x[i, lane], two.v[i, lane], two.a[i, lane])
        k = rows + 1
        wall = cubic(s, h, one.x[k, lane], one.v[k, lane], two.x[k, lane], two.v[k, lane])
        d = quintic(s, h, here, there) - wall
        wall_force[lane] = hertz_force(d if d > 0.0 else 0.0, A[last + lane])


@fastmath
def sample_step(
    step: int, k: int, steps: LaneSteps, one: Ends, two: Ends, A: Array, saved: SavedLanes
) -> int:
    """All samples from the k-th on that a step passes; the next one after it."""
    dt, n_steps, n_save = steps
    while k <= n_save and k * n_steps <= (step + 1) * n_save:
        s = (k * n_steps - step * n_save) / n_save
        sample_lanes(s, dt, one, two, A, saved.v[k], saved.wall_force[k])
        k += 1
    return k


@fastmath
def note_energy(energy: Array, start: Array, scale: Array, worst: Array) -> None:
    for lane in range(LANES):
        change = abs(energy[lane] - start[lane]) / scale[lane]
        if not change <= worst[lane]:  # keeps a NaN
            worst[lane] = change


@fastmath
def kinetic_energy(lanes: Lanes, energy: Array) -> None:
    """Of the spheres; 1 where none moves, as errors are relative to it."""
    energy[:] = 0.0
    for row in range(0, lanes.A.size, LANES):
        for lane in range(LANES):
            j = row + lane
            energy[lane] += 0.5 * lanes.mass[j] * lanes.v[j] * lanes.v[j]
    for lane in range(LANES):
        if energy[lane] == 0.0:
            energy[lane] = 1.0


@fastmath_allocating
def march_block(
    lanes: Lanes, a: Array, b: Array, correction: Correction | None, steps: LaneSteps,
    observed: Array, saved: SavedLanes,
) -> None:  # fmt: skip
    dt, n_steps, n_save = steps
    x_old, v_old = np.zeros_like(lanes.x), np.zeros_like(lanes.v)
    wall = WallPush(np.zeros(LANES), np.zeros(LANES), np.zeros(LANES), np.zeros(LANES))
    squares_of_lanes(lanes.phi, wall.square)
    start, energy, scale = np.zeros(LANES), np.zeros(LANES), np.zeros(LANES)
    shape = (observed.size + 2, LANES)
    one = Ends(np.zeros(shape), np.zeros(shape), np.zeros(shape))
    two = Ends(np.zeros(shape), np.zeros(shape), np.zeros(shape))
    forces_of_lanes(lanes.x, lanes.A, lanes.f)
    stale = n_save < 0  # a literal False would compile what takes it once more
    energy_of_lanes(lanes, wall.work, start)
    kinetic_energy(lanes, scale)
    note_end(lanes, observed, two)
    sample_lanes(1.0, dt, two, two, lanes.A, saved.v[0], saved.wall_force[0])
    k = 1
    for step in range(n_steps):
        due = k * n_steps <= (step + 1) * n_save
        if due:
            if stale:
                forces_of_lanes(lanes.x, lanes.A, lanes.f)
                stale = n_save < 0
            note_end(lanes, observed, one)
        if correction is not None:
            x_old[:], v_old[:] = lanes.x, lanes.v
        stale = step_of_lanes(dt, stale, a, b, lanes, wall)
        stale |= correct_step_of_lanes(dt, lanes, x_old, v_old, correction, wall)
        if not due:
            continue
        if stale:
            forces_of_lanes(lanes.x, lanes.A, lanes.f)
            stale = n_save < 0
        note_end(lanes, observed, two)
        k = sample_step(step, k, steps, one, two, lanes.A, saved)
        energy_of_lanes(lanes, wall.work, energy)
        note_energy(energy, start, scale, saved.energy_error)


@fastmath_allocating_march
def march_lanes(
    blocks: Blocks, a: Array, b: Array, correction: Correction | None, steps: LaneSteps,
    observed: Array, saved: SavedLanes,
) -> None:  # fmt: skip
    """March LANES chains side by side, block after block, into `saved`."""
    n_blocks, n = blocks.v0.shape[:2]
    size, modes = n * LANES, blocks.phi.shape[1] * LANES
    padded = size + LANES
    for block in range(n_blocks):
        mass = blocks.mass[block].reshape(size)
        minv, x, v = np.zeros(padded), np.zeros(padded), np.zeros(padded)
        minv[:size] = 1.0 / mass
        v[:size] = blocks.v0[block].reshape(size)
        held = held_by(blocks.held, block)
        x[: held.rest.size] = held.rest
        lanes = Lanes(
            x, v, np.zeros(padded), np.zeros(modes), np.zeros(modes), minv, mass,
            blocks.A[block].reshape(size), blocks.phi[block].reshape(modes),
            blocks.omega[block].reshape(modes), blocks.propagator[block], held, blocks.swing[block],
        )  # fmt: skip
        if held.wall_offset.size > 0:
            x[size:] = held.wall_offset
        kept = SavedLanes(saved.v[block], saved.wall_force[block], saved.energy_error[block])
        march_block(lanes, a, b, correction, steps, observed, kept)


@fastmath_allocating
def held_by(held: Held, block: int) -> Held:
    return Held(
        held.rest[block].ravel(), held.load[block].ravel(), held.wall_offset[block].ravel(),
        held.wall_force[block].ravel(), held.static[block].ravel(), held.preload[block].ravel(),
        held.weight[block].ravel(),
        held.stiffness[block].ravel(), held.anchor[block].ravel(),
    )  # fmt: skip
