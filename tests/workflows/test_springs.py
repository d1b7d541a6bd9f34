"""[[springs]] of a scene: a box on cords in modes, reduction, run and tuning, and refusals."""

import re
from contextlib import nullcontext
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.linalg import eigh

import beadwave
from beadwave import fem, rom
from beadwave.workflows.files.output_file import OutputFile
from beadwave.workflows.files.scene import scene
from beadwave.workflows.report.render import coil
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.pages.pictures import fixtures
from beadwave.workflows.stages.structure.assembly import dashpots
from beadwave.workflows.structure.export import write_model
from beadwave.workflows.structure.mode_table import mode_table

from command_line import beadwave as beadwave_command

BOX = """
chain = { count = 2, radius = 0.005, density = 7800.0, young = 210e9, poisson = 0.3 }
striker = { velocity = 0.1 }
time = { duration = 1e-4 }
wall = { kind = "rom" }
assembly = { held = [], material = "steel" }
bodies = { box = { box = [0.3, 0.2, 0.05], seed = 0.1 } }
reduction = { kind = "free-modes", modes = 10, to_hz = 5e3 }
strike = { on = "box:-x", at = [0.02, 0.0], radius = 0.005 }
[materials.steel]
young = 210e9
poisson = 0.3
density = 7850.0
[[springs]]
name = "cord"                  # assumed: four cords at the corners
on = "box:+z"
at = [[0.12, 0.07], [-0.12, 0.07], [-0.12, -0.08], [0.11, -0.08]]
radius = "10 mm"
kx = 800.0
ky = 900.0
kz = "4 kN/m"
"""
POINTS = [(0.12, 0.07), (-0.12, 0.07), (-0.12, -0.08), (0.11, -0.08)]
DASHPOTS = {"springs.cord.cx": 3.0, "springs.cord.cy": 2.0, "springs.cord.cz": 8.0}


@pytest.fixture(scope="module", autouse=True)
def folder(module_folder):
    (module_folder / "box.toml").write_text(BOX)
    return module_folder


def pipeline(changes=(), name="box.toml"):
    return pipeline_of(scene(name, dict(changes)), lambda name: nullcontext())


def moved(x, y, z):
    """Displacement (3, 6) of a point under three shifts and three turns."""
    return np.hstack([np.eye(3), [[0, z, -y], [-z, 0, x], [y, -x, 0]]])


def rigid_stiffness(k=(800.0, 900.0, 4000.0)):
    """(6, 6) of the cords under a rigid box, about its middle, by hand."""
    ends = (moved(x, y, 0.025) for x, y in POINTS)
    return sum(end.T @ np.diag(k) @ end for end in ends)


def rigid_compliance(y):
    """[m/N] of a rigid box on its cords pushed along x at (-0.15, y, 0), by hand."""
    w = moved(-0.15, y, 0.0)[0]
    return w @ np.linalg.solve(rigid_stiffness(), w)


def rigid_hz(k=(800.0, 900.0, 4000.0)):
    """Six frequencies of a rigid box on its cords, by hand."""
    a, b, c = 0.3, 0.2, 0.05
    m, K = 7850 * a * b * c, rigid_stiffness(k)
    M = np.diag([m] * 3 + [m / 12 * (p * p + q * q) for p, q in ((b, c), (a, c), (a, b))])
    return np.sqrt(eigh(K, M, eigvals_only=True)) / (2 * np.pi)


def test_a_box_on_cords_has_the_modes_of_a_rigid_body_and_a_known_mesh_error():
    run = pipeline()
    modes, missed = run("modes"), run("missed-energy")
    hz = modes.omega / (2 * np.pi)
    np.testing.assert_allclose(hz[:6], rigid_hz(), rtol=1e-5)
    error = missed.of_frequencies(modes.omega)
    assert missed.unknown == "" and np.all(error[:6] < 1e-5) and np.all(error[6:10] > 1e-5)
    assert "Modes 1, 2, 3, 4, 5, 6 are rigid motions" in mode_table(run).text()
    assert "count the others, mode 7 as 1" in mode_table(run).text()


@pytest.mark.slow
@pytest.mark.parametrize("stiffer", [1.0, 300.0])
def test_the_mesh_s_error_of_a_suspension_is_that_against_a_finer_mesh(stiffer):
    """The dents under discs of 10 mm, of which elements of 100 mm have nothing: 1e-7 to 4e-5."""
    k = {f"springs.cord.k{axis}": stiffer * k for axis, k in (("x", 800), ("y", 900), ("z", 4000))}
    own, finer = pipeline(k), pipeline({**k, "mesh.scale": 0.33})
    omega = own("modes").omega[:6]
    error = own("missed-energy").of_frequencies(own("modes").omega)[:6]
    true = omega / finer("modes").omega[:6] - 1
    # rounding leaves 3e-7 of the softest
    assert np.all(error > true - 3e-7) and np.all(error < 20 * np.maximum(true, 1e-7))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["free-modes", "craig-bampton"])
