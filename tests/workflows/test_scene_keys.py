"""The reference of scene keys: every key of every table, with a meaning and a valid example."""

import importlib.util
import json
import tomllib
from pathlib import Path

import pytest

from beadwave.workflows.files.scene import built_in, scene
from beadwave.workflows.scene import reference
from beadwave.workflows.scene.quantities import entries

from command_line import beadwave

ROOT = Path(__file__).parents[2]
KEYS = {entry.key for entry in reference.scene_keys()}


def keys_of(value, path=()):
    """Dotted keys of what a scene's file holds, its names as NAME and its numbers as N."""
    if isinstance(value, dict):
        for key, below in value.items():
            named = path in {("bodies",), ("materials",)}
            yield from keys_of(below, (*path, "NAME" if named else key))
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        for row in value:
            step = "NAME" if "name" in row else "N"
            yield from keys_of(row, (*path, step))
    else:
        yield ".".join(path)


@pytest.mark.parametrize("name", built_in())
def test_every_key_of_a_built_in_scene_is_in_the_reference(name):
    assert set(keys_of(tomllib.loads(built_in()[name]))) <= KEYS


@pytest.mark.parametrize("name", ["rig-rom", "plate-on-bolts", "beam", "plate", "sensed-beam"])
def test_every_number_of_a_resolved_scene_has_an_entry(name):
    for number in entries(scene(name).written):
        assert reference.entries_of(number.key), number.key


@pytest.mark.parametrize("entry", reference.scene_keys(), ids=lambda entry: entry.key)
def test_an_entry_says_what_its_key_is(entry):
    assert entry.meaning and entry.values and entry.default != "None"
    assert not entry.example.endswith("= required"), "it needs a value in EXAMPLES of reference.py"
    assert tomllib.loads(entry.example).keys() == {entry.key.rpartition(".")[2]}


def test_the_page_has_what_the_tables_say():
    spec = importlib.util.spec_from_file_location("scene_keys", ROOT / "docs" / "scene_keys.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert module.PAGE.read_text("utf-8") == module.page(), "run docs/scene_keys.py"


def test_a_key_is_explained_by_a_name_of_the_user_s_own(capsys):
    assert beadwave("scene", "--key", "bodies.lid.box") == 0
    printed = capsys.readouterr().out
    assert printed.startswith("bodies.NAME.box [m]") and "example" in printed
    assert beadwave("scene", "--key", "wall", "--json") == 0
    rows = json.loads(capsys.readouterr().out)["keys"]
    assert {row["of"] for row in rows if row["key"] == "wall.young"} > {'kind = "1dof"'}


def test_a_key_that_means_the_same_in_both_kinds_of_a_mesh_has_one_entry():
    of = {}
    for entry in reference.scene_keys():
        of.setdefault(entry.key, []).append(entry.of)
    assert of["mesh.seconds"] == [""]
    assert of["mesh.element"] == ["Elements of bodies", "Elements of the thesis' rig"]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("--key", "chian.radius"), "the nearest known is 'chain.radius'"),
        (("--key", "chain.radius.x"), "is no key of a scene"),
        ((), "scene needs a NAME or a --key"),
    ],
)
def test_a_key_that_no_table_has_is_refused_with_the_nearest(arguments, sentence, capsys):
    assert beadwave("scene", *arguments) == 2
    assert sentence in capsys.readouterr().err


def keys_printed(capsys, word):
    assert beadwave("scene", "--key", word, "--json") == 0
    return [entry["key"] for entry in json.loads(capsys.readouterr().out)["keys"]]


def test_a_word_finds_the_keys_that_have_it_then_those_that_contain_it(capsys):
    thickness = keys_printed(capsys, "thickness")
    assert thickness == [
        "beam.thickness", "bodies.NAME.plate.thickness", "plate.thickness",
        "assembly.sheet_thickness", "wall.plate_thickness",
    ]  # fmt: skip
    assert keys_printed(capsys, "held")[0] == "assembly.held"
    assert keys_printed(capsys, "chain.radius") == ["chain.radius"]
    plates = keys_printed(capsys, "plate")
    assert plates[0] == "plate.length" and plates[-1] == "bodies.NAME.plate.thickness"


def test_a_key_is_found_without_the_names_on_its_way(capsys):
    assert keys_printed(capsys, "joints.between") == ["joints.NAME.between"]
    assert keys_printed(capsys, "targets.hz") == ["targets.N.hz"]
    assert keys_printed(capsys, "bodies.plate") == [
        "bodies.NAME.plate.outline", "bodies.NAME.plate.thickness",
    ]  # fmt: skip
    assert "joints.NAME.kx" in keys_printed(capsys, "joints.at-the-foot")


def test_a_word_that_no_key_has_finds_the_keys_that_its_meaning_is_of(capsys):
    grounded = keys_printed(capsys, "ground")
    assert {"assembly.held", "joints.NAME.between"} <= set(grounded) and len(grounded) < 10


@pytest.mark.parametrize(
    ("symbol", "key"),
    [("friction.mu", "friction.coefficient"), ("chain.E", "chain.young")],
)
def test_a_symbol_names_the_key_that_it_stands_for(symbol, key, capsys):
    assert beadwave("scene", "--key", symbol) == 2
    assert f"the nearest known is {key!r}" in capsys.readouterr().err


def test_a_key_like_none_names_the_tables_and_not_hundreds_of_keys(capsys):
    assert beadwave("scene", "--key", "qqq") == 2
    message = capsys.readouterr().err
    assert "`beadwave scene --key TABLE`" in message and len(message) < 500


def test_a_word_that_is_no_key_finds_what_is_about_it_too(capsys):
    screws = keys_printed(capsys, "screw")
    assert screws[0] == "assembly.foot_screw_z" and "assembly.constraint" in screws
    assert keys_printed(capsys, "washers") == ["joints.NAME.washer"]
    assert keys_printed(capsys, "damping of contacts")[0] == "contact.dissipation"
