"""Runs from the command to the folder: status, files, what is kept, what is loaded."""

import json
import re
import subprocess
import sys
from errno import EACCES, ENOSPC
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from beadwave import impact, run
from beadwave.workflows.files.scene import scene
from beadwave.workflows.stages.engine import cache
from beadwave.workflows.stages.engine import pipeline as stages

from command_line import beadwave

ROOT = Path(__file__).parents[2]
SMALL = ("chain.count=5", "output.spheres=[1,4]", "output.samples=201", "time.duration=0.5e-3")

pytestmark = pytest.mark.usefixtures("own_folder")


def small(command, name, *more):
    return beadwave(command, name, *(f"--set={change}" for change in SMALL), *more)


@pytest.mark.parametrize("name", ["rig-rigid", "free-chain", "rig-1dof", "rig-half-space"])
def test_a_run_fills_its_folder(name, tmp_path, capsys):
    assert small("run", name, "--out=out", "--json") == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == json.loads((tmp_path / "out" / "summary.json").read_text())
    assert printed["energy_error"] < 1e-6
    assert printed["error_estimate"]["time"] <= 1e-4
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {
        ".beadwave", "given.toml", "scene.toml", "summary.json", "trajectory.npz", "report.html",
        "figures",
    }  # fmt: skip


CONTRACT = {
    "scene", "modes_hz", "dofs", "n_wall_modes", "dt_s", "n_steps", "peak_wall_force_N",
    "contact_radius_m", "energy_error", "error_estimate", "waves", "stages", "warnings", "versions",
}  # fmt: skip
BESIDE = {
    "verdict", "reduction", "wall_contact", "command", "date", "modes",
    "seconds", "sensors", "sources", "load_factor", "errors", "friction", "synthetic",
    "error_spheres", "sphere_errors_m_s", "mesh", "crystal", "chains", "contact", "amplitudes",
}  # fmt: skip


def test_the_summary_has_the_keys_of_the_contract(capsys):
    small("impact", "rig-1dof", "--json")
    summary = json.loads(capsys.readouterr().out)
    assert set(summary) == CONTRACT | BESIDE
    assert set(summary["error_estimate"]) == {"time", "reduction", "mesh", "theory", "receptance"}
    assert set(summary["stages"][0]) == {"name", "seconds", "cached"}
    assert set(summary["waves"]) == {"1", "4"}


@pytest.mark.parametrize(("name", "n_contacts"), [("rig-1dof", 5), ("free-chain", 4)])
def test_the_trajectory_file_has_the_arrays_of_the_contract(name, n_contacts, tmp_path):
    small("impact", name, "--out=out")
    with np.load(tmp_path / "out" / "trajectory.npz") as trajectory:
        shapes = {key: trajectory[key].shape for key in trajectory.files}
    k = 201
    assert shapes.pop("x") == shapes.pop("v") == (k, 5)
    assert shapes.pop("contact_force") == (k, n_contacts)
    assert shapes.pop("error_x") == shapes.pop("error_v") == (5,)
    assert shapes.pop("error_contact_force") == (n_contacts,)
    if name == "rig-1dof":
        assert shapes.pop("wall_q") == (k, 1)
        assert shapes.pop("wall_omega") == shapes.pop("wall_phi") == (1,)
    assert set(shapes) == {
        "t", "wall_x", "wall_v", "energy_kinetic", "energy_contact", "energy_leaf", "energy_wall",
        "energy_residual", "dissipated_contact", "dissipated_wall", "work_preload", "energy_total",
        "dissipated_guides", "work_gravity",
    }  # fmt: skip
    assert set(shapes.values()) == {(k,)}


def test_the_step_follows_from_the_error_asked_for(capsys):
    steps = []
    for error in ("1e-2", "1e-7"):
        small("impact", "rig-half-space", f"--set=time.error={error}", "--json")
        summary = json.loads(capsys.readouterr().out)
        assert summary["error_estimate"]["time"] <= float(error)
        steps.append(summary["n_steps"])
    assert steps[0] < steps[1]


