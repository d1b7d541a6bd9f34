"""Arguments of the Python functions and words of the command line: refused in one sentence."""

import inspect
import os
import subprocess
import sys
import traceback
from pathlib import Path

import numpy as np
import pytest

import beadwave

import command_line

FUNCTIONS = {
    name: function
    for name in beadwave.__all__
    if inspect.isfunction(function := getattr(beadwave, name))
}
ARGUMENTS = [
    (name, argument) for name, function in FUNCTIONS.items()
    for argument in inspect.signature(function).parameters
]  # fmt: skip
# no argument takes an object or a set of texts; what takes one of the others is in REFUSES
NEVER = (object(), {"a", 3}, b"bytes", 1j)
# a value that the types named in an annotation do not take, by a word that it must not have
REFUSES = (
    ("yes", "str"),
    (float("nan"), "never"),
    (2.5, "float"),
    ([None], "never"),
    (None, "None"),
    (7, "int"),
    ({}, "Source|Mapping|Changes"),
)


def refused(hint, value, words):
    if isinstance(value, int) and not isinstance(value, bool) and "float" in hint:
        return False  # an integer is a number
    if "Source" in hint or "Changes" in hint:  # texts, dicts and None
        return isinstance(value, float | int | list)
    if "Callable" in hint or "Progress" in hint:
        return True
    if "Array" in hint or isinstance(value, dict):
        return False
    return not any(word in hint for word in words.split("|"))


def call_of(name, argument, value):
    """The arguments of a call with one wrong value, the others of any fitting type."""
    given = {
        parameter.name: "x"
        for parameter in inspect.signature(FUNCTIONS[name]).parameters.values()
        if parameter.default is parameter.empty and parameter.name != argument
    }
    if name == "reduce_matrices":
        given = {key: np.eye(2) for key in given}
    if name == "design_hammer_test" and argument != "points":
        given["points"] = 3
    return given | {argument: value}


@pytest.mark.parametrize(("name", "argument"), ARGUMENTS)
def test_a_value_of_a_wrong_type_is_refused_in_one_sentence_at_the_call(name, argument):
    hint = inspect.signature(FUNCTIONS[name]).parameters[argument].annotation
    values = [*NEVER, *(value for value, words in REFUSES if refused(hint, value, words))]
    assert len(values) >= 4
    for value in values:
        if "bool" in hint and value is True:
            continue
        with pytest.raises(beadwave.InvalidScene) as caught:
            FUNCTIONS[name](**call_of(name, argument, value))
        message = str(caught.value)
        assert message.startswith(f"{name}: {argument} = ") and " must be " in message
        assert message.endswith(".") and "\n" not in message and len(message) < 300
        # raised by the check, not from inside of the function
        frames = traceback.extract_tb(caught.value.__traceback__)
        assert len(frames) == 2 and Path(frames[-1].filename).stem == "arguments"


@pytest.mark.parametrize("name", FUNCTIONS)
def test_an_unknown_argument_is_named_with_its_function_and_the_nearest(name):
    with pytest.raises(TypeError, match=f"{name}: .*'ovrwrite'"):
        FUNCTIONS[name](ovrwrite=True)


def test_numbers_and_paths_of_numpy_and_pathlib_are_taken(own_folder):
    changes = {"striker.velocity": np.float64(0.4), "chain.count": np.int64(4)}
    small = changes | {"output.spheres": [1], "time.duration": 5e-4}
    run = beadwave.impact("rig-rigid", small, out=Path("run"), overwrite=np.bool_(False))
    assert run.summary.peak_wall_force_N > 0.0


def test_a_small_model_is_reduced_to_all_of_its_modes():
    reduced = beadwave.reduce_matrices([[2.0, -1.0], [-1.0, 2.0]], np.eye(2), [0.0, 1.0])
    assert reduced.K.shape[0] == 2


CYCLE: list = []
CYCLE.append(CYCLE)
LONG = "é" * 300


@pytest.mark.parametrize(
    "changes",
    [{"striker.velocity": CYCLE}, {"striker": {"velocity": CYCLE}}, [("striker.velocity", CYCLE)]],
)
def test_endless_values_of_changes_are_refused(changes):
    with pytest.raises(beadwave.InvalidScene, match="more than 20 levels"):
        beadwave.scene("rig-1dof", changes)


@pytest.mark.parametrize("name", [LONG, "\ud800", "a\0b"])
def test_what_is_no_name_of_a_file_is_refused_wherever_it_stands(own_folder, name):
    wall = {"wall": {"kind": "rom", "file": name}}
    for call in (
        lambda: beadwave.scene(name),
        lambda: beadwave.load(name),
        lambda: beadwave.impact("rig-1dof", out=name),
        lambda: beadwave.impact("rig-1dof", rom=name),
        lambda: beadwave.scene("rig-1dof", wall),
    ):
        with pytest.raises(beadwave.InvalidScene) as caught:
            call()
        assert len(str(caught.value)) < 300


