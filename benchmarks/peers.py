"""Modes, condensation and a chain by the programs that a user would take instead.

You will see, for the modes of an assembly, its Craig-Bampton model at the contact, and a chain at a
rigid and at a reduced wall: each method with its error, the seconds of later calls and of the first
one, those of the processor, and the most memory; then the fastest other method of each.

All get the same matrices or the same spheres, one thread, and a process of their own, whose memory
holds the interpreter, its libraries and the matrices. Integrators are compared at equal error: each
gets the tolerance or the step (column "setting") with which its true error, against one reference
run, is ours; we search for our step ourselves within the seconds stated. The error of a
condensation is that of the static compliance and of the fixed-interface frequencies; references of
both are solved with another shift and refined. CalculiX assembles the matrices itself, prints seven
digits, and finds modes and compliance in one run, which stands in both places.

Run it: python benchmarks/peers.py [SCENE]        some thirty processes: minutes; rig-rom by default
"""

import os
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from importlib.util import find_spec
from multiprocessing import get_context
from shutil import which
from time import perf_counter, process_time
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator, eigsh

from beadwave import dem, fem, rom
from beadwave.coupling.reduced_wall import wall_from_reduced
from beadwave.fem.exchange.abaqus import input_deck
from beadwave.system import adding, children_seconds, largest_child, peak_memory, providing
from beadwave.workflows.evidence.accuracy.peers import SCIPY, SUNDIALS
from beadwave.workflows.evidence.accuracy.problems import Problem
from beadwave.workflows.evidence.accuracy.runs import reference
from beadwave.workflows.files.scene import scene as load_scene
from beadwave.workflows.report.tables import Table, text
from beadwave.workflows.scene.required_parts import with_assembly, with_chain
from beadwave.workflows.stages.structure import assembly as stages
from beadwave.workflows.stages.structure.reduction import boundary_of

BEADWAVE, SUPERLU, PARDISO, CALCULIX = "beadwave", "scipy, SuperLU", "scipy, PARDISO", "CalculiX"
LAMMPS, EXUDYN = "LAMMPS", "Exudyn"
MODES, CONDENSATION = "modes", "condensation"
# modules and programs that methods need, and what adds them
NEEDED = {
    PARDISO: ("pypardiso", adding("fast")), CALCULIX: ("ccx", providing("calculix-ccx")),
    **dict.fromkeys(SUNDIALS, ("sksundae", adding("peers"))),
    LAMMPS: ("lammps", adding("verify")), EXUDYN: ("exudyn", adding("verify")),
}  # fmt: skip
# tried in the search for a setting, the coarsest first
TOLERANCES = tuple(10.0**-k for k in range(2, 12))
STEPS = tuple(8e-7 / 2**k for k in range(7))  # [s]
SLOW = 20.0  # [s] of a call that is not repeated, or followed by a finer setting
SHIFT = -((2 * np.pi * 20.0) ** 2)  # of the references, which no method takes
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


class EigenProblem(NamedTuple):
    """Matrices, the contact, and how many modes are wanted; CalculiX takes the deck."""

    K: object  # (n, n), sparse
    M: object
    w: NDArray[np.float64]  # (n,)
    boundary: NDArray[np.int64]  # (k,)
    n_modes: int
    deck: str | None = None


class Row(NamedTuple):
    """A line of the table."""

    work: str
    method: str
    setting: float | None  # tolerance, or step [s]
    error: float
    warm: float  # [s]
    cold: float  # [s] of the first call
    processor: float  # [s]
    processor_cold: float  # [s]
    gigabytes: float | None


COLUMNS = ("work", "method", "setting", "error", "warm [s]", "cold [s]", "processor [s]",
           "processor, cold [s]", "memory [GB]")  # fmt: skip


