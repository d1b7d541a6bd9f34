"""One method's work in a process of its own: its first call, its later ones, its memory.

python -m beadwave.workflows.evidence.accuracy.peer_process FILE

calls the function that is pickled in the file with the arguments beside it, and leaves there what
it returns. Its libraries compute in one thread, which the environment it is started in says.
"""

import sys
from collections.abc import Callable
from pathlib import Path
from pickle import dumps, loads
from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator, eigsh

from beadwave.system import largest_child, peak_memory
from beadwave.workflows.evidence.accuracy.cost import Timed, timed

BEADWAVE, SUPERLU, PARDISO, CALCULIX = "beadwave", "scipy, SuperLU", "scipy, PARDISO", "CalculiX"
MODES, CONDENSATION = "modes", "condensation"
LAMMPS, EXUDYN = "LAMMPS", "Exudyn"
# what the search for a setting tries, the coarsest first
TOLERANCES = tuple(10.0**-k for k in range(2, 12))
STEPS = tuple(8e-7 / 2**k for k in range(7))  # [s]
SLOW = 20.0  # [s] of a call that is not repeated, or followed by a finer setting


class EigenProblem(NamedTuple):
    """Matrices, the contact, and how many modes are wanted; CalculiX takes the deck."""

    K: object  # (n, n), sparse
    M: object
    w: NDArray[np.float64]  # (n,)
    boundary: NDArray[np.int64]  # (k,)
    n_modes: int
    deck: str | None = None


class Spheres(NamedTuple):
    """Equal spheres in a row, the first of which moves; the wall is of their material."""

    radius: float  # [m]
    density: float  # [kg/m^3]
    young: float  # [Pa]
    poisson: float
    count: int
    speed: float  # [m/s]
    duration: float  # [s]
    n_save: int


def measured(work: Callable[..., Callable], method: str, *given) -> tuple[Timed, float | None]:
    """What the call of a method gives and takes, and the most memory [bytes] of this process."""
    # repeats of 1 s in all; a first call of SLOW is not repeated
    cost = timed(work(method, *given), budget=1.0, repeats=20, slow=SLOW)
    # ccx is a child of this process, which holds less than it when it starts it
    of_child = largest_child() if method == CALCULIX else None
    return cost, of_child or peak_memory()


def modes(method: str, structure: EigenProblem) -> Callable[[], NDArray[np.float64]]:
    """A call that gives the lowest frequencies (k,) [Hz]; CalculiX' the compliance [m/N] behind
    them, (k + 1,)."""
    K, M, _, _, n_modes, deck = structure
    if method == CALCULIX:
        from beadwave.fem.calculix import answer

        def frequencies_and_compliance() -> NDArray[np.float64]:
            """(k + 1,) of one run of CalculiX."""
            # its deck's static step comes along, for its line of the condensation
            results = answer(deck)
            return np.append(results.frequency_hz, results.compliance)

        return frequencies_and_compliance
    if method == BEADWAVE:
        from beadwave import fem

        return lambda: fem.modes(K, M, n_modes, factor=fem.held(K, M)).frequency_hz
    factorise = _factorise(method)
    return lambda: shift_inverted(K, M, n_modes, factorise(K))[0]


def condensation(method: str, structure: EigenProblem) -> Callable[[], NDArray[np.float64]]:
    """A call that gives the compliance at the contact [m/N] and fixed-interface frequencies [Hz],
    (1 + k,), of a Craig-Bampton model.

    The compliance is w_b^T S^-1 w_b with S the model's stiffness at the boundary.
    """
    K, M, w, b, n_modes, _ = structure
    if method == BEADWAVE:
        from beadwave import fem, rom

        selection = rom.Selection(n_modes=n_modes, choice="lowest")

        def ours() -> NDArray[np.float64]:
            """(1 + k,) of our Craig-Bampton model, whose K holds S and the squares omega^2."""
            with fem.one_thread():
                reduced = rom.craig_bampton(K, M, w, b, selection, factorise=fem.factorised)
            n_b = len(b)
            compliance = w[b] @ np.linalg.solve(reduced.K[:n_b, :n_b], w[b])
            hz = np.sqrt(np.sort(np.diag(reduced.K)[n_b:])) / (2 * np.pi)
            return np.append(compliance, hz)

        return ours
    factorise, i = _factorise(method), np.setdiff1d(np.arange(len(w)), b)

    def theirs() -> NDArray[np.float64]:
        """(1 + k,) as in a textbook: one factor of K_ii for constraint modes and fixed-interface
        modes, Psi = -K_ii^-1 K_ib, S = K_bb + K_bi Psi."""
        K_ii, K_ib, M_ii = (A.tocsc() for A in (K[:, i][i], K[:, b][i], M[:, i][i]))
        factor = factorise(K_ii)
        psi = -factor.solve(K_ib.toarray())
        S = K[:, b][b].toarray() + K_ib.T @ psi
        hz, phi = shift_inverted(K_ii, M_ii, n_modes, factor)
        T = np.zeros((len(w), len(b) + n_modes))
        T[b, : len(b)], T[i, : len(b)], T[i, len(b) :] = np.eye(len(b)), psi, phi
        T.T @ (M @ T)  # the reduced mass, which belongs to the work
        return np.append(w[b] @ np.linalg.solve(S, w[b]), hz)

    return theirs


