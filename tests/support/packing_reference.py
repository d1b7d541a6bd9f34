"""Packings by scipy's DOP853, with forces written anew: what the march in space is held against."""

import numpy as np
from scipy.integrate import solve_ivp

from beadwave.dem.space import MOVING, Plane, line_guides, packing_of


def reference(packing, wall, v0, t, *, tolerance=1e-11, longest=None):
    """Displacements and velocities (k, s, 3) at times t (k,) [s] of a packing without friction and
    yield, from rest with velocities v0 (s, 3); `wall` of one mode, or None."""
    s = len(packing.mass)
    i, j = packing.pairs.T
    plane, moving = j < 0, j == MOVING
    second = np.where(plane, 0, j)
    free = np.eye(3)[None] if packing.guides is None else packing.guides.motion
    load = 0.0 if packing.load is None else packing.load
    gamma = np.zeros(len(i)) if packing.gamma is None else packing.gamma

    def rates(_, state):
        u, v = state[: 6 * s].reshape(2, s, 3)
        q, p = state[6 * s :] if wall is not None else (0.0, 0.0)
        phi = wall.phi[0] if wall is not None else 0.0
        still = np.where(moving, 1.0, 0.0)[:, None] * packing.arm
        move = np.where(plane[:, None], phi * q * still, u[second]) - u[i]
        speed = np.where(plane[:, None], phi * p * still, v[second]) - v[i]
        span = np.where(plane[:, None], packing.arm, packing.arm + move)
        size = np.linalg.norm(span, axis=1)
        e = span / size[:, None]
        rise = np.where(
            plane,
            np.einsum("cx,cx->c", move, packing.arm),
            (2 * packing.arm + move).__mul__(move).sum(axis=1)
            / (size + np.linalg.norm(packing.arm, axis=1)),
        )
        elastic = packing.A * np.maximum(packing.overlap - rise, 0.0) ** 1.5
        closing = -np.einsum("cx,cx->c", speed, e)
        force = np.where(elastic > 0.0, np.maximum(elastic * (1.0 + gamma * closing), 0.0), 0.0)
        total = np.zeros((s, 3))
        np.add.at(total, i, -force[:, None] * e)
        np.add.at(total, j[~plane], force[~plane, None] * e[~plane])
        a = np.einsum("sxy,sy->sx", np.broadcast_to(free, (s, 3, 3)), total + load)
        a /= packing.mass[:, None]
        rate = [v.ravel(), a.ravel()]
        if wall is not None:
            omega, zeta = wall.omega[0], wall.zeta[0]
            push = phi * force[moving].sum()
            rate.append([p, push - 2 * zeta * omega * p - omega**2 * q])
        return np.concatenate(rate)

    start = np.concatenate([np.zeros(3 * s), np.ravel(v0), [] if wall is None else [0.0, 0.0]])
    result = solve_ivp(
        rates, (t[0], t[-1]), start, "DOP853", t, rtol=tolerance, atol=1e-16,
        max_step=longest or np.inf,
    )  # fmt: skip
    assert result.success, result.message
    u, v = result.y[: 6 * s].T.reshape(len(t), 2, s, 3).transpose(1, 0, 2, 3)
    return u, v


