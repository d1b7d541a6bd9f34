"""[[measured]]: a part known by receptances at points, joined to an assembly. All synthetic."""

import json
from contextlib import nullcontext
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse.linalg import eigsh, splu

from beadwave import rom
from beadwave.fem.contact.impact_point import plane_spot
from beadwave.workflows.files.scene import scene
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.scene.places import spring_face
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.pages.pictures import fixtures
from beadwave.workflows.stages.structure.assembly import dashpots
from beadwave.workflows.stages.structure.loss_factors import ratios_of_modes
from beadwave.workflows.stages.structure.measured_parts import fitted_part, rigid_motions
from beadwave.workflows.structure.hammer import accelerances, corner_readings

from command_line import beadwave

pytest.importorskip("pyuff", reason="responses are in a universal file (the extra `identify`)")
pytestmark = pytest.mark.usefixtures("module_folder")
EXAMPLE = Path(__file__).parents[2] / "examples" / "measured_arm.py"
SOFT = "kx = 2e7\nkz = 2e7\n"
TWO = """
[bodies.arm]
box = [0.3, 0.02, 0.04]
at = [0.55, 0.0, 0.0]
[[springs]]
name = "joint"
on = "bar:+x"
at = {at}
radius = 6e-3
to = "arm:-x"
to_at = {to_at}
kx = 2e7
ky = 1e3
kz = 2e7
[[springs]]
name = "keep"
on = "bar:+x"
at = [[{side}, {up}], [-{side}, -{up}]]
radius = 2e-3
to = "arm:-x"
kx = 1e3
"""


@pytest.fixture(scope="module")
def arm(module_folder):
    """The example, its scene and receptances with noise of 0.2 %."""
    spec = spec_from_file_location("measured_arm", EXAMPLE)
    example = module_from_spec(spec)
    spec.loader.exec_module(example)
    example.written(Path())
    return example


def pipeline(path, *changes):
    return pipeline_of(scene(path, changes), lambda _: nullcontext())


def bending(pipeline, n=4):
    modes = pipeline("modes")
    along = np.flatnonzero(modes.effective_mass[:, 2] > 1e-3)[:n]
    return modes.omega[along] / (2 * np.pi), along


@pytest.mark.slow
def test_an_arm_on_springs_has_the_modes_of_both_solids_on_the_same_springs(arm):
    """Each within the error stated of the fit and 0.1 %; measured: 3.2, 0.08, 0.02, 0.04 %,
    where 3.5, 0.11, 0.003 and 0.001 % are stated."""
    text = Path("measured_arm.toml").read_text()
    Path("soft.toml").write_text(text + SOFT)
    table = scene("measured_arm.toml").measured[0]
    joined = pipeline("soft.toml")
    hz, along = bending(joined)
    stated = joined("part-errors")[along]

    # the same discs on both faces, in the axes of each; what these leave free is held softly
    body = text.split("[[measured]]")[0].replace("material =", 'touching = "free"\nmaterial =', 1)
    two = TWO.format(at=[[0, 0]], to_at=[[0, 0]], side=0.004, up=0.004)
    Path("free.toml").write_text(body.replace("[strike]", f"{two}[strike]"))
    mesh = pipeline("free.toml")("mesh")
    places = []
    for name, end in (("bar", "on"), ("arm", "to")):
        face = mesh.face(spring_face("joint", end))
        middle = plane_spot(mesh.meshes[name], mesh.facets(face), face, (0.0, 0.0))
        places.append([(middle.axes @ np.array([0, 0, z])).tolist() for z in (-arm.OFF, arm.OFF)])
    tied = Path("free.toml").read_text().replace("at = [[0, 0]]", f"at = {places[0]}", 1)
    Path("tied.toml").write_text(tied.replace("to_at = [[0, 0]]", f"to_at = {places[1]}"))
    reference, _ = bending(pipeline("tied.toml"))
    off = np.abs(hz / reference - 1)
    assert np.all(off < stated + 1e-3), (off, stated)
    assert table.stiffness == (np.inf,) * 3


def test_rigidly_joined_it_is_a_longer_bar_within_the_joint(arm):
    """Of a Timoshenko beam of both lengths; the mesh makes it 0.5 to 0.7 % stiffer, two discs are
    softer than the whole face, and the fit errs by what it states."""
    joined = pipeline("measured_arm.toml")
    hz, along = bending(joined)
    stated = joined("part-errors")[along]
    assert np.all(np.abs(hz / arm.timoshenko_hz() - 1) < stated + 0.012)


