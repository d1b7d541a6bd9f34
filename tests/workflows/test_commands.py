"""Comfort of the command line: help, completion, progress, hints, `doctor`."""

import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from beadwave import system
from beadwave.workflows.commands import options, terminal
from beadwave.workflows.commands.app import COMMANDS, built, main
from beadwave.workflows.commands.examples import EXAMPLES
from beadwave.workflows.evidence import groups
from beadwave.workflows.files.scene import built_in

ROOT = Path(__file__).parents[2]
PIP_H5 = 'pip install "beadwave[h5]"'
SHORT = ("--set=chain.count=4", "--set=output.spheres=[1]", "--set=time.duration=0.2 ms")

pytestmark = pytest.mark.usefixtures("own_folder")


@pytest.fixture
def beadwave(monkeypatch, capfd):
    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["beadwave", *arguments])
        with pytest.raises(SystemExit) as end:
            main()
        out, err = capfd.readouterr()
        return end.value.code or 0, out, err

    return run


@pytest.mark.parametrize("command", COMMANDS)
def test_help_shows_examples_on_lines_of_eighty(command, beadwave):
    status, out, err = beadwave(command, "-h")
    assert status == 0 and err == ""
    assert all(f"  beadwave {line}" in out for line in EXAMPLES[command])
    assert all(len(line) <= 80 for line in out.splitlines() if "beadwave" not in line)


def test_examples_use_options_and_scenes_that_are_there():
    for name, lines in EXAMPLES.items():
        for line in lines:
            command, *words = line.split(" > ")[0].split(" | ")[0].split()
            assert command == name
            given = {word.partition("=")[0] for word in words if word.startswith("--")}
            assert given <= {option for p in built(name).params for option in p.opts}
            scenes = {word for word in words if re.fullmatch(r"rig-[\w-]+", word)}
            assert scenes <= set(built_in())


def test_help_names_what_options_take(beadwave):
    for command in ("accuracy", "stability", "verify"):
        assert "--list names them" in " ".join(beadwave(command, "-h")[1].split())
        names = [line.split()[0] for line in beadwave(command, "--list")[1].splitlines()]
        assert names == groups.names(command)
    assert "re_1, im_1" in beadwave("hammer", "-h")[1]


def test_version(beadwave):
    assert beadwave("--version") == (0, "beadwave 0.1.0\n", "")


@pytest.mark.parametrize(
    ("arguments", "meant"),
    [
        (("rnu",), "run"),
        (("stabilty",), "stability"),
        (("impact", "rig-rgid"), "rig-rigid"),
        (("impact", "rig-1dof", "--set=wall.frequecy=3"), "frequency"),
        (("impact", "--otu=d"), "--out"),
        (("accuracy", "--stage=tme"), "time"),
        (("stability", "--case=prelod"), "preload"),
        (("tune", "--free=haed.ky"), "head.ky"),
    ],
)
def test_a_mistyped_word_is_answered_by_the_one_that_was_meant(arguments, meant, beadwave):
    status, out, err = beadwave(*arguments)
    assert (status, out) == (2, "")
    assert err.count("\n") == 1 and meant in err


def test_quiet_leaves_files_and_warnings_alone(beadwave):
    status, out, err = beadwave("run", "rig-rigid", "--quiet", "--out=out", *SHORT)
    assert (status, out) == (0, "") and Path("out/report.html").is_file()
    assert all(line.startswith("warning: ") for line in err.splitlines())
    assert json.loads(beadwave("impact", "rig-rigid", "-q", "--json", *SHORT)[1])["n_steps"] > 0


def test_an_impact_says_where_it_wrote_and_leaves_no_empty_folder(beadwave):
    _, out, _ = beadwave("impact", "rig-rigid", "--out=out", *SHORT)
    assert "written: out/trajectory.npz" in out
    names = {path.name for path in Path("out").iterdir()}
    assert names == {
        ".beadwave", "given.toml", "scene.toml", "summary.json", "trajectory.npz"
    }  # fmt: skip