def test_a_step_longer_than_the_samples_lie_apart_is_told(capsys):
    small("impact", "rig-1dof", "--set=time={duration=1e-4, dt=2e-6}", "--set=output.samples=101")
    said = capsys.readouterr().err
    assert "time.dt = 2e-06 s is longer" in said and "1e-06 s" in said
    small("impact", "rig-1dof", "--set=time={duration=1e-4, dt=1e-6}", "--set=output.samples=101")
    assert "time.dt" not in capsys.readouterr().err


ASSEMBLY = (
    "gmsh", "skfem", "pyvista", "meshio", "scipy.sparse",
    "beadwave.geometry", "beadwave.fem", "beadwave.rom",
)  # fmt: skip
COARSE = (
    "mesh.seed=0.02", "mesh.block_seed=0.05", "mesh.support_seed=0.1", "mesh.contact_seed=0.012",
    "patch.radius=0.006", 'assembly.parts=["block","sheets"]', "reduction.modes=8",
)  # fmt: skip
SLOW = ("matplotlib", "scipy.optimize", "scipy.signal", "scipy.stats", "scipy.integrate")


def loads_nothing_of(absent, *command):
    code = (
        "import sys; from beadwave.workflows.commands.app import main\n"
        "try: main()\n"
        "except SystemExit as end: assert not end.code\n"
        f"found = {set(absent)} & set(sys.modules)\n"
        "assert not found, found"
    )
    changes = [f"--set={change}" for change in SMALL]
    program = [sys.executable, "-c", code, *command, *changes]
    done = subprocess.run(program, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rig-rigid", "free-chain"])
def test_a_scene_without_an_assembly_loads_nothing_of_one(name, tmp_path):
    loads_nothing_of(ASSEMBLY, "run", name, f"--out={tmp_path}/out")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "name", "more"),
    [
        ("run", "rig-rigid", ()),
        ("impact", "rig-1dof", ()),
        ("run", "rig-rom", COARSE),
    ],
)
def test_what_is_kept_loads_neither_the_march_nor_finite_elements(command, name, more, tmp_path):
    """A run whose results are kept takes a second, of which these libraries would be another."""
    out = [f"--out={tmp_path}/out"] if command == "run" else []
    sets = [f"--set={change}" for change in more]
    loads_nothing_of(("scipy.signal", "scipy.stats"), command, name, *sets, *out)
    ours = ("beadwave.fem", "beadwave.rom", "beadwave.coupling", "beadwave.dem")
    heavy = ("skfem", "gmsh", "meshio", "numba", "scipy", *ours)
    loads_nothing_of((*heavy, *SLOW), command, name, *sets, *out)


def test_what_is_kept_is_among_the_stages_that_are_not_computed(capsys):
    small("run", "rig-1dof", "--out=first", "--json")
    first = json.loads(capsys.readouterr().out)["stages"]
    small("run", "rig-1dof", "--out=second", "--json")
    second = json.loads(capsys.readouterr().out)["stages"]
    names = {stage["name"] for stage in first} - {"compilation"}  # there is nothing to compile for
    assert names == {stage["name"] for stage in second}
    assert not any(stage["cached"] for stage in first) and all(s["cached"] for s in second)


@pytest.mark.parametrize("name", ["rig-rigid", "rig-1dof"])
def test_an_impact_loads_no_library_that_fits_filters_or_draws(name):
    loads_nothing_of((*ASSEMBLY, *SLOW), "impact", name)


@pytest.mark.slow
def test_an_impact_that_is_kept_compiles_nothing():
    loads_nothing_of((), "impact", "rig-1dof")
    loads_nothing_of(("numba", *ASSEMBLY, *SLOW), "impact", "rig-1dof")


BAD = {
    "typo": ["--set=chain.cuont=3"],
    "text for a number": ["--set=chain.radius='a'"],
    "not a number": ["--set=chain.radius=nan"],
    "negative": ["--set=chain.radius=-1"],
    "no such option": ["--sett=1"],
}


@pytest.mark.parametrize("arguments", BAD.values(), ids=BAD)
def test_bad_input_is_one_sentence_and_leaves_nothing(arguments, tmp_path, capsys):
    assert beadwave("run", "rig-rigid", "--out=out", *arguments) == 2
    assert not (tmp_path / "out").exists()
    assert _one_line(capsys.readouterr().err)


