"""Scenes of bodies under static load: forces on faces, and heat."""

import json

import numpy as np
import pytest

from beadwave.workflows.files.scene import scene, scene_text
from beadwave.workflows.stages.engine.pipeline import Pipeline, pipeline_of

from command_line import beadwave

pytestmark = pytest.mark.usefixtures("shared_cache")
COARSE = "--set=mesh.scale=3"
FORCE = """
[[loads]]
name = "axial"
on = "beam:+x"
force = 1000.0
"""
HEAT = """
[[loads]]
name = "sun"
body = "b*"
temperature = 40.0
"""
ROD = """
[[loads]]
name = "tendon"
on = "beam:-x"
to = "beam:+x"
tension = "4 kN"
"""


@pytest.fixture
def cantilever(tmp_path):
    """The built-in scene with loads at its end."""

    def written(loads, expansion=True, held='["beam:-x"]'):
        text = scene_text("cantilever").text.replace('["beam:-x"]', held)
        if expansion:
            text = text.replace("density = 2700.0", "expansion = 23e-6\ndensity = 2700.0")
        path = tmp_path / "loaded.toml"
        path.write_text(text + loads)
        return path

    return written


def modes(capsys, *arguments):
    assert beadwave("modes", *arguments, COARSE, "--json") == 0
    computed = json.loads(capsys.readouterr().out)
    return [row["frequency_hz"] for row in computed["rows"]], computed["load_factor"]


@pytest.mark.slow
def test_a_pressed_cantilever_is_slower_and_tells_its_buckling_load(cantilever, capsys):
    """Euler's load of a column on a foot, its weak axis; lambda_1 falls about in proportion."""
    free, none = modes(capsys, "cantilever")
    pressed, mu = modes(capsys, cantilever(FORCE))
    euler = np.pi**2 * 70e9 * 0.02 * 0.012**3 / 12 / (2 * 0.3) ** 2
    assert none is None and mu == pytest.approx(
        1000 / euler, rel=0.03
    )  # a held foot does not shrink
    assert (pressed[0] / free[0]) ** 2 == pytest.approx(1 - mu, abs=0.02)
    pulled, nothing = modes(capsys, cantilever(FORCE), "--set=loads.axial.force=-1000")
    assert pulled[0] > free[0] and nothing == 0
    assert pulled[0] ** 2 - free[0] ** 2 == pytest.approx(free[0] ** 2 - pressed[0] ** 2, rel=0.05)


def test_a_loaded_scene_reads_back_and_says_what_it_bears(cantilever, capsys):
    path = cantilever(FORCE)
    assert scene(str(path)).loads[0].force == 1000.0
    assert beadwave("modes", path, COARSE) == 0
    assert "of the load that buckles it" in capsys.readouterr().out


@pytest.mark.slow
def test_a_tendon_buckles_a_cantilever_as_a_hinged_bar(cantilever, capsys):
    """Its force passes through the foot; a spring along the beam leaves bending alone."""
    (slow, *further), mu = modes(capsys, cantilever(ROD))
    assert mu == pytest.approx(4e3 * 0.3**2 / (np.pi**2 * 70e9 * 0.02 * 0.012**3 / 12), rel=0.01)
    (free, *_), _ = modes(capsys, "cantilever")
    assert slow < 0.97 * free
    (locked, *stretched), same = modes(capsys, cantilever(ROD + 'stiffness = "1e8 N/m"'))
    assert locked == pytest.approx(slow, rel=1e-3) and same == pytest.approx(mu, rel=1e-6)
    assert max(np.divide(stretched, further)) > 1.05


@pytest.mark.slow
def test_heat_between_two_walls_presses(cantilever, capsys):
    held = '["beam:-x", "beam:+x"]'
    cold, _ = modes(capsys, cantilever("", held=held))
    warm, mu = modes(capsys, cantilever(HEAT, held=held))
    euler = np.pi**2 * 70e9 * 0.02 * 0.012**3 / 12 / (0.5 * 0.3) ** 2
    assert mu == pytest.approx(70e9 * 0.02 * 0.012 * 23e-6 * 40 / euler, rel=0.05)
    assert warm[0] < 0.99 * cold[0]
    _, nothing = modes(capsys, cantilever(HEAT))
    assert nothing < 1e-2  # but for the foot, where it is held


def test_a_scene_without_loads_does_no_more_than_before(monkeypatch):
    from beadwave import fem

    monkeypatch.setattr(fem, "prestressed", None)  # would be called
    computed: Pipeline = pipeline_of(
        scene("cantilever", ("mesh.scale=3",)), lambda name: _nothing()
    )
    assert computed("mesh").load is None and computed("model").load_factor is None


def _nothing():
    from contextlib import nullcontext

    return nullcontext()


REFUSED = {
    FORCE.replace("1000.0", "1e6"): "times that which buckles the structure",
    FORCE.replace('on = "beam:+x"', 'body = "beam"'): "it needs one of on and force",
    ROD + "force = 1.0\n": "has force, on, tension, to; it needs one of",
    ROD.replace("-x", "+x"): "has no length",
    ROD + "stiffness = inf\n": "stiffness = inf",
    FORCE.replace('"beam:+x"', '"plank:+x"'): "plank",
    FORCE + FORCE: "2 tables named 'axial'",
    FORCE + "direction = [0, 0, 0]\n": "direction = [0.0, 0.0, 0.0]",
    HEAT.replace("b*", "c*"): 'no body is called "c*"',
}


@pytest.mark.parametrize("loads", REFUSED)
def test_a_load_that_cannot_be_is_refused_in_a_sentence(loads, cantilever, capsys):
    assert beadwave("modes", cantilever(loads), COARSE) == 2
    message = capsys.readouterr().err
    assert REFUSED[loads] in message and "Traceback" not in message and message.count("\n") <= 2


def test_heat_needs_an_expansion_and_loads_need_a_support(cantilever, capsys):
    assert beadwave("modes", cantilever(HEAT, expansion=False), COARSE) == 2
    assert "has no expansion" in capsys.readouterr().err
    assert beadwave("modes", cantilever(FORCE, held="[]"), COARSE) == 2
    assert "loads act on an assembly that floats" in capsys.readouterr().err
    assert beadwave("modes", "rig-rom", '--set=loads=[{name="a",on="b:+x",force=1.0}]') == 2
    assert "[loads] belongs to an assembly of bodies" in capsys.readouterr().err
