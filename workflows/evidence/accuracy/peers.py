"""Alternatives of a user: integrators of scipy and SUNDIALS on the chain's equations.

    m_i x_i'' = F_{i-1} - F_i - k_i (x_i - a_i) + P [i = N],   q'' + 2 zeta omega q' + omega^2 q =
    phi F_N,   u_d' = F_N / c,   F = A delta^(3/2) and its damping

compiled, in absolute coordinates, y = (x, v, q, q', u_d), the dashpot's u_d where there is one. The
contact laws are written here once more, so that an error of the chain's kernels shows beside them.
"""

from collections.abc import Callable
from importlib.util import find_spec
from typing import NamedTuple

import numpy as np
from scipy import integrate

from beadwave import dem
from beadwave.dem.kernels.compiled import njit
from beadwave.dem.kernels.laws import DAMPING_LAWS
from beadwave.dem.spheres import time_scale
from beadwave.workflows.evidence.accuracy.problems import Problem

NONE, LINEAR, CLIPPED, HUNT_CROSSLEY = (
    DAMPING_LAWS[name].number for name in ("none", "linear", "linear-clipped", "hunt-crossley")
)


class PeerSolution(NamedTuple):
    """Saved states and what they cost; steps is None where the integrator does not count them."""

    y: np.ndarray  # (k, 2 n + 2 n_modes), one more for a dashpot
    steps: int | None
    evaluations: int


class PeerEquations(NamedTuple):
    """The right-hand side's constants; the absent parts are None and not compiled."""

    spheres: np.ndarray  # (2, n) 1/m, A of the contact behind each sphere (0: none)
    modes: np.ndarray | None  # (3, n_modes) phi, omega^2, 2 zeta omega
    residual: float | None  # compliance in series with the last contact [m/N]
    springs: np.ndarray | None  # (3, n) stiffness and anchor of leaf springs, steady force
    damping: tuple[np.ndarray, int] | None  # (n,) coefficient of each contact, law
    mobility: float | None  # of the dashpot [m/(N s)]


@njit(error_model="numpy", fastmath=True)
def indentation(gap, A, s):
    """d of  d + s A d^(3/2) = gap, by Newton's method from above."""
    if gap <= 0.0:
        return 0.0
    e = s * A
    y = np.sqrt(gap)
    if e > 0.0:
        y = min(y, np.cbrt(gap / e))
    for _ in range(60):
        change = (gap - y * y * (1.0 + e * y)) / (y * (2.0 + 3.0 * e * y))
        y += change
        if abs(change) <= 1e-15 * y:
            break
    return y * y


@njit(error_model="numpy", fastmath=True)
def damped(force, approach, gamma, law):
    """Force of a contact with its damping."""
    if force == 0.0 or law == NONE:
        return force
    if law == HUNT_CROSSLEY:
        return max(force * (1.0 + gamma * approach), 0.0)
    total = force + gamma * approach
    return total if law == LINEAR else max(total, 0.0)


@njit(error_model="numpy", fastmath=True)
def rate_into(y, out, spheres, modes, residual, springs, damping, mobility):
    """Write y' to out; `wall` and `speed` are the displacement and velocity at the contact."""
    # u_w = sum phi_j q_j + u_d, its rate without the dashpot's
    n = spheres.shape[1]
    wall = 0.0
    speed = 0.0
    if modes is not None:
        for j in range(modes.shape[1]):
            wall += modes[0, j] * y[2 * n + j]
            speed += modes[0, j] * y[2 * n + modes.shape[1] + j]
    if mobility is not None:
        wall += y[y.size - 1]

    # m_i x_i'' = F_(i-1) - F_i - k_i (x_i - a_i) + P_i, from the striker to the wall
    F_left = 0.0  # of the contact that pushes the sphere on
    for i in range(n):
        gap = y[i] - (y[i + 1] if i < n - 1 else wall)
        if residual is not None and i == n - 1:
            gap = indentation(gap, spheres[1, i], residual)
        gap = max(gap, 0.0)
        force = spheres[1, i] * gap * np.sqrt(gap)
        if damping is not None:
            gamma, law = damping
            approach = y[n + i] - (y[n + i + 1] if i < n - 1 else speed)
            force = damped(force, approach, gamma[i], law)
        total = F_left - force
        if springs is not None:
            total += springs[2, i] - springs[0, i] * (y[i] - springs[1, i])
        out[i] = y[n + i]
        out[n + i] = spheres[0, i] * total
        F_left = force

    # q'' = phi F - omega^2 q - 2 zeta omega q', u_d' = mobility F; F_left is now the wall's force
    if modes is not None:
        k = modes.shape[1]
        for j in range(k):
            q, p = y[2 * n + j], y[2 * n + k + j]
            out[2 * n + j] = p
            out[2 * n + k + j] = modes[0, j] * F_left - modes[1, j] * q - modes[2, j] * p
    if mobility is not None:
        out[y.size - 1] = mobility * F_left


