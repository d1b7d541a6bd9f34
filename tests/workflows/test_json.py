"""`--json`: every command prints JSON and nothing else on stdout."""

import json
import sys

import pytest

from beadwave.workflows.commands.app import COMMANDS, built, main
from beadwave.workflows.files.scene import built_in, scene_text, tables

COARSE = ("mesh.seed=0.02", "mesh.block_seed=0.05", "mesh.support_seed=0.1",
          "mesh.contact_seed=0.03", "reduction.modes=8",
          'assembly.parts=["block","sheets"]')  # fmt: skip
MODEL = [f"--set={change}" for change in COARSE]
SHORT = ["--set=chain.count=4", "--set=output.spheres=[1]", "--set=time.duration=0.2 ms"]
PRINTED = {
    "scenes": ["scenes"],
    "scene": ["scene", "rig-rom"],
    "impact": ["impact", "rig-rigid", *SHORT],
    "run": ["run", "rig-rigid", "--out=out", *SHORT],
    "report": ["report", "out"],
    "modes": ["modes", *MODEL],
    "modes --inp --step": ["modes", "--inp=model.inp", "--step=model.step", *MODEL],
    "reduce": ["reduce", "--out=rom.npz", *MODEL],
    "hammer --synthetic": ["hammer", "test.uff", "--synthetic", *MODEL],
    "hammer": ["hammer", "test.uff"],
}
FILES = {
    "report": ["out/report.html"],
    "modes --inp --step": ["model.inp", "model.step"],
    "reduce": ["rom.npz"],
    "hammer --synthetic": ["test.uff"],
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("json")


@pytest.fixture(autouse=True)
def here(folder, monkeypatch):
    monkeypatch.setenv("BEADWAVE_CACHE_DIR", str(folder / "cache"))
    monkeypatch.chdir(folder)


@pytest.mark.parametrize("name", PRINTED)  # in this order: a report is of the run before it
def test_a_command_prints_json_and_nothing_else(name, monkeypatch, capfd, folder):
    monkeypatch.setattr(sys, "argv", ["beadwave", *PRINTED[name], "--json"])
    with pytest.raises(SystemExit) as end:
        main()
    assert not end.value.code
    printed = json.loads(capfd.readouterr().out, parse_constant=pytest.fail)
    assert isinstance(printed, dict) and printed
    if name in FILES:
        assert printed == {"written": FILES[name]}
        assert all((folder / file).is_file() for file in FILES[name])


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_the_option_and_its_help_says_what_is_printed(command):
    option = next(one for one in built(command).params if one.name == "json")
    assert option.help.startswith("Print JSON: ")


@pytest.mark.parametrize("name", built_in())
def test_a_scene_as_json_holds_the_tables_of_its_toml(name):
    import tomllib

    written = json.dumps(tomllib.loads(scene_text(name).text)).replace("Infinity", '"inf"')
    assert json.loads(json.dumps(tables(name))) == json.loads(written)


def test_json_of_a_scene_knows_no_infinite_number(tmp_path):
    path = tmp_path / "odd.toml"
    path.write_text(scene_text("rig-rom").text + "\n[joints.foot]\nkx = inf\n")
    assert tables(str(path))["joints"]["foot"] == {"kx": "inf"}