def test_a_reduced_box_on_cords_answers_as_the_full_one(kind):
    """At rest, where it moves 1e5 times as far as it gives, at its suspension and between its
    elastic modes."""
    run = pipeline({"reduction.kind": kind})
    model, reduced, w = run("model"), run("reduction"), run("contact").w
    static = w @ fem.factorised(model.K).solve(w)
    assert static == pytest.approx(rigid_compliance(0.02), rel=1e-5)
    assert rom.static_compliance(reduced) == pytest.approx(static, rel=1e-6)
    for hz in (3.0, 40.0, 900.0, 3000.0):
        s = (2 * np.pi * hz) ** 2
        full = w @ fem.factorised((model.K - s * model.M).tocsc()).solve(w)
        small = reduced.w @ np.linalg.solve(reduced.K - s * reduced.M, reduced.w)
        assert small == pytest.approx(full, rel=2e-3)


@pytest.mark.slow
def test_cords_along_one_axis_leave_the_others_free():
    """Vertical cords alone: three rigid motions at 0 Hz, and those that they resist as by hand; the
    contact's receptance between the modes as the full one's, far below that of a free mass."""
    run = pipeline({"springs": vertical_alone()})
    hz = run("modes").omega / (2 * np.pi)
    np.testing.assert_allclose(hz[3:6], rigid_hz((0.0, 0.0, 4000.0))[3:], rtol=1e-5)
    assert np.all(hz[:3] < 0.1 * hz[3])
    assert "Modes 1, 2, 3, 4, 5, 6 are rigid motions" in mode_table(run).text()
    model, reduced, w = run("model"), run("reduction"), run("contact").w
    for f in (1.0, 40.0, 900.0, 3000.0):
        s = (2 * np.pi * f) ** 2
        full = w @ fem.factorised((model.K - s * model.M).tocsc()).solve(w)
        small = reduced.w @ np.linalg.solve(reduced.K - s * reduced.M, reduced.w)
        assert small == pytest.approx(full, rel=2e-3)


def vertical_alone():
    return [{k: v for k, v in table()[0].items() if k not in ("kx", "ky")}]


def test_cords_that_leave_a_motion_free_are_refused_where_a_model_needs_what_is_held(capsys):
    Path("vertical.toml").write_text(BOX.replace("kx = 800.0\nky = 900.0\n", ""))
    arguments = "reduce", "vertical.toml", "--set=reduction.kind=craig-bampton", "--out=r.npz"
    assert beadwave_command(*arguments) == 2
    assert "with springs (cord) that leave that motion free" in capsys.readouterr().err
    assert not Path("r.npz").exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"preload.force": 5.0}, "preload.force = 5 N presses"),
        ({"gravity.inclination": 30.0}, "gravity.inclination = 30 deg presses"),
    ],
)
def test_a_force_along_which_cords_hold_nothing_is_refused_by_naming_them(changes, words):
    sentence = f"{words} the structure along the strike, where it moves freely on springs.cord; "
    with pytest.raises(InvalidScene, match=sentence):
        pipeline({"springs": vertical_alone(), **changes})("impact")
    # leaf springs under the spheres give way until these press the structure; cords along the
    # strike hold it
    with pytest.raises(InvalidScene, match=sentence):
        changes_of_chain = {**changes, "leaf_springs.stiffness": 1e3}
        pipeline({"springs": vertical_alone(), **changes_of_chain})("impact")
    run = pipeline({"springs": table(), **changes})("impact")
    assert np.isfinite(run.trajectory.v).all()


@pytest.mark.slow
def test_dashpots_beside_cords_damp_the_reduced_model_as_the_full_one():
    """Complex receptances at the suspension's modes, where damping decides, and far above."""
    run = pipeline(DASHPOTS)
    model, reduced, w = run("model"), run("reduction"), run("contact").w
    C = dashpots(run.scene, model)
    for hz in (*rigid_hz(), 50.0, 3000.0):
        s = 2 * np.pi * hz
        A = (model.K + 1j * s * C - s**2 * model.M).tocsc()
        full = w @ np.linalg.solve(A.toarray(), w) if A.shape[0] < 400 else w @ solved(A, w)
        small = reduced.w @ np.linalg.solve(
            reduced.K + 1j * s * reduced.C - s**2 * reduced.M, reduced.w
        )
        assert abs(small / full - 1) < 2e-3


