"""Sweeps: which cases, each once and right, through kills and refusals, and what they depend on."""

import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import psutil
import pytest

import beadwave
from beadwave import Cases, InvalidScene, dem, rom
from beadwave.workflows.files.run_folder import RunFolder
from beadwave.workflows.report.tables import apart
from beadwave.workflows.stages.engine import cache
from beadwave.workflows.sweep import inputs, tasks
from beadwave.workflows.sweep import sweep as sweeping
from beadwave.workflows.sweep.cases import base_of
from beadwave.workflows.sweep.cluster import engine
from beadwave.workflows.sweep.core.design import Design
from beadwave.workflows.sweep.core.effects import sobol_effects
from beadwave.workflows.sweep.design_words import grid, sampled, table
from beadwave.workflows.sweep.result import opened
from beadwave.workflows.sweep.sweep_pictures import _spacing, curves

from command_line import beadwave as command

TWO = """
name = "two"
chain = { count = 6, radius = 0.005, density = 7800.0, young = 210e9, poisson = 0.3 }
striker = { velocity = 0.2 }
wall = { kind = "rom" }
damping = { kind = "modal", ratio = 0.002 }
time = { duration = 4e-4 }
output = { spheres = [1, 5], samples = 401 }
materials = { steel = { young = 210e9, poisson = 0.3, density = 7850.0 } }
strike = { on = "plate:+z", at = [0.0, 0.01], radius = 2e-3 }
[assembly]
held = ["base:-z"]
material = "steel"
[bodies]
base = { box = [0.06, 0.04, 0.02], seed = 0.02 }
plate = { box = [0.06, 0.04, 0.006], at = [0.0, 0.0, 0.013], seed = 0.02 }
[[joints]]
name = "bolt"
between = "plate|base"
at = [[-0.02, 0.0, 0.01], [0.02, 0.0, 0.01]]
washer = 5e-3
kz = 2e7
"""
SHORT = {"chain.count": 5, "output.spheres": [1, 4], "time.duration": 6e-4, "output.samples": 601}


WHERE = spec_from_file_location(
    "many_workers", Path(__file__).parents[2] / "examples" / "many_workers.py"
)
WORKERS = module_from_spec(WHERE)
WHERE.loader.exec_module(WORKERS)


@pytest.fixture(autouse=True)
def here(shared_cache):
    pass


def number(key, text):
    return float(text)


# --- which cases -------------------------------------------------------------------------------


def test_a_grid_has_every_combination_the_last_key_fastest():
    result = grid(("a.b=1:3:3", "c.d=2,5", "e.f=1:100:3:log"), number)
    assert result.n_cases == 18 and result.keys == ("a.b", "c.d", "e.f")
    assert result.case(0) == {"a.b": 1.0, "c.d": 2, "e.f": 1.0}
    assert result.columns["e.f"][:4] == pytest.approx((1.0, 10.0, 100.0, 1.0))
    assert result.columns["c.d"][2:7] == (2, 5, 5, 5, 2)
    assert len({tuple(result.case(i).values()) for i in range(18)}) == 18


def test_whole_numbers_stay_whole():
    result = grid(("chain.count=15:17:3", "a.b=1:2:3", "c.d=1.0:3.0:3"), number)
    kinds = {key: {type(value) for value in values} for key, values in result.columns.items()}
    assert kinds == {"chain.count": {int}, "a.b": {float}, "c.d": {float}}
    steps = grid(("chain.count=5:404:400",), number)  # steps of 1 that linspace does not round to
    assert steps.columns["chain.count"] == tuple(range(5, 405))


def test_a_pipe_is_no_table(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InvalidScene, match="no ordinary file"):
        table(tmp_path / "pipe", number)


def test_words_and_lists_are_values_too():
    result = grid(("wall.kind=rigid, half-space", "x.y=[1, 2], [3]"), number)
    assert result.columns["wall.kind"] == ("rigid", "rigid", "half-space", "half-space")
    assert result.columns["x.y"] == ([1, 2], [3], [1, 2], [3])


def test_units_are_read_by_the_key():
    base = base_of("rig-rigid", ())
    result = grid(("chain.radius=5mm:15mm:3",), base.number)
    assert result.columns["chain.radius"] == pytest.approx((0.005, 0.01, 0.015))
    result = grid(("chain.radius=14mm, 9 mm, 0.011", "wall.kind=rigid"), base.number)
    assert result.columns["chain.radius"] == pytest.approx((0.014, 0.009, 0.011))
    Path("cases.csv").write_text("chain.radius,wall.kind\n14mm,rigid\n9 mm,rigid\n0.011,rigid\n")
    result = table(Path("cases.csv"), base.number)
    assert result.columns["chain.radius"] == pytest.approx((0.014, 0.009, 0.011))
    assert result.columns["wall.kind"] == ("rigid",) * 3


