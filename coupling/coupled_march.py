"""Spheres and a coupled wall marched together, with an estimate of the error.

    m x'' = forces of the neighbours,   q'' + D q' + diag(omega^2) q = g F,   F = F(x_n - h^T q)

by an adaptive Runge-Kutta method of order 8 over spheres and modes at once: slow, and independent
of the splitting in dem. Hairer, Norsett and Wanner, Solving ODE I (1993), II.5.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from coupling.coupled_wall import CoupledWall
from coupling.errors import CouplingError
from dem import Chain, State, Trajectory, Wall, equilibrium
from dem.kernels.laws import hertz_indentation
from dem.spheres import hertz_stiffness, time_scale

CLIPPED = {"linear-clipped", "hunt-crossley"}
STIFF = 100.0  # times as fast as the fastest mode: a march of minutes
COARSER = 32.0  # times the error of a step, of the march that the error is estimated by


class EnergyGain(NamedTuple):
    """Energy made out of nothing over a run, relative to that of the striker: at most, at the end,
    and the time [s] of the largest."""

    largest: float
    final: float
    time: float


def march_coupled(
    chain: Chain,
    wall: CoupledWall,
    v0: ArrayLike,
    *,
    duration: float,
    error: float = 1e-6,
    n_save: int = 1000,
    largest_step: float | None = None,
) -> Trajectory:
    """Trajectory of the chain against a coupled wall, from the static state with velocities v0.

    error bounds the relative error of one step, not that of the run, see with_coupled_error.
    wall_x, the displacement that is read, is without the residual spring. Raises CouplingError.
    """
    if chain.yield_overlap is not None:
        raise CouplingError("a CoupledWall takes no plastic contacts; leave out yield_overlap.")
    if chain.slides:
        raise CouplingError("a CoupledWall takes no friction in guides; leave out friction.")
    from scipy.integrate import solve_ivp  # half a second that no other wall pays for

    motion = _Motion(chain, wall)
    t = np.linspace(0, duration, n_save + 1)
    start, scale = motion.start(np.asarray(v0, dtype=float))
    tolerance = max(error, 1e-13)
    solution = solve_ivp(
        motion.rate,
        (0, duration),
        start,
        method="DOP853",
        t_eval=t,
        rtol=tolerance,
        atol=tolerance * scale,
        max_step=largest_step or longest_step(wall),
    )
    if solution.status < 0 or not np.isfinite(solution.y).all():
        raise CouplingError(
            f"the coupled march stopped at t={solution.t[-1] if len(solution.t) else 0:.4g} s: "
            f"{solution.message} The wall feeds energy into the chain, or the contact became "
            "unstable."
        )
    return motion.trajectory(t, solution.y.T, solution.nfev // 12)


def with_coupled_error(
    chain: Chain, wall: CoupledWall, v0: ArrayLike, trajectory: Trajectory, *, error: float
) -> Trajectory:
    """The trajectory of march_coupled at this error with the largest velocity difference to a
    march of half as many steps, over the largest initial speed: a cautious error_estimate."""
    coarser = march_coupled(
        chain, wall, v0, duration=float(trajectory.t[-1]), error=COARSER * error,
        n_save=trajectory.t.size - 1, largest_step=2 * longest_step(wall),
    )  # fmt: skip
    scale = float(np.abs(v0).max()) or 1.0
    return trajectory._replace(error_estimate=float(np.abs(coarser.v - trajectory.v).max()) / scale)


def longest_step(wall: CoupledWall) -> float:
    """[s] that the Runge-Kutta method keeps stable; raises CouplingError where none is worth it."""
    fastest = wall.omega.max(initial=0.0)
    decay = np.abs(wall.D).max(initial=0.0) and np.linalg.eigvalsh(wall.D)[-1]
    if decay > STIFF * fastest:
        raise CouplingError(
            f"the wall's dampers settle within {1 / decay:.1e} s, {decay / fastest:.1e} times as "
            f"fast as its fastest mode (allowed is {STIFF:g}); dampers that stiff hold their "
            "direction rigid: make it so, or lower their coefficients."
        )
    # the order 8 method is stable along the negative axis to about 6, along the imaginary to 5
    return 1 / max(fastest, decay / 3) if fastest > 0 else np.inf


class _Motion:
    """Equations of motion of y = (x, v, q, p, dissipated in contacts, dissipated in the wall)."""

    def __init__(self, chain: Chain, wall: CoupledWall):
        self.chain, self.wall = chain, wall
        n, k = len(chain.mass), len(wall.omega)
        self.n, self.k = n, k
        self.leaf, self.anchor = chain.springs
        self.gamma = np.zeros(n) if chain.gamma is None else np.asarray(chain.gamma)

    def split(self, y: np.ndarray) -> tuple[np.ndarray, ...]:
        n, k = self.n, self.k
        return np.split(y, [n, 2 * n, 2 * n + k, 2 * n + 2 * k], axis=-1)

    def start(self, v0: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        n, k, wall = self.n, self.k, self.wall
        moving = (wall.force * wall.reading != 0) & (wall.omega > 0)
        squared = np.where(wall.omega > 0, wall.omega, np.inf) ** 2
        soft = np.sum((wall.force * wall.reading / squared)[moving]) + wall.residual_compliance
        static = equilibrium(self.chain, Wall(*np.zeros((3, 0)), residual_compliance=float(soft)))
        q = wall.force * static.force[-1] / squared
        speed = np.abs(v0).max(initial=0.0) or 1e-3
        period = time_scale(self.chain.mass.max(), self.chain.A.min(), speed)
        mass = self.chain.mass.max()
        scale = np.concatenate(
            [
                np.full(n, speed * period),
                np.full(n, speed),
                np.full(k, speed * period * np.sqrt(mass)),
                np.full(k, speed * np.sqrt(mass)),
                np.full(2, mass * speed**2),
            ]
        )
        return np.concatenate([static.x, v0, q, np.zeros(k + 2)]), scale

    def forces(self, x, v, q, p) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Indentations, elastic and damping forces, approach velocities of the n contacts."""
        chain, wall = self.chain, self.wall
        gap = np.append(x[:-1] - x[1:], x[-1] - wall.reading @ q)
        delta = np.maximum(gap, 0.0)
        delta[-1] = _indentation(gap[-1], chain.A[-1], wall.residual_compliance)
        approach = np.append(v[:-1] - v[1:], v[-1] - wall.reading @ p)
        elastic = chain.A * delta * np.sqrt(delta)
        damping = self.gamma * approach * (elastic if chain.dissipation == "hunt-crossley" else 1.0)
        damping = np.where(delta > 0, damping, 0.0)
        # the contact gives way by 1 / (1 + s k) of the gap, and hands on as much of its damping
        stiffness = hertz_stiffness(delta[-1], chain.A[-1])
        damping[-1] /= (1 + wall.residual_compliance * stiffness) ** 2
        if chain.dissipation in CLIPPED:
            damping = np.maximum(damping, -elastic)
        return delta, elastic, damping, approach

    def rate(self, t: float, y: np.ndarray) -> np.ndarray:
        x, v, q, p, _ = self.split(y)
        chain, wall = self.chain, self.wall
        _, elastic, damping, approach = self.forces(x, v, q, p)
        F = elastic + damping
        net = np.append(0.0, F[:-1]) - F - self.leaf * (x - self.anchor)
        net += chain.steady
        drag = wall.D @ p
        p_rate = wall.force * F[-1] - drag - wall.omega**2 * q
        return np.concatenate([v, net / chain.mass, p, p_rate, [damping @ approach, p @ drag]])

    def trajectory(self, t: np.ndarray, Y: np.ndarray, n_steps: int) -> Trajectory:
        x, v, q, p, lost = self.split(Y)
        chain, wall = self.chain, self.wall
        parts = [self.forces(*row) for row in zip(x, v, q, p, strict=True)]
        delta, elastic, damping, _ = (np.array(part) for part in zip(*parts, strict=True))
        energies = (
            0.5 * v**2 @ chain.mass,
            0.4 * (elastic * delta).sum(axis=1),
            0.5 * (x - self.anchor) ** 2 @ self.leaf,
            0.5 * (p**2 + (wall.omega * q) ** 2).sum(axis=1),
            0.5 * wall.residual_compliance * elastic[:, -1] ** 2,
            lost[:, 0],
            lost[:, 1],
            np.zeros(len(t)),
            chain.preload * (x[:, -1] - x[0, -1]),
            chain.gravity * (x - x[0]) @ chain.mass,
        )
        total = sum(energies[:8]) - energies[8] - energies[9]
        scale = energies[0][0] or np.abs(total).max() or 1.0
        return Trajectory(
            t,
            x,
            v,
            elastic + damping,
            q @ wall.reading,
            p @ wall.reading,
            q.astype(np.float32),
            *energies,
            total,
            float(t[-1] / n_steps),
            n_steps,
            "dop853",
            float(np.abs(total - total[0]).max() / scale),
            None,
            State(x[-1], v[-1], q[-1], p[-1], 0.0),
        )


def _indentation(gap: float, A: float, s: float) -> float:
    found = hertz_indentation(gap, A, s)
    if math.isnan(found):
        raise CouplingError(
            f"the contact became unstable: a residual compliance of {s:.3g} m/N answers no force "
            f"to an approach of {gap:.3g} m; lower the cutoff frequency."
        )
    return found


def energy_gain(trajectory: Trajectory) -> EnergyGain:
    """Energy that a run has made: total energy above its start over the striker's energy."""
    made = trajectory.energy_total - trajectory.energy_total[0]
    scale = trajectory.energy_kinetic[0] or 1.0
    worst = int(made.argmax())
    return EnergyGain(
        float(made[worst] / scale), float(made[-1] / scale), float(trajectory.t[worst])
    )
