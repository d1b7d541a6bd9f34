"""Processes of our own beside a run: nothing of the working directory's, never for ever."""

import signal
import subprocess
import sys
from pathlib import Path
from time import sleep

import pytest

from beadwave.workflows.files.child import child


def test_a_child_imports_nothing_from_the_working_directory(tmp_path, monkeypatch):
    for name in ("this", "runpy", "resource", "subprocess", "workflows"):
        (tmp_path / f"{name}.py").write_text('open("ran", "w")')
    monkeypatch.chdir(tmp_path)
    assert b"Zen of Python" in child("this", seconds=120).stdout
    assert not (tmp_path / "ran").exists()


def test_a_child_that_hangs_is_ended_and_told():
    with pytest.raises(TimeoutError, match=r"timeit took more than 0\.5 s"):
        child("timeit", "-n1", "-r1", "while True: pass", seconds=0.5)


def test_a_child_that_crashes_leaves_its_signal_and_no_core(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = child("timeit", "-n1", "-r1", "import ctypes; ctypes.string_at(0)", seconds=120)
    assert done.returncode == -11
    assert not list(tmp_path.iterdir())


ORPHAN = """
import os, signal
from beadwave.workflows.files.child import while_open
with while_open("timeit", "-n1", "-r1", "while True: pass") as process:
    print(process.pid, flush=True)
    os.kill(os.getpid(), signal.{name})
"""


@pytest.mark.parametrize("name", ["SIGKILL", "SIGTERM", "SIGINT"])
def test_a_child_ends_with_whoever_started_it(name):
    parent = subprocess.run(
        [sys.executable, "-c", ORPHAN.format(name=name)],
        capture_output=True, check=False, start_new_session=True,
    )  # fmt: skip
    child_id = int(parent.stdout)
    assert parent.returncode == -signal.Signals[name]
    for _ in range(1200):  # a minute
        try:
            state = Path(f"/proc/{child_id}/stat").read_text().rpartition(")")[2].split()[0]
        except (FileNotFoundError, ProcessLookupError):
            return
        if state == "Z":  # where process 1 takes leave of no orphan
            return
        sleep(0.05)
    pytest.fail(f"{child_id} outlives its parent")
