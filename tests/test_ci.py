"""The script of continuous integration, on programs that only say that they were called."""

import os
import re
import shutil
import signal
import subprocess
from pathlib import Path
from time import sleep

import pytest

RUN = Path(__file__).parents[1] / ".ci" / "run"
pytestmark = pytest.mark.skipif(not RUN.is_file(), reason="a source archive has no .ci")

README = """```sh
never
```
```sh
./install.sh test && .venv/bin/python -m pytest
```
"""
SAYS = """#!/bin/sh
if [ "$*" = "verify --list --json" ]; then
    echo '{"groups": [{"name": "contacts"}, {"name": "thesis-tables"}, {"name": "beams"}]}'; exit
fi
case "$1" in -c) exec python3 "$@" ;; esac
echo "called $(basename "$0") $*" | tee -a calls
case "$*" in *"$FAILS"*) exit 3 ;; *"$HANGS"*) exec sleep 3600 ;; esac
"""
STEPS = ("install", "install-more", "tests", "slow-tests", "gallery", "docs")
IN_TURN = ("fuzz-text", "fuzz-binary", "kills", "newest", "processors")
JOBS = ("commands", "verify", "peers", "one in turn")


@pytest.fixture
def checkout(tmp_path):
    """A checkout whose programs only say that they were called."""
    for place in (".ci", ".venv/bin", "docs", "tests/tools/hostile", "tmp"):
        (tmp_path / place).mkdir(parents=True)
    (tmp_path / "README.md").write_text(README)
    shutil.copy(RUN, tmp_path / ".ci" / "run")
    for place in ("install.sh", ".venv/bin/python", ".venv/bin/beadwave", "docs/build.sh"):
        (tmp_path / place).write_text(SAYS)
        (tmp_path / place).chmod(0o755)
    (tmp_path / "docs" / "first.md").write_text("```sh\necho\n```\n")
    (tmp_path / "docs" / "second.md").write_text("```python\nprint()\n```\n")
    (tmp_path / "docs" / "third.md").write_text("```sh\necho\n```\n")
    (tmp_path / "docs" / "none.md").write_text("nothing to run\n")
    # makes an environment whose Python says what it is called with
    (tmp_path / "bin").mkdir()
    newest = f'#!/bin/sh\nmkdir -p "$3/bin" && cp "{tmp_path}/.venv/bin/python" "$3/bin/python"\n'
    (tmp_path / "bin" / "python3.13").write_text(newest)
    (tmp_path / "bin" / "python3.13").chmod(0o755)
    return tmp_path


def started(checkout, fails="nothing fails", hangs="nothing hangs", turn=0):
    environment = os.environ | {
        "FAILS": fails, "HANGS": hangs, "BEADWAVE_TURN": str(turn),
        "PATH": f"{checkout / 'bin'}:{os.environ['PATH']}", "TMPDIR": str(checkout / "tmp"),
    }  # fmt: skip
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    # bash cannot trap a signal that was ignored when it began, as SIGHUP is beneath nohup
    inherited = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    try:
        return subprocess.Popen(
            [checkout / ".ci" / "run"], env=environment, start_new_session=True, **pipes
        )
    finally:
        signal.signal(signal.SIGHUP, inherited)


def test_every_step_and_job_runs_and_says_how_long_it_took(checkout):
    with started(checkout) as process:
        said = process.communicate(timeout=600)[0]
    assert process.returncode == 0, said
    for name in (*STEPS, "commands", "verify", "peers"):
        assert f"=== {name}: status 0, " in said
    assert "called python -m pytest\n" in said
    assert "called python -m pytest -m slow --part 1/3\n" in said
    assert "failed" not in said and not list((checkout / "tmp").iterdir())


def test_all_that_runs_in_turn_has_its_turn(checkout):
    """Pages, groups of `verify` and thirds of the slow tests and of those beside other programs in
    three turns, jobs in five; of the groups `thesis-tables` takes many minutes and is left out."""
    (checkout / "tests" / "tools" / "processors.sh").write_text(SAYS)
    (checkout / "tests" / "tools" / "processors.sh").chmod(0o755)
    calls, jobs = "", []
    for turn in range(5):
        with started(checkout, turn=turn) as process:
            said = process.communicate(timeout=600)[0]
        assert process.returncode == 0, said
        jobs += [name for name in IN_TURN if f"=== {name}: status 0, " in said]
        calls += said if turn < 3 else ""
    assert jobs == list(IN_TURN)
    run = re.findall(r"called python docs/run_commands.py (.*)", calls)
    assert sorted(" ".join(run).split()) == ["first", "second", "third"]
    groups = re.findall(r"--group (\S+)", calls)
    assert sorted(groups) == ["beams", "contacts"]
    for tests in ("-m slow", "tests/verify -m peer and not minutes"):
        parts = re.findall(rf"called python -m pytest {tests} --part (./3)\n", calls)
        assert sorted({*parts}) == ["1/3", "2/3", "3/3"]


def test_all_is_installed_before_anything_runs(checkout):
    with started(checkout) as process:
        process.communicate(timeout=600)
    calls = (checkout / "calls").read_text().splitlines()
    assert calls[:2] == ["called install.sh test", "called install.sh docs,verify"]
    assert calls.index("called python -m pytest") < calls.index("called build.sh ")


@pytest.mark.parametrize(
    ("fails", "name", "turn"),
    [("fuzz.py 72", "fuzz-binary", 1), ("-m slow", "slow-tests", 0), ("gallery.py", "gallery", 2)],
)
def test_one_that_fails_is_named_last_and_hinders_no_other(fails, name, turn, checkout):
    with started(checkout, fails=fails, turn=turn) as process:
        said = process.communicate(timeout=600)[0]
    assert process.returncode == 1
    assert said.splitlines()[-1] == f"failed: {name} (status 3)"
    assert f"=== {name}: status 3, " in said
    assert said.count("status 0, ") == len(STEPS) + len(JOBS) - 1


def test_nothing_is_tested_that_could_not_be_installed(checkout):
    with started(checkout, fails="docs,verify") as process:
        said = process.communicate(timeout=600)[0]
    assert process.returncode == 1 and "install-more (status 3)" in said
    assert "pytest" not in (checkout / "calls").read_text()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
@pytest.mark.parametrize("hangs", ["kills.py", "-m pytest"])
def test_what_still_runs_ends_with_the_script(number, hangs, checkout):
    calls = checkout / "calls"
    with started(checkout, hangs=hangs, turn=2) as process:
        while not calls.exists() or hangs not in calls.read_text():
            assert process.poll() is None
            sleep(0.02)
        process.send_signal(number)
        process.communicate(timeout=600)  # until nothing writes to the pipe
    assert process.returncode == 128 + number
    assert not list((checkout / "tmp").iterdir())
