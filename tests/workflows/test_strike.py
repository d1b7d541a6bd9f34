"""Strikes on cylinders and spheres by the words of a scene: Hertz' ellipse, the patch, refusals."""

from contextlib import nullcontext
from pathlib import Path

import gmsh
import numpy as np
import pytest

import beadwave
from beadwave import fem
from beadwave.coupling import elliptical_contact
from beadwave.geometry.meshing.gmsh_session import session, silent
from beadwave.workflows.files.scene import scene
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.scene.toml import parsed, resolved
from beadwave.workflows.stages.chain.chain import chain
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.structure.reduction import contact_of

R, SPHERE = 0.03, 0.005  # [m] of the struck face, of the chain
STEEL = "{ young = 210e9, poisson = 0.3, density = 7850.0 }"
HEAD = f"""
chain = {{ count = 2, radius = {SPHERE}, density = 7800.0, young = 210e9, poisson = 0.3 }}
striker = {{ velocity = 0.1 }}
time = {{ duration = 1e-4 }}
wall = {{ kind = "rom" }}
materials = {{ steel = {STEEL} }}
"""
BAR = f"""{HEAD}
assembly = {{ held = ["bar:-z"], material = "steel" }}
bodies = {{ bar = {{ cylinder = {{ radius = {R}, length = 0.08 }}, seed = 0.015 }} }}
[strike]
on = "bar:cylinder"
at = [0.1, 0.0, 0.01]
seed = 2.5e-3
"""
FIBRES = (
    "{ young = [135e9, 9e9, 9e9], poisson = [0.3, 0.3, 0.45], shear = [5e9, 5e9, 3.1e9], "
    "density = 1600.0 }"
)
ROUND_PLY = BAR.replace(STEEL, FIBRES)
PLY = ROUND_PLY.replace("cylinder = { radius = 0.03, length = 0.08 }", "box = [0.06, 0.06, 0.08]")
CUT = f"""{HEAD}
assembly = {{ step = "cut.step", held = ["body:-z"], material = "steel" }}
strike = {{ on = "body@0,0,WHERE", radius = 1e-3, seed = 4e-3 }}
"""

pytestmark = pytest.mark.usefixtures("own_folder")


def pipeline(text, *changes):
    Path("mine.toml").write_text(text)
    return pipeline_of(scene("mine.toml", changes), lambda name: nullcontext())


def last_stiffness(run):
    """k of the contact at the wall over that on a plane of the same material."""
    return run("start").chain.A[-1] / chain(run.scene).A[-1]


def left(run, factor):
    """Static compliance of the structure without its half-space [m/N]."""
    patch, model = run("contact"), run("model")
    return patch.w @ factor.solve(patch.w) - contact_of(run.scene, model, patch).half_space


@pytest.mark.slow
def test_a_struck_cylinder_has_its_ellipse_and_the_patch_does_not_matter():
    """Patches up to R/10, allowed 1e-3 of what is left; measured 5e-5."""
    run = pipeline(BAR)
    assert last_stiffness(run) == elliptical_contact(SPHERE, (0.0, 1 / R)).stiffness < 1
    spot = run("contact").spot
    np.testing.assert_allclose(spot.point, [R, 0.0, 0.01], atol=1e-12)
    np.testing.assert_allclose(spot.inward, [-1.0, 0.0, 0.0], atol=1e-12)
    factor = fem.factorised(run("model").K)
    computed = [left(pipeline(BAR, f"strike.radius={r}"), factor) for r in (5e-4, 1e-3, 2e-3, 3e-3)]
    assert np.ptp(computed) < 1e-3 * computed[1]


def write_cut(path, hollow):
    """A ball cut flat below, or a block with a seat for one, as STEP."""
    with session("nothing drawn"), silent():
        occ = gmsh.model.occ
        ball = occ.addSphere(0, 0, R / 2 if hollow else 0, R)
        block = occ.addBox(-0.04, -0.04, -0.04, 0.08, 0.08, 0.04 if hollow else 0.025)
        occ.cut([(3, block)], [(3, ball)]) if hollow else occ.cut([(3, ball)], [(3, block)])
        occ.synchronize()
        gmsh.write(str(path))