def test_a_curve_over_one_of_two_keys_is_drawn_for_each_value_of_the_other():
    """Not one line through the cases of all of them; words count as values too."""
    mass, hz = np.repeat([1.0, 3.0], 3), np.tile([200.0, 400.0, 300.0], 2)
    lines = curves(mass * hz, hz, {"wall.mass [kg]": mass})
    assert [line.name for line in lines] == ["wall.mass = 1 kg", "wall.mass = 3 kg"]
    for line, m in zip(lines, (1.0, 3.0), strict=True):
        np.testing.assert_array_equal(line.x, [200.0, 300.0, 400.0])
        np.testing.assert_array_equal(line.y, m * line.x)
    words = curves(hz, hz, {"a": mass, "b": np.array(["x", "y", "x"] * 2)})
    assert [line.name for line in words] == [
        "a = 1, b = x",
        "a = 1, b = y",
        "a = 3, b = x",
        "a = 3, b = y",
    ]
    many = curves(hz, hz, {"c": np.arange(6.0) + np.arange(6) // 3})
    assert len(many) == 6 and curves(np.arange(9.0), np.arange(9.0), {"c": np.arange(9.0)}) is None


def test_a_latin_hypercube_has_one_value_in_each_slice():
    result = sampled(("a.b=1:5", "c.d=1:1000:log"), "lhs:40", 3, number)
    slices = (np.array(result.columns["a.b"]) - 1.0) / 4.0 * 40
    assert sorted(slices.astype(int)) == list(range(40))
    powers = np.log10(result.columns["c.d"]) / 3 * 40
    assert sorted(powers.astype(int)) == list(range(40))


def test_a_sobol_design_swaps_one_column_at_a_time():
    result = sampled(("a.b=0:1", "c.d=0:1", "e.f=0:1"), "sobol:8", 0, number)
    A, B, *mixed = np.array(list(result.columns.values())).T.reshape(5, 8, 3)
    for j, one in enumerate(mixed):
        assert np.array_equal(one[:, j], B[:, j])
        assert np.array_equal(np.delete(one, j, 1), np.delete(A, j, 1))


def test_a_table_is_read_as_it_stands(tmp_path):
    path = tmp_path / "cases.csv"
    path.write_text("wall.kind, striker.velocity\nrigid, 0.3\nhalf-space, 0.5\n\n")
    assert table(path, number).columns == {
        "wall.kind": ("rigid", "half-space"),
        "striker.velocity": (0.3, 0.5),
    }


@pytest.mark.parametrize(
    ("over", "sample", "says"),
    [
        ((), None, "needs keys to vary"),
        (("striker.velocity=300,400",), None, "all 2 cases are refused"),
        (("striker.velocity",), None, "is not key=values"),
        (("striker.velocity=6,",), None, "has an empty value"),
        (("striker.velocity=1,,2",), None, "has an empty value"),
        (("striker.velocity=1:2",), None, "start:stop:n"),
        (("striker.velocity=1:2:1",), None, "has one value"),
        (("striker.velocity=1:2:0",), None, "must be a number of values"),
        (("striker.velocity=1:1:3",), None, "two finite numbers that differ"),
        (("striker.velocity=0:1:3:log",), None, "between numbers above 0"),
        (("striker.velocity=1:nan:3",), None, "two finite numbers"),
        (("striker.velocity=1 kg:2 kg:3",), None, "a velocity is needed"),
        (("wall.kind=rigid:half-space:3",), None, "rigid"),
        (("striker.velocity=1,2", "striker.velocity=3,4"), None, "twice"),
        (("striker..velocity=1,2",), None, "no dotted key"),
        (("striker.velocity=1,2", "striker={velocity = 3}"), None, "one undoes the other"),
        (("wall={kind = 'rigid'}", "wall.kind=rigid"), None, "both wall and wall.kind"),
        (("striker.drop=1cm,2cm", "striker.velocity=1,2"), None, "one undoes the other"),
        (("time.error=1e-3,1e-4", "time.dt=1e-7,2e-7"), None, "one undoes the other"),
        (("preload.force=1:2", "preload.force.x=1:2"), "lhs:3", "one undoes the other"),
        (("striker.velocity=1:2:4000", "chain.young=1:2:4000"), None, "16000000 cases"),
        (("striker.velocty=1,2",), None, "unknown key 'velocty'"),
        (("output.samples=10,20",), None, "cannot vary"),
        (("name=a,b",), None, "cannot vary"),
        (("striker.velocity=1:2:3",), "lhs:9", "low:high"),
        (("striker.velocity=1:2",), "sobol:9", "take 8 or 16"),
        (("striker.velocity=1:2",), "monte-carlo:9", "lhs:n or sobol:n"),
        (("striker.velocity=1:2",), "lhs:1000000000", "between 2 and 10000000"),
    ],
)
def test_bad_designs_are_refused_in_a_sentence(over, sample, says):
    with pytest.raises(InvalidScene, match=says):
        beadwave.sweep("rig-rigid", cases=Cases(over, sample), out="out")
    assert not Path("out").exists()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("striker.velocity\n", "1 lines"),
        ("striker.velocity,striker.velocity\n1,2\n", "twice"),
        ("striker.velocity,chain.young\n1\n", "line 2 has 1 values for 2 keys"),
        ("striker velocity.,x\n1,2\n", "no dotted key"),
        ("striker.velocity,striker\n0.2,{velocity=0.3}\n", "one undoes the other; vary one of"),
        ("time,chain.young,time.error\n{},2e11,1e-4\n", "both time and time.error"),
        ("reduction.cutoff,reduction.modes\n9e3,7\n", "one undoes the other"),
    ],
)
def test_bad_tables_are_refused_in_a_sentence(tmp_path, text, says):
    path = tmp_path / "cases.csv"
    path.write_text(text)
    with pytest.raises(InvalidScene, match=says):
        beadwave.sweep("rig-rigid", cases=Cases(table=path), out="out")
    assert path.read_text() == text


CELLS = {
    "24 digits": "987654321098765432109876",
    "above 64 bits": "-9223372036854775809",
    "400 digits": "7" * 400,
    "4400 digits": "7" * 4400,
    "a huge exponent": "3e999",
    "no number": "nan",
    "infinite": "-inf",
    "empty": "",
    "a word": "quick",
    "two lines": '"0.2\nunusual = 1"',
    "a list": '"[0.2, 0.3]"',
    "a day": "2001-01-01",
}


@pytest.mark.parametrize(
    ("key", "sound", "cells"),
    [("chain.radius", 0.0127, CELLS), ("chain.count", 5, ["24 digits"])],
    ids=["chain.radius", "chain.count"],
)
def test_a_cell_that_is_no_value_of_its_key_refuses_its_row_alone(key, sound, cells):
    values = [value for cell in cells for value in (CELLS[cell], sound)]
    lines = [f"{key},contact.coefficient", f"{sound},0", *(f"{value},0" for value in values)]
    Path("cases.csv").write_text("\n".join(lines) + "\n")
    result = beadwave.sweep("rig-rigid", SHORT, cases=Cases(table="cases.csv"), out="out")
    assert result.columns["status"].tolist() == ["done"] + ["refused", "done"] * len(cells)
    messages = result.columns["message"][1::2]
    assert all(key in message and message.count("\n") == 0 for message in messages)
    assert len(beadwave.load_sweep("out").columns[key]) == 1 + 2 * len(cells)


def test_whole_numbers_above_those_of_a_float_are_rows_beside_fractions():
    over = {"chain.young": "2.5e11,9007199254740993,210000000000"}
    result = beadwave.sweep("rig-rigid", SHORT, cases=over, out="out")
    assert result.columns["status"].tolist() == ["done", "refused", "done"]
    assert result.columns["chain.young"].tolist() == [2.5e11, 2.0**53, 2.1e11]


def test_a_sweep_that_observes_the_striker_alone_says_why_it_has_no_echo():
    changes = SHORT | {"output.spheres": [1]}
    result = beadwave.sweep("rig-rigid", changes, over={"striker.velocity": [0.1, 0.2]}, out="out")
    (note,) = result.notes
    assert note.startswith("Only sphere 1 is observed.") and "output.spheres = [1, 5]" in note
    result = beadwave.sweep("rig-rigid", SHORT, over={"striker.velocity": [0.1, 0.2]}, out="two")
    assert result.notes == ()


def test_a_table_shows_units_of_keys_and_no_more_digits_than_errors_support():
    """The echo ratio of elastic spheres does not depend on the speed; its error is below 1e-4."""
    over = {"striker.velocity": [0.1, 0.2, 0.4]}
    result = beadwave.sweep("rig-rigid", SHORT, over=over, out="out")
    (heading, *rows) = (line.split("  ") for line in result.text().splitlines()[2:])
    assert heading[0] == "striker.velocity [m/s]"
    ratios = {[cell for cell in row if cell][2].strip() for row in rows}
    assert 1e-6 < result.columns["error_time"].max() < 1e-4
    (ratio,) = ratios
    assert len(ratio) <= len("0.9633")


def test_cases_that_are_all_alike_are_rows_each():
    Path("cases.csv").write_text("chain.count,wall.kind\n5,rigid\n6,rigid\n5,rigid\n")
    result = beadwave.sweep("rig-rigid", SHORT, cases=Cases(table="cases.csv"), out="out")
    force = result.columns["wall_peak_force_N"]
    assert result.counts() == {"done": 3} and force[0] == force[2] != force[1]


@pytest.mark.parametrize(
    "over",
    [
        {"contact.coefficient": "0,0.2,0.3"},
        {"contact.coefficient": "0,0.2", "chain.count": "5,5"},
        {"preload.mass": "0,0.1"},
    ],
    ids=str,
)
def test_cases_that_differ_in_an_ignored_key_are_a_row_each(over):
    changes = SHORT | {"preload.force": 0.0}
    result = beadwave.sweep("rig-rigid", changes, cases=over, out="out")
    assert result.counts() == {"done": result.design.n_cases}


@pytest.mark.parametrize("digits", [30, 5000])
def test_numbers_of_many_digits_are_no_numbers_of_cases(digits):
    n = "8" * digits
    for over, sample, says in (
        (f"striker.velocity=0.1:0.2:{n}", None, "must be a number of values up to"),
        ("striker.velocity=0.1:0.2", f"lhs:{n}", "between 2 and"),
    ):
        with pytest.raises(InvalidScene, match=says):
            beadwave.sweep("rig-rigid", cases=Cases((over,), sample), out="out")