def solved(A, w):
    from scipy.sparse.linalg import splu

    return splu(A).solve(w.astype(complex))


def table(**changes):
    usual = {"name": "cord", "on": "box:+z", "at": [list(p) for p in POINTS], "radius": 0.01}
    return [usual | {"kx": 800.0, "ky": 900.0, "kz": 4000.0} | changes]


@pytest.mark.slow
def test_a_run_on_cords_is_that_of_the_box_that_floats_until_the_cords_notice():
    """0.1 ms are 1e-3 of the suspension's period: velocities agree to that squared and the errors
    of both reductions."""
    hung, free = (pipeline({"springs": s})("impact").trajectory for s in (table(), []))
    t = np.linspace(0, 1e-4, 200)
    v = [np.interp(t, run.t, run.v[:, 1]) for run in (hung, free)]
    assert np.abs(v[0] - v[1]).max() < 1e-4 * 0.1
    assert np.abs(v[0]).max() > 0.05


@pytest.mark.slow
def test_tune_finds_modulus_and_cords_of_a_box():
    """Targets are the full model's: modes by number count those that strain the box, its heave is
    known by its motion. A modulus 10 % higher and cords 30 % stiffer."""
    changes = {"materials.steel.young": 231e9, "springs": table(kz=5200.0)}
    hz = pipeline(changes)("modes").omega / (2 * np.pi)
    heave = rigid_hz((800.0, 900.0, 5200.0))
    motions = [{"hz": float(hz[6]), "number": 1}, {"hz": float(hz[7]), "number": 2}]
    i = int(np.abs(hz[:6] - np.sqrt(4 * 5200 / 23.55) / (2 * np.pi)).argmin())
    assert hz[i] == pytest.approx(heave[i], rel=1e-5)
    targets = [*motions, {"hz": float(hz[i]), "body": "box", "motion": "z"}]
    tuned = beadwave.tune(
        "box.toml",
        changes={"targets": targets},
        match={1: targets[0]["hz"], 2: targets[1]["hz"], 3: targets[2]["hz"]},
        free=["materials.steel.young", "springs.cord.kz"],
    )
    assert tuned.scene.materials["steel"].young == pytest.approx(231e9, rel=1e-3)
    assert tuned.scene.springs[0].kz == pytest.approx(5200.0, rel=1e-3)


REFUSED = {
    "springs has 2 tables named 'cord'; give each a name of its own": table() * 2,
    "springs.cord.kx = -1.0 must be greater than 0": table(kx=-1.0),
    "springs.cord.kz = 0.0 must be greater than 0": table(kz=0.0),
    "springs.cord.ky = nan must be": table(ky=float("nan")),
    "springs.cord.ky = inf must be": table(ky=float("inf")),
    "springs.cord: k = 500 N/m to the ground has no direction": table(
        kx=None, ky=None, kz=None, k=500.0
    ),
    "springs.cord: has no stiffness: give kx, ky or kz": table(kx=None, ky=None, kz=None),
    "kx and ky and kz and k exclude each other": table(k=500.0),
    "springs.cord: direction is that of k": table(direction="z"),
    'direction = "up" must be': table(kx=None, ky=None, kz=None, k=500.0, direction="up"),
    "direction = [0.0, 0.0, 0.0] must not be zero": table(
        kx=None, ky=None, kz=None, k=500.0, direction=[0.0, 0.0, 0.0]
    ),
    "springs.cord: c = 3 has no spring: give k in N/m": table(c=3.0),
    'to_at needs a face: give to = "body:-z"': table(to_at=[[0.0, 0.0]]),
    "springs.cord: a disc of radius 0.01 m at [0.145, 0.0] m from the middle of 'box:+z' leaves": (
        table(at=[[0.145, 0.0]])
    ),
    "springs.cord.on: 'box' is no face of a body": table(on="box"),
    "springs.cord.on = 'lid:+z' names no body; there are box": table(on="lid:+z"),
    "springs.cord.to = 'lid:-z' names no body; there are box": table(to="lid:-z"),
    "springs.cord.to: 'earth' is neither": table(to="earth"),
    "box:+q": table(on="box:+q"),
}


@pytest.mark.parametrize("sentence", REFUSED)
def test_what_is_no_spring_is_refused_in_a_sentence(sentence):
    rows = [{k: v for k, v in row.items() if v is not None} for row in REFUSED[sentence]]
    with pytest.raises(InvalidScene, match=re.escape(sentence)) as refused:
        pipeline({"springs": rows})("model")
    print(refused.value)