@njit(error_model="numpy")
def rate(y, spheres, modes, residual, springs, damping, mobility):
    """y' of y."""
    out = np.empty_like(y)
    rate_into(y, out, spheres, modes, residual, springs, damping, mobility)
    return out


def equations(problem: Problem) -> PeerEquations:
    """The constants of a problem."""
    chain, wall = problem.chain, problem.wall
    A = np.append(chain.A, np.zeros(chain.mass.size - chain.A.size))
    modes = springs = residual = damping = mobility = None
    if wall is not None and wall.omega.size:
        modes = np.array([wall.phi, wall.omega**2, 2 * wall.zeta * wall.omega])
    if wall is not None and wall.residual_compliance:
        residual = float(wall.residual_compliance)
    if np.any(chain.leaf_stiffness) or chain.steady.any():
        springs = np.array([*chain.springs, chain.steady])
    if chain.dissipation != "none":
        gamma = np.append(chain.gamma, np.zeros(A.size - chain.A.size))
        damping = gamma, DAMPING_LAWS[chain.dissipation].number
    if wall is not None and wall.mobility:
        mobility = float(wall.mobility)
    return PeerEquations(np.array([1 / chain.mass, A]), modes, residual, springs, damping, mobility)


def initial_state(problem: Problem) -> np.ndarray:
    """y (2 n + 2 n_modes,), one more for a dashpot, at rest in equilibrium, with the velocities
    v0; raises what `dem.equilibrium` raises where there is none."""
    static = dem.equilibrium(problem.chain, problem.wall)
    u_d = np.zeros(_n_dashpots(problem))
    return np.concatenate([static.x, problem.v0, static.q, np.zeros_like(static.q), u_d])


def _n_dashpots(problem: Problem) -> int:
    return int(problem.wall is not None and problem.wall.mobility > 0.0)


def magnitudes(problem: Problem) -> np.ndarray:
    """Typical size of each entry of y, as long as y: what an absolute tolerance must be measured
    by. Coordinates of mass-normalised modes have the unit kg^1/2 m."""
    n, speed = problem.v0.size, float(np.abs(problem.v0).max())
    k = 0 if problem.wall is None else problem.wall.omega.size
    reach = speed * time_scale(problem.chain.mass[0], problem.chain.A[0], speed)
    modal = np.sqrt(problem.chain.mass[0])
    sizes = [reach, speed, modal * reach, modal * speed, reach]
    return np.repeat(sizes, [n, n, k, k, _n_dashpots(problem)])


def reference(problem: Problem) -> PeerSolution:
    """DOP853 at the limit of its tolerances, its steps held far below the contacts' periods."""
    return adaptive("DOP853", steps=4000)(problem, 1e-16)


Solver = Callable[[Problem, float], PeerSolution]


def adaptive(method: str, *, steps: int = 0) -> Solver:
    """One of scipy's `solve_ivp` methods, as a function of the problem and the tolerance; it takes
    at least `steps` steps."""

    def solve(problem: Problem, tolerance: float) -> PeerSolution:
        constants = equations(problem)
        # 2.3e-14: scipy raises anything below 100 eps
        solution = integrate.solve_ivp(
            lambda t, y: rate(y, *constants),
            (0.0, problem.duration),
            initial_state(problem),
            method=method,
            t_eval=_instants(problem),
            rtol=max(tolerance, 2.3e-14),
            atol=tolerance * magnitudes(problem),
            max_step=problem.duration / steps if steps else np.inf,
        )
        return PeerSolution(solution.y.T, None, solution.nfev)

    return solve


def odeint(problem: Problem, tolerance: float) -> PeerSolution:
    """LSODA without an interpreter between its steps, scipy's `odeint`."""
    constants = equations(problem)
    y, report = integrate.odeint(
        lambda y, t: rate(y, *constants),
        initial_state(problem),
        _instants(problem),
        rtol=tolerance,
        atol=tolerance * magnitudes(problem),
        mxstep=100_000,
        full_output=True,
    )
    return PeerSolution(y, int(report["nst"][-1]), int(report["nfe"][-1]))


