"""Gravity, guides and drops of a scene: keys, velocities that follow, refusals, runs."""

import json
import re

import numpy as np
import pytest

from beadwave.workflows.files.scene import scene
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.scene.toml import toml
from beadwave.workflows.stages.chain.chain import chain

from command_line import beadwave

G = 9.80665

pytestmark = pytest.mark.usefixtures("own_folder")


def test_a_drop_gives_the_striker_its_velocity():
    assert scene("upright").striker.velocity == pytest.approx(np.sqrt(2 * G * 5e-3), rel=1e-12)
    tilted = scene("upright", {"gravity.inclination": 30.0, "striker.drop": "8 mm"})
    assert tilted.striker.velocity == pytest.approx(np.sqrt(G * 8e-3), rel=1e-12)
    rough = scene("upright", {"gravity.inclination": 30.0, "guides.coefficient": 0.2})
    net = G * (np.sin(np.pi / 6) - 0.2 * np.cos(np.pi / 6))
    assert rough.striker.velocity == pytest.approx(np.sqrt(2 * net * 5e-3), rel=1e-12)
    assert scene("upright", {"striker.velocity": 0.4}).striker.drop is None


def test_weight_and_friction_reach_the_chain():
    tilted = scene("upright", {"gravity.inclination": 30.0, "guides.coefficient": 0.2})
    row = chain(tilted)
    assert row.gravity == pytest.approx(G / 2, rel=1e-12) and row.n_falling == 1
    assert row.friction == pytest.approx(0.2 * G * np.cos(np.pi / 6) * row.mass, rel=1e-12)
    forces = scene("upright", {"guides.force": "20 mN"})
    assert np.array_equal(chain(forces).friction, np.full(20, 0.02))
    lying = scene("upright", {"gravity.inclination": 0.0, "striker.velocity": 0.3})
    assert chain(lying).gravity == 0.0 and chain(lying).n_falling == 0


REFUSED = {
    "makes no fall, 0 m/s^2 act": {"gravity.inclination": 0.0},
    "makes no fall, -0.": {"guides.force": "0.3 N"},
    "lets the chain fall off": {"gravity.inclination": -90.0, "striker.velocity": 0.3},
    'Take wall.kind = "half-space" for a slab': {
        "wall.kind": "dashpot",
        "wall.coefficient": 100.0,
    },
    "presses nothing on the guides": {"guides.coefficient": 0.2},
    "exclude each other": {"guides.force": 0.01, "leaf_springs.stiffness": 10.0},
    "needs either coefficient or force": {"guides": {}},
    "needs velocity in m/s, or drop": {"striker": {}},
    "gives 0.313": {"striker": {"velocity": 0.4, "drop": 5e-3}},
    "gravity.inclination = 91": {"gravity.inclination": 91.0},
    "must be 1 to 30 m/s^2 in size": {"gravity.acceleration": 9800.0},
    "guides.force has 3 values, 20 are allowed": {"guides.force": [0.1, 0.1, 0.1]},
}


@pytest.mark.parametrize("sentence", REFUSED)
def test_what_cannot_be_is_refused(sentence):
    with pytest.raises(InvalidScene, match=re.escape(sentence)):
        scene("upright", REFUSED[sentence])


def test_a_free_chain_or_a_floating_block_carries_no_weight():
    with pytest.raises(InvalidScene, match=r"needs a \[wall\]"):
        scene("free-chain", {"gravity.inclination": 90.0})
    floating = {"assembly.parts": ["block"], "preload.force": 0.0, "gravity.inclination": 90.0}
    with pytest.raises(InvalidScene, match="without supports"):
        scene("rig-full-tie", floating)


def test_a_resolved_drop_reads_back(tmp_path):
    first = scene("upright")
    (tmp_path / "s.toml").write_text(toml(first))
    assert scene(str(tmp_path / "s.toml")) == first


@pytest.mark.slow
def test_the_upright_chain_runs_and_its_ledger_closes(tmp_path, capsys):
    assert beadwave("impact", "upright", "--out=o", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    kept = np.load(tmp_path / "o" / "trajectory.npz")
    mass = chain(scene("upright")).mass
    assert kept["contact_force"][0] == pytest.approx(G * np.cumsum(mass) - G * mass[0], rel=1e-9)
    assert found["energy_error"] < 1e-7
    fallen = G * (kept["x"] - kept["x"][0]) @ mass
    assert kept["work_gravity"] == pytest.approx(fallen, rel=1e-9, abs=1e-15)
    waves = found["sensors"]["force 10"]
    assert (
        waves["unit"] == "V"
        and 0.3e-3 < waves["echo_delay_s"] < 1.5e-3
        and 0.2 < waves["echo_ratio"] < 1.0
    )


@pytest.mark.slow
def test_guides_slow_the_waves_down(capsys):
    speeds = []
    for force in ("0", "1"):
        beadwave("impact", "upright", "--json", "--set=striker.velocity=0.3",
                 f"--set=guides.force={force}", "--set=time.error=1e-4")  # fmt: skip
        told = json.loads(capsys.readouterr().out)
        speeds.append(told["waves"]["20"]["arrivals"][0]["peak_velocity_m_s"])
    assert 0.5 * speeds[0] < speeds[1] < 0.95 * speeds[0]
