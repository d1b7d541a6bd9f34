"""A hammer-test file in, frequencies and damping out, a tuned scene at the end; data synthetic."""

import re
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat, wavfile

import beadwave
from beadwave.fem.identification.hits import FrequencyResponses, Hits, frequency_responses
from beadwave.fem.identification.poly_reference import IdentifiedModes, identified_modes
from beadwave.fem.identification.synthetic_hits import HammerDefects, synthetic_hits
from beadwave.fem.modes.mac import mac
from beadwave.workflows.files.hammer import (
    MeasuredTest,
    measured_test,
    points_and_directions,
    write_modes,
    write_synthetic,
)
from beadwave.workflows.files.hit_files import records_of_data_sets
from beadwave.workflows.files.measured_shape import measured_shape
from beadwave.workflows.files.output_file import OutputFile
from beadwave.workflows.files.record import SYNTHETIC
from beadwave.workflows.files.response_files import Responses
from beadwave.workflows.files.scene import scene
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.structure.hammer import (
    Choice,
    IdentifiedTest,
    hammer_test,
    opposite_directions,
    pictures,
)
from beadwave.workflows.structure.pairing import applied

import command_line
from ambient_records import F, ambient

RIG = {1: 51.0, 2: 269.0, 3: 907.0, 4: 8425.0}
LINES = np.arange(10.0, 1200.0, 0.2)


def computed(modes=((51.0, 0.01), (269.0, 0.008), (905.0, 0.006)), noise=1e-3):
    omega = 2 * np.pi * LINES
    H = np.zeros((2, len(LINES)), dtype=complex)
    for f, zeta in modes:
        w = 2 * np.pi * f
        H += np.array([[1.0], [0.7]]) * -(omega**2) / (w**2 - omega**2 + 2j * zeta * w * omega)
    rng = np.random.default_rng(0)
    H += noise * np.abs(H).mean() * (rng.normal(size=H.shape) + 1j * rng.normal(size=H.shape))
    return Responses(LINES, H, SYNTHETIC)


@pytest.fixture
def csv(tmp_path):
    test, path = computed(), tmp_path / "test.csv"
    columns = [test.frequency_hz, *(part for h in test.H for part in (h.real, h.imag))]
    np.savetxt(path, np.column_stack(columns), delimiter=",", header="f,re,im,re,im")
    return path


def test_a_csv_gives_frequencies_and_damping_of_the_rig_s_modes(csv):
    report = hammer_test(csv, RIG).report
    assert list(report.targets) == [1, 2, 3]
    np.testing.assert_allclose(list(report.targets.values()), [51, 269, 905], rtol=2e-3)
    np.testing.assert_allclose(list(report.damping.values()), [0.01, 0.008, 0.006], rtol=0.1)


def test_without_targets_resonances_stand_alone_and_the_report_says_so(csv):
    report = hammer_test(csv, {}).report
    assert len(report.rows) == 3 and not report.targets
    assert "No targets" in report.text()
    assert "No targets" not in hammer_test(csv, RIG).report.text()


def test_uff_keeps_the_responses_and_says_that_they_are_synthetic(tmp_path):
    pytest.importorskip("pyuff", reason="UFF58 is optional (the extra `identify`)")
    path, test = tmp_path / "test.uff", computed()
    write_synthetic(OutputFile(path), test)
    read = measured_test([path])
    np.testing.assert_allclose(read.responses.frequency_hz, test.frequency_hz, rtol=1e-9)
    np.testing.assert_allclose(
        read.responses.H[:, 0], test.H, rtol=1e-5, atol=1e-6 * np.abs(test.H).max()
    )
    assert read.title == SYNTHETIC and "SYNTHETIC" in path.read_text()


def test_measured_damping_reaches_the_scene_only_when_all_four_are_known(csv):
    report = hammer_test(csv, RIG).report
    changed, wanted = applied(scene("rig-rom"), report, "1,3")
    assert changed.damping == scene("rig-rom").damping
    assert wanted[3] == report.targets[3]
    with pytest.raises(InvalidScene, match=r"no resonance near modes \[4\]"):
        applied(scene("rig-rom"), report, "1,4")