def test_completion_knows_scenes_keys_and_stages():
    assert options.scene_names("rig-rom") == ["rig-rom", "rig-rom-269", "rig-rom-907"]
    assert options.stage_names("me") == ["mesh"] and "preload" in options.case_names("p")

    for params, words in (({"scene": "rig-1dof"}, []), ({"scene": None}, ["rig-1dof"])):
        typed = SimpleNamespace(params=params, args=words)
        keys = options.dotted_keys(typed, "wall.")
        assert {"wall.frequency=", "wall.mass="} <= set(keys) and "wall.young=" in keys
        assert "striker.velocity=" in options.dotted_keys(typed, "stri")
    assert options.dotted_keys(SimpleNamespace(params={}, args=["none.toml"]), "wall.") == []


@pytest.mark.parametrize(
    ("line", "result"),
    [("run rig-1", "rig-1dof"), ("impact rig-1dof --set wall.freq", "wall.frequency=")],
)
def test_a_shell_completes(line, result, monkeypatch):
    words = f"beadwave {line}"
    for name, value in (
        ("_BEADWAVE_COMPLETE", "complete_bash"), ("COMP_WORDS", words),
        ("COMP_CWORD", str(len(words.split()) - 1)), ("_TYPER_COMPLETE_ARGS", words),
    ):  # fmt: skip
        monkeypatch.setenv(name, value)
    done = subprocess.run(
        [Path(sys.executable).parent / "beadwave"], capture_output=True, text=True, check=False
    )
    assert done.stdout.split() == [result]


def test_doctor_tells_what_is_missing_and_what_that_costs(beadwave, monkeypatch):
    from beadwave.workflows.installation import doctor

    def absent(name):
        raise doctor.PackageNotFoundError(name)

    monkeypatch.setattr(doctor, "version", absent)
    result = json.loads(beadwave("doctor", "--json")[1])
    missing = {name: (costs, remedy) for name, costs, remedy in result["missing"]}
    assert missing["h5py"][1] == "./install.sh h5" and ".h5" in missing["h5py"][0]
    assert result["cores"] > 0 and result["cache"].endswith("cache")
    out = beadwave("doctor")[1]
    assert "missing: h5py: reduced models cannot be read from or written to .h5" in out


@pytest.mark.parametrize(
    ("linux", "kind", "n"), [(True, "aarch64", 1), (True, "x86_64", 0), (False, "arm64", 0)]
)
def test_doctor_says_that_gmsh_has_no_wheel_for_linux_on_arm(linux, kind, n, beadwave, monkeypatch):
    from beadwave.workflows.installation import doctor

    monkeypatch.setattr(doctor, "machine", lambda: kind)
    monkeypatch.setattr(doctor, "LINUX", linux)
    monkeypatch.setattr("beadwave.workflows.stages.engine.cache._version", lambda name: None)
    missing = json.loads(beadwave("doctor", "--json")[1])["missing"]
    found = [costs for name, costs, _ in missing if name == "gmsh"]
    assert len(found) == n and all("no wheel for Linux on ARM" in costs for costs in found)
    assert linux or not any(
        remedy.startswith("apt-get") for name, _, remedy in missing if ".so" in name
    )


def test_doctor_knows_extras_that_there_are():
    from beadwave.workflows.installation.doctor import MISSING

    extras = (ROOT / "pyproject.toml").read_text()
    assert all(f"\n{extra} = " in extras for extra, _ in MISSING.values())


