"""A sphere with friction on a wall whose modes couple its directions, beside a plain integrator
written from the formulas, and beside the same wall mirrored and turned."""

from collections.abc import Iterator

import numpy as np

import dem
from coupling.periodic_state import PeriodicState, periodic_state
from coupling.spatial_march import (
    Before,
    ShakerForces,
    SpatialSearch,
    body_of,
    march_space,
)
from coupling.spatial_wall import SpatialWall, spatial_wall_of_modes
from dem.friction import tangential_modulus
from dem.kernels.tangential import WIDTH
from dem.lateral import LastSphere
from workflows.evidence.verify.comparisons import Comparison, compared
from workflows.evidence.verify.friction import MU, NU, E, R, sphere_with_friction

SPEED, ACROSS = 0.1, (0.06, 0.05)  # m/s struck, along n and along t1, t2
LOAD, FORCE, FREQUENCY, PHASE = 40.0, 60.0, 1000.0, 0.4  # N pressed, N and Hz shaken, rad
ARM, TURN = np.array([2e6, 3e6]), 300.0  # N/m, N m/rad
PLAIN = "Runge and Kutta's order 4 over sphere and modes, 800 bristles cut back one by one"
MIRRORED, TURNED = "the wall mirrored, t2 to -t2", "the wall turned by 90 degrees about n"


def coupled_directions() -> Iterator[Comparison]:
    """Oblique impacts and a shaken cycle on coupled modes, walls mirrored and turned."""
    # impacts, free and on an arm
    for name, seed, arm in (("free", 1, {}), ("on an arm", 2, {"arm_stiffness": ARM})):
        wall, (chain, last) = _wall(seed), sphere_with_friction(velocity=np.array(ACROSS), **arm)
        run = march_space(chain, wall, [SPEED], last, duration=1.5e-4, error=1e-5, n_save=20)
        start = np.concatenate([[0.0, SPEED, 0.0, 0.0], ACROSS, np.zeros(12)])
        end, _ = _plain(chain, wall, last, start, 1.5e-4, 1e-7)
        ours = [run.trajectory.v[-1, 0], *run.lateral.sphere_t_v[-1]]
        yield compared(f"oblique impact, sphere {name}, velocity along n, t1, t2 [m/s]",
                       ours, [end[1], *end[4:6]], allowed=1e-4, of=SPEED, source=PLAIN)  # fmt: skip
        spin = R * run.lateral.sphere_spin[-1]
        yield compared(f"oblique impact, sphere {name}, its turn at the surface [m/s]",
                       spin, [-R * end[9], R * end[8]],
                       allowed=1e-4, of=SPEED, source=PLAIN)  # fmt: skip

    # the cycle that a shaker keeps up, and a period of the plain integrator from its start
    wall, (chain, last) = _wall(1), sphere_with_friction(LOAD, arm_stiffness=ARM, arm_rotation=TURN)
    shakers = ShakerForces(np.array([FORCE]), np.array([FREQUENCY]), np.array([PHASE]))
    body = body_of(chain, wall, [0.0], last, shakers)
    state = periodic_state(body, Before(np.zeros(1, bool), 0), error=1e-4)
    end, history = _plain_cycle(chain, wall, last, state)
    T, slip = history[:, 1:3], history[:, 3:]
    heat = float(np.sum(0.5 * (T[1:] + T[:-1]) * np.diff(slip, axis=0)))
    yield compared("shaken cycle, amplitudes of friction along t1, t2 [N]",
                   0.5 * np.ptp(state.cycle.friction_force, axis=0), 0.5 * np.ptp(T, axis=0),
                   allowed=5e-4, source=PLAIN)  # fmt: skip
    yield compared("shaken cycle, heat of friction [J]", state.heat, heat,
                   allowed=5e-4, source=PLAIN)  # fmt: skip
    yield compared("shaken cycle, velocities of the modes after a period [kg^1/2 m/s]",
                   state.moving.motion.p, end[14:], allowed=2e-4, source=PLAIN)  # fmt: skip
    yield compared("shaken cycle, friction and damping, beside the shaker's work [J]",
                   state.heat + state.lost_in_wall, state.work,
                   allowed=1e-4, source="energy")  # fmt: skip

    # walls mirrored and turned, marched by the same steps
    mirror = np.diag([1.0, 1.0, -1.0])
    turn = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    for Q, source in ((mirror, MIRRORED), (turn, TURNED)):
        S = 3e-9 * np.array([[1.0, 0.3, -0.2], [0.3, 1.2, 0.4], [-0.2, 0.4, 0.8]])
        wall = _wall(3)._replace(residual_compliance=S)
        changed = wall._replace(phi=wall.phi @ Q.T, residual_compliance=Q @ S @ Q.T)
        runs = []
        for w, P in ((wall, np.eye(3)), (changed, Q)):
            chain, last = sphere_with_friction(velocity=P[1:, 1:] @ ACROSS)
            search = SpatialSearch(dt=2e-7)
            runs.append(
                march_space(chain, w, [SPEED], last, duration=1.5e-4, n_save=50, search=search)
            )
        a, b = runs
        yield compared("impact on a wall with residual compliance, forces along n, t1, t2 [N]",
                       a.contact_force @ Q.T, b.contact_force,
                       allowed=1e-9, source=source)  # fmt: skip


