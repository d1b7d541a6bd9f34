"""Shakers and the contact across in the reduced model of a scene, and refusals of shakers."""

import re

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from beadwave import fem
from beadwave.coupling.reduced_spatial_wall import spatial_wall_of
from beadwave.workflows.files.scene import scene
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.scene.rules.shakers import of_shakers
from beadwave.workflows.scene.tables.friction import Friction
from beadwave.workflows.scene.tables.shakers import Shaker

from block_scene import BLOCK, SENSED, pipeline

SHAKER = {"name": "shaker", "on": "block:-x", "direction": "y", "frequency": 100.0, "force": 20.0}


@pytest.fixture(scope="module", autouse=True)
def folder(module_folder):
    (module_folder / "block.toml").write_text(BLOCK)
    return module_folder


def with_shakers(*shakers):
    """The block's scene with friction and these shakers."""
    tables = tuple(Shaker(**(SHAKER | shaker)) for shaker in shakers)
    return scene("block.toml", {}).model_copy(
        update={"friction": Friction(coefficient=0.2), "shakers": tables}
    )


def test_a_scene_without_friction_and_shakers_has_no_functionals_beside_its_contact():
    assert pipeline(scene("block.toml", {}))("reduction").columns is None


def test_the_reduced_model_of_a_shaken_scene_has_the_static_response_to_its_words():
    """Patches anew on the mesh: Hertz' weights along n, t1, t2, a plain mean under each shaker."""
    vector = [0.6, 0.0, 0.8]
    shaken = with_shakers(
        {}, {"name": "b", "on": "block:+y", "at": [0.01, -0.005], "direction": "normal"},
        {"name": "c", "direction": vector, "radius": 3e-3},
    )  # fmt: skip
    results = pipeline(shaken)
    model, contact, reduced = (results(name) for name in ("model", "contact", "reduction"))
    assert reduced.columns.load_names == ("shaker", "b", "c")

    # n is -x, t1 is y and t2 = n x t1 is -z
    np.testing.assert_allclose(reduced.columns.axes, [[-1, 0, 0], [0, 1, 0], [0, 0, -1]], atol=1e-9)
    W = [(row @ contact.mean) for row in reduced.columns.axes]
    for face, at, radius, direction in (
        ("shaker-shaker", (0.0, 0.0), 5e-3, [0, 1, 0]),
        ("shaker-b", (0.01, -0.005), 5e-3, [0, 1, 0]),
        ("shaker-c", (0.0, 0.0), 3e-3, vector),
    ):
        patch = fem.contact_patch(model, f"block:{face}", at, radius, weights="area")
        W.append(np.array(direction) @ patch.mean)
    W = model.T.T @ np.column_stack(W)
    exact = W.T @ fem.factorised(model.K).solve(np.asfortranarray(W))
    wall = spatial_wall_of(reduced)
    phi = np.column_stack([wall.phi, wall.load])
    compliance = (phi / wall.omega[:, None] ** 2).T @ phi
    assert np.abs(compliance - exact).max() < 1e-9 * exact.max()

    # the same shaker elsewhere is another reduced model, another force is not
    key = results.key("reduction")
    first = {"name": "b", "on": "block:+y", "at": [0.01, -0.005], "direction": "normal"}
    last = {"name": "c", "direction": vector, "radius": 3e-3}
    assert pipeline(with_shakers({"force": 1.0}, first, last)).key("reduction") == key
    assert pipeline(with_shakers({"direction": "z"}, first, last)).key("reduction") != key


def test_a_shaker_that_leaves_its_face_is_refused():
    wide = with_shakers({"at": [0.023, 0.0]})
    sentence = (
        "shakers.shaker: a disc of radius 0.005 m at [0.023, 0.0] m from the middle of 'block:-x' "
        "leaves that face; the face is 0.05 x 0.04 m along y and z, and the nearest place for it "
        "is [0.02, 0.0]; move it by shakers.shaker.at, or make shakers.shaker.radius smaller."
    )
    with pytest.raises(InvalidScene, match=re.escape(sentence)):
        pipeline(wide)("reduction")


REFUSED = {
    'shakers.shaker.on = "wall" is no face of a structure': {"on": "wall"},
    'shakers.shaker.direction is "up", allowed are "x", "y", "z"': {"direction": "up"},
    "shakers.shaker.direction is missing": {"direction": None},
    "shakers.shaker.direction = [0.0, 0.0, 0.0] has no length": {"direction": (0.0, 0.0, 0.0)},
    "shakers.shaker has no amplitude": {"force": None},
    "moves a structure without a stinger": {"force": None, "displacement": 1e-5},
    "stands between a motion and the face": {"stinger": 1e6},
    "velocity and force, which exclude each other": {"velocity": 0.1},
}


@pytest.mark.parametrize("sentence", REFUSED)
def test_what_does_not_shake_a_structure_is_refused_in_a_sentence(sentence):
    sentences = list(of_shakers(with_shakers(REFUSED[sentence])))
    assert sentence in sentences[0]


def test_shakers_of_a_structure_by_force_or_by_a_stinger_are_allowed():
    moved = {"name": "moved", "force": None, "displacement": 1e-5, "stinger": 2e6}
    shaken = with_shakers({}, moved)
    assert not list(of_shakers(shaken))
    assert [shaker.force_amplitude for shaker in shaken.shakers] == [20.0, pytest.approx(20.0)]