@pytest.mark.parametrize(
    ("name", "text", "sentence"),
    [
        ("a.txt", "", "must end in"),
        ("none.csv", None, "does not exist"),
        ("empty.csv", "", "no samples below a header line"),
        ("words.csv", "f,re,im\na,b,c\n", "no frequency responses"),
        ("excel.csv", "f;re;im\n1,5;2,5;3\n", "line 2 is not numbers with decimal points"),
        ("two.csv", "f,re\n1,2\n2,3\n", "2 columns"),
        ("short.csv", "f,re,im\n" + "".join(f"{i},1,0\n" for i in range(9)), "at least 40"),
        (
            "nan.csv",
            "f,re,im\n" + "".join(f"{i},nan,0\n" for i in range(60)),
            "line 2 has no number",
        ),
        ("flat.csv", "f,re,im\n" + "".join(f"{i},1,0\n" for i in range(60)), "no peaks"),
        ("bad.uff", "    -1\n    58\n", "no frequency responses"),
        ("bare.uff", "    -1\n    15\n    -1\n", "shapes alone .* are targets of modes and tune"),
    ],
)
def test_files_without_a_test_are_refused_in_a_sentence(tmp_path, name, text, sentence):
    path = tmp_path / name
    if text is not None:
        path.write_text(text)
    with pytest.raises(InvalidScene, match=sentence):
        hammer_test(path, RIG)


CLEAN = HammerDefects(noise=0.01, double=0.0, overload=0.0, cross=0.0)


@pytest.fixture(scope="module")
def hits():
    """Three hits at each of four points, two sensors, three modes; no second is cut off."""
    return synthetic_hits(4, CLEAN, points=4, references=2, repeats=3, modes=3, duration=1.0)


def as_csv(path, t, force, response, point, sensors):
    header = ",".join(
        ["time [s]", f"force {point} [N]", *(f"response {s} [m/s^2]" for s in sensors)]
    )
    table = np.column_stack([t, force, response.T])
    np.savetxt(path, table, delimiter=",", header=header, comments="", fmt="%.7g")
    return path


def as_wav(path, rate, channels):
    scaled = np.array(channels).T / np.abs(channels).max()
    wavfile.write(path, rate, scaled.astype(np.float32))
    return path


def near(report, test):
    np.testing.assert_allclose(
        [row.frequency_hz for row in report.rows], test.frequency_hz, rtol=1e-3
    )
    np.testing.assert_allclose([row.zeta for row in report.rows], test.zeta, rtol=0.1)


BAND = Choice(band_hz=(40.0, 950.0))
NAMES, SENSORS = ("1+z", "2+z", "3-z", "4+z"), ("2+z", "4+x")


def test_hits_in_csv_files_give_the_modes_whose_hits_they_are(hits, tmp_path):
    """One file a hit, the point in the heading; and one file a point with its hits in a row."""
    records, t = hits.hits, np.arange(hits.hits.force.shape[1]) * hits.hits.dt
    single, joined = [], []
    for p, name in enumerate(NAMES):
        rows = np.flatnonzero(records.point == p)
        for r in rows:
            path = tmp_path / f"hit_{r}.csv"
            single.append(as_csv(path, t, records.force[r], records.response[r], name, SENSORS))
        long = np.arange(len(rows) * len(t)) * records.dt
        response = np.concatenate(records.response[rows], axis=1)
        path = tmp_path / f"point_{p}.csv"
        joined.append(
            as_csv(path, long, np.concatenate(records.force[rows]), response, name, SENSORS)
        )
    one = hammer_test(single, {}, choice=BAND)
    near(one.report, hits)
    assert one.test.responses.points == NAMES
    assert one.report.rows[0].coherence > 0.9
    near(hammer_test(joined, {}, choice=BAND).report, hits)