def main(
    name: str = "rig-rom",
    # times the scene's element sizes: 15 363 unknowns of the rig, where CalculiX takes 3.4 s of the
    # processor; with its own 49 062 it takes over two minutes
    coarser: float = 3.0,
    n_modes: int = 10,
    error: float = 1e-4,  # that our march of the chain is asked for
    duration: float = 5e-4,  # [s]; Exudyn at equal error then takes 1.6 s of the processor
) -> list[Row]:
    """Print the table of a scene; returns its rows."""
    scene = with_chain(with_assembly(load_scene(name, ())))
    scene = scene.but(mesh={"scale": coarser * scene.mesh.scale})
    mesh = stages.mesh(scene)
    model = stages.model(scene, mesh)
    contact = stages.contact(scene, mesh, model)
    deck = input_deck(model, mesh.materials, n_modes=n_modes, w=contact.w)
    boundary = boundary_of(contact, None)
    structure = EigenProblem(model.K, model.M, contact.w, boundary, n_modes, deck)
    body = rom.free_modes(model.K, model.M, contact.w, rom.Selection(n_modes=12))._replace(T=None)

    # equal spheres, the first of the scene's: all that LAMMPS' and Exudyn's scenes here take
    table = scene.chain
    material = [
        float(np.ravel(x)[0]) for x in (table.radius, table.density, table.young, table.poisson)
    ]
    flat = dem.Flat(*material[2:])
    chain = dem.row_of_spheres(*material, count=table.count, flat=flat)
    v0 = float(scene.striker.velocity) * np.eye(1, table.count)[0]
    rigid = Problem(chain, dem.rigid_wall(), v0, duration, np.arange(table.count), n_save=50)

    print(f"{name}: {model.K.shape[0]} unknowns\n")
    rows = [*structure_rows(structure)]
    for work, reduced in (("chain, rigid wall", None), ("chain, reduced wall", body)):
        rows += chain_rows(work, rigid, material, reduced, error)
    print(text(Table("peers", COLUMNS, tuple(rows))) + "\n")

    for work in dict.fromkeys(row.work for row in rows):
        of_work = [row for row in rows if row.work == work]
        ours = next(row for row in of_work if row.method == BEADWAVE)
        others = [row for row in of_work if row.method != BEADWAVE]
        best = min(others, key=lambda row: row.warm, default=ours)
        print(
            f"{work}: beadwave {ours.warm:.3g} s ({ours.cold:.3g} s the first time), error "
            f"{ours.error:.1e}; fastest other one, {best.method}, {best.warm:.3g} s "
            f"({best.cold:.3g} s), error {best.error:.1e}"
        )
        for row in of_work:
            if row.setting and row.error > 1.1 * ours.error:
                print(f"{row.method} ({work}) does not reach this error within {SLOW:g} s a run")
    return rows


# ---- the structure -----------------------------------------------------------------------------


def structure_rows(structure: EigenProblem) -> Iterator[Row]:
    """Modes and condensation by every method that is installed."""
    structure = structure._replace(K=sp.csc_array(structure.K), M=sp.csc_array(structure.M))
    truth = structure_truth(structure)

    def error(work: str, values: NDArray[np.float64]) -> float:
        """Largest relative difference of values (k,) to the truth, of as many as both have."""
        k = min(len(values), len(truth[work]))
        return float(np.abs(values[:k] / truth[work][:k] - 1).max())

    for work, function in ((MODES, modes), (CONDENSATION, condensation)):
        for method in (BEADWAVE, SUPERLU, PARDISO):
            if installed(method, work):
                run = in_own_process(method, work, measured, method, function, method, structure)
                yield from row_of(work, method, None, run, lambda v, work=work: error(work, v))
    if structure.deck is not None and installed(CALCULIX, MODES):
        run = in_own_process(CALCULIX, MODES, measured, CALCULIX, by_calculix, structure.deck)
        yield from row_of(MODES, CALCULIX, None, run, lambda v: error(MODES, v[:-1]))
        yield from row_of(CONDENSATION, CALCULIX, None, run, lambda v: error(CONDENSATION, v[-1:]))


def structure_truth(structure: EigenProblem) -> dict[str, NDArray[np.float64]]:
    """By work: frequencies (n_modes,) [Hz] of the modes; compliance w^T K^-1 w [m/N] and then the
    fixed-interface frequencies [Hz], (1 + n_modes,)."""
    K, M, w, b, n_modes, _ = structure
    i = np.setdiff1d(np.arange(len(w)), b)
    hz = []
    for A, B in ((K, M), (K[:, i][i], M[:, i][i])):
        A, B = sp.csc_array(A), sp.csc_array(B)
        hz.append(shift_inverted(A, B, n_modes, rom.superlu(A - SHIFT * B), SHIFT)[0])

    # u = K^-1 w, refined: u += K^-1 (w - K u) takes off what the factor's rounding left
    factor = rom.superlu(K)
    u = factor.solve(w)
    for _ in range(2):
        u += factor.solve(w - K @ u)
    return {MODES: hz[0], CONDENSATION: np.append(w @ u, hz[1])}