@pytest.mark.parametrize("content", [None, "", "[chain", "name = 3"])
def test_a_bad_file_is_one_sentence_and_leaves_nothing(content, tmp_path, capsys):
    if content is not None:
        (tmp_path / "mine.toml").write_text(content)
    assert beadwave("run", "mine.toml", "--out=out") == 2
    assert not (tmp_path / "out").exists()
    assert _one_line(capsys.readouterr().err)


@pytest.mark.parametrize(
    ("file", "words"),
    [("no.npz", "no whole zip archive"), ("no.mat", "cannot be read as mat"), ("no.txt", "npz")],
)
def test_a_wall_that_is_no_reduced_model_leaves_nothing(file, words, tmp_path, capsys):
    (tmp_path / file).write_text("no model")
    assert small("run", "rig-1dof", f"--set=wall={{kind='rom', file='{file}'}}", "--out=out") == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_value_of_several_lines_is_no_value(capsys):
    assert small("run", "rig-1dof", "--set=time.error=1e-4\nextra=1", "--out=out") == 2
    assert "time.error" in capsys.readouterr().err


def _no_space(*_):
    raise OSError(ENOSPC, "No space left on device")


@pytest.mark.parametrize("other", ["--table=5.2", "--out=mac"])
def test_a_model_that_is_written_alone_drops_no_other_wish(other, capsys):
    assert beadwave("modes", "--inp=a.inp", other) == 2
    assert "drop --table and --out" in capsys.readouterr().err


def test_a_cache_that_cannot_be_written_is_told(tmp_path, monkeypatch, capsys):
    (tmp_path / "file").touch()
    monkeypatch.setenv("BEADWAVE_CACHE_DIR", str(tmp_path / "file"))
    assert small("impact", "rig-1dof") == 0
    assert "Nothing is kept for the next run" in capsys.readouterr().err


def _read_only(*_):
    raise PermissionError(EACCES, "Permission denied", "there/trajectory.npz")


def test_a_file_that_cannot_be_written_is_named(monkeypatch, capsys):
    monkeypatch.setattr("beadwave.workflows.files.run_folder.RunFolder.writing", _read_only)
    assert small("run", "rig-1dof", "--out=out") == 1
    said = capsys.readouterr().err
    assert "there/trajectory.npz: Permission denied; choose" in said and _one_line(said)


def test_a_full_disk_is_told_in_one_sentence(monkeypatch, capsys):
    monkeypatch.setattr("beadwave.workflows.files.run_folder.RunFolder.writing", _no_space)
    assert small("run", "rig-1dof", "--out=out") == 1
    said = capsys.readouterr().err
    assert "No space left on device; make room" in said and _one_line(said)


def test_a_cache_that_takes_no_more_is_passed_over_in_silence(monkeypatch, capsys, recwarn):
    monkeypatch.setattr("joblib.numpy_pickle.dump", _no_space)
    assert small("run", "free-chain", "--out=out") == 0
    said = capsys.readouterr().err
    assert "space" not in said and "joblib" not in said and not recwarn.list


NO_START = {
    "no end": ["time.duration=1e12 s"],
    "spheres of no size": ["chain.radius=1e-17 m"],
    "an error below rounding": ["time.error=1e-17"],
    "too long a step": ["time.dt=1"],
    "yields at rest": ["contact.law=thornton", "contact.yield_pressure=1e7", "preload.force=1e3"],
}


@pytest.mark.parametrize("command", ["run", "impact"])
@pytest.mark.parametrize("changes", NO_START.values(), ids=NO_START)
def test_a_chain_that_cannot_start_is_refused_before_a_folder_is_made(
    command, changes, tmp_path, capsys
):
    given = [f"--set={change}" for change in changes]
    assert small(command, "rig-rigid", "--out=out", *given) == 2
    assert not (tmp_path / "out").exists()
    assert _one_line(capsys.readouterr().err)


def _one_line(text):
    return text.startswith("beadwave: ") and text.count("\n") == 1 and "Traceback" not in text


