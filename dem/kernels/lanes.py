"""Bare chains side by side in the lanes of vector registers: sphere i of lane l is i * LANES + l.

The wall is one more sphere without mass, moved by its modes alone.
"""

from typing import NamedTuple

import numpy as np

from dem.kernels.arguments import Array, Correction, Steps
from dem.kernels.compiled import (
    fastmath,
    fastmath_allocating,
    fastmath_allocating_march,
    fastmath_inline,
    ieee,
)
from dem.kernels.events import missed_impulse
from dem.kernels.laws import hertz_force

LANES = 16


class Blocks(NamedTuple):
    """Chains by LANES; (n_blocks, m, LANES) each."""

    v0: Array
    mass: Array
    A: Array  # 0 behind the last sphere of a free chain
    phi: Array
    omega: Array
    propagator: Array  # (n_blocks, n_drifts, 4, n_modes * LANES)


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
    q: Array  # (n_modes * LANES,)
    p: Array
    inverse_mass: Array  # ((n + 1) LANES,) 0 of the wall
    mass: Array  # (n LANES,)
    A: Array
    phi: Array
    omega: Array
    propagator: Array  # (n_drifts, 4, n_modes * LANES)


class WallPush(NamedTuple):
    """What the wall's modes get, (LANES,)."""

    impulse: Array
    shift: Array


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
def read_modes_of_lanes(lanes: Lanes) -> None:
    """The modes' displacement and velocity into those of the wall."""
    q, p, phi = lanes.q, lanes.p, lanes.phi
    u, w = lanes.x[lanes.A.size :], lanes.v[lanes.A.size :]
    u[:] = 0.0
    w[:] = 0.0
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
def energy_of_lanes(lanes: Lanes, energy: Array) -> None:
    x, v, mass, A, q, p, omega = (
        lanes.x, lanes.v, lanes.mass, lanes.A, lanes.q, lanes.p, lanes.omega,
    )  # fmt: skip
    energy[:] = 0.0
    for row in range(0, A.size, LANES):
        for lane in range(LANES):
            j = row + lane
            d = x[j] - x[j + LANES]
            d = d if d > 0.0 else 0.0
            energy[lane] += 0.4 * hertz_force(d, A[j]) * d + 0.5 * mass[j] * v[j] * v[j]
    for row in range(0, q.size, LANES):
        for lane in range(LANES):
            j = row + lane
            energy[lane] += 0.5 * (p[j] * p[j] + omega[j] * omega[j] * q[j] * q[j])


@fastmath_inline
def kick_lanes(kick: float, lanes: Lanes, wall: WallPush) -> None:
    v, f, minv = lanes.v, lanes.f, lanes.inverse_mass
    size = lanes.A.size
    for j in range(size):
        v[j] += kick * minv[j] * (f[j] - f[j + LANES])
    if lanes.q.size > 0:
        for lane in range(LANES):
            wall.impulse[lane] = kick * f[size + lane]
        push_modes_of_lanes(wall.impulse, lanes.q, lanes.p, lanes.phi, None)


@fastmath_inline
def drift_lanes(i: int, drift: float, lanes: Lanes) -> None:
    x, v = lanes.x, lanes.v
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
    if lanes.q.size > 0:
        read_modes_of_lanes(lanes)
    if not correct_lanes(dt, lanes, x_old, v_old, correction, wall):
        return False
    if lanes.q.size > 0:
        push_modes_of_lanes(wall.impulse, lanes.q, lanes.p, lanes.phi, wall.shift)
        read_modes_of_lanes(lanes)
    return True


@fastmath
def save_lanes(
    lanes: Lanes, observed: Array, energy: Array, start: Array, saved: SavedLanes
) -> None:
    """Observed velocities v (n_observed, lanes), wall force and worst energy error so far."""
    x, A = lanes.x, lanes.A
    last = A.size - LANES
    for lane in range(LANES):
        for i in range(observed.size):
            saved.v[i, lane] = lanes.v[observed[i] * LANES + lane]
        d = max(x[last + lane] - x[last + LANES + lane], 0.0)
        saved.wall_force[lane] = hertz_force(d, A[last + lane])
        change = abs(energy[lane] - start[lane]) / start[lane]
        if not change <= saved.energy_error[lane]:  # keeps a NaN
            saved.energy_error[lane] = change


@fastmath_allocating
def march_block(
    lanes: Lanes, a: Array, b: Array, correction: Correction | None, steps: Steps, observed: Array,
    saved: SavedLanes,
) -> None:  # fmt: skip
    dt, n_save, stride = steps
    x_old, v_old = np.zeros_like(lanes.x), np.zeros_like(lanes.v)
    wall = WallPush(np.zeros(LANES), np.zeros(LANES))
    start, energy = np.zeros(LANES), np.zeros(LANES)
    stale = n_save >= 0  # a literal True would compile what takes it once more
    for k in range(n_save + 1):
        for _step in range(stride if k > 0 else 0):
            if correction is not None:
                for j in range(x_old.size):
                    x_old[j], v_old[j] = lanes.x[j], lanes.v[j]
            stale = step_of_lanes(dt, stale, a, b, lanes, wall)
            stale |= correct_step_of_lanes(dt, lanes, x_old, v_old, correction, wall)
        energy_of_lanes(lanes, energy)
        if k == 0:
            start = energy.copy()
        row = SavedLanes(saved.v[k], saved.wall_force[k], saved.energy_error)
        save_lanes(lanes, observed, energy, start, row)


@fastmath_allocating_march
def march_lanes(
    blocks: Blocks, a: Array, b: Array, correction: Correction | None, steps: Steps,
    observed: Array, saved: SavedLanes,
) -> None:  # fmt: skip
    """March LANES bare chains side by side, block after block, into `saved`."""
    n_blocks, n = blocks.v0.shape[:2]
    size, modes = n * LANES, blocks.phi.shape[1] * LANES
    padded = size + LANES
    for block in range(n_blocks):
        mass = blocks.mass[block].reshape(size)
        minv, v = np.zeros(padded), np.zeros(padded)
        minv[:size] = 1.0 / mass
        v[:size] = blocks.v0[block].reshape(size)
        lanes = Lanes(
            np.zeros(padded), v, np.zeros(padded), np.zeros(modes), np.zeros(modes), minv, mass,
            blocks.A[block].reshape(size), blocks.phi[block].reshape(modes),
            blocks.omega[block].reshape(modes), blocks.propagator[block],
        )  # fmt: skip
        kept = SavedLanes(saved.v[block], saved.wall_force[block], saved.energy_error[block])
        march_block(lanes, a, b, correction, steps, observed, kept)