def test_whole_numbers_of_a_range_stay_numbers_where_a_float_skips_some():
    values = grid(("a.b=1:1000000000000000000000000:3",), number).columns["a.b"]
    assert values == pytest.approx((1.0, 5e23, 1e24))


@pytest.mark.parametrize(
    ("changes", "over"),
    [
        (("striker.velocity=0.4",), "striker={velocity = 0.3}"),
        (("striker.velocity=0.4",), "striker.drop=1cm,2cm"),
        ({"preload": {"mass": 0.1, "force": 5.0}}, "preload={force = 7.0}"),
        (("time.dt=1e-7",), "time.error=1e-3,1e-4"),
    ],
    ids=str,
)
def test_a_change_that_the_cases_would_undo_is_refused(changes, over):
    key = over.partition("=")[0]
    for computed in (beadwave.sweep, beadwave.sweep_price):
        with pytest.raises(InvalidScene, match=f"^{key} varies, which undoes --set .*; drop one"):
            computed("rig-rigid", changes, cases=Cases((over,)))
    assert not Path("sweeps").exists()


def test_a_change_of_a_swept_key_holds_for_the_scene_alone():
    """A wall of another kind needs values, also where they vary."""
    wall = {"kind": "1dof", "mass": 9.0, "frequency": 200.0, "damping_ratio": 0.1}
    over = {"wall.mass": "1,2", "wall.frequency": [300.0]}
    result = beadwave.sweep("rig-rigid", SHORT | {"wall": wall}, cases=over, out="out")
    assert result.counts() == {"done": 2} and result.notes == tuple(
        f"--set {key} is of the scene alone: the cases vary it" for key in over
    )


@pytest.mark.slow
def test_the_kind_of_a_wall_drops_none_of_its_keys_that_vary():
    Path("cases.csv").write_text(
        "wall.young,wall.poisson,wall.kind\n70 GPa,0.3,half-space\n400 GPa,0.3,half-space\n"
    )
    cases = Cases(table="cases.csv")
    result = beadwave.sweep("rig-rom", SHORT, cases=cases, out="out")
    force = result.columns["wall_peak_force_N"]
    assert result.counts() == {"done": 2} and force[1] > 1.01 * force[0]


# --- each case right ---------------------------------------------------------------------------

PARTS = {
    "rigid": ("rig-rigid", {"preload.force": 5.0, "preload.mass": 0.0}, {"preload.force": "1,30"}),
    "free": ("free-chain", {}, {"chain.young": "150e9,220e9"}),
    "half-space": ("rig-half-space", {}, {"wall.young": "70e9,400e9"}),
    "one mass": ("rig-1dof", {}, {"wall.frequency": "200,900", "wall.mass": "1,3"}),
    "damped": (
        "rig-half-space",
        {"contact.dissipation": "hunt-crossley", "contact.coefficient": 0.3},
        {"contact.coefficient": "0.1,0.5", "chain.density": "7000,8000"},
    ),
    "plate": ("rig-half-space", {"wall.kind": "dashpot", "wall.coefficient": 900.0}, {}),
}


@pytest.mark.slow
@pytest.mark.parametrize("part", PARTS)
def test_cases_side_by_side_are_the_runs_alone(part):
    scene, changes, over = PARTS[part]
    over = {"striker.velocity": "0.2,0.4", **over}
    result = beadwave.sweep(scene, SHORT | changes, cases=over, out="out", signals=True)
    assert set(result.counts()) == {"done"}
    signals = result.signals()
    for i in range(result.design.n_cases):
        case = result.design.case(i)
        alone = beadwave.impact(scene, SHORT | changes | case)
        speed = case["striker.velocity"]
        seen = alone.arrays["v"][:, [0, 3]]
        assert np.abs(signals["v"].values[i] - seen).max() < 2e-4 * speed
        waves = alone.summary.waves["4"]
        if waves.echo_delay_s:
            assert result.columns["sphere_4_echo_delay_s"][i] == pytest.approx(
                waves.echo_delay_s, rel=2e-3
            )
            assert result.columns["sphere_4_echo_ratio"][i] == pytest.approx(
                waves.echo_ratio, rel=2e-3
            )
        if part != "free":
            peak = alone.summary.peak_wall_force_N
            assert result.columns["wall_peak_force_N"][i] == pytest.approx(peak, rel=2e-3)
        assert result.columns["error_time"][i] < 1e-4
        assert result.columns["energy_error"][i] < 1e-3


def test_other_numbers_of_spheres_are_other_groups(monkeypatch):
    over = {"chain.count": "5,6", "wall.kind": "rigid,half-space", "striker.velocity": "0.2,0.3"}
    calls = []
    monkeypatch.setattr(sweeping, "rows", lambda *a: calls.append(a[0].group.cases) or original(*a))
    result = beadwave.sweep("rig-rigid", SHORT, cases=over, out="out")
    assert sorted(calls) == [(0, 1), (2, 3), (4, 5), (6, 7)]
    assert (result.columns["wall_peak_force_N"] > 0).all()
    alone = beadwave.impact("rig-rigid", SHORT | result.design.case(7))
    peak = alone.summary.peak_wall_force_N
    assert result.columns["wall_peak_force_N"][7] == pytest.approx(peak, rel=1e-3)


original = sweeping.rows


def test_a_case_that_is_refused_or_fails_is_a_row():
    over = {"wall.mass": "-1,1", "preload.force": "0,1,1e9"}
    result = beadwave.sweep("rig-1dof", SHORT, cases=over, out="out")
    status = result.columns["status"].tolist()
    assert status[:3] == ["refused"] * 3 and status[3:5] == ["done"] * 2
    assert status[5] != "done"
    message = result.columns["message"].tolist()
    assert "wall.mass = -1 must be greater than 0" in message[0] and message[3] == ""
    assert np.isnan(result.columns["sphere_4_echo_ratio"][:3]).all()


def test_a_failing_case_does_not_spoil_the_cases_of_its_march(monkeypatch):
    own = dem.march_batch

    def march(chains, **options):
        if (chains.v0 > 0.5).any():
            raise dem.UnstableStep("too fast to march")
        return own(chains, **options)

    monkeypatch.setattr(dem, "march_batch", march)
    result = beadwave.sweep("rig-rigid", SHORT, cases={"striker.velocity": "0.1:0.7:7"}, out="out")
    assert result.columns["status"].tolist() == ["done"] * 5 + ["failed"] * 2
    assert result.columns["message"][5] == "too fast to march"
    assert np.isnan(result.columns["wall_peak_force_N"][5:]).all()


# --- what cases share --------------------------------------------------------------------------


@pytest.fixture
def counted(monkeypatch):
    made = []
    own = sweeping.models
    monkeypatch.setattr(sweeping, "models", lambda source: made.append(source) or own(source))
    return made


@pytest.mark.slow
def test_cases_share_their_reduced_model(counted, monkeypatch):
    over = {"wall.cutoff": "5e3,2e4", "striker.velocity": "0.1,0.2"}
    Path("two.toml").write_text(TWO)
    result = beadwave.sweep("two.toml", cases=over, out="out")
    assert len(counted) == 1 and set(result.counts()) == {"done"}
    alone = beadwave.impact("two.toml", result.design.case(3)).summary
    got = result.columns["wall_peak_force_N"][3]
    assert got == pytest.approx(alone.peak_wall_force_N, rel=1e-3)
    assert result.columns["error_reduction"][0] > 0 and result.columns["error_mesh"][0] > 0
    worst = 100 * result.columns["error_mesh"].max()
    monkeypatch.setattr("beadwave.workflows.sweep.result.LARGE_ERROR", 1e-9)
    note = next(note for note in beadwave.load_sweep("out").notes if "of the mesh" in note)
    assert f"speed in 4 of 4 cases, {worst:.2g} % at the worst" in note


