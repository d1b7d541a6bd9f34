"""Methods of others on the same matrices and spheres: their errors, seconds and memory."""

from pathlib import Path
from subprocess import run
from sys import executable

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.sparse import csc_array, diags_array, eye_array

from beadwave import dem
from beadwave.fem.modes.solver.factorisation import has_pardiso
from beadwave.workflows.evidence.accuracy.problems import Problem

import peers as benchmark
from peers import (
    BEADWAVE,
    CALCULIX,
    CONDENSATION,
    MODES,
    PARDISO,
    SUPERLU,
    EigenProblem,
)

N, N_MODES = 300, 6
MATERIAL = [0.0127, 7800.0, 210e9, 0.3]


def springs():
    """Masses in a row, held at one end, struck at the other."""
    off = np.full(N - 1, -1e8)
    K = csc_array(diags_array([np.append(np.full(N - 1, 2e8), 1e8), off, off], offsets=[0, 1, -1]))
    M, w = csc_array(0.1 * eye_array(N)), np.eye(1, N, N - 1)[0]
    return EigenProblem(K, M, w, np.array([N - 1]), N_MODES)


def spheres():
    """Three spheres at a rigid wall."""
    chain = dem.row_of_spheres(*MATERIAL, count=3, flat=dem.Flat(*MATERIAL[2:]))
    return Problem(chain, dem.rigid_wall(), 0.3 * np.eye(1, 3)[0], 2e-4, np.arange(3), 8)


def only(monkeypatch, *methods):
    """Lets the others be missing."""
    monkeypatch.setattr(benchmark, "installed", lambda method, work: method in methods)


@pytest.mark.slow
def test_modes_and_condensation_by_every_method_are_those_of_lapack():
    rows = [*benchmark.structure_rows(springs())]
    methods = [m for m in (BEADWAVE, SUPERLU, PARDISO) if m != PARDISO or has_pardiso()]
    assert [(row.work, row.method) for row in rows] == [
        (work, method) for work in (MODES, CONDENSATION) for method in methods
    ]

    # the references that the errors are measured against, against LAPACK: rounding of the largest
    # eigenvalue leaves eps (omega_max / omega_1)^2 = 8e-12 of the smallest
    K, M = springs()[:2]
    truth = benchmark.structure_truth(springs())
    hz = np.sqrt(eigh(K.toarray(), M.toarray(), eigvals_only=True)[:N_MODES]) / (2 * np.pi)
    np.testing.assert_allclose(truth[MODES], hz, rtol=1e-10)
    assert truth[CONDENSATION][0] == pytest.approx(N / 1e8, rel=1e-10)
    assert max(row.error for row in rows) < 1e-9

    # an interpreter with numpy holds more than 20 MB, and no work here takes an hour
    assert all(row.gigabytes is None or 0.02 < row.gigabytes < 2 for row in rows)
    assert all(0 < row.warm <= 3600 and row.processor > 0 for row in rows)


@pytest.mark.slow
def test_an_error_of_a_method_is_noticed(monkeypatch):
    truth = benchmark.structure_truth(springs())
    wrong = {work: values * 1.01 for work, values in truth.items()}
    monkeypatch.setattr(benchmark, "structure_truth", lambda structure: wrong)
    only(monkeypatch, BEADWAVE)
    rows = [*benchmark.structure_rows(springs())]
    assert [row.error for row in rows] == pytest.approx([1 - 1 / 1.01] * 2, rel=1e-6)


@pytest.mark.slow
def test_integrators_of_the_chain_are_compared_at_our_error(monkeypatch):
    only(monkeypatch, BEADWAVE, "DOP853")
    ours, other = benchmark.chain_rows("chain", spheres(), MATERIAL, None, 1e-3)
    assert (ours.method, other.method) == (BEADWAVE, "DOP853") and 0 < ours.error <= 1e-3
    # at most ours but for the rounding of a run in another process
    assert 0 < other.error <= ours.error * (1 + 1e-6)


@pytest.mark.parametrize("order", [1, 2, 8])
def test_the_setting_of_equal_error_is_that_of_a_power_law(order):
    # an error h^order meets 1e-4 at h = 1e-4^(1/order), whatever the settings that are tried
    settings = tuple(10.0**-k for k in range(8))
    setting = benchmark.equal_error(lambda h: h**order, settings, 1e-4 * (1 + 1e-9))
    assert setting == pytest.approx(1e-4 ** (1 / order), rel=1e-6)


