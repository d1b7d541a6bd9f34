"""Scenes of any assembly through the commands: modes against theory, runs, tuning, refusals."""

import json
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest

from fem import Material
from workflows.commands.app import main
from workflows.files.scene import scene
from workflows.scene.toml import toml

spec = spec_from_file_location("theory", Path(__file__).with_name("test_fem_theory.py"))
theory = module_from_spec(spec)
spec.loader.exec_module(theory)
ALUMINIUM = Material(70e9, 0.33, 2700.0)
ENDS = ("clamped", "free")


def beadwave(*arguments):
    """The exit status of a command."""
    with pytest.MonkeyPatch.context() as patch, pytest.raises(SystemExit) as end:
        patch.setattr(sys, "argv", ["beadwave", *map(str, arguments)])
        main()
    return end.value.code or 0


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(autouse=True)
def shared_cache(cache, tmp_path, monkeypatch):
    monkeypatch.setenv("BEADWAVE_CACHE_DIR", str(cache))
    monkeypatch.chdir(tmp_path)


def modes_of(capsys, *arguments):
    assert beadwave("modes", *arguments, "--json") == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    return np.array([row["frequency_hz"] for row in rows]), rows


def test_the_cantilever_has_the_modes_of_timoshenko_in_both_planes(capsys):
    """Struck on its side: modes that the contact moves bend one way, the others the other.

    Without Poisson's ratio, as a clamped end that cannot contract stiffens so short a beam by 1 %.
    """
    plain = ("--set=materials.aluminium.poisson=0", "--set=mesh.scale=0.6")
    hz, rows = modes_of(capsys, "cantilever", *plain)
    struck, solid = [row["participation"] for row in rows], ALUMINIUM._replace(poisson=0.0)
    for sides, seen in (((0.02, 0.012), lambda w: w > 0.5), ((0.012, 0.02), lambda w: w < 1e-6)):
        expected = theory.timoshenko_hz(theory.rectangle(0.3, *sides, solid), ENDS, 3)
        found = hz[seen(np.array(struck))]  # it twists and stretches as well
        nearest = np.abs(np.log(np.divide.outer(expected, found))).argmin(axis=1)
        np.testing.assert_allclose(found[nearest], expected, rtol=2e-3)


PLATE = """
[assembly]
held = []
material = "steel"
[materials.steel]
young = 210e9
poisson = 0.3
density = 7850.0
[bodies.plate]
box = [0.3, 0.3, 0.002]
seed = 0.0125
"""


def written(text, name="mine"):
    Path(f"{name}.toml").write_text(text, encoding="utf-8")
    return f"{name}.toml"


def test_a_floating_plate_has_the_modes_of_gorman(capsys):
    """By command: six rigid motions, then Kirchhoff's square plate; h/a = 1/150."""
    hz, _ = modes_of(capsys, written(PLATE))
    assert hz[5] < 1e-2 < hz[6]
    steel, side, h = theory.STEEL, 0.3, 2e-3
    D = steel.young * h**3 / (12 * (1 - steel.poisson**2))
    unit = np.sqrt(D / (steel.density * h)) / side**2 / (2 * np.pi)
    np.testing.assert_allclose(hz[6:11], unit * np.array(theory.FREE), rtol=3e-3)


def test_bolted_plates_run_from_words_to_waves(capsys):
    folder = Path("run")
    fast = ("--set=mesh.scale=2", "--set=reduction.modes=20", "--set=output.samples=501")
    assert beadwave("run", "plate-on-bolts", f"--out={folder}", *fast) == 0
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["energy_error"] < 1e-6
    volume = 0.2 * 0.1 * 0.036 - 4 * np.pi * 0.004**2 * 0.036
    assert summary["reduction"]["mass_kg"] == pytest.approx(7850 * volume, rel=1e-6)
    assert summary["reduction"]["grounding"] < 1e-9
    assert 0 < summary["error_estimate"]["mesh"] < 0.1
    assert len(summary["waves"]["1"]["arrivals"]) >= 1
    assert {"report.html", "rom.npz", "modes.vtu"} <= {path.name for path in folder.iterdir()}
    again = scene(str(folder / "scene.toml"))
    assert toml(again) == (folder / "scene.toml").read_text()
