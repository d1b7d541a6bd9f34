"""Spheres and a coupled wall marched together, with an estimate of the error.

    m x'' = forces of the neighbours,   q'' + D q' + diag(omega^2) q = g F,   F = F(x_n - h^T q)

by an adaptive Runge-Kutta method of order 8 over spheres and modes at once: slower than the
splittings of dem, which it shares no code with, so that each verifies the other. Hairer, Norsett
and Wanner, Solving ODE I (1993), II.5.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from beadwave.coupling.coupled_wall import CoupledWall
from beadwave.coupling.errors import CouplingError
from beadwave.dem import ArrayErrors, Chain, State, Trajectory, Wall, equilibrium
from beadwave.dem.kernels.laws import DAMPING_LAWS, elastic_indentation
from beadwave.dem.spheres import time_scale


class EnergyGain(NamedTuple):
    """Energy that a run has made out of nothing, over the striker's: its largest value, that at the
    end, and the time [s] of the largest."""

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
    """Trajectory of the chain against a coupled wall, from the static state with velocities v0 (n,)
    [m/s], at n_save + 1 equal times to `duration` [s].

    error bounds the relative error of one step, not that of the run, see with_coupled_error;
    largest_step [s] is the longest taken, None that of `longest_step`. wall_x, the displacement
    that is read, is without the residual spring. Raises NoEquilibrium, and CouplingError for yield
    or friction of guides, for dampers of the wall too stiff to march, and where the march does not
    come to its end.
    """
    if chain.yield_overlap is not None:
        raise CouplingError("a CoupledWall takes no plastic contacts; leave out yield_overlap.")
    if chain.slides:
        raise CouplingError("a CoupledWall takes no friction in guides; leave out friction.")
    from scipy.integrate import solve_ivp  # half a second that no other wall pays for

    v0 = np.asarray(v0, dtype=float)
    n, k = len(chain.mass), len(wall.omega)
    g, h, s = wall.force, wall.reading, wall.residual_compliance
    leaf, anchor = chain.springs
    ends = [n, 2 * n, 2 * n + k, 2 * n + 2 * k]  # of x, v, q, p in y; two energies behind

    # at rest under preload and gravity: the wall of all modes is a spring of compliance
    # sum g h / omega^2 + s; rigid-body modes have no rest under a force and start at 0
    squared = np.where(wall.omega > 0, wall.omega, np.inf) ** 2
    moving = (g * h != 0) & (wall.omega > 0)
    compliance = np.sum((g * h / squared)[moving]) + s
    static = equilibrium(chain, Wall(*np.zeros((3, 0)), residual_compliance=float(compliance)))
    y0 = np.concatenate([static.x, v0, g * static.force[-1] / squared, np.zeros(k + 2)])

    # errors count in units of the impact: its speed V, its time, V sqrt(m) for modes, m V^2
    mass = chain.mass.max()
    speed = np.abs(v0).max(initial=0.0) or 1e-3
    law = chain.elastic
    if law.shape is None:
        period = time_scale(mass, chain.A.min(), speed)
    else:
        deepest = law.overlap_of_energy(np.full(chain.A.shape, 0.5 * mass * speed**2))
        period = float(deepest.max()) / speed
    units = (speed * period, speed, speed * period * np.sqrt(mass), speed * np.sqrt(mass))
    scale = np.repeat([*units, mass * speed**2], [n, n, k, k, 2])

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        """Derivatives of y = (x, v, q, p, dissipated in contacts, dissipated in the wall)."""
        x, v, q, p, _ = np.split(y, ends)
        contacts = contact_forces(chain, wall, x, v, q, p)
        F = contacts.elastic + contacts.damping
        net = np.append(0.0, F[:-1]) - F - leaf * (x - anchor)
        net += chain.steady
        drag = wall.D @ p
        p_rate = g * F[-1] - drag - wall.omega**2 * q
        lost = [contacts.damping @ contacts.approach, p @ drag]
        return np.concatenate([v, net / chain.mass, p, p_rate, lost])

    # rounding limits the tolerance; steps stay below the stability limit of the fastest mode or
    # damper, which the error control alone would meet again and again
    t = np.linspace(0, duration, n_save + 1)
    tolerance = max(error, 1e-13)
    solution = solve_ivp(
        rate,
        (0, duration),
        y0,
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
    n_steps = solution.nfev // 12  # evaluations a step

    # the ledger of energies over the saved times: what total has gained was made of nothing
    x, v, q, p, lost = np.split(solution.y.T, ends, axis=-1)
    saved = [contact_forces(chain, wall, *row) for row in zip(x, v, q, p, strict=True)]
    _, elastic, damping, _ = (np.array(column) for column in zip(*saved, strict=True))
    energies = (
        0.5 * v**2 @ chain.mass,
        chain.elastic.energy(elastic).sum(axis=1),
        0.5 * (x - anchor) ** 2 @ leaf,
        0.5 * (p**2 + (wall.omega * q) ** 2).sum(axis=1),
        0.5 * s * elastic[:, -1] ** 2,
        lost[:, 0],
        lost[:, 1],
        np.zeros(len(t)),  # friction
        chain.preload * (x[:, -1] - x[0, -1]),
        chain.gravity * (x - x[0]) @ chain.mass,
    )
    total = sum(energies[:8]) - energies[8] - energies[9]
    largest = energies[0][0] or np.abs(total).max() or 1.0
    return Trajectory(
        t,
        x,
        v,
        elastic + damping,
        q @ h,
        p @ h,
        q.astype(np.float32),
        *energies,
        total,
        float(t[-1] / n_steps),
        n_steps,
        "dop853",
        float(np.abs(total - total[0]).max() / largest),
        None,
        State(x[-1], v[-1], q[-1], p[-1], 0.0),
    )


class ContactForces(NamedTuple):
    """Indentations and forces of the n contacts, the last one at the wall."""

    delta: np.ndarray  # (n,) [m] indentation
    elastic: np.ndarray  # (n,) [N]
    damping: np.ndarray  # (n,) [N]
    approach: np.ndarray  # (n,) [m/s]


def contact_forces(
    chain: Chain, wall: CoupledWall, x: np.ndarray, v: np.ndarray, q: np.ndarray, p: np.ndarray
) -> ContactForces:
    """Forces of spheres at x, v (n,) and modes at q, p (k,), positive where they push apart.

    The residual spring s is in series with the last contact: x_n - h^T q = delta + s F(delta).
    Raises CouplingError where s < 0 leaves that without an answer.
    """
    s, law = wall.residual_compliance, chain.elastic
    gap = np.append(x[:-1] - x[1:], x[-1] - wall.reading @ q)
    delta = np.maximum(gap, 0.0)
    last = law.at(np.s_[-1:])
    delta[-1] = elastic_indentation(0, gap[-1], s, last.A, last.shape)
    if math.isnan(delta[-1]):
        raise CouplingError(
            f"the contact became unstable: a residual compliance of {s:.3g} m/N answers no force "
            f"to an approach of {gap[-1]:.3g} m; lower the cutoff frequency."
        )
    approach = np.append(v[:-1] - v[1:], v[-1] - wall.reading @ p)
    elastic = law.force(delta)
    gamma = np.zeros(len(x)) if chain.gamma is None else np.asarray(chain.gamma)
    damping = gamma * approach * (1.0 if chain.jumps else elastic)
    damping = np.where(delta > 0, damping, 0.0)

    # the contact closes by 1 / (1 + s k) of the approach, and of its damping the same share reaches
    # the wall: hence the square
    stiffness = last.stiffness(delta[-1:])[0]
    damping[-1] /= (1 + s * stiffness) ** 2
    if DAMPING_LAWS[chain.dissipation].clipped:  # contacts do not pull
        damping = np.maximum(damping, -elastic)
    return ContactForces(delta, elastic, damping, approach)


def with_coupled_error(
    chain: Chain, wall: CoupledWall, v0: ArrayLike, trajectory: Trajectory, *, error: float
) -> Trajectory:
    """The trajectory of march_coupled at this error from velocities v0 (n,) [m/s] with the largest
    velocity difference to a coarser march, over the largest initial speed: a cautious
    error_estimate, as nearly all of the difference is the error of the coarser march. `errors` are
    the differences of every sphere and contact. Raises CouplingError.
    """
    # 32 times the error of a step, and twice the longest step: of six runs of five spheres at
    # errors of 1e-6 to 1e-10 the coarser took 0.5 to 0.7 of the steps and was 2.7 to 120 times as
    # wrong
    coarser = march_coupled(
        chain, wall, v0, duration=float(trajectory.t[-1]), error=32.0 * error,
        n_save=trajectory.t.size - 1, largest_step=2 * longest_step(wall),
    )  # fmt: skip
    scale = float(np.abs(v0).max()) or 1.0
    errors = ArrayErrors(
        *(
            np.abs(getattr(coarser, name) - getattr(trajectory, name)).max(axis=0)
            for name in ArrayErrors._fields
        )
    )
    return trajectory._replace(error_estimate=float(errors.v.max()) / scale, errors=errors)


def longest_step(wall: CoupledWall, stiffest: float = 100.0) -> float:
    """Longest step [s] of a march, well below where the Runge-Kutta method turns unstable; inf for
    a wall whose modes are all rigid. Raises CouplingError for dampers `stiffest` times as fast as
    the fastest mode, with which a march would take minutes."""
    fastest = wall.omega.max(initial=0.0)
    decay = np.abs(wall.D).max(initial=0.0) and np.linalg.eigvalsh(wall.D)[-1]
    if decay > stiffest * fastest:
        raise CouplingError(
            f"the wall's dampers settle within {1 / decay:.1e} s, {decay / fastest:.1e} times as "
            f"fast as its fastest mode (allowed is {stiffest:g}); dampers that stiff hold their "
            "direction rigid: make it so, or lower their coefficients."
        )
    # the method of order 8 is stable to about 6 / decay and 5 / fastest; half and a fifth of these
    # leave room where both act at once
    return 1 / max(fastest, decay / 3) if fastest > 0 else np.inf


def energy_gain(trajectory: Trajectory) -> EnergyGain:
    """Energy that a run has made: total energy above its start over the striker's energy."""
    gain = trajectory.energy_total - trajectory.energy_total[0]
    scale = trajectory.energy_kinetic[0] or 1.0
    worst = int(gain.argmax())
    return EnergyGain(
        float(gain[worst] / scale), float(gain[-1] / scale), float(trajectory.t[worst])
    )