def shift_inverted(K, M, n_modes: int, factor, sigma: float = 0.0):
    """Frequencies (k,) [Hz], ascending, and mass-normalised shapes (n, k) by scipy's `eigsh`, to
    rounding, with a factor of K - sigma M."""
    inverse = LinearOperator(K.shape, matvec=factor.solve)
    start = np.random.default_rng(0).standard_normal(K.shape[0])
    squared, phi = eigsh(K, n_modes, M, sigma=sigma, OPinv=inverse, v0=start)
    order = np.argsort(squared)
    return np.sqrt(np.maximum(squared[order], 0.0)) / (2 * np.pi), phi[:, order]


def _factorise(method: str):
    if method == PARDISO:
        from beadwave.fem.factorisation import Pardiso

        return Pardiso
    from beadwave.rom import superlu

    return superlu


def chain_velocities(
    method: str, spheres: Spheres, body, setting: float
) -> Callable[[], NDArray[np.float64]]:
    """A call that gives velocities (n_save, n) [m/s] of spheres at a reduced body, or without one
    at a rigid wall; setting is an error, a tolerance or a step [s]."""
    from beadwave import dem
    from beadwave.workflows.evidence.accuracy import peers

    problem = problem_of(spheres, body)
    saves = {"duration": spheres.duration, "n_save": spheres.n_save}
    if method == BEADWAVE:
        arguments = problem.chain, problem.wall, problem.v0
        return lambda: dem.march_to_error(*arguments, error=setting, **saves).trajectory.v[1:]
    if method == LAMMPS:
        from beadwave.workflows.evidence.verify import lammps

        row = lammps.LammpsSpheres(*spheres[:4])
        return lambda: lammps.velocities(row, problem.v0, dt=setting, wall=True, **saves)
    if method == EXUDYN:
        from beadwave.workflows.evidence.verify import exudyn

        return lambda: exudyn.velocities(problem.chain, body, problem.v0, dt=setting, **saves)
    solver, n = peers.peers()[method], spheres.count
    return lambda: solver(problem, setting).y[1:, n : 2 * n]


def problem_of(spheres: Spheres, body):
    """The chain at a reduced body, or without one at a rigid wall."""
    from beadwave import dem
    from beadwave.workflows.evidence.accuracy.peers import Problem

    wall = dem.rigid_wall()
    if body is not None:
        from beadwave.coupling.reduced_wall import wall_from_reduced

        wall = wall_from_reduced(body, half_space=0.0, cutoff_hz=np.inf)
    flat = dem.Flat(spheres.young, spheres.poisson)
    chain = dem.row_of_spheres(*spheres[:4], count=spheres.count, flat=flat)
    v0 = spheres.speed * np.eye(1, spheres.count)[0]
    observed = np.arange(spheres.count)
    return Problem(chain, wall, v0, spheres.duration, observed, spheres.n_save)


def setting_of_equal_error(
    method: str, spheres: Spheres, body, truth: NDArray[np.float64], wanted: float
) -> float:
    """The setting with which a method's velocities differ from the truth (n_save, n) by `wanted` of
    the striker's at most; the finest one that was tried where none does."""
    seconds = [0.0]

    def error(setting: float) -> float:
        """Of the velocities with a setting; infinite of an integrator that gives up."""
        started = perf_counter()
        v = chain_velocities(method, spheres, body, setting)()
        seconds[0] = perf_counter() - started
        # an integrator that gives up leaves fewer saves
        return float(np.abs(v - truth).max() / spheres.speed) if len(v) == len(truth) else np.inf

    settings = STEPS if method in (LAMMPS, EXUDYN) else TOLERANCES
    return equal_error(error, settings, wanted, lambda: seconds[0] > SLOW)


def equal_error(
    error: Callable[[float], float],
    settings: tuple[float, ...],
    wanted: float,
    is_slow: Callable[[], bool] = lambda: False,
) -> float:
    """The setting whose error is at most `wanted` and nearest to it: the first of the settings that
    is fine enough, or the point between it and the one before where a power law of both has the
    error. Where none is fine enough, or runs become slow, the one with the smallest error."""
    errors: list[float] = []
    for setting in settings:
        errors.append(error(setting))
        if errors[-1] <= wanted or is_slow():
            break
    n = len(errors)
    if errors[-1] > wanted:
        return settings[int(np.argmin(errors))]
    if n == 1 or not np.isfinite(errors[-2]) or errors[-1] == 0.0:
        return settings[n - 1]

    # error = c setting^p between the last two: the setting of the error wanted, if it holds there
    share = np.log(errors[-2] / wanted) / np.log(errors[-2] / errors[-1])
    between = float(settings[n - 2] ** (1 - share) * settings[n - 1] ** share)
    return between if errors[-1] < error(between) <= wanted else settings[n - 1]


if __name__ == "__main__":
    file = Path(sys.argv[1])
    function, arguments = loads(file.read_bytes())
    file.write_bytes(dumps(function(*arguments)))
