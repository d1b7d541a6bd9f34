"""A refusal names the line of the file, the value that is wrong and a remedy for this value."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from beadwave import dem
from beadwave.workflows.files.hammer import Reading, measured_test, points_of_file
from beadwave.workflows.files.scene import scene
from beadwave.workflows.fit.scene_parameters import limits_of, number, plain_number
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.stages.structure.bodies import drawing
from beadwave.workflows.stages.warnings import high_friction
from beadwave.workflows.structure.parameters import freed
from beadwave.workflows.structure.tuning import targets

from command_line import beadwave as command

F = np.arange(1.0, 60.0)


def responses(change):
    rows = [f"{f:g},{1 / f:g},0.1" for f in F]
    change(rows)
    return "\n".join(["frequency_hz,re_1,im_1", *rows]) + "\n"


@pytest.mark.parametrize(
    ("row", "sentence"),
    [
        ("8,nan,0.1", "line 9 has no number in the column"),
        ("8,0.1", "line 9 has 2 cells, those before it have 3"),
        ("8,abc,0.1", "line 9 is not numbers with decimal points"),
    ],
)
def test_a_line_of_responses_that_is_no_numbers_is_named(tmp_path, row, sentence):
    path = tmp_path / "frf.csv"
    path.write_text(responses(lambda rows: rows.__setitem__(7, row)))
    with pytest.raises(InvalidScene, match=sentence):
        measured_test([path])


def test_a_file_that_is_no_text_is_refused_without_a_library_s_words(tmp_path):
    path = tmp_path / "frf.csv"
    path.write_bytes(b"frequency_hz,re_1,im_1\n\x80\x81")
    with pytest.raises(InvalidScene, match="it is no text in UTF-8") as refused:
        measured_test([path])
    assert "codec" not in str(refused.value)


def test_a_mat_file_that_is_cut_off_is_refused_without_a_library_s_words(tmp_path):
    path = tmp_path / "hits.mat"
    savemat(path, {"dt": 1e-4, "response": np.ones((5000, 1, 3)), "force": np.ones((5000, 3))})
    path.write_bytes(path.read_bytes()[:50_000])
    with pytest.raises(InvalidScene, match="it is cut off or damaged"):
        measured_test([path])


def test_the_hit_and_the_sensor_without_a_number_are_named(tmp_path):
    """Sample 7 of the second hit at the first sensor: 6 steps of 0.1 ms after the record began."""
    force = np.zeros((3, 512))
    force[:, 20:24] = 1.0
    response = np.random.default_rng(0).normal(size=(3, 2, 512))
    response[1, 0, 6] = np.nan
    path = tmp_path / "hits.mat"
    content = {"response": response.T, "force": force.T, "sensors": ["1+z", "2+z"]}
    savemat(path, {"dt": 1e-4, **content})
    with pytest.raises(
        InvalidScene, match=r"record 2 of 3 has NaN or inf at sensor 1\+z, sample 7, 0.0006 s"
    ):
        measured_test([path], Reading())


@pytest.mark.parametrize(
    ("row", "sentence"),
    [
        ("3,nan,0,0", "line 4 has a point that is no number: '3,nan,0,0'"),
        ("3,a,0,0", "line 4 is not node, x, y, z: '3,a,0,0'"),
        ("3,0,0", "line 4 is not node, x, y, z: '3,0,0'"),
        ("2,0,0,0", "node 2 stands in two lines"),
    ],
)
def test_a_line_of_points_that_is_none_is_named(tmp_path, row, sentence):
    path = tmp_path / "points.csv"
    path.write_text("\n".join(["node,x,y,z", "1,0,0,0", "2,0,0,1", row, ""]))
    with pytest.raises(InvalidScene, match=sentence):
        points_of_file(path)


@pytest.mark.parametrize(
    ("key", "sentence"),
    [
        ("beam.thicknes", "the nearest that has one is 'beam.thickness'"),
        ("striker.velocty", "the nearest that has one is 'striker.velocity'"),
        ("nothing.here", "name a key whose value is one number"),
    ],
)
def test_a_number_that_is_misspelt_names_the_nearest_one(key, sentence):
    with pytest.raises(InvalidScene, match=sentence):
        number(scene("sensed-beam"), key)


@pytest.mark.parametrize(
    ("bounds", "sentence"),
    [
        ("beam.thickness=15:9", "write beam.thickness=9:15"),
        ("beam.thickness=15", "write beam.thickness=LOW:HIGH"),
        ("beam.thickness=a:9", "'a' is no number; write beam.thickness=LOW:HIGH"),
    ],
)
def test_a_remedy_of_bounds_is_of_the_key_that_was_given(bounds, sentence):
    with pytest.raises(InvalidScene, match=sentence):
        limits_of(bounds, plain_number)


@pytest.mark.parametrize("hz", ["-50", "0", "inf", "nan", "51 Hz"])
def test_a_frequency_that_is_none_is_what_match_is_refused_for(hz):
    with pytest.raises(InvalidScene, match=f"--match 1={hz}: {hz} is no frequency above 0"):
        targets(f"1={hz},2=269", {1: 51.0, 2: 269.0})


def test_a_beam_in_millimetres_is_told_how_to_write_them():
    with pytest.raises(InvalidScene, match='write thickness = "12 mm" if these are meant'):
        scene("sensed-beam", ["beam.thickness=12"])


TWO_PLATES = """
assembly.material = "steel"
assembly.held = ["foot:-z"]
strike.on = "lid:+z"
chain.count = 10
striker.velocity = 0.3
chain.material = "steel"
chain.radius = "6 mm"
wall.kind = "rom"
bodies.foot.box = ["80 mm", "80 mm", "10 mm"]
bodies.lid.box = ["80 mm", "80 mm", "10 mm"]
bodies.lid.at = [0, 0, 0.01]
[[joints]]
name = "m8"
between = "lid|foot"
at = [[0.0, 0.0, 0.005]]
washer = 0.01
kz = 1e7
"""


def two_plates(tmp_path, change=("", "")):
    path = tmp_path / "plates.toml"
    path.write_text(TWO_PLATES.replace(*change))
    return scene(path)


def test_a_joint_of_one_s_own_is_freed_by_its_short_name(tmp_path):
    of_short_name = freed(two_plates(tmp_path), ["m8.kz"])
    assert of_short_name == freed(two_plates(tmp_path), ["joints.m8.kz"])
    assert [p.name for p in of_short_name] == ["joints.m8.kz"]


def test_one_stiffness_is_not_freed_by_both_its_names(tmp_path):
    with pytest.raises(InvalidScene, match=r"--free joints\.m8\.kz is named twice"):
        freed(two_plates(tmp_path), ["m8.kz", "joints.m8.kz"])


def test_bodies_drawn_in_millimetres_are_told_how_to_write_them(tmp_path):
    drawn = two_plates(tmp_path, change=('"80 mm", "80 mm", "10 mm"', "45, 45, 10"))
    with pytest.raises(InvalidScene, match='are drawn in metres; write "80 mm"'):
        drawing(drawn).__enter__()


@pytest.mark.parametrize(("coefficient", "n"), [(0.3, 0), (2.0, 0), (5.0, 1)])
def test_friction_above_that_of_dry_solids_is_warned_of(coefficient, n):
    scene_rubbed = scene("oblique-sphere", {"friction.coefficient": coefficient})
    assert len(list(high_friction(scene_rubbed))) == n


EXAMPLES = Path(__file__).parents[2] / "examples"
WITHOUT = """
import runpy, sys
for name in ("pyuff", "pyarrow", "distributed"):
    sys.modules[name] = None  # as if it were not installed
