"""A chain that meets a structure with friction, by the words of a scene and by an imported wall."""

import json
import re

import numpy as np
import pytest

from beadwave import impact, rom
from beadwave.workflows.files.scene import scene
from beadwave.workflows.scene import InvalidScene

from block_scene import BLOCK, SENSED, pipeline
from command_line import beadwave

FRICTION = ("friction.coefficient=0.2", "arm.stiffness=2e6", "arm.rotation=1e3")


@pytest.fixture(scope="module", autouse=True)
def folder(module_folder):
    (module_folder / "block.toml").write_text(BLOCK)
    return module_folder


@pytest.mark.slow
def test_a_structure_that_is_struck_off_its_middle_moves_the_sphere_across(capsys):
    sets = [f"--set={change}" for change in FRICTION]
    assert beadwave("impact", "block.toml", "--json", "--out=o", *sets) == 0
    summary = json.loads(capsys.readouterr().out)
    across = summary["friction"]
    assert np.hypot(*across["velocity_m_s"]) > 1e-6
    assert across["dissipated_J"] > 0.0
    assert summary["energy_error"] < 1e-4
    run = dict(np.load("o/trajectory.npz"))
    assert run["wall_q"].shape[1] == len(run["wall_omega"])
    bound = 0.2 * run["contact_force"][:, -1]
    assert (np.hypot(*run["friction_force"].T) <= bound * (1 + 1e-9) + 1e-9).all()
    # the structure moves with the last sphere, along the chain and across it
    assert np.ptp(run["wall_t"][:, 0]) > 0.0
    assert any("Errors of reduction and mesh" in sentence for sentence in summary["warnings"])


@pytest.mark.slow
def test_the_sphere_before_holds_the_last_one_on_a_structure():
    """Pressed together they rub: less motion across, heat at both contacts, the same ledger."""
    changes = {"friction.coefficient": 0.2, "arm.stiffness": 2e6, "arm.rotation": 1e3}
    free, held = (
        impact("block.toml", changes | further).summary
        for further in ({}, {"friction.between_spheres": 0.4})
    )
    across, with_before = (np.hypot(*run.friction.velocity_m_s) for run in (free, held))
    assert abs(across - with_before) > 0.02 * across
    assert held.friction.dissipated_J != free.friction.dissipated_J
    assert held.energy_error < 1e-4


def test_without_force_across_the_run_is_that_without_friction():
    """A sphere without an arm whose friction is a millionth: along the chain nothing changes, and
    sensors on the structure show the same by the march's modes and by the contact force."""
    changes = (SENSED, "time.error=1e-6", "reduction.modes=30", "reduction.to_hz=50e3")
    plain = pipeline(scene("block.toml", changes))
    rubbed = pipeline(scene("block.toml", (*changes, "friction.coefficient=1e-6")))
    v, v_rubbed = (results("impact").trajectory.v for results in (plain, rubbed))
    # the model of the scene with friction has two functionals more, and so other modes above 50 kHz
    assert np.abs(v_rubbed - v).max() < 2e-6 * 0.1  # measured 1.9e-7
    y, y_rubbed = (results("record").y for results in (plain, rubbed))
    # measured 2.8e-3 of the first, a quiet place, and 2e-6 of the others
    allowed = np.array([1e-2, 2e-5, 2e-5, 2e-5])
    assert (np.abs(y_rubbed - y).max(axis=0) < allowed * np.abs(y).max(axis=0)).all()


def imported(path, W, names=()):
    """A wall file of two modes, with w of the columns given."""
    columns = {"w_load": np.array([[0.5], [0.2]]), "load_names": list(names)} if names else {}
    omega = 2 * np.pi * np.array([400.0, 900.0])
    np.savez(path, K=np.diag(omega**2), M=np.eye(2), w=W, **columns)


def test_an_imported_wall_of_three_columns_turns_with_its_directions(capsys):
    """t1 and t2 exchanged in the file and in the striker's velocity: the answer exchanged."""
    W = np.array([[1.2, 0.7, 0.1], [0.4, -0.6, 0.9]])
    answers = []
    for columns, velocity in ((W, [0.05, 0.01]), (W[:, [0, 2, 1]], [0.01, 0.05])):
        imported("wall.npz", columns)
        sets = [f"--set=striker.tangential_velocity={velocity}", "--set=friction.coefficient=0.2"]
        assert beadwave("impact", "oblique-sphere", "--json", "--set=wall.kind=rom",
                        "--set=wall.file=wall.npz", *sets) == 0  # fmt: skip
        answers.append(json.loads(capsys.readouterr().out)["friction"]["velocity_m_s"])
    assert answers[1] == pytest.approx(answers[0][::-1], rel=1e-6)
    assert abs(answers[0][1] - 0.01) > 1e-5


def test_an_imported_wall_of_one_column_is_refused_with_friction(capsys):
    imported("wall.npz", np.array([1.2, 0.4]))
    assert beadwave("impact", "oblique-sphere", "--set=wall.kind=rom",
                    "--set=wall.file=wall.npz") == 2  # fmt: skip
    assert "w with three columns" in capsys.readouterr().err


