"""Files of a user stay: folders of ours are marked, held by one run, complete or absent."""

import json
import os
import signal
import socket
import subprocess
import sys
from hashlib import sha256
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from beadwave import rom
from beadwave.workflows.evidence.accuracy import folder as accuracy
from beadwave.workflows.evidence.accuracy.runs import AccuracyRow, table_of
from beadwave.workflows.files.output_file import OutputFile
from beadwave.workflows.files.own_folder import own_folder
from beadwave.workflows.files.run_folder import MARKER, RunFolder
from beadwave.workflows.files.scene import scene_text
from beadwave.workflows.files.whole_file import writing_file
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.report.report import CAPTIONS
from beadwave.workflows.run.run import FILES, IMPACT_FILES
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.structure.hammer import IdentifiedTest

from command_line import beadwave

SMALL = ("chain.count=5", "output.spheres=[1,4]", "output.samples=201", "time.duration=0.5e-3")


@pytest.fixture(autouse=True)
def own_cache(tmp_path, tmp_path_factory, monkeypatch):
    monkeypatch.setenv("BEADWAVE_CACHE_DIR", str(tmp_path_factory.getbasetemp() / "files-cache"))
    monkeypatch.chdir(tmp_path)


def small(command, name, *more):
    return beadwave(command, name, *(f"--set={change}" for change in SMALL), *more)


def contents(folder):
    return {path: path.read_bytes() for path in Path(folder).rglob("*") if path.is_file()}


def one_line(text):
    return text.startswith("beadwave: ") and text.count("\n") == 1 and "Traceback" not in text


# ---- what is somebody's ----------------------------------------------------------------------


@pytest.mark.parametrize("name", FILES)
def test_a_run_touches_nothing_in_a_folder_that_holds_a_file_it_would_replace(name, capsys):
    theirs = Path("out", name)
    theirs.parent.mkdir(parents=True)
    theirs.write_bytes(b"theirs")
    before = contents("out")
    assert small("run", "rig-1dof", "--out=out") == 2
    assert contents("out") == before
    said = capsys.readouterr().err
    assert name in said and "--overwrite" in said and one_line(said)


@pytest.mark.parametrize("place", ["../victim.dat", "figures/../../victim.dat", "absolute"])
def test_a_forged_marker_leads_no_run_out_of_its_folder(place, tmp_path):
    victim = tmp_path / "victim.dat"
    victim.write_bytes(b"theirs")
    name = str(victim) if place == "absolute" else place
    Path("out", "figures").mkdir(parents=True)
    Path("out", MARKER).write_text(f"\n{sha256(b'theirs').hexdigest()}  {name}\n")
    assert small("impact", "rig-1dof", "--out=out") == 0
    assert victim.read_bytes() == b"theirs"


INTO_A_FOLDER = {
    "run": ("run", "rig-1dof"),
    "impact": ("impact", "rig-1dof"),
    "sweep": ("sweep", "rig-rigid", "--over=striker.velocity=0.3,0.4"),
    "scan": ("scan", "rig-rom", "--grid=2x2"),
    "look": ("look", "rig-rom"),
    "modes": ("modes", "rig-rom"),
    "hammer": ("hammer", "mine.csv"),
    "calibrate": ("calibrate", "rig-1dof", "mine.csv"),
    "inspect": ("inspect", "cantilever", "mine.csv", "--find=beam.axial_force=-35kN:5kN"),
    "design": ("design", "cantilever", "--find=beam.axial_force=-35kN:5kN"),
    "accuracy": ("accuracy", "--stage=time"),
    "stability": ("stability", "--case=one-dof-wall"),
    "verify": ("verify", "--group=solitary-wave"),
}