def test_hits_as_wav_and_mat_files_give_the_same_modes(hits, tmp_path):
    records = hits.hits
    paths = [
        as_wav(tmp_path / f"{NAMES[p]}_{r}.wav", 4096, [f, *x])
        for r, (p, f, x) in enumerate(
            zip(records.point, records.force, records.response, strict=True)
        )
    ]
    test = hammer_test(paths, {}, choice=BAND)
    near(test.report, hits)
    assert sorted(test.test.responses.points) == sorted(NAMES)
    path = tmp_path / "hits.mat"
    savemat(path, {
        "dt": records.dt, "force": records.force.T, "response": records.response.transpose(2, 1, 0),
        "points": [NAMES[p] for p in records.point], "sensors": list(SENSORS),
    })  # fmt: skip
    test = hammer_test(path, {}, choice=BAND)
    near(test.report, hits)
    assert test.test.responses.references == SENSORS


def test_sensors_that_are_moved_are_references_beside_each_other(hits, tmp_path):
    """Each sensor in files of its own, of all hits: the responses are those of both at once."""
    records, t = hits.hits, np.arange(hits.hits.force.shape[1]) * hits.hits.dt
    paths = [
        as_csv(
            tmp_path / f"s{s}_{r}.csv", t, records.force[r], records.response[r, s : s + 1],
            NAMES[records.point[r]], SENSORS[s : s + 1],
        )
        for s in range(2) for r in range(len(records.force))
    ]  # fmt: skip
    test = hammer_test(paths, {}, choice=BAND)
    assert test.test.responses.H.shape[:2] == (4, 2)
    near(test.report, hits)


def test_universal_files_of_hits_hold_points_and_come_back_as_targets(hits, tmp_path):
    pyuff = pytest.importorskip("pyuff", reason="universal files are the extra `identify`")
    records, t = hits.hits, np.arange(hits.hits.force.shape[1]) * hits.hits.dt
    path, file = tmp_path / "hits.uff", pyuff.UFF(str(tmp_path / "hits.uff"))
    nodes, zero = list(range(1, 5)), [0] * 4
    x = [0.1, 0.2, 0.3, 0.4]
    file.write_sets(pyuff.prepare_15(nodes, zero, zero, zero, x, x, x), mode="overwrite")
    for p, f, x in zip(records.point, records.force, records.response, strict=True):
        ends = [(int(p) + 1, 3, 13, f), (2, 3, 12, x[0]), (4, 1, 12, x[1])]
        for node, direction, kind, values in ends:
            one = pyuff.prepare_58(
                binary=0, func_type=1, rsp_node=node, rsp_dir=direction, ref_node=int(p) + 1,
                ref_dir=3, data=values, x=t, id1="test", rsp_ent_name="r", ref_ent_name="h",
                abscissa_spacing=1, abscissa_spec_data_type=17, ordinate_spec_data_type=kind,
                orddenom_spec_data_type=0,
            )  # fmt: skip
            file.write_sets(one, mode="add")
    test = hammer_test(path, {}, choice=BAND)
    near(test.report, hits)
    assert set(test.test.nodes) == {1, 2, 3, 4}
    modes = tmp_path / "modes.uff"
    write_modes(modes, test.test, test.modes.frequency_hz, test.modes.zeta, test.modes.phi)
    for i, hz in enumerate(test.modes.frequency_hz):
        shape = measured_shape(modes, float(hz))
        assert mac(shape.values[:, None], hits.phi[:, [i]])[0, 0] > 0.95


def test_responses_of_universal_files_are_scaled_by_their_unit():
    """g, mm/s^2 and a unit that is no word of ours, by type accelerations; unit against type."""
    t = np.arange(100) / 1000

    def channels(unit, kind=12):
        shared = {"func_type": 1, "x": t, "id1": "", "rsp_node": 1, "ref_node": 1, "ref_dir": 3}
        force = {**shared, "rsp_dir": 3, "ordinate_spec_data_type": 13, "data": np.sin(t)}
        motion = {"rsp_dir": 1, "ordinate_spec_data_type": kind, "ordinate_axis_units_lab": unit}
        return [force, {**shared, **motion, "data": np.cos(t)}]

    for unit, scale in (("g", 9.80665), ("mm/s^2", 1e-3), ("NONE", 1.0)):
        (record,) = records_of_data_sets(channels(unit))
        np.testing.assert_allclose(record.response[0], scale * np.cos(t), rtol=1e-12)
        assert record.quantity == "accelerations"
    assert records_of_data_sets(channels("mm/s", kind=0))[0].quantity == "velocities"
    with pytest.raises(ValueError, match="in mm/s is one of accelerations by its type"):
        records_of_data_sets(channels("mm/s"))


