"""The study of friction on the shaken rig: what it compares, on a coarse mesh and few rows."""

from contextlib import nullcontext

import pytest

from beadwave.workflows.evidence.thesis.friction import FrictionOptions, cases, friction, label
from beadwave.workflows.files.scene import scene
from beadwave.workflows.scene import InvalidScene

from command_line import COARSE_RIG


def quiet(stage):
    return nullcontext()


def test_each_row_changes_one_thing():
    rig = scene("rig-shaker")
    options = FrictionOptions(
        coefficients=(0.1,), forces=(2.0,), phases=(90.0,), arms=(0.5,), patches=(0.0,)
    )
    rows = {label(case): case for case in cases(rig, options)}
    assert list(rows) == [
        "scene 0.2", "coefficient 0.1", "phase [deg] 180", "force [N] 2", "arm [MN/m] 1",
        "patch [mm] 0",
    ]  # fmt: skip
    assert rows["coefficient 0.1"].scene.friction.coefficient == 0.1
    assert rows["phase [deg] 180"].turn == 0.25 and rows["phase [deg] 180"].scene == rig
    assert rows["force [N] 2"].scene.shakers[0].force == 2.0
    assert rows["arm [MN/m] 1"].scene.arm.stiffness == 1e6
    assert rows["patch [mm] 0"].scene.patch.point == (0.0, 0.0)


@pytest.mark.parametrize("name", ["rig-rom", "shaken-plane"])
def test_a_scene_without_a_shaken_structure_is_refused(name):
    with pytest.raises(InvalidScene, match=r"take rig-shaker|too short"):
        friction(scene(name), quiet)


@pytest.mark.parametrize(
    ("table", "changes", "said"),
    [
        ("arm", {"stiffness": (2e6, 1e6)}, "an .arm. of one stiffness"),
        ("shakers", {"force": None, "velocity": 1e-3, "stinger": 1e6}, "push by a force"),
    ],
)
def test_a_rig_that_the_study_cannot_vary_is_refused_in_a_sentence(table, changes, said):
    rig = scene("rig-shaker")
    changed = rig.arm.but(**changes) if table == "arm" else (rig.shakers[0].but(**changes),)
    rig = rig.but(**{table: changed})
    with pytest.raises(InvalidScene, match=said):
        friction(rig, quiet)


@pytest.mark.slow
def test_slip_shows_in_later_waves_and_through_the_structures_coupling_alone():
    """On a coarse mesh as on the rig's: the first reflected wave of a contact that slips in part
    hardly moves, the later ones do; without coupled directions nothing does."""
    options = FrictionOptions(coefficients=(), forces=(), phases=(90.0,), arms=(), patches=())
    rig = scene("rig-shaker", (*COARSE_RIG, "reduction.modes=20"))
    finding = friction(rig, quiet, options)
    table, mechanisms = finding.tables
    assert set(table.column("cycle")) == {"partial slip"}
    error = max(table.column("error_mm_s"))
    assert max(table.column("arrival_us")) < 0.1
    assert min(table.column("later_mm_s")) > 20 * error
    assert max(table.column("amplitude_mm_s")) < 0.1
    rows = {name: (max(first, later), error) for name, first, later, error in mechanisms.rows}
    largest, error = rows["all but the structure's coupling"]
    assert largest < error
    assert all(x > 50 * error for name, (x, _) in rows.items() if not name.startswith("all but"))
    assert any(sentence.startswith("A contact in partial slip") for sentence in finding.sentences)