def test_a_command_runs_with_its_stderr_closed(tmp_path):
    done = subprocess.run(
        ["sh", "-c", f'"{sys.executable}" -m beadwave impact nonsense 2>&-'],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2 and done.stdout == ""


def test_a_terminal_shows_each_stage_and_the_time_that_counted_work_has_left(monkeypatch):
    from io import StringIO

    written = StringIO()
    written.isatty = lambda: True
    monkeypatch.setattr(sys, "stderr", written)
    clock = [0.0]
    with terminal.StageProgress() as progress:
        bars = progress._bars
        bars.get_time = lambda: clock[0]
        for task in bars.tasks:
            task._get_time = bars.get_time
        with progress.stage("mesh"):
            clock[0] = 3.0
        with progress.counted("cases") as count:
            for n_done in (0, 10, 20):
                count(n_done, 100)
                clock[0] += 2.0
            count(30, 100)
            bars.console.print(bars.get_renderable())
    text = written.getvalue()
    assert "mesh" in text and "cases: 30 of 100" in text
    assert "14 s left" in text  # 70 at 5 a second


def test_a_stage_says_one_line_where_nobody_watches_a_terminal(monkeypatch, capfd):
    """One that ends within a second says nothing."""
    for quiet in (False, True):
        monkeypatch.setattr(terminal, "PATIENCE", 0.05)
        text = ""
        with terminal.StageProgress(quiet=quiet) as progress:
            for n, stage in enumerate(("factor", "krylov-space"), start=1):
                with progress.stage(stage):
                    time.sleep(0.3)
                    while not quiet and text.count("\n") < n:  # on a busy machine it comes later
                        time.sleep(0.01)
                        text += capfd.readouterr().err
            monkeypatch.setattr(terminal, "PATIENCE", 60.0)  # which no busy machine takes for this
            with progress.stage("waves"):
                pass
        text += capfd.readouterr().err
        if quiet:
            assert text == ""
            continue
        assert text.splitlines() == [
            "beadwave: now factors of the stiffness (--quiet: no progress, no text).",
            "beadwave: now search for modes.",
        ]


def test_a_missing_hammer_file_is_told_before_anything_is_loaded(beadwave, monkeypatch):
    monkeypatch.setattr("beadwave.workflows.structure.api.load_scene", None)
    monkeypatch.setattr("beadwave.workflows.structure.api.load_scene", None)
    for arguments in (("hammer", "none.csv"), ("tune", "--hammer=none.csv")):
        status, _, err = beadwave(*arguments)
        assert status == 2 and "none.csv does not exist" in err


@pytest.mark.parametrize("text", ["secret = 'x'\n", "root:x:0:0\n", "", "[project]\nname = 'a'\n"])
@pytest.mark.parametrize("more", [(), ("--json",)])
def test_the_command_scene_prints_scenes_alone(text, more, beadwave):
    Path("any.txt").write_text(text)
    status, out, err = beadwave("scene", "any.txt", *more)
    assert (status, out) == (2, "") and err.startswith("beadwave: any.txt") and err.count("\n") == 1
    Path("mine.toml").write_text(f"# mine\n{built_in()['rig-rigid']}")
    status, out, err = beadwave("scene", "mine.toml", *more)
    assert status == 0 and ("striker" in out if more else out == Path("mine.toml").read_text())


def test_a_sentence_longer_than_a_terminal_is_folded_between_words_and_tables_are_not(monkeypatch):
    monkeypatch.setenv("COLUMNS", "40")
    terminal_like = SimpleNamespace(isatty=lambda: True)
    sentence = "the mesh makes mode 2 7.4 % too high, more than the fit misses."
    table = "mode  paired with      wanted [Hz]  fitted [Hz]"
    folded = terminal.folded(f"{table}\n{sentence}", terminal_like)
    assert folded.split("\n")[0] == table
    assert folded.split("\n")[1:] == [
        "the mesh makes mode 2 7.4 % too high,", "  more than the fit misses.",
    ]  # fmt: skip
    assert terminal.folded(sentence, SimpleNamespace(isatty=lambda: False)) == sentence


def test_without_a_command_a_sentence_says_so(beadwave):
    assert beadwave() == (2, "", "beadwave: a command is missing; `beadwave -h` lists them.\n")


def test_a_closed_output_is_no_error():
    code = "import sys; sys.stdout = None; from beadwave.workflows.commands.app import main; "
    code += "sys.argv = ['beadwave', 'scenes']; main()"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.skipif(sys.platform in ("darwin", "win32"), reason="names of files are text there")
def test_a_scene_whose_name_is_no_utf_8_is_run(beadwave):
    name = os.fsdecode(b"z\xff.toml")
    Path(name).write_text(built_in()["rig-rigid"], encoding="utf-8")
    status, _, err = beadwave("impact", name, *SHORT, "--out", "run", "--quiet")
    assert status == 0 and "Error" not in err
    assert r"'z\udcff.toml'" in Path("run/given.toml").read_text().splitlines()[0]


def test_an_extra_is_added_as_what_runs_was_installed(monkeypatch, tmp_path):
    """A wheel has no install.sh beside it."""
    assert system.adding("h5") == ("./install.sh h5" if system.LINUX else PIP_H5)
    monkeypatch.setattr(system, "__file__", str(tmp_path / "a" / "beadwave" / "system.py"))
    assert system.adding("h5") == PIP_H5