def modes(method: str, structure: EigenProblem) -> NDArray[np.float64]:
    """The lowest frequencies (k,) [Hz]."""
    K, M, n_modes = structure.K, structure.M, structure.n_modes
    if method == BEADWAVE:
        return fem.modes(K, M, n_modes, factor=fem.held(K, M)).frequency_hz
    return shift_inverted(K, M, n_modes, factorise(method, K))[0]


def condensation(method: str, structure: EigenProblem) -> NDArray[np.float64]:
    """The compliance at the contact [m/N] and fixed-interface frequencies [Hz], (1 + k,), of a
    Craig-Bampton model: w_b^T S^-1 w_b with S the model's stiffness at the boundary."""
    K, M, w, b, n_modes, _ = structure
    if method == BEADWAVE:
        selection, n_b = rom.Selection(n_modes=n_modes, choice="lowest"), len(b)
        with fem.one_thread():
            reduced = rom.craig_bampton(K, M, w, b, selection, factorise=fem.factorised)
        compliance = w[b] @ np.linalg.solve(reduced.K[:n_b, :n_b], w[b])
        return np.append(compliance, np.sqrt(np.sort(np.diag(reduced.K)[n_b:])) / (2 * np.pi))

    # as in a textbook: one factor of K_ii for constraint modes and fixed-interface modes,
    # Psi = -K_ii^-1 K_ib, S = K_bb + K_bi Psi
    i = np.setdiff1d(np.arange(len(w)), b)
    K_ii, K_ib, M_ii = (A.tocsc() for A in (K[:, i][i], K[:, b][i], M[:, i][i]))
    factor = factorise(method, K_ii)
    psi = -factor.solve(K_ib.toarray())
    S = K[:, b][b].toarray() + K_ib.T @ psi
    hz, phi = shift_inverted(K_ii, M_ii, n_modes, factor)
    T = np.zeros((len(w), len(b) + n_modes))
    T[b, : len(b)], T[i, : len(b)], T[i, len(b) :] = np.eye(len(b)), psi, phi
    T.T @ (M @ T)  # the reduced mass, which belongs to the work
    return np.append(w[b] @ np.linalg.solve(S, w[b]), hz)


def by_calculix(deck: str) -> NDArray[np.float64]:
    """Frequencies [Hz] and the compliance [m/N] behind them, (k + 1,), of one run."""
    from programs.calculix import answer

    results = answer(deck)
    return np.append(results.frequency_hz, results.compliance)


def shift_inverted(K, M, n_modes: int, factor, sigma: float = 0.0):
    """Frequencies (k,) [Hz], ascending, and mass-normalised shapes (n, k) by scipy's `eigsh`, to
    rounding, with a factor of K - sigma M."""
    inverse = LinearOperator(K.shape, matvec=factor.solve)
    start = np.random.default_rng(0).standard_normal(K.shape[0])
    squared, phi = eigsh(K, n_modes, M, sigma=sigma, OPinv=inverse, v0=start)
    order = np.argsort(squared)
    return np.sqrt(np.maximum(squared[order], 0.0)) / (2 * np.pi), phi[:, order]


def factorise(method: str, A):
    if method == PARDISO:
        from beadwave.fem.modes.solver.factorisation import Pardiso

        return Pardiso(A)
    return rom.superlu(A)


# ---- the chain ---------------------------------------------------------------------------------


def chain_rows(
    work: str, rigid: Problem, material: list[float], body: rom.ReducedModel | None, error: float
) -> Iterator[Row]:
    """The chain at a body, or at a rigid wall without one, by every integrator that is installed,
    with the setting of our true error, where we ask for `error`. LAMMPS has no reduced wall, our
    scene of Exudyn needs one."""
    problem = rigid
    if body is not None:
        problem = rigid._replace(wall=wall_from_reduced(body, half_space=0.0, cutoff_hz=np.inf))
    truth, speed = reference(problem).v[1:], np.abs(rigid.v0).max()

    def error_of(v: NDArray[np.float64]) -> float:
        """Largest error of velocities (n_save, n) over the striker's speed."""
        return float(np.abs(v - truth).max() / speed)

    case, setting, ours = (problem, material, body), error, None
    for method in (BEADWAVE, *SCIPY, *SUNDIALS, LAMMPS if body is None else EXUDYN):
        if not installed(method, work):
            continue
        if ours is not None:
            setting = in_own_process(
                method, work, setting_of_equal_error, method, case, truth, ours.error
            )
        if setting is not None:
            run = in_own_process(method, work, measured, method, velocities, method, case, setting)
            for row in row_of(work, method, setting, run, error_of):
                ours = ours or row
                yield row
        if ours is None:  # without our error there is no equal one
            return


