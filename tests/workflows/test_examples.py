"""Examples of users' structures: a page of text each, whole by the commands, as in CalculiX."""

import json
from importlib.util import module_from_spec, spec_from_file_location
from itertools import product
from pathlib import Path
from shutil import copy, which
from subprocess import run

import gmsh
import numpy as np
import pytest

from beadwave.geometry.cad.occ import write_step
from beadwave.geometry.cad.shapes import Box, Cylinder
from beadwave.geometry.meshing.gmsh_session import session
from beadwave.workflows.files.scene import scene, scene_text

from command_line import beadwave

pytestmark = pytest.mark.usefixtures("shared_cache")
EXAMPLES = Path(__file__).parents[2] / "examples"
PRINTED = 1e-6  # CalculiX prints seven digits
LONGEST = 25  # lines, with comments and blank ones
COARSE = {"cantilever": 2.0, "plate-on-bolts": 4.0, "gearbox.toml": 6.0}


def example(name):
    """The module of an example."""
    spec = spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(autouse=True)
def gearbox(shared_cache):
    """The example beside the STEP file that its script draws."""
    write_step(example("gearbox").SHAPES, Path("gearbox.step"))
    copy(EXAMPLES / "gearbox.toml", ".")


@pytest.mark.parametrize("name", COARSE)
def test_a_structure_is_a_page_of_text(name):
    assert len(scene_text(name).text.splitlines()) <= LONGEST
    assert scene(name).strike is not None


def answer(capsys, *arguments):
    assert beadwave(*arguments, "--json") == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.slow
def test_a_gearbox_goes_from_its_step_file_to_waves(capsys):
    """Modes, bolts tuned to the target, reduced model, waves; six bodies of hexahedra."""
    coarse = "--set=mesh.scale=6"
    rows = answer(capsys, "modes", "gearbox.toml", coarse)["rows"]
    (first,) = (row for row in rows if row["hammer_mode"] == 1)
    assert first["frequency_hz"] != pytest.approx(first["hammer_hz"], rel=5e-3)
    order = (
        "tune",
        "gearbox.toml",
        coarse,
        "--set=reduction.kind=free-modes",
        "--free=joints.cover.kz",
        "--out=tuned.toml",
    )
    report = answer(capsys, *order)
    assert report["full_order_hz"]["1"] == pytest.approx(first["hammer_hz"], rel=1e-4)
    answer(capsys, "reduce", "tuned.toml", "--out=rom.npz")
    summary = answer(capsys, "run", "tuned.toml", "--out=run")
    assert summary["modes_hz"]["1"] == pytest.approx(first["hammer_hz"], rel=1e-4)
    assert summary["energy_error"] < 1e-6
    assert summary["waves"]["1"]["arrivals"]
    assert summary["reduction"]["grounding"] < 1e-9


def table_of_fourteen_bodies():
    """A table on four posts, pads below and blocks above them, as STEP; the posts' EI [N m^2]."""
    shapes = {"base": Box((0.3, 0.2, 0.012)), "table": Box((0.3, 0.2, 0.012), at=(0, 0, 0.112))}
    for i, (x, y) in enumerate(product((-0.11, 0.11), (-0.06, 0.06))):
        shapes[f"pad-{i}"] = Box((0.04, 0.04, 0.01), at=(x, y, -0.011))
        shapes[f"post-{i}"] = Cylinder(0.012, 0.1, at=(x, y, 0.056))
        shapes[f"block-{i}"] = Box((0.05, 0.04, 0.03), at=(x, y, 0.133))
    write_step(shapes, Path("table.step"))
    return len(shapes), 210e9 * np.pi / 4 * 0.012**4


TABLE = """materials = { steel = { young = 210e9, poisson = 0.3, density = 7850.0 } }
[assembly]
step = "table.step"
touching = "tied"
held = ["pad-0:-z", "pad-1:-z", "pad-2:-z", "pad-3:-z"]
material = "steel"
"""


@pytest.mark.slow
def test_a_table_of_fourteen_bodies_sways_slower_than_on_rigid_plates(capsys):
    """omega^2 = 4 12 EI / L^3 / m is that of rigid plates; by less than a half. 50 s of one
    processor were measured."""
    n_bodies, EI = table_of_fourteen_bodies()
    Path("table.toml").write_text(TABLE)
    rows = answer(capsys, "modes", "table.toml")["rows"]
    assert n_bodies == 14
    mass = 7850 * (0.3 * 0.2 * 0.012 + 4 * 0.05 * 0.04 * 0.03)
    rigid = np.sqrt(48 * EI / 0.1**3 / mass) / (2 * np.pi)
    assert 0.5 * rigid < rows[0]["frequency_hz"] < rigid


def calculix_hz():
    """The first ten frequencies of deck.inp."""
    run(["ccx", "deck"], capture_output=True, check=True, timeout=900)
    rows = [line.split() for line in Path("deck.dat").read_text().splitlines()]
    return [float(row[3]) for row in rows if len(row) == 5 and row[0].isdigit()][:10]