def random_network(seed):
    """A packing of 3 to 7 spheres of several sizes and materials about each other, some on a plane,
    some guided, some damped, and velocities of one or two of them."""
    rng = np.random.default_rng(seed)
    s = int(rng.integers(3, 8))
    radius = rng.uniform(3e-3, 8e-3, s)
    centre = np.zeros((s, 3))
    for k in range(1, s):  # each touches one before it, at 1 um at most
        while True:
            on = int(rng.integers(0, k))
            way = rng.normal(size=3)
            gap = rng.choice([0.0, rng.uniform(0.0, 1e-6)])
            way *= (radius[k] + radius[on] + gap) / np.linalg.norm(way)
            centre[k] = centre[on] + way
            others = np.delete(np.arange(k), on)
            apart = np.linalg.norm(centre[others] - centre[k], axis=1) - radius[others] - radius[k]
            if np.all(apart > 0.0):
                break
    i, j = np.triu_indices(s, 1)
    near = np.linalg.norm(centre[j] - centre[i], axis=1) - radius[i] - radius[j] < 2e-4
    planes = []
    if rng.random() < 0.5:
        reach = centre[:, 0] + radius
        on = np.flatnonzero(reach > reach.max() - 1e-4)
        planes = [Plane(on, np.array([1.0, 0.0, 0.0]), reach[on] - reach.max(), 70e9, 0.3)]
    fields = {}
    if rng.random() < 0.3:
        direction = rng.normal(size=(s, 3)) * (rng.random(s) < 0.5)[:, None]
        fields["guides"] = line_guides(direction)
    packing = packing_of(
        centre, radius, rng.uniform(2000, 8000, s), rng.uniform(50e9, 210e9, s), 0.3,
        pairs=np.column_stack([i, j])[near], planes=planes, **fields,
    )  # fmt: skip
    if rng.random() < 0.4:
        gamma = np.full(len(packing.A), rng.uniform(0.05, 2.0))
        packing = packing._replace(dissipation="hunt-crossley", gamma=gamma)
    v0 = np.zeros((s, 3))
    v0[0] = rng.normal(size=3) * 0.1
    neighbour = packing.pairs[packing.pairs[:, 0] == 0][0, 1]
    if neighbour > 0:  # towards one of its own
        v0[0] = (centre[neighbour] - centre[0]) * rng.uniform(5.0, 40.0)
    if packing.guides is not None:
        v0 = np.einsum("sxy,sy->sx", packing.guides.motion, v0)
        if not v0.any():
            v0[0] = packing.guides.motion[0] @ rng.normal(size=3) * 0.1
    return packing, v0