def test_files_that_are_not_written_without_pyuff_are_named_with_what_adds_it(csv, monkeypatch):
    monkeypatch.chdir(csv.parent)
    monkeypatch.setattr("beadwave.workflows.structure.api.find_spec", lambda name: None)
    report = beadwave.hammer(csv, "rig-rom", out="made").report
    assert "modes.uff is not written" in report.text() and not Path("made/modes.uff").exists()
    assert "./install.sh identify" in Path("made/modes.json").read_text()


def test_a_band_outside_of_the_responses_is_refused_with_what_they_hold(csv):
    with pytest.raises(InvalidScene, match=r"--band 90000:200000 holds 0 .* reach from .* Hz"):
        hammer_test(csv, RIG, choice=Choice(band_hz=(9e4, 2e5)))


def test_a_number_of_a_pole_that_is_none_is_refused(csv):
    with pytest.raises(InvalidScene, match="--accept 3,b must be numbers of poles, as 3,7"):
        beadwave.hammer(csv, "rig-rom", reject="1,2", accept="3,b")


def test_poles_are_rejected_and_accepted_by_their_numbers(csv):
    """The rest is fitted anew; a number that is none of a pole is refused with those there are."""
    report = hammer_test(csv, RIG).report
    first = report.rows[0].number
    rest = hammer_test(csv, RIG, choice=Choice(reject=(first,))).report
    assert [row.number for row in rest.rows] == [row.number for row in report.rows[1:]]
    assert {row.number: row.reason for row in rest.left_out}[first] == "rejected"
    assert rest.steps[-1].options["reject"] == str(first)
    with pytest.raises(InvalidScene, match="pole 99 is none: they are numbered 1 to"):
        hammer_test(csv, RIG, choice=Choice(reject=(99,)))
    for row in report.left_out[:1]:
        more = hammer_test(csv, RIG, choice=Choice(accept=(row.number,))).report
        assert row.number in [r.number for r in more.rows]


def test_a_sensor_against_its_direction_at_some_modes_is_named(hits, tmp_path):
    """At point 2 sensor 1 and hammer are one: its residues have one phase until points mix."""
    test = hammer_test_of(hits)
    driving = test.test.responses.points.index("2+z")
    opposite = test.modes.phi.copy()
    assert opposite_directions(test.test, test.modes) == []
    opposite[driving, 0] *= -1
    (sentence,) = opposite_directions(test.test, test.modes._replace(phi=opposite))
    assert "driving point 2+z: 1 of 3 modes move against the others" in sentence


def test_a_sensor_that_looks_against_the_hammer_is_named_where_its_quantity_is_known(
    hits, tmp_path
):
    """Hits along -z that are said to be along +z: accelerations at the driving point are against
    the force. Said rightly, or without a unit, there is nothing to say."""
    records, t = hits.hits, np.arange(hits.hits.force.shape[1]) * hits.hits.dt
    at = [int(np.abs(hits.phi - phi).sum(axis=1).argmin()) for phi in hits.phi_at_sensors]
    sensors = [f"{p + 1}+z" for p in at]

    def remarks(sign, named):
        names = [f"{p + 1}{'-' if named else '+'}z" for p in range(4)]
        paths = [
            as_csv(
                tmp_path / f"r{r}.csv", t, records.force[r], sign * records.response[r],
                names[records.point[r]], sensors,
            )
            for r in range(len(records.force))
        ]  # fmt: skip
        return hammer_test(paths, {}, choice=BAND).report.remarks

    assert remarks(1, False) == []
    assert all("hammer and sensor point against each other" in r for r in remarks(-1, False))
    assert len(remarks(-1, False)) == 2
    assert remarks(-1, True) == []