# an orthotropic plate on a hinge and rollers, a steel boss on it, struck on its side
MIXED = """
chain = { count = 6, radius = 0.005, density = 7800.0, young = 210e9, poisson = 0.3 }
striker = { velocity = 0.2 }
wall = { kind = "rom" }
damping = { kind = "modal", ratio = 0.002 }
time = { duration = 5e-4 }
output = { spheres = [1, 4] }
[materials.steel]
young = 210e9
poisson = 0.3
density = 7850.0
[materials.ply]
young = [135e9, 9e9, 9e9]
poisson = [0.3, 0.3, 0.45]
shear = [5e9, 5e9, 3.1e9]
density = 1600.0
[assembly]
held = [
    { on = "plate:-x", directions = "yz" },
    { on = "plate:+x", directions = "yz" },
    { on = "plate:-y", directions = "x" },
]
touching = "tied"
[bodies.plate]
box = [0.2, 0.1, 0.006]
material = "ply"
[bodies.boss]
cylinder = { radius = 0.02, length = 0.04 }
at = [0.0, 0.0, 0.023]
material = "steel"
[strike]
on = "boss:cylinder"
at = [0.1, 0.0, 0.023]
radius = 1e-3
"""


@pytest.mark.slow
def test_every_command_takes_a_scene_without_targets_and_says_so(capsys):
    Path("mixed.toml").write_text(MIXED)
    coarse = "--set=mesh.scale=4"
    assert beadwave("modes", "mixed.toml", coarse) == 0
    assert "No targets" in capsys.readouterr().out
    assert beadwave("reduce", "mixed.toml", coarse, "--out=mixed.npz") == 0
    assert beadwave("tune", "mixed.toml", coarse, "--free=materials.steel.young") == 2
    assert "no targets" in capsys.readouterr().err
    assert beadwave("hammer", "mixed.csv", "--scene=mixed.toml", coarse, "--synthetic") == 0
    assert Path("mixed.csv").stat().st_size > 0
    capsys.readouterr()
    summary = answer(capsys, "impact", "mixed.toml", coarse)
    assert summary["energy_error"] < 1e-6 and not summary["modes_hz"]


@pytest.mark.slow
@pytest.mark.skipif(which("ccx") is None, reason="CalculiX (Debian: calculix-ccx)")
@pytest.mark.parametrize(("name", "scale"), [*COARSE.items(), ("mixed.toml", 3.0)])
def test_calculix_finds_the_same_ten_frequencies(name, scale, capsys):
    Path("mixed.toml").write_text(MIXED)
    changes = f"--set=mesh.scale={scale}"
    assert beadwave("modes", name, changes, "--inp=deck.inp") == 0
    capsys.readouterr()
    rows = answer(capsys, "modes", name, changes)["rows"]
    ours = np.array([row["frequency_hz"] for row in rows[:10]])
    np.testing.assert_allclose(ours / calculix_hz(), 1.0, rtol=PRINTED)


@pytest.mark.slow
def test_a_round_trip_gives_modes_and_joints_of_a_plate_on_bolts_back(capsys):
    """Modes within 0.05 % and 5 % in damping, none false, and the stiffness within two bars."""
    spec = spec_from_file_location("round_trip", EXAMPLES / "round_trip.py")
    round_trip = module_from_spec(spec)
    spec.loader.exec_module(round_trip)
    counts = round_trip.main(joints=2, tests=1, first=40, only="plate-on-bolts")["plate-on-bolts"]
    assert counts.found == counts.modes == 16 and counts.false == 0
    assert counts.worst_hz < 5e-5 and counts.worst_zeta < 0.01
    assert counts.values == counts.within == 2 and counts.worst < 1e-3
    assert "plate-on-bolts" in capsys.readouterr().out


def surface(path, *, whole=True):
    """A plate of 80 x 60 x 20 mm with a square hole of 20 mm as triangles, in mm; without one of
    them if not `whole`."""
    with session():
        plate = gmsh.model.occ.addBox(0, 0, 0, 80, 60, 20)
        hole = gmsh.model.occ.addBox(30, 20, -5, 20, 20, 30)
        gmsh.model.occ.cut([(3, plate)], [(3, hole)])
        gmsh.model.occ.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeMax", 10)
        gmsh.model.mesh.generate(2)
        gmsh.write(str(path))
    facets = path.read_text().split("endfacet\n")
    if not whole:
        path.write_text("endfacet\n".join(facets[1:]).join(["solid s\n", ""]))
    return len(facets) - 1


def test_a_closed_surface_is_filled_to_its_own_volume(tmp_path, capsys):
    """(80 x 60 - 20 x 20) x 20 mm^3; gmsh writes the corners exactly."""
    surface(tmp_path / "scan.stl")
    fill = example("fill_surface")
    of_mesh, enclosed = fill.filled(tmp_path / "scan.stl", tmp_path / "part.msh", 1e-3)
    assert enclosed == pytest.approx(88e-6, rel=1e-9)
    assert of_mesh == pytest.approx(enclosed, rel=1e-6)

    (tmp_path / "part.toml").write_text(
        'assembly = { mesh = "part.msh", held = ["part:-z"], material = "steel" }\n'
        'strike = { on = "part:+x" }\n'
    )
    looked = answer(capsys, "look", tmp_path / "part.toml", "--json")
    assert looked["bodies"][0]["mass_kg"] == pytest.approx(7850 * enclosed, rel=1e-6)


def test_a_surface_with_a_triangle_missing_is_not_filled(tmp_path):
    surface(tmp_path / "scan.stl", whole=False)
    with pytest.raises(ValueError, match="is not closed: 3 edges do not have two triangles"):
        example("fill_surface").filled(tmp_path / "scan.stl", tmp_path / "part.msh")
