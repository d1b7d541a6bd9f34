"""[[masses]] of a scene, on a structure that floats: modes, reduction, tuning, and refusals."""

import re
from contextlib import nullcontext

import numpy as np
import pytest

import beadwave
from beadwave.workflows.files.output_file import OutputFile
from beadwave.workflows.files.scene import scene
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.structure.export import write_model

BAR = """
chain = { count = 2, radius = 0.005, density = 7800.0, young = 210e9, poisson = 0.3 }
striker = { velocity = 0.1 }
time = { duration = 1e-4 }
wall = { kind = "rom" }
assembly = { held = [], material = "steel" }
bodies = { bar = { box = [0.3, 0.02, 0.015], seed = 0.05 } }
reduction = { kind = "free-modes", modes = 8, to_hz = 5e3 }
strike = { on = "bar:-x" }
[materials.steel]
young = 210e9
poisson = 0.3
density = 7850.0
[[masses]]
name = "sensor"                # on the far end
on = "bar:+x"
mass = "60 g"
radius = "6 mm"
height = "8 mm"
inertia = [4e-6, 4e-6, 4e-6]
"""
HEAVIER = {"masses.sensor.mass": 0.072, "masses.sensor.inertia": [4.8e-6] * 3}


@pytest.fixture(scope="module", autouse=True)
def folder(module_folder):
    (module_folder / "bar.toml").write_text(BAR)
    return module_folder


def pipeline(changes=()):
    return pipeline_of(scene("bar.toml", dict(changes)), lambda name: nullcontext())


def test_a_reduced_model_has_the_mass_and_the_centre_of_bar_and_sensor():
    mass, sensor = 7850 * 0.3 * 0.02 * 0.015, 0.06
    properties = pipeline()("reduction").mass
    assert properties.mass == pytest.approx(mass + sensor, rel=1e-9)
    x = sensor * 0.158 / (mass + sensor)
    np.testing.assert_allclose(properties.centre, [x, 0, 0], atol=1e-9)


def test_a_reduced_model_of_what_floats_is_free_to_move_with_its_whole_mass():
    """Far below its modes a free body answers a push through its centre as 1 / (m omega^2)."""
    reduced = pipeline()("reduction")
    omega = 2 * np.pi * 5.0
    receptance = reduced.w @ np.linalg.solve(reduced.K - omega**2 * reduced.M, reduced.w)
    # rotations do not take part: push, bar and sensor lie on one axis; elastic part below 1e-4
    assert -receptance * omega**2 == pytest.approx(1 / reduced.mass.mass, rel=1e-4)


def test_another_mass_keeps_the_mesh():
    one, other = pipeline(), pipeline(HEAVIER)
    assert one.key("mesh") == other.key("mesh")
    assert one.key("modes") != other.key("modes")


@pytest.mark.slow
def test_tune_finds_the_mass_of_a_sensor_on_a_structure_that_floats():
    """Targets are the full model's frequencies with 72 g, its elastic modes counted from 1."""
    hz = pipeline(HEAVIER)("modes").omega / (2 * np.pi)
    tuned = beadwave.tune(
        "bar.toml", match={1: float(hz[6]), 2: float(hz[7])}, free=["masses.sensor.mass"]
    )
    (sensor,) = tuned.scene.masses
    assert sensor.mass == pytest.approx(0.072, rel=1e-3)
    assert len(repr(sensor.mass)) <= len("0.0720001")  # as many digits as its deviation supports
    np.testing.assert_allclose(sensor.inertia, 4.8e-6, rtol=1e-3)


REFUSED = {
    "masses has 2 tables named 'a'; give each a name of its own": [{"name": "a"}, {"name": "a"}],
    "a disc of radius 0.005 m at [0.008, 0.0] m from the middle of 'bar:+x' leaves that face; "
    "the face is 0.02 x 0.015 m along y and z, and the nearest place for it is [0.005, 0.0]": [
        {"at": [0.008, 0.0]}
    ],
    "is that of no body": [{"inertia": [1e-6, 1e-6, 3e-6]}],
    "has a radius of gyration of 6.32 m, allowed are 2 m": [{"inertia": [0.4, 0.4, 0.3]}],
    "masses.a.mass = -1.0 must be greater than 0": [{"mass": -1.0}],
}


@pytest.mark.parametrize("sentence", REFUSED)
def test_what_is_no_mass_on_a_face_is_refused_in_a_sentence(sentence):
    usual = {"name": "a", "on": "bar:+x", "mass": 0.01}
    with pytest.raises(InvalidScene, match=re.escape(sentence)):
        pipeline({"masses": [usual | table for table in REFUSED[sentence]]})("model")


def test_masses_without_an_assembly_are_refused():
    masses = {"masses": [{"name": "a", "on": "bar:+x", "mass": 0.01}]}
    with pytest.raises(InvalidScene, match=r"\[\[masses\]\] sit on faces of an \[assembly\]"):
        scene("rig-rigid", {**masses})


def test_an_input_deck_without_the_masses_is_refused(folder):
    deck = OutputFile(folder / "bar.inp", "--inp")
    with pytest.raises(InvalidScene, match=r"\[\[masses\]\] are not written to --inp"):
        write_model(pipeline(), deck, None)


def test_look_lists_what_faces_carry():
    assert re.search(r"sensor +bar:\+x +0\.06", str(beadwave.look("bar.toml")))
    report = beadwave.look("bar.toml", {"masses.sensor.mass": 60.0}).found
    assert re.match(r"sensor of 60 kg is heavier than bar, 0\.\d+ kg", report.remarks[-1])


def test_a_mass_on_a_held_face_is_refused():
    changes = {"assembly.held": ["bar:+x"]}
    with pytest.raises(InvalidScene, match=r"masses\.sensor: on = 'bar:\+x' is held"):
        pipeline(changes)("model")
    pipeline({"assembly.held": ["bar:-y"]})("model")