@pytest.mark.slow
def test_springs_of_joints_share_one_reduced_model(counted):
    over = {"joints.bolt.kz": "1e6:1e9:7:log"}
    Path("two.toml").write_text(TWO)
    result = beadwave.sweep("two.toml", cases=over, out="out")
    assert len(counted) == 1 and counted[0].springs == ("bolt.kz",)
    peaks = result.columns["wall_peak_force_N"]
    assert len(np.unique(peaks)) == 7
    for i in (0, 6):
        alone = beadwave.impact("two.toml", result.design.case(i)).summary
        stated = result.columns["error_reduction"][i] + alone.error_estimate.reduction
        assert abs(peaks[i] / alone.peak_wall_force_N - 1.0) < 2 * stated < 1e-3
        waves = alone.waves["5"]
        assert result.columns["sphere_5_echo_ratio"][i] == pytest.approx(
            waves.echo_ratio, rel=2 * stated
        )


@pytest.mark.slow
def test_a_rigid_direction_has_a_model_of_its_own(counted):
    over = {"joints.bolt.kz": "1e7,inf"}
    Path("two.toml").write_text(TWO)
    beadwave.sweep("two.toml", cases=over, out="out")
    assert [source.springs for source in counted] == [(), ()]


# --- each case once ----------------------------------------------------------------------------


@pytest.mark.slow
def test_a_sweep_that_was_stopped_goes_on(monkeypatch):
    monkeypatch.setattr(tasks, "CHUNK", 4)
    over = {"striker.velocity": "0.1:1:20"}
    whole = beadwave.sweep("rig-rigid", SHORT, cases=over, out="whole")

    def stop(done, n):
        if done >= 8:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        beadwave.sweep("rig-rigid", SHORT, cases=over, out="out", told=stop)
    computed = []
    monkeypatch.setattr(
        sweeping, "rows", lambda *a: computed.extend(a[0].group.cases) or original(*a)
    )
    result = beadwave.sweep("rig-rigid", SHORT, cases=over, out="out")
    assert sorted(computed) == list(range(8, 20))
    for name, values in whole.columns.items():
        if name not in ("seconds", "status", "message"):
            np.testing.assert_allclose(result.columns[name], values, 1e-13, 1e-15, err_msg=name)
    assert not list(Path("out").glob("part-*"))
    computed.clear()
    again = beadwave.sweep("rig-rigid", SHORT, cases=over, out="out")
    assert computed == [] and again.design.n_cases == 20


@pytest.mark.slow
def test_failed_cases_stay_until_again_recomputes_them(monkeypatch):
    own, marched, over = dem.march_batch, [], {"striker.velocity": "0.1:0.7:7"}

    def march(chains, **options):
        marched.extend(chains.v0[:, 0].tolist())
        if (chains.v0 > 0.5).any():
            raise dem.UnstableStep("too fast to march")
        return own(chains, **options)

    def swept(again=False):
        marched.clear()
        cases = Cases(over, again=again)
        return beadwave.sweep("rig-rigid", SHORT, cases=cases, out="out", signals=True)

    with monkeypatch.context() as older:
        older.setattr(dem, "march_batch", march)
        assert swept().notes == ()
    monkeypatch.setattr(
        dem, "march_batch", lambda c, **o: marched.extend(c.v0[:, 0]) or own(c, **o)
    )
    kept = swept()
    assert kept.counts() == {"done": 5, "failed": 2} and marched == []
    assert kept.notes == ("2 cases failed before and are kept so; --again computes them again",)
    before = kept.signals()["v"].to_numpy()
    result = swept(again=True)
    assert result.counts() == {"done": 7} and min(marched) > 0.5
    assert result.notes == ("5 of 7 cases were there already",)
    assert np.array_equal(result.columns["wall_peak_s"][:5], kept.columns["wall_peak_s"][:5])
    v = result.signals()["v"].to_numpy()
    assert np.array_equal(v[:5], before[:5]) and np.abs(v).max(axis=(1, 2)) == pytest.approx(
        result.columns["striker.velocity"], rel=1e-6
    )
    assert not list(Path("out").glob("part-*"))
    assert swept(again=True).counts() == {"done": 7} and marched == []


def test_a_stopped_sweep_goes_on_with_failed_cases_where_asked(monkeypatch):
    monkeypatch.setattr(tasks, "CHUNK", 2)
    own, over = dem.march_batch, {"striker.velocity": "0.7:0.1:6"}
    seen = []

    def march(chains, **options):
        if (chains.v0 > 0.5).any():
            raise dem.UnstableStep("too fast to march")
        return own(chains, **options)

    def stop(done, n):
        if done >= 4:
            raise KeyboardInterrupt

    with monkeypatch.context() as older, pytest.raises(KeyboardInterrupt):
        older.setattr(dem, "march_batch", march)
        beadwave.sweep("rig-rigid", SHORT, cases=over, out="out", told=stop)
    cases = Cases(over, again=True)
    result = beadwave.sweep(
        "rig-rigid", SHORT, cases=cases, out="out", told=lambda done, n: seen.append(done)
    )
    assert seen[0] == 2 and result.counts() == {"done": 6}


def test_other_cases_or_another_scene_are_computed_anew(monkeypatch):
    one = beadwave.sweep("rig-rigid", SHORT, cases={"striker.velocity": "0.1,0.2"}, out="out")
    two = beadwave.sweep("rig-rigid", SHORT, cases={"striker.velocity": "0.1,0.3"}, out="out")
    assert two.design.case(1) == {"striker.velocity": 0.3}
    changes = SHORT | {"chain.radius": 0.01}
    three = beadwave.sweep("rig-rigid", changes, cases={"striker.velocity": "0.1,0.3"}, out="out")
    assert three.columns["wall_peak_force_N"][0] < one.columns["wall_peak_force_N"][0]


def test_other_cases_of_a_scene_get_a_folder_of_their_own():
    first, other = {"striker.velocity": "0.1,0.2"}, {"striker.velocity": "0.1,0.3"}
    one = beadwave.sweep("rig-rigid", SHORT, cases=first)
    before = (one.folder / "cases.parquet").read_bytes()
    two = beadwave.sweep("rig-rigid", SHORT, cases=other)
    assert (one.notes, one.folder.name) == ((), "rig-rigid")
    assert (
        two.folder.name == "rig-rigid-2" and (one.folder / "cases.parquet").read_bytes() == before
    )
    assert two.notes == (f"{one.folder} is left as it is: it holds another run",)
    assert beadwave.sweep("rig-rigid", SHORT, cases=first).folder == one.folder


@pytest.mark.slow
@pytest.mark.parametrize("command", ["sweep", "run", "impact"])
def test_a_note_says_that_a_table_was_replaced(command):
    swept = {"striker.velocity": "0.1,0.2"}
    assert beadwave.sweep("rig-rigid", SHORT, cases=swept, out="out").notes == ()
    assert beadwave.sweep("rig-rigid", SHORT, cases=swept, out="out").notes == ()
    more = {"cases": {"preload.force": "1,2"}} if command == "sweep" else {}
    result = getattr(beadwave, command)("rig-rigid", SHORT, **more, out="out")
    assert result.notes == ("replaced: what an earlier run of rig-rigid left in out",)