def test_a_repeated_run_computes_nothing(capsys):
    small("run", "rig-1dof", "--json")
    small("run", "rig-1dof", "--json")
    first, again = capsys.readouterr().out.split("}\n{")
    again = json.loads("{" + again)
    assert '"cached": false' in first
    assert all(stage["cached"] for stage in again["stages"])


def test_a_damaged_entry_is_computed_again(tmp_path, capsys):
    small("run", "rig-1dof", "--json")
    for entry in (tmp_path / "cache").rglob("output.pkl"):
        entry.write_bytes(entry.read_bytes()[:40])
    capsys.readouterr()
    assert small("run", "rig-1dof", "--json") == 0
    printed = capsys.readouterr()
    assert not any(stage["cached"] for stage in json.loads(printed.out)["stages"])
    assert printed.err == ""


def test_without_a_writable_cache_a_run_works_all_the_same(monkeypatch, tmp_path):
    (tmp_path / "file").touch()
    monkeypatch.setenv("BEADWAVE_CACHE_DIR", str(tmp_path / "file" / "cache"))
    assert small("run", "rig-1dof") == 0


FUNCTION = {
    "wall": "beadwave.workflows.stages.chain.walls.wall_of",
    "impact": "beadwave.workflows.stages.chain.impact.impact",
    "figures": "beadwave.workflows.stages.pages.figures.of_chain",
}


def interrupted(*_):
    raise KeyboardInterrupt


@pytest.fixture
def loaded():
    """Every module of the stages: one that is imported amid a patch keeps it for ever."""
    for module in (ROOT / "workflows" / "stages").rglob("*.py"):
        name = ".".join(module.relative_to(ROOT).with_suffix("").parts)
        import_module(f"beadwave.{name.removesuffix('.__init__')}")


@pytest.mark.slow
@pytest.mark.usefixtures("loaded")
@pytest.mark.parametrize("stage", FUNCTION)
def test_an_interrupted_run_goes_on_where_it_stopped(stage, monkeypatch, tmp_path, capsys):
    with monkeypatch.context() as patch:
        patch.setattr(FUNCTION[stage], interrupted)
        assert small("run", "rig-1dof", "--out=out") == 130
    assert _one_line(capsys.readouterr().err)
    assert not (tmp_path / "out" / "summary.json").exists()
    assert not list((tmp_path / "out").rglob("*.part*"))
    assert small("run", "rig-1dof", "--out=out", "--json") == 0
    report = {s["name"]: s["cached"] for s in json.loads(capsys.readouterr().out)["stages"]}
    order = list(FUNCTION)
    assert [report[name] for name in order] == [
        order.index(name) < order.index(stage) for name in order
    ]


def key(stage, *changes):
    chosen = scene("rig-rom", changes)
    return stages.Pipeline(chosen, stages.Memory(None, verbose=0)).key(stage)


FE = (
    "mesh",
    "model",
    "modes",
    "reduction",
    "second-mesh",
    "full-response",
    "response",
    "pictures",
)


INTERRUPTED = """
import atexit, gc, sys
from beadwave.__main__ import main

class Interrupted:
    @property
    def main(self):
        raise KeyboardInterrupt

atexit.register(lambda: print("collected" if gc.isenabled() else "not collected"))
sys.modules["beadwave.workflows.commands.app"] = Interrupted()
main()
"""


def test_an_interrupt_while_the_program_loads_is_quiet():
    """In a process of its own, which `main` ends: it leaves signals to the program's handlers."""
    command = [sys.executable, "-P", "-c", INTERRUPTED]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 130 and _one_line(done.stderr)
    assert done.stdout == "collected\n"


@pytest.mark.parametrize(
    "change", ["chain.radius=0.01", "striker.velocity=1.0", "time.error=1e-5", "preload.force=3"]
)
def test_a_changed_chain_redoes_nothing_of_the_finite_elements(change):
    assert all(key(stage, change) == key(stage) for stage in FE)
    assert key("impact", change) != key("impact")


def test_the_time_that_a_mesh_may_take_redoes_nothing():
    assert all(key(stage, "mesh.seconds=7") == key(stage) for stage in (*FE, "impact"))


