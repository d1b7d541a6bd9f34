"""The study of the reduction on a coarse mesh: what its errors must do, and that it prints."""

import json
import re
import sys
from contextlib import nullcontext

import numpy as np
import pytest
from scipy.sparse import csc_matrix

from beadwave.workflows.commands.app import main
from beadwave.workflows.evidence.accuracy import reduction as study
from beadwave.workflows.evidence.accuracy.runs import AccuracyRow, table_of
from beadwave.workflows.evidence.accuracy.shared_solutions import SharedSolutions
from beadwave.workflows.files.scene import scene
from beadwave.workflows.report import finding
from beadwave.workflows.report.tables import Table
from beadwave.workflows.scene import InvalidScene

from command_line import COARSE_RIG

COARSE = (
    *COARSE_RIG,
    "output.samples=301", "time.duration=1e-3", 'assembly.parts=["block", "sheets"]',
    "assembly.fixing=flat",
)  # fmt: skip


@pytest.fixture(scope="module")
def printed(tmp_path_factory):
    """The rows of the command, few modes and frequencies."""
    out = tmp_path_factory.mktemp("accuracy")
    with pytest.MonkeyPatch.context() as patch, pytest.raises(SystemExit) as end:
        patch.setattr(study, "COUNTS", (4, 30))
        patch.setattr(study, "BANDS_HZ", (8e3, 20e3))
        patch.setenv("BEADWAVE_CACHE_DIR", str(out / "cache"))
        changes = [f"--set={change}" for change in COARSE]
        patch.setattr(
            sys, "argv", ["beadwave", "accuracy", "--stage=reduction", *changes, f"--out={out}"]
        )
        main()
    assert not end.value.code
    return json.loads((out / "accuracy.json").read_text()), out


def error(printed, method, n):
    (row,) = [r for r in printed[0]["rows"] if (r["method"], r["parameter"]) == (method, n)]
    return row["error"]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["free-modes", "craig-bampton"])
@pytest.mark.parametrize("measure", ["receptance to 8 kHz", "velocities"])
def test_modes_and_the_residual_bring_the_error_down(printed, kind, measure):
    few, many = (error(printed, f"{kind} + residual: {measure}", n) for n in (4, 30))
    modes_alone = error(printed, f"{kind}: {measure}", 30)
    assert many < 0.2 * few
    assert many < 0.05 * modes_alone  # the static residual is not optional


@pytest.mark.slow
def test_free_modes_with_residual_answer_like_the_full_model(printed):
    assert error(printed, "free-modes + residual: receptance to 8 kHz", 30) < 1e-4


@pytest.mark.slow
def test_the_study_leaves_rows_and_a_picture(printed):
    summary, out = printed
    assert {row["study"] for row in summary["rows"]} == {"reduction"}
    assert all(row["seconds"] > 0 and np.isfinite(row["error"]) for row in summary["rows"])
    assert (out / "figures" / "accuracy_reduction.png").read_bytes()[:4] == b"\x89PNG"
    assert len((out / "accuracy.csv").read_text().splitlines()) == 1 + len(summary["rows"])


@pytest.mark.slow
def test_the_reference_is_the_full_model_to_its_bound(printed):
    """Said of the direct solutions beside it; a wrong mass or weight would show in percents."""
    (sentence,) = [s for s in printed[0]["findings"] if s.startswith("Errors are relative")]
    stated, off = (float(word) for word in re.findall(r"\d\.\de-\d\d", sentence))
    assert off < stated <= study.BOUND


def test_a_shared_solution_is_the_same_and_its_seconds_count_again():
    A = csc_matrix(np.diag([2.0, 4.0]) + 0.5)
    shared, b = SharedSolutions(), np.array([1.0, 3.0])
    first = shared(A).solve(b)
    saved = shared.saved
    again = shared(A).solve(b)
    np.testing.assert_array_equal(first, again)
    np.testing.assert_allclose(A @ again, b, rtol=1e-14)
    assert shared.saved > saved == 0
    again[:] = 0  # what a caller does with it is no matter of the next
    np.testing.assert_array_equal(shared(A).solve(b), first)


def test_a_scene_with_dashpots_is_refused_not_compared_without_them():
    damped = scene("rig-rom", ("joints.head.cz=100.0",))
    with pytest.raises(InvalidScene, match="joints or springs have dashpots"):
        study.reduction(damped, lambda name: nullcontext())


def test_a_person_reads_one_table_and_not_its_rows_again():
    """Ninety rows with mostly empty columns once stood before the table that says the same."""
    row = AccuracyRow("reduction", "free-modes: velocities", 10, 1e-4, 0.1)
    table_of_study = Table("reduction", ("method", "modes"), (("free-modes", 10),))
    reduction = finding.Finding((table_of((row,), printed=False), table_of_study), ("word " * 50,))
    table, *sentences = finding.text(reduction).split("\n\n")
    assert table.splitlines() == ["method      modes", "free-modes     10"]
    assert max(map(len, sentences[0].splitlines())) <= 100
    of_schemes = finding.Finding((table_of((row._replace(study="time", method="leapfrog"),)),))
    for both in (finding.merged([of_schemes, reduction]), finding.merged([reduction, of_schemes])):
        assert "leapfrog" in finding.text(both)
        assert "free-modes: velocities" not in finding.text(both)
        assert len(both.tables[0].rows) == 2


def test_joined_tables_print_the_rows_of_each_that_prints_any():
    """Rows of a table without lines of its own were left out beside one that has some."""
    plain = Table("cases", ("case", "value"), (("plain", 1),))
    worded = Table("cases", ("case", "value"), (("worded", 2),), (("case", "value"), ("lines", 2)))
    silent = Table("cases", ("case", "value"), (("silent", 3),), ())
    both = finding.merged([finding.Finding((table,)) for table in (plain, worded, silent)])
    assert [row[0] for row in both.tables[0].printed] == ["case", "plain", "lines"]
    assert [row[0] for row in both.tables[0].rows] == ["plain", "worded", "silent"]
    assert finding.merged([finding.Finding((plain,))] * 2).tables[0].printed is None
