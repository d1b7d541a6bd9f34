"""Records of a bead in the chain in, thickness, modulus and axial force of a beam out."""

import json
from contextlib import nullcontext

import numpy as np
import pytest
import tomli_w

import beadwave
from beadwave.workflows.files.record import Channel
from beadwave.workflows.files.scene import scene
from beadwave.workflows.fit.measured_record import recorded, sensor_of
from beadwave.workflows.fit.parametric_wall import Bounds
from beadwave.workflows.fit.plausibility import noise_of, rounding
from beadwave.workflows.fit.scene_parameters import number, per_record, put, shared, usual_each
from beadwave.workflows.fit.varied_scene import VariedScene, structure
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.stages.chain.sensor_signals import csv_text
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.sweep.cases import base_of

from command_line import beadwave as command

BEAM = {
    "name": "inspected",
    "chain": {"count": 9, "radius": 0.00953, "density": 7800.0, "young": 210e9, "poisson": 0.3},
    "striker": {"velocity": 0.3},
    "wall": {"kind": "rom"},
    "damping": {"kind": "modal", "ratio": 0.003},
    "time": {"duration": 3.4e-3},
    "beam": {
        "length": 0.3, "width": 0.04, "thickness": 0.012, "young": 70e9, "poisson": 0.33,
        "density": 2700.0, "left": "hinged", "right": "hinged", "position": 0.126,
        "axial_force": 0.0,
    },
    "output": {
        "spheres": [5],
        "samples": 3401,
        "instrument": {"sampling": 1e6, "bits": 8},
        "sensors": [{"sphere": 5, "quantity": "force", "gain": "bead", "noise": 0.01}],
    },
}  # fmt: skip
TRUTH = {"beam.thickness": 0.0124, "beam.young": 72e9, "beam.axial_force": -20e3}
BOUNDS = "beam.thickness=9mm:15mm,beam.axial_force=-30kN:5kN"
FIND = ",".join(TRUTH)
THROUGH = VariedScene.through
NO_BOX = Bounds(np.zeros(0), np.zeros(0))


def measured(folder, speeds=(0.31, 0.44), **changes):
    """Records of the true beam, noise 1 %, 8 bits."""
    folder.mkdir(exist_ok=True)
    files = []
    for i, speed in enumerate(speeds):
        expected = {"striker.velocity": speed, "output.instrument.seed": i, **TRUTH, **changes}
        true = scene(BEAM, expected)
        files.append(folder / f"drop{i}.csv")
        files[-1].write_text(csv_text(true, pipeline_of(true, _quiet)("record")))
    return files


def _quiet(name):
    return nullcontext()


@pytest.fixture(scope="module")
def drops(tmp_path_factory):
    return measured(tmp_path_factory.mktemp("drops"))


@pytest.fixture(scope="module")
def result(drops, tmp_path_factory):
    out = tmp_path_factory.mktemp("out") / "inspected"
    result = beadwave.inspect(
        BEAM, drops, find=FIND, bounds=BOUNDS, each="striker.velocity=0.3,0.45", out=out
    )
    return result, out


@pytest.mark.slow
def test_thickness_modulus_and_axial_force_come_out_within_their_bars(result):
    rows = {row.name: row for row in result[0].report.numbers}
    for key, share in (("beam.thickness", 0.01), ("beam.young", 0.02)):
        off = abs(rows[key].found - TRUTH[key])
        assert off <= 1.5 * rows[key].two_sigma and off < share * TRUTH[key]
    force = rows["beam.axial_force"]
    assert abs(force.found + 20e3) <= 1.5 * force.two_sigma < 0.05 * 44e3  # of buckling
    assert [row.identifiable for row in rows.values()] == ["yes"] * 3
    assert [row.unit for row in rows.values()] == ["m", "Pa", "N"]
    assert result[0].report.explained


@pytest.mark.slow
def test_bars_say_what_share_noise_and_each_error_of_the_model_have(result):
    for row in result[0].report.numbers:
        assert set(row.bar_by) == {"noise", "time", "mesh", "reduction", "theory"}
        assert sum(row.bar_by.values()) == pytest.approx(1, abs=1e-9)
        assert row.bar_by["theory"] > row.bar_by["mesh"]  # elements of order 10 have converged
    assert "bar by" in result[0].report.text()