def test_the_joined_matrices_create_no_energy(arm):
    """K, M and C are symmetric and none has a negative eigenvalue, rounding apart; C is that of the
    oscillators alone."""
    model = pipeline("measured_arm.toml")("model")
    C = dashpots(scene("measured_arm.toml"), model)
    for A in (model.K, model.M):
        assert abs(A - A.T).max() <= 1e-12 * abs(A).max()
        assert eigsh(A, 1, sigma=-1e-6 * A.diagonal().min(), return_eigenvectors=False)[0] > 0
    ((part, at),) = model.measured
    np.testing.assert_allclose(C.diagonal()[at], 2 * part.zeta * part.omega)
    assert C.diagonal().sum() == pytest.approx(np.sum(2 * part.zeta * part.omega))


def test_points_on_a_line_across_show_three_rigid_motions(arm):
    part = fitted_part(scene("measured_arm.toml").measured[0])
    assert rigid_motions(part.receptances) == 3
    assert part.fit.free.shape[1] == 3 and part.synthetic
    # along z the free mass is m / 4 at the end of a rod: both points move alike
    z = [i for i, a in enumerate(part.receptances.axis) if a == 2]
    mass = 1 / np.mean(np.sum(part.fit.free[z] ** 2, axis=1))
    assert mass == pytest.approx(0.3 * 0.02 * 0.04 * 7850 / 4, rel=0.03)
    H = rom.modal_receptance(part.fit, part.receptances.frequency_hz)
    assert np.linalg.norm(H - part.receptances.H) < 0.01 * np.linalg.norm(part.receptances.H)


def test_modes_and_look_say_that_the_part_is_synthetic(arm, capsys):
    assert beadwave("modes", "measured_arm.toml") == 0
    said = capsys.readouterr().out
    assert "of parts" in said and "SYNTHETIC, computed, not measured" in said
    assert beadwave("look", "measured_arm.toml") == 0
    said = capsys.readouterr().out
    assert "1x, 1z, 2x, 2z" in said and "SYNTHETIC" in said


def test_pictures_show_each_point_of_the_part_and_that_it_is_synthetic(arm):
    run = pipeline("measured_arm.toml")
    shown = fixtures(run.scene, run("mesh"))
    assert shown["springs"] == []
    assert [name for name, *_ in shown["parts"]] == ["arm, SYNTHETIC"] * 2
    for _, point, out in shown["parts"]:
        assert point[0] == pytest.approx(0.4) and out == pytest.approx([1, 0, 0])


