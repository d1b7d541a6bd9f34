"""`beadwave tune` and the models it judges by, on a coarse mesh."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from beadwave.fem.modes.solver import factorisation
from beadwave.workflows.commands.app import main
from beadwave.workflows.files.output_file import OutputFile
from beadwave.workflows.files.scene import scene
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.structure.api import tune
from beadwave.workflows.structure.mode_table import mode_table
from beadwave.workflows.structure.parameters import SHIFT, freed, usual
from beadwave.workflows.structure.tuning import loosened, targets, tuned, unit, write_scene
from beadwave.workflows.thesis import HAMMER_TEST_HZ

from command_line import beadwave

COARSE = (
    "mesh.seed=0.012",
    "mesh.block_seed=0.05",
    "mesh.support_seed=0.1",
    "mesh.contact_seed=0.03",
)


@pytest.fixture(autouse=True)
def own_cache(tmp_path_factory, monkeypatch):
    monkeypatch.setenv("BEADWAVE_CACHE_DIR", str(tmp_path_factory.getbasetemp() / "tuning"))


def silent(name):
    from contextlib import nullcontext

    return nullcontext()


def rig_targets(match):
    return targets(match, dict(enumerate(HAMMER_TEST_HZ, start=1)))


def test_fitted_values_have_a_unit_or_name_the_value_that_they_multiply():
    names = ("head.ky", "joints.cover.krz", "block.young", "materials.steel.density")
    assert [*map(unit, names)] == ["N/m", "N m/rad", "of the rest's", "of the scene's"]
    # the direction says what is stiff, not a joint that happens to be called so
    assert [*map(unit, ("joints.krx-left.kz", "joints.kr.krz"))] == ["N/m", "N m/rad"]


def test_targets_are_hammer_test_modes_or_frequencies_of_ones_own():
    assert rig_targets("1,3,4") == {1: 51.0, 3: 907.0, 4: 8425.0}
    assert rig_targets("2=270.5") == {2: 270.5}
    for wrong in ("1=-3", "1=nan"):
        with pytest.raises(InvalidScene, match="is no frequency above 0"):
            rig_targets(wrong)
    for wrong in ("", "5", "1,x", "1,1", "1=51,2,1=60"):
        with pytest.raises(InvalidScene, match="must name modes 1 to 4"):
            rig_targets(wrong)


def test_modes_two_and_three_together_free_the_turn():
    rig = scene("rig-rom")
    assert usual(rig, {1: 51.0, 2: 269.0}) == ("head.ky", "head.kt")
    assert usual(rig, {2: 269.0, 3: 907.0, 4: 8425.0})[2:] == (
        "head.kry", "block.young", "block.density",
    )  # fmt: skip


@pytest.mark.slow
def test_a_tuned_scene_meets_its_modes_in_the_full_model():
    result, report = tuned(scene("rig-rom", COARSE), rig_targets("1,2,3"), (), silent)
    found = [report.full_order_hz[str(i)] for i in (1, 2, 3)]
    np.testing.assert_allclose(found, [report.modes_hz[str(i)] for i in (1, 2, 3)], rtol=1e-3)
    np.testing.assert_allclose(found, [51, 269, 907], rtol=5e-3)  # three springs, weak pulls
    head = result.bushings["head"]
    assert head.ky == report.stiffness["head.ky"] and head.kx == np.inf


@pytest.mark.slow
def test_mac_is_the_same_in_tune_and_modes():
    result, report = tuned(scene("rig-rom", COARSE), {1: 52.0}, (), silent)
    rows = mode_table(pipeline_of(result, silent)).rows
    assert report.mac == {str(row.hammer_mode): row.mac for row in rows if row.hammer_mode}


@pytest.mark.slow
def test_a_remark_explains_why_one_tangential_stiffness_misses_modes_2_and_3():
    free = ("head.ky", "head.kt")
    result, report = tuned(scene("rig-rom", COARSE), rig_targets("1,2,3"), free, silent)
    assert result.bushings["head"].kx == result.bushings["head"].kz
    assert any("shear the joints along x" in remark for remark in report.remarks)


@pytest.mark.parametrize(
    ("name", "free", "sentence"),
    [
        ("rig-full-tie", (), "no springs to tune"),
        ("rig-rom", ("head.kq",), "head.kq is not known"),
        ("rig-rom", ("tail.ky",), "tail.ky is not known"),
        ("rig-rom", ("head.kx", "head.kt"), "head.kx and head.kt set the same"),
        ("rig-rom", ("block.young", "block.young"), "block.young is named twice"),
    ],
)
def test_what_cannot_be_tuned_is_refused(name, free, sentence):
    with pytest.raises(InvalidScene, match=sentence):
        tuned(scene(name, COARSE), rig_targets("1"), free, silent)


@pytest.mark.parametrize(
    ("parts", "free"),
    [("['block']", "head.ky"), ("['block', 'sheets']", "foot.ky")],
)
def test_a_joint_of_an_absent_part_is_not_tuned(parts, free):
    with pytest.raises(InvalidScene, match=f"{free} cannot be tuned"):
        tuned(scene("rig-rom", (f"assembly.parts={parts}",)), rig_targets("1"), (free,), silent)


@pytest.mark.slow
def test_the_command_writes_a_scene_that_reads_back(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    arguments = ["tune", "--match=1,2", "--json", *(f"--set={change}" for change in COARSE)]
    arguments += ["--out=new/my rig.toml"]
    monkeypatch.setattr(sys, "argv", ["beadwave", *arguments])
    with pytest.raises(SystemExit) as end:
        main()
    assert not end.value.code
    report = json.loads(capsys.readouterr().out)
    written = scene("new/my rig.toml")
    assert written.bushings["head"].kz == report["stiffness"]["head.kt"]
    assert written.name == "rig-rom"  # of its file


def test_a_block_with_its_own_steel_keeps_the_values_that_are_not_tuned():
    rig = scene("rig-rom", ("assembly.block.poisson=0.28",))
    loose = loosened(rig, freed(rig, ("head.kz", "block.young")))
    block = loose.materials["block"]
    assert block.poisson == 0.28 and block.density == rig.materials["block"].density
    assert block.young == rig.materials["sheets"].young  # a factor of 1


@pytest.mark.slow
def test_a_stiffness_that_the_modes_do_not_determine_keeps_its_value():
    rig = scene("rig-rom", COARSE)
    result, report = tuned(rig, rig_targets("2"), ("head.ky", "head.kt"), silent)
    assert report.stiffness.keys() == {"head.kt"}
    assert result.stiffness("head.ky") == rig.stiffness("head.ky")
    assert report.remarks[0] == "head.ky is not determined by mode 2: it stays 503650."


@pytest.mark.slow
@pytest.mark.parametrize(("match", "free"), [("2", "head.ky"), ("3", "foot.ky")])
def test_where_nothing_is_determined_no_scene_is_written(
    match, free, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    changes = [f"--set={change}" for change in COARSE]
    assert beadwave("tune", f"--match={match}", f"--free={free}", "--quiet", *changes) == 2
    said = capsys.readouterr()
    assert f"no value of --free {free} is determined by mode {match}, nothing" in said.err
    assert not said.out and said.err.count("\n") == 1 and not list(tmp_path.iterdir())


@pytest.mark.parametrize("free", [[1], (None,), 5])
def test_values_to_free_must_be_names(free):
    with pytest.raises(InvalidScene, match="must be names, as in"):
        tune("rig-rom", COARSE, match="1", free=free)


@pytest.mark.slow
def test_a_remark_names_the_undetermined_stiffness_that_would_meet_a_mode():
    """Sheets at a rigid joint, of which the scene has a soft one: there is a least stiffness and
    no largest."""
    rigid = scene("rig-rom", (*COARSE, "joints.head.kz=inf"))
    hz = {n: pipeline_of(rigid, silent)("modes").paired_hz[str(n)] for n in (1, 2)}
    soft = scene("rig-rom", (*COARSE, "joints.head.kz=4e8", "joints.head.ky=6e5"))
    _, report = tuned(soft, hz, ("head.ky", "head.kz"), silent)
    assert report.undetermined == {"head.kz": 4e8} and report.stiffness.keys() == {"head.ky"}
    assert any("mode 2 would be met with head.kz = " in remark for remark in report.remarks)


def test_a_stiffness_starts_from_the_value_of_its_scene():
    rig = scene("rig-rom", COARSE)
    ky, kx, young = freed(rig, ("head.ky", "head.kx", "block.young"))
    assert ky.start == rig.bushings["head"].ky
    assert kx.start == SHIFT[0]  # rigid: no value to start from
    block, sheets = (rig.materials[part].young for part in ("block", "sheets"))
    assert young.start * sheets == pytest.approx(block, rel=1e-15)


@pytest.mark.slow
def test_no_remark_advises_to_free_a_stiffness_that_is_free():
    """Three springs cannot take mode 2 above mode 3."""
    free = ("head.ky", "head.kz", "head.kry")
    _, report = tuned(scene("rig-rom", COARSE), {2: 900.0, 3: 300.0}, free, silent)
    assert report.failures and not any("Free " in remark for remark in report.remarks)


@pytest.mark.slow
def test_a_gross_miss_is_a_failure_and_writes_no_scene(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    arguments = ["tune", "--match=1=48000", "--free=head.ky", "--json", "--quiet"]
    monkeypatch.setattr(sys, "argv", ["beadwave", *arguments, *(f"--set={c}" for c in COARSE)])
    with pytest.raises(SystemExit) as end:
        main()
    told = capsys.readouterr()
    assert end.value.code == 1 and not list(tmp_path.iterdir())
    assert json.loads(told.out)["match"] == {"1": 48000.0}
    assert "no scene is written: mode 1 of 48000 Hz is missed by -99.9 %" in told.err
    assert told.err.count("\n") == 1


@pytest.mark.slow
def test_a_tuned_scene_is_judged_by_what_it_was_tuned_to():
    result, _ = tuned(scene("rig-rom", COARSE), {1: 53.0, 2: 269.0}, ("head.ky", "head.kz"), silent)
    assert result.measured_hz == (53.0, 269.0, 907.0, 8425.0)
    again = scene(result, {"targets": [{"hz": 54.0, "number": 1}]})
    assert again.measured_hz == (54.0, 269.0, 907.0, 8425.0)
    for wrong in ([{"hz": 54.0, "number": 5}], [{"hz": 54.0, "number": 1}] * 2):
        with pytest.raises(InvalidScene, match="modes 1 to 4, each once"):
            scene(result, {"targets": wrong})
    plate = scene("plate-on-bolts", {"targets": [{"hz": 900.0, "number": 1}]})
    assert plate.remeasured({1: {"hz": 950.0}}).measured_hz == (950.0,)


@pytest.mark.slow
def test_a_value_that_ends_at_its_bound_and_a_mode_beyond_those_computed_are_named(shared_cache):
    """110 Hz cannot become 300 Hz by twice the modulus."""
    free = ("materials.aluminium.young",)
    report = tune("cantilever", match="1=300", free=free, out=None).report
    assert any("ends at its bound, 2 of the scene's" in remark for remark in report.remarks)
    with pytest.raises(InvalidScene, match="mode 199 is beyond the modes that are computed"):
        tune("cantilever", match="199=300", free=free, out=None)


@pytest.mark.parametrize("out", ["given/tuned.toml", "tuned.toml"])
def test_a_tuned_scene_of_a_step_file_keeps_its_comments(out, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    source = Path("given/mine.toml")
    source.parent.mkdir()
    Path("given/part.step").touch()
    source.write_text(
        '# of a test\nassembly = { step = "part.step", held = ["base:-z"], material = "steel" }\n'
        '[[joints]]\nname = "bolts"  # M6\nbetween = "lid|base"\nkz = 1e8  # N/m\n'
        "[[targets]]\nnumber = 3\nhz = 990.0\n"
    )
    given = scene(source)
    (bolts,) = given.joints
    result = given.but(joints=(bolts.but(kz=2e8),))
    file = OutputFile(out, "--out", inputs=(), ending=".toml", overwrite=False)
    assert write_scene(result, file, "Of mode 3.", source)[0].name == "tuned"
    text = Path(out).read_text()
    assert "# of a test" in text and "# M6" in text and "200000000.0" in text
    assert scene(out).but(name=given.name) == result

    # of a table that had defaults alone the value that was set
    coarse = result.but(mesh={"scale": 2.0})
    write_scene(coarse, file, "Of mode 3.", source)
    text = Path(out).read_text()
    assert "[mesh]\nscale = 2.0\n" in text and "element" not in text
    assert scene(out).but(name=given.name) == coarse


@pytest.mark.slow
def test_targets_by_number_are_called_by_the_numbers_of_their_modes(tmp_path):
    path = tmp_path / "block.toml"
    path.write_text(
        "# a block on springs\n"
        'assembly = { held = ["base:-z"], material = "steel", touching = "free" }\n'
        "[bodies.base]\nbox = [0.06, 0.04, 0.02]\nseed = 0.02\n"
        "[bodies.block]\nbox = [0.06, 0.04, 0.02]\nseed = 0.02\nat = [0.0, 0.0, 0.02]\n"
        '[[joints]]\nname = "pads"\nbetween = "block|base"\n'
        "at = [[-0.02, 0.0, 0.01], [0.02, 0.0, 0.01]]\n"
        "washer = 0.008\nkz = 1e7  # N/m, of the pads\nkx = 1e7\nky = 1e7\n"
        "krx = 500.0\nkry = 500.0\nkrz = 500.0\n"
    )
    computed = pipeline_of(scene(path), silent)("modes").omega / (2 * np.pi)
    hz = {2: 0.99 * float(computed[1]), 3: 0.99 * float(computed[2])}
    free = ("joints.pads.kz", "joints.pads.ky")
    tuning = tune(path, match=hz, free=free, out=tmp_path / "tuned.toml")
    report = tuning.report
    keyed = report.match, report.modes_hz, report.full_order_hz, report.mac, report.computed_mode
    assert all([*one] == ["2", "3"] for one in keyed)
    assert report.computed_mode == {"2": 2, "3": 3}
    np.testing.assert_allclose([*report.modes_hz.values()], [*hz.values()], rtol=0.01)
    lines = report.text().splitlines()
    head = next(i for i, line in enumerate(lines) if line.split()[:1] == ["2"])
    assert [line.split()[:2] for line in lines[head : head + 2]] == [["2", "2"], ["3", "3"]]

    # the scene that was written, its modes table, and what --match names of it
    written = tmp_path / "tuned.toml"
    rows = mode_table(pipeline_of(scene(written), silent)).rows
    assert [row.hammer_mode for row in rows[:4]] == [None, 2, 3, None]
    assert rows[2].hammer_hz == pytest.approx(hz[3])
    assert [*tune(written, match=[3], free=free[:1]).report.match] == ["3"]
    with pytest.raises(InvalidScene, match="must name modes 2 or 3 of the targets"):
        tune(written, match="1", free=free)
    twice = {"targets": [{"hz": 900.0, "number": 2}, {"hz": 950.0, "number": 2}]}
    with pytest.raises(InvalidScene, match="2 tables of number = 2"):
        scene(path, twice)


@pytest.mark.slow
def test_shapes_of_a_low_mac_share_a_sentence(tmp_path, monkeypatch):
    """Stiffnesses of pads that are far below those of stiff joints: several shapes are others."""
    monkeypatch.chdir(tmp_path)
    Path("pads.toml").write_text(
        'assembly = { held = ["base:-z"], material = "steel", touching = "free" }\n'
        "[bodies.base]\nbox = [0.06, 0.04, 0.02]\nseed = 0.02\n"
        "[bodies.block]\nbox = [0.06, 0.04, 0.02]\nseed = 0.02\nat = [0.0, 0.0, 0.02]\n"
        '[[joints]]\nname = "pads"\nbetween = "block|base"\n'
        "at = [[-0.02, 0.0, 0.01], [0.02, 0.0, 0.01]]\nwasher = 0.008\n"
        "kz = 1e6\nkx = 1e5\nky = 1e5\nkrx = 5.0\nkry = 5.0\nkrz = 5.0\n"
    )
    hz = pipeline_of(scene("pads.toml"), silent)("modes").omega[:4] / (2 * np.pi)
    match = ",".join(f"{n}={float(f):.6g}" for n, f in enumerate(hz, start=1))
    report = tune("pads.toml", match=match, free="joints.pads.kz,joints.pads.kx", out=None).report
    unlike = [n for n, value in report.mac.items() if value < 0.8]
    assert len(unlike) > 1
    (sentence,) = (s for s in report.remarks if "no proof of the joint" in s)
    assert sentence.startswith(f"the shapes of modes {', '.join(unlike)} have a MAC of ")


BAR = """
assembly = { held = ["bar:-x"], material = "mine" }
materials = { mine = { young = 70e9, poisson = 0.33, density = 2700.0 } }
[bodies.bar]
box = [0.2, 0.02, 0.01]
seed = 0.01
[[targets]]
number = 1
hz = 210.0
"""


@pytest.mark.parametrize(("key", "power"), [("young", 2), ("density", -2)])
@pytest.mark.parametrize("threshold", ["WORTH_PARDISO", "WORTH_COUNTING"])
def test_a_material_alone_is_tuned_by_every_solver(
    threshold, key, power, tmp_path, monkeypatch, capsys
):
    # no joint, spring or carried mass: the basis has no attachment shapes. f ~ sqrt(E / rho)
    values = {"WORTH_PARDISO": 100, "WORTH_COUNTING": (1, 1)}
    monkeypatch.setattr(factorisation, threshold, values[threshold])
    monkeypatch.chdir(tmp_path)
    Path("bar.toml").write_text(BAR)
    first_hz = mode_table(pipeline_of(scene("bar.toml"), silent)).rows[0].frequency_hz
    assert beadwave("tune", "bar.toml", f"--free=materials.mine.{key}", "--json") == 0
    report = json.loads(capsys.readouterr().out)
    factor = (210.0 / first_hz) ** power
    assert report["stiffness"][f"materials.mine.{key}"] == pytest.approx(factor, rel=2e-5)
