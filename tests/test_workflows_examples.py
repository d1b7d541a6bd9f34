"""Examples of users' structures: a page of text each, whole by the commands, as in CalculiX."""

import json
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from shutil import copy, which
from subprocess import run

import numpy as np
import pytest

from command_line import beadwave
from geometry.cad import write_step
from workflows.files.scene import scene, scene_text

pytestmark = pytest.mark.usefixtures("shared_cache")
EXAMPLES = Path(__file__).parents[1] / "examples"
PRINTED = 1e-6  # CalculiX prints seven digits
LONGEST = 25  # lines, with comments and blank ones
COARSE = {"cantilever": 2.0, "plate-on-bolts": 4.0, "gearbox.toml": 6.0}


@pytest.fixture(autouse=True)
def gearbox(shared_cache):
    """The example beside the STEP file that its script draws."""
    spec = spec_from_file_location("gearbox", EXAMPLES / "gearbox.py")
    drawn = module_from_spec(spec)
    spec.loader.exec_module(drawn)
    write_step(drawn.SHAPES, Path("gearbox.step"))
    copy(EXAMPLES / "gearbox.toml", ".")


@pytest.mark.parametrize("name", COARSE)
def test_a_structure_is_a_page_of_text(name):
    assert len(scene_text(name).text.splitlines()) <= LONGEST
    assert scene(name).strike is not None


def answer(capsys, *arguments):
    assert beadwave(*arguments, "--json") == 0
    return json.loads(capsys.readouterr().out)


def test_a_gearbox_goes_from_its_step_file_to_waves(capsys):
    """Modes, bolts tuned to the target, reduced model, waves; six bodies of hexahedra."""
    coarse = "--set=mesh.scale=6"
    rows = answer(capsys, "modes", "gearbox.toml", coarse)["rows"]
    (first,) = (row for row in rows if row["hammer_mode"] == 1)
    assert first["frequency_hz"] != pytest.approx(first["hammer_hz"], rel=5e-3)
    order = (
        "tune",
        "gearbox.toml",
        coarse,
        "--set=reduction.kind=free-modes",
        "--free=joints.cover.kz",
        "--out=tuned.toml",
    )
    report = answer(capsys, *order)
    assert report["full_order_hz"]["1"] == pytest.approx(first["hammer_hz"], rel=1e-4)
    answer(capsys, "reduce", "tuned.toml", "--out=rom.npz")
    summary = answer(capsys, "run", "tuned.toml", "--out=run")
    assert summary["modes_hz"]["1"] == pytest.approx(first["hammer_hz"], rel=1e-4)
    assert summary["energy_error"] < 1e-6
    assert summary["waves"]["1"]["arrivals"]
    assert summary["reduction"]["grounding"] < 1e-9


def calculix_hz():
    """The first ten frequencies of deck.inp."""
    run(["ccx", "deck"], capture_output=True, check=True, timeout=900)
    rows = [line.split() for line in Path("deck.dat").read_text().splitlines()]
    return [float(row[3]) for row in rows if len(row) == 5 and row[0].isdigit()][:10]


@pytest.mark.skipif(which("ccx") is None, reason="CalculiX (Debian: calculix-ccx)")
@pytest.mark.parametrize(("name", "scale"), COARSE.items())
def test_calculix_finds_the_same_ten_frequencies(name, scale, capsys):
    changes = f"--set=mesh.scale={scale}"
    assert beadwave("modes", name, changes, "--inp=deck.inp") == 0
    capsys.readouterr()
    rows = answer(capsys, "modes", name, changes)["rows"]
    ours = np.array([row["frequency_hz"] for row in rows[:10]])
    np.testing.assert_allclose(ours / calculix_hz(), 1.0, rtol=PRINTED)