def test_a_case_counts_as_done_once_its_signals_are_there(monkeypatch):
    """Ended between the two files of a part."""
    over, written, parts = {"striker.velocity": "0.1,0.2"}, RunFolder.writing, []

    def full(self, name):
        parts.extend([name] if name.startswith("part-") else [])
        if len(parts) == 2:
            raise OSError("no space")
        return written(self, name)

    with monkeypatch.context() as disk, pytest.raises(OSError, match="no space"):
        disk.setattr(RunFolder, "writing", full)
        beadwave.sweep("rig-rigid", SHORT, cases=over, out="out", signals=True)
    result = beadwave.sweep("rig-rigid", SHORT, cases=over, out="out", signals=True)
    assert np.abs(result.signals()["v"].values).max(axis=(1, 2)) == pytest.approx([0.1, 0.2])


def test_a_sweep_that_is_stopped_keeps_the_finished_one_and_its_own_cases(monkeypatch):
    old, new = {"striker.velocity": "0.1,0.2"}, {"striker.velocity": "0.3,0.4"}
    beadwave.sweep("rig-rigid", SHORT, cases=old, out="out")
    finished = {p: p.read_bytes() for p in Path("out").rglob("*") if p.is_file()}
    with monkeypatch.context() as ended, pytest.raises(KeyboardInterrupt):
        ended.setattr(
            "beadwave.workflows.sweep.api._draw",
            lambda *_: (_ for _ in ()).throw(KeyboardInterrupt),
        )
        beadwave.sweep("rig-rigid", SHORT, cases=new, out="out")
    parts = list(Path("out").glob("part-*"))
    left = {p: p.read_bytes() for p in Path("out").rglob("*") if p.is_file() and p not in parts}
    marker = Path("out", ".beadwave")
    assert left.pop(marker).startswith(finished.pop(marker)) and left == finished and parts
    monkeypatch.setattr("beadwave.workflows.sweep.sweep.rows", None)
    result = beadwave.sweep("rig-rigid", SHORT, cases=new, out="out")
    assert result.counts() == {"done": 2} and not list(Path("out").glob("part-*"))
    assert beadwave.load_sweep("out").columns["striker.velocity"].tolist() == [0.3, 0.4]


def test_cases_side_by_side_need_no_observed_sphere():
    over, none = {"striker.velocity": [0.1, 0.2]}, SHORT | {"output.spheres": []}
    assert beadwave.sweep("free-chain", none, cases=over, out="free").counts() == {"done": 2}
    result = beadwave.sweep("rig-rigid", none, cases=over, out="out", signals=True)
    assert result.counts() == {"done": 2} and result.signals()["v"].sizes["sphere"] == 0
    seen = beadwave.sweep("rig-rigid", SHORT, cases=over, out="seen").columns
    peaks = result.columns["wall_peak_force_N"] / seen["wall_peak_force_N"]
    assert np.abs(peaks - 1.0).max() < 1e-4  # errors of both


@pytest.mark.slow
def test_springs_with_units_share_a_model_as_numbers_do(counted):
    Path("two.toml").write_text(TWO)
    result = beadwave.sweep("two.toml", cases={"joints.bolt.kz": ["1e7 N/m"]}, out="out")
    assert result.counts() == {"done": 1}
    assert [one.springs for one in counted] == [("bolt.kz",)]


# --- rows of the files that are there ----------------------------------------------------------


def wall_of(path, stiffness):
    """A reduced model of six equal masses as a wall's file."""
    K = stiffness * (2 * np.eye(6) - np.eye(6, k=1) - np.eye(6, k=-1))
    rom.save_npz(path, rom.full_order(K, 0.4 * np.eye(6), np.eye(6)[0]))


def by_wall(*files):
    """Changes for a wall of the first file, and cases over all of them."""
    wall = {"kind": "rom", "file": files[0], "half_space": 0.0}
    return SHORT | {"wall": wall}


TABLE = '{ kind = "rom", file = "b.npz", half_space = 0.0 }'
NAMED_BY = {
    "the scene": (by_wall("b.npz"), {"striker.velocity": "0.2,0.3"}),
    "a list": (by_wall("a.npz"), {"wall.file": "b.npz,a.npz"}),
    "a table": (SHORT, {"wall": TABLE}),
    "a CSV": (by_wall("a.npz"), Cases(table="cases.csv")),
}


def test_the_files_of_cases_are_those_of_the_scene_and_those_of_every_value(tmp_path):
    for name in ("a.npz", "b.npz", "c.npz", "one.unv"):
        wall_of(tmp_path / name, 2e8)
    scene = tmp_path / "mine.toml"
    changes = "\n".join(["[chain]", "count = 3", "radius = 0.01", "density = 7800.0"])
    scene.write_text(
        f"{changes}\nyoung = 2e11\npoisson = 0.3\n[striker]\nvelocity = 0.2\n"
        '[wall]\nkind = "rom"\nfile = "a.npz"\nhalf_space = 0.0\n'
    )
    columns = {
        "wall.file": ("b.npz", "a.npz", "b.npz"),
        "striker.velocity": ("0.3 m/s", 1, 2.0),
        "assembly": ({"step": "c.npz", "parts": ["sheets"]},) * 3,
        "targets": ([{"hz": 3.0, "shape": "one.unv"}, {"hz": 5.0}],) * 3,
        "mesh.file": ("gone.msh",) * 3,
    }
    result = inputs.files_of_cases(base_of(str(scene), ()), Design("table", columns))
    names = ["a.npz", "b.npz", "c.npz", "one.unv", "gone.msh"]
    assert result == [tmp_path / name for name in names]


@pytest.mark.slow
@pytest.mark.parametrize("named_by", NAMED_BY)
def test_a_table_is_computed_anew_once_the_file_of_a_wall_is_another(named_by):
    wall_of("a.npz", 2e8), wall_of("b.npz", 3e7)
    Path("cases.csv").write_text("wall.file, striker.velocity\na.npz,0.2\nb.npz,0.2\n")
    changes, cases = NAMED_BY[named_by]

    def swept():
        return beadwave.sweep("rig-1dof", changes, cases=cases, out="out")

    old = swept()
    assert "replaced" not in str(old.notes) and set(old.counts()) == {"done"}
    assert swept().columns["seconds"].tolist() == old.columns["seconds"].tolist()
    wall_of("b.npz", 5e9)
    new = swept()
    assert new.notes[-1] == (
        "replaced: the table in out, since a file that it was made of changed, or the program did"
    )
    change = new.columns["wall_peak_force_N"] / old.columns["wall_peak_force_N"] - 1.0
    assert np.abs(change).max() > 0.05
    assert swept().notes == old.notes


def test_a_stopped_sweep_does_not_go_on_with_rows_of_a_file_that_is_another(monkeypatch):
    monkeypatch.setattr(tasks, "CHUNK", 2)
    wall_of("a.npz", 2e8)
    over, changes = {"striker.velocity": "0.1:0.5:6"}, by_wall("a.npz")

    def stop(done, n):
        if done >= 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        beadwave.sweep("rig-1dof", changes, cases=over, out="out", told=stop)
    assert list(Path("out").glob("part-*"))
    wall_of("a.npz", 3e7)
    result = beadwave.sweep("rig-1dof", changes, cases=over, out="out")
    whole = beadwave.sweep("rig-1dof", changes, cases=over, out="whole")
    force = result.columns["wall_peak_force_N"]
    np.testing.assert_allclose(force, whole.columns["wall_peak_force_N"], 1e-13)
    assert not list(Path("out").glob("part-*"))


