"""The guards of the tests' own signals, each in a pytest of its own."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from signal_guard import signals_restored

SUPPORT = Path(__file__).parent / "support"


def outcome(tmp_path, text):
    """Exit status, stdout and stderr of pytest on a file of tests, in a session of its own."""
    (tmp_path / "test_it.py").write_text(f"import os, signal, subprocess, sys\n{text}")
    environment = os.environ | {"PYTHONPATH": str(SUPPORT), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    (tmp_path / "pytest.ini").write_text("[pytest]\n")
    command = "-m pytest -q -p signal_guard -p no:cacheprovider .".split()
    with signals_restored():
        signal.signal(signal.SIGHUP, signal.SIG_DFL)  # beneath nohup it is ignored, and inherited
        return subprocess.run(
            [sys.executable, *command], cwd=tmp_path, env=environment, start_new_session=True,
            capture_output=True, text=True, timeout=600,
        )  # fmt: skip


LEFT = {
    "signal.signal(signal.SIGTERM, lambda *_: os._exit(143))": "SIGTERM is left to <function",
    "signal.signal(signal.SIGHUP, signal.SIG_IGN)": "SIGHUP is left to",
    "signal.signal(signal.SIGINT, signal.SIG_DFL)": "SIGINT is left to",
    "signal.setitimer(signal.ITIMER_REAL, 60.0)": "a timer sends a signal in",
    # as a library in C, past Python
    "import ctypes; ctypes.CDLL(None).signal(15, ctypes.c_void_p(1))": "(ignored), before it was",
}
UNDONE = """
def test_after_{i}():
    assert signal.getsignal(signal.SIGTERM).__name__ == "trace_and_end"
    assert signal.getsignal(signal.SIGHUP).__name__ == "trace_and_end"
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)
"""


def test_what_a_test_leaves_of_signals_fails_it_and_is_undone(tmp_path):
    tests = (
        f"def test_before_{i}():\n    {change}\n{UNDONE.format(i=i)}"
        for i, change in enumerate(LEFT)
    )
    found = outcome(tmp_path, "\n".join(tests))
    assert f"{2 * len(LEFT)} passed, {len(LEFT)} errors" in found.stdout, found.stdout
    for said in LEFT.values():
        assert said in found.stdout


TARGETS = (
    "os.kill(os.getpid(), signal.SIGTERM)",
    "os.kill(os.getppid(), signal.SIGTERM)",
    "os.kill(0, signal.SIGKILL)",
    "os.kill(-os.getpgid(0), signal.SIGKILL)",
    "os.killpg(os.getpgid(0), signal.SIGKILL)",
    "os.killpg(0, signal.SIGHUP)",
    # a child in pytest's own group: its group is pytest's
    "with subprocess.Popen(['cat'], stdin=-1) as c: os.killpg(os.getpgid(c.pid), 9)",
)


def test_a_test_cannot_signal_pytest_its_parent_or_its_group(tmp_path):
    tests = (f"def test_{i}():\n    {target}\n" for i, target in enumerate(TARGETS))
    found = outcome(tmp_path, "\n".join([*tests, "def test_after():\n    pass\n"]))
    assert f"{len(TARGETS)} failed, 1 passed" in found.stdout, found.stdout
    assert "start_new_session=True" in found.stdout


def test_children_of_a_test_are_signalled_as_ever(tmp_path):
    text = """
import pytest

@pytest.mark.parametrize("alone", [False, True])
def test_kills(alone):
    for end in ("terminate", "kill"):
        with subprocess.Popen(["cat"], stdin=-1, start_new_session=alone) as child:
            os.kill(child.pid, 0)
            getattr(child, end)()
        assert child.returncode < 0
    with pytest.raises(ProcessLookupError):
        os.kill(child.pid, signal.SIGTERM)

def test_kills_a_group_of_its_own():
    with subprocess.Popen(["cat"], stdin=-1, start_new_session=True) as child:
        os.killpg(child.pid, signal.SIGKILL)
    assert child.returncode == -9
    os.kill(os.getpid(), 0)
"""
    found = outcome(tmp_path, text)
    assert "3 passed" in found.stdout, found.stdout


@pytest.mark.parametrize("name", ["SIGHUP", "SIGALRM"])
def test_a_signal_that_ends_pytest_leaves_a_trace(name, tmp_path):
    """Sent here by a child, past the guard."""
    text = f"""
def test_waits():
    subprocess.run(["sh", "-c", "kill -{name[3:]} $PPID"])
    signal.pause()
"""
    found = outcome(tmp_path, text)
    assert found.returncode == -signal.Signals[name]
    assert f"pytest is ended by {name} during test_it.py::test_waits (call)" in found.stderr
    assert "in test_waits" in found.stderr
