"""The work of a run by the programs that a user would take instead: modes, condensation, chain.

All of them get the same matrices or the same spheres, one thread, and a process of their own. The
integrators of a chain are compared at equal error: each gets the tolerance or step with which its
true error, against one reference run, is ours. References of frequencies and compliance are solved
with another shift and refined.
"""

import sys
from collections.abc import Callable, Mapping
from importlib.util import find_spec
from os import environ
from pathlib import Path
from pickle import dumps, loads
from shutil import which
from subprocess import run
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from beadwave import rom
from beadwave.fem.abaqus import input_deck
from beadwave.system import adding
from beadwave.workflows.evidence.accuracy import peer_process
from beadwave.workflows.evidence.accuracy.peer_process import (
    BEADWAVE,
    CALCULIX,
    CONDENSATION,
    EXUDYN,
    LAMMPS,
    MODES,
    PARDISO,
    SUPERLU,
    EigenProblem,
    Spheres,
    measured,
    problem_of,
    shift_inverted,
)
from beadwave.workflows.evidence.accuracy.peers import SCIPY, SUNDIALS
from beadwave.workflows.evidence.accuracy.row import AccuracyRow, table_of
from beadwave.workflows.evidence.accuracy.runs import reference
from beadwave.workflows.evidence.study import rendered
from beadwave.workflows.files.run_folder import Picture
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.report.tables import Table
from beadwave.workflows.scene import Scene
from beadwave.workflows.scene.parts import with_assembly
from beadwave.workflows.stages import assembly as stages
from beadwave.workflows.stages.progress import Progress
from beadwave.workflows.stages.reduction import boundary_of

SCENE = "rig-rom"
ALONE = True  # some thirty processes, and CalculiX: minutes
RIGID, REDUCED = "chain, rigid wall", "chain, reduced wall"
HEADING = ("work", "method", "setting", "error", "warm [s]", "cold [s]", "processor [s]",
           "processor, cold [s]", "memory [GB]")  # fmt: skip
OPTIONAL = {  # methods, the module or program that they need, and what brings it
    "PARDISO": ((PARDISO,), "pypardiso", f"{adding('fast')} adds it"),
    CALCULIX: ((CALCULIX,), "ccx", "the package calculix-ccx of Debian brings it"),
    "SUNDIALS": (tuple(SUNDIALS), "sksundae", f"{adding('peers')} adds it"),
    LAMMPS: ((LAMMPS,), "lammps", f"{adding('verify')} adds it"),
    EXUDYN: ((EXUDYN,), "exudyn", f"{adding('verify')} adds it"),
}
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


class PeerOptions(NamedTuple):
    """The size of the work that is compared."""

    # times the scene's element sizes: 15 363 unknowns of the rig, where CalculiX takes 3.4 s of the
    # processor; with its own 49 062 it takes over two minutes
    coarser: float = 3.0
    n_modes: int = 10
    error: float = 1e-4  # that our march of the chain is asked for
    duration: float = 5e-4  # [s]; Exudyn at equal error then takes 1.6 s of the processor
    n_save: int = 50
    wall_modes: int = 12  # of the reduced wall


class Failed(NamedTuple):
    """A method that is installed and gave no result."""

    method: str
    work: str
    message: str  # last line of what it wrote