def hammer_test_of(hits):
    """The truth as modes with one sensor at the second point, along the direction of its hits."""
    responses = FrequencyResponses(np.zeros(1), np.zeros((4, 1, 1)), NAMES, ("2+z",))
    phi = hits.phi.astype(complex)
    modes = hammer_modes(phi, 1j * hits.phi[1][:, None])
    return IdentifiedTest(None, MeasuredTest(responses, "", {}, ()), modes)


def hammer_modes(phi, L):
    n = phi.shape[1]
    ones = np.ones(n)
    return IdentifiedModes(ones, ones, ones, phi, L, ones, ones, ones, ones, ones, (), (), ())


RECORDS = {
    "two-forces.csv": ("time [s], force 1 [N], force 2 [N]\n0,1,2\n", "two columns of a force"),
    "no-response.csv": ("time [s], force 1 [N]\n0,1\n", "no column with a response"),
    "unit.csv": ("time [s], force 1 [bar], response 2\n0,1,2\n", "unit of its force is 'bar'"),
    "unit-2.csv": (
        "time [s], force 1 [N], response 2 [km]\n0,1,2\n",
        "unit of 'response 2 .km.' is 'km'",
    ),
    "two-kinds.csv": (
        "time [s], force 1 [N], response 2 [g], response 3 [mm]\n0,1,2,3\n",
        "responses are accelerations and displacements; shapes need one quantity",
    ),
    "cut.csv": ("time [s], force 1 [N], response 2\n0,1,2\n1,2", "line 3 has 2 cells"),
    "minutes.csv": ("time [min], force 1 [N], response 2\n0,1,2\n", r"'time \[s\]' is needed"),
    "short.csv": ("time [s], force 1 [N], response 2\n0,1,2\n1,2,3\n", "at least 64"),
    "nan.csv": (
        "time [s], force [N], a\n" + "".join(f"{i / 100},{i == 5:d},nan\n" for i in range(99)),
        "line 2 has no number in the column 'a'",
    ),
    "quiet.csv": (
        "time [s], force [N], a\n" + "".join(f"{i / 100},0,{i % 3}\n" for i in range(99)),
        "no pulse in the force",
    ),
    "back.csv": (
        "time [s], force [N], a\n" + "".join(f"{i % 7},0,1\n" for i in range(99)),
        "time does not grow at sample 8",
    ),
}


@pytest.mark.parametrize("name", RECORDS)
def test_records_that_cannot_be_used_are_refused_in_a_sentence(tmp_path, name):
    content, sentence = RECORDS[name]
    path = tmp_path / name
    path.write_text(content)
    with pytest.raises(InvalidScene, match=sentence):
        hammer_test(path, RIG)


def test_files_of_two_kinds_or_of_unlike_sampling_are_refused(csv, tmp_path):
    rng, paths = np.random.default_rng(0), []
    for name, dt in (("a.csv", 1e-3), ("b.csv", 2e-3)):
        t, pulse = np.arange(200) * dt, np.zeros(200)
        pulse[20:23] = 1.0
        as_csv(tmp_path / name, t, pulse, rng.normal(size=(1, 200)), "1+z", ["2+z"])
        paths.append(tmp_path / name)
    with pytest.raises(InvalidScene, match="some files hold responses and others time records"):
        hammer_test([csv, paths[0]], RIG)
    with pytest.raises(InvalidScene, match=r"sampled every 0\.001 s and every 0\.002 s"):
        hammer_test(paths, RIG)


def written(path, t, y, names):
    header = ",".join(["time [s]", *(f"response {name} [m/s^2]" for name in names)])
    np.savetxt(path, np.column_stack([t, y.T]), delimiter=",", header=header, comments="")
    return path


