"""[[measured]]: a part known by receptances at points, joined to an assembly. All synthetic."""

from contextlib import nullcontext
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse.linalg import eigsh

import rom
from command_line import beadwave
from fem.spot import plane_spot
from workflows.files.scene import scene
from workflows.scene import InvalidScene
from workflows.scene.places import spring_face
from workflows.stages.assembly import dashpots
from workflows.stages.measured_parts import fitted_part, rigid_motions
from workflows.stages.pipeline import pipeline_of

pytest.importorskip("pyuff", reason="responses are in a universal file (the extra `identify`)")
pytestmark = pytest.mark.usefixtures("module_folder")
EXAMPLE = Path(__file__).parents[1] / "examples" / "measured_arm.py"
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
    H = rom.matrix_receptance(part.fit, part.receptances.frequency_hz)
    assert np.linalg.norm(H - part.receptances.H) < 0.01 * np.linalg.norm(part.receptances.H)


def test_modes_and_look_say_that_the_part_is_synthetic(arm, capsys):
    assert beadwave("modes", "measured_arm.toml") == 0
    said = capsys.readouterr().out
    assert "of parts" in said and "SYNTHETIC, computed, not measured" in said
    assert beadwave("look", "measured_arm.toml") == 0
    said = capsys.readouterr().out
    assert "1x, 1z, 2x, 2z" in said and "SYNTHETIC" in said


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