def peers(scene: Scene, progress: Progress, *, options: PeerOptions = PeerOptions()) -> Finding:
    """Modes, condensation and the chain beside other programs, at equal error: seconds, memory."""
    with_assembly(scene)

    # what is not installed is left out, and said
    absent, missing = {}, set()
    for name, (methods, needed, source) in OPTIONAL.items():
        if (which if name == CALCULIX else find_spec)(needed) is None:
            absent[name] = source
            missing |= {*methods}

    with progress("matrices"):
        coarse = scene.but(mesh={"scale": options.coarser * scene.mesh.scale})
        mesh = stages.mesh(coarse)
        model = stages.model(coarse, mesh)
        contact = stages.contact(coarse, mesh, model)
        structure = EigenProblem(
            model.K, model.M, contact.w, boundary_of(contact, None), options.n_modes,
            input_deck(model, mesh.materials, n_modes=options.n_modes, w=contact.w),
        )  # fmt: skip
        selection = rom.Selection(n_modes=options.wall_modes)
        body = rom.free_modes(model.K, model.M, contact.w, selection)._replace(T=None)

    # equal spheres, the first of the scene's: all that LAMMPS' and Exudyn's scenes here take
    table = scene.chain
    first = [
        float(np.ravel(x)[0]) for x in (table.radius, table.density, table.young, table.poisson)
    ]
    spheres = Spheres(
        *first, table.count, float(scene.striker.velocity), options.duration, options.n_save
    )
    results = structure_results(structure, missing, progress)
    for work, reduced in ((RIGID, None), (REDUCED, body)):
        results += chain_results(work, spheres, reduced, options.error, missing, progress)
    return finding(scene.name, model.K.shape[0], results, absent)


def structure_results(
    structure: EigenProblem, missing: set[str], progress: Progress
) -> list[AccuracyRow | Failed]:
    """Modes and condensation by every method that is there; CalculiX makes its own matrices."""
    structure = structure._replace(K=sp.csc_array(structure.K), M=sp.csc_array(structure.M))
    truth = structure_truth(structure)

    def off(work: str, values: NDArray) -> float:
        """Largest relative difference of values (k,) to the truth, of as many as both have."""
        k = min(len(values), len(truth[work]))
        return float(np.abs(values[:k] / truth[work][:k] - 1).max())

    results, both = [], None
    for work in (MODES, CONDENSATION):
        for method in (BEADWAVE, SUPERLU, PARDISO):
            if method in missing:
                continue
            with progress(f"{work}, {method}"):
                call = getattr(peer_process, work)
                outcome = in_own_process(work, method, measured, call, method, structure)
            results.append(_result(work, method, outcome, lambda v, work=work: off(work, v)))
        if structure.deck is None or CALCULIX in missing:
            continue

        # one run of CalculiX gives both; of the condensation it has the compliance alone
        if work == MODES:
            with progress(f"{MODES} and compliance, {CALCULIX}"):
                call = peer_process.modes
                both = in_own_process(MODES, CALCULIX, measured, call, CALCULIX, structure)
            results.append(_result(MODES, CALCULIX, both, lambda v: off(MODES, v[:-1])))
        elif not isinstance(both, Failed):
            results.append(_result(work, CALCULIX, both, lambda v: off(CONDENSATION, v[-1:])))
    return results


def structure_truth(structure: EigenProblem) -> Mapping[str, NDArray]:
    """By work: frequencies (n_modes,) [Hz] of the modes; compliance w^T K^-1 w [m/N] and then the
    fixed-interface frequencies [Hz], (1 + n_modes,), by shifts that none of the methods takes, and
    a refined solution."""
    K, M, w, b, n_modes, _ = structure
    i = np.setdiff1d(np.arange(len(w)), b)
    hz = []
    for A, B in ((K, M), (K[:, i][i], M[:, i][i])):
        A, B = sp.csc_array(A), sp.csc_array(B)
        sigma = -((2 * np.pi * 20.0) ** 2)
        hz.append(shift_inverted(A, B, n_modes, rom.superlu(A - sigma * B), sigma)[0])

    # u = K^-1 w, refined: u += K^-1 (w - K u) takes off what the factor's rounding left
    factor = rom.superlu(K)
    u = factor.solve(w)
    for _ in range(2):
        u += factor.solve(w - K @ u)
    return {MODES: hz[0], CONDENSATION: np.append(w @ u, hz[1])}