def _wall(seed: int) -> SpatialWall:
    """Four modes of 200 Hz to 6 kHz whose shapes point anywhere, and a shaker on them."""
    rng = np.random.default_rng(seed)
    omega = 2 * np.pi * np.exp(rng.uniform(np.log(200), np.log(6000), 4))
    phi = rng.normal(size=(4, 3)) / np.sqrt(rng.uniform(1, 10, 4))[:, None]
    return spatial_wall_of_modes(omega, np.full(4, 0.05), phi, load=rng.normal(size=(4, 1)))


def _plain_cycle(
    chain: dem.Chain, wall: SpatialWall, last: LastSphere, state: PeriodicState
) -> tuple[np.ndarray, np.ndarray]:
    """A period from the state's start, its bristles those of the contact's cells."""
    motion, cells = state.moving.motion, state.moving.contacts.cells
    y = np.concatenate(
        [motion.x, motion.v, motion.u, motion.u_v, motion.psi, motion.spin, motion.q, motion.p]
    )
    xi = np.arange(len(cells.u)) * cells.state[WIDTH]
    begin = (xi, cells.u, motion.slip.copy(), motion.force.copy())
    return _plain(chain, wall, last, y, 1.0 / FREQUENCY, 1e-6, begin)


def _plain(
    chain: dem.Chain, wall: SpatialWall, last: LastSphere, y: np.ndarray, duration: float,
    dt: float, begin: tuple | None = None,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """The last state y = x, v, u, u', psi, psi', q, q', and force and slip over time, (k, 5)."""
    m, A = float(chain.mass[0]), float(chain.A[0])
    G = tangential_modulus(E, NU, E, NU)
    E_star = E / (2.0 * (1.0 - NU**2))
    static = dem.equilibrium(
        chain, dem.Wall(wall.omega, wall.zeta, np.ascontiguousarray(wall.phi[:, 0]), 0.0)
    )
    F0, offset = float(static.force[-1]), float(wall.phi[:, 0] @ static.q)
    edges = np.sqrt(6e-6 * R) * np.sin(np.linspace(0, np.pi / 2, 801))
    x_b, width = 0.5 * (edges[1:] + edges[:-1]), 2.0 * np.diff(edges)
    bristles, slip, force = np.zeros((800, 2)), np.zeros(2), np.array([F0, 0.0, 0.0])
    if begin is not None:
        xi, u, slip, force = begin
        bristles = np.column_stack([np.interp(x_b**2, xi, values) for values in u.T])

    def rate(t: float, y: np.ndarray) -> tuple[np.ndarray, tuple]:
        x, v = y[0], y[1]
        u, uv, psi, spin, q, p = y[2:4], y[4:6], y[6:8], y[8:10], y[10:14], y[14:]
        gap = np.array([x - offset, *(u + R * psi)]) - wall.phi.T @ q
        d = max(gap[0], 0.0)
        trial = np.where((d > x_b**2 / R)[:, None], bristles + (gap[1:] - slip), 0.0)
        bound = MU * E_star / G * np.maximum(d - x_b**2 / R, 0.0)
        size = np.hypot(*trial.T)
        trial *= (np.minimum(bound, size) / np.where(size > 0, size, 1.0))[:, None]
        N, T = A * d**1.5, G * width @ trial
        push = wall.phi @ [N - F0, *T]
        if begin is not None:
            push = push + wall.load[:, 0] * FORCE * np.cos(2 * np.pi * FREQUENCY * t + PHASE)
        a = push - 2 * wall.zeta * wall.omega * p - wall.omega**2 * q
        turn = -(R * T + last.arm_rotation * psi) / last.inertia
        across = -(T + np.asarray(last.arm_stiffness) * u) / m
        dy = np.concatenate([[v, (float(chain.steady[0]) - N) / m], uv, across, spin, turn, p, a])
        return dy, (trial, gap[1:], np.array([N, *T]))

    history = [[*force, *slip]]
    for i in range(round(duration / dt)):
        t = i * dt
        k1, _ = rate(t, y)
        k2, _ = rate(t + dt / 2, y + dt / 2 * k1)
        k3, _ = rate(t + dt / 2, y + dt / 2 * k2)
        k4, _ = rate(t + dt, y + dt * k3)
        y = y + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        _, (bristles, slip, force) = rate(t + dt, y)
        history.append([*force, *slip])
    return y, np.array(history)