@pytest.mark.parametrize("after", [2, 6], ids=["amid", "at the end"])
def test_a_file_that_changes_while_a_sweep_runs_ends_it_in_a_sentence(after, monkeypatch):
    monkeypatch.setattr(tasks, "CHUNK", 2)
    wall_of("a.npz", 2e8)
    first = Path("a.npz").read_bytes()
    over, changes = {"striker.velocity": "0.1:0.5:6"}, by_wall("a.npz")

    def replaced(done, n):
        if done == after:
            wall_of("a.npz", 3e7)

    with pytest.raises(ValueError, match=r"a.npz changed while its cases were computed; put"):
        beadwave.sweep("rig-1dof", changes, cases=over, out="out", told=replaced)
    assert not Path("out", "cases.parquet").exists()
    Path("a.npz").write_bytes(first)
    computed = []
    monkeypatch.setattr(
        sweeping, "rows", lambda *a: computed.extend(a[0].group.cases) or original(*a)
    )
    result = beadwave.sweep("rig-1dof", changes, cases=over, out="out")
    assert result.counts() == {"done": 6} and len(computed) == 6 - after


def test_a_table_is_computed_anew_by_another_program(monkeypatch):
    over = {"striker.velocity": "0.1,0.2"}
    old = beadwave.sweep("rig-rigid", SHORT, cases=over, out="out")
    for name in ("fingerprint", "library_versions"):
        with monkeypatch.context() as other:
            other.setattr(cache, name, lambda *_: "of another program")
            new = beadwave.sweep("rig-rigid", SHORT, cases=over, out="out")
        assert new.notes and (new.columns["seconds"] != old.columns["seconds"]).all()


KILLED = """
import beadwave, os, signal
from beadwave.workflows.sweep import tasks
tasks.CHUNK = 5
def told(done, n):
    if done >= 10:
        os.kill(os.getpid(), signal.SIGKILL)
beadwave.sweep("rig-rigid", {short}, cases={{"striker.velocity": "0.1:1:30"}}, out="out", told=told)
"""


@pytest.mark.slow
def test_a_killed_sweep_loses_nothing_that_was_done():
    script = KILLED.format(short=SHORT)
    command = [sys.executable, "-c", script]
    ended = subprocess.run(command, timeout=600, capture_output=True, start_new_session=True)
    assert ended.returncode == -signal.SIGKILL, ended.stderr
    assert sorted(path.name for path in Path("out").glob("*.parquet"))
    seen = []
    result = beadwave.sweep(
        "rig-rigid", SHORT, cases={"striker.velocity": "0.1:1:30"}, out="out",
        told=lambda done, n: seen.append(done),
    )  # fmt: skip
    assert seen[0] == 10 and result.columns["case"].tolist() == list(range(30))
    assert set(result.counts()) == {"done"}


# --- processes ---------------------------------------------------------------------------------


@pytest.mark.slow
def test_processes_leave_the_same_table_though_one_is_killed(monkeypatch):
    over = {"chain.count": "4,5,6,7", "striker.velocity": "0.1,0.2"}
    changes = SHORT | {"output.spheres": [1, 3]}
    here = beadwave.sweep("rig-rigid", changes, cases=over, out="here")
    base, killed = base_of("rig-rigid", changes), []
    cases = grid(tuple(f"{key}={values}" for key, values in over.items()), number)
    with engine(2) as run:
        result = {}
        for parts in run(tasks.sharings(base, cases, list(range(8)), False)):
            for part in parts:
                result.update(zip(part.cases, part.columns["wall_peak_force_N"], strict=True))
            if not killed:
                killed.append(_kill_a_worker())
    # to the last digits: memory that lies elsewhere may sum in another order
    expected = here.columns["wall_peak_force_N"]
    np.testing.assert_allclose([result[i] for i in range(8)], expected, rtol=1e-13)


def _kill_a_worker():
    from distributed import get_client

    pids = list(get_client().run(os.getpid).values())
    os.kill(pids[0], signal.SIGKILL)
    while Path(f"/proc/{pids[0]}").exists():  # until its nanny has heard of it
        time.sleep(0.01)
    return pids[0]


def test_a_scheduler_that_ends_fails_no_case():
    from distributed import LocalCluster

    base = base_of("rig-rigid", SHORT | {"output.spheres": [1, 3]})
    cases, result = grid(("chain.count=4,5,6,7,8,9,10,11",), number), []
    other = LocalCluster(n_workers=1, processes=False, dashboard_address=None)
    with (
        pytest.raises(ValueError, match="goes on with the cases that are missing"),
        engine(other.scheduler_address) as run,
    ):
        for parts in run(tasks.sharings(base, cases, list(range(8)), False)):
            result += [status for part in parts for status in part.columns["status"]]
            other.close()
    assert result and set(result) == {"done"}


def test_a_scheduler_without_workers_is_warned_of_and_waited_for(caplog):
    from distributed import LocalCluster

    base, cases = base_of("rig-rigid", SHORT), grid(("chain.count=4,5",), number)
    with LocalCluster(n_workers=0, processes=False, dashboard_address=None) as other:
        with engine(other.scheduler_address) as run:
            assert f"{other.scheduler_address} has no workers" in caplog.text
            other.scale(1)
            result = [
                part for parts in run(tasks.sharings(base, cases, [0, 1], False)) for part in parts
            ]
    assert sorted(case for part in result for case in part.cases) == [0, 1]


def test_values_of_many_kinds_are_a_column_of_words():
    each = ["0.0", "[0.0, 0.0, 0.0, 0.0, 0.0]", "0.1"]
    cases = {"contact.coefficient": ",".join(each)}
    result = beadwave.sweep("rig-rigid", SHORT, cases=cases, out="out")
    assert result.columns["contact.coefficient"].tolist() == each
    assert result.counts() == {"done": 3}


def test_no_process_at_all_is_refused():
    with pytest.raises(InvalidScene, match="0 processes; give 1 to"):
        beadwave.sweep("rig-rigid", SHORT, cases={"striker.velocity": "0.1,0.2"}, on=0)


def test_a_scheduler_that_does_not_answer_is_told(monkeypatch):
    monkeypatch.setattr("beadwave.workflows.sweep.cluster.PATIENCE", "1s")
    with pytest.raises(InvalidScene, match=r"tcp://127.0.0.1:1 does not answer"):
        beadwave.sweep(
            "rig-rigid", SHORT, cases={"striker.velocity": "0.1,0.2"}, on="tcp://127.0.0.1:1"
        )


