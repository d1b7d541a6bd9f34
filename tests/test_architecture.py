"""The rooms, their arrows, and what stays where."""

import ast
import importlib.metadata
import re
import subprocess
import sys
from pathlib import Path

import pytest
from importlinter.cli import lint_imports

import beadwave
from workflows.commands.app import COMMANDS
from workflows.commands.verb import Verb

ROOT = Path(__file__).parents[1]
ROOMS = ("geometry", "fem", "rom", "dem", "coupling", "workflows")


@pytest.mark.parametrize("room", ROOMS)
def test_no_other_distribution_owns_a_room(room):
    owners = importlib.metadata.packages_distributions().get(room, [])
    assert set(owners) <= {"beadwave"}


@pytest.mark.parametrize("room", ROOMS)
def test_every_room_is_typed(room):
    assert (ROOT / room / "py.typed").is_file()


def test_arrows_point_down():
    assert lint_imports(str(ROOT / "pyproject.toml"), no_cache=True) == 0


def test_code_passes_the_linter():
    ruff = subprocess.run(
        [sys.executable, "-m", "ruff", "check", "--no-cache", "."],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert ruff.returncode == 0, ruff.stdout


RIG = r"""["'](block|sheets?|head|foot|support|plate|block:\+x)["']|HAMMER_TEST|STRUCK|\b8425\b"""


@pytest.mark.parametrize("place", ["fem", "rom", "coupling", "workflows/commands"])
def test_no_part_face_or_mode_of_the_rig_is_named_where_any_assembly_passes(place):
    found = [path for path in (ROOT / place).rglob("*.py") if re.search(RIG, path.read_text())]
    assert not found


def crowded(tree):
    """Functions of more than eight arguments, with their number."""
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef):
            given = function.args
            n = len([*given.posonlyargs, *given.args, *given.kwonlyargs])
            if n > 8:
                yield function.name, n


def test_no_function_takes_more_than_eight_arguments():
    """Commands alone may, and the functions of Python's interface whose arguments are theirs: each
    is an option of the command line."""
    paths = [path for room in ROOMS for path in (ROOT / room).rglob("*.py")]
    commands = {
        tuple(command.function.rsplit(".", 1))
        if isinstance(command, Verb)
        else (command.__module__, command.__name__)
        for command in COMMANDS.values()
    }
    commands |= {
        (command.command.__module__, command.command.__name__)
        for command in COMMANDS.values()
        if isinstance(command, Verb)
    }
    commands |= {(module, name) for module, names in beadwave._HOMES.items() for name in names}
    found = {
        (".".join(path.relative_to(ROOT).with_suffix("").parts), name)
        for path in paths
        for name, _ in crowded(ast.parse(path.read_text()))
    }
    assert found <= commands
    assert [*crowded(ast.parse("def f(a, /, b, c, d, e, f, *, g, h, i): pass"))] == [("f", 9)]


def test_tests_are_flat():
    assert not [path for path in (ROOT / "tests").rglob("__init__.py")]
    assert not {path.stem for path in (ROOT / "tests").glob("*.py")} & set(ROOMS)


def test_readme_opens_with_the_two_lines():
    blocks = (ROOT / "README.md").read_text(encoding="utf-8").split("```sh\n")[1:3]
    lines = [block.split("```")[0].strip() for block in blocks]
    assert all("\n" not in line and "./install.sh" in line for line in lines)
    assert "beadwave run" in lines[0]
    assert "pytest" in lines[1]
