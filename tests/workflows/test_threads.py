"""Shanks in bores: what a thread joins, what it leaves free on purpose, and what is refused."""

from contextlib import nullcontext
from math import pi
from pathlib import Path

import gmsh
import numpy as np
import pytest
from skfem import FacetBasis

from beadwave import rom
from beadwave.geometry.cad.occ import write_step
from beadwave.geometry.cad.shapes import Cylinder
from beadwave.geometry.meshing.gmsh_session import session, silent
from beadwave.workflows.files.scene import scene
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.stages.engine.pipeline import pipeline_of

from command_line import beadwave

pytestmark = pytest.mark.usefixtures("shared_cache")

RADIUS, LENGTH = 5e-3, 0.024  # of the shank [m]
OUTER, HIGH, AT = 9e-3, 6e-3, 0.006  # of the nut [m]
MASS = {"stud": pi * RADIUS**2 * LENGTH * 7850, "nut": pi * (OUTER**2 - RADIUS**2) * HIGH * 7850}

SCENE = """
materials = { steel = { young = 210e9, poisson = 0.3, density = 7850.0 } }
assembly = { held = [], material = "steel" }
strike = { on = "stud:-z", radius = 1e-3 }
reduction = { kind = "free-modes" }
[bodies.stud]
cylinder = { radius = 0.005, length = 0.024 }
seed = 5e-3
[bodies.nut]
cylinder = { radius = 0.009, bore = 0.005, length = 0.006 }
seed = 5e-3
at = [0.0, 0.0, 0.006]
[[joints]]
name = "m10"
between = "stud|nut*"
at = "thread"
"""
SECOND = """
[bodies.nut-2]
cylinder = { radius = 0.009, bore = 0.005, length = 0.006 }
seed = 5e-3
at = [0.0, 0.0, -0.006]
"""


def stages(text=SCENE, *changes):
    Path("thread.toml").write_text(text)
    return pipeline_of(scene("thread.toml", changes), lambda name: nullcontext())


def hz(*order):
    return stages(*order)("modes").omega / (2 * pi)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("more", "changes", "n_free"),
    [
        ("", (), 6),
        ("", ("joints.m10.kz=0", "reduction.modes=20"), 7),
        (SECOND, ("joints.m10.kz=0",), 8),
    ],
)
def test_directions_left_free_on_purpose_are_modes_of_no_frequency(more, changes, n_free):
    stage = stages(SCENE + more, *changes)
    computed = stage("modes").omega / (2 * pi)
    assert computed[n_free - 1] < 1.0 and computed[n_free] > 5e3
    if not more:
        reduced = rom.modal(stage("reduction")).omega
        assert np.count_nonzero(reduced == 0) == n_free
        assert np.abs(computed / (reduced[n_free] / (2 * pi)) - 1).min() < 1e-4


def test_a_nut_on_a_soft_thread_moves_along_it_as_two_masses_on_a_spring():
    """kz = 1e5 N/m, where both bodies are 1e4 times as stiff."""
    stage = stages(SCENE, "joints.m10.kz=1e5")
    (joint,) = stage("mesh").connections.joints
    np.testing.assert_allclose(joint.centre, [0, 0, AT], atol=1e-9)
    np.testing.assert_allclose(np.abs(joint.frame[2]), [0, 0, 1], atol=1e-12)
    expected = np.sqrt(1e5 * sum(1 / mass for mass in MASS.values())) / (2 * pi)
    assert (stage("modes").omega / (2 * pi))[6] == pytest.approx(expected, rel=1e-3)


def test_a_thread_holds_the_length_that_shank_and_bore_have_in_common():
    """The nut reaches 2 mm beyond the stud's end: 4 mm of 6 are engaged, on either body."""
    stage = stages(SCENE, "bodies.nut.at=[0, 0, 0.011]")
    (joint,) = stage("mesh").connections.joints
    np.testing.assert_allclose(joint.centre, [0, 0, 0.010], atol=1e-9)
    for side in (joint.first, joint.second):
        body, name = side.face.split(":")
        mesh = stage("mesh").meshes[body]
        area = FacetBasis(mesh, mesh.elem(), facets=name).dx.sum()
        # of facets that enclose the cylinder's volume, longer than the circle by 0.8 % at most
        assert area == pytest.approx(2 * pi * RADIUS * 4e-3, rel=8e-3)


@pytest.mark.slow
def test_the_parts_of_a_step_file_have_the_modes_of_the_drawn_ones():
    """With 0.8 mm between shank and bore, which bodies that touch do not have."""
    drawn = hz(SCENE, "bodies.stud.cylinder.radius=4.2e-3", "joints.m10.kz=5e8")
    parts = {"stud": Cylinder(4.2e-3, LENGTH), "nut": Cylinder(OUTER, HIGH, RADIUS, at=(0, 0, AT))}
    write_step(parts, Path("parts.step"))
    tables = SCENE.split("[bodies.stud]")[0].replace("held", 'step = "parts.step", held')
    text = f'{tables}[bodies."*"]\nseed = 5e-3\n[[joints]]{SCENE.split("[[joints]]")[1]}kz = 5e8\n'
    read = hz(text)
    np.testing.assert_allclose(read[6:12], drawn[6:12], rtol=2e-3)