@pytest.mark.parametrize("kind", ["pipe", "link", "dangling link", "folder", "socket"])
@pytest.mark.parametrize("command", INTO_A_FOLDER.values(), ids=INTO_A_FOLDER)
def test_a_marker_that_is_no_ordinary_file_is_refused(command, kind, monkeypatch, capsys):
    monkeypatch.setattr("beadwave.workflows.stages.engine.pipeline.Pipeline.__call__", None)
    Path("mine.csv").write_text(SIGNAL)
    Path("d").mkdir()
    marker, theirs = Path("d", MARKER), Path("theirs.txt")
    theirs.write_text("mine, not a marker\n")
    made = {
        "pipe": lambda: os.mkfifo(marker),
        "link": lambda: marker.symlink_to(theirs.absolute()),
        "dangling link": lambda: marker.symlink_to(Path("absent").absolute()),
        "folder": marker.mkdir,
        "socket": lambda: socket.socket(socket.AF_UNIX).bind(str(marker)),
    }
    made[kind]()
    assert beadwave(*command, "--out=d") == 2
    said = capsys.readouterr().err
    assert one_line(said) and f"--out d holds {MARKER}, which is" in said
    assert theirs.read_text() == "mine, not a marker\n" and not Path("absent").exists()
    assert [path.name for path in Path("d").iterdir()] == [MARKER]


def test_a_linked_marker_makes_no_folder_of_ours(tmp_path):
    assert small("impact", "rig-1dof", "--out=a") == 0
    Path("a", MARKER).rename("elsewhere")
    Path("a", MARKER).symlink_to(tmp_path / "elsewhere")
    assert own_folder(tmp_path, "a", Path("a", "scene.toml").read_text()) == tmp_path / "a-2"


@pytest.mark.parametrize("place", ["/", "//", "/usr/..", "/usr", "/etc/", "/var", "/proc", "root"])
def test_a_folder_of_the_system_is_no_run_folder(place, tmp_path):
    if place == "root":
        Path("root").symlink_to("/")
    with pytest.raises(InvalidScene, match=r"is a folder of the system; choose one for the run"):
        RunFolder(Path(place)).require("scene.toml")