@pytest.mark.slow
def test_the_head_of_a_page_says_that_a_part_is_synthetic(arm):
    assert beadwave("run", "measured_arm.toml", "--out=run", "--quiet") == 0
    assert json.loads(Path("run/summary.json").read_text())["synthetic"] == ["arm"]
    header = Path("run/report.html").read_text().partition("</header>")[0].partition("<header>")[2]
    assert "SYNTHETIC: receptances of arm are computed, not measured" in header


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ('measured.arm.unit="m/N"', 'is none of accelerations, which .* take "m/s.2/N"'),
        ("measured.arm.points=[1,7]", "points has node 7, of which .* there are 1, 2"),
        ('measured.arm.directions="y"', 'directions = "y" has none of those measured'),
        (
            'measured.arm.on="bar:+z"',
            "node 1 .* lies .* off the plane of 'bar:[+]z', allowed",
        ),
        ('measured.arm.on="rod:+z"', "names no body; there are bar"),
        ("measured.arm.at=[[0,0]]", "at needs points"),
        ("measured.arm.highest=100", "lines above 0 Hz and up to measured.arm.highest = 100 Hz"),
        ("measured.arm.lowest=50000", "lines above 0 Hz and from measured.arm.lowest = 50000 Hz"),
        ("measured.arm.radius=0.02", "leaves that face"),
        ('measured.arm.receptance="nowhere.uff"', "nowhere.uff does not exist"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_sentence(arm, change, sentence):
    with pytest.raises(InvalidScene, match=sentence):
        pipeline("measured_arm.toml", change)("model")


def test_a_ring_down_without_a_force_is_refused(arm):
    t = 1e-4 * np.arange(8192)
    v = np.where(t < 5e-3, 0.0, np.exp(-13.0 * (t - 5e-3)) * np.sin(1260.0 * (t - 5e-3)))
    rows = (f"{at:.4f},{of_sensor:.6g}" for at, of_sensor in zip(t, v, strict=True))
    Path("tap.csv").write_text("\n".join(["time [s], response 1+z [m/s]", *rows, ""]))
    with pytest.raises(InvalidScene, match="has ring-downs without a force; give responses"):
        pipeline("measured_arm.toml", 'measured.arm.receptance="tap.csv"')("model")


@pytest.mark.slow
def test_lines_below_the_lowest_are_not_fitted_and_it_is_below_the_highest(arm):
    every = fitted_part(scene("measured_arm.toml").measured[0]).receptances
    from_300 = scene("measured_arm.toml", ["measured.arm.lowest=300"]).measured[0]
    some = fitted_part(from_300).receptances
    np.testing.assert_array_equal(some.frequency_hz, every.frequency_hz[every.frequency_hz >= 300])
    np.testing.assert_array_equal(some.H, every.H[every.frequency_hz >= 300])
    crossed = ["measured.arm.lowest=500", "measured.arm.highest=400"]
    with pytest.raises(InvalidScene, match="lowest = 500 Hz must be below highest = 400 Hz"):
        scene("measured_arm.toml", crossed)


def test_a_deck_does_without_and_says_so(arm, capsys):
    assert beadwave("modes", "measured_arm.toml", "--inp", "deck.inp") == 2
    assert "[[measured]] are not written to --inp" in capsys.readouterr().err


def test_a_virtual_test_has_the_damping_of_the_part(arm):
    """At 420 Hz, near a mode that the arm damps by 1.1e-4 beside the scene's 2e-3, responses are
    7e-4 off a direct solution; without that damping 1.8e-2."""
    joined = pipeline("measured_arm.toml")
    model, modes = joined("model"), joined("modes")
    reading = corner_readings(model, joined.scene.struck_body)
    hit = np.ones(3) / np.sqrt(3)
    phi, f = reading @ modes.phi, np.array([420.0])
    zeta = ratios_of_modes(joined.scene, model, modes)
    H = accelerances(phi, hit @ phi, modes.omega, zeta, f).ravel()

    # (K + s C + s^2 M)^-1 with the scene's ratio of 0.002 for the modes, M phi (2 zeta omega)
    # phi^T M, by the Sherman-Morrison-Woodbury formula
    s, C = 2j * np.pi * f[0], dashpots(joined.scene, model)
    factor = splu((model.K + s * C + s**2 * model.M).tocsc().astype(complex))
    U = model.M @ modes.phi
    response, of_modes = (factor.solve(np.asarray(b, complex)) for b in (hit @ reading, U))
    core = np.diag(1 / (s * 0.004 * modes.omega)) + U.T @ of_modes
    response = response - of_modes @ np.linalg.solve(core, U.T @ response)
    direct = s**2 * (reading @ response)
    assert np.linalg.norm(H - direct) < 3e-3 * np.linalg.norm(direct)


def test_tune_finds_the_modulus_beside_a_measured_part(arm, capsys):
    """Frequencies of the same bar of 195 GPa; the arm's own stay as they were measured."""
    softer = pipeline("measured_arm.toml", "materials.steel.young=195e9")
    hz = softer("modes").omega[:3] / (2 * np.pi)
    match = ",".join(f"{i + 1}={f:.6f}" for i, f in enumerate(hz))
    asked = ("--free=materials.steel.young", f"--match={match}", "--out=tuned.toml", "--json")
    assert beadwave("tune", "measured_arm.toml", *asked) == 0
    assert json.loads(capsys.readouterr().out)
    found = scene("tuned.toml").materials["steel"].young
    assert found == pytest.approx(195e9, rel=1.3e-3)  # two sigma of it are 0.13 %


def test_a_part_that_is_said_to_be_held_has_no_free_masses(arm):
    """The arm moves freely along three motions: without them its modes miss all of its responses
    at low frequencies. One on springs to the ground is fitted as well without."""
    assert fitted_part(scene("measured_arm.toml").measured[0]).fit.free.shape[1] == 3
    with pytest.raises(InvalidScene, match=r"modes miss 100% .*, or that it is held"):
        fitted_part(scene("measured_arm.toml", ["measured.arm.held=true"]).measured[0])

    w, own = 2 * np.pi * np.arange(5.0, 800.0, 2.0), 2 * np.pi * np.array([180.0, 430.0])
    phi = np.array([[0.4, 0.3], [0.3, -0.5]])
    modes = 1 / (own**2 - w[:, None] ** 2 + 0.02j * own * w[:, None])
    H = np.einsum("aj,bj,kj->kab", phi, phi, modes)
    fit = rom.passive_fit(w / (2 * np.pi), H, most_free=0)
    assert not fit.free.size and fit.error < 1e-6
