"""The sources of a stage: every module that it reaches, and nothing imported to find them."""

import os
import subprocess
import sys
from pathlib import Path
from shutil import copytree

import grimp
import pytest

import beadwave
from beadwave.workflows.stages import sources
from beadwave.workflows.stages.pipeline import ASSEMBLY

PACKAGE = Path(beadwave.__file__).parent
EDIT = """
import sys
from pathlib import Path
from beadwave.workflows.stages import sources
assert Path(sources.__file__).is_relative_to(Path.cwd()), sources.__file__

def digest(module):
    for cached in (sources.fingerprint, sources.digest, sources.imported):
        cached.cache_clear()
    return sources.fingerprint(module)

for module in sys.argv[1:]:
    before = digest(module)
    for reached in sources.modules(module):
        file = sources.files(reached)[0]
        text = file.read_text()
        file.write_text(text + "# edited")
        assert digest(module) != before, (module, reached)
        file.write_text(text)
    assert digest(module) == before
print(len(sys.modules.keys() & {"numpy", "skfem", "numba"}))
"""


def test_imports_are_those_that_a_parser_finds():
    graph = grimp.build_graph("beadwave", cache_dir=None)
    for module in graph.modules - {"beadwave", "beadwave.__main__"}:
        assert graph.find_modules_directly_imported_by(module) <= sources.imported(module), module


@pytest.mark.slow
def test_an_edit_of_any_module_that_a_stage_reaches_changes_its_key(tmp_path):
    copytree(PACKAGE, tmp_path / "beadwave", ignore=lambda *_: ["__pycache__"])
    stages = sorted({stage.module for stage in ASSEMBLY.values()})
    done = subprocess.run(
        [sys.executable, "-c", EDIT, "beadwave.workflows.run.run", *stages],
        cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(tmp_path)},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "0", "a key imported what it is to do without"


@pytest.mark.parametrize(
    "module", ["beadwave.workflows.stages.walls", "beadwave.workflows.files.wall_file"]
)
def test_what_builds_a_wall_is_among_the_sources_of_the_wall(module):
    assert module in sources.modules("beadwave.workflows.stages.chain")


def test_a_child_process_is_among_the_sources_of_the_stage_that_starts_it():
    assert "beadwave.workflows.report.render" in sources.modules(
        "beadwave.workflows.stages.pictures"
    )