def chain_results(
    work: str, spheres: Spheres, body: rom.ReducedModel | None, error: float,
    missing: set[str], progress: Progress,
) -> list[AccuracyRow | Failed]:  # fmt: skip
    """The chain at a body, or at a rigid wall without one, by every integrator that is there, with
    the setting of our true error, where we ask for `error`. LAMMPS has no reduced wall, our scene
    of Exudyn needs one."""
    with progress(f"{work}, reference"):
        truth = reference(problem_of(spheres, body)).v[1:]

    def off(v: NDArray) -> float:
        """Largest error of velocities (n_save, n) over the striker's speed."""
        return float(np.abs(v - truth).max() / spheres.speed)

    results, setting, chain = [], error, (spheres, body)
    for method in (BEADWAVE, *SCIPY, *SUNDIALS, LAMMPS if body is None else EXUDYN):
        if method in missing:
            continue
        with progress(f"{work}, {method}"):
            if results:
                search = peer_process.setting_of_equal_error
                arguments = (search, method, *chain, truth, results[0].error)
                setting = in_own_process(work, method, *arguments)
            arguments = (measured, peer_process.chain_velocities, method, *chain, setting)
            failed = isinstance(setting, Failed)
            outcome = setting if failed else in_own_process(work, method, *arguments)
        results.append(_result(work, method, outcome, off, setting))
        if isinstance(results[0], Failed):  # without our error there is no equal one
            break
    return results


def in_own_process(work: str, method: str, function: Callable, *arguments) -> Any | Failed:
    """What a function of `peer_process` returns, in a process with one thread."""
    with TemporaryDirectory() as folder:
        file = Path(folder) / "call"
        file.write_bytes(dumps((function, arguments)))
        ended = run(
            [sys.executable, "-m", peer_process.__name__, str(file)], cwd=folder,
            capture_output=True, encoding="utf-8", errors="replace",
            env=environ | dict.fromkeys(THREADS, "1"),
        )  # fmt: skip
        if ended.returncode:
            lines = ended.stderr.strip().splitlines() or [f"exit status {ended.returncode}"]
            return Failed(method, work, lines[-1])
        return loads(file.read_bytes())


def _result(
    work: str, method: str, outcome, error: Callable[[NDArray], float],
    setting: float | None = None,
) -> AccuracyRow | Failed:  # fmt: skip
    """What a method gave and took, as `measured` has it, with the error of its values."""
    if isinstance(outcome, Failed):
        return outcome
    (values, warm, cold), memory = outcome
    return AccuracyRow(
        "peers", method, work, error(values), warm.clock, seconds_cold=cold.clock, setting=setting,
        processor_seconds=warm.processor, processor_cold=cold.processor, bytes=memory,
    )  # fmt: skip


def finding(
    scene: str, n: int, results: list[AccuracyRow | Failed], absent: Mapping[str, str]
) -> Finding:
    """Rows as a table, a picture and sentences; `n` are the unknowns of the structure, `absent`
    says by name what brings a method that is not installed."""
    failures = [result for result in results if isinstance(result, Failed)]
    rows = [result for result in results if not isinstance(result, Failed)]
    lines = tuple(
        (row.parameter, row.method, row.setting, row.error, row.seconds, row.seconds_cold,
         row.processor_seconds, row.processor_cold, None if row.bytes is None else row.bytes / 1e9)
        for row in rows
    )  # fmt: skip

    # by work ours and the fastest of the others, which must be as accurate to count
    works = {
        work: [row for row in rows if row.parameter == work]
        for work in dict.fromkeys(row.parameter for row in rows)
    }
    ours = {work: next(row for row in of if row.method == BEADWAVE) for work, of in works.items()}
    fastest = {
        work: min((row for row in of if row.method != BEADWAVE), key=lambda row: row.seconds)
        for work, of in works.items()
    }
    short = [row for row in rows if row.setting and row.error > 1.1 * ours[row.parameter].error]
    sentences = rendered(
        __file__, scene=scene, n=n, ours=ours, fastest=fastest, short=short,
        failures=failures, absent=absent,
    )  # fmt: skip

    axes = [
        Panel(
            work, "first call [s]", "error",
            [Line(row.method, np.array([row.seconds_cold]), np.array([max(row.error, 1e-16)]), "o")
             for row in of],
            "xy", legend="aside",
        )
        for work, of in works.items()
    ]  # fmt: skip
    picture = Picture("peers", panels(axes, columns=2, size=(5.5, 3.4)))
    tables = table_of(tuple(rows), printed=False), Table("peers", HEADING, lines, (HEADING, *lines))
    return Finding(tables, sentences, (picture,))