@pytest.mark.parametrize("name", ["rig-rigid", "rig-1dof"])
def test_spheres_that_no_wave_has_reached_list_none(name, capsys):
    """Their rounding had hundreds of peaks, of 1e-16 m/s and less."""
    assert beadwave("impact", name, "--set=time.duration=0.2 ms", "--json") == 0
    waves = json.loads(capsys.readouterr().out)["waves"]
    assert len(waves["4"]["arrivals"]) == 1 and not waves["14"]["arrivals"]
    assert waves["14"]["echo_delay_s"] is None


@pytest.mark.parametrize(
    ("change", "redone"),
    [
        ("assembly.sheet_width=0.064", set(FE)),
        ("assembly.young=200e9", set(FE)),
        (
            "patch.radius=0.0025",
            {"reduction", "second-mesh", "full-response", "response", "pictures"},
        ),
        ("reduction.modes=50", {"reduction", "response"}),
        ("damping.ratio=0.01", {"response"}),
    ],
)
def test_only_what_depends_on_a_change_is_redone(change, redone):
    assert {stage for stage in FE if key(stage, change) != key(stage)} == redone
    assert key("impact", change) != key("impact")


def test_an_edit_of_any_source_or_data_file_changes_every_key(monkeypatch, tmp_path):
    (tmp_path / "room").mkdir()
    files = [tmp_path / "room" / name for name in ("module.py", "scene.toml", "numbers.csv")]
    monkeypatch.setattr(cache, "PACKAGE", tmp_path)
    monkeypatch.setattr(cache, "fingerprint", cache.fingerprint.__wrapped__)
    keys = {(key("modes"), key("reduction"))}
    for file in files:
        for text in ("a = 1\n", "a = 2\n"):
            file.write_text(text)
            keys.add((key("modes"), key("reduction")))
    assert len(keys) == 7
    compiled = tmp_path / "room" / "__pycache__" / "code"
    compiled.mkdir(parents=True)
    (compiled / "march.json").write_text("{}")
    assert (key("modes"), key("reduction")) in keys


def test_another_version_of_the_program_computes_anew(monkeypatch):
    seen = {key("modes")}
    for own in ("another", "1"):
        monkeypatch.setattr(cache, "_version", {"beadwave": own}.get)
        seen.add(key("modes"))
    assert len(seen) == 3


def test_the_report_is_one_page_that_needs_no_other(tmp_path):
    small("run", "rig-1dof", "--out=out")
    page = (tmp_path / "out" / "report.html").read_text()
    assert page.count("data:image/png;base64,") == 3
    assert not re.findall(r'(?:src|href)="(?!data:|#)', page)
    (tmp_path / "out" / "report.html").unlink()
    assert beadwave("report", "out") == 0
    assert (tmp_path / "out" / "report.html").read_text() == page


def test_a_report_of_no_run_folder_is_refused(capsys):
    assert beadwave("report", "nowhere") == 2
    assert "nowhere" in capsys.readouterr().err


def test_scenes_are_listed_and_printed(capsys):
    assert beadwave("scenes") == 0
    listed = capsys.readouterr().out
    for name in ("rig-rom", "rig-1dof", "rig-half-space", "rig-rigid", "free-chain"):
        assert name in listed
        assert beadwave("scene", name) == 0
        assert f'name = "{name}"' in capsys.readouterr().out


def test_a_missing_scene_name_is_refused(capsys):
    assert beadwave("scene", "rig-rum") == 2
    assert "rig-rom" in capsys.readouterr().err


def test_the_summary_names_the_waves_and_states_the_blow_at_the_wall(capsys):
    """references.md, section 4: times and peaks of the chain on a rigid wall, in t_s and V."""
    assert beadwave("impact", "rig-rigid", "--json") == 0
    summary = json.loads(capsys.readouterr().out)
    arrivals = summary["waves"]["14"]["arrivals"]
    assert [a["name"] for a in arrivals[:2]] == ["incident", "reflected 1"]
    unit = 39.5e-6
    assert arrivals[1]["time_s"] == pytest.approx(24.1637 * unit, rel=2e-3)
    assert arrivals[1]["peak_velocity_m_s"] == pytest.approx(-0.65665 * 0.31, rel=1e-3)
    assert all(a["alone"] and a["quality"] > 0.95 for a in arrivals[:2])
    blow = summary["wall_contact"]
    assert blow["tof_s"] == pytest.approx(blow["contact_time_s"] + blow["travelling_time_s"])
    assert blow["velocity_sum_ratio_2_8"] == pytest.approx(1.36, abs=0.02)
    assert blow["energy_restitution"] == pytest.approx(1.0, abs=1e-3)
    # mean over the chain, whose ends are faster than the steady wave's 541 m/s
    assert blow["speed_in_m_s"] == pytest.approx(541, rel=0.02)
    assert blow["trains"][0]["name"] == "incident"