@pytest.fixture
def silent():
    """The address of a port that takes connections and never answers."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield f"127.0.0.1:{server.getsockname()[1]}"


@pytest.mark.parametrize(
    ("scheme", "says"),
    [
        ("tls://", "needs certificates"),
        ("tcp://", "does not answer"),
        ("ws://", "does not answer"),
        ("ucx://", "does not answer"),
        ("no-such-scheme://", "is no address"),
        ("tcp://[", "is no address"),
    ],
)
def test_an_address_without_a_scheduler_is_refused_in_a_sentence(
    scheme, says, silent, monkeypatch, capfd
):
    monkeypatch.setattr("beadwave.workflows.sweep.cluster.PATIENCE", "500ms")
    over = "--over=striker.velocity=0.3,0.4"
    assert command("sweep", "rig-rigid", over, "--out=out", f"--scheduler={scheme}{silent}") == 2
    said = capfd.readouterr().err
    assert said.startswith(f"beadwave: --scheduler {scheme}{silent} {says}")
    assert said.count("\n") == 1 and not Path("out").exists()


@pytest.mark.parametrize("address", ["localhost", "tcp://host:port", "tcp://a b:8786", "8786"])
def test_an_address_without_host_and_port_is_refused_before_it_is_tried(address):
    with pytest.raises(InvalidScene, match=r"is no address; give scheme, host and port"):
        beadwave.sweep("rig-rigid", SHORT, cases={"striker.velocity": "0.1,0.2"}, on=address)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--workers=0",), "--workers"),
        (("--workers=-3",), "--workers"),
        (("--workers=12345678",), "12345678 processes; give 1 to"),
        (("--workers=2", "--scheduler=tcp://127.0.0.1:1"), "give one of them"),
    ],
)
def test_impossible_numbers_of_processes_are_refused_in_a_sentence(words, says, capfd):
    over = "--over=striker.velocity=0.3,0.4"
    assert command("sweep", "rig-rigid", over, "--out=out", *words) == 2
    said = capfd.readouterr().err
    assert says in said and said.count("\n") == 1 and not Path("out").exists()


def test_processes_of_a_sweep_listen_to_this_machine_alone():
    before = listening()  # schedulers of other tests may take a moment to end
    with engine(1):
        result = listening() - before
    assert len(result) >= 4 and {host for host, _ in result} == {"127.0.0.1"}


def listening():
    """Addresses (host, port) at which this process and its children listen."""
    this, every = psutil.Process(), []
    for process in [this, *this.children(recursive=True)]:
        with suppress(psutil.NoSuchProcess):  # a child of another test, which has ended since
            every += process.net_connections()
    return {(c.laddr.ip, c.laddr.port) for c in every if c.status == "LISTEN"}


# --- what outputs depend on --------------------------------------------------------------------


@pytest.mark.slow
def test_sobol_indices_are_those_of_the_power_law():
    """A chain on a half-space of its own material, nothing else: ln TOF = c + 0.4 ln m - 0.4 ln A
    - 0.2 ln V, with m ~ R^3 rho and A ~ R^(1/2): R^1, rho^0.4, V^-0.2."""
    over = {
        "chain.radius": "0.010:0.014:log",
        "chain.density": "5000:9000:log",
        "striker.velocity": "0.1:1:log",
    }
    result = beadwave.sweep(
        "rig-half-space", {"time.duration": 4e-3}, cases=Cases(over, "sobol:128"), out="out"
    )
    effects = result.effects("sphere_14_echo_delay_s", logarithm=True)
    share = (np.array([1.0, 0.4, -0.2]) * np.log([1.4, 1.8, 10.0])) ** 2
    share /= share.sum()
    both = (effects.first, effects.first_error), (effects.total, effects.total_error)
    for index, error in both:
        assert (np.abs(index - share) < 3 * error + 1e-3).all()
        assert (error < 0.15).all()
    assert effects.used == 128
    text = result.text()
    assert "first order" in text and "chain.radius" in text


def ishigami(n):
    """A Sobol design of three keys from -pi to pi, and y = sin a + 7 sin^2 b + 0.1 c^4 sin a."""
    over = [f"{key}={-np.pi!r}:{np.pi!r}" for key in ("k.a", "k.b", "k.c")]
    design = sampled(over, f"sobol:{n}", 0, number)
    a, b, c = map(np.array, design.columns.values())
    return design, np.sin(a) + 7 * np.sin(b) ** 2 + 0.1 * c**4 * np.sin(a)


def test_standard_errors_are_the_same_at_every_call_and_fall_with_the_root_of_the_samples():
    coarse, fine = (sobol_effects(*ishigami(n)) for n in (256, 4096))
    again = sobol_effects(*ishigami(256))
    assert all(np.array_equal(*pair) for pair in zip(coarse[:4], again[:4], strict=True))
    for one, other in zip(coarse[2:4], fine[2:4], strict=True):
        assert ((2.5 < one / other) & (one / other < 6.0)).all()


@pytest.mark.parametrize("lost", [0, 5])
def test_indices_are_those_of_ishigami(lost):
    """T. Ishigami and T. Homma (1990): 0.3139, 0.4424, 0 and 0.5576, 0.4424, 0.2437; also where
    cases are missing, so that the samples are no power of 2."""
    design, y = ishigami(1024)
    y[:lost] = np.nan
    result = sobol_effects(design, y)
    assert result.used == 1024 - lost
    for index, right in (
        (result.first, (0.3139, 0.4424, 0.0)),
        (result.total, (0.5576, 0.4424, 0.2437)),
    ):
        assert np.abs(index - right).max() < 0.02


def test_outputs_within_the_error_of_a_run_have_no_sobol_indices():
    design, y = ishigami(64)
    share = (y - y.min()) / np.ptp(y)
    assert sobol_effects(design, 1.0 - 1.1e-5 * share).used == 64
    with pytest.raises(ValueError, match="values differ by more than 1e-05"):
        sobol_effects(design, 1.0 - 0.9e-5 * share)


def test_standard_errors_are_the_spread_over_designs():
    """Of the first key's index over designs that differ in their random numbers alone."""
    result, design = [], Design("sobol", {key: (0.0,) * 384 for key in ("k.a", "k.b")}, 96)
    for seed in range(60):
        A, B = np.random.default_rng(seed).random((2, 2, 96))
        y = [a + 2 * b * a for a, b in (A, B, (B[0], A[1]), (A[0], B[1]))]
        result.append(sobol_effects(design, np.concatenate(y)))
    for index, error in (("first", "first_error"), ("total", "total_error")):
        spread = np.std([getattr(one, index) for one in result], axis=0)
        stated = np.mean([getattr(one, error) for one in result], axis=0)
        assert ((0.6 < stated / spread) & (stated / spread < 1.7)).all()


def test_indices_need_a_design_for_them():
    result = beadwave.sweep("rig-rigid", SHORT, cases={"striker.velocity": "0.1,0.2"}, out="out")
    with pytest.raises(InvalidScene, match="--sample sobol:n"):
        result.effects("sphere_4_echo_delay_s")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("over", "sample"),
    [
        ({"striker.velocity": "0.1:0.4:4"}, None),
        ({"striker.velocity": "0.1:0.4:3", "chain.young": "1e11:2e11:10"}, None),
        ({"striker.velocity": "0.1:0.4:9", "chain.young": "1e11:2e11:10"}, None),
        ({"striker.velocity": "0.1:0.4:3", "wall.kind": "rigid,half-space"}, None),
        ({"striker.velocity": "0.1:0.4", "chain.young": "1e11:2e11", "chain.density": "7e3:8e3"},
         "lhs:20"),
    ],
)  # fmt: skip
def test_every_design_has_pictures_of_its_main_outputs(over, sample):
    result = beadwave.sweep("rig-rigid", SHORT, cases=Cases(over, sample), out="out")
    names = {path.name for path in Path("out/figures").iterdir()}
    assert names == {
        "sphere_4_echo_delay_s.png",
        "sphere_4_echo_ratio.png",
        "wall_peak_force_N.png",
    }
    assert result.plot("energy_error", (next(iter(over)),)).png.startswith(b"\x89PNG")
    with pytest.raises(InvalidScene, match="'sphere_4_tof' is not in the sweep"):
        result.plot("sphere_4_tof")


def test_a_table_with_former_names_of_the_echo_is_read_by_those_of_today():
    import pyarrow.parquet as pq

    result = beadwave.sweep("rig-rigid", SHORT, cases={"striker.velocity": "0.2,0.3"}, out="out")
    former = {"echo_delay_s": "tof_s", "echo_ratio": "arr"}
    path = result.folder / "cases.parquet"
    table = pq.read_table(path)
    names = table.column_names
    for today, name in former.items():
        names = [n.replace(f"_{today}", f"_{name}") for n in names]
    assert "sphere_4_tof_s" in names and "sphere_4_arr" in names
    pq.write_table(table.rename_columns(names).replace_schema_metadata(table.schema.metadata), path)
    assert opened(result.folder).columns.keys() == result.columns.keys()