def test_a_ring_down_shows_damping_over_amplitude_and_says_so(tmp_path):
    """The first mode's damping grows from 0.2 % with its amplitude, the second's is 0.3 %."""
    rng, t = np.random.default_rng(0), np.arange(3 * 4096) / 4096
    e = np.exp(-2 * np.pi * 120.0 * 0.002 * t)
    first = 0.002 * e / (0.002 + 0.004 * (1 - e)) * np.cos(2 * np.pi * 120.0 * t)
    second = np.exp(-2 * np.pi * 300.0 * 0.003 * t) * np.cos(2 * np.pi * 300.0 * t)
    y = np.outer([1.0, 0.5, -0.7], first) + np.outer([0.8, -1.0, 0.3], second)
    y += 0.002 * rng.normal(size=y.shape)
    path = written(tmp_path / "decay.csv", t, y, ("1+z", "2+z", "3+z"))
    test = hammer_test(path, {}, choice=Choice(band_hz=(50.0, 500.0)))
    assert test.test.kind == "ring-downs"
    by_hz = {round(row.frequency_hz, -1): row for row in test.report.rows}
    assert any("damping depends on amplitude" in remark for remark in by_hz[120].remarks)
    assert by_hz[120].over_amplitude[0].zeta > 1.5 * by_hz[120].over_amplitude[-1].zeta
    assert not any("amplitude" in remark for remark in by_hz[300].remarks)
    assert by_hz[300].zeta == pytest.approx(0.003, rel=0.05)
    assert "decay" in [picture.name for picture in pictures(test)]


@pytest.mark.slow
def test_ambient_records_are_identified_without_a_force(tmp_path):
    y, _ = ambient(0, 90.0)
    path = written(
        tmp_path / "ambient.csv", np.arange(y.shape[1]) / 512, y, [f"{i}+z" for i in range(1, 6)]
    )
    test = hammer_test(path, {}, choice=Choice(band_hz=(6.0, 100.0)))
    assert test.test.kind == "ambient"
    np.testing.assert_allclose([row.frequency_hz for row in test.report.rows], F, rtol=0.01)
    assert [step.step for step in test.report.steps][-1] == "subspace identification"
    assert {"hammer", "synthesis", "automac"} <= {picture.name for picture in pictures(test)}


def test_points_in_millimetres_are_those_in_metres_where_the_header_says_so(tmp_path):
    (tmp_path / "m.csv").write_text("node,x,y,z,direction\n1,0.16,-0.015,0.04,-y\n2,0,0,1,\n")
    (tmp_path / "mm.csv").write_text(
        "node,x [mm],y [mm],z [mm],direction\n1,160,-15,40,-y\n2,0,0,1000,\n"
    )
    (one, signs), (other, others) = (
        points_and_directions(tmp_path / f"{u}.csv") for u in ("m", "mm")
    )
    assert signs == others and one.keys() == other.keys() == {1, 2}
    for node in one:
        np.testing.assert_allclose(other[node], one[node], rtol=1e-15)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("1,0.1,0.2,0.3\n2,0.1,0.2,0.4\n", "its first line holds numbers, not names of columns"),
        ("node,z,y,x\n1,0.1,0.2,0.3\n", "its columns are node, z, y, x"),
        ("node,x [in],y,z\n1,0.1,0.2,0.3\n", "the units in, not m or mm"),
        ("node,x [m],y [mm],z\n1,0.1,0.2,0.3\n", "the units m, mm, not m or mm"),
        ("node,x,y,z\n1,0.1,0.2,0.3\n1,0.1,0.2,0.4\n", "node 1 stands in two lines"),
    ],
)
def test_points_that_can_be_misread_are_refused(text, words, tmp_path):
    (tmp_path / "points.csv").write_text(text)
    with pytest.raises(InvalidScene, match=re.escape(words)):
        points_and_directions(tmp_path / "points.csv")


def struck_three_modes(rng, dt=1 / 2048, k=1024, noise=1e-3, samples=6):
    """Force (k,) and accelerations (2, k) at two points of a structure of 80, 190 and 330 Hz; a
    Hann pulse of `samples` steps, whose spectrum is null at 2 / (samples dt)."""
    pulse = np.zeros(k)
    pulse[40 : 40 + samples + 1] = 100 * np.sin(np.pi * np.arange(samples + 1) / samples) ** 2
    w = 2 * np.pi * np.fft.rfftfreq(8 * k, dt)  # padded: ring-downs do not come round
    modes = [(80.0, 0.0099, 1.0), (190.0, 0.008, -0.6), (330.0, 0.012, 0.8)]
    H = np.zeros((2, len(w)), complex)
    for hz, zeta, at_two in modes:
        o = 2 * np.pi * hz
        H += np.outer([1.0, at_two], -(w**2) / (o**2 - w**2 + 2j * zeta * o * w))
    y = np.fft.irfft(H * np.fft.rfft(pulse, 8 * k))[:, :k]
    f = pulse + noise * 100 * rng.normal(size=k)
    return f, y + noise * np.abs(y).max() * rng.normal(size=y.shape)


