"""`beadwave tune --rank` beside separate solutions of the full model, on a coarse mesh."""

import json

import numpy as np
import pytest

from beadwave.workflows.files.scene import scene
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.engine.progress import quiet
from beadwave.workflows.structure.api import rank_parameters, tune
from beadwave.workflows.structure.parameters import scene_value, with_values

from command_line import beadwave
from known_models import PADS

MATCH = (1, 2, 3, 4)
FREED = (
    "joints.pads.kx",
    "joints.pads.kz",
    "joints.pads.krx",
    "materials.steel.young",
    "materials.steel.density",
    "masses.sensor.mass",
)


@pytest.fixture(scope="module")
def pads(tmp_path_factory):
    path = tmp_path_factory.mktemp("pads") / "pads.toml"
    path.write_text(PADS)
    return path


def full_hz(one):
    return pipeline_of(one, quiet)("modes").omega[: len(MATCH)] / (2 * np.pi)


@pytest.mark.slow
def test_sensitivities_are_central_differences_of_full_solutions_and_onsets_their_shifts(
    pads, shared_cache
):
    start = scene(pads)
    hz = full_hz(start)
    report = rank_parameters(pads, match={n: 1.02 * float(hz[n - 1]) for n in MATCH})
    np.testing.assert_allclose([*report.computed_hz.values()], hz, rtol=1e-4)
    rows = {row.name: row for row in report.parameters}
    assert rows.keys() >= set(FREED)
    h = 0.01
    for name in FREED:
        value = scene_value(start, name) if name.startswith("joints") else 1.0
        up, down = (full_hz(with_values(start, {name: value * np.exp(x)})) for x in (h, -h))
        slopes = np.log(up / down) / (2 * h)
        np.testing.assert_allclose([*rows[name].frequency.values()], slopes, atol=2e-4)

    # all that is stiff, and all that is heavy
    stiff = [n for n in rows if n.startswith("joints") or n.endswith("young")]
    for mode in map(str, MATCH):
        assert sum(rows[n].frequency[mode] for n in stiff) == pytest.approx(0.5, abs=1e-6)
        assert sum(rows[n].frequency[mode] for n in rows.keys() - stiff) == pytest.approx(-0.5)

    # directions that are rigid: a joint as soft as the onset lowers the mode by 1 %
    assert [(row.name, row.now) for row in report.onsets] == [
        ("joints.pads.ky", "rigid"),
        ("joints.pads.kry", "rigid"),
    ]
    for row in report.onsets:
        for mode, k in row.stiffness.items():
            if k is not None:
                shifts = full_hz(with_values(start, {row.name: k})) / hz[int(mode) - 1] - 1
                assert np.abs(shifts + 0.01).min() < 2e-4


@pytest.mark.slow
def test_what_is_ranked_first_is_what_tune_determines(pads, shared_cache):
    start = scene(pads)
    aim = with_values(start, {"joints.pads.kz": 1.1e7, "joints.pads.krx": 480.0})
    match = {n: float(hz) for n, hz in zip(MATCH, full_hz(aim), strict=True)}
    free = ("joints.pads.kz", "joints.pads.krx", "joints.pads.krz")
    report = rank_parameters(pads, match=match, free=free)
    assert {row.name for row in report.parameters} == set(free)
    fit = tune(pads, match=match, free=report.determined, out=None).report
    assert not fit.undetermined and fit.stiffness.keys() == set(report.determined)
    deviations = {row.name: row.deviation for row in report.parameters}
    last = report.determined[-1]
    assert fit.deviation[last] == pytest.approx(deviations[last], rel=0.2)
    assert f"--free {','.join(report.determined)}." in report.remarks[0]