def test_a_shaker_of_a_file_is_called_by_its_name_alone():
    placed = with_shakers({"on": "wall"})
    of_file = placed.wall.model_copy(update={"file": "rom.npz"})
    (sentence,) = of_shakers(placed.model_copy(update={"wall": of_file}))
    assert "shakers.shaker.direction is stated by wall.file" in sentence
    named = with_shakers({"on": "wall", "direction": None})
    assert not list(of_shakers(named.model_copy(update={"wall": of_file})))


def test_sensors_on_the_structure_show_what_the_full_model_does():
    """Newmark's average acceleration on all unknowns, driven by the contact force of the run."""
    changes = [
        "preload.force=0", "time.duration=4e-4", SENSED, "output.samples=801", "chain.count=1",
        "chain.radius=0.02", "reduction.to_hz=25e3",
    ]  # fmt: skip
    results = pipeline(scene("block.toml", changes))
    record, run = results("record"), results("impact").trajectory
    model = results("model")
    h = run.t[1] - run.t[0]
    columns = []
    for face, at, radius, direction in (
        ("sensor-1", (0.0, 0.0), 5e-3, [0, 1, 0]),
        ("sensor-2", (-0.015, 0.0), 3e-3, [1, 0, 0]),
        ("sensor-3", (0.0, 0.0), 5e-3, [1, 0, 0]),
    ):
        patch = fem.contact_patch(model, f"block:{face}", at, radius, weights="area")
        columns.append(model.T.T @ (np.array(direction) @ patch.mean))
    W, w = np.array(columns), results("contact").w

    # M a + K u = w F, u and v by averages of a over a step
    factor = fem.factorised((model.M + h**2 / 4 * model.K).tocsc())
    u, v, a = np.zeros((3, len(w)))
    read = np.zeros((len(run.t), 3, 3))
    for i, force in enumerate(run.contact_force[1:, -1], start=1):
        u, v = u + h * v + h**2 / 4 * a, v + h / 2 * a
        a = factor.solve(w * force - model.K @ u)
        u, v = u + h**2 / 4 * a, v + h / 2 * a
        read[i] = W @ np.column_stack([u, v, a])
    expected = [read[:, 0, 2], 2.0 * read[:, 1, 1], read[:, 2, 0]]
    # behind the low pass at half of 25 kHz; measured 3e-2, 1e-3 and 4e-4
    sos = butter(4, 12.5e3, fs=1 / h, output="sos")
    for y, exact, allowed in zip(record.y.T, expected, (0.06, 3e-3, 1e-3), strict=False):
        exact = sosfilt(sos, exact)
        assert np.abs(y - exact[::2]).max() < allowed * np.abs(exact).max()
    assert record.waves[:3] == ((), (), ())


@pytest.mark.slow
def test_the_record_of_a_sensor_on_the_structure_names_its_place():
    results = pipeline(scene("block.toml", [SENSED, "damping.kind=modal", "damping.ratio=0.01"]))
    numbers = results("sensor-numbers")
    assert [(name, numbers[name].unit) for name in numbers] == [
        ("acceleration block:+y y", "m/s^2"),
        ("velocity block:+x at -0.015 0 normal", "V"),
        ("displacement block:+z along 1 0 0", "m"),
        ("force 1", "N"),
    ]
    head = results("chain-files")["signals.csv"].decode().splitlines()[1]
    assert "acceleration block:+y y [m/s^2]" in head and "sphere 1 force [N]" in head


UNSENSED = {
    "give one of sphere and on": {"quantity": "velocity"},
    "allowed of a sphere are force": {"sphere": 1, "quantity": "acceleration"},
    "allowed of a face are acceleration": {"on": "block:+y", "direction": "y"},
    "output.sensors.1.at is of a sensor on a face": {"sphere": 1, "at": [0.0, 0.0]},
    "output.sensors.1.direction is missing": {"on": "block:+y", "quantity": "velocity"},
    'direction is "up"': {"on": "block:+y", "quantity": "velocity", "direction": "up"},
    "has no length": {"on": "block:+y", "quantity": "velocity", "direction": [0.0, 0.0, 0.0]},
    "high_pass = 12000 Hz must be below the low pass of a sensor on a face, 2500 Hz": {
        "on": "block:+y",
        "quantity": "velocity",
        "direction": "y",
        "high_pass": 12e3,
    },
    'on = "block" is no face': {"on": "block", "quantity": "velocity", "direction": "y"},
}


@pytest.mark.parametrize("sentence", UNSENSED)
def test_what_reads_no_structure_is_refused_in_a_sentence(sentence):
    with pytest.raises(InvalidScene, match=re.escape(sentence)):
        scene("block.toml", {"output.sensors": [UNSENSED[sentence]]})


def test_a_sensor_on_a_face_of_a_wall_without_one_is_refused():
    sensor = {"on": "block:+y", "quantity": "velocity", "direction": "y"}
    with pytest.raises(InvalidScene, match="a face of an assembly, which this wall does not have"):
        scene("rig-rigid", {"output.sensors": [sensor]})