def hit_files(folder, hits, dt=1 / 2048):
    paths = []
    for i, (force, response) in enumerate(hits, start=1):
        paths.append(folder / f"1+z_{i}.csv")
        as_csv(paths[-1], np.arange(len(force)) * dt, force, response, "1+z", ["1+z", "2+z"])
    return paths


@pytest.mark.slow
def test_a_hit_given_twice_is_named_and_counts_once(tmp_path):
    rng = np.random.default_rng(0)
    hit, other = (struck_three_modes(rng) for _ in range(2))
    once, twice, with_other = (
        hit_files(folder, hits)
        for folder, hits in (
            (tmp_path / "once", [hit]), (tmp_path / "twice", [hit, hit]),
            (tmp_path / "three", [hit, hit, other]),
        )
        if not folder.mkdir()
    )  # fmt: skip
    alone, again = (beadwave.hammer(paths, band=(10, 500)).report for paths in (once, twice))
    (reading,) = [step for step in again.steps if step.step == "responses of hits"]
    assert reading.left_out == ["1+z_2.csv is left out: its samples are those of 1+z_1.csv"]
    assert [row.frequency_hz for row in again.rows] == [row.frequency_hz for row in alone.rows]
    for row, hz in zip(again.rows, (80.0, 190.0, 330.0), strict=True):
        # deviations of what one hit's fit leaves: three hold the truth
        assert 0 < row.frequency_deviation_hz < 0.5
        assert abs(row.frequency_hz - hz) < 3 * row.frequency_deviation_hz
    three = beadwave.hammer(with_other, band=(10, 500)).report
    assert [step.options["hits"] for step in three.steps if "hits" in step.options] == [2]


def test_hits_that_are_multiples_of_one_another_have_deviations_of_what_the_fit_leaves(tmp_path):
    force, response = struck_three_modes(np.random.default_rng(0))
    hits = Hits(
        1 / 2048, np.array([force, 2 * force]), np.array([response, 2 * response]),
        np.zeros(2, int), ("1+z",), ("1+z", "2+z"), "",
    )  # fmt: skip
    modes = identified_modes(frequency_responses(hits), (10.0, 500.0))
    assert np.all((modes.frequency_deviation > 1e-3) & (modes.frequency_deviation < 0.5))
    assert np.isfinite(modes.phi_deviation).all()


@pytest.mark.slow
@pytest.mark.parametrize("n_hits", [1, 4])
@pytest.mark.parametrize("noise", [0.0, 1e-3, 5e-3])
def test_lines_that_the_force_does_not_excite_are_named_and_left_out(tmp_path, n_hits, noise):
    # the pulse's spectrum is null at 683 Hz, where H is noise over nothing; the structure has three
    # modes. Deviations of four hits with 0.5 % noise were ten times larger with all lines
    rng = np.random.default_rng(3)
    scales = 1 + 0.1 * np.arange(n_hits)
    hits = [[a * x for x in struck_three_modes(rng, noise=noise)] for a in scales]
    report = beadwave.hammer(hit_files(tmp_path, hits)).report
    (sentence,) = [s for s in report.remarks if "hardly excites" in s]
    ranges = re.findall(r"([\d.]+) to ([\d.]+) Hz", sentence)
    assert any(float(low) < 683 < float(high) for low, high in ranges)
    assert all(float(low) > 400 for low, _ in ranges)
    hz = [row.frequency_hz for row in report.rows]
    np.testing.assert_allclose(hz, [80.0, 190.0, 330.0], rtol=1e-3)
    np.testing.assert_allclose([row.zeta for row in report.rows], [0.0099, 0.008, 0.012], rtol=0.03)
    if noise and n_hits > 1:
        assert max(row.frequency_deviation_hz for row in report.rows) < 0.05