@pytest.mark.parametrize("command", INTO_A_FOLDER.values(), ids=INTO_A_FOLDER)
def test_no_command_fills_the_home_of_a_user(command, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("beadwave.workflows.stages.engine.pipeline.Pipeline.__call__", None)
    Path("mine.csv").write_text(SIGNAL)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    Path("home").mkdir()
    assert beadwave(*command, "--out=home") == 2
    said = capsys.readouterr().err
    assert one_line(said) and "--out home is your home folder" in said
    assert not list(Path("home").iterdir())


def test_a_home_that_is_a_run_folder_already_stays_one(tmp_path, monkeypatch):
    assert small("impact", "rig-1dof", "--out=home") == 0
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert small("impact", "rig-rigid", "--out=home") == 0
    assert small("impact", "rig-rigid", "--out=home/below") == 0


def test_files_that_a_run_does_not_write_stay_as_they_are():
    Path("out", "mine").mkdir(parents=True)
    for name in ("out/notes.txt", "out/mine/.notes.part.txt", "out/.rom.part.npz"):
        Path(name).write_text("mine")
    before = contents("out")
    for scene in ("rig-1dof", "rig-rigid"):
        assert small("run", scene, "--out=out") == 0
        assert before.items() <= contents("out").items()


def test_who_means_it_replaces_what_is_not_ours():
    Path("out").mkdir()
    Path("out", "summary.json").write_text("theirs")
    assert small("run", "rig-1dof", "--out=out", "--overwrite") == 0
    assert json.loads(Path("out", "summary.json").read_text())["scene"] == "rig-1dof"


def wall_file(path):
    """A reduced model of six masses, and the change that makes it the wall."""
    K = 2e8 * (2 * np.eye(6) - np.eye(6, k=1) - np.eye(6, k=-1))
    path.parent.mkdir(parents=True, exist_ok=True)
    rom.save_npz(path, rom.full_order(K, 0.4 * np.eye(6), np.eye(6)[0]))
    return f"--set=wall={{kind='rom', file='{path.absolute()}', half_space=0.0}}"


def test_a_reduced_model_in_the_run_folder_is_read_and_stays():
    wall_file(Path("d", "rom.npz"))
    before = contents("d")
    assert small("impact", "rig-1dof", "--rom=d/rom.npz", "--out=d") == 0
    assert before.items() <= contents("d").items()
    assert small("impact", "rig-rigid", "--out=d") == 0
    assert before.items() <= contents("d").items()


def test_not_even_overwrite_replaces_an_input(capsys):
    """A run of an assembly would write its own rom.npz; the one it reads is not its to replace."""
    change = wall_file(Path("d", "rom.npz"))
    before = contents("d")
    for more in ((), ("--overwrite",)):
        assert small("run", "rig-1dof", change, "--out=d", *more) == 2
        assert "would overwrite" in capsys.readouterr().err and contents("d") == before


def test_an_input_that_an_earlier_run_of_ours_left_is_not_cleared():
    assert small("run", "rig-1dof", "--out=d") == 0
    folder = RunFolder(Path("d"))
    with folder.writing("rom.npz") as part:
        wall_file(part)
    before = Path("d", "rom.npz").read_bytes()
    assert small("impact", "rig-1dof", "--rom=d/rom.npz", "--out=d") == 0
    assert Path("d", "rom.npz").read_bytes() == before


@pytest.mark.parametrize("more", [(), ("--overwrite",)])
def test_a_scene_is_not_replaced_by_its_own_run(more, capsys):
    mine = Path("scene.toml")
    mine.write_text("# mine\n" + scene_text("rig-1dof").text)
    before = mine.read_bytes()
    assert small("run", "scene.toml", "--out=.", *more) == 2
    assert mine.read_bytes() == before and one_line(capsys.readouterr().err)


def test_a_run_of_the_scene_that_a_run_left_repeats_it_and_changes_no_letter(capsys):
    assert small("run", "rig-1dof", "--out=out") == 0
    scene = Path("out", "scene.toml").read_bytes()
    assert beadwave("run", "out/scene.toml", "--out=out") == 0
    assert Path("out", "scene.toml").read_bytes() == scene
    assert beadwave("run", "out/scene.toml", "--out=out", "--set=wall.frequency=300") == 2
    assert Path("out", "scene.toml").read_bytes() == scene
    assert "would overwrite" in capsys.readouterr().err


def test_a_result_that_was_changed_by_hand_is_no_longer_ours(capsys):
    assert small("run", "rig-1dof", "--out=out") == 0
    Path("out", "scene.toml").write_text("# mine now\n")
    before = contents("out")
    assert small("run", "rig-rigid", "--out=out") == 2
    assert contents("out") == before
    assert "scene.toml" in capsys.readouterr().err


# ---- what an earlier run of ours left ----------------------------------------------------------


def test_nothing_of_an_earlier_run_is_left_or_shown():
    assert small("run", "rig-1dof", "--out=out") == 0
    for name in (*FILES, "figures/of_a_later_version.png"):
        RunFolder(Path("out")).write(name, b"of the run before")
    with RunFolder(Path("out")).run("name = 'other'\n", FILES) as folder:
        assert {path.name for path in contents(folder.path)} == {MARKER, "scene.toml"}
    left = {path.name for path in contents("out")}
    assert left == {MARKER, "scene.toml"}


def test_an_impact_after_a_run_leaves_no_figure_of_the_run():
    assert small("run", "rig-1dof", "--out=out") == 0
    assert small("impact", "rig-1dof", "--out=out") == 0
    # of sensors and crystals, which this scene has none of
    written = {*IMPACT_FILES} - {"signals.csv", "arrivals.csv"}
    assert {path.name for path in contents("out")} == {MARKER, "scene.toml", *written}


FAILURES = (KeyboardInterrupt, ValueError, InvalidScene)


@pytest.mark.parametrize("failure", FAILURES)
@pytest.mark.parametrize("scene", ["name = 'a'\n", "name = 'other'\n"])
def test_what_was_complete_stays_until_a_run_has_a_result(scene, failure):
    with RunFolder(Path("out")).run("name = 'a'\n", FILES) as folder:
        folder.write("rom.npz", b"long to make")
        folder.write("summary.json", b"old")
    before = contents("out")
    with pytest.raises(failure), RunFolder(Path("out")).run(scene, FILES) as folder:
        folder.write("rom.npz", b"new")
        folder.write("figures/modes.png", b"new")
        raise failure
    assert contents("out") == before and not Path("out", "figures").exists()
    with RunFolder(Path("out")).run(scene, FILES) as folder:
        folder.write("summary.json", b"new")
        assert contents("out").items() >= before.items()
    assert Path("out", "summary.json").read_bytes() == b"new"
    assert not Path("out", "rom.npz").exists()


def test_a_run_that_fails_late_leaves_the_finished_one(monkeypatch, capsys):
    assert small("run", "rig-1dof", "--out=out") == 0
    before = contents("out")
    for failure, status in ((ValueError, 1), (InvalidScene, 2)):

        def fails(*_, failure=failure, **__):
            raise failure("late.")

        monkeypatch.setattr("beadwave.workflows.run.run.summary_of", fails)
        for command in ("run", "impact"):
            assert small(command, "rig-1dof", "--set=wall.frequency=300", "--out=out") == status
            assert contents("out") == before


@pytest.mark.parametrize("made", [False, True])
def test_a_refused_run_leaves_nothing_and_a_failed_one_its_finished_files(made):
    for failure, left in ((InvalidScene, made), (ValueError, True)):
        if made:
            Path("out").mkdir(exist_ok=True)
        with pytest.raises(failure), RunFolder(Path("out")).run("name = 'a'\n", FILES) as folder:
            folder.write("figures/modes.png", b"finished")
            raise failure
        assert Path("out").exists() == left
        if failure is InvalidScene:
            assert not contents("out")
        assert Path("out", "figures", "modes.png").exists() == (failure is ValueError)


def by_name(folder):
    return {path.name: path.read_bytes() for path in Path(folder).iterdir() if path.is_file()}


def over_a_finished_run(monkeypatch, at_replacing):
    """A run over a finished one; at_replacing(i) is called before the i-th file takes its place."""
    names = ("rom.npz", "trajectory.npz", "summary.json")
    with RunFolder(Path("out")).run("name = 'a'\n", FILES) as folder:
        for name in (*names, "response.npz"):
            folder.write(name, b"old")
    calls = iter(range(99))

    def replace(source, target):
        if Path(target).parent == Path("out"):
            at_replacing(next(calls))
        os.replace(source, target)

    monkeypatch.setattr("beadwave.workflows.files.run_folder.replace", replace)
    with RunFolder(Path("out")).run("name = 'b'\n", FILES) as folder:
        for name in names:
            folder.write(name, b"new")
    return names


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_amid_the_replacement_waits_for_its_end(number, monkeypatch):
    came = []
    before = signal.signal(number, lambda n, _: came.append(by_name("out")))
    try:
        over_a_finished_run(monkeypatch, lambda i: i or signal.raise_signal(number))
    finally:
        signal.signal(number, before)
    (after,) = came
    assert after["summary.json"] == after["rom.npz"] == b"new" and "response.npz" not in after


def test_each_file_is_whole_while_a_run_takes_the_place_of_another(monkeypatch):
    seen = []
    names = over_a_finished_run(monkeypatch, lambda i: seen.append(by_name("out")))
    assert len(seen) > 3 and all({*names, "response.npz"} <= now.keys() for now in seen)
    assert all(now[name] in (b"old", b"new") for now in seen for name in names)


def test_what_a_killed_run_prepared_beside_a_finished_one_goes():
    with RunFolder(Path("out")).run("name = 'a'\n") as folder:
        folder.write("summary.json", b"old")
    Path("out", ".beadwave-new-999999999").mkdir()
    Path("out", ".beadwave-new-mine").mkdir()
    Path("out", ".beadwave-new-999999999", "summary.json").write_bytes(b"half a result")
    with RunFolder(Path("out")).run("name = 'a'\n"):
        pass
    assert {path.name for path in Path("out").glob(".beadwave-*")} == {".beadwave-new-mine"}


@pytest.mark.parametrize("more", [(), ("--overwrite",)])
def test_a_folder_in_the_place_of_a_file_is_refused_at_once(more, monkeypatch, capsys):
    monkeypatch.setattr("beadwave.workflows.stages.engine.pipeline.Pipeline.__call__", None)
    Path("a", "summary.json").mkdir(parents=True)
    Path("b").mkdir()
    Path("b", "figures").write_text("mine")
    for out in ("a", "b"):
        before = contents(out)
        assert small("run", "rig-1dof", f"--out={out}", *more) == 2
        assert one_line(capsys.readouterr().err) and contents(out) == before


def test_the_words_of_another_scene_are_not_taken_for_those_of_a_resolved_one():
    assert small("run", "rig-rigid", "--out=other") == 0
    assert small("run", "rig-1dof", "--out=out") == 0
    words = Path("other", "given.toml").read_text()
    assert beadwave("run", "other/scene.toml", "--out=out") == 0
    assert beadwave("run", "other/scene.toml", "--out=other") == 0
    assert "rig-1dof" not in Path("out", "given.toml").read_text()
    assert Path("other", "given.toml").read_text() == words


def test_a_run_writes_nothing_but_what_it_asked_for_beforehand():
    """Figures are those that a report has words for; an assembly's run is held to the same."""
    assert small("run", "rig-1dof", "--out=out") == 0
    names = {str(path.relative_to("out")) for path in contents("out")}
    assert names <= {MARKER, "scene.toml", *FILES}
    assert {f"figures/{name}.png" for name in CAPTIONS} <= set(FILES)


def test_a_line_of_the_marker_that_a_killed_run_left_half_hides_no_other():
    folder = RunFolder(Path("out"))
    folder.write("a.txt", "a")
    with Path("out", MARKER).open("a") as marker:
        marker.write("0123456789abcdef")
    folder.write("b.txt", "b")
    assert folder.ours("a.txt") and folder.ours("b.txt")


# ---- which folder ------------------------------------------------------------------------------


def test_another_scene_of_the_same_name_gets_a_folder_of_its_own(capsys):
    assert small("run", "rig-1dof") == 0
    before = contents("runs/rig-1dof")
    assert small("run", "rig-1dof", "--set=wall.frequency=300") == 0
    printed = capsys.readouterr()
    assert contents("runs/rig-1dof") == before
    assert "written: runs/rig-1dof-2/report.html" in printed.out
    assert "runs/rig-1dof is left as it is" in printed.err


def test_the_same_scene_takes_its_own_folder_again():
    for frequency in (300, 310, 300, 310):
        assert small("run", "rig-1dof", f"--set=wall.frequency={frequency}") == 0
    assert {path.name for path in Path("runs").iterdir()} == {"rig-1dof", "rig-1dof-2"}


def test_a_folder_of_somebody_is_no_folder_of_ours(tmp_path):
    (tmp_path / "a").mkdir()
    assert own_folder(tmp_path, "a", "x") == tmp_path / "a"
    (tmp_path / "a" / "notes.txt").touch()
    (tmp_path / "a-2").touch()
    assert own_folder(tmp_path, "a", "x") == tmp_path / "a-3"


def test_the_run_that_is_replaced_is_named(capsys):
    assert small("run", "rig-1dof", "--out=out") == 0
    assert "replaced" not in capsys.readouterr().err
    assert small("run", "rig-rigid", "--out=out") == 0
    assert "replaced: what an earlier run of rig-1dof left in out" in capsys.readouterr().err


NAMES = ["..", ".", "...", "a/b", "../a", "/tmp/a", ".hidden", "a" * 300, "-x", "", "a\nb"]


@pytest.mark.parametrize("name", NAMES)
def test_no_name_leads_out_of_the_folder_of_runs(name, tmp_path, capsys):
    text = scene_text("rig-1dof").text.replace('name = "rig-1dof"', f"name = {json.dumps(name)}")
    Path("mine.toml").write_text(text)
    assert beadwave("run", "mine.toml") == 2
    said = capsys.readouterr().err
    assert one_line(said) and "name = " in said
    assert {path.name for path in tmp_path.iterdir()} == {"mine.toml"}


def test_a_file_of_dots_names_no_folder_above(tmp_path, capsys):
    text = scene_text("rig-1dof").text.replace('name = "rig-1dof"\n', "")
    (tmp_path / "below").mkdir()
    Path("below", "...toml").write_text(text)
    assert beadwave("run", "below/...toml") == 2
    assert one_line(capsys.readouterr().err)
    assert {path.name for path in tmp_path.iterdir()} == {"below"}


# ---- two at once, and what is gone ---------------------------------------------------------------


def test_of_two_runs_into_one_folder_one_is_refused(capsys):
    folder = RunFolder(Path("out"))
    with folder.run("name = 'first'\n"):
        assert small("run", "rig-1dof", "--out=out") == 2
        said = capsys.readouterr().err
        assert "is being written by another run" in said and one_line(said)
        assert Path("out", "scene.toml").read_text() == "name = 'first'\n"
    assert small("run", "rig-1dof", "--out=out") == 0


HOLDING = """
from pathlib import Path
from types import SimpleNamespace
from beadwave.workflows.files.run_folder import RunFolder
folder = RunFolder(Path("out"))
with folder.run("name = 'first'"), folder.writing("rom.npz") as part:
    part.write_text("half")
    print("held", flush=True)
    input()
"""


@pytest.fixture
def killed():
    """A folder that a process left that was killed while it wrote."""
    command, pipe = [sys.executable, "-c", HOLDING], subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, start_new_session=True) as process:
        assert process.stdout.readline() == b"held\n"
        assert small("run", "rig-1dof", "--out=out") == 2
        parts = list(Path("out").glob(".beadwave-*"))
        assert [str(process.pid) in part.name for part in parts] == [True]
        process.kill()
    return parts[0]


