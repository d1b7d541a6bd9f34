"""A sphere on a wall of random modes in three directions, and a plain integrator of both written
from the formulas."""

import numpy as np

import dem
from coupling.spatial_wall import spatial_wall_of_modes
from dem.friction import tangential_law, tangential_modulus
from dem.lateral import LastSphere

R, E, NU, RHO, MU = 0.0127, 210e9, 0.3, 7800.0, 0.2
STEEL = dem.Flat(E, NU)
E_STAR, G_STAR = E / (1 - NU**2) / 2, tangential_modulus(E, NU, E, NU)


def row(count=1, **fields):
    return dem.row_of_spheres(R, RHO, E, NU, count=count, flat=STEEL, **fields)


def last(chain, velocity=(0.0, 0.0), **arm):
    law = tangential_law(MU, R, E, NU, np.inf, E, NU)
    mass = 4 / 3 * np.pi * R**3 * RHO
    return LastSphere(law, 0.4 * mass * R**2, np.array(velocity, float), **arm)


def random_wall(seed, n_modes=4, **columns):
    """Modes of 200 Hz to 6 kHz whose shapes point anywhere, of 0.3 to 3 kg at the contact."""
    rng = np.random.default_rng(seed)
    omega = 2 * np.pi * np.exp(rng.uniform(np.log(200), np.log(6000), n_modes))
    phi = rng.normal(size=(n_modes, 3)) / np.sqrt(rng.uniform(1, 10, n_modes))[:, None]
    return spatial_wall_of_modes(omega, rng.uniform(0.0, 0.05, n_modes), phi, **columns)


def plain_march(
    chain,
    wall,
    v0,
    body,
    *,
    duration,
    dt,
    deepest,
    begin=None,
    shaker=None,
    n_bristles=1200,
    start=0.0,
):
    """Runge and Kutta's method of order 4 over spheres, arm and modes; the contact is a row of
    bristles that a step moves as a whole, each back to its circle. Returns y and the bristles.

    y = x, v, u, u', psi, psi', q, q'; shaker = (force, circular frequency, phase); `begin` is a
    state of `coupling` in two directions, None for rest.
    """
    n, k, m = chain.mass.size, wall.omega.size, np.asarray(chain.mass)
    gamma = np.zeros(n) if chain.gamma is None else np.asarray(chain.gamma)
    leaf, anchor = chain.springs
    arm, S = np.asarray(body.arm_stiffness), wall.residual_compliance
    free = np.isfinite(arm)
    arm = np.where(free, arm, 0.0)
    # more bristles at the edge of the largest contact: x = a sin(theta)
    edges = np.sqrt(deepest * R) * np.sin(np.linspace(0, np.pi / 2, n_bristles + 1))
    x_b, width = 0.5 * (edges[1:] + edges[:-1]), 2.0 * np.diff(edges)

    def contact(gap, q_pressure, b, slip, F):
        """Force on the wall (3,), bristles; S F by fixed point."""
        for _ in range(200):
            near = gap - S @ (F - [F0, 0, 0])
            d = max(near[0] - S[0, 0] * F0, 0.0)
            trial = np.where((d > x_b**2 / R)[:, None], b + (near[1:] - slip), 0.0)
            bound = MU * q_pressure * E_STAR / G_STAR * np.maximum(d - x_b**2 / R, 0.0)
            size = np.hypot(*trial.T)
            trial *= (np.minimum(bound, size) / np.where(size > 0, size, 1.0))[:, None]
            new = np.array([chain.A[-1] * d**1.5, *(G_STAR * width @ trial)])
            if np.abs(new - F).max() <= 1e-12 * np.abs(new).max() or not S.any():
                break
            F = new
        return new, trial, near[1:]

    static = dem.equilibrium(
        chain, dem.Wall(wall.omega, wall.zeta, wall.phi[:, 0].copy(), float(S[0, 0]))
    )
    F0 = static.force[-1]
    ends = np.cumsum([n, n, 2, 2, 2, 2, k])
    offset = wall.phi[:, 0] @ static.q
    bristles, slip, F = np.zeros((n_bristles, 2)), np.zeros(2), np.array([F0, 0.0, 0.0])
    y = np.concatenate([static.x, v0, [0, 0], body.velocity, np.zeros(4 + 2 * k)])
    if begin is not None:
        m_, cells = begin.motion, begin.contacts.cells
        y = np.concatenate([m_.x, m_.v, m_.u, m_.u_v, m_.psi, m_.spin, m_.q, m_.p])
        slip, F = m_.slip.copy(), m_.force.copy()
        xi = np.arange(len(cells.u)) * cells.state[6]  # the width of a cell in xi = x^2
        bristles = np.column_stack([np.interp(x_b**2, xi, u) for u in cells.u.T])

    def rate(t, y):
        x, v, u, uv, psi, spin, q, p = np.split(y, ends)
        U, V = wall.phi.T @ q, wall.phi.T @ p
        gap = np.array([x[-1] - offset - U[0], *(u + R * psi - U[1:])])
        w = v[-1] - V[0]
        force, b, s = contact(gap, max(1 + gamma[-1] * w, 0.0), bristles, slip, F)
        f = np.append(chain.A[:-1] * np.maximum(x[:-1] - x[1:], 0) ** 1.5, force[0])
        approach = np.append(v[:-1] - v[1:], w)
        f = f * np.maximum(1 + gamma * approach, 0.0)
        net = np.append(0.0, f[:-1]) - f - leaf * (x - anchor) + chain.steady
        T = force[1:]
        push = wall.phi @ [f[-1] - F0, *T]
        if shaker is not None:
            push = push + wall.load[:, 0] * shaker[0] * np.cos(shaker[1] * t + shaker[2])
        a = push - 2 * wall.zeta * wall.omega * p - wall.omega**2 * q
        kappa = body.arm_rotation
        turn = (-R * T - kappa * psi) / body.inertia if np.isfinite(kappa) else np.zeros(2)
        across = np.where(free, -(T + arm * u) / m[-1], 0.0)
        return np.concatenate([v, net / m, uv, across, spin, turn, p, a]), (b, s, force)

    history = [[*F, *slip]]
    for i in range(round(duration / dt)):
        t = i * dt
        k1, _ = rate(t, y)
        k2, _ = rate(t + dt / 2, y + dt / 2 * k1)
        k3, _ = rate(t + dt / 2, y + dt / 2 * k2)
        k4, _ = rate(t + dt, y + dt * k3)
        y = y + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        _, (bristles, slip, F) = rate(t + dt, y)
        history.append([*F, *slip])
    return np.split(y, ends), np.array(history)