def compiled_dop853(problem: Problem, tolerance: float) -> PeerSolution:
    """DOP853 without an interpreter between its steps, scipy's `ode`; it stops at every save."""
    constants, unit, calls = equations(problem), magnitudes(problem), [0]

    def right_hand_side(t, y):
        """y' in units of `magnitudes`: this integrator takes one tolerance for all entries."""
        calls[0] += 1
        return rate(y * unit, *constants) / unit

    solver = integrate.ode(right_hand_side)
    solver.set_integrator("dop853", rtol=tolerance, atol=tolerance, nsteps=100_000)
    solver.set_initial_value(initial_state(problem) / unit, 0.0)
    saved = [solver.y, *(solver.integrate(t) for t in _instants(problem)[1:])]
    return PeerSolution(np.array(saved) * unit, None, calls[0])


def cvode(method: str) -> Solver:
    """CVODE of SUNDIALS, where its wheel is installed."""

    def solve(problem: Problem, tolerance: float) -> PeerSolution:
        from sksundae.cvode import CVODE

        constants = equations(problem)
        solver = CVODE(
            lambda t, y, out: rate_into(y, out, *constants),
            method=method,
            rtol=tolerance,
            atol=tolerance * magnitudes(problem),
            max_num_steps=100_000,
        )
        solution = solver.solve(_instants(problem), initial_state(problem))
        return PeerSolution(solution.y, None, int(solution.nfev))

    return solve


SCIPY: dict[str, Solver] = {
    "RK45": adaptive("RK45"),
    "DOP853": adaptive("DOP853"),
    "LSODA": adaptive("LSODA"),
    "Radau": adaptive("Radau"),
    "odeint": odeint,
    "ode-dop853": compiled_dop853,
}


SUNDIALS: dict[str, Solver] = {"CVODE-Adams": cvode("Adams"), "CVODE-BDF": cvode("BDF")}


def peers() -> dict[str, Solver]:
    """All solvers that are installed, by name."""
    return {**SCIPY, **SUNDIALS} if has_sundials() else SCIPY


def has_sundials() -> bool:
    """True if the optional wheel of SUNDIALS is installed."""
    return find_spec("sksundae") is not None


def energy_error(problem: Problem, y: np.ndarray) -> float | None:
    """Largest change of the energy over the kinetic energy at the start, of saved states y
    (k, size); None with any damping, whose loss the others do not book."""
    lossy = problem.wall is not None and (np.any(problem.wall.zeta) or problem.wall.mobility)
    if lossy or problem.chain.dissipation != "none":
        return None
    total = energy(problem, y)
    kinetic = 0.5 * float(problem.chain.mass @ problem.v0**2)
    return float(np.abs(total - total[0]).max() / kinetic)


def energy(problem: Problem, y: np.ndarray) -> np.ndarray:
    """(k,) [J] of saved states (k, size): kinetic, Hertz' 2/5 F delta, springs and modes, less the
    work of steady forces."""
    chain, n = problem.chain, problem.v0.size
    constants = equations(problem)
    x, v, modal = y[:, :n], y[:, n : 2 * n], y[:, 2 * n :]
    k = modal.shape[1] // 2
    wall = modal[:, :k] @ constants.modes[0] if constants.modes is not None else 0.0 * x[:, 0]
    overlap = np.maximum(x - np.column_stack([x[:, 1:], wall]), 0.0)
    if constants.residual is not None:
        A = constants.spheres[1, -1]
        overlap[:, -1] = [indentation(gap, A, constants.residual) for gap in overlap[:, -1]]
    force = constants.spheres[1] * overlap**1.5
    total = 0.5 * v**2 @ chain.mass + 0.4 * (force * overlap).sum(axis=1) - x @ chain.steady
    if constants.residual is not None:
        total += 0.5 * constants.residual * force[:, -1] ** 2
    if constants.springs is not None:
        stiffness, anchor, _ = constants.springs
        total += 0.5 * (x - anchor) ** 2 @ stiffness
    if constants.modes is not None:
        q, p = np.split(modal, 2, axis=1)
        total += 0.5 * (p**2).sum(axis=1) + 0.5 * q**2 @ constants.modes[1]
    return total


def _instants(problem: Problem) -> np.ndarray:
    """The saves, with the start (n_save + 1,) [s]."""
    return np.linspace(0.0, problem.duration, problem.n_save + 1)