def test_a_killed_run_leaves_no_lock_and_its_half_files_go(killed):
    assert killed.exists()
    assert small("run", "rig-1dof", "--out=out") == 0
    assert not killed.exists() and not Path("out", "rom.npz").exists()


def test_a_file_that_is_being_written_by_a_living_process_stays():
    Path("out").mkdir()
    alive, foreign = Path("out", ".beadwave-1-rom.npz"), Path("out", ".beadwave-notes-1")
    alive.touch()
    foreign.touch()
    assert small("run", "rig-1dof", "--out=out") == 0
    assert alive.exists() and foreign.exists()


def test_a_new_file_replaces_the_old_one_at_once(tmp_path):
    folder = RunFolder(tmp_path)
    target = folder.write("summary.json", "old")
    with folder.writing("summary.json") as path:
        path.write_text("new")
        assert target.read_text() == "old"
        written = path.stat().st_ino
    assert target.stat().st_ino == written


def test_a_file_appears_complete_or_not_at_all(tmp_path):
    folder = RunFolder(tmp_path)
    with pytest.raises(ZeroDivisionError), folder.writing("summary.json") as path:
        path.write_text("half")
        raise ZeroDivisionError
    assert not list(tmp_path.iterdir())


def test_a_folder_that_cannot_be_written_is_refused():
    Path("out", "scene.toml").mkdir(parents=True)
    with (
        pytest.raises(InvalidScene, match=r"out holds scene.toml"),
        RunFolder(Path("out")).run("x"),
    ):
        pass


