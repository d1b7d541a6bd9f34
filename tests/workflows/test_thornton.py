"""Scenes whose contacts yield (C. Thornton, J. Appl. Mech. 64 (1997) 383)."""

import json

import numpy as np
import pytest

from beadwave.dem import rigid_wall
from beadwave.workflows.files.scene import scene
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.stages.chain.chain import contact_radius, start
from beadwave.workflows.stages.chain.impact import impact
from beadwave.workflows.stages.chain.walls import wall_of

from command_line import beadwave

PRESSURE = 1.6e9  # Pa
ALONE = ("chain.count=1", "output.spheres=[1]", "time.duration=0.4e-3", "time.error=1e-6")


def yielding(*changes):
    law = ("contact.law=thornton", f"contact.yield_pressure={PRESSURE}")
    return scene("rig-half-space", (*law, *changes))


def thorntons(speed, density=7800.0):
    """Restitution of a steel sphere on steel by its speed and that of first yield."""
    E_star = 0.5 * 210e9 / (1 - 0.3**2)
    first = (0.5 * np.pi / E_star) ** 2 * np.sqrt(0.4 * PRESSURE**5 / density)
    ratio = first / speed
    softer = ratio / (ratio + 2 * np.sqrt(1.2 - 0.2 * ratio**2))
    return np.sqrt(6 * np.sqrt(3) / 5) * np.sqrt(1 - ratio**2 / 6) * softer**0.25


@pytest.mark.parametrize("speed", [0.2, 0.31, 2.0])
def test_a_sphere_of_a_scene_bounces_as_thornton_has_it(speed):
    alone = yielding(*ALONE, f"striker.velocity={speed}")
    run = impact(alone, start(alone), rigid_wall()).trajectory
    assert -run.v[-1, 0] / speed == pytest.approx(thorntons(speed), abs=2e-6)  # twice the error
    lost = run.dissipated_contact[-1] / run.energy_kinetic[0]
    assert lost == pytest.approx(1 - thorntons(speed) ** 2, abs=4e-6)
    assert run.energy_error < 1e-6


def radius(of, force):
    return contact_radius(of, start(of), force)


def test_a_pressure_that_is_never_reached_changes_nothing():
    hertz = scene("rig-half-space", ("chain.count=5", "output.spheres=[1]", "time.dt=5e-7"))
    law = {"law": "thornton", "yield_pressure": (1e12,) * 5}
    plastic = hertz.model_copy(update={"contact": hertz.contact.model_copy(update=law)})
    one, two = (impact(s, start(s), wall_of(s)).trajectory for s in (hertz, plastic))
    assert np.abs(two.v - one.v).max() < 1e-6 * 0.31  # two schemes at one step
    assert two.dissipated_contact.max() == 0.0
    assert radius(plastic, 100.0) == pytest.approx(radius(hertz, 100.0))


def test_a_yielding_contact_is_wider_at_the_same_force():
    assert radius(yielding(), 5e3) > 1.3 * radius(scene("rig-half-space"), 5e3)


def test_a_run_tells_which_contacts_yield_and_books_the_loss(tmp_path, capsys):
    law = ["--set=contact.law=thornton", f"--set=contact.yield_pressure={PRESSURE}"]
    small = ["--set=chain.count=5", "--set=output.spheres=[1]", "--set=time.duration=1e-3"]
    assert beadwave("run", "rig-rigid", f"--out={tmp_path}/out", "--json", *law, *small) == 0
    summary = json.loads(capsys.readouterr().out)
    assert any("5 of 5 contacts yield" in said for said in summary["verdict"])
    assert not any("would yield with" in said for said in summary["warnings"])
    kept = np.load(tmp_path / "out" / "trajectory.npz")
    assert kept["dissipated_contact"][-1] > 0.3 * kept["energy_kinetic"][0]
    assert 'law = "thornton"' in (tmp_path / "out" / "scene.toml").read_text(encoding="utf-8")


LAW = ("contact.law=thornton", "contact.yield_pressure=1e9")
REFUSED = {
    "needs yield_pressure": LAW[:1],
    "belongs to law": LAW[1:],
    "a millionth of the spheres' young": (
        LAW[0],
        "contact.yield_pressure=1",
        "unusual=['contact.yield_pressure']",
    ),
    "has 1 values": (LAW[0], "contact.yield_pressure=[1e9]"),
    'with wall.kind = "dashpot"': (*LAW, "wall={kind='dashpot', coefficient=100}"),
}


@pytest.mark.parametrize("words", REFUSED)
def test_a_law_that_cannot_be_is_refused(words):
    with pytest.raises(InvalidScene, match=words):
        scene("rig-rigid", REFUSED[words])


def test_modes_that_dampers_couple_take_no_yielding_contacts():
    with pytest.raises(InvalidScene, match="not marched with dashpots"):
        scene("rig-rom", (*LAW, "joints.head={kz=1e8, cz=10.0}"))
    with pytest.raises(InvalidScene, match=r'patch\.weights = "thesis"'):
        scene("rig-rom", (*LAW, "patch.weights=thesis"))


@pytest.mark.parametrize("command", ["accuracy", "calibrate"])
def test_what_knows_no_history_refuses_it(command, tmp_path, capsys):
    data = tmp_path / "data.csv"
    t = np.arange(0, 1e-3, 1e-6)
    v = 0.2 * np.exp(-(((t - 4e-4) / 3e-5) ** 2))
    rows = "\n".join(f"{a:.6e},{b:.6e}" for a, b in zip(t, v, strict=True))
    data.write_text(f"t [s],v4 [m/s]\n{rows}\n", encoding="utf-8")
    given = {"accuracy": ["--stage=time"], "calibrate": [str(data)]}[command]
    assert beadwave(command, "rig-rigid", *given, *(f"--set={change}" for change in LAW)) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and ("history" in said or "plastic contacts" in said)