@pytest.mark.parametrize("length", [5, 16, 30, 36, 40, 47, 1500])
def test_rejects_a_wav_that_is_cut_off(tmp_path, capsys, length):
    path = tmp_path / "1+z.wav"
    wavfile.write(path, 2048, np.random.default_rng(0).normal(size=(600, 2)).astype(np.float32))
    path.write_bytes(path.read_bytes()[:length])
    assert command_line.beadwave("hammer", path) == 2
    error = capsys.readouterr().err
    assert "it is no WAV file, cut off or damaged; write it anew" in error
    assert error.count("\n") == 1


@pytest.mark.parametrize("seed", range(20))
def test_reads_a_wav_with_changed_bytes_or_rejects_it_in_a_sentence(tmp_path, seed):
    rng, path = np.random.default_rng(seed), tmp_path / "1+z.wav"
    wavfile.write(path, 2048, rng.normal(size=(600, 2)).astype(np.float32))
    changed = bytearray(path.read_bytes())
    for place in rng.integers(0, 60, 3).tolist():
        changed[place] = int(rng.integers(0, 256))
    path.write_bytes(changed)
    with suppress(InvalidScene):
        measured_test([path])


HEAD = "time [s], force 1+z [N], response 1+z [m/s^2], response 2+z [m/s^2]\n"
LINE = "{t},{force},{one},{two}\n"


def small_record(head=HEAD, **changed):
    lines = [
        LINE.format(t=i / 1000, force=int(i == 5), one=i % 7, two=i % 5)
        if i != 9 else LINE.format(**{"t": i / 1000, "force": 0, "one": 1, "two": 1, **changed})
        for i in range(99)
    ]  # fmt: skip
    return head + "".join(lines)


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (small_record(two=1e300), r"sample 10 of 2\+z is 1e\+300, up to 1e\+60"),
        (small_record(force=-1e300), r"sample 10 of the force is -1e\+300, up to 1e\+60"),
        (
            small_record(HEAD.replace("response 2", "response 1")),
            r"two responses of the sensor 1\+z; drop one",
        ),
    ],
)
def test_rejects_huge_samples_and_a_sensor_named_twice(tmp_path, content, sentence):
    path = tmp_path / "record.csv"
    path.write_text(content)
    with pytest.raises(InvalidScene, match=sentence):
        beadwave.hammer(path)


def test_rejects_files_of_one_test_in_different_quantities(tmp_path):
    for name, unit in (("1+z", "m/s^2"), ("2+z", "m/s")):
        (tmp_path / f"{name}.csv").write_text(small_record(HEAD.replace("m/s^2", unit)))
    with pytest.raises(
        InvalidScene, match=r"accelerations \(1\+z.csv\) and velocities \(2\+z.csv\)"
    ):
        beadwave.hammer([tmp_path / "1+z.csv", tmp_path / "2+z.csv"])


def test_rejects_frequencies_below_zero_in_a_mat_file(tmp_path):
    test = computed()
    savemat(tmp_path / "two-sided.mat", {"frequency_hz": LINES - 500.0, "H": test.H})
    with pytest.raises(InvalidScene, match="frequencies below 0 Hz, from -490"):
        beadwave.hammer(tmp_path / "two-sided.mat")


def test_rejects_a_pole_both_accepted_and_rejected(csv):
    with pytest.raises(InvalidScene, match="pole 2 is in --accept and in --reject"):
        beadwave.hammer(csv, accept=(1, 2), reject=(2, 3))


@pytest.mark.parametrize("name", ["1+z.csv", "1+z.mat", "1+z.uff", "1+z.wav"])
def test_rejects_a_file_larger_than_the_memory_before_it_is_read(tmp_path, name):
    with (tmp_path / name).open("wb") as file:
        file.truncate(2**42)  # 4.4 TB, of which the disk holds nothing
    with pytest.raises(InvalidScene, match=r"has 4.4e\+03 GB, and the free memory allows files"):
        beadwave.hammer(tmp_path / name)
