"""Signals at any moment: the exit status of the signal, one sentence, nothing half written."""

import re
import subprocess
import sys
from pathlib import Path
from signal import SIG_DFL, SIG_IGN, SIGHUP, SIGINT, SIGTERM, signal
from time import sleep

import pytest

from beadwave.workflows.commands import app
from beadwave.workflows.commands.interrupts import Stopped, stopped_by

from signal_guard import signals_restored

# the interpreter itself starts before a line of ours runs: signals are counted from there on
PROGRAM = """
import sys
from beadwave.__main__ import main
print("up", flush=True)
sys.argv = ["beadwave", *sys.argv[1:]]
main()
"""
COMMAND = ("run", "rig-1dof", "--set=time.duration=1e-3", "--set=output.samples=301", "--out=out")


@pytest.fixture(autouse=True)
def own_cache(tmp_path, tmp_path_factory, monkeypatch):
    monkeypatch.setenv("BEADWAVE_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)


def at_once(process):
    """A line is printed."""
    return True


def handled(process):
    """The program handles signals: it begins to load."""
    status = Path(f"/proc/{process.pid}/status").read_text()
    return int(re.search(r"SigCgt:\s*(\w+)", status)[1], 16) >> (SIGTERM - 1) & 1


def while_it_loads(process):
    """The first compiled library of many is in its memory."""
    return "_multiarray_umath" in Path(f"/proc/{process.pid}/maps").read_text()


def while_it_runs(process):
    """Its stages have begun, machine code is still to be made."""
    return Path("out", "scene.toml").exists()


def ended(number, moment, *command, program=PROGRAM):
    """Exit status and stderr of the program, sent the signal once that holds of its process."""
    start = [sys.executable, "-P", "-c", program, *command]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with signals_restored():
        signal(SIGHUP, SIG_DFL)  # beneath nohup it is ignored, which a child would inherit
        process = subprocess.Popen(start, **pipes, start_new_session=True)
    with process:
        assert process.stdout.readline() == "up\n"
        while process.poll() is None and not moment(process):
            sleep(0.005)
        process.send_signal(number)
        said = process.communicate(timeout=600)[1]
    return process.returncode, said


@pytest.mark.parametrize("number", [SIGINT, SIGTERM, SIGHUP])
@pytest.mark.parametrize("moment", [handled, while_it_loads, while_it_runs])
def test_a_signal_at_any_moment_ends_in_its_status_and_one_sentence(number, moment):
    status, said = ended(number, moment, *COMMAND)
    assert status == 128 + number, said
    assert said.startswith("beadwave: ") and said.count("\n") == 1
    assert not list(Path().rglob(".beadwave-*")) and not Path("out", "summary.json").exists()


COMPILED = """
from beadwave.workflows.commands import interrupts
interrupts.PATIENCE = {patience}
interrupts.unwind()
try:
    {before}
    print("up", flush=True)
    {call}
except interrupts.Stopped as stopped:
    interrupts.ignore()
    raise SystemExit(interrupts.print_end(stopped.number) - 128)
"""
BUSY = {
    "before": "from hashlib import pbkdf2_hmac",
    "call": 'pbkdf2_hmac("sha256", b"a march", b"of minutes", 2**30)',
}
WAITS = {"before": "from time import sleep", "call": "sleep(3600)"}


def computes(process):
    """It has had more time of a processor than its imports need."""
    return int(Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()[11]) > 60


def test_a_signal_in_a_compiled_calculation_of_minutes_ends_it():
    status, said = ended(SIGTERM, computes, program=COMPILED.format(**BUSY, patience=0.3))
    assert status == 128 + SIGTERM and said.startswith("beadwave: terminated")


def test_a_signal_that_python_handles_unwinds():
    program = COMPILED.format(**WAITS, patience=3600)
    status, said = ended(SIGTERM, at_once, program=program)
    assert status == SIGTERM and said.startswith("beadwave: terminated")


SWALLOWING = (
    PROGRAM.replace("main()\n", "").rstrip()
    + """
from beadwave.workflows.commands import app

class Deaf:
    def __del__(self):
        _wait()

def _wait():
    from time import sleep
    print("up", flush=True)
    sleep(30)

def deaf(**_):
    try:
        {swallow}
    except:
        pass
    _wait.__globals__["done"] = [0 for _ in iter(int, 1)]

app._status = lambda command: deaf()
main()
"""
)


@pytest.mark.parametrize("swallow", ["_wait()", "Deaf()"])
def test_a_signal_that_a_library_swallows_comes_again(swallow):
    program = SWALLOWING.replace('print("up", flush=True)\n', "", 1).format(swallow=swallow)
    status, said = ended(SIGINT, at_once, program=program)
    assert status == 130 and said.count("\n") == 1 and said.startswith("beadwave: interrupted")


def test_a_signal_that_a_library_makes_an_error_of_is_still_a_signal(monkeypatch):
    def converted(**_):
        try:
            raise Stopped(SIGTERM)
        except Stopped as stopped:
            raise ImportError("cannot load") from stopped

    with pytest.raises(Stopped) as stopped:
        app._status(converted)
    assert stopped.value.number == SIGTERM == stopped_by(stopped.value)
    assert stopped_by(ImportError()) is None


LOSING = """
import os
import signal
import time

from numba.core.codegen import CPUCodeLibrary

from beadwave.dem.kernels.compiled import ieee_entry
from beadwave.__main__ import main
from beadwave.workflows.commands import app

known, status = CPUCodeLibrary._object_compiled_hook, app._status

def emitted(module, code):
    if "twice" in module.name:
        os.kill(os.getpid(), signal.SIGTERM)
    known(module, code)

@ieee_entry
def twice(x):
    return 2.0 * x

CPUCodeLibrary._object_compiled_hook = staticmethod(emitted)
app._status = lambda command: status(lambda **_: (twice(3.0), time.sleep(600)))
main()
"""


def test_a_signal_while_machine_code_is_made_is_no_error_of_the_compiler(tmp_path):
    """numba loses what is raised where it takes the code over, and then misses the code: it is
    compiled again, and the signal comes again."""
    script = tmp_path / "losing.py"
    script.write_text(LOSING)
    result = subprocess.run([sys.executable, "-P", script], capture_output=True, text=True)
    assert result.returncode == 128 + SIGTERM, result.stderr
    assert result.stderr.startswith("beadwave: terminated") and result.stderr.count("\n") == 1


def test_who_runs_it_deaf_to_a_signal_keeps_it_so():
    """nohup ignores SIGHUP, a shell SIGINT for what it runs in the background."""
    program = "from signal import *; signal(SIGHUP, SIG_IGN)\n" + PROGRAM
    earlier = signal(SIGHUP, SIG_IGN)
    try:
        status, _ = ended(SIGHUP, at_once, "scenes", program=program)
    finally:
        signal(SIGHUP, earlier)
    assert status == 0


def test_a_file_that_ends_too_early_is_no_interrupt(monkeypatch, capsys):
    """typer takes an EOFError for Ctrl-D."""

    def short(*_):
        raise EOFError("Ran out of input")

    monkeypatch.setattr("beadwave.workflows.run.api.load_scene", short)
    monkeypatch.setattr(sys, "argv", ["beadwave", "run", "rig-1dof"])
    with pytest.raises(SystemExit) as end:
        app.main()
    said = capsys.readouterr().err
    assert end.value.code == 1 and "a file ends before" in said and said.count("\n") == 1


NAMES = ("pyvista", "numpy", "multiprocessing", "pickle", "workflows", "resource", "runpy", "json")
SPAWNING = """
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from beadwave.workflows.commands.app import main

if __name__ == "__main__":
    sys.argv = ["beadwave", "scenes"]
    try:
        main()
    except SystemExit:
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
            print(pool.submit(pow, 2, 3).result())
"""


def test_no_process_that_a_command_starts_imports_from_the_working_directory(tmp_path_factory):
    """By multiprocessing; the pictures' child has a test of its own."""
    program = tmp_path_factory.mktemp("bin") / "beadwave"  # a script, as the command is one
    program.write_text(SPAWNING)
    for name in NAMES:
        Path(f"{name}.py").write_text("raise SystemExit('imported')\n")
    command = [sys.executable, str(program)]
    finished = subprocess.run(command, capture_output=True, text=True, check=False, timeout=600)
    assert finished.returncode == 0, finished.stderr
    assert finished.stdout.endswith("8\n") and "imported" not in finished.stderr
