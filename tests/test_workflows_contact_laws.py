"""Power laws and tables of forces in scenes: files, sweeps and fits."""

import numpy as np
import pytest

import beadwave
from workflows.files.force_file import force_table
from workflows.scene import InvalidScene, scene
from workflows.stages.chain import chain

POWER = ("contact.law=power", "contact.stiffness=3e12", "contact.exponent=2", "chain.count=6")
SHORT = ("output.spheres=[1, 4]", "time.duration=4e-4")


def test_a_scene_sets_the_force_of_its_contacts(tmp_path):
    row = chain(scene("rig-rigid", (*POWER, "contact.stiffness_factor=1.5", SHORT[0])))
    assert row.elastic.force(np.full(6, 2e-6)) == pytest.approx(1.5 * 3e12 * 4e-12, rel=1e-14)
    path = tmp_path / "force.csv"
    path.write_text("overlap,force\n0,0\n1e-6,4\n\n3e-6,30\n")
    row = chain(scene("rig-rigid", ("contact.law=table", f"contact.file={path}")))
    assert row.elastic.force(np.full(17, 1e-6)) == pytest.approx(4.0, rel=1e-14)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "0 overlaps and 0 forces"),
        ("0,0\n1e-6,1\n2e-6", "'2e-6' in row 3, allowed are two numbers"),
        ("0,0\n1e-6,a\n", "'1e-6,a' in row 2"),
        ("0,0\n1e-6,1\n5e-7,2\n", "must grow from row to row"),
        ("1e-7,0\n1e-6,1\n5e-6,2\n", "start it at 0, 0"),
        ("0,0\n1e-6,inf\n5e-6,2\n", "not a finite number"),
    ],
)
def test_a_file_that_is_no_force_is_refused_with_its_row(text, sentence, tmp_path):
    path = tmp_path / "force.csv"
    path.write_text(text)
    with pytest.raises(InvalidScene, match="contact.file = ") as refused:
        force_table(str(path))
    assert sentence in str(refused.value)


def test_the_march_of_a_kept_run_is_anew_when_the_file_of_its_force_changes(tmp_path):
    path, peaks = tmp_path / "force.csv", []
    for factor in (1, 2):
        d = np.linspace(0, 4e-5, 12)
        rows = zip(d, factor * 3e12 * d**2, strict=True)
        path.write_text("".join(f"{a},{b}\n" for a, b in rows))
        summary = beadwave.impact(
            "rig-rigid", settings=("contact.law=table", f"contact.file={path}", POWER[3], *SHORT),
        )  # fmt: skip
        peaks.append(summary.peak_wall_force_N)
    # F ~ k^(1/(n+1)) = 2^(1/3) in a wave of the same speed; the table is near that
    assert peaks[1] / peaks[0] == pytest.approx(2 ** (1 / 3), rel=0.01)