def test_a_mesh_in_place_of_a_scene_is_answered_by_the_key_that_names_it(own_folder):
    Path("part.msh").write_text("$MeshFormat\n")
    with pytest.raises(beadwave.InvalidScene, match=r'mesh = "part\.msh"'):
        beadwave.look("part.msh")


def command(*words, cwd=None, **environment):
    return subprocess.run(
        [sys.executable, "-m", "beadwave", *words], capture_output=True, text=True, cwd=cwd,
        env=os.environ | environment, check=False,
    )  # fmt: skip


@pytest.mark.parametrize(
    "words",
    [
        ("--set", "a." * 3000 + "b=1"),
        ("--set", "x" * 15_000 + "=1"),
        ("--set", "wall.kind=" + "x" * 15_000),
        ("--set", 'chain.radius="' + "5" * 15_000 + '"'),
        ("--set", f"chain.radius={[0.1] * 5000}"),
        ("--set", "chain.radius=" + "[" * 50 + "1" + "]" * 50),
    ],
)
def test_long_and_deep_words_are_refused_in_a_short_sentence(words, own_folder, capfd):
    assert command_line.beadwave("impact", "rig-1dof", *words) == 2
    stderr = capfd.readouterr().err
    assert stderr.startswith("beadwave: ") and len(stderr) < 700
    assert "Traceback" not in stderr and "Error" not in stderr


@pytest.mark.parametrize(
    "text",
    ["a." * 5000 + "a = 1", "a." * 100_000 + "a = 1", "[" + "a." * 500 + "a]\nb = 1",
     "a = " + "[" * 60 + "]" * 60, "a = " + "{b = " * 60 + "1" + "}" * 60],
)  # fmt: skip
def test_deep_toml_is_refused_in_a_sentence(own_folder, text):
    Path("deep.toml").write_text(text)
    with pytest.raises(beadwave.InvalidScene, match=r"deep\.toml.* more than 20 "):
        beadwave.scene("deep.toml")


def test_a_scene_of_many_numbers_is_not_deep(own_folder):
    radius = [0.01 + 1e-5 * i for i in range(200)]
    Path("long.toml").write_text(
        f"# a.b.c of a chain, 1.2.3\n[chain]\ncount = 200\nradius = {radius}\n"
        "density = 7800.0\nyoung = 210e9\npoisson = 0.3\n[striker]\nvelocity = 0.1\n"
    )
    assert beadwave.scene("long.toml").chain.count == 200


def test_toml_in_place_of_its_file_is_refused(own_folder):
    with pytest.raises(beadwave.InvalidScene, match="too long for the name of a file"):
        beadwave.scene("[chain]\n" + "count = 8\n" * 1000)


@pytest.mark.parametrize("radius", [1e-12, "1e-12 m", "0.9 um"])
def test_a_patch_far_smaller_than_a_contact_is_refused(radius):
    """Elements as small filled the memory of the machine."""
    with pytest.raises(beadwave.InvalidScene, match=r"strike\.radius"):
        beadwave.scene("cantilever", {"strike.radius": radius})


def test_the_results_are_printed_on_a_terminal_without_signs_beyond_ascii(own_folder):
    small = ("--set", "chain.count=4", "--set", "output.spheres=[1]")
    done = command("impact", "rig-rigid", *small, PYTHONIOENCODING="ascii")
    assert done.returncode == 0 and "codec" not in done.stderr
    assert "peak force at the wall" in done.stdout


@pytest.mark.skipif(sys.platform == "win32", reason="Windows keeps a folder that is in use")
def test_a_removed_working_folder_is_named(tmp_path):
    folder = tmp_path / "gone"
    folder.mkdir()
    script = f"cd '{folder}' && rmdir '{folder}' && '{sys.executable}' -m beadwave impact rig-1dof"
    done = subprocess.run(
        ["sh", "-c", script], capture_output=True, text=True, check=False
    )  # fmt: skip
    assert done.returncode == 2 and "the current folder has been removed" in done.stderr


def test_warnings_of_libraries_do_not_reach_the_terminal(own_folder, monkeypatch):
    code = (
        "import sys, warnings; sys.argv = ['beadwave', 'scenes']\n"
        "from beadwave.workflows.commands import app\n"
        "status = app._status\n"
        "app._status = lambda c: (warnings.warn('of a library'), status(c))[1]\n"
        "app.main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )  # fmt: skip
    assert done.returncode == 0 and done.stderr == ""