# ---- the same manners elsewhere ------------------------------------------------------------------


OUTPUTS = {
    "modes --inp": ("modes", "mine.toml", "--inp=mine.toml"),
    "modes --step": ("modes", "mine.step", "--step=mine.step"),
    "reduce": ("reduce", "mine.npz", "--out=mine.npz"),
    "tune": ("tune", "mine.toml", "--out=mine.toml"),
    "tune --hammer": ("tune", "rig-rom", "--hammer=mine.csv", "--out=mine.csv"),
    "calibrate": ("calibrate", "rig-1dof", "d/signals.csv", "--out=d"),
    "accuracy": ("accuracy", "d/accuracy.csv", "--out=d"),
    "hammer": ("hammer", "mine.uff", "--synthetic"),
    "hammer, points": ("hammer", "mine.csv", "--points=d/modes.json", "--out=d"),
    "sweep": ("sweep", "rig-1dof", "--cases=d/signals.nc", "--out=d"),
}
SIGNAL = "time [s],sphere 1 [m/s]\n" + "\n".join(f"{i}e-6,{i % 7}e-3" for i in range(400))


@pytest.mark.parametrize("arguments", OUTPUTS.values(), ids=OUTPUTS)
def test_no_command_replaces_what_it_reads(arguments, monkeypatch, capsys):
    monkeypatch.setattr("beadwave.workflows.stages.engine.pipeline.Pipeline.__call__", None)
    monkeypatch.setattr("beadwave.workflows.structure.hammer.hammer_test", None)
    monkeypatch.setattr(
        "beadwave.workflows.structure.pairing.applied", lambda chosen, *_: (chosen, {1: 50.0})
    )
    identified = IdentifiedTest(SimpleNamespace(steps=[]), None, None)
    monkeypatch.setattr("beadwave.workflows.structure.hammer.hammer_test", lambda *_: identified)
    monkeypatch.setattr("beadwave.workflows.structure.pairing.measured_shapes", lambda _: None)
    Path("d").mkdir()
    for name in ("mine.toml", "mine.npz", "mine.step", "mine.csv", "mine.uff", "d/scene.toml",
                 "d/signals.csv", "d/walls.csv", "d/accuracy.csv", "d/modes.json"):  # fmt: skip
        read = SIGNAL if name == "d/signals.csv" else scene_text("rig-rom").text
        Path(name).write_text(read)
    Path("d/signals.nc").write_text("striker.velocity\n0.3\n")
    before = contents(".")
    for more in ((), ("--overwrite",))[: 1 + (arguments[-1] == "--out=d")]:
        assert beadwave(*arguments, *more) == 2
        said = capsys.readouterr().err
        assert one_line(said), said
        assert contents(".") == before
        if more:
            assert "would overwrite" in said, said