THREE_SPHERES = """
name = "shaken-modes"
[chain]
count = 3
radius = 0.0127
density = 7800.0
young = 210e9
poisson = 0.3
[striker]
velocity = 0.1
[preload]
force = 20.0
[friction]
coefficient = 0.2
upstream = "{}"
[arm]
stiffness = 2e6
rotation = 300.0
[wall]
kind = "rom"
file = "wall.npz"
[[shakers]]
name = "motor"
on = "wall"
frequency = 500.0
force = 5.0
[damping]
kind = "modal"
ratio = 0.05
[time]
duration = 3e-4
error = 1e-3
"""


def test_spheres_that_nothing_holds_beside_a_shaken_structure_are_held_by_a_word(capsys, folder):
    """They would be pushed away: refused by default, at rest until the striker with "held"."""
    imported("wall.npz", np.array([[1.2, 0.7, 0.1], [0.4, -0.6, 0.9]]), names=["motor"])
    (folder / "free.toml").write_text(THREE_SPHERES.format("free"))
    assert beadwave("impact", "free.toml") == 2
    assert 'set friction.upstream to "held"' in capsys.readouterr().err
    (folder / "held.toml").write_text(THREE_SPHERES.format("held"))
    assert beadwave("impact", "held.toml", "--json") == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["friction"]["loop_tangential_N"] > 0.0
    assert summary["energy_error"] < 1e-3


REFUSED = {
    'friction.upstream = "held" holds the other spheres': ["friction.upstream=held"],
    "[friction] needs a contact that is read where it is loaded": ["strike.weights=thesis"],
}


@pytest.mark.parametrize("sentence", REFUSED)
def test_what_a_structure_with_friction_does_not_take_is_refused(sentence):
    with pytest.raises(InvalidScene, match=re.escape(sentence)):
        scene("block.toml", (*FRICTION, *REFUSED[sentence]))


@pytest.mark.slow
def test_a_reduced_model_of_friction_is_a_wall_of_another_run(capsys):
    """rom.npz of a run, with its w of three columns, taken as wall.file: the same answer."""
    sets = [f"--set={change}" for change in FRICTION]
    assert beadwave("impact", "block.toml", "--json", *sets) == 0
    first = json.loads(capsys.readouterr().out)
    reduced = pipeline(scene("block.toml", FRICTION))("reduction")
    rom.save_npz("own.npz", reduced)
    assert beadwave("impact", "block.toml", "--json", "--rom=own.npz", *sets) == 0
    second = json.loads(capsys.readouterr().out)
    for key in ("velocity_m_s", "spin_rad_s"):
        assert second["friction"][key] == pytest.approx(first["friction"][key], rel=1e-6)


SHAKEN = [
    "--set=wall.kind=rom", "--set=wall.file=shaken.npz", "--set=preload.force=20",
    "--set=damping.kind=modal", "--set=damping.ratio=0.02", "--set=time.error=1e-3",
    "--set=time.duration=1e-3", "--set=time.horizon=1e-3", "--set=output.samples=501",
]  # fmt: skip


def shaken(capsys, tables, status=0):
    """Summary of a sphere that is pressed on an imported wall of two modes, which is shaken."""
    sets = [f"--set=shakers=[{tables}]"]
    assert beadwave("impact", "shaken-plane", "--json", "--out=s", "--overwrite",
                    *SHAKEN, *sets) == status  # fmt: skip
    printed = capsys.readouterr()
    return json.loads(printed.out) if status == 0 else printed.err


def test_a_shaker_of_an_imported_wall_brings_the_contact_into_a_period(capsys):
    """The heat of the run, which lasts a period, is the loop's, and the ledger closes with the
    shaker's work. A stinger a thousand times as soft as the structure at its shaker makes a motion
    the force that it is times the stiffness."""
    imported("shaken.npz", np.array([[0.1, 0.9, 0.0], [0.05, -0.5, 0.0]]), ("top",))
    base = 'name = "top", on = "wall", frequency = 1000.0'
    summary = shaken(capsys, f"{{ {base}, force = 20.0 }}")
    by_force = summary["friction"]
    assert 0.0 < summary["error_estimate"]["time"] <= 1e-3  # along and across are one march
    off = by_force["loop_unbalanced_J"] / by_force["loop_energy_J"]
    assert 0.0 < off and any("all losses" in line for line in summary["warnings"]) == (off > 0.05)
    run = dict(np.load("s/trajectory.npz"))
    assert by_force["periodicity_error"] < 1e-3
    loop = by_force["loop_energy_J"]
    assert loop > 1e-8 and by_force["dissipated_J"] == pytest.approx(loop, rel=1e-2)
    assert np.ptp(run["energy_total"]) < 1e-2 * loop
    by_motion = shaken(capsys, f"{{ {base}, displacement = 1e-3, stinger = 2e4 }}")["friction"]
    assert by_motion["loop_energy_J"] == pytest.approx(loop, rel=2e-2)


def test_a_shaker_that_the_file_does_not_have_is_refused(capsys):
    imported("shaken.npz", np.array([[0.1, 0.9, 0.0], [0.05, -0.5, 0.0]]), ("top",))
    why = shaken(capsys, '{ name = "side", on = "wall", frequency = 1000.0, force = 20.0 }', 2)
    assert "shakers.side is no shaker of wall.file, which has top" in why
