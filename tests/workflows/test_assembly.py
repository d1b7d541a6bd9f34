"""The assembly through all stages on a coarse mesh, and the files it leaves."""

import json

import numpy as np
import pytest
import tomli_w

from beadwave.workflows.files.scene import scene
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.scene.rig import DIMENSIONS, RigTable
from beadwave.workflows.scene.toml import resolved
from beadwave.workflows.stages.structure import assembly as assembly_stages
from beadwave.workflows.structure import thesis_tables

from command_line import COARSE_RUN, beadwave


def coarse(command, *more):
    return beadwave(command, "rig-rom", *(f"--set={change}" for change in COARSE_RUN), *more)


@pytest.fixture(autouse=True)
def kept_there(rig_cache, tmp_path, monkeypatch):
    """The commands of a test work in a folder of its own, and keep results beside those of the
    coarse run."""
    monkeypatch.setenv("BEADWAVE_CACHE_DIR", str(rig_cache))
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="module")
def run(coarse_run):
    """Folder and summary of one coarse run."""
    return coarse_run, json.loads((coarse_run / "summary.json").read_text())


@pytest.mark.slow
def test_the_folder_holds_every_file_of_the_contract(run):
    folder, summary = run
    wanted = {
        "given.toml", "scene.toml", "summary.json", "trajectory.npz", "rom.npz", "rom.mat",
        "modes.vtu", "response.npz", "missed.npz",
        ".beadwave", "report.html",
        "velocities.png", "waves.png", "energies.png", "frequency_response.png",
    }  # fmt: skip
    if not any("rendered" in warning for warning in summary["warnings"]):
        wanted |= {"assembly.png", "modes.png", "mesh-error.png"}
    assert {path.name for path in folder.rglob("*.*")} == wanted


def test_the_four_modes_are_those_of_the_hammer_test(run):
    """Tuned on the default mesh; a coarse one is some percent stiffer."""
    modes = [run[1]["modes_hz"][str(i)] for i in (1, 2, 3, 4)]
    np.testing.assert_allclose(modes, [51, 269, 907, 8425], rtol=0.05)


def test_every_error_stands_in_the_summary(run):
    errors = run[1]["error_estimate"]
    assert errors["time"] < 1e-4
    assert 1e-6 < errors["reduction"] < 4e-4  # 5e-4 between twice and all of the modes
    assert 1e-3 < errors["mesh"] < 0.5  # 0.2 of so coarse a mesh
    assert run[1]["energy_error"] < 1e-6


def test_the_wall_moves_and_takes_energy(run):
    with np.load(run[0] / "trajectory.npz") as trajectory:
        assert np.abs(trajectory["wall_x"]).max() > 1e-7
        assert trajectory["energy_wall"][-1] > 0.01 * trajectory["energy_total"][0]


def test_another_striker_builds_nothing_of_the_assembly(run, monkeypatch, capsys):
    for name in ("mesh", "model", "modes", "contact"):
        monkeypatch.setattr(f"beadwave.workflows.stages.structure.assembly.{name}", None)
    monkeypatch.setattr("beadwave.workflows.stages.structure.reduction.reduction", None)
    assert coarse("run", "--set=striker.velocity=0.4", "--out=out", "--json") == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["modes_hz"] == run[1]["modes_hz"]
    assert summary["peak_wall_force_N"] > 1.2 * run[1]["peak_wall_force_N"]


def test_a_reduced_model_from_a_file_is_the_same_wall(run, capsys):
    for name in ("rom.npz", "rom.mat"):
        assert coarse("impact", f"--rom={run[0] / name}", "--json") == 0
        found = json.loads(capsys.readouterr().out)
        for number in ("peak_wall_force_N", "n_wall_modes"):
            assert found[number] == pytest.approx(run[1][number], rel=1e-6)


