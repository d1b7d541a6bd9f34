"""The study of the reduction on a coarse mesh: what its errors must do, and that it prints."""

import json
import sys

import numpy as np
import pytest

from workflows import reduction_accuracy as study
from workflows.cli import main

COARSE = (
    "mesh.seed=0.012", "mesh.block_seed=0.05", "mesh.contact_seed=0.012", "patch.radius=0.006",
    "output.samples=301", "time.duration=1e-3",
)  # fmt: skip


@pytest.fixture(scope="module")
def printed(tmp_path_factory):
    """The rows of the command, few modes and frequencies."""
    out = tmp_path_factory.mktemp("accuracy")
    with pytest.MonkeyPatch.context() as patch, pytest.raises(SystemExit) as end:
        patch.setattr(study, "COUNTS", (12, 60))
        patch.setattr(study, "BANDS_HZ", (8e3, 12e3))
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


@pytest.mark.parametrize("kind", ["free-modes", "craig-bampton"])
@pytest.mark.parametrize("measure", ["receptance to 8 kHz", "velocities"])
def test_modes_and_the_residual_bring_the_error_down(printed, kind, measure):
    whole = [error(printed, f"{kind} + residual: {measure}", n) for n in (12, 60)]
    bare = error(printed, f"{kind}: {measure}", 60)
    assert whole[1] < 0.2 * whole[0]
    assert whole[1] < 0.05 * bare  # the static residual is not optional


def test_free_modes_with_residual_answer_like_the_full_model(printed):
    assert error(printed, "free-modes + residual: receptance to 8 kHz", 60) < 1e-4


def test_the_study_leaves_rows_and_a_picture(printed):
    summary, out = printed
    assert {row["study"] for row in summary["rows"]} == {"reduction"}
    assert all(row["seconds"] > 0 and np.isfinite(row["error"]) for row in summary["rows"])
    assert (out / "figures" / "accuracy_reduction.png").read_bytes()[:4] == b"\x89PNG"
    assert len((out / "accuracy.csv").read_text().splitlines()) == 1 + len(summary["rows"])
