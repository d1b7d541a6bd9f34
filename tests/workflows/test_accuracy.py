"""The accuracy studies: references that agree, errors that are errors, a table and its files."""

import csv
import json
import sys
from contextlib import nullcontext
from functools import partial

import numpy as np
import pytest

import beadwave
from beadwave import dem
from beadwave.workflows.commands.app import main
from beadwave.workflows.evidence import groups
from beadwave.workflows.evidence.accuracy import chain_length as sizes
from beadwave.workflows.evidence.accuracy import curves, folder, peers, runs, time
from beadwave.workflows.evidence.accuracy.curves import growth, ratios, seconds_at, slope
from beadwave.workflows.evidence.accuracy.problems import lengthened, modal_wall, problem
from beadwave.workflows.evidence.accuracy.reduction import least_seconds
from beadwave.workflows.evidence.accuracy.runs import (
    AccuracyRow,
    ReferenceRun,
    limit,
    peer_rows,
    reference,
    scheme_row,
    scheme_rows,
    table_of,
    timed,
)
from beadwave.workflows.evidence.accuracy.time import orders_closed
from beadwave.workflows.files.run_folder import RunFolder
from beadwave.workflows.files.scene import scene
from beadwave.workflows.report import finding
from beadwave.workflows.scene import InvalidScene

SHORT = ("chain.count=6", "output.spheres=[1,4]", "time.duration=0.8e-3")


def quiet(name):
    return nullcontext()


@pytest.fixture(scope="module")
def case():
    return problem(scene("rig-rigid", SHORT), quiet)


def with_all_parts(case):
    """The case with leaf springs, preload, a spring and modes behind the last contact."""
    wall = modal_wall(None, 3)._replace(residual_compliance=-2e-10)
    stiffness, anchor = np.full(6, 1e5), np.linspace(1e-5, 0.0, 6)
    chain = case.chain._replace(leaf_stiffness=stiffness, leaf_anchor=anchor, preload=20.0)
    return case._replace(chain=chain, wall=wall)


def test_two_independent_methods_agree_to_ten_digits(case):
    assert reference(case).difference < 1e-10


def test_peers_solve_the_same_equations_with_with_all_parts(case):
    full = with_all_parts(case)
    truth = reference(full)
    assert truth.difference < 1e-9
    assert peers.energy_error(full, peers.SCIPY["DOP853"](full, 1e-12).y) < 1e-7


@pytest.mark.slow
@pytest.mark.parametrize("name", list(peers.SCIPY))
def test_a_peers_error_falls_with_its_tolerance(case, name):
    truth = reference(case)
    solver = {name: peers.SCIPY[name]}
    rough, fine = peer_rows("time", case, truth, solver, tolerances=(1e-4, 1e-8), slow=np.inf)
    assert fine.error < 0.03 * rough.error < 0.03
    assert fine.evaluations > rough.evaluations


def test_sundials_keeps_its_tolerance_where_it_is_installed(case):
    pytest.importorskip("sksundae")
    truth = reference(case)
    for row in peer_rows("time", case, truth, peers.SUNDIALS, tolerances=(1e-8,)):
        assert row.error < 1e-3


def test_errors_are_those_of_the_observed_spheres(case):
    truth = reference(case)
    shifted = ReferenceRun(truth.v + 0.031, truth.difference, truth.checked_by)
    row = scheme_row("time", case, shifted, "rkn6", 1e-6)
    assert row.error == pytest.approx(0.1, abs=1e-6)
    assert row.evaluations == 11 * row.steps


def test_time_at_an_error_lies_on_the_line_between_two_runs():
    rows = [
        AccuracyRow("time", "m", 0.0, error, seconds) for error, seconds in [(1e-2, 1), (1e-6, 100)]
    ]
    assert seconds_at(rows, 1e-4) == pytest.approx(10.0)
    assert seconds_at(rows, 1e-1) == 1.0
    assert seconds_at(rows, 1e-8) == np.inf
    slower_and_rougher = [*rows, AccuracyRow("time", "m", 0.0, 2e-2, 50.0)]
    assert seconds_at(slower_and_rougher, 1e-4) == pytest.approx(10.0)


def test_ratio_names_the_fastest_of_each_kind():
    rows = [
        AccuracyRow("time", method, 0.0, error, seconds)
        for method, seconds in [("rkn6", 1e-3), ("verlet", 5e-3), ("LSODA", 0.06), ("RK45", 0.2)]
        for error in (1e-5, 1e-7)
    ]
    rough, _ = ratios(tuple(rows), "rig")
    assert rough == "rig, velocity error 0.0001: rkn6 takes 1 ms, LSODA 60 ms (60 times as long)."