@pytest.mark.slow
def test_a_mesh_of_one_s_own_has_the_thread_of_the_drawn_bodies():
    """The nut within the stud's length, both in tetrahedra with 16 edges around."""
    with session(), silent():
        occ = gmsh.model.occ
        stud = occ.addCylinder(0, 0, -LENGTH / 2, 0, 0, LENGTH, RADIUS)
        nut, bore = (occ.addCylinder(0, 0, AT - HIGH / 2, 0, 0, HIGH, r) for r in (OUTER, RADIUS))
        occ.cut([(3, nut)], [(3, bore)])
        occ.synchronize()
        for name, tag in (("stud", stud), ("nut", nut)):
            gmsh.model.setPhysicalName(3, gmsh.model.addPhysicalGroup(3, [tag]), name)
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 16)
        gmsh.model.mesh.generate(3)
        gmsh.write("own.msh")
    tables = SCENE.split("[bodies.stud]")[0].replace("held", 'mesh = "own.msh", held')
    text = f"{tables}[[joints]]{SCENE.split('[[joints]]')[1]}kz = 1e5\n"
    expected = np.sqrt(1e5 * sum(1 / mass for mass in MASS.values())) / (2 * pi)
    assert hz(text)[6] == pytest.approx(expected, rel=0.03)  # 16 edges leave 2.5 % of the masses


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        (["bodies.nut.at=[0, 0, 0.06]"], r'at = "thread" finds no shank .* "stud" has a shank of'),
        (["bodies.nut.at=[0.02, 0, 0.006]"], "finds no shank .* on one axis, up to 20 %"),
        (["bodies.nut.turn=[90, 0, 0]", "bodies.nut.at=[0, 0.04, 0]"], "finds no shank"),
        (["bodies.stud.cylinder.radius=3.9e-3"], "has a bore of 10 mm; move them"),
        (["joints.m10.washer=0.008"], r"joints\.m10\.washer = 0\.008 contradicts at = \"thread\""),
        (['joints.m10.sides=["rigid", "mean"]'], r"joints\.m10\.sides = .* drop sides"),
        (['joints.m10.between="stud|ground"'], "the ground has neither"),
        (["joints.m10.kz=-1e6"], r"kz = -1000000\.0 must be greater than or equal to 0"),
        (["joints.m10.kz=nan"], "kz = nan must be"),
        (['assembly.held=["stud:-z"]', "joints.m10.kz=0"],
         r'"nut" can still move along or about z, which joints\.m10\.kz = 0 leaves free'),
        (['ties=[{between="stud|nut"}]'], "is tied and has the joint 'm10'"),
        (["reduction.kind=craig-bampton", "joints.m10.kz=0"], r"with joints\.m10\.kz = 0"),
    ],
)  # fmt: skip
def test_what_no_thread_can_join_is_bad_input(changes, reason):
    with pytest.raises((InvalidScene, ValueError), match=reason):
        stages(SCENE, *changes)("reduction")


def test_bodies_with_two_cylinders_in_common_are_refused():
    """A nut whose upper half is wider by 0.4 mm, on one straight shank."""
    with session(), silent():
        occ = gmsh.model.occ
        occ.addCylinder(0, 0, 0, 0, 0, LENGTH, RADIUS)
        nut = occ.addCylinder(0, 0, 0.01, 0, 0, HIGH, OUTER)
        halves = ((0.01, 5e-3), (0.013, 5.4e-3))
        bores = [(3, occ.addCylinder(0, 0, z, 0, 0, HIGH / 2, radius)) for z, radius in halves]
        occ.cut([(3, nut)], bores)
        occ.synchronize()
        gmsh.write("stepped.step")
    tables = SCENE.split("[bodies.stud]")[0].replace("held", 'step = "stepped.step", held')
    text = f"{tables}[[joints]]{SCENE.split('[[joints]]')[1]}".replace("stud:-z", "body-1:-z")
    with pytest.raises(InvalidScene, match=r'"body-1\|body-2" have 2 cylinders in common, at \['):
        stages(text.replace("stud|nut*", "body-1|body-2"))("mesh")


def test_a_body_that_no_thread_holds_stays_refused(capsys):
    """Only what k = 0 leaves free is meant."""
    Path("loose.toml").write_text(SCENE + SECOND.replace("nut-2", "ring"))
    changes = ("joints.m10.kz=0", "assembly.touching=free", 'joints.m10.between="stud|nut"')
    assert beadwave("modes", "loose.toml", *(f"--set={change}" for change in changes)) == 2
    assert "which nothing keeps; tie it" in capsys.readouterr().err
