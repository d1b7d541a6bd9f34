from os import _exit

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.sparse import csc_array, diags_array, eye_array

from beadwave.fem.factorisation import has_pardiso
from beadwave.workflows.evidence.accuracy import beside_peers, peer_process
from beadwave.workflows.evidence.accuracy.cost import Seconds, Timed
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
)
from beadwave.workflows.stages.progress import quiet

N, N_MODES = 300, 6
SPHERES = Spheres(0.0127, 7800.0, 210e9, 0.3, 3, 0.3, 2e-4, 8)


def springs():
    """K, M, w and boundary of masses in a row, held at one end, struck at the other."""
    off = np.full(N - 1, -1e8)
    K = csc_array(diags_array([np.append(np.full(N - 1, 2e8), 1e8), off, off], offsets=[0, 1, -1]))
    return K, csc_array(0.1 * eye_array(N)), np.eye(1, N, N - 1)[0], np.array([N - 1])


@pytest.mark.slow
def test_modes_and_condensation_by_every_method_are_those_of_lapack():
    K, M, w, b = springs()
    missing = {CALCULIX, EXUDYN, LAMMPS} | (set() if has_pardiso() else {PARDISO})
    rows = beside_peers.structure_results(EigenProblem(K, M, w, b, N_MODES), missing, quiet)
    assert not [row for row in rows if isinstance(row, beside_peers.Failed)]
    methods = [m for m in (BEADWAVE, SUPERLU, PARDISO) if m not in missing]
    assert [(row.parameter, row.method) for row in rows] == [
        (work, method) for work in (MODES, CONDENSATION) for method in methods
    ]

    # the references that the errors are measured against, against LAPACK: rounding of the largest
    # eigenvalue leaves eps (omega_max / omega_1)^2 = 8e-12 of the smallest
    truth = beside_peers.structure_truth(EigenProblem(K, M, w, b, N_MODES))
    hz = np.sqrt(eigh(K.toarray(), M.toarray(), eigvals_only=True)[:N_MODES]) / (2 * np.pi)
    np.testing.assert_allclose(truth[MODES], hz, rtol=1e-10)
    assert truth[CONDENSATION][0] == pytest.approx(N / 1e8, rel=1e-10)
    assert max(row.error for row in rows) < 1e-9

    # an interpreter with numpy holds more than 20 MB, and no work here takes an hour
    assert all(row.bytes is None or 2e7 < row.bytes < 2e9 for row in rows)
    assert all(0 < row.seconds <= 3600 and row.processor_seconds > 0 for row in rows)


@pytest.mark.slow
def test_an_error_of_a_method_is_seen(monkeypatch):
    K, M, w, b = springs()
    truth = beside_peers.structure_truth(EigenProblem(K, M, w, b, N_MODES))
    monkeypatch.setattr(
        beside_peers, "structure_truth",
        lambda *_: {work: values * 1.01 for work, values in truth.items()},
    )  # fmt: skip
    missing = {PARDISO, CALCULIX, SUPERLU}
    rows = beside_peers.structure_results(EigenProblem(K, M, w, b, N_MODES), missing, quiet)
    assert [row.error for row in rows] == pytest.approx([1 - 1 / 1.01] * 2, rel=1e-6)


@pytest.mark.slow
def test_integrators_of_the_chain_are_compared_at_our_error(monkeypatch):
    monkeypatch.setattr(beside_peers, "SCIPY", {"DOP853": None})
    monkeypatch.setattr(beside_peers, "SUNDIALS", {})
    ours, *others = beside_peers.chain_results("chain", SPHERES, None, 1e-3, {LAMMPS}, quiet)
    assert ours.method == BEADWAVE and 0 < ours.error <= 1e-3
    assert [row.method for row in others] == ["DOP853"]
    # at most ours but for the rounding of a run in another process
    assert all(0 < row.error <= ours.error * (1 + 1e-6) for row in others)