def test_the_picture_draws_whichever_scheme_is_the_fastest(monkeypatch):
    lines = []
    monkeypatch.setattr(curves, "panels", lambda sets, **size: lines.extend(sets[0].lines) or b"")
    row = AccuracyRow("time", "rkn6", 1e-6, 1e-7, 2e-3, setting=1e-6)
    rows = [row, row._replace(method="split4", seconds=1e-3)]
    curves.picture("accuracy_time", iter(rows), "rig")
    assert "split4" not in curves.DRAWN
    assert [(line.name, line.style) for line in lines] == [("rkn6", "o-"), ("split4", "o-")]


def test_the_slope_is_that_of_logarithms():
    assert slope([1, 10, 100], [2, 20, 200]) == pytest.approx(1.0)


def test_growth_is_a_fixed_time_and_a_line():
    size = np.array([17, 100, 1000, 10000])
    assert growth(size, 5e-5 + 1e-6 * size) == pytest.approx((5e-5, 1e-6, 1.0), rel=1e-6)
    assert growth(size, 1e-6 * size**1.3).exponent > 1.2


def test_the_first_call_does_not_count_as_warm():
    calls = iter([0.3, 0.0, 0.0])
    run = timed(lambda: __import__("time").sleep(next(calls, 0.0)), repeats=2)
    assert run.cold > 0.25 > run.warm


def test_calls_that_are_compared_take_turns():
    order = []
    seconds = least_seconds((lambda: order.append("a"), lambda: order.append("b")), repeats=2)
    assert order == ["a", "b", "a", "b"] and len(seconds) == 2


@pytest.mark.slow
def test_orders_of_the_schemes_are_stated(case, monkeypatch):
    """Also on a busy machine: no scheme stops at a slow run."""
    monkeypatch.setattr(time, "scheme_rows", partial(scheme_rows, slow=np.inf))
    orders = orders_closed(case)
    for name, scheme in dem.SCHEMES.items():
        assert orders[name] == pytest.approx(scheme.order, abs=0.15), name


def test_a_longer_chain_repeats_its_middle(case):
    longer = lengthened(case, 50)
    assert longer.chain.A.size == longer.v0.size == 50
    assert longer.chain.A[-1] == case.chain.A[-1] != longer.chain.A[-2]
    assert longer.v0.sum() == case.v0.sum()
    free = case._replace(chain=case.chain._replace(A=case.chain.A[:-1]), wall=None)
    assert lengthened(free, 50).chain.A.size == 49


def test_walls_keep_their_own_modes_first():
    one_dof = dem.one_dof_wall(700.0, 2.0, 0.1)
    wall = modal_wall(one_dof, 4)
    assert wall.omega[0] == one_dof.omega[0] and wall.zeta[0] == 0.1
    assert np.diff(wall.omega) == pytest.approx(2 * np.pi * 400.0)
    assert modal_wall(None, 0).omega.size == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changes", "allowed"),
    [
        (("contact.coefficient=0.3",), 1e-8),
        (('wall.kind="dashpot"', "wall.coefficient=1e3"), 1e-8),
        (('contact.dissipation="linear-clipped"', "contact.coefficient=20.0"), 1e-3),
    ],
)
def test_peers_solve_damped_chains_and_dashpots_too(changes, allowed):
    """The linear law jumps where a contact closes, which leaves any method that steps over it
    order 1."""
    damped = problem(scene("rig-rigid", (*SHORT, *changes)), quiet)
    truth = reference(damped, finer=64.0)
    assert truth.difference < allowed
    assert truth.scheme == "kahan-li8"
    assert peers.energy_error(damped, np.zeros((1, 12))) is None
    elastic = problem(scene("rig-rigid", SHORT), quiet)
    assert np.abs(reference(elastic, finer=64.0).v - truth.v).max() > 1e-3


def test_study_becomes_table_csv_and_plots(tmp_path):
    rows = (AccuracyRow("time", "rkn6", 1e-6, 2e-7, 3e-4, None),)
    study = finding.Finding((table_of(rows),), ("ten times",))
    folder.write({"time": study}, RunFolder(tmp_path))
    with (tmp_path / "accuracy.csv").open(encoding="utf-8") as file:
        (row,) = csv.DictReader(file)
    assert row["method"] == "rkn6" and float(row["error"]) == 2e-7 and row["energy_error"] == ""
    assert json.loads((tmp_path / "machine.json").read_text())["libraries"]["numpy"]
    assert finding.text(study).splitlines()[-1] == "ten times"


