"""Scenes on a mesh of the user's own: bodies, touching pairs, bolts, ties, strikes, wrong files."""

import json
from contextlib import nullcontext
from pathlib import Path

import gmsh
import meshio
import numpy as np
import pytest

from beadwave.geometry.meshing.gmsh_session import session
from beadwave.workflows.files.scene import scene
from beadwave.workflows.stages.engine.pipeline import pipeline_of

from command_line import beadwave
from meshed_boxes import SCENE, boxes

pytestmark = pytest.mark.usefixtures("shared_cache", "files_read_here")

BOLTS = '[[joints]]\nname = "bolts"\nbetween = "cover|base"\nkz = 1e8\nwasher = 8e-3'
SIDES, HOLES, RADIUS = (0.1, 0.06), ((0.02, 0.03), (0.08, 0.03)), 4e-3


def bolted(path, order):
    """A cover on a base, two holes through both, as gmsh meshes them: apart, in groups."""
    with session():
        occ, tags = gmsh.model.occ, {}
        for name, z, height in (("base", 0.0, 0.02), ("cover", 0.02, 0.006)):
            solid = occ.addBox(0, 0, z, *SIDES, height)
            drills = [(3, occ.addCylinder(*at, z, 0, 0, height, RADIUS)) for at in HOLES]
            ((_, tags[name]),), _ = occ.cut([(3, solid)], drills)
        occ.synchronize()
        for name, tag in tags.items():
            group = gmsh.model.addPhysicalGroup(3, [tag])
            gmsh.model.setPhysicalName(3, group, name)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.015)
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 10)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(order)
        gmsh.write(str(path))


def written(words, top="cover"):
    Path("mine.toml").write_text(SCENE.format(words=words, top=top), encoding="utf-8")
    return "mine.toml"


def modes_hz(capsys, words, n=4):
    assert beadwave("modes", written(words), "--json") == 0
    return [row["frequency_hz"] for row in json.loads(capsys.readouterr().out)["rows"]][:n]


def refused(capsys, words):
    assert beadwave("modes", written(words)) == 2
    message = capsys.readouterr().err.strip().splitlines()[-1]
    assert message.count(". ") <= 1
    return message


@pytest.fixture(scope="module")
def meshes(tmp_path_factory):
    folder = tmp_path_factory.mktemp("meshes")
    for order in (1, 2):
        bolted(folder / f"bolted-{order}.msh", order)
    return folder


@pytest.mark.slow
def test_a_plate_of_gmsh_has_the_modes_of_one_drawn(meshes, capsys):
    """Tied, by elements of either order; bolts whose washers end on element edges leave more."""
    outline = f"[[0, 0], [{SIDES[0]}, 0], [{SIDES[0]}, {SIDES[1]}], [0, {SIDES[1]}]]"
    body = """[bodies.{}]
plate = {{ outline = {}, thickness = {} }}
holes = {{ diameter = 0.008, at = [[0.02, 0.03], [0.08, 0.03]] }}
at = [0.0, 0.0, {}]"""
    drawn = [body.format("base", outline, 0.02, 0.0), body.format("cover", outline, 0.006, 0.02)]
    expected = modes_hz(capsys, "\n".join(['touching = "tied"', *drawn, "[mesh]\nscale = 2"]))
    first, second = (f'mesh = "{meshes}/bolted-{order}.msh"' for order in (1, 2))
    tied = modes_hz(capsys, f'{first}\ntouching = "tied"')
    np.testing.assert_allclose(tied, expected, rtol=0.01)
    again = modes_hz(capsys, f'{second}\ntouching = "tied"')
    # chords of ten around make holes 6 % too small in section, which changes these by 0.03 %
    np.testing.assert_allclose(again, tied, rtol=1e-3)
    bolted = modes_hz(capsys, f'{first}\ntouching = "free"\n{BOLTS}')
    assert np.all(np.divide(bolted, tied) < 0.9)


