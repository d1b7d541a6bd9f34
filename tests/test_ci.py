"""The script of continuous integration, on programs that only say that they were called."""

import os
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
    echo '{"groups": [{"name": "contacts"}, {"name": "honest-bars"}, {"name": "beams"}]}'; exit
fi
case "$1" in -c) exec python3 "$@" ;; esac
echo "called $(basename "$0") $*" | tee -a calls
case "$*" in *"$FAILS"*) exit 3 ;; *"$HANGS"*) exec sleep 3600 ;; esac
"""
STEPS = ("install", "install-more", "tests", "gallery", "docs")
JOBS = ("commands", "verify", "fuzz-text", "fuzz-binary", "kills")


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
    return tmp_path


def started(checkout, fails="nothing fails", hangs="nothing hangs"):
    environment = os.environ | {"FAILS": fails, "HANGS": hangs, "TMPDIR": str(checkout / "tmp")}
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
    script = checkout / "tests" / "tools" / "processors.sh"
    script.write_text(SAYS)
    script.chmod(0o755)
    with started(checkout) as process:
        said = process.communicate(timeout=600)[0]
    assert process.returncode == 0, said
    for name in (*STEPS, *JOBS, "processors"):
        assert f"=== {name}: status 0, " in said
    assert "called python -m pytest --all\n" in said
    assert "called beadwave verify --group contacts --group beams\n" in said
    assert "failed" not in said and not list((checkout / "tmp").iterdir())


def test_all_is_installed_before_anything_runs(checkout):
    with started(checkout) as process:
        process.communicate(timeout=600)
    calls = (checkout / "calls").read_text().splitlines()
    assert calls[:2] == ["called install.sh test", "called install.sh docs,verify"]
    assert calls.index("called python -m pytest --all") < calls.index("called build.sh ")


@pytest.mark.parametrize(
    ("fails", "name"),
    [("fuzz.py 72", "fuzz-binary"), ("-m pytest", "tests"), ("gallery.py", "gallery")],
)
def test_one_that_fails_is_named_last_and_hinders_no_other(fails, name, checkout):
    with started(checkout, fails=fails) as process:
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
    with started(checkout, hangs=hangs) as process:
        while not calls.exists() or hangs not in calls.read_text():
            assert process.poll() is None
            sleep(0.02)
        process.send_signal(number)
        process.communicate(timeout=600)  # until nothing writes to the pipe
    assert process.returncode == 128 + number
    assert not list((checkout / "tmp").iterdir())
