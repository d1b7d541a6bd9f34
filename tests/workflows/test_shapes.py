"""Measured shapes as targets: written from a known model with noise, paired by MAC, refused."""

import json
import re
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import beadwave
from beadwave.fem import mac, on_surface
from beadwave.fem.identification.hammer_test import accelerances
from beadwave.fem.identification.measured_shapes import rigid_fit
from beadwave.workflows.files.measured_shape import measured_shape
from beadwave.workflows.files.scene import scene
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.structure.targets import remarks_on_axes
from beadwave.workflows.structure import pairing
from beadwave.workflows.structure.mode_table import mode_table

pyuff = pytest.importorskip("pyuff", reason="universal files are optional (the extra `identify`)")

BEAM = """
materials = { steel = { young = 210e9, poisson = 0.3, density = 7850.0 } }
assembly = { held = ["beam:-x"], material = "steel" }
mesh = { scale = 2.0 }
strike = { on = "beam:+y" }
[bodies.beam]
box = [0.2, 0.012, 0.02]
"""
TARGETS = [4, 0, 2]  # modes measured, in this order; the first one twists
TARGET = '[[targets]]\nhz = {}\nshape = "shapes.uff"\n'
NOISE = 0.03
SHIFT = 1.02  # of measured frequencies over those of the model


def pipeline(text, *changes):
    Path("beam.toml").write_text(text)
    return pipeline_of(scene("beam.toml", changes), lambda name: nullcontext())


