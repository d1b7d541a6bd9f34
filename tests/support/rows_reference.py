"""Chains on points of one structure by scipy's DOP853, along their own lines."""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq


def overlap_in_series(gap, A, s):
    """d of d + s A d^1.5 = gap, by bisection."""
    if gap <= 0.0 or s == 0.0:
        return max(gap, 0.0)
    top = gap
    while top + s * A * top**1.5 < gap:
        top *= 1.1
    return brentq(lambda d: d + s * A * d**1.5 - gap, 0.0, top, xtol=1e-22, rtol=1e-14)


def rows_reference(chains, velocities, delays, structure, t, *, tolerance=1e-11):
    """Positions and velocities (k, n) at times t (k,) of undamped chains without springs and
    preload, all in order; row i leans on direction i of the structure (r = p). A chain under weight
    leans on the structure, its first sphere in flight."""
    m = structure.omega.size
    counts = [len(chain.mass) for chain in chains]
    ends = np.cumsum(counts)
    n = ends[-1]
    mass = np.concatenate([chain.mass for chain in chains])
    A = np.concatenate([chain.A for chain in chains])
    weight = np.concatenate([chain.gravity * chain.mass for chain in chains])

    # at rest contacts carry the weights above them, but for that of the sphere in flight
    carried = [np.cumsum(chain.gravity * chain.mass * (np.arange(chain.mass.size) > 0))
               for chain in chains]  # fmt: skip
    rest_force = np.array([force[-1] for force in carried])

    def rates(_, state):
        x, v, q, p = np.split(state, [n, 2 * n, 2 * n + m])
        force, on_structure = np.zeros(n), np.zeros(len(chains))
        for i, end in enumerate(ends):
            first = end - counts[i]
            gap = x[first : end - 1] - x[first + 1 : end]
            force[first : end - 1] = A[first : end - 1] * np.maximum(gap, 0.0) ** 1.5
            s = structure.residual[i, 0]
            d = overlap_in_series(x[end - 1] - structure.phi[i] @ q, A[end - 1], s)
            force[end - 1] = on_structure[i] = A[end - 1] * d**1.5
        before = np.concatenate([[0.0], force[:-1]])
        before[ends[:-1]] = 0.0
        push = (on_structure - rest_force) @ structure.phi
        omega, zeta = structure.omega, structure.zeta
        return np.concatenate(
            [v, (before - force + weight) / mass, p, push - 2 * zeta * omega * p - omega**2 * q]
        )

    # places from those at which spheres just touch; modes from the static state
    x0, v0 = [], [np.array(velocity, float) for velocity in velocities]
    for i, chain in enumerate(chains):
        gaps = (carried[i] / chain.A) ** (2 / 3)
        gaps[-1] += structure.residual[i, 0] * rest_force[i]
        x0.append(np.cumsum(gaps[::-1])[::-1])
        x0[i][0] -= (v0[i][0] - 0.5 * chain.gravity * delays[i]) * delays[i]
        v0[i][0] -= chain.gravity * delays[i]
    start = np.concatenate([*x0, *v0, np.zeros(2 * m)])
    result = solve_ivp(
        rates, (t[0], t[-1]), start, "DOP853", t, rtol=tolerance, atol=1e-16, max_step=2e-6
    )
    assert result.success, result.message
    return result.y[:n].T, result.y[n : 2 * n].T