def velocities(method: str, case: tuple, setting: float) -> NDArray[np.float64]:
    """Velocities (n_save, n) [m/s] of the chain; setting is an error, a tolerance or a step [s].

    An integrator that gives up has fewer saves.
    """
    problem, material, body = case
    saves = {"duration": problem.duration, "n_save": problem.n_save}
    if method == BEADWAVE:
        arguments = problem.chain, problem.wall, problem.v0
        return dem.march_to_error(*arguments, error=setting, **saves).trajectory.v[1:]
    if method == LAMMPS:
        from programs import lammps

        spheres = lammps.LammpsSpheres(*material)
        return lammps.velocities(spheres, problem.v0, dt=setting, wall=True, **saves)
    if method == EXUDYN:
        from programs import exudyn

        return exudyn.velocities(problem.chain, body, problem.v0, dt=setting, **saves)
    n = problem.v0.size
    return (SCIPY | SUNDIALS)[method](problem, setting).y[1:, n : 2 * n]


def setting_of_equal_error(
    method: str, case: tuple, truth: NDArray[np.float64], wanted: float
) -> float:
    """The setting with which a method's velocities differ from the truth (n_save, n) by `wanted` of
    the striker's at most; the finest one that was tried where none does."""
    speed, seconds = np.abs(case[0].v0).max(), [0.0]

    def error(setting: float) -> float:
        """Of the velocities with a setting; infinite of an integrator that gives up."""
        started = perf_counter()
        v = velocities(method, case, setting)
        seconds[0] = perf_counter() - started
        return float(np.abs(v - truth).max() / speed) if len(v) == len(truth) else np.inf

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


# ---- one method in a process of its own --------------------------------------------------------


def installed(method: str, work: str) -> bool:
    """True if a method's module or program is there; says what adds it if not."""
    name, remedy = NEEDED.get(method, ("numpy", ""))
    there = bool(which(name) if method == CALCULIX else find_spec(name))
    if not there:
        print(f"{method} ({work}) is not installed; {remedy} adds it")
    return there


def in_own_process(method: str, work: str, function: Callable, *arguments) -> Any | None:
    """The value of a call in a process with one thread; prints why there is none."""
    with (
        patch.dict(os.environ, dict.fromkeys(THREADS, "1")),
        ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool,
    ):
        try:
            return pool.submit(function, *arguments).result()
        except Exception as error:
            lines = str(error).strip().splitlines() or [type(error).__name__]
            print(f"{method} ({work}) gave no result: {lines[-1]}")
            return None


def measured(method: str, work: Callable, *arguments) -> tuple:
    """The value of a call, (clock, processor) seconds of the quickest of some later calls and of
    the first, and the most memory [bytes] of this process. Later calls last 1 s in all; a first
    call of SLOW seconds is not repeated."""
    seconds: list[tuple[float, float]] = []
    while len(seconds) < 21 and (not seconds or sum(s for s, _ in seconds[1:]) < 1.0):
        started, processor = perf_counter(), process_time() + children_seconds()
        value = work(*arguments)
        now = process_time() + children_seconds()
        seconds.append((perf_counter() - started, now - processor))
        if seconds[0][0] >= SLOW:
            break
    # ccx is a child of this process, which holds less than it when it starts it
    of_child = largest_child() if method == CALCULIX else None
    return value, min(seconds[1:] or seconds), seconds[0], of_child or peak_memory()


def row_of(
    work: str, method: str, setting: float | None, run: tuple | None, error: Callable
) -> Iterator[Row]:
    """The row of a run as `measured` has it; none without one."""
    if run is not None:
        value, (warm, processor), (cold, processor_cold), memory = run
        gigabytes = None if memory is None else memory / 1e9
        yield Row(work, method, setting, error(value), warm, cold, processor, processor_cold,
                  gigabytes)  # fmt: skip


if __name__ == "__main__":
    main(*sys.argv[1:])
