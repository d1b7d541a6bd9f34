"""The rooms, their arrows, and what stays where."""

import ast
import importlib.util
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest
from importlinter.cli import lint_imports

import beadwave
from beadwave.workflows.commands.app import COMMANDS
from beadwave.workflows.commands.verb import Verb

import other_system

ROOT = Path(__file__).parents[1]
ROOMS = ("geometry", "fem", "rom", "dem", "coupling", "workflows")


@pytest.mark.parametrize("room", ROOMS)
def test_no_room_is_imported_by_its_bare_name(room, tmp_path):
    """`python -m pytest` puts the checkout on the path, where `import fem` makes a second object of
    each module; elsewhere there is no such name."""
    code = f"from importlib.util import find_spec; print(find_spec({room!r}))"
    done = subprocess.run(
        [sys.executable, "-P", "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "None"
    bare = tmp_path / "bare.py"
    bare.write_text(f"import {room}\nfrom {room} import thing\nprint({room}, thing)\n")
    command = [sys.executable, "-m", "ruff", "check", "--no-cache", "--config", "pyproject.toml"]
    found = subprocess.run([*command, str(bare)], cwd=ROOT, capture_output=True, text=True)
    assert found.stdout.count("TID251") == 2
    assert not sys.modules.keys() & set(ROOMS)


SYSTEM = "src/beadwave/system.py"
SOURCES = [path for room in (*ROOMS, "src") for path in (ROOT / room).rglob("*.py")]


@cache
def parsed(path):
    return ast.parse(path.read_text("utf-8"))


@pytest.fixture(scope="module", autouse=True)
def trees_are_kept_for_this_file():
    yield
    parsed.cache_clear()


def of_one_system(tree):
    """Names of modules, functions and signals, and paths, that not every system has."""
    for node in ast.walk(tree):
        words = []
        if isinstance(node, ast.Import):
            words = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            words = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            words = [f"{node.value.id}.{node.attr}"]
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield from re.findall(r"^/(?:proc|sys|dev|etc|tmp)\b", node.value)
        if isinstance(node, ast.Attribute) and node.attr in ("symlink_to", "hardlink_to"):
            yield node.attr
        for word in words:
            module, _, name = word.rpartition(".")
            hidden = other_system.HIDDEN.get(module)
            if word in other_system.MODULES or (hidden and re.fullmatch(hidden, name)):
                yield word


def test_what_one_system_alone_has_is_in_one_module():
    assert {*of_one_system(ast.parse((ROOT / SYSTEM).read_text("utf-8")))} > {"resource"}
    found = {
        str(path.relative_to(ROOT)): names
        for path in SOURCES
        if (names := [*of_one_system(parsed(path))])
    }
    assert found.keys() == {SYSTEM}, found


def test_each_way_to_name_what_one_system_has_is_seen():
    sources = (
        "import fcntl", "from resource import getrlimit", "import os\nos.fork()",
        "from signal import SIGHUP", "from signal import SIGALRM as late", "open('/proc/meminfo')",
        "path.symlink_to(other)",
    )  # fmt: skip
    assert all([*of_one_system(ast.parse(source))] for source in sources)
    assert not [*of_one_system(ast.parse("from signal import SIGINT\nfrom os import path"))]


def without_encoding(tree):
    """Lines that read or write text in the encoding, or write it with the line ends, of the system
    that they run on."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        given = {word.arg: word.value for word in node.keywords}
        function = node.func
        name = function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")
        if name in ("read_text", "write_text"):
            known = "encoding" in given or len(node.args) > (name == "write_text")
            if not known or (name == "write_text" and "newline" not in given):
                yield ast.unparse(node)
        elif name == "open":
            # the mode comes first at a path, second at the function
            mode = node.args[:1] if isinstance(function, ast.Attribute) else node.args[1:2]
            words = ast.literal_eval(mode[0]) if mode and isinstance(mode[0], ast.Constant) else "r"
            if (mode and not isinstance(mode[0], ast.Constant)) or "b" in words:
                continue  # of pictures and archives, or bytes
            if "encoding" not in given or ({*words} & {*"wax"} and "newline" not in given):
                yield ast.unparse(node)
        elif "text" in given or "universal_newlines" in given:
            yield ast.unparse(node)


def test_text_has_an_encoding_and_ends_of_lines_of_no_system():
    found = {
        str(path.relative_to(ROOT)): calls
        for path in SOURCES
        if (calls := [*without_encoding(parsed(path))])
    }
    assert not found


@pytest.mark.parametrize(
    ("source", "n"),
    [
        ("a.read_text()", 1), ("a.read_text('utf-8')", 0), ("a.write_text('b')", 1),
        ("a.write_text('b', encoding='utf-8')", 1), ("run(a, text=True)", 1),
        ("a.write_text('b', encoding='utf-8', newline='')", 0), ("open(a)", 1),
        ("open(a, 'rb')", 0), ("a.open('a', encoding='utf-8')", 1), ("a.open()", 1),
        ("open(a, encoding='utf-8')", 0), ("Image.open(path)", 0),
    ],
)  # fmt: skip
def test_text_of_the_system_is_seen(source, n):
    assert len([*without_encoding(ast.parse(source))]) == n


def test_arrows_point_down():
    assert lint_imports(str(ROOT / "pyproject.toml"), no_cache=True) == 0


def files_read_off_a_room(tree):
    """(room, file) of each `room.file` behind `from beadwave import room`."""
    rooms = {
        alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module == "beadwave"
        for alias in node.names
    } & {*ROOMS}
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and getattr(node.value, "id", "") in rooms:
            room = ROOT / node.value.id
            if (room / f"{node.attr}.py").exists() or (room / node.attr).is_dir():
                yield f"{node.value.id}.{node.attr}"


def test_a_file_read_off_its_room_is_loaded_with_the_room():
    """`coupling.reduced_wall.wall_of` works only after somebody has imported that file: on its own
    a group of `verify` failed so. The rooms are asked in a process that has loaded nothing else."""
    read = {}
    others = (path for folder in ("examples", "benchmarks", "tests")
              for path in (ROOT / folder).rglob("*.py"))  # fmt: skip
    for path in [*SOURCES, *others]:
        for name in files_read_off_a_room(parsed(path)):
            read.setdefault(name, []).append(str(path.relative_to(ROOT)))
    code = (
        "import sys\nfrom beadwave import geometry, fem, rom, dem, coupling, workflows\n"
        f"print(*(name for name in {[*read]} if 'beadwave.' + name not in sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {name: read[name] for name in done.stdout.split()}
    assert "dem.spheres" in read
    alone = "from beadwave import coupling\ncoupling.reduced_wall.wall_of(0)"
    assert [*files_read_off_a_room(ast.parse(alone))] == ["coupling.reduced_wall"]


def test_code_passes_the_linter():
    ruff = subprocess.run(
        [sys.executable, "-m", "ruff", "check", "--no-cache", "."],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert ruff.returncode == 0, ruff.stdout


def imports(module, path, modules):
    """Other modules of `modules` that a file imports, in functions and under TYPE_CHECKING too."""
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    imported = set()
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.Import):
            imported |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            levels_up = "." * node.level + (node.module or "")
            base = importlib.util.resolve_name(levels_up, package) if node.level else node.module
            for alias in node.names:
                inner = f"{base}.{alias.name}"
                imported.add(inner if inner in modules else base)
    return imported & modules.keys() - {module}


def circles(arrows):
    """Sets of modules that import each other, directly or through further ones (R. E. Tarjan, SIAM
    J. Comput. 1 (1972) 146)."""
    order, lowest, path, groups = {}, {}, [], []

    def visit(module):
        order[module] = lowest[module] = len(order)
        path.append(module)
        for other in sorted(arrows[module]):
            if other not in order:
                visit(other)
            if other in path:
                lowest[module] = min(lowest[module], lowest[other])
        if lowest[module] == order[module]:
            group = path[path.index(module) :]
            del path[path.index(module) :]
            if len(group) > 1:
                groups.append(set(group))

    for module in arrows:
        if module not in order:
            visit(module)
    return groups


def test_no_files_import_each_other_in_a_circle():
    modules = {}
    for path in (path for room in ROOMS for path in (ROOT / room).rglob("*.py")):
        parts = ("beadwave", *path.relative_to(ROOT).with_suffix("").parts)
        modules[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    arrows = {module: imports(module, path, modules) for module, path in modules.items()}
    # the arrows are those of the code, not of an empty list
    assert "beadwave.rom" in arrows["beadwave.coupling.reduced_wall"]
    remaining = circles(arrows)
    assert not remaining, "\n".join(
        f"{module} -> {', '.join(sorted(arrows[module] & circle))}"
        for circle in remaining
        for module in sorted(circle)
    )


def test_circles_through_further_files_and_type_checking_are_seen(tmp_path):
    """a -> b -> c -> a, where each arrow is written another way, and d, which is in no circle."""
    sources = {
        "room.a": "def run():\n    from room import b\n",
        "room.b": "if TYPE_CHECKING:\n    from room.c import Thing\n",
        "room.c": "from . import a\nimport room.d\n",
        "room.d": "import numpy\n",
    }
    modules = {}
    for module, source in sources.items():
        modules[module] = tmp_path / f"{module}.py"
        modules[module].write_text(source)
    arrows = {module: imports(module, path, modules) for module, path in modules.items()}
    assert circles(arrows) == [{"room.a", "room.b", "room.c"}]
    assert circles(arrows | {"room.c": {"room.d"}}) == []


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
        (".".join(("beadwave", *path.relative_to(ROOT).with_suffix("").parts)), name)
        for path in paths
        for name, _ in crowded(parsed(path))
    }
    assert found <= commands
    assert [*crowded(ast.parse("def f(a, /, b, c, d, e, f, *, g, h, i): pass"))] == [("f", 9)]


def test_tests_are_no_packages():
    """Of a package pytest would put the parent on the path, where `tests/fem` is called `fem`."""
    assert not [path for path in (ROOT / "tests").rglob("__init__.py")]


def test_readme_opens_with_the_two_lines():
    blocks = (ROOT / "README.md").read_text(encoding="utf-8").split("```sh\n")[1:3]
    lines = [block.split("```")[0].strip() for block in blocks]
    assert all("\n" not in line and "./install.sh" in line for line in lines)
    assert "beadwave run" in lines[0]
    assert "pytest" in lines[1]


def test_files_and_names_of_the_recipes_are_there():
    """Those that CONTRIBUTING.md has in code; a bare name of a file may be in any folder."""
    folders = (*ROOMS, "src", "docs", "tests", "examples", "benchmarks")
    paths = [path for folder in folders for path in (ROOT / folder).rglob("*")]
    files = "\n".join(f"/{path.relative_to(ROOT)}{'/' * path.is_dir()}" for path in paths)
    code = [path for path in paths if path.suffix in (".py", ".js")]
    names = {name for path in code for name in re.findall(r"\w+", path.read_text("utf-8"))}

    quoted = re.findall(r"`([^`\n]+)`", (ROOT / "CONTRIBUTING.md").read_text("utf-8"))
    of_file = r"[\w/-]+(/|\.(py|js|md|toml|jinja|sh|html\.jinja))"
    named_files = {word for word in quoted if re.fullmatch(of_file, word)}
    named = {word for word in quoted if re.fullmatch(r"[A-Za-z]\w*", word)}
    there = {*(path.name for path in ROOT.iterdir())}
    missing = {word for word in named_files - there if f"/{word}" not in files}
    missing |= named - names
    assert not missing
    assert len(named_files) > 40 and len(named) > 5