@pytest.mark.slow
@pytest.mark.parametrize(("hollow", "sign", "top"), [(False, 1, R), (True, -1, -R / 2)])
def test_balls_and_seats_of_a_step_file_are_struck(hollow, sign, top):
    write_cut("cut.step", hollow)
    text = CUT.replace("WHERE", f"{top}")
    run = pipeline(text)
    expected = elliptical_contact(SPHERE, (sign / R, sign / R))
    assert last_stiffness(run) == pytest.approx(expected.stiffness, rel=1e-9)
    np.testing.assert_allclose(run("contact").spot.point, [0, 0, top], atol=1e-9)
    factor = fem.factorised(run("model").K)
    small, large = (left(pipeline(text, f"strike.radius={r}"), factor) for r in (1e-3, 3e-3))
    local = contact_of(run.scene, run("model"), run("contact")).half_space
    assert abs(small - large) < 1e-3 * local


@pytest.mark.slow
@pytest.mark.parametrize(("face", "at", "modulus"), [("x", "0, 0", 47.12e9), ("y", "0, 0", 11e9)])
def test_an_orthotropic_face_is_a_flat_of_its_indentation_modulus(face, at, modulus):
    """F = 4/3 E* sqrt(R) delta^(3/2), 1/E* = (1 - nu^2)/E of the sphere + 1/M of the face."""
    from beadwave.workflows.files.output_file import OutputFile
    from beadwave.workflows.structure.export import write_reduced

    text = PLY.replace("bar:cylinder", f"bar:+{face}").replace("[0.1, 0.0, 0.01]", f"[{at}]")
    run = pipeline(text, "reduction.modes=6", "mesh.scale=2")
    M = fem.indentation_modulus(run("mesh").materials["bar"], np.eye(3)["xyz".index(face)])
    assert modulus == pytest.approx(M, rel=1e-3)
    E_star = 1 / ((1 - 0.3**2) / 210e9 + 1 / M)
    stiffness = run("start").chain.A[-1]
    assert stiffness == pytest.approx(4 / 3 * E_star * np.sqrt(SPHERE), rel=1e-9)
    write_reduced(run, OutputFile("rom.npz"))
    far = f"{HEAD.split('materials')[0]}".replace('"rom" }', '"rom", file = "rom.npz" }')
    Path("far.toml").write_text(far)
    again = pipeline_of(scene("far.toml"), lambda name: nullcontext())
    assert again("start").chain.A[-1] == pytest.approx(stiffness, rel=1e-9)


def test_curved_and_orthotropic_at_once_is_refused_and_so_is_its_calibration():
    with pytest.raises(InvalidScene, match="is a curved face of an orthotropic material"):
        pipeline(ROUND_PLY)("start")
    Path("ply.toml").write_text(PLY.replace("bar:cylinder", "bar:+x"))
    lines = [f"{i}e-6,{i % 7}e-3" for i in range(400)]
    Path("velocities.csv").write_text("\n".join(["time [s],sphere 1 [m/s]", *lines]))
    with pytest.raises(InvalidScene, match="of an orthotropic material, which this command does"):
        beadwave.calibrate("ply.toml", "velocities.csv")


@pytest.mark.slow
def test_cases_of_a_sweep_strike_the_face_that_a_run_strikes():
    """A cylinder's ellipse is 4 % softer than the plane's contact."""
    Path("bar.toml").write_text(BAR)
    coarse = {"reduction.modes": 6, "mesh.scale": 2, "output.spheres": [1]}
    alone = beadwave.impact("bar.toml", coarse).summary.peak_wall_force_N
    cases = {"striker.velocity": "0.1,0.2"}
    for key in ({}, {"time.dt": 2e-8}):  # together, and one by one
        computed = beadwave.sweep(
            "bar.toml", coarse | key, cases=cases, out="cases", overwrite=True
        )
        assert computed.columns["wall_peak_force_N"][0] == pytest.approx(alone, rel=1e-3)


def test_a_plane_face_is_struck_at_the_nearest_of_a_point():
    box = BAR.replace("cylinder = { radius = 0.03, length = 0.08 }", "box = [0.06, 0.06, 0.08]")
    box = box.replace("bar:cylinder", "bar:+x")
    from_middle, pointed = (pipeline(box, f"strike.at={at}")("contact") for at in (
        "[0.004, 0.01]", "[0.2, 0.004, 0.01]"))  # fmt: skip
    np.testing.assert_allclose(pointed.spot.point, from_middle.spot.point, atol=1e-12)
    np.testing.assert_allclose(pointed.w, from_middle.w, atol=1e-12)


