"""Chains on points of one structure by scipy's DOP853, along their own lines; random ones that
rub."""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from beadwave import dem
from beadwave.dem import space
from beadwave.dem.friction import tangential_law
from beadwave.dem.lateral import LastSphere


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


def random_rubbing_rows(seed):
    """One or two chains on a structure of some modes in three directions, whose last spheres rub by
    exact springs: damped or not, held by arms or free, spheres alone striking obliquely, a second
    chain later; with what a mesh couples in the half-space taken off. As rows and structure."""
    rng = np.random.default_rng(seed)
    p, k = int(rng.integers(1, 3)), int(rng.integers(3, 9))
    omega = 2 * np.pi * np.sort(10 ** rng.uniform(2.5, 4.6, k))
    turns = [np.linalg.qr(rng.standard_normal((3, 3)))[0] for _ in range(p)]
    axes = [np.array([n, t, np.cross(n, t)]) for n, t, _ in turns]
    besides = rng.uniform(-1e-10, 1e-10, (p, 3, 3))
    besides += besides.transpose(0, 2, 1)
    besides[:, np.arange(3), np.arange(3)] = 0.0
    structure = space.Structure(
        omega, rng.uniform(0.0, 0.1, k), rng.uniform(-2.0, 2.0, (3 * p, k)),
        np.repeat(np.arange(p), 3), np.vstack(axes),
        -rng.uniform(0.3e-9, 1.2e-9, (p, 2)), besides,
    )  # fmt: skip
    rows = []
    for i in range(p):
        n, radius = int(rng.integers(1, 5)), float(rng.uniform(3e-3, 12e-3))
        fields = {}
        if rng.random() < 0.5:
            fields = {"dissipation": "hunt-crossley", "gamma": float(rng.uniform(0.05, 0.5))}
        if n > 1 and rng.random() < 0.4:
            fields["preload"] = float(rng.uniform(1.0, 40.0))
        chain = dem.row_of_spheres(
            radius, 7800.0, 210e9, 0.3, count=n, flat=dem.Flat(210e9, 0.3), **fields
        )
        law = tangential_law(float(rng.uniform(0.02, 0.6)), radius, 210e9, 0.3, np.inf, 210e9, 0.3)
        inertia = 0.4 * float(chain.mass[-1]) * radius**2
        stiffness = rng.choice([0.0, 1e5, 2e6, np.inf], 2)
        across = rng.uniform(-0.2, 0.2, 2) * np.isfinite(stiffness) if n == 1 else np.zeros(2)
        last = LastSphere(
            law, inertia * float(rng.uniform(1.0, 2.0)), across, stiffness,
            float(rng.choice([0.0, 2.0, np.inf])),
        )  # fmt: skip
        if n > 1 and rng.random() < 0.3:
            last = last._replace(before=tangential_law(0.2, radius, 210e9, 0.3, radius, 210e9, 0.3))
        delay = float(rng.uniform(0.0, 5e-5)) if i and "preload" not in fields else 0.0
        velocity = np.eye(n)[0] * rng.uniform(0.05, 0.5)
        rows.append(space.Row(chain, velocity, np.zeros(3), axes[i][0], delay, last=last))
    return space.rows_of(rows, structure), structure
