"""Former import paths, the rooms as `beadwave.fem`, and files of a user that hide a package."""

import subprocess
import sys
from os import environ
from pathlib import Path

import pytest

import dem
import fem
import rom
from workflows.aliases import MOVED_MODULES, MOVED_PACKAGES, RENAMED_CLASSES, present_path

ROOT = Path(__file__).parents[1]


def run_there(command: list[str], folder: Path) -> subprocess.CompletedProcess:
    """A command in a folder of the user, whose modules Python finds: commands that ran in this
    process before have told their children to leave it out."""
    env = {name: value for name, value in environ.items() if name != "PYTHONSAFEPATH"}
    return subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True)


def python(code: str, folder: Path, *options: str) -> subprocess.CompletedProcess:
    """What a user's script prints that stands in a folder of hers."""
    script = folder / "script.py"
    script.write_text(code)
    return run_there([sys.executable, *options, str(script)], folder)


@pytest.mark.parametrize("former", [*MOVED_MODULES, *MOVED_PACKAGES])
def test_every_former_path_leads_to_a_file(former):
    path = ROOT.joinpath(*present_path(former).split("."))
    assert path.with_suffix(".py").is_file() or (path / "__init__.py").is_file()


@pytest.mark.parametrize("room", [dem, fem, rom])
def test_former_names_of_a_room_give_those_of_today_with_a_warning(room):
    for former, name in RENAMED_CLASSES[room.__name__].items():
        with pytest.warns(DeprecationWarning, match=f"{room.__name__}.{former} is .*{name} now"):
            assert getattr(room, former) is getattr(room, name)
    with pytest.raises(AttributeError, match="no attribute 'Serch'"):
        _ = room.Serch


@pytest.mark.parametrize("lines", ["import dem\nimport beadwave", "import beadwave\nimport dem"])
def test_former_names_are_there_in_either_order_of_imports(tmp_path, lines):
    """A package that was loaded before the finder gets them as well."""
    code = "\nfrom dem import Search\nassert Search is dem.StepSearch\nprint(dem.__name__)"
    run = python(lines + code, tmp_path, "-W", "always::DeprecationWarning")
    assert run.stdout == "dem\n", run.stderr
    assert "dem.Search is dem.StepSearch now" in run.stderr


def test_modules_that_stay_have_no_other_path():
    assert present_path("coupling.march") is None
    assert present_path("coupling.sweeping") is None


def test_a_former_path_gives_the_same_module_and_names_the_new_one(tmp_path):
    run = python(
        "import beadwave\n"
        "from coupling.inspection import inversion as before\n"
        "from coupling.parametric_wall import ParametricWall\n"
        "from workflows.fit import inversion as today\n"
        "from workflows.fit import parametric_wall\n"
        "assert before is today and ParametricWall is parametric_wall.ParametricWall\n"
        "path = 'workflows.fit.inversion'\n"
        "assert today.__spec__.name == today.__name__ == path\n",
        tmp_path, "-W", "always::DeprecationWarning",
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    assert "coupling.parametric_wall is workflows.fit.parametric_wall now." in run.stderr


def test_the_rooms_are_there_as_parts_of_beadwave_and_are_the_same_modules(tmp_path):
    run = python(
        "import beadwave.dem.kernels\n"
        "import beadwave, dem\n"
        "from beadwave.fem import joints\n"
        "import fem.joints\n"
        "assert beadwave.dem is dem and joints is fem.joints and beadwave.rom.__name__ == 'rom'\n",
        tmp_path, "-W", "error::DeprecationWarning",
    )  # fmt: skip
    assert run.returncode == 0, run.stderr


HIDING = ["fem.py", "dem/__init__.py", "coupling/thing.py", "workflows.py"]


@pytest.mark.parametrize("name", HIDING)
@pytest.mark.parametrize("use", ["beadwave.impact('rig-rigid')", "beadwave.fem.joints"])
def test_a_file_of_the_user_that_hides_a_package_is_named(name, use, tmp_path):
    theirs = tmp_path / name
    theirs.parent.mkdir(exist_ok=True)
    theirs.write_text("x = 1\n")
    run = python(f"import beadwave\n{use}\n", tmp_path)
    if name == "coupling/thing.py":  # a folder without __init__.py hides nothing
        assert run.returncode == 0 or ("AttributeError" in run.stderr and "joints" in use)
        return
    *_, last = run.stderr.strip().splitlines()
    assert last.startswith("ImportError: ")
    assert str(tmp_path / name.split("/")[0]) in last
    assert "rename" in last


def test_an_import_from_beadwave_names_the_hiding_file_too(tmp_path):
    (tmp_path / "rom.py").write_text("")
    run = python("from beadwave import modes\n", tmp_path)
    assert str(tmp_path / "rom.py") in run.stderr.strip().splitlines()[-1]


def test_a_module_of_the_user_that_was_imported_before_is_named(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "dem.py").write_text("")
    run = python(
        "import sys\nsys.path.insert(0, 'elsewhere')\nimport dem\nsys.path.pop(0)\n"
        "import beadwave\nbeadwave.impact('rig-rigid')\n",
        tmp_path,
    )
    assert "dem.py" in run.stderr.strip().splitlines()[-1]
    assert "ImportError" in run.stderr


def test_the_command_names_a_hiding_file_with_status_2(tmp_path):
    (tmp_path / "rom.py").write_text("")
    command = [sys.executable, "-c", "import beadwave; beadwave.main()", "scenes"]
    run = run_there(command, tmp_path)
    assert run.returncode == 2
    assert run.stderr.count("\n") == 1 and str(tmp_path / "rom.py") in run.stderr


def test_a_folder_of_other_files_hides_nothing(tmp_path):
    (tmp_path / "fem").mkdir()
    (tmp_path / "fem" / "notes.txt").write_text("mine")
    (tmp_path / "geometry.txt").write_text("mine")
    run = python(
        "import beadwave\nassert beadwave.scene('rig-rigid').name == 'rig-rigid'", tmp_path
    )
    assert run.returncode == 0, run.stderr