def test_a_reduced_model_of_a_curved_face_keeps_its_ellipse_in_a_file():
    from beadwave.workflows.files.output_file import OutputFile
    from beadwave.workflows.structure.export import write_reduced

    run = pipeline(BAR, "reduction.modes=6", "mesh.scale=2")
    write_reduced(run, OutputFile("rom.npz"))
    Path("far.toml").write_text(HEAD.replace('"rom" }', '"rom", file = "rom.npz" }')
                                .replace(f"materials = {{ steel = {STEEL} }}\n", ""))  # fmt: skip
    far = pipeline_of(scene("far.toml"), lambda name: nullcontext())
    assert far("start").chain.A[-1] == pytest.approx(run("start").chain.A[-1], rel=1e-12)
    assert far("start").ellipse == pytest.approx(run("start").ellipse, rel=1e-12)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            ("strike.radius=4e-3",),
            r"0\.004 m on a face of curvature radius 0\.03 m is 0\.13",
        ),
        (("strike.at=[0.0, 0.0]",), r"no plane face, .* say where it is struck, at = \[x, y, z\]"),
        (("strike.at=[0.0, 0.0, 0.0]",), "lies in the middle of"),
        (
            ("strike.at=[0.1, 0.0, 0.0395]", "strike.radius=2e-3"),
            r"mine: strike.on = 'bar:cylinder': the patch .* leaves that face",
        ),
        (("strike.at=[0.1]",), r"strike\.at = \[0\.1\] has 1 value; give at least 2"),
        (("contact.law=thornton", "contact.yield_pressure=1e9"), "the face struck is curved"),
    ],
)
def test_what_cannot_be_struck_is_refused_in_a_sentence(changes, message):
    with pytest.raises(InvalidScene, match=message):
        run = pipeline(BAR, *changes)
        run("start"), run("contact")


BLOCK = BAR.replace("cylinder = { radius = 0.03, length = 0.08 }", "box = [0.06, 0.06, 0.08]")


@pytest.mark.parametrize(
    ("text", "changes"),
    [
        (BLOCK, ("strike.on=bar:+z", "strike.at=[0.2, 0.0]")),
        (BLOCK, ("strike.on=bar:+z", "strike.at=[0.0291, 0.0]")),  # only its rim
        (BLOCK, ("strike.on=bar:+z", "strike.at=[0.0, 0.1, 0.04]")),
        (BAR, ("strike.at=[0.1, 0.0, 0.06]",)),
        (CUT.replace("WHERE", f"{R}"), ("strike.on=body:-z", "strike.at=[0.05, 0.0]")),
    ],
)
def test_a_strike_beside_its_face_is_refused_before_anything_is_meshed(text, changes, monkeypatch):
    monkeypatch.setattr("beadwave.geometry.meshing.body_mesh.body_meshes", None)
    write_cut("cut.step", hollow=False)
    with pytest.raises(InvalidScene, match="leaves that face; move it") as refused:
        pipeline(text, *changes)("mesh")
    on = changes[0].partition("=")[2] if "strike.on" in changes[0] else "bar:cylinder"
    said = str(refused.value)
    assert (
        said.startswith(f"mine: strike.on = {on!r}: the patch of radius 0.00") and "(" not in said
    )
    assert "; it lies between [" in said


def test_a_sphere_larger_than_its_hollow_is_refused():
    tables = parsed(BAR, "tight") | {"chain": {**parsed(BAR, "tight")["chain"], "radius": 0.006}}
    tables["bodies"] = {"bar": {"cylinder": {"radius": R, "bore": 0.0055, "length": 0.08}}}
    tables["strike"] = {"on": "bar:hole", "at": [0.1, 0.0, 0.0], "radius": 5e-4}
    tables["mesh"] = {"scale": 2.0}
    with pytest.raises(
        InvalidScene, match=r"0\.006 m does not fit into a hollow of radius 0\.0055"
    ):
        pipeline_of(resolved(tables, "tight"), lambda name: nullcontext())("start")