folder, name = sys.argv[1:]
sys.path.insert(0, folder)
sys.argv = [name]
runpy.run_path(f"{folder}/{name}", run_name="__main__")
"""


@pytest.mark.parametrize(
    ("example", "extra"),
    [("measured_arm", "identify"), ("many_workers", "sweep"), ("sweep_rates", "sweep")],
)
def test_an_example_without_its_library_ends_in_a_sentence(tmp_path, example, extra):
    words = sys.executable, "-c", WITHOUT, EXAMPLES, f"{example}.py"
    end = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert end.returncode == 2
    assert f"./install.sh {extra}" in end.stderr and "Traceback" not in end.stderr


def test_a_refusal_of_a_later_stage_names_the_file(tmp_path, capfd):
    """As one of the tables does."""
    two_plates(tmp_path, change=('"80 mm", "80 mm", "10 mm"', "45, 45, 10"))
    path = tmp_path / "plates.toml"
    path.write_text('name = "something-else"\n' + path.read_text())
    assert command("modes", path) == 2
    assert capfd.readouterr().err.startswith(f"beadwave: {path}: the assembly is 45 x 45")


@pytest.mark.parametrize(("frequencies", "status"), [("-200,300", 0), ("-200,-300", 2)])
def test_a_sweep_without_any_result_does_not_end_as_if_done(tmp_path, capfd, frequencies, status):
    over = f"wall.frequency={frequencies}"
    assert command("sweep", "rig-1dof", "--over", over, "--out", tmp_path / "out") == status


def test_a_sweep_all_of_whose_cases_fail_ends_as_failed(tmp_path, capfd, monkeypatch):
    def march(chains, **options):
        raise dem.UnstableStep("too fast to march")

    monkeypatch.setattr(dem, "march_batch", march)
    over = "striker.velocity=0.3,0.4"
    assert command("sweep", "rig-rigid", "--over", over, "--out", tmp_path / "out") == 1
    assert "none of 2 cases has a result (2 failed); too fast" in capfd.readouterr().err


def test_bodies_that_do_not_touch_are_told_how_far_they_are_apart(tmp_path, capfd):
    """Plates 10 mm thick whose middles are 35 mm apart leave 25 mm."""
    two_plates(tmp_path, change=("[0, 0, 0.01]", "[0, 0, 0.035]"))
    assert command("modes", tmp_path / "plates.toml") == 2
    assert '"lid|foot" do not touch and are at least 25 mm apart' in capfd.readouterr().err


@pytest.mark.parametrize(
    ("name", "remedy"), [("scan.stl", "examples/fill_surface.py"), ("a.igs", "a solid as STEP")]
)
def test_a_surface_is_refused_with_what_to_do(tmp_path, capfd, name, remedy):
    (tmp_path / name).write_text("solid x")
    assert command("look", tmp_path / name) == 2
    assert remedy in capfd.readouterr().err