SINGLE = {
    "modes --inp": ("modes", "--inp=mine.inp"),
    "modes --step": ("modes", "--step=mine.step"),
    "reduce": ("reduce", "--out=mine.npz"),
    "reduce --matrices": ("reduce", "--out=rom.npz", "--matrices=mine.mat"),
    "tune": ("tune", "--out=mine.toml"),
    "tune, the usual name": ("tune", "rig-rom-907"),
    "look": ("look", "gearbox.step", "--scene=mine.toml"),
    "hammer": ("hammer", "mine.uff", "--synthetic"),
}
THEIRS = ("mine.inp", "mine.step", "mine.npz", "mine.mat", "mine.toml", "mine.uff",
          "rig-rom-907-tuned.toml", "gearbox.step")  # fmt: skip


@pytest.mark.parametrize("arguments", SINGLE.values(), ids=SINGLE)
def test_no_option_replaces_a_file_that_beadwave_did_not_write(arguments, monkeypatch, capsys):
    reached = []
    for place in ("stages.engine.pipeline.Pipeline.__call__", "structure.look.look",
                  "structure.tuning.tuned", "structure.export.write_model",
                  "structure.export.require_formats", "structure.hammer.virtual_test"):  # fmt: skip
        monkeypatch.setattr(
            f"beadwave.workflows.{place}", lambda *_, **__: reached.append(1) or 1 / 0
        )
    for name in THEIRS:
        Path(name).write_text("# mine\n")
    before = contents(".")
    assert beadwave(*arguments) == 2
    said = capsys.readouterr().err
    assert one_line(said) and "--overwrite" in said and not reached
    assert beadwave(*arguments, "--overwrite") == 1 and reached
    assert contents(".") == before


