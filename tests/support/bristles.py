"""A sphere with friction on a wall whose modes couple its directions, by a plain integrator written
from the formulas: a contact of bristles, cut back one by one."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from beadwave import dem
from beadwave.coupling.spatial_march import MarchState
from beadwave.coupling.spatial_wall import SpatialWall
from beadwave.dem.friction import tangential_modulus
from beadwave.dem.kernels.tangential import WIDTH
from beadwave.dem.lateral import LastSphere
from beadwave.workflows.evidence.verify.friction import MU, NU, E, R


class Bristles(NamedTuple):
    """The row of springs that a contact is made of (V. L. Popov, M. Hess, Method of Dimensionality
    Reduction, 2015): the largest overlap [m] that they reach, and how many they are."""

    deepest: float
    count: int = 800


class ShakenStart(NamedTuple):
    """A state to start from, and the shaker: its force [N], circular frequency [rad/s], phase."""

    moving: MarchState
    force: float
    omega: float
    phase: float


def plain_march(
    chain: dem.Chain, wall: SpatialWall, v0: ArrayLike, last: LastSphere, *, duration: float,
    dt: float, bristles: Bristles, shaken: ShakenStart | None = None,
) -> tuple[list[np.ndarray], np.ndarray]:  # fmt: skip
    """Runge and Kutta's method of order 4 over spheres, arm and modes; the contact is a row of
    bristles that a step moves as a whole, each back to its circle.

    Gives the last x, v, u, u', psi, psi', q, q', and force and slip over time (k, 5); from
    rest with v0, or from a `shaken` state.
    """
    # chain, arm and modes; a clamped direction of the arm moves as if its mass were infinite
    E_star, G_star = E / (2.0 * (1.0 - NU**2)), tangential_modulus(E, NU, E, NU)
    n, k, m = chain.mass.size, wall.omega.size, np.asarray(chain.mass)
    gamma = np.zeros(n) if chain.gamma is None else np.asarray(chain.gamma)
    leaf, anchor = chain.springs
    arm, S = np.asarray(last.arm_stiffness), wall.residual_compliance
    free = np.isfinite(arm)
    arm = np.where(free, arm, 0.0)

    # more bristles at the edge of the largest contact: x = a sin(theta)
    edges = np.sqrt(bristles.deepest * R) * np.sin(np.linspace(0, np.pi / 2, bristles.count + 1))
    x_b, width = 0.5 * (edges[1:] + edges[:-1]), 2.0 * np.diff(edges)

    def contact(gap, q_pressure, b, slip, F):
        """Force on the wall (3,), bristles and slip; S F by fixed point.

        A bristle at x moves by dU as long as G* |u| <= mu E* (d - x^2 / R), is cut back to that
        circle beyond, and is 0 out of contact.
        """
        for _ in range(200):
            near = gap - S @ (F - [F0, 0, 0])
            d = max(near[0] - S[0, 0] * F0, 0.0)
            trial = np.where((d > x_b**2 / R)[:, None], b + (near[1:] - slip), 0.0)
            bound = MU * q_pressure * E_star / G_star * np.maximum(d - x_b**2 / R, 0.0)
            size = np.hypot(*trial.T)
            trial *= (np.minimum(bound, size) / np.where(size > 0, size, 1.0))[:, None]
            new = np.array([chain.A[-1] * d**1.5, *(G_star * width @ trial)])
            if np.abs(new - F).max() <= 1e-12 * np.abs(new).max() or not S.any():
                break
            F = new
        return new, trial, near[1:]

    def behind(d, q_pressure, b, way):
        """Force on the last sphere (2,) of its contact with the one before, and the bristles."""
        radius = R if last.before is None else last.before.radius
        trial = np.where((d > x_b**2 / radius)[:, None], b + way, 0.0)
        c = 0.0 if last.before is None else last.before.bound
        bound = c * q_pressure * np.maximum(d - x_b**2 / radius, 0.0)
        size = np.hypot(*trial.T)
        trial *= (np.minimum(bound, size) / np.where(size > 0, size, 1.0))[:, None]
        return G_star * width @ trial, trial

    # from rest, the contact pressed and never sheared, or from the state of a cycle, whose bristles
    # are read off its cells at x^2
    static = dem.equilibrium(
        chain, dem.Wall(wall.omega, wall.zeta, wall.phi[:, 0].copy(), float(S[0, 0]))
    )
    F0 = static.force[-1]
    ends = np.cumsum([n, n, 2, 2, 2, 2, k])
    offset = wall.phi[:, 0] @ static.q
    stretch, slip, F = np.zeros((bristles.count, 2)), np.zeros(2), np.array([F0, 0.0, 0.0])
    stretch_before, rolled = np.zeros((bristles.count, 2)), np.zeros(2)
    y = np.concatenate([static.x, v0, [0, 0], last.velocity, np.zeros(4 + 2 * k)])
    if shaken is not None:
        m_, cells = shaken.moving.motion, shaken.moving.contacts.cells
        y = np.concatenate([m_.x, m_.v, m_.u, m_.u_v, m_.psi, m_.spin, m_.q, m_.p])
        slip, F = m_.slip.copy(), m_.force.copy()
        xi = np.arange(len(cells.u)) * cells.state[WIDTH]
        stretch = np.column_stack([np.interp(x_b**2, xi, u) for u in cells.u.T])

    def rate(t, y):
        """y' and what the contact has become; `stretch` is that at the beginning of the step, so
        that all four stages cut the same bristles back."""
        x, v, u, uv, psi, spin, q, p = np.split(y, ends)
        U, V = wall.phi.T @ q, wall.phi.T @ p
        gap = np.array([x[-1] - offset - U[0], *(u + R * psi - U[1:])])
        w = v[-1] - V[0]
        force, b, s = contact(gap, max(1 + gamma[-1] * w, 0.0), stretch, slip, F)
        f = np.append(chain.A[:-1] * np.maximum(x[:-1] - x[1:], 0) ** 1.5, force[0])
        approach = np.append(v[:-1] - v[1:], w)
        f = f * np.maximum(1 + gamma * approach, 0.0)
        net = np.append(0.0, f[:-1]) - f - leaf * (x - anchor) + chain.steady
        T = force[1:]
        d, q2 = max(x[-2] - x[-1], 0.0) if n > 1 else 0.0, 1.0
        if n > 1:
            q2 = max(1 + gamma[-2] * approach[-2], 0.0)
        back = u - R * psi
        B, b_before = behind(d, q2, stretch_before, back - rolled)
        push = wall.phi @ [f[-1] - F0, *T]
        if shaken is not None:
            push = push + wall.load[:, 0] * shaken.force * np.cos(shaken.omega * t + shaken.phase)
        a = push - 2 * wall.zeta * wall.omega * p - wall.omega**2 * q
        kappa = last.arm_rotation
        turn = np.zeros(2)
        if np.isfinite(kappa):
            turn = (-R * (T - B) - kappa * psi) / last.inertia
        across = np.where(free, -(T + B + arm * u) / m[-1], 0.0)
        became = b, s, force, b_before, back
        return np.concatenate([v, net / m, uv, across, spin, turn, p, a]), became

    history = [[*F, *slip]]
    for i in range(round(duration / dt)):
        t = i * dt
        k1, _ = rate(t, y)
        k2, _ = rate(t + dt / 2, y + dt / 2 * k1)
        k3, _ = rate(t + dt / 2, y + dt / 2 * k2)
        k4, _ = rate(t + dt, y + dt * k3)
        y = y + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        _, (stretch, slip, F, stretch_before, rolled) = rate(t + dt, y)
        history.append([*F, *slip])
    return np.split(y, ends), np.array(history)