def test_the_reduced_model_is_written_alone(run, tmp_path):
    assert coarse("reduce", "--out=rom.mat") == 0
    assert (tmp_path / "rom.mat").exists()
    assert coarse("reduce", "--out=rom.txt") == 2


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("reduce", "--out=folder.npz"), "folder.npz cannot be written, it is a folder"),
        (("reduce", "--out=file/rom.npz"), "--out file/rom.npz cannot be a file"),
        (("modes", "--inp=folder.npz"), "--inp folder.npz cannot be written"),
        (("modes", "--step=bodies.stl"), "--step bodies.stl must end in .step"),
        (("tune", "--out=folder.npz"), "--out folder.npz must end in .toml"),
    ],
)
def test_a_file_that_cannot_be_written_is_refused_before_anything_is_computed(
    arguments, words, tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr("beadwave.workflows.stages.engine.pipeline.Pipeline.__call__", None)
    (tmp_path / "folder.npz").mkdir()
    (tmp_path / "file").touch()
    assert coarse(*arguments) == 2
    assert words in capsys.readouterr().err


def test_hdf5_without_its_reader_is_refused_before_anything_is_computed(monkeypatch, capsys):
    monkeypatch.setattr("beadwave.workflows.files.wall_file.find_spec", lambda name: None)
    assert coarse("reduce", "--out=rom.h5") == 2
    assert "install.sh h5" in capsys.readouterr().err


def test_modes_stand_beside_the_hammer_test(run, capsys):
    assert coarse("modes", "--json") == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    tested = {row["hammer_mode"]: row for row in rows if row["hammer_mode"]}
    assert set(tested) == {1, 2, 3, 4}
    assert tested[3]["frequency_hz"] == pytest.approx(run[1]["modes_hz"]["3"])
    assert tested[3]["participation"] > 0.1  # a blow beside the middle turns the block
    assert all(0.95 < tested[i]["mac"] <= 1 for i in (1, 3, 4))
    assert 0.5 < tested[2]["mac"] < 0.9  # the soft joints take the pitch out of mode 2
    assert coarse("modes") == 0
    assert "907 Hz" in capsys.readouterr().out


@pytest.mark.slow
def test_modes_of_tied_parts_are_their_own_reference(run, capsys):
    assert coarse("modes", "--set=assembly.constraint=full-tie", "--json") == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [row["mac"] for row in rows if row["hammer_mode"]] == pytest.approx([1.0] * 4, abs=1e-9)


def test_a_run_compares_the_shapes_of_targets(run):
    assert "mac" in {stage["name"] for stage in run[1]["stages"]}


def test_a_scene_without_an_assembly_has_no_modes(capsys):
    assert beadwave("modes", "rig-rigid") == 2
    assert "[assembly]" in capsys.readouterr().err


def test_a_wall_without_the_assembly_builds_none_of_it(run, capsys):
    assert coarse("run", "--set=wall.kind=rigid", "--out=out", "--json") == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["modes_hz"] == {}
    stages = {stage["name"] for stage in summary["stages"]}
    assert stages == {"wall", "compilation", "impact", "waves", "figures"}


def test_the_built_in_scene_has_the_dimensions_that_are_the_defaults():
    table, fitted = scene("rig-rom").rig.assembly, RigTable()
    assert all(getattr(table, name) == getattr(fitted, name) for name in DIMENSIONS)


def test_the_mesh_has_a_node_at_the_contact():
    points = assembly_stages.mesh(scene("rig-rom", COARSE_RUN)).meshes["block"].p
    half = RigTable().block_z / 2
    offsets = points - np.array([[RigTable().block_x / 2], [0.03], [half]])
    assert np.linalg.norm(offsets, axis=0).min() < 1e-9


def test_a_patch_that_leaves_the_block_is_refused(capsys):
    assert coarse("run", "--set=patch.point=[0.045, 0.0]", "--out=out") == 2
    assert "patch.point" in capsys.readouterr().err


def test_a_foreign_file_is_refused_in_a_sentence(tmp_path):
    (tmp_path / "rom.npz").write_bytes(b"no model")
    tables = {
        "chain": {"count": 2, "radius": 0.01, "density": 7800.0, "young": 2e11, "poisson": 0.3},
        "striker": {"velocity": 1.0},
        "wall": {"kind": "rom", "file": "rom.npz"},
    }
    with pytest.raises(InvalidScene, match=r"rom\.npz cannot be read"):
        (tmp_path / "mine.toml").write_text(tomli_w.dumps(tables))
        scene(str(tmp_path / "mine.toml"))
    assert beadwave("impact", "rig-rigid", f"--rom={tmp_path / 'rom.npz'}") == 2
    tables["wall"]["file"] = "absent.npz"
    with pytest.raises(InvalidScene, match="absent"):
        resolved(tables, "scene", tmp_path)


@pytest.mark.slow
def test_a_table_of_the_thesis_is_rebuilt_beside_its_numbers(monkeypatch, capsys):
    monkeypatch.setattr(thesis_tables, "TABLE_52", thesis_tables.TABLE_52[::3])
    changes = [f"--set={change}" for change in COARSE_RUN]
    assert beadwave("modes", "rig-rom", *changes, "--table=5.2", "--json") == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [row["model"] for row in rows] == ["full-tie", "screw-tie"]
    for row in rows:
        hz, thesis = np.array(row["modes_hz"]), np.array(row["thesis_hz"])
        np.testing.assert_allclose(row["difference_percent"], 100 * (hz / thesis - 1), atol=1e-3)
    assert rows[1]["modes_hz"][0] < rows[0]["modes_hz"][0]  # screws alone hold more softly
    assert beadwave("modes", "--table=9.9") == 2


def test_what_a_component_adds_is_told_by_the_names_of_the_rows():
    rows = [
        thesis_tables.TableRow(model=m, modes_hz=hz, thesis_hz=[100.0] * 4, difference_percent=[])
        for m, hz in (
            ("full-tie", [50.0] * 4),
            ("screw-tie", [40.0] * 4),
            ("screw-tie + support", [30.0] * 4),
            ("full-tie + support", [55.0, 50.0, 25.0, None]),
            ("full-tie + support + plate", [55.0] * 4),
        )
    ]
    found = thesis_tables.added(thesis_tables.ThesisTable(rows=rows))
    assert found["full-tie"].components == ("support", "plate")
    np.testing.assert_allclose(found["full-tie"].ours[0], [10.0, 0.0, -50.0, np.nan], rtol=1e-12)
    np.testing.assert_allclose(found["screw-tie"].ours, [[-25.0] * 4], rtol=1e-12)
    assert not found["screw-tie"].thesis.any()