def written(path, content="ours", **how):
    with OutputFile(path, **how).writing() as part:
        part.write_text(content)
    return Path(path)


def test_a_file_that_was_written_and_not_changed_is_replaced_unasked():
    ours = written("a.toml")
    assert written("a.toml", "again").read_text() == "again"
    ours.write_text("changed by hand")
    with pytest.raises(InvalidScene, match="--overwrite"):
        OutputFile("a.toml")
    assert written("a.toml", "meant", overwrite=True).read_text() == "meant"
    assert written("a.toml").read_text() == "ours"
    assert [path.name for path in Path().iterdir()] == ["a.toml"]  # nothing lies beside it


def test_a_copy_of_what_was_written_is_its_owners():
    copied = written("a.toml").rename("b.toml")
    with pytest.raises(InvalidScene, match="--overwrite"):
        OutputFile(copied)


def test_a_file_that_appears_while_its_content_is_computed_stays():
    mine = OutputFile("a.toml")
    Path("a.toml").write_text("somebody's")
    with pytest.raises(InvalidScene, match="--overwrite"), mine.writing() as part:
        part.write_text("ours")
    assert Path("a.toml").read_text() == "somebody's"


def test_a_link_stays_a_link_to_what_is_written():
    Path("elsewhere").mkdir()
    Path("a.toml").symlink_to("elsewhere/b.toml")
    with pytest.raises(InvalidScene, match="no ordinary file"):
        OutputFile("a.toml")
    written("elsewhere/b.toml")
    written("a.toml", "through the link")
    assert Path("a.toml").is_symlink()
    assert Path("elsewhere/b.toml").read_text() == "through the link"