def test_axes_are_logarithmic_for_values_spaced_by_factors():
    for low, high in ((1, 50), (0.1, 1000)):
        assert _spacing(np.geomspace(low, high, 20)) == "x"
        assert _spacing(np.linspace(low, high, 20)) == ""
    assert _spacing(np.geomspace(1, 10, 20)) == _spacing(np.array([1.0, 100.0])) == ""


@pytest.mark.slow
def test_numbers_on_a_terminal_tell_the_cases_apart():
    assert apart([0.00034304, 0.000343, np.nan, 0.00034]) == [
        "0.00034304", "0.00034300", "-", "0.00034000",
    ]  # fmt: skip
    assert apart([648.61, 649.1]) == ["648.6", "649.1"] and apart([1.0, 2.0]) == ["1", "2"]
    assert apart([12345.4, 12345.6, 12.0]) == ["12345", "12346", "12"]
    assert apart([1.0, 1.0 + 1e-9, 1.1]) == ["1", "1", "1.1"]  # beyond what is computed
    for few in (4, 60):
        over = {"wall.young": f"200e9:201e9:{few}"}
        result = beadwave.sweep("rig-half-space", SHORT, cases=over, out=f"out-{few}")
        heading, *lines = (line.split() for line in result.text().splitlines()[2:])
        shown = (
            [line[heading.index("sphere_4_echo_delay_s")] for line in lines]
            if few == 4
            else next(line for line in lines if line[0] == "sphere_4_echo_delay_s")[1:]
        )
        assert len(set(shown)) == len(shown) > 2


@pytest.mark.parametrize(("mark", "name"), [(";", "semicolons"), ("\t", "tabs")])
def test_cases_that_no_commas_separate_are_refused_with_what_does(tmp_path, mark, name):
    file = tmp_path / "cases.csv"
    file.write_text(f"striker.velocity{mark}preload.force\n0.1{mark}5\n")
    with pytest.raises(InvalidScene, match=f"has {name} between its values; write commas"):
        beadwave.sweep("rig-rigid", SHORT, cases=Cases(table=file))


def test_a_table_is_read_by_others(tmp_path):
    import pandas

    beadwave.sweep("rig-rigid", SHORT, cases={"striker.velocity": "0.1,0.2"}, out="out")
    frame = pandas.read_parquet("out/cases.parquet")
    assert frame["striker.velocity"].tolist() == [0.1, 0.2]
    assert beadwave.load_sweep("out").data()["status"].tolist() == ["done", "done"]
    with pytest.raises(InvalidScene, match=r"cases\.parquet does not exist"):
        beadwave.load_sweep(tmp_path / "nothing")
    Path("out/cases.parquet").write_bytes(b"PAR1 rubbish PAR1")
    with pytest.raises(InvalidScene, match="is no table of a sweep"):
        beadwave.load_sweep("out")


def test_the_price_of_many_cases_comes_from_a_sample():
    cases = {"chain.count": "5:404:400", "striker.velocity": "0.1:1:500"}
    price = beadwave.sweep_price("rig-rigid", SHORT, cases=cases)
    assert (price.cases, price.walls, price.side_by_side) == (200_000, 400, 200_000)
    half = {"contact.dissipation": "none,no-such", "chain.count": "5:304:300"}
    some = beadwave.sweep_price("rig-rigid", SHORT, cases=half)
    assert some.refused == some.walls == some.side_by_side == 300


def test_the_price_of_refused_cases_is_their_sentence():
    long = {"chain.count": "900000:1000000:5"}
    with pytest.raises(InvalidScene, match=r"all 5 cases are refused; .* allowed are 1e\+08"):
        beadwave.sweep_price("rig-rigid", cases=long)
    base, few = SHORT | {"wall.kind": "half-space"}, {"chain.count": "4,5,900000"}
    price = beadwave.sweep_price("rig-rigid", base, cases=few)
    assert price.refused == 1 and "900000" in price.notes[0]


def test_the_price_of_walls_that_fail_says_why(tmp_path):
    Path("two.toml").write_text(TWO)
    cases = {"striker.velocity": "0.1,0.2"}
    price = beadwave.sweep_price("two.toml", {"bodies.plate.seed": 5e-5}, cases=cases)
    assert price.refused == 0 and "take a seed above" in price.notes[0]


def test_a_price_estimates_cases_walls_and_seconds():
    over = {"wall.kind": "rigid,half-space", "striker.velocity": "0.1:1:50"}
    price = beadwave.sweep_price("rig-rigid", SHORT, cases=over)
    assert price.cases == 100 and price.walls == 2 and price.side_by_side == 100
    assert 0 < price.seconds < 30 and price.refused == 0
    assert not Path("sweeps").exists()


@pytest.mark.parametrize("law, said", [("linear-clipped", 1), ("hunt-crossley", 0)])
def test_the_price_says_which_laws_are_marched_chain_by_chain(law, said):
    changes = SHORT | {"contact.dissipation": law, "contact.coefficient": 0.01}
    price = beadwave.sweep_price("rig-rigid", changes, cases={"striker.velocity": "0.1,0.2"})
    assert (
        len([note for note in price.notes if f'"{law}" is marched chain by chain' in note]) == said
    )


def test_the_example_of_many_workers_measures_what_dask_spends(capfd):
    with WORKERS.waiting_workers(3) as client:
        assert len(client.nthreads()) == 3
        began = time.perf_counter()
        result = WORKERS.seconds_of_a_task(client, 0.05, 12)
        elapsed = time.perf_counter() - began
    assert 0.05 / 3 <= result.clock < elapsed / 12 and 0.0 < result.processor < 1.0
    assert capfd.readouterr() == ("", "")  # workers and scheduler end without a complaint


@pytest.mark.parametrize(
    ("words", "status", "says"),
    [
        (["10", "ten"], 2, "'ten' is not a number of workers; give 10 100, for example.\n"),
        (["-3"], 2, "'-3' is not a number of workers; give 10 100, for example.\n"),
        (["10000000"], 1, "10000000 workers open 100000010 files, this system allows "),
    ],
)
def test_the_example_of_many_workers_refuses_in_a_sentence(words, status, says, capsys):
    with pytest.raises(SystemExit) as ended:
        WORKERS.main(WORKERS.counts(words))
    printed, code = capsys.readouterr().err, ended.value.code
    if isinstance(code, str):  # which Python prints, and ends with 1
        printed, code = f"{code}\n", 1
    assert code == status and printed.startswith(says) and printed.count("\n") == 1


def test_the_example_measures_rates():
    where = Path(__file__).parents[2] / "examples" / "sweep_rates.py"
    spec = spec_from_file_location("sweep_rates", where)
    rates = module_from_spec(spec)
    spec.loader.exec_module(rates)
    cores = os.sched_getaffinity(0)
    began = time.perf_counter()
    of_a_sweep = rates.seconds_of_a_sweep("rig-rigid", 2, 1)
    assert 0.0 < of_a_sweep < time.perf_counter() - began
    assert os.sched_getaffinity(0) == cores
    began = time.perf_counter()
    of_a_task = rates.seconds_of_a_task(2, tasks_each=5)
    assert 0.0 < 2 * 5 * of_a_task < time.perf_counter() - began