def rubbing_reference(packing, v0, t, structure=None, *, tolerance=1e-9, longest=2e-7):
    """`reference` with friction: displacements, velocities and spins (k, s, 3) of a packing without
    dampers and guides, at rest planes and the points of a structure allowed. Contacts there are in
    series with its residual compliances.

    T follows Mindlin's increments as an equation of rates: k times the surfaces' relative velocity,
    turned with the pair, and T k'/k where the overlap falls; at its bound mu N it keeps to it.
    """
    s, c = len(packing.mass), len(packing.A)
    i, j = packing.pairs.T
    plane = j < 0
    second = np.where(plane, 0, j)
    R = packing.radius
    share = np.where(plane, 1.0, R[i] / (R[i] + R[second]))
    length = np.where(plane, R[i], np.linalg.norm(packing.arm, axis=1))
    load = 0.0 if packing.load is None else packing.load
    m = 0 if structure is None else len(structure.omega)
    in_series, leaning = np.zeros((c, 2)), np.flatnonzero(j <= MOVING)
    moved_by = np.zeros((len(leaning), 3, m))  # displacement of each point by the modes
    for at, point in enumerate(MOVING - j[leaning]):
        rows = structure.point == point
        moved_by[at] = structure.direction[rows].T @ structure.phi[rows]
        in_series[leaning[at]] = structure.residual[point]

    def rates(_, state):
        u, v, spin = state[: 9 * s].reshape(3, s, 3)
        T = state[9 * s : 9 * s + 3 * c].reshape(c, 3)
        q, p = state[9 * s + 3 * c :].reshape(2, m)
        zero = np.zeros((c, 3))
        wall_u, wall_v = zero.copy(), zero.copy()
        wall_u[leaning], wall_v[leaning] = moved_by @ q, moved_by @ p
        move = np.where(plane[:, None], wall_u, u[second]) - u[i]
        speed = np.where(plane[:, None], wall_v, v[second]) - v[i]
        span = np.where(plane[:, None], packing.arm, packing.arm + move)
        size = np.linalg.norm(span, axis=1)
        e = span / size[:, None]
        rise = np.where(
            plane,
            np.einsum("cx,cx->c", move, packing.arm),
            np.einsum("cx,cx->c", 2 * packing.arm + move, move) / (size + length),
        )
        gap = packing.overlap - rise
        touch = gap > 0.0
        d = np.maximum(gap, 1e-30)
        for _ in range(8):  # d + s A d^1.5 = gap by Newton's steps; s A d^0.5 is some percent
            k_n = in_series[:, 0] * packing.A * np.sqrt(np.maximum(d, 0.0))
            d = np.where(touch, d + (gap - d - k_n * d) / (1.0 + 1.5 * k_n), d)
        N = np.where(touch, packing.A * d**1.5, 0.0)
        along = np.einsum("cx,cx->c", speed, e)
        reach = np.where(plane, length - d, size)
        turns = share[:, None] * spin[i] + np.where(
            plane[:, None], zero, (1 - share)[:, None] * spin[second]
        )
        slide = speed - along[:, None] * e - reach[:, None] * np.cross(turns, e)
        turn = np.where(plane[:, None], zero, np.cross(e, speed / size[:, None]))
        mean = 0.5 * (
            np.einsum("cx,cx->c", spin[i], e)
            + np.where(plane, 0.0, np.einsum("cx,cx->c", spin[second], e))
        )
        turn = turn + mean[:, None] * e
        bare = packing.shear * np.sqrt(d)
        k = bare / (1.0 + in_series[:, 1] * bare)
        T = T - np.einsum("cx,cx->c", T, e)[:, None] * e
        # rate of the overlap
        grows = -along / (1.0 + in_series[:, 0] * 1.5 * packing.A * np.sqrt(d))
        rate = k[:, None] * slide + np.cross(turn, T)
        falls = 0.5 * grows / d / (1.0 + in_series[:, 1] * bare)
        rate += np.where(grows < 0.0, falls, 0.0)[:, None] * T
        bound = packing.friction * N
        strength = np.linalg.norm(T, axis=1)
        unit = T / np.where(strength > 0.0, strength, 1.0)[:, None]
        outward = np.einsum("cx,cx->c", rate, unit)
        of_bound = packing.friction * 1.5 * packing.A * np.sqrt(d) * grows
        slips = touch & (strength >= bound * (1.0 - 1e-9)) & (outward > of_bound)
        rate += ((of_bound - outward) * slips)[:, None] * unit
        # forgotten before the next touch, some 1e-5 s away
        rate = np.where(touch[:, None], rate, -T / 2e-7)
        T = T * np.where(touch, 1.0, 0.0)[:, None]

        force = N[:, None] * e - T
        moment = reach[:, None] * np.cross(e, T)
        total, turning = np.zeros((s, 3)), np.zeros((s, 3))
        np.add.at(total, i, -force)
        np.add.at(total, j[~plane], force[~plane])
        np.add.at(turning, i, share[:, None] * moment)
        np.add.at(turning, j[~plane], ((1 - share)[:, None] * moment)[~plane])
        a = (total + load) / packing.mass[:, None]
        turning /= packing.inertia[:, None]
        push = np.einsum("cxm,cx->m", moved_by, force[leaning])
        if m:
            push -= 2 * structure.zeta * structure.omega * p + structure.omega**2 * q
        return np.concatenate([v.ravel(), a.ravel(), turning.ravel(), rate.ravel(), p, push])

    start = np.concatenate([np.zeros(3 * s), np.ravel(v0), np.zeros(3 * s + 3 * c + 2 * m)])
    # forces of contacts that open and close jump in their rates: 1e-9 N of them are enough
    atol = np.full(start.size, 1e-14)
    atol[9 * s : 9 * s + 3 * c] = 1e-14 if structure is None else 1e-9
    result = solve_ivp(
        rates, (t[0], t[-1]), start, "DOP853", t, rtol=tolerance, atol=atol, max_step=longest
    )  # fmt: skip
    assert result.success, result.message
    return result.y[: 9 * s].T.reshape(len(t), 3, s, 3).transpose(1, 0, 2, 3)