def test_where_no_setting_reaches_the_error_the_best_is_taken():
    setting = benchmark.equal_error(lambda h: 1e-3 + (h - 0.01) ** 2, (1.0, 0.1, 0.01, 1e-3), 1e-6)
    assert setting == 0.01


def test_a_method_that_fails_says_why_and_has_no_row(capsys):
    assert benchmark.in_own_process(SUPERLU, MODES, float, "a text") is None
    assert f"{SUPERLU} ({MODES}) gave no result" in (out := capsys.readouterr().out)
    assert "could not convert" in out
    assert not [*benchmark.row_of(MODES, SUPERLU, None, None, max)]


def test_a_method_whose_process_ends_says_so():
    """In an interpreter of its own: in one of pytest's workers the pool that breaks now and then
    took the worker along."""
    code = "import os, peers\nprint(peers.in_own_process(peers.SUPERLU, peers.MODES, os._exit, 3))"
    ended = run(
        [executable, "-c", code], cwd=Path(benchmark.__file__).parent, capture_output=True,
        encoding="utf-8", check=True,
    )  # fmt: skip
    said, returned = ended.stdout.splitlines()
    assert said.startswith(f"{SUPERLU} ({MODES}) gave no result") and "terminated" in said
    assert returned == "None"


def test_memory_is_that_of_the_process_of_the_method():
    held = np.zeros(30_000_000)  # 240 MB of the parent, which are not the child's
    held += 1.0
    case = spheres(), MATERIAL, None
    call = benchmark.measured, BEADWAVE, benchmark.velocities, BEADWAVE, case, 1e-3
    value, *_, memory = benchmark.in_own_process(BEADWAVE, "chain", *call)
    assert held[-1] == 1.0
    assert value.shape == (8, 3)
    with open("/proc/self/status") as status:
        own = next(1024 * int(s.split()[1]) for s in status if s.startswith("VmHWM"))
    assert memory < own


def test_one_run_of_calculix_stands_for_its_modes_and_its_compliance(monkeypatch):
    """Its compliance comes behind its frequencies."""
    structure = springs()._replace(deck="*NODE")
    truth = benchmark.structure_truth(structure)
    values = np.append(1.01 * truth[MODES], 1.02 * truth[CONDENSATION][0])
    run = values, (1.0, 2.0), (3.0, 4.0), 5e9
    monkeypatch.setattr(benchmark, "in_own_process", lambda *_: run)
    only(monkeypatch, CALCULIX)
    rows = [*benchmark.structure_rows(structure)]
    assert [(row.work, row.method) for row in rows] == [(MODES, CALCULIX), (CONDENSATION, CALCULIX)]
    assert [row.error for row in rows] == pytest.approx([0.01, 0.02], rel=1e-9)
    assert rows[0][4:] == (1.0, 3.0, 2.0, 4.0, 5.0)


def test_a_program_that_is_not_installed_is_named_with_what_adds_it(monkeypatch, capsys):
    monkeypatch.setattr(benchmark, "find_spec", lambda name: None)
    monkeypatch.setattr(benchmark, "which", lambda name: None)
    assert not benchmark.installed("LAMMPS", MODES) and not benchmark.installed(CALCULIX, MODES)
    printed = capsys.readouterr().out
    assert "LAMMPS (modes) is not installed; ./install.sh verify adds it" in printed
    assert "calculix-ccx adds it" in printed


@pytest.mark.slow
def test_the_whole_table_is_printed(monkeypatch, capsys):
    only(monkeypatch, BEADWAVE, SUPERLU, "DOP853")
    rows = benchmark.main("cantilever", coarser=2.0, n_modes=4, error=1e-3, duration=2e-4)
    assert [row.work for row in rows] == [
        MODES, MODES, CONDENSATION, CONDENSATION, *2 * ["chain, rigid wall"],
        *2 * ["chain, reduced wall"],
    ]  # fmt: skip
    assert "fastest other one, DOP853" in capsys.readouterr().out
