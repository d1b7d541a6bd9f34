"""Tests that a run of the whole suite takes and leaves out, by their marks."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import mutants

TESTS = Path(__file__).parent
PROJECT = """[tool.pytest.ini_options]
testpaths = ["tests"]
pythonpath = ["tests"]
markers = ["slow", "peer", "minutes"]
"""
FOUR = """import os, pytest

def test_quick():
    print("worker", os.environ.get("PYTEST_XDIST_WORKER", "none"))

@pytest.mark.slow
def test_slow():
    pass

@pytest.mark.peer
def test_beside_a_program():
    pass

@pytest.mark.peer
@pytest.mark.minutes
def test_of_minutes():
    pass
"""


@pytest.fixture
def pytest_says(tmp_path):
    """Output of pytest with these options in a project with our conftest."""
    (tmp_path / "tests").mkdir()
    (tmp_path / "pyproject.toml").write_text(PROJECT)
    (tmp_path / "tests" / "test_four.py").write_text(FOUR)
    for name in ("conftest.py", "support/signal_guard.py"):
        shutil.copy(TESTS / name, tmp_path / "tests")
    inherited = {k: v for k, v in os.environ.items() if not k.startswith("PYTEST_")}

    def says(*options):
        process = subprocess.run(
            [sys.executable, "-m", "pytest", "-rP", "-p", "no:cacheprovider", *options],
            cwd=tmp_path, env=inherited, capture_output=True, text=True, timeout=600, check=False,
        )  # fmt: skip
        assert process.returncode == 0, process.stdout + process.stderr
        return process.stdout

    return says


def test_the_whole_suite_takes_every_core_and_leaves_out_marked_tests(pytest_says):
    said = pytest_says()
    assert "1 passed" in said and "worker gw" in said


@pytest.mark.slow
def test_all_leaves_out_tests_of_minutes_alone(pytest_says):
    said = pytest_says("--all")
    assert "3 passed" in said and "worker gw" in said


def test_a_file_that_is_named_runs_whole_in_one_process(pytest_says):
    said = pytest_says("tests/test_four.py")
    assert "4 passed" in said and "worker none" in said


@pytest.mark.slow
@pytest.mark.parametrize("option", ["--pdb", "-pno:xdist", "-n0"])
def test_one_process_is_enough_where_the_options_want_one(pytest_says, option):
    said = pytest_says(option)
    assert "1 passed, 3 deselected" in said and "worker none" in said


def test_a_choice_of_marks_is_kept(pytest_says):
    assert "1 passed, 3 deselected" in pytest_says("-n0", "-m", "slow")


def test_the_short_run_has_every_test_that_the_mutants_are_noticed_by():
    """It leaves out none of the share that `tests/tools/mutants.py` measures."""
    names = {name for room in mutants.ROOMS.values() for name in room.tests}
    files = [TESTS / "{}/test_{}.py".format(*name.split("/")) for name in names]
    assert len(files) > 50
    assert not [file.name for file in files if not file.is_file()]
    assert f'"{mutants.QUICK}"' in (TESTS / "conftest.py").read_text(encoding="utf-8")


def test_explained_mutants_are_those_of_lines_that_there_are():
    modules = {module for room in mutants.ROOMS.values() for module in room.modules}
    lines = {
        line.strip()
        for module in modules
        for line in (mutants.ROOT / module).read_text(encoding="utf-8").splitlines()
    }
    assert not [line for line, _ in mutants.EXPLAINED if line not in lines]