@pytest.mark.slow
def test_waves_that_cannot_be_told_apart_are_not_passed_on_in_silence(capsys):
    """Spheres of two sizes: no wave is solitary, and none is named."""
    sizes = ",".join(["0.01,0.005"] * 8 + ["0.01"])
    radii = f"--set=chain.radius=[{sizes}]"
    assert beadwave("run", "rig-rigid", radii, "--out=out") == 0
    said = capsys.readouterr().err
    assert "masses differ by a factor of 8" in said
    assert "waves at a sphere are the peaks of its velocity, without names" in said
    assert beadwave("run", "rig-rigid", "--out=out2") == 0
    said = capsys.readouterr().err
    assert "without names" not in said and "differ" not in said and "ends" not in said


def test_waves_between_samples_are_no_reason_for_a_longer_run(capsys):
    """A wave of some 0.1 ms is not seen by samples 0.3 ms apart, however many of them there are."""
    assert beadwave("impact", "rig-half-space", "--set=output.samples=11") == 0
    said = capsys.readouterr().err
    assert "output.samples = 11 leaves 0.0003 s between samples" in said
    assert "take a longer one" not in said


@pytest.mark.parametrize(
    ("duration", "told"),
    [
        (5e-5, "ends before a wave is at the wall"),
        (1e-3, "of the impact's energy more than at rest"),
    ],
)
def test_a_record_that_ends_too_early_is_told(duration, told, capsys):
    """The wave is at the wall after 0.8 ms, back at the striker after 1.7 ms."""
    changed = f"--set=time.duration={duration}"
    assert beadwave("run", "rig-half-space", changed, "--out=out", "--verbose") == 0
    said = capsys.readouterr()
    assert told in said.err
    assert "nan" not in said.out
    contact = json.loads(Path("out/summary.json").read_text())["wall_contact"]
    assert (contact["contact_time_s"] is None) == (duration < 1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["rig-rigid", "rig-1dof"])
def test_the_errors_of_numbers_hold_against_a_finer_march_and_record(scene):
    # twenty times as many instants and steps of a hundredth of the error: what is left of it is
    # a thousandth of that of the first run
    coarse, fine = (
        impact(scene, changes).summary
        for changes in ({}, {"time.error": 1e-8, "output.samples": 60001})
    )
    exact = {number.name: number.value for number in fine.errors}
    assert len(exact) >= 14
    for number in coarse.errors:
        assert number.total > 0
        assert abs(number.value - exact[number.name]) <= number.total, number


def test_a_file_holds_each_wave_once_with_its_error(tmp_path, capsys):
    # a structure's waves are printed before their errors are known: to stderr where stdout is none
    assert beadwave("impact", "cantilever", "--set=mesh.scale=3", "--out=out") == 0
    printed, told = capsys.readouterr()
    assert printed.count("time of flight TOF") == 1 and "±" in printed
    assert told.count("time of flight TOF") == 1 and "±" not in told


@pytest.mark.slow
def test_a_structure_without_a_chain_has_its_page(tmp_path):
    """Tables of the chain, `[output]` among them, are not there at all."""
    bar = tmp_path / "bar.toml"
    bar.write_text(
        'name = "bar"\nassembly = { held = ["bar:-x"], material = "steel" }\n'
        "bodies.bar.box = [0.1, 0.02, 0.02]\nmesh.scale = 2\n"
        'strike = { on = "bar:+z", radius = 2e-3 }\n'
    )
    run(bar, out=tmp_path / "run")
    assert (tmp_path / "run" / "report.html").is_file()