def test_springs_without_an_assembly_are_refused():
    with pytest.raises(InvalidScene, match=r"\[\[springs\]\] sit on faces of an \[assembly\]"):
        scene("rig-rigid", {"springs": table()})


def test_an_input_deck_without_the_springs_is_refused(folder):
    with pytest.raises(InvalidScene, match=r"\[\[springs\]\] are not written to --inp"):
        write_model(pipeline(), OutputFile(folder / "box.inp", "--inp"), None)


@pytest.mark.slow
def test_a_scan_of_a_box_on_cords_is_that_of_the_box_that_floats(folder):
    """The impact takes 1e-4 of the suspension's period; modes to 10 kHz are beside 2 Hz."""
    forces = []
    for name, springs in (("hung", table()), ("free", [])):
        changes = {"springs": springs}
        result = beadwave.scan("box.toml", changes, grid="2x1", out=folder / f"scan-{name}")
        forces.append(result.columns["wall_peak_force_N"])
    np.testing.assert_allclose(forces[0], forces[1], rtol=1e-4)
    assert np.all(forces[0] > 1.0)


def test_look_lists_springs():
    assert re.search(
        r"cord +box:\+z +ground +4 +kx 800, ky 900, kz 4000", str(beadwave.look("box.toml"))
    )


def test_another_stiffness_keeps_the_mesh():
    one, other = pipeline(), pipeline({"springs.cord.kz": 5e3})
    assert one.key("mesh") == other.key("mesh")
    assert one.key("modes") != other.key("modes")


def test_a_spring_on_a_held_face_is_refused():
    changes = {"assembly.held": ["box:+z"]}
    with pytest.raises(InvalidScene, match=r"springs\.cord: on = 'box:\+z' is held"):
        pipeline(changes)("model")
    pipeline({"assembly.held": ["box:-y"]})("model")


@pytest.mark.slow
def test_a_hammer_test_of_a_box_on_cords_tunes_its_modulus(folder):
    """Points, hits and targets are of the modes that strain the box, numbered from 1; the hits are
    those of a modulus 10 % higher."""
    band = "0:6000"
    plan = beadwave.design_hammer_test("points.csv", 8, "box.toml", band=band)
    assert min(plan.modes_hz) > 1000
    changes = {"materials.steel.young": 231e9, "damping.kind": "modal", "damping.ratio": 0.004}
    points = "points.csv"
    beadwave.write_hammer_test("hits.mat", "box.toml", changes, points=points, band=band)
    beadwave.hammer("hits.mat", "box.toml", points=points, band=band, out="identified")
    report = beadwave.tune(
        "box.toml", hammer="identified/modes.uff", free="materials.steel.young"
    ).report
    assert report.stiffness["materials.steel.young"] == pytest.approx(1.1, rel=1e-3)
    lowest = re.search(r": ([\d.]+) Hz is mode 1, ", report.remarks[0])
    assert float(lowest[1]) == pytest.approx(min(plan.modes_hz) * 1.1**0.5, rel=1e-3)


def test_modes_whose_errors_arise_at_one_place_share_a_sentence():
    table = mode_table(pipeline())
    worst, other, elsewhere = (
        row.model_copy(update={"error_percent": error, "why": f"why {error}", "place": place})
        for row, error, place in zip(
            table.rows[6:], (9.0, 6.0, 7.0), ("there", "there", "here"), strict=False
        )
    )
    rows = [other, worst, elsewhere]
    text = table.model_copy(update={"rows": rows}).text()
    assert f"Mode {worst.number}: why 9.0 The smaller error of mode {other.number} arises" in text
    assert f"Mode {elsewhere.number}: why 7.0" in text and "why 6.0" not in text


@pytest.mark.slow
def test_tune_says_which_modes_numbers_of_targets_are_on_springs():
    """Six modes hang on the cords: number 1 is mode 7."""
    hz = pipeline()("modes").omega[6] / (2 * np.pi)
    match = f"1={1.002 * hz:.6g}"
    remarks = beadwave.tune(
        "box.toml", match=match, free="materials.steel.young", out=None
    ).report.remarks
    assert remarks[0].endswith("not rigid motions, free or on springs: 1 is mode 7.")