@pytest.mark.parametrize("cache", ["shared", "closed"])
def test_without_a_cache_of_ones_own_no_file_is_taken_for_ours(cache, monkeypatch):
    Path("shared").mkdir()
    Path("shared").chmod(0o777)  # where anybody could forge a note
    Path("closed").write_text("no folder")
    monkeypatch.setenv("BEADWAVE_CACHE_DIR", str(Path(cache).absolute()))
    written("a.toml")
    with pytest.raises(InvalidScene, match="--overwrite"):
        OutputFile("a.toml")


def test_a_file_that_cannot_be_written_is_named_as_the_user_did():
    # nothing can be made below /proc/self/fd, whoever asks
    with (
        pytest.raises(OSError) as refused,
        writing_file(Path("/proc/self/fd/a.toml")) as draft,
    ):
        draft.write_text("")
    assert refused.value.filename == "/proc/self/fd/a.toml"


def test_two_options_name_two_files(capsys):
    assert beadwave("reduce", "--out=a.mat", "--matrices=./a.mat") == 2
    assert "--out and --matrices both name" in capsys.readouterr().err


def test_studies_of_accuracy_stay_beside_each_other():
    def found(study, error, said):
        return Finding((table_of((AccuracyRow(study, "rkn6", 1e-6, error, 1e-4),)),), (said,))

    folder = RunFolder(Path("acc"))
    first, again = (found("time", error, f"{error}") for error in (2e-7, 3e-7))
    accuracy.write({"time": first}, folder)
    accuracy.write({"mesh": found("mesh", 1e-2, "finer")}, folder)
    accuracy.write({"time": again}, folder)
    kept = json.loads(Path("acc", "accuracy.json").read_text())
    assert {(row["study"], row["error"]) for row in kept["rows"]} == {
        ("time", 3e-7),
        ("mesh", 1e-2),
    }
    assert sorted(kept["findings"]) == ["3e-07", "finer"]
    assert Path("acc", "accuracy.csv").read_text().count("\n") == 3


def test_cases_are_refused_before_they_run_where_they_would_replace_a_file(monkeypatch, capsys):
    monkeypatch.setattr("beadwave.workflows.evidence.api._verdicts", None)
    Path("d").mkdir()
    Path("d", "stability.csv").write_text("mine")
    assert beadwave("stability", "--out=d") == 2
    assert "stability.csv" in capsys.readouterr().err


def test_a_device_is_no_file_to_replace():
    with pytest.raises(InvalidScene, match="no ordinary file"):
        OutputFile("/dev/null")


def test_a_file_alone_appears_complete_or_not_at_all(tmp_path):
    with pytest.raises(ZeroDivisionError), writing_file(tmp_path / "rom.npz") as part:
        part.write_text("half")
        raise ZeroDivisionError
    assert not list(tmp_path.iterdir())


FOREIGN = [b"\xff\x00\x1e theirs", b"[1, 2]\n", b'{"files": 3}', b"0123xyz\n"]


@pytest.mark.parametrize("content", FOREIGN)
def test_a_marker_that_somebody_else_wrote_stays_and_its_folder_is_refused(content, tmp_path):
    marker = tmp_path / MARKER
    marker.write_bytes(content)
    with pytest.raises(InvalidScene, match="which beadwave did not write; remove it or choose"):
        RunFolder(tmp_path).require("a.txt")
    assert marker.read_bytes() == content


@pytest.mark.parametrize("half", ["", "# What beadw", "\n0123abc", f"\n{64 * 'a'} "])
def test_half_a_line_of_a_killed_run_is_one_of_ours(half, tmp_path):
    (tmp_path / MARKER).write_text(half)
    RunFolder(tmp_path).require("a.txt")