@pytest.mark.slow
def test_the_command_prints_a_table_or_json_and_writes_nothing(
    pads, shared_cache, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    arguments = (
        "tune",
        str(pads),
        "--match=1=3000,2=5000",
        "--free=joints.pads.kz,joints.pads.ky",
        "--rank",
    )
    assert beadwave(*arguments, "--json") == 0
    report = json.loads(capsys.readouterr().out)
    assert report["parameters"][0]["name"] == "joints.pads.kz"
    assert report["onsets"][0]["name"] == "joints.pads.ky"
    assert beadwave(*arguments) == 0
    text = capsys.readouterr().out
    assert "joints.pads.kz" in text and "moves a mode by 1 % at" in text
    assert not list(tmp_path.iterdir())
    assert beadwave(*arguments, "--out=tuned.toml") == 2
    assert "--rank writes no scene; drop --out" in capsys.readouterr().err


@pytest.mark.slow
def test_modes_that_are_not_computed_and_names_that_are_not_known_are_refused(pads, shared_cache):
    with pytest.raises(InvalidScene, match="no computed mode is like mode 199"):
        rank_parameters(pads, match={199: 5e4}, free="joints.pads.kz")
    with pytest.raises(InvalidScene, match=r"--free joints.pads.kq is not known"):
        rank_parameters(pads, match={1: 900.0}, free="joints.pads.kq")


@pytest.mark.slow
def test_the_rig_ranks_its_joints_and_block_with_the_slopes_of_full_solutions(shared_cache):
    coarse = {"mesh.seed": 0.012, "mesh.block_seed": 0.05, "mesh.support_seed": 0.1}
    start = scene("rig-rom", coarse | {"mesh.contact_seed": 0.03})
    report = rank_parameters(start)
    rows = {row.name: row for row in report.parameters}
    assert {row.name for row in report.onsets} == {
        *("head.kx", "head.krx", "head.krz"),
        *(f"foot.{key}" for key in ("kx", "ky", "kz", "krx", "kry", "krz")),
    }
    assert report.determined[:2] == ["head.kz", "head.ky"]
    h = 0.01
    for name, number in (("ky", 1), ("kz", 2)):
        k = getattr(start.bushings["head"], name)
        up, down = (
            pipeline_of(scene(start, {f"joints.head.{name}": k * np.exp(x)}), quiet)(
                "modes"
            ).paired_hz[str(number)]
            for x in (h, -h)
        )
        slope = np.log(up / down) / (2 * h)
        assert rows[f"head.{name}"].frequency[str(number)] == pytest.approx(slope, abs=2e-3)
    # an assembly without sheets below has no foot to free
    alone = scene(start, {"assembly.parts": ["block", "sheets"]})
    names = [row.name for row in rank_parameters(alone, match=[1]).onsets]
    assert not any(name.startswith("foot") for name in names)


@pytest.mark.slow
def test_bars_rest_on_the_deviations_of_the_test_where_targets_have_them(pads, shared_cache):
    """0.02 % and 0.4 % in place of 0.1 %: of rank and fit alike, and a frequency of one's own takes
    no deviation of another one."""
    hz = full_hz(scene(pads))
    share = np.array([2e-4, 4e-3, 1e-6, 1e-3])
    targets = [
        {"number": n, "hz": float(f)} | ({"hz_deviation": float(s * f)} if n < 4 else {})
        for n, f, s in zip(MATCH, hz, share, strict=True)
    ]
    aimed, free = scene(pads, {"targets": targets}), ("joints.pads.kz",)
    report = rank_parameters(aimed, free=free)
    # no model is closer than 0.01 %; without a deviation 0.1 % is taken
    expected = np.array([2e-4, 4e-3, 1e-4, 1e-3])
    np.testing.assert_allclose([*report.frequency_error.values()], expected, rtol=1e-12)
    words = "(0.01 to 0.4 %; none below 0.01 % is taken; 0.1 % for mode 4 without one)"
    assert f"at the test's own deviations in frequency {words}" in report.remarks[0]
    (row,) = report.parameters
    slopes = np.array([*row.frequency.values()])
    alone = 1 / np.linalg.norm(slopes / expected)
    assert row.deviation == pytest.approx(alone, rel=1e-3)

    # the fit has the same bars where it meets the modes, wider ones where it does not
    fit = tune(aimed, free=free, out=None).report
    assert fit.frequency_error == report.frequency_error
    assert fit.deviation["joints.pads.kz"] == pytest.approx(alone, rel=0.01)
    assert any("Bars rest on the test's own deviations" in remark for remark in fit.remarks)
    apart = {
        n: f * (1 + e) for n, f, e in zip(MATCH, hz.tolist(), (9e-4, 0, -4e-4, 0), strict=True)
    }
    moved = [target | {"hz": apart[n]} for n, target in zip(MATCH, targets, strict=True)]
    wider = tune(scene(pads, {"targets": moved}), free=free, out=None).report
    assert wider.deviation["joints.pads.kz"] > 2 * alone
    assert any("bars are widened by that" in remark for remark in wider.remarks)

    other = rank_parameters(aimed, match={1: float(hz[0]) * 1.001}, free=free)
    assert other.frequency_error == {"1": 1e-3} and "at 0.1 % in frequency" in other.remarks[0]


def test_a_deviation_as_large_as_its_frequency_is_refused(pads):
    for value, words in ((900.0, "is not below hz = 900 Hz"), (0.0, "must be greater than 0")):
        with pytest.raises(InvalidScene, match=words) as refused:
            scene(pads, {"targets": [{"number": 1, "hz": 900.0, "hz_deviation": value}]})
        assert "hz_deviation" in str(refused.value)