@pytest.fixture(scope="module")
def known(tmp_path_factory):
    """Points beside the beam, modes of the model there (k, m, 3), frequencies."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("known"))
        patch.setenv("BEADWAVE_CACHE_DIR", str(Path.cwd()))
        run = pipeline(BEAM)
        model, modes = run("model"), run("modes")
    x = np.linspace(-0.08, 0.1, 7)
    points = np.array([[x, 0.0061, 0.008], [x, 0.006, -0.008]], dtype=object)
    points = np.concatenate([np.column_stack(np.broadcast_arrays(*row)) for row in points])
    P = on_surface(model.structure, points.astype(float)).P
    shapes = (P @ model.T @ modes.phi[:, :8]).T.reshape(8, len(points), 3)
    return points.astype(float), shapes, modes.omega[:8]


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch, known):
    monkeypatch.setenv("BEADWAVE_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)


def noisy(values):
    rng = np.random.default_rng(2)
    return values + NOISE * np.abs(values).max() * rng.standard_normal(values.shape)


def written(*sets, name="shapes.uff"):
    file = pyuff.UFF(name)
    for i, one in enumerate(sets):
        file.write_sets(one, mode="add" if i else "overwrite")


def nodes(points):
    n = len(points)
    x, y, z = points.T
    zero = [0] * n
    return pyuff.prepare_15(list(range(1, n + 1)), zero, zero, zero, list(x), list(y), list(z))


def shape_55(values, hz):
    """Measured along y and z alone."""
    parts = {f"r{i + 1}": values[:, i] * (i > 0) for i in range(3)}
    head = {f"id{i}": "NONE" for i in range(1, 6)}
    return pyuff.prepare_55(
        model_type=1, analysis_type=2, data_ch=2, spec_data_type=8, data_type=2, n_data_per_node=3,
        node_nums=np.arange(1, len(values) + 1), load_case=1, mode_n=1, freq=hz, modal_m=0,
        modal_damp_vis=0.0, modal_damp_his=0.0, **parts, **head,
    )  # fmt: skip


def responses_58(shapes, omega, roving=False, noise=NOISE):
    """Accelerances at all points along y, against y, and z to a hammer that strikes askew."""
    n = shapes.shape[1]
    ends = [(i, axis) for i in range(n) for axis in (1, 2)]
    read = np.array([shapes[:, i, axis] * (-1 if axis == 1 else 1) for i, axis in ends])
    hz = np.arange(50.0, 1.1 * omega.max() / (2 * np.pi), 1.0)
    H = accelerances(read, read[-1] + read[-4], omega, np.full(len(omega), 0.004), hz)
    H = H + noise * np.abs(H).max(axis=0) * np.random.default_rng(3).standard_normal(H.shape)
    for (i, axis), h in zip(ends, H, strict=True):
        there, other = (i + 1, -2 if axis == 1 else 3), (n, 3)
        response, reference = (other, there) if roving else (there, other)
        yield pyuff.prepare_58(
            binary=0, func_type=4, rsp_node=response[0], rsp_dir=response[1],
            ref_node=reference[0], ref_dir=reference[1], data=h, x=hz, id1="test",
            rsp_ent_name="r", ref_ent_name="h", abscissa_spacing=1, abscissa_spec_data_type=18,
            ordinate_spec_data_type=12, orddenom_spec_data_type=13,
        )  # fmt: skip


def measured_hz(known):
    return [SHIFT * known[2][i] / (2 * np.pi) for i in TARGETS]


def paired(known):
    text = BEAM + "".join(TARGET.format(repr(float(hz))) for hz in measured_hz(known))
    modes = pipeline(text)("modes")
    return modes.index.tolist(), modes.score


def test_shapes_of_data_set_55_find_their_modes(known):
    points, shapes, _ = known
    all_hz = zip(TARGETS, measured_hz(known), strict=True)
    written(nodes(points), *(shape_55(noisy(shapes[i]), hz) for i, hz in all_hz))
    index, score = paired(known)
    assert index == TARGETS and np.all(score > 0.98) and np.all(score < 1)


def complex_55(values, eigenvalue, modal_a=0j, modal_b=0j, title="NONE"):
    """A shape with a complex eigenvalue, measured along z."""
    head = {f"id{i}": "NONE" for i in range(2, 6)}
    return pyuff.prepare_55(
        id1=title, model_type=1, analysis_type=3, data_ch=2, spec_data_type=8, data_type=5,
        n_data_per_node=3, node_nums=np.arange(1, len(values) + 1), load_case=0, mode_n=1,
        eig=eigenvalue, modal_a=modal_a, modal_b=modal_b, r1=0j * values, r2=0j * values,
        r3=values.astype(complex), **head,
    )  # fmt: skip


EVIDENCE = {
    "modal A of a modal mass of 1": lambda w, hz: {"modal_a": 2j * w.imag},
    "modal A and B of any scale": lambda w, hz: {"modal_a": 3.7 + 1j, "modal_b": -w * (3.7 + 1j)},
    "a title": lambda w, hz: {"title": f"Mode at {hz:.2f} Hz, 0.2 %"},
}


@pytest.mark.parametrize("unit", [1.0, 2 * np.pi])
@pytest.mark.parametrize("evidence", EVIDENCE)
def test_eigenvalues_of_data_set_55_are_read_in_the_unit_that_they_have(known, evidence, unit):
    points = known[0]
    shapes = np.random.default_rng(0).normal(size=(3, len(points)))
    all_hz = (120.57, 243.44, 757.6)  # the first would be the third, read in the other unit
    sets = []
    for values, hz in zip(shapes, all_hz, strict=True):
        omega = 2 * np.pi * hz * (-0.002 + 1j)
        sets.append(complex_55(values, omega / unit, **EVIDENCE[evidence](omega, hz)))
    written(nodes(points), *sets)
    for values, hz in zip(shapes, all_hz, strict=True):
        shape = measured_shape(Path("shapes.uff"), hz)
        np.testing.assert_allclose(shape.values.real, values, rtol=1e-4)


def test_eigenvalues_of_data_set_55_without_a_hint_are_in_rad_s(known):
    points = known[0]
    values = np.random.default_rng(0).normal(size=len(points))
    written(nodes(points), complex_55(values, 2j * np.pi * 100.0, modal_a=0.3j))
    np.testing.assert_allclose(measured_shape(Path("shapes.uff"), 100.0).values.real, values, 1e-4)
    with pytest.raises(InvalidScene, match=r"there are 100 Hz, eigenvalues being in rad/s unless"):
        measured_shape(Path("shapes.uff"), 628.0)


def test_a_pair_of_frequencies_far_apart_is_doubted_however_like_its_shapes(known):
    points, shapes, omega = known
    hz = omega[4] / (2 * np.pi) / 2.1
    written(nodes(points), shape_55(shapes[4], hz))
    table = mode_table(pipeline(BEAM + TARGET.format(hz)))
    (row,) = [row for row in table.rows if row.hammer_mode]
    assert row.number == 5 and row.score > 0.99
    (warning,) = [sentence for sentence in table.warnings if "shape alone" in sentence]
    assert "2.1 times its frequency" in warning


PLATE = """
assembly = { held = ["plate:+x", "plate:-x", "plate:+y", "plate:-y"], material = "board" }
materials = { board = { young = 25e9, poisson = 0.3, density = 2900.0 } }
[bodies.plate]
box = [0.23424, 0.23424, 0.0013]
"""


@pytest.mark.slow
@pytest.mark.parametrize("scale", [2.5, 2.75, 3.0])
def test_a_double_mode_is_paired_with_the_plane_of_the_computed_pair_on_any_mesh(scale):
    # a clamped square plate: its double mode measured as two, turned by 50 degrees in their plane.
    # Products of (1 - x^2)^2 and x (1 - x^2)^2 are its shapes to a MAC of 0.99
    x = np.array([-0.9, -0.4, 0.4, 0.9, -0.85, -0.4, 0.4, 0.95, 0.0])
    y = np.array([0.85, 0.45, 0.5, 0.9, -0.95, -0.5, -0.45, -0.95, 0.0])
    at = np.column_stack([0.11712 * x, 0.11712 * y, 0 * x])
    bump = (1 - x**2) ** 2 * (1 - y**2) ** 2
    c, s = np.cos(np.radians(50)), np.sin(np.radians(50))
    measured = {
        120.57: bump, 243.44: bump * (c * x + s * y), 248.36: bump * (c * y - s * x),
        362.57: bump * x * y,
    }  # fmt: skip
    zeros = np.zeros_like(x)
    sets = [shape_55(np.column_stack([zeros, zeros, z]), hz) for hz, z in measured.items()]
    written(nodes(at), *sets)
    table = mode_table(
        pipeline(PLATE + "".join(map(TARGET.format, measured)), f"mesh.scale={scale}")
    )
    paired = {row.number: row for row in table.rows if row.hammer_mode}
    assert [row.hammer_hz for row in paired.values()] == sorted(measured)
    assert list(paired) == [1, 2, 3, 4]
    assert all(row.score > 0.97 for row in paired.values())
    assert abs(paired[2].frequency_hz / 247.7 - 1) < 0.01


@pytest.mark.slow
@pytest.mark.parametrize("roving", [False, True])
def test_responses_at_many_points_tell_the_shapes_of_their_peaks(known, roving):
    points, shapes, omega = known
    written(nodes(points), *responses_58(shapes, SHIFT * omega, roving))
    index, score = paired(known)
    assert index == TARGETS and np.all(score > 0.95)


@pytest.mark.slow
def test_a_hammer_test_at_many_points_names_the_modes_by_their_shapes(known):
    """The first two modes of the beam change places in frequency: the nearest would be wrong."""
    points, shapes, omega = known[0][::4], known[1][:, ::4], known[2]
    swapped = SHIFT * omega.copy()
    swapped[[0, 1]] = 1.02 * swapped[1], 0.98 * swapped[0]
    written(nodes(points), *responses_58(shapes[:5], swapped[:5], noise=1e-4))
    targets = [f"[[targets]]\nhz = {omega[i] / 6.2832}\nnumber = {i + 1}\n" for i in (0, 1)]
    Path("beam.toml").write_text(BEAM + "".join(targets))
    report = beadwave.hammer("shapes.uff", "beam.toml").report
    measured = {row.mode: row for row in report.rows if row.mode}
    assert sorted(measured) == [1, 2]
    for number, row in measured.items():
        assert row.frequency_hz == pytest.approx(swapped[number - 1] / (2 * np.pi), rel=2e-3)
        assert row.computed_hz == pytest.approx(omega[number - 1] / (2 * np.pi), rel=1e-6)
        assert row.mac > 0.95
    assert measured[1].frequency_hz > measured[2].frequency_hz
    assert "MAC" in report.text()


@pytest.mark.slow
def test_a_hammer_test_gives_targets_to_a_scene_without_any(known):
    points, shapes, omega = known[0][::4], known[1][:, ::4], known[2]
    written(nodes(points), *responses_58(shapes[:5], SHIFT * omega[:5], noise=1e-4))
    Path("beam.toml").write_text(BEAM)
    tuned = beadwave.tune("beam.toml", hammer="shapes.uff", free="materials.steel.young")
    assert tuned.report.stiffness["materials.steel.young"] == pytest.approx(SHIFT**2, rel=2e-3)
    assert all(target.shape.endswith("shapes.uff") for target in tuned.scene.targets)
    assert tuned.scene.damping.ratio == pytest.approx([0.004] * len(tuned.scene.targets), rel=0.1)
    assert "by the shapes of their points" in tuned.report.remarks[0]
    # the way from the file to the fitted value
    steps = [remark for remark in tuned.report.remarks if remark.startswith("shapes.uff: ")]
    assert steps[0] == "shapes.uff: read responses, responses 8."
    assert steps[1].startswith("shapes.uff: poly-reference identification, from_hz 50, to_hz ")


def test_a_hammer_test_without_points_is_paired_in_the_order_of_frequencies(known):
    shapes, omega = known[1][:5], SHIFT * known[2][:5]
    f = np.arange(50.0, 1.1 * omega[-1] / (2 * np.pi), 1.0)
    read = shapes[:, -1, 1:].T
    H = accelerances(read, read.sum(axis=0), omega, np.full(5, 0.004), f)
    columns = np.column_stack([f, H[0].real, H[0].imag, H[1].real, H[1].imag])
    np.savetxt("point.csv", columns, delimiter=",", header="frequency_hz, re_1, im_1, re_2, im_2")
    Path("beam.toml").write_text(BEAM)
    free = {"free": "materials.steel.young", "match": "1"}
    report = beadwave.tune("beam.toml", hammer="point.csv", **free).report
    assert "in the order of frequencies" in report.remarks[0]
    assert report.match == {"1": pytest.approx(omega[0] / (2 * np.pi), rel=1e-3)}
    assert report.stiffness["materials.steel.young"] == pytest.approx(SHIFT**2, rel=2e-3)


def test_points_in_millimetres_say_so(known):
    points, shapes, _ = known
    millimetres = {"type": 164, "units_code": 5, "units_description": "mm", "temp_mode": 1,
                   "length": 1e3, "force": 1.0, "temp": 1.0, "temp_offset": 0.0}  # fmt: skip
    hz = measured_hz(known)
    sets = [shape_55(shapes[i], f) for i, f in zip(TARGETS, hz, strict=True)]
    written(nodes(1e3 * points), *sets)
    with pytest.raises(InvalidScene, match=r"m from the assembly, allowed .*if they are in mm"):
        paired(known)
    written(millimetres, nodes(1e3 * points), *sets)
    assert paired(known)[0] == TARGETS


def test_a_shape_is_tuned_to_by_the_command(known, capsys):
    from beadwave.workflows.structure.tuning import tuned

    points, shapes, omega = known
    hz = float(SHIFT * omega[2] / (2 * np.pi))
    written(nodes(points), shape_55(noisy(shapes[2]), hz))
    Path("beam.toml").write_text(BEAM + TARGET.format(hz))
    free = ("materials.steel.young",)
    _, report = tuned(scene("beam.toml"), {1: hz}, free, lambda name: nullcontext())
    assert report.stiffness["materials.steel.young"] == pytest.approx(SHIFT**2, rel=1e-6)
    assert report.full_order_hz["1"] == pytest.approx(hz, rel=1e-6)
    assert json.loads(report.model_dump_json())["mac"]["1"] > 0.98
    # a modulus that scales all of K leaves the shape as it was: the MAC is that of the noise
    clean, measured = (values[:, 1:].reshape(-1, 1) for values in (shapes[2], noisy(shapes[2])))
    assert report.measured_mac["1"] == pytest.approx(mac(clean, measured)[0, 0], abs=1e-6)
    assert "measured MAC" in report.text()


@pytest.mark.parametrize(
    ("sets", "message"),
    [
        (lambda p, s: [shape_55(s[0], 100.0)], "it has no points, which data set 15 or 2411 holds"),
        (lambda p, s: [nodes(p)], "neither shapes .* nor frequency responses"),
        (lambda p, s: [nodes(p), shape_55(s[0], 150.0)], "no shape near 100 Hz, there are 150 Hz"),
        (lambda p, s: [nodes(p[:3]), shape_55(s[0], 100.0)], "node 4 has no point"),
        (lambda p, s: [nodes(p[:1]), shape_55(s[0][:1], 100.0)], "2 measured displacements"),
        (lambda p, s: [nodes(p), shape_55(0 * s[0], 100.0)], "0 measured displacements"),
        (
            lambda p, s: [nodes(p), shape_55(0 * s[0], 100.0), shape_55(s[0], 200.0)],
            "the displacements at 100 Hz are zero or no numbers",
        ),
    ],
)
def test_files_without_the_shape_are_refused_in_a_sentence(known, sets, message):
    written(*sets(*known[:2]))
    with pytest.raises(InvalidScene, match=message):
        pipeline(BEAM + TARGET.format(100.0))("modes")


def test_what_is_no_universal_file_is_refused_in_a_sentence():
    for name, content, message in (
        ("shapes.csv", "1,2", r"must end in \.uff or \.unv"),
        ("none.uff", None, "does not exist"),
        ("shapes.uff", "    -1\n    55\n", "holds no shape that can be read"),
        ("shapes.uff", "nothing", "holds no shape that can be read"),
    ):
        if content is not None:
            Path(name).write_text(content)
        with pytest.raises(InvalidScene, match=message):
            pipeline(BEAM + TARGET.format(100.0).replace("shapes.uff", name))("modes")


def driven_at_the_last_point(shapes, omega, scale=1.0):
    """Accelerances of all points to a hammer that strikes the last one along z."""
    n = shapes.shape[1]
    ends = [(i, axis) for i in range(n) for axis in (1, 2)]
    read = np.array([shapes[:, i, axis] for i, axis in ends])
    hz = np.arange(50.0, 1.1 * omega.max() / (2 * np.pi), 1.0)
    H = scale * accelerances(read, shapes[:, -1, 2], omega, np.full(len(omega), 0.004), hz)
    for (i, axis), h in zip(ends, H, strict=True):
        yield pyuff.prepare_58(
            binary=0, func_type=4, rsp_node=i + 1, rsp_dir=axis + 1, ref_node=n, ref_dir=3,
            data=h, x=hz, id1="test", rsp_ent_name="r", ref_ent_name="h", abscissa_spacing=1,
            abscissa_spec_data_type=18, ordinate_spec_data_type=12, orddenom_spec_data_type=13,
        )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scale", "sentence"),
    [
        (1.0, None),
        (1 / 9.80665, "0.102 times what the model gives at .* in g that are called m/s"),
        (3.0, "3 times what .* look at units and sensitivities, or at its mass"),
    ],
)
def test_responses_that_have_not_the_models_size_are_named(known, scale, sentence):
    points, shapes, omega = known[0][::4], known[1][:, ::4], known[2]
    written(nodes(points), *driven_at_the_last_point(shapes[:5], SHIFT * omega[:5], scale))
    Path("beam.toml").write_text(BEAM)
    remarks = beadwave.hammer("shapes.uff", "beam.toml").report.remarks
    of_size = [remark for remark in remarks if "times what the model gives" in remark]
    assert len(of_size) == (sentence is not None)
    assert all(re.search(sentence, remark) for remark in of_size)


def test_one_more_point_is_named_where_two_modes_look_alike(known):
    """Three points near the tip along y see all bending about z alike."""
    run = pipeline(BEAM)
    model, modes = run("model"), run("modes")
    points = np.array([[0.098, 0.006, 0.0], [0.096, 0.006, 0.0], [0.094, 0.006, 0.0]])
    reading = (on_surface(model.structure, points).P @ model.T @ modes.phi)[1::3]
    bending = np.flatnonzero(np.abs(reading[0]) > 0.5 * np.abs(reading).max())[:2]
    assert mac(reading[:, bending[:1]], reading[:, bending[1:]])[0, 0] > 0.8
    sentence = pairing.points_that_tell(model, modes, reading, bending)[0]
    at = np.array([float(x) for x in re.search(r"\[(.*)\]", sentence)[1].split(",")])
    row = "xyz".index(re.search(r"along (.)", sentence)[1])
    both = [int(np.abs(modes.omega / 2 / np.pi - float(hz)).argmin())
            for hz in re.findall(r"([\d.]+) Hz", sentence)]  # fmt: skip
    more = (on_surface(model.structure, at[None]).P @ model.T @ modes.phi)[row]
    with_it = np.vstack([reading, more])[:, both]
    stated = float(re.search(r"MAC ([\d.]+) with it", sentence)[1])
    assert mac(with_it[:, :1], with_it[:, 1:])[0, 0] == pytest.approx(stated, abs=0.01)
    assert stated < 0.5


@pytest.mark.slow
def test_measured_shapes_are_drawn_beside_the_computed_ones_in_their_sense(known, monkeypatch):
    points, shapes, omega = known[0][::4], known[1][:, ::4], known[2]
    written(nodes(points), *responses_58(shapes[:5], SHIFT * omega[:5], noise=1e-4))
    Path("beam.toml").write_text(BEAM)
    drawn = {}

    def rendered(module, field, content, name):
        drawn.update(field=field, content=content)
        return genuine(module, field, content, name)

    genuine = pairing.rendered
    monkeypatch.setattr(pairing, "rendered", rendered)
    test = beadwave.hammer("shapes.uff", "beam.toml", out="out")
    assert Path("out/figures/shapes.png").exists() and Path("out/figures/mac.png").exists()
    assert {picture.name for picture in test.pictures} >= {"mac", "shapes"}
    paired = [row for row in test.report.rows if row.computed_hz is not None]
    assert len(drawn["content"]) == len(paired) == len(drawn["field"].number) == 5
    for i, mode in enumerate(drawn["content"]):
        assert mode["computed"].startswith(f"computed {drawn['field'].frequency_hz[i]:.2f} Hz")
        u = np.array(mode["displacement"])[:, 1:]
        at = [int(np.linalg.norm(points - p, axis=1).argmin()) for p in mode["points"]]
        number = int(drawn["field"].number[i]) - 1
        expected = shapes[number][at][:, 1:]
        likeness = np.sum(u * expected) / np.linalg.norm(u) / np.linalg.norm(expected)
        assert likeness > 0.99, "against the computed mode" if likeness < 0 else "another shape"


@pytest.mark.slow
def test_designed_points_computed_hits_and_their_modes_tune_a_model(capsys):
    """The beam of the hits is 4 % softer: its modulus is found to 0.2 %, twice the deviation of
    0.1 % in frequency."""
    Path("beam.toml").write_text('damping = { kind = "modal", ratio = 0.004 }\n' + BEAM)
    band = (0.0, 3500.0)
    design = beadwave.design_hammer_test("points.csv", 8, "beam.toml", band=band)
    assert len(design.rows) == 8 and design.largest_mac < 0.7
    softer = ["materials.steel.young=201.6e9"]
    beadwave.write_hammer_test("hits.mat", "beam.toml", softer, points="points.csv", band=band)
    test = beadwave.hammer("hits.mat", "beam.toml", points="points.csv", band=band, out="hammer")
    assert [row.computed_hz is not None for row in test.report.rows] == [True] * len(
        design.modes_hz
    )
    assert Path("hammer/modes.json").exists() and Path("hammer/figures/coherence.png").exists()
    Path("aimed.toml").write_text(
        Path("beam.toml").read_text() + Path("hammer/targets.toml").read_text()
    )
    report = beadwave.tune("aimed.toml", free="materials.steel.young").report
    assert report.stiffness["materials.steel.young"] == pytest.approx(0.96, rel=2e-3)

    # the test's deviations go with its frequencies, by the file of targets and by --hammer
    aimed = scene("aimed.toml")
    for table, row in zip(aimed.targets, test.report.rows, strict=True):
        assert table.hz_deviation == pytest.approx(row.frequency_deviation_hz, rel=0.05)
        assert abs(table.hz - row.frequency_hz) < 0.1 * row.frequency_deviation_hz
    direct = beadwave.tune("beam.toml", hammer="hits.mat", free="materials.steel.young").report
    assert max(direct.frequency_error.values()) < 1e-3

    # a node without coordinates is named, and the shapes at the others tell the modes as well
    lines = Path("points.csv").read_text().splitlines()
    missing = lines.pop(3).split(",")
    Path("some.csv").write_text("\n".join(lines))
    some = beadwave.hammer("hits.mat", "beam.toml", points="some.csv", band=band, out="some").report
    assert any(
        remark.startswith(f"1 of 8 points have no coordinates ({missing[0]}+{missing[-1]})")
        for remark in some.remarks
    )
    assert [row.computed_hz for row in some.rows] == [row.computed_hz for row in test.report.rows]
    for row in some.rows:
        assert len(measured_shape(Path("some/modes.uff"), row.frequency_hz).points) == 7


def test_designs_that_cannot_be_are_refused_in_a_sentence():
    Path("beam.toml").write_text(BEAM)
    with pytest.raises(InvalidScene, match=r"2 points tell at most 2 modes .* take --design"):
        beadwave.design_hammer_test("points.csv", 2, "beam.toml")
    with pytest.raises(InvalidScene, match=r"no mode between 1 and 2 Hz"):
        beadwave.design_hammer_test("points.csv", 8, "beam.toml", band=(1.0, 2.0))
    Path("points.csv").write_text("node,x,y,z,direction\n1,0,0,0,up\n")
    with pytest.raises(InvalidScene, match="direction 'up' is none of x, y, z"):
        beadwave.write_hammer_test("hits.mat", "beam.toml", points="points.csv")


TURN = Rotation.from_euler("xyz", [25.0, -40.0, 110.0], degrees=True).as_matrix()
SHIFTED = np.array([0.3, -1.2, 0.45])  # m
CORNERS = np.array([[-0.1, 0.006, 0.01], [0.1, 0.006, 0.01], [0.1, 0.006, -0.01], [0.1, -0.006, 0]])


def in_the_test(points):
    """Points of the beam in axes of a test that are turned and shifted against its own."""
    return (points - SHIFTED) @ TURN


def axes_table(points, at=CORNERS):
    return f"[test_axes]\npoints = {np.asarray(points).tolist()}\nat = {np.asarray(at).tolist()}\n"


def test_a_turn_and_a_shift_are_those_that_scipy_aligns():
    rng = np.random.default_rng(5)
    x = rng.standard_normal((9, 3))
    exact = rigid_fit(in_the_test(x), x)
    np.testing.assert_allclose(exact.turn, TURN, atol=1e-14)
    np.testing.assert_allclose(exact.shift, SHIFTED, atol=1e-14)
    assert exact.misfit.max() < 1e-14 and exact.mirrored > 0.5
    y = x + 0.05 * rng.standard_normal(x.shape)
    rough = rigid_fit(in_the_test(x), y)
    from_0 = in_the_test(x) - in_the_test(x).mean(axis=0)
    turn, rssd = Rotation.align_vectors(y - y.mean(axis=0), from_0)
    np.testing.assert_allclose(rough.turn, turn.as_matrix(), atol=1e-12)
    assert np.sqrt(np.sum(rough.misfit**2)) == pytest.approx(rssd, rel=1e-9)
    # a mirror image is no turn
    mirror = rigid_fit(x * [1, 1, -1], x)
    assert np.linalg.det(mirror.turn) == pytest.approx(1.0) and mirror.mirrored < 1e-12


def test_a_test_in_axes_of_its_own_finds_the_modes_of_the_beam(known):
    """Displacements along two turned axes, without noise: the MAC is 1 to rounding of the file."""
    points, shapes, _ = known
    turned = [(i, shapes[i] @ TURN, hz) for i, hz in zip(TARGETS, measured_hz(known), strict=True)]
    written(nodes(in_the_test(points)), *(shape_55(values, hz) for _, values, hz in turned))
    text = BEAM + "".join(TARGET.format(repr(float(hz))) for hz in measured_hz(known))
    run = pipeline(text + axes_table(in_the_test(CORNERS)))
    modes = run("modes")
    assert modes.index.tolist() == TARGETS and np.all(modes.score > 1 - 1e-6)
    (sentence,) = remarks_on_axes(run.scene)
    assert "4 points of [test_axes] miss their places by up to" in sentence
    with pytest.raises(InvalidScene, match=r"or \[test_axes\] that say how they lie on it"):
        pipeline(text)("modes")


@pytest.mark.parametrize(
    ("points", "at", "sentence"),
    [
        (CORNERS[:3], CORNERS, "points has 3 and at has 4 places: give one each"),
        (CORNERS[:2], CORNERS[:2], "give at least 3"),
        (CORNERS[[0, 1, 1]], CORNERS[:3], "the places of points lie on a line"),
        (1e3 * CORNERS, CORNERS, r"check the order of the points and their unit"),
    ],
)  # fmt: skip
def test_axes_that_no_turn_brings_onto_the_beam_are_refused(known, points, at, sentence):
    shapes = known[1]
    written(nodes(known[0]), shape_55(shapes[0], measured_hz(known)[1]))
    text = BEAM + TARGET.format(repr(float(measured_hz(known)[1])))
    with pytest.raises(InvalidScene, match=sentence):
        pipeline(text + axes_table(points, at), "unusual=['test_axes.points']")("modes")


def test_left_handed_axes_of_a_test_are_named(known):
    written(nodes(known[0]), shape_55(known[1][0], measured_hz(known)[1]))
    text = BEAM + TARGET.format(repr(float(measured_hz(known)[1])))
    places = np.array([[0.1, 0, 0.01], [-0.1, 0, 0.01], [0.1, 0, -0.01], [0.1, 0.06, 0.01]])
    with pytest.raises(InvalidScene, match="change the sign of one axis: the test's are left"):
        pipeline(text + axes_table(places * [1, -1, 1], places))("modes")