@pytest.mark.slow
def test_the_wall_between_others_is_checked_at_the_answer(result):
    report, judged = result[0].report, result[0].found.answer
    assert report.walls > 10 and 0 < report.wall_missed < 0.5  # coefficients of degree 2
    assert judged.moved <= 0.05
    assert any("computed at the answer" in remark for remark in report.remarks)


def test_the_folder_holds_the_scene_found_and_says_synthetic(result, drops):
    result, out = result
    written = scene(out / "scene.toml")
    row = result.report.numbers[0]  # written to the digits that its bar supports
    assert written.beam.thickness == pytest.approx(row.found, abs=0.005 * row.two_sigma)
    for name in ("scene.toml", "numbers.csv", "signals.csv"):
        assert "SYNTHETIC" in (out / name).read_text(encoding="utf-8")
    assert {path.name for path in (out / "figures").iterdir()} == {
        "signals.png", "numbers.png", "length.png",
    }  # fmt: skip
    rows = (out / "signals.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) == 2 + 2 * 3401
    assert json.loads((out / "report.json").read_text())["synthetic"] is True


def test_bars_shrink_with_the_records_length_and_the_force_is_told_last(result):
    report = result[0].report
    t = np.array(report.record_length_s)
    width = {row.name: np.ptp(row.bounds) for row in report.numbers}
    expected = {
        name: t[np.argmax(np.array(bars) < 0.1 * width[name])]
        for name, bars in report.two_sigma_by_length.items()
    }
    assert expected["beam.thickness"] < 1.2e-3 < expected["beam.axial_force"]


@pytest.mark.slow
def test_records_of_the_first_wave_alone_do_not_tell_the_axial_force(tmp_path):
    files = measured(tmp_path, speeds=(0.4,), **{"time.duration": 1.1e-3})
    result = beadwave.inspect(BEAM, files, find=FIND, bounds=BOUNDS, each="striker.velocity=0.4",
                              starts=2)  # fmt: skip
    force = result.report.numbers[2]
    assert force.identifiable == "no"
    assert force.two_sigma > 0.5 * np.ptp(force.bounds)
    assert any("no wave within" in r and "beam.axial_force" in r for r in result.report.remarks)
    assert "beam.axial_force" in repr(result)


@pytest.mark.slow
def test_a_beam_that_is_held_otherwise_is_told_by_what_is_left(tmp_path):
    files = measured(tmp_path, speeds=(0.4,), **{"beam.left": "clamped", "beam.density": 4000.0})
    asked = {"find": "beam.axial_force", "bounds": "beam.axial_force=-30kN:5kN"}
    result = beadwave.inspect(BEAM, files, **asked, each="striker.velocity=0.4", starts=2)
    assert not result.report.explained
    assert any("DOES NOT EXPLAIN" in remark for remark in result.report.remarks)


def test_an_answer_without_a_wall_is_shown_and_not_explained(drops, monkeypatch):
    """Beyond buckling, for example: what walls around it gave, with the reason."""

    def none(scene):
        raise InvalidScene("beam.axial_force: it buckles.")

    monkeypatch.setattr(VariedScene, "through", lambda one, values: _through(one, values, none))
    result = beadwave.inspect(BEAM, drops[:1], TRUTH, find="beam.thickness", starts=2)
    assert not result.report.explained
    assert [row.identifiable for row in result.report.numbers] == ["not explained"]
    assert any("no wall can be computed at the answer (beam.axial_force: it buckles)" in remark
               for remark in result.report.remarks)  # fmt: skip
    assert 0 < result.report.misfit[0][0] < 2 and "DOES NOT EXPLAIN" in repr(result)


def _through(one, values, computed):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("beadwave.workflows.fit.varied_scene.computed", computed)
        return THROUGH(one, values)


def test_numbers_of_the_chain_need_no_other_wall(tmp_path, drops):
    result = beadwave.inspect(
        BEAM,
        drops[:1],
        {**TRUTH, "striker.velocity": 0.31},
        find="chain.young",
        each="none",
        starts=2,
    )
    row = result.report.numbers[0]
    assert result.report.walls == 0
    assert abs(row.found - 210e9) <= 1.5 * row.two_sigma < 0.02 * 210e9


def test_a_gain_that_the_scene_says_is_not_sought(drops):
    base = base_of(BEAM, {})
    expected, name = sensor_of(base.with_values({}), Channel(5, "force", True))
    assert name == "bead" and expected.gain == 1.0
    loud = {**BEAM["output"], "sensors": [{"sphere": 5, "gain": 0.3}]}
    expected, name = sensor_of(scene({**BEAM, "output": loud}), Channel(5, "force", True))
    assert name is None and expected.gain == 0.3
    expected, name = sensor_of(base.with_values({}), Channel(5, "velocity", False))
    assert name is None and expected.quantity == "velocity"


def test_values_put_into_a_scene_are_those_of_a_scene_read_anew():
    base = base_of(BEAM, {})
    keys = ("beam.thickness", "striker.velocity", "chain.young")
    values = np.array([0.011, 0.4, 200e9])
    anew = base.with_values(dict(zip(keys, values.tolist(), strict=True)))
    assert put(base.with_values({}), keys, values).model_dump() == anew.model_dump()
    named = base_of("cantilever", {})
    material = "materials.aluminium.young"
    second = put(named.with_values({}), (material,), np.array([65e9]))
    assert number(second, material) == 65e9
    assert number(named.with_values({}), material) == 70e9


def test_a_height_of_fall_moves_the_velocity_that_follows_from_it():
    base = base_of("upright", {})
    both = structure(base, ("striker.drop",), NO_BOX, 0, _quiet)
    low, high = (both(np.array([drop])).v0[0] for drop in (0.005, 0.020))
    assert high / low == pytest.approx(2.0, rel=1e-6)
    assert both.rows is None
    alone = structure(base, ("chain.young",), NO_BOX, 1, _quiet)
    assert alone.rows.of == (0,)


def test_a_force_a_thousand_times_off_is_refused(tmp_path):
    loud = {**BEAM["output"], "sensors": [{"sphere": 5, "noise": 0.01}]}
    true = scene({**BEAM, "output": loud}, {"time.duration": 1.1e-3})
    text = csv_text(true, pipeline_of(true, _quiet)("record"))
    file = tmp_path / "drop.csv"
    file.write_text(text.replace("force [N]", "force [kN]"))
    with pytest.raises(InvalidScene, match="correct the unit in the data's header"):
        beadwave.inspect({**BEAM, "output": loud}, file, find="beam.young")


def test_a_record_knows_its_noise_from_what_lies_between_its_waves(drops):
    item = recorded(drops[0])
    rms, is_known = noise_of(item, 5e-5)
    largest = np.abs(item.y).max()
    assert is_known
    assert 0.009 < rms[0] / largest < 0.0125  # 1 %, and the steps of 8 bits


@pytest.mark.parametrize(
    ("order", "sign", "sentence"),
    [
        ((1, 0), (1, 1), "sphere 3 velocity of r.csv and sphere 7 velocity of r.csv are swapped"),
        ((0, 1), (1, -1), "^sphere 7 velocity of r.csv has the wrong sign"),
        ((0, 1), (-1, -1), "sphere 7 velocity of r.csv have the wrong sign"),
    ],
)
def test_swapped_and_turned_columns_are_refused(tmp_path, order, sign, sentence):
    both = [{"sphere": n, "quantity": "velocity", "noise": 0.01} for n in (3, 7)]
    beam = {**BEAM, "output": {**BEAM["output"], "sensors": both}}
    true = scene(beam, {"striker.velocity": 0.34, **TRUTH})
    comment, head, *lines = csv_text(true, pipeline_of(true, _quiet)("record")).splitlines()
    t, *y = np.array([line.split(",") for line in lines], float).T
    rows = np.column_stack([t, *(s * y[i] for i, s in zip(order, sign, strict=True))])
    text = [comment, head, *(",".join(map(repr, map(float, row))) for row in rows)]
    (tmp_path / "r.csv").write_text("\n".join(text))
    with pytest.raises(InvalidScene, match=sentence):
        beadwave.inspect(beam, tmp_path / "r.csv", find="striker.velocity", starts=1)


@pytest.mark.parametrize("head", ["sphere 5 force [V]", "sphere 5 force [N]", "sphere 4 [m/s]"])
@pytest.mark.parametrize("value", [0.0, 43.0])
def test_a_column_that_never_changes_is_refused(tmp_path, head, value):
    """Alone, as one of two sensors, and as one repeat of two."""
    t = np.arange(3000) * 1e-6
    wave = 43.0 * np.exp(-(((t - 8e-4) / 3e-5) ** 2))
    file = tmp_path / "still.csv"
    for heads in ([head], [head, "sphere 7 force [V]"], [head, head]):
        rows = np.column_stack([t, *[np.full(3000, value), wave][: len(heads)]])
        lines = [",".join(map(repr, map(float, row))) for row in rows]
        file.write_text("\n".join([", ".join(["time [s]", *heads]), *lines]))
        with pytest.raises(InvalidScene, match=f"is {value:g} at every sample, no wave is in it"):
            beadwave.inspect(BEAM, file, find="striker.velocity", starts=1)


def test_steps_of_an_instrument_are_noise():
    y = np.round(np.sin(np.linspace(0, 6, 5000)) * 100) / 100
    assert rounding(y[:, None])[0] == pytest.approx(0.01 / np.sqrt(12.0), rel=1e-6)
    assert rounding(np.sin(np.linspace(0, 6, 5000))[:, None]) == 0.0


def test_columns_have_quantities_and_units_and_repeats_are_averaged(tmp_path):
    t = np.arange(400) * 1e-6
    wave = np.exp(-(((t - 2e-4) / 3e-5) ** 2))
    rows = np.column_stack([1e6 * t, 1e3 * wave, 1e3 * wave, 2 * wave])
    head = "time [us], sphere 9 force [mN], sphere 9 force [mN], sphere 4 [m/s]"
    path = tmp_path / "r.csv"
    path.write_text("\n".join([head, *(",".join(map(repr, map(float, r))) for r in rows)]))
    with pytest.raises(InvalidScene, match="differ in repeats"):
        recorded(path)
    rows, head = rows[:, :3], head.rsplit(",", 1)[0]
    path.write_text("\n".join([head, *(",".join(map(repr, map(float, r))) for r in rows)]))
    result = recorded(path)
    assert result.channels == (Channel(9, "force", False),) and result.repeats == 2
    np.testing.assert_allclose(result.y[:, 0], wave, atol=1e-6)


@pytest.mark.slow
def test_a_design_foresees_the_bars_of_an_inspection(drops, tmp_path):
    item = beadwave.inspect(BEAM, drops[1], find=FIND, bounds=BOUNDS, each="striker.velocity=0.44")
    true = {**TRUTH, "striker.velocity": 0.44}
    foreseen = beadwave.design(BEAM, true, find=FIND, bounds=BOUNDS, out=tmp_path / "design")
    table = foreseen.tables[0]
    assert table.column("sphere") == tuple(range(2, 10))
    assert item.report.explained
    for row in item.report.numbers:
        bar = table.column(f"{row.name} two sigma [{row.unit}]")[3]  # sphere 5
        by_noise = table.column(f"{row.name} noise in its square")[3]
        # the same errors of the model, here by derivatives, there by fits: along the valley of
        # thickness, modulus and force these move the numbers up to twice as far
        assert 0.4 < bar / row.two_sigma < 1.3
        # the noise of one record is known to some ten per cent
        assert 0.6 < np.sqrt(by_noise / row.bar_by["noise"]) * bar / row.two_sigma < 1.5
    assert (tmp_path / "design" / "design.csv").is_file()
    assert (tmp_path / "design" / "figures" / "design.png").is_file()


@pytest.mark.slow
def test_a_design_compares_chains_and_says_what_a_record_is_too_short_for():
    brief = {**TRUTH, "time.duration": 1.1e-3}
    result = beadwave.design(BEAM, brief, find=FIND, bounds=BOUNDS, over=["chain.count=7,9"])
    table = result.tables[0]
    assert table.column("chain.count") == (7,) * 6 + (9,) * 8
    assert any("beam.axial_force is told by no sphere" in said for said in result.sentences)
    assert any(
        said.startswith("beam.thickness is determined best by sphere") for said in result.sentences
    )
    observed = np.array(table.column("beam.thickness record [s]"))
    assert (observed <= 1.1e-3).all() and observed.min() < 1.0e-3


def test_a_design_of_too_many_cases_is_refused():
    with pytest.raises(InvalidScene, match="up to 200"):
        beadwave.design(BEAM, find="beam.young", over=["striker.velocity=0.1:1:201"])


@pytest.mark.parametrize(
    ("asked", "sentence"),
    [
        ({"find": "beam.thicknes"}, "has no value"),
        ({"find": "chain.count"}, "counts; name a key that varies"),
        ({"find": "beam.left"}, "one number"),
        ({"find": ""}, "names nothing"),
        ({"find": "beam.young,beam.young"}, "twice"),
        ({"find": "beam.axial_force"}, "add --bounds beam.axial_force"),
        ({"find": "beam.young", "bounds": "beam.thickness=9mm:15mm"}, "not among the numbers"),
        ({"find": "beam.young", "bounds": "beam.young=80GPa:90GPa"}, "must hold"),
        ({"find": "beam.young", "bounds": "beam.young=80GPa"}, "not key=low:high"),
        ({"find": "beam.young", "bounds": "beam.young=90GPa:50GPa"}, "write beam.young=50GPa:90"),
        ({"find": "beam.poisson", "bounds": "beam.poisson=0.2:0.7"}, "bounds of beam.poisson"),
        ({"find": "beam.young", "each": "striker.velocity=0.3"}, "give one for each"),
        ({"find": "striker.velocity", "each": "striker.velocity"}, "name it once"),
        ({"find": "beam.young", "each": "beam.thickness"}, "which all records share"),
    ],
)  # fmt: skip
def test_what_cannot_be_asked_is_refused_in_a_sentence(drops, asked, sentence):
    with pytest.raises(InvalidScene, match=sentence):
        beadwave.inspect(BEAM, drops, **asked)


@pytest.mark.parametrize(
    ("header", "sentence"),
    [
        ("time [s], sphere 5 force [mV/N]", "the unit of sphere 5's force"),
        ("time [s], sphere 5 temperature [K]", "the quantity is one of"),
        ("time [s], sphere 12 force [N]", "allowed are 1 to chain.count = 9"),
        ("time [s], sphere 5 velocity [m/s]", "records of the same sensors"),
    ],
)
def test_records_that_cannot_be_used_are_refused(drops, tmp_path, header, sentence):
    lines = drops[0].read_text(encoding="utf-8").splitlines()
    bad = tmp_path / "bad.csv"
    bad.write_text("\n".join([header, *lines[2:]]))
    files = [drops[0], bad] if "same" in sentence else [bad]
    with pytest.raises(InvalidScene, match=sentence):
        beadwave.inspect(BEAM, files, find="beam.young")


def test_numbers_of_a_record_start_where_they_are_told():
    base = base_of(BEAM, {})
    first, second = per_record(base, "striker.velocity=300mm/s,0.45", 2)
    assert first[0].start == 0.3 and second[0].start == 0.45
    assert per_record(base, usual_each(base.with_values({}), "beam.young"), 2)[1][0].start == 0.3
    assert per_record(base, usual_each(base.with_values({}), "striker.velocity"), 2) == [[], []]
    assert shared(base, "beam.young", None)[0].low == pytest.approx(49e9)


@pytest.mark.slow
def test_the_command_prints_numbers_as_json_and_refuses_with_status_2(drops, tmp_path, capsys):
    toml = tmp_path / "beam.toml"
    toml.write_text(tomli_w.dumps(BEAM))
    asked = ["inspect", toml, drops[0], "--find", "striker.velocity", "--json"]
    changes = [piece for key, value in TRUTH.items() for piece in ("--set", f"{key}={value!r}")]
    assert command(*asked, *changes) == 0
    row = json.loads(capsys.readouterr().out)["numbers"][0]
    assert abs(row["found"] - 0.31) <= 1.5 * row["two_sigma"]
    assert command("inspect", toml, tmp_path / "none.csv", "--find", "beam.young") == 2
    assert "none.csv does not exist" in capsys.readouterr().err