@pytest.mark.slow
def test_a_look_at_a_mesh_counts_its_own_dofs(meshes, capsys):
    words = f'mesh = "{meshes}/bolted-2.msh"\ntouching = "tied"'
    assert beadwave("look", written(words), "--json") == 0
    report = json.loads(capsys.readouterr().out)
    bored = np.prod(SIDES) - 2 * np.pi * RADIUS**2
    heights = {"base": 0.02, "cover": 0.006}
    mass = {body["name"]: body["mass_kg"] for body in report["bodies"]}
    # its ten facets around a hole cut 6 % of it off
    assert mass == pytest.approx({n: 7850 * bored * h for n, h in heights.items()}, rel=2e-3)
    (pair,) = report["touching"]
    assert pair["between"] == "base|cover" and pair["area_m2"] == pytest.approx(bored, rel=2e-3)
    assert {(hole["body"], hole["number"]) for hole in report["holes"]} == {
        ("base", 2),
        ("cover", 2),
    }
    run = pipeline_of(scene("mine.toml"), lambda name: nullcontext())
    assert report["dofs"] == run("model").structure.n_dofs
    capsys.readouterr()
    assert beadwave("look", "mine.toml", "--out=seen") == 0
    last = capsys.readouterr().out.splitlines()[-1]
    assert last == "written: seen/faces.html, seen/figures/assembly.png"
    assert all(Path(name).exists() for name in last.removeprefix("written: ").split(", "))
    page = Path("seen/faces.html").read_text()
    assert "base:-z" in page and "cover:hole" in page


@pytest.mark.slow
def test_a_mesh_of_hexahedra_and_tetrahedra_is_tied_where_they_touch(capsys):
    """A stocky column held below; not tied, its upper half floats."""
    file = "boxes.inp"
    boxes(file)
    assert 'between = "base|cover"' in refused(capsys, f'mesh = "{file}"')
    tied = modes_hz(capsys, f'mesh = "{file}"\ntouching = "tied"')
    assert 8e3 < tied[0] < 4e4
    message = refused(capsys, f'mesh = "{file}"\ntouching = "free"')
    assert '"cover" can still move' in message


@pytest.mark.parametrize(
    ("change", "words", "message"),
    [
        ({}, "seed", 'bodies.cover.seed contradicts assembly.mesh'),
        ({"at": 0.1}, "", '"cover" touches no other body and is not held'),
        ({"at": 0.025}, "", "let its mesh end where the other body does"),
        ({"lift": -0.004}, "", '"base" and "cover" overlap by'),
        ({"lift": 4e-4}, "", "miss each other by 0.4 mm"),
        ({"scale": 1000.0}, "", "the assembly is 40 x 40 x 30 m"),
        ({"names": ("base", "lid")}, "", 'no body is called "cover"'),
    ],
)  # fmt: skip
def test_a_mesh_that_cannot_stand_for_an_assembly_is_refused(change, words, message, capsys):
    boxes("boxes.inp", **change)
    words = "[bodies.cover]\nseed = 1e-3" if words else ""
    assert message in refused(capsys, f'mesh = "boxes.inp"\ntouching = "tied"\n{words}')


def test_files_that_are_no_mesh_of_bodies_are_refused(meshes, capsys):
    complete = (meshes / "bolted-1.msh").read_bytes()
    Path("cut.msh").write_bytes(complete[: len(complete) // 2])
    Path("text.msh").write_text("no mesh")
    tet = np.eye(4, 3), [("tetra", np.array([[0, 1, 2, 3]]))]
    meshio.Mesh(*tet).write("unnamed.inp")
    for file, message in (
        ("none.msh", "none.msh does not exist"),
        ("cut.msh", "cut off before $EndElements"),
        ("text.msh", "does not begin with $MeshFormat"),
        ("unnamed.inp", 'no body is called "base"; there are "1"'),
    ):
        assert message in refused(capsys, f'mesh = "{file}"')
    both = f'mesh = "{meshes}/bolted-1.msh"\nstep = "other.step"'
    assert "step and assembly.mesh exclude each other" in refused(capsys, both)