CORNERS = [
    [[x * a, y * b] for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    for x, y in ((0.08, 0.05), (0.1, 0.07))
]
STACK = {
    "assembly": {"held": [], "material": "steel"},
    "bodies": {
        "lower": {"box": [0.3, 0.2, 0.05], "seed": 0.1},
        "upper": {"box": [0.2, 0.15, 0.05], "at": [0.0, 0.0, 0.15], "seed": 0.1},
    },
    "materials": {"steel": {"young": 210e9, "poisson": 0.3, "density": 7850.0}},
    "springs": [
        {"name": "mount", "on": "upper:-z", "at": CORNERS[0], "to": "lower:+z"}
        | {"kx": 5e3, "ky": 5e3, "kz": 1e4},
        {"name": "foam", "on": "lower:-z", "at": CORNERS[1]} | {"kx": 5e3, "ky": 5e3, "kz": 5e3},
        {"name": "bungee", "on": "upper:+x", "at": [0.01, 0.0], "k": 1.0, "direction": [1, 0, 1]},
    ],
    "masses": [{"name": "sensor", "on": "lower:+x", "at": [0.02, 0.01], "mass": 0.01}],
}


def test_a_body_on_springs_of_another_heaves_as_two_masses_do():
    """m2 on 4 k2 on m1 on 4 k1; springs of 1 N/m and a mass of 10 g beside 23 kg."""
    hz = pipeline_of(scene(STACK), lambda name: nullcontext())("modes").omega / (2 * np.pi)
    m1, m2 = 7850 * 0.3 * 0.2 * 0.05 + 0.01, 7850 * 0.2 * 0.15 * 0.05
    K = np.array([[2e4 + 4e4, -4e4], [-4e4, 4e4]])
    heave = np.sqrt(eigh(K, np.diag([m1, m2]), eigvals_only=True)) / (2 * np.pi)
    for f in heave:
        assert np.abs(hz / f - 1).min() < 5e-4
    # nothing across the springs: the motion is named
    loose = [spring | {"kx": None, "ky": None} for spring in STACK["springs"][:2]]
    loose = [{k: v for k, v in spring.items() if v is not None} for spring in loose]
    with pytest.raises(
        InvalidScene, match=r"can still move along or about x, y, rz, .* give a spring"
    ):
        pipeline_of(scene(STACK | {"springs": loose}), lambda name: nullcontext())("modes")


def test_one_point_is_a_list_of_one(folder):
    one, several = (scene("box.toml", {"springs": table(at=at)}) for at in ([0.1, 0.0], [[0.1, 0]]))
    assert one.springs == several.springs
    (folder / "one.toml").write_text(re.sub(r"at = \[\[0.12.*", 'at = ["100 mm", 0.0]', BOX))
    assert scene("one.toml").springs[0].at == ((0.1, 0.0),)


@pytest.mark.slow
@pytest.mark.pictures
def test_the_picture_has_each_spring_from_its_face_to_the_ground_or_the_other_body():
    run = pipeline_of(scene(STACK), lambda name: nullcontext())
    drawn = fixtures(run.scene, run("mesh"))
    named = [(name, grounded) for name, *_, grounded in drawn["springs"]]
    assert named == [("mount", False)] * 4 + [("foam", True)] * 4 + [("bungee", True)]
    (_, start, end, _), *_ = drawn["springs"]
    np.testing.assert_allclose(start, [0.08, 0.05, 0.125], atol=1e-12)
    np.testing.assert_allclose(end, [0.08, 0.05, 0.025], atol=1e-12)
    _, start, down, _ = drawn["springs"][4]
    np.testing.assert_allclose([start, down], [[0.1, 0.07, -0.025], [0, 0, -1]], atol=1e-12)
    np.testing.assert_allclose(drawn["springs"][8][2], np.array([1, 0, 1]) / np.sqrt(2), atol=1e-12)
    (mass,) = drawn["masses"]
    assert mass[0] == "sensor" and mass[3] == 0.005
    np.testing.assert_allclose(mass[1:3], [[0.15, 0.02, 0.01], [1, 0, 0]], atol=1e-12)

    whole = Image.open(BytesIO(beadwave.look(STACK, mesh=True).plot().png)).convert("RGB")
    for colour in ((47, 125, 79), (122, 63, 157)):  # SPRING, MASS of report.render
        assert (np.abs(np.asarray(whole, float) - colour).max(axis=2) < 40).sum() > 100


def test_a_coil_is_straight_at_its_ends_and_winds_around_its_axis():
    start, end = np.array([0.1, 0.2, -0.3]), np.array([0.4, -0.2, 0.9])
    path = coil(start, end, 0.02, 7)
    np.testing.assert_allclose([path[0], path[-1]], [start, end], atol=1e-12)
    axis = (end - start) / np.linalg.norm(end - start)
    away = (path - start) - np.outer((path - start) @ axis, axis)
    assert np.linalg.norm(away, axis=1).max() == pytest.approx(0.02)