@pytest.mark.parametrize("order", [1, 2, 8])
def test_the_setting_of_equal_error_is_that_of_a_power_law(order):
    # an error h^order meets 1e-4 at h = 1e-4^(1/order), whatever the settings that are tried
    settings = tuple(10.0**-k for k in range(8))
    setting = peer_process.equal_error(lambda h: h**order, settings, 1e-4 * (1 + 1e-9))
    assert setting == pytest.approx(1e-4 ** (1 / order), rel=1e-6)


def test_where_no_setting_reaches_the_error_the_best_is_taken():
    setting = peer_process.equal_error(
        lambda h: 1e-3 + (h - 0.01) ** 2, (1.0, 0.1, 0.01, 1e-3), 1e-6
    )
    assert setting == 0.01


@pytest.mark.parametrize(
    ("function", "argument", "message"),
    [(float, "a text", "ValueError: could not convert"), (_exit, 3, "exit status 3")],
)
def test_a_method_that_fails_is_told_with_its_last_line(function, argument, message):
    failed = beside_peers.in_own_process(MODES, SUPERLU, function, argument)
    assert isinstance(failed, beside_peers.Failed)
    assert (failed.method, failed.work) == (SUPERLU, MODES)
    assert message in failed.message


def test_memory_is_that_of_the_process_of_the_method():
    held = np.zeros(30_000_000)  # 240 MB of the parent, which are not the child's
    held += 1.0
    call = (peer_process.measured, peer_process.chain_velocities, BEADWAVE, SPHERES, None, 1e-3)
    cost, memory = beside_peers.in_own_process("chain", BEADWAVE, *call)
    assert held[-1] == 1.0
    assert cost.result.shape == (SPHERES.n_save, SPHERES.count)
    with open("/proc/self/status") as status:
        own = next(1024 * int(s.split()[1]) for s in status if s.startswith("VmHWM"))
    assert memory < own


def test_one_run_of_calculix_stands_for_its_modes_and_its_compliance(monkeypatch):
    """Its compliance comes behind its frequencies; a run that fails stands once."""
    K, M, w, b = springs()
    structure = EigenProblem(K, M, w, b, N_MODES, deck="*NODE")
    truth = beside_peers.structure_truth(structure)
    values = np.append(1.01 * truth[MODES], 1.02 * truth[CONDENSATION][0])
    cost = Timed(values, warm=Seconds(1.0, 2.0), cold=Seconds(3.0, 4.0))
    monkeypatch.setattr(beside_peers, "in_own_process", lambda *_: (cost, 5.0))
    missing = {BEADWAVE, SUPERLU, PARDISO}
    rows = beside_peers.structure_results(structure, missing, quiet)
    assert [(row.parameter, row.method) for row in rows] == [
        (MODES, CALCULIX), (CONDENSATION, CALCULIX),
    ]  # fmt: skip
    assert [row.error for row in rows] == pytest.approx([0.01, 0.02], rel=1e-9)
    assert (rows[0].seconds, rows[0].processor_cold, rows[0].bytes) == (1.0, 4.0, 5.0)

    failed = beside_peers.Failed(CALCULIX, MODES, "no licence")
    monkeypatch.setattr(beside_peers, "in_own_process", lambda *_: failed)
    assert beside_peers.structure_results(structure, missing, quiet) == [failed]


@pytest.mark.slow
def test_a_peer_that_is_not_installed_is_named_with_what_brings_it():
    K, M, w, b = springs()
    missing = {PARDISO, CALCULIX}
    rows = beside_peers.structure_results(EigenProblem(K, M, w, b, N_MODES), missing, quiet)
    absent = {name: source for name, (_, _, source) in beside_peers.OPTIONAL.items()}
    finding = beside_peers.finding("springs", N, rows, absent)
    text = "\n".join(finding.sentences)
    assert "LAMMPS is not installed; ./install.sh verify adds it." in text
    assert "CalculiX is not installed; the package calculix-ccx of Debian brings it." in text
    assert finding.tables[1].name == "peers" and len(finding.tables[1].rows) == len(rows)
