"""Commands whose arguments are those of a Python function."""

import subprocess
import sys
from importlib import import_module
from inspect import signature

import pytest

from beadwave.workflows.commands.app import COMMANDS, built
from beadwave.workflows.commands.verb import Verb, described

VERBS = {name: command for name, command in COMMANDS.items() if isinstance(command, Verb)}
INSTEAD = {"sweep": {"on"}}  # --workers and --scheduler
OF_PYTHON = ("Progress", "Planned", "Callable")  # types that nobody types


def function_of(name):
    module, _, attribute = VERBS[name].function.rpartition(".")
    return getattr(import_module(module), attribute)


@pytest.mark.parametrize("name", VERBS)
def test_a_command_has_every_argument_of_its_function_that_can_be_typed(name):
    typed = {
        one.name
        for one in signature(function_of(name)).parameters.values()
        if not one.annotation.startswith(OF_PYTHON)
    }
    assert typed - INSTEAD.get(name, set()) <= {one.name for one in built(name).params}


@pytest.mark.parametrize("name", VERBS)
def test_what_is_not_typed_is_the_default_of_the_function(name):
    defaults = {one.name: one.default for one in signature(function_of(name)).parameters.values()}
    for option in built(name).params:
        if option.name in defaults and not option.required:
            empty = (None, ()) if option.default is None else (option.default,)
            assert defaults[option.name] in empty


@pytest.mark.parametrize("name", VERBS)
def test_help_of_each_argument_is_a_sentence(name):
    for one in built(name).params:
        if one.name != "help":
            assert one.help[0] == one.help[0].upper() and one.help.endswith("."), one.name


def test_a_docstring_tells_its_arguments_by_lines_of_two_columns():
    def chain():
        """Spheres in a row.

        Prose with two words  apart is none of them.

        radius     of a sphere [m],
                   of all alike
        count      how many

        Raises InvalidScene.
        """

    assert described(chain) == {"radius": "of a sphere [m], of all alike", "count": "how many"}


def test_the_list_of_commands_imports_no_function_of_theirs():
    modules = sorted({command.function.rpartition(".")[0] for command in VERBS.values()})
    code = (
        "import sys\nfrom beadwave.workflows.commands.app import app\n"
        "app(['--help'], standalone_mode=False)\n"
        f"assert not set({modules}) & set(sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert all(f"  {name} " in done.stdout for name in COMMANDS)