@pytest.mark.slow
def test_command_prints_rows_for_machines(capsys, monkeypatch, tmp_path):
    monkeypatch.setattr(sizes, "LENGTHS", (100, 200))
    monkeypatch.setenv("BEADWAVE_CACHE_DIR", str(tmp_path))
    changes = [part for change in SHORT for part in ("--set", change)]
    command = ["beadwave", "accuracy", "--stage", "chain-length", "--json", "--out", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", [*command, *changes])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert {"study", "method", "parameter", "error", "seconds"} <= set(rows[0])
    assert {row["parameter"] for row in rows} == {100, 200}
    assert (tmp_path / "figures" / "accuracy_chain_length.png").is_file()


def test_a_peer_that_gives_up_leaves_no_row(case):
    def gives_up(problem, tolerance):
        return peers.PeerSolution(np.zeros((3, 12)), None, 1)

    assert not list(peer_rows("time", case, reference(case), {"one": gives_up}))


def test_steps_that_the_engine_refuses_are_left_out(case, monkeypatch):
    refusing = limit(case, "verlet")
    monkeypatch.setattr(runs, "limit", lambda problem, scheme: 4 * refusing)
    rows = list(scheme_rows("time", case, reference(case), ["verlet"], halvings=5))
    assert rows and max(row.setting for row in rows) < refusing


def test_json_holds_no_number_that_is_not_finite():
    rows = (AccuracyRow("time", "LSODA", 1e-6, np.nan, 1e-3, np.inf),)
    study = finding.Finding((table_of(rows),))
    (row,) = finding.record(study)["rows"]
    assert row["error"] is row["energy_error"] is None


def test_unknown_stage_is_bad_input(capsys, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["beadwave", "accuracy", "--stage", "tme"])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 2
    assert "'time'" in capsys.readouterr().err


@pytest.mark.parametrize("change", ['time.duration="1e12 s"', 'chain.radius="1e-17 m"'])
def test_a_chain_that_cannot_be_run_is_not_measured(change):
    long = scene("rig-rigid", (change,))
    with pytest.raises(InvalidScene, match=r"takes more than .* steps"):
        problem(long, quiet)


@pytest.fixture
def few_peers(monkeypatch):
    monkeypatch.setattr(peers, "peers", lambda: {"odeint": peers.odeint})
    monkeypatch.setattr(runs, "ASKED", (1e-2,))


def rows_of(*methods):
    """A quick run of each method to 1e-8, ours the quicker one."""
    return [
        AccuracyRow("", name, 0.0, 1e-8, 1e-3 * (1 + i), setting=1e-7)
        for i, name in enumerate(methods)
    ]


def test_the_study_of_schemes_says_orders_and_ratios(few_peers, monkeypatch):
    monkeypatch.setattr(time, "scheme_rows", lambda *_, **__: iter(rows_of("rkn6")))
    monkeypatch.setattr(time, "peer_rows", lambda *_: iter(rows_of("rkn6", "odeint")[1:]))
    result = time.time(scene("rig-rigid", SHORT), quiet)
    sentences = " ".join(result.sentences)
    assert "the reference solution, rkn6a with a small step, differs from DOP853" in sentences
    assert "rkn6 takes 1 ms, odeint 2 ms (2 times as long)" in sentences and "rkn6 -" in sentences


@pytest.mark.slow
def test_the_study_of_wall_modes_says_what_a_mode_costs(few_peers, monkeypatch):
    monkeypatch.setattr(sizes, "MODES", (0, 1, 2, 3))
    monkeypatch.setattr(sizes, "COMPARED", 2)
    ours, theirs = rows_of("rkn6", "odeint")

    def at(row, k):
        return row._replace(parameter=k, seconds=(k + 1) * row.seconds)

    monkeypatch.setattr(sizes, "scheme_row", lambda *case: at(ours, case[-1]))
    monkeypatch.setattr(sizes, "scheme_rows", lambda *_, **__: ())
    monkeypatch.setattr(sizes, "peer_rows", lambda *_, parameter, **__: [at(theirs, parameter)])
    result = sizes.wall_modes(scene("rig-rigid", SHORT), quiet)
    assert "no modes of its own" in result.sentences[0]
    assert "takes 1 ms with a rigid wall, and with modes 1 ms + 1e+03 µs" in result.sentences[-1]


def test_the_study_of_reductions_is_left_out_unless_it_is_named_or_all_is_asked_for(monkeypatch):
    thorough = {}

    def study(name):
        def found(scene, progress, **options):
            thorough.update({name: options})
            return finding.Finding((table_of(()),), (name,))

        return found

    def chosen(folder, names):
        return {name: study(name) for name in names or groups.names(folder)}

    monkeypatch.setattr(groups, "chosen", chosen)
    *names, words = beadwave.accuracy().sentences
    assert names == ["time", "mesh", "chain-length", "wall-modes"]
    assert words == "Left out: the stage reduction; --stage reduction runs it, --thorough all."
    assert thorough == {name: {"thorough": False} if name == "mesh" else {} for name in names}
    assert beadwave.accuracy(thorough=True).sentences == tuple(groups.names("accuracy"))
    assert thorough["mesh"] == {"thorough": True}
    assert beadwave.accuracy(stage="reduction").sentences == ("reduction",)
