"""Scenes of any assembly through the commands: modes against theory, runs, tuning, refusals."""

import json
import re
import subprocess
import sys
import tomllib
from contextlib import nullcontext
from importlib.util import module_from_spec, spec_from_file_location
from io import BytesIO
from pathlib import Path

import gmsh
import numpy as np
import pytest
from PIL import Image
from scipy.integrate import quad
from skfem import Basis, FacetBasis

from beadwave import system
from beadwave.fem import Material
from beadwave.geometry.cad.occ import write_step
from beadwave.geometry.cad.shapes import Box, Hole, Slab
from beadwave.geometry.meshing import hexahedra
from beadwave.geometry.meshing.gmsh_session import session, silent
from beadwave.workflows.files.scene import scene
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.scene.toml import resolved, toml
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.pages.pictures import fixtures
from beadwave.workflows.stages.structure import assembly
from beadwave.workflows.structure.api import look

from command_line import beadwave

pytestmark = pytest.mark.usefixtures("shared_cache", "files_read_here")

spec = spec_from_file_location("theory", Path(__file__).parents[1] / "fem" / "test_theory.py")
theory = module_from_spec(spec)
spec.loader.exec_module(theory)
ALUMINIUM = Material(70e9, 0.33, 2700.0)
ENDS = ("clamped", "free")


def modes_of(capsys, *arguments):
    assert beadwave("modes", *arguments, "--json") == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    return np.array([row["frequency_hz"] for row in rows]), rows


@pytest.mark.slow
def test_the_cantilever_has_the_modes_of_timoshenko_in_both_planes(capsys):
    """Struck on its side: modes that the contact moves bend one way, the others the other.

    Without Poisson's ratio, as a clamped end that cannot contract stiffens so short a beam by 1 %.
    """
    plain = ("--set=materials.aluminium.poisson=0", "--set=mesh.scale=0.6")
    hz, rows = modes_of(capsys, "cantilever", *plain)
    struck, solid = [row["participation"] for row in rows], ALUMINIUM._replace(poisson=0.0)
    for sides, seen in (((0.02, 0.012), lambda w: w > 0.5), ((0.012, 0.02), lambda w: w < 1e-6)):
        expected = theory.timoshenko_hz(theory.rectangle(0.3, *sides, solid), ENDS, 3)
        found = hz[seen(np.array(struck))]  # it twists and stretches as well
        nearest = np.abs(np.log(np.divide.outer(expected, found))).argmin(axis=1)
        np.testing.assert_allclose(found[nearest], expected, rtol=2e-3)


PLATE = """
[assembly]
held = []
material = "steel"
[materials.steel]
young = 210e9
poisson = 0.3
density = 7850.0
[bodies.plate]
box = [0.3, 0.3, 0.002]
seed = 0.0125
"""


def written(text, name="mine"):
    Path(f"{name}.toml").write_text(text, encoding="utf-8")
    return f"{name}.toml"


@pytest.mark.slow
def test_a_floating_plate_has_the_modes_of_gorman(capsys):
    """By command: six rigid motions, then Kirchhoff's square plate; h/a = 1/150."""
    hz, _ = modes_of(capsys, written(PLATE))
    assert hz[5] < 1e-2 < hz[6]
    steel, side, h = theory.STEEL, 0.3, 2e-3
    D = steel.young * h**3 / (12 * (1 - steel.poisson**2))
    unit = np.sqrt(D / (steel.density * h)) / side**2 / (2 * np.pi)
    np.testing.assert_allclose(hz[6:11], unit * np.array(theory.FREE), rtol=3e-3)


@pytest.mark.slow
def test_bolted_plates_run_from_words_to_waves(capsys):
    folder = Path("run")
    fast = ("--set=mesh.scale=2", "--set=reduction.modes=20", "--set=output.samples=501")
    assert beadwave("run", "plate-on-bolts", f"--out={folder}", *fast) == 0
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["energy_error"] < 1e-6
    volume = 0.2 * 0.1 * 0.036 - 4 * np.pi * 0.004**2 * 0.036
    assert summary["reduction"]["mass_kg"] == pytest.approx(7850 * volume, rel=1e-6)
    assert summary["reduction"]["grounding"] < 1e-9
    assert 0 < summary["error_estimate"]["mesh"] < 0.1
    assert len(summary["waves"]["1"]["arrivals"]) >= 1
    assert {"report.html", "rom.npz", "modes.vtu"} <= {path.name for path in folder.iterdir()}
    again = scene(str(folder / "scene.toml"))
    assert toml(again) == (folder / "scene.toml").read_text()


SLABS = {
    "base": Box((0.06, 0.04, 0.01), at=(0.03, 0.02, 0.005)),
    "lid": Slab(((0, 0), (0.06, 0), (0.06, 0.04), (0, 0.04)), 0.004, (Hole(0.008, (0.05, 0.02)),),
                 at=(0.0, 0.0, 0.01)),
}  # fmt: skip


@pytest.fixture
def step():
    write_step(SLABS, Path("slabs.step"))
    return "slabs.step"


def test_a_look_at_a_step_file_reports_masses_pairs_and_holes(step, capsys):
    assert beadwave("look", step, "--json") == 0
    seen = json.loads(capsys.readouterr().out)
    mass = {body["name"]: body["mass_kg"] for body in seen["bodies"]}
    bored = 0.06 * 0.04 - np.pi * 0.004**2
    assert mass == pytest.approx({"base": 7850 * 2.4e-5, "lid": 7850 * bored * 0.004}, rel=1e-6)
    assert seen["bodies"][0]["sides_m"] == [0.06, 0.04, 0.01]
    (pair,) = seen["touching"]
    assert pair["between"] == "base|lid" and pair["area_m2"] == pytest.approx(bored, rel=1e-6)
    (hole,) = seen["holes"]
    assert (hole["body"], hole["number"]) == ("lid", 1)
    assert hole["diameter_m"] == pytest.approx(0.008) and hole["axis"] == [0, 0, 1]
    assert seen["seconds"] > 0 and seen["memory_bytes"] > 0
    assert seen["unit"] == "mm" and seen["dofs"] == sum(b["dofs"] for b in seen["bodies"])


FLANGE = """
assembly = { held = ["flange:-z"], material = "steel" }
[bodies.flange]
cylinder = { radius = "40 mm", bore = "10 mm", length = "15 mm" }
seed = "10 mm"
[[bodies.flange.holes]]
diameter = "9 mm"
at = [["30 mm", 0], ["-30 mm", 0]]
[[bodies.flange.holes]]
diameter = "5 mm"
around = [[45, "0 mm"]]
depth = "12 mm"
"""


@pytest.mark.slow
def test_a_drawn_flange_has_its_mass_and_holes_of_two_diameters(capsys):
    """The blind hole: chords of its flat bottom at 28 mm from the axis up to the round face."""
    Path("flange.toml").write_text(FLANGE)
    assert beadwave("look", "flange.toml", "--out=seen", "--json") == 0
    seen = json.loads(capsys.readouterr().out)
    blind = quad(lambda s: 2 * np.sqrt(2.5**2 - s**2) * (np.sqrt(40**2 - s**2) - 28), -2.5, 2.5)[0]
    drilled = np.pi * (40**2 - 10**2 - 2 * 4.5**2) * 15 - blind
    assert seen["bodies"][0]["mass_kg"] == pytest.approx(7850 * drilled * 1e-9, rel=1e-5)
    holes = [(round(1e3 * hole["diameter_m"], 6), hole["number"]) for hole in seen["holes"]]
    assert sorted(holes) == [(5, 1), (9, 2), (20, 1)]
    assert "flange:hole" in Path("seen/faces.html").read_text("utf-8")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('around = [[45, "0 mm"]]', "", r"bodies\.flange\.holes\.2: holes are placed by at = "),
        ('"0 mm"', '"6 mm"', r"bodies\.flange: hole of 0\.005 m .* between -0\.005 m and 0\.005 m"),
        ('"12 mm"', '"30 mm"', r"bodies\.flange: depth = 0\.03 m .* to end before the bore"),
        ('"-30 mm"', '"23 mm"', r"bodies\.flange: holes at .* overlap: .* must exceed 0\.009 m"),
        ("cylinder = {", 'box = [0.1, 0.1, 0.1]\nfoo = {', "unknown key 'foo'"),
        ('cylinder = { radius = "40 mm", bore = "10 mm", length = "15 mm" }',
         "box = [0.1, 0.1, 0.1]", "holes belong to a plate or a cylinder"),
        ('cylinder = { radius = "40 mm", bore = "10 mm", length = "15 mm" }',
         "plate = { outline = [[0, 0], [0.1, 0], [0, 0.1]], thickness = 0.01 }",
         r"holes\.around are in the round face of a cylinder"),
        ("around = ", 'rings = [{washer = 0.006, lower = [0, 0], upper = [0.02, 0.02]}]\naround = ',
         r"rings is no key any more; drop it: seed, mesh\.scale and strike\.seed say how large"),
        ("cylinder = {", "lines = { x = [0.01] }\ncylinder = {", "lines is no key any more"),
    ],
)  # fmt: skip
def test_holes_that_cannot_be_drilled_are_refused_by_their_key(old, new, message):
    assert old in FLANGE
    Path("flange.toml").write_text(FLANGE.replace(old, new))
    with pytest.raises(InvalidScene, match=message):
        pipeline_of(scene("flange.toml"), lambda name: nullcontext())("mesh")


def test_a_look_at_the_rig_tells_what_it_is_made_of(capsys):
    """Its block is 131.5 x 98.2 x 41.5 mm; the dofs are those of its own mesh."""
    assert beadwave("look", "rig-rom", "--json") == 0
    seen = json.loads(capsys.readouterr().out)
    table = scene("rig-rom").rig.assembly
    (block,) = (body for body in seen["bodies"] if body["name"] == "block")
    volume = np.prod(block["sides_m"])
    assert block["mass_kg"] == pytest.approx(table.made_of("block").density * volume, rel=1e-6)
    holes = {(hole["body"], hole["number"]) for hole in seen["holes"]}
    assert holes == {("sheet-y", 4), ("sheet+y", 4)}
    pairs = {pair["between"] for pair in seen["touching"]}
    assert {"block|sheet-y", "support|plate"} < pairs and len(pairs) == 6
    built = pipeline_of(scene("rig-rom"), lambda name: nullcontext())
    assert seen["dofs"] == 3 * sum(built("mesh").nodes.values())


@pytest.mark.parametrize(
    "name",
    [
        "cantilever",
        pytest.param("rig-rom", marks=pytest.mark.slow),
        pytest.param("plate-on-bolts", marks=pytest.mark.slow),
    ],
)
def test_a_look_foretells_the_unknowns_of_a_run(name):
    """To 2 %: corners of a tied face that lie on a held one are counted twice."""
    seen = look(name, mesh=True).found
    unknowns = pipeline_of(scene(name), lambda name: nullcontext())("model").K.shape[0]
    assert seen.unknowns == pytest.approx(unknowns, rel=0.02)
    assert seen.unknowns < 0.99 * seen.dofs


@pytest.mark.parametrize("name", ["cantilever", "plate-on-bolts", "bolted-plates", "two-chains"])
def test_a_look_without_a_mesh_foretells_its_dofs_within_a_factor_of_two(name):
    foreseen, counted = look(name).found, look(name, mesh=True).found
    assert (foreseen.meshed, counted.meshed) == (False, True)
    for before, after in zip(foreseen.bodies, counted.bodies, strict=True):
        assert 0.5 < before.dofs / after.dofs < 2
    assert 0.4 < foreseen.seconds / counted.seconds < 2.5
    assert foreseen.joints == counted.joints


def pointed_cone(occ):
    occ.addCone(0, 0, 0, 0, 0, 50, 20, 0)


def ball(occ):
    occ.addSphere(0, 0, 0, 20)


def ring(occ):
    occ.addTorus(0, 0, 0, 50, 10)


def drilled_block(occ):
    """A blind hole as a drill of 118 degrees leaves it."""
    block, depth = occ.addBox(-30, -20, -30, 60, 40, 30), 20
    drill = occ.addCylinder(0, 0, 0, 0, 0, -depth, 5)
    tip = occ.addCone(0, 0, -depth, 0, 0, -5 / np.tan(np.radians(59)), 5, 0)
    occ.cut([(3, block)], [(3, drill), (3, tip)])


@pytest.mark.parametrize(
    "made",
    [
        pointed_cone,
        ball,
        *(pytest.param(made, marks=pytest.mark.slow) for made in (ring, drilled_block)),
    ],
)
def test_a_look_at_a_round_body_draws_it_and_foretells_its_dofs(made):
    """The curvature of a cone has no bound at its apex, a ball has no edges to draw."""
    with session():
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
        made(gmsh.model.occ)
        gmsh.model.occ.synchronize()
        with silent():
            gmsh.write("round.step")
    foreseen, counted = look("round.step"), look("round.step", mesh=True).found
    assert 0.5 < foreseen.found.bodies[0].dofs / counted.bodies[0].dofs < 2
    picture = np.asarray(Image.open(BytesIO(foreseen.plot().png)).convert("L"))
    assert np.mean(picture < 250) > 0.05


def test_a_mesh_that_takes_too_long_ends_the_command_in_a_sentence():
    """Of a process of its own, since gmsh cannot be stopped otherwise; not of one that calls from
    Python, as this."""
    refined = {"bodies.beam.seed": "1 mm", "mesh.element": "tet", "mesh.seconds": 1}
    given = [f"--set={key}={value}" for key, value in refined.items()]
    command = [sys.executable, "-m", "beadwave", "modes", "cantilever", *given]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 2 and not done.stdout
    assert '"beam" was not meshed within 1 s with elements of 1 mm; its smallest' in done.stderr
    assert "or allow more by mesh.seconds." in done.stderr and "Traceback" not in done.stderr
    assert not system.ended_by_us.is_set()


def test_a_look_says_that_a_run_may_refuse_what_no_memory_holds(capsys):
    assert beadwave("look", "cantilever", "--set=bodies.beam.seed=2e-5") == 0
    last = capsys.readouterr().out.splitlines()[-1]
    assert last.startswith("A run may refuse this scene: the mesh of [assembly] has ")


def test_a_look_at_a_scene_that_a_run_refuses_says_so_and_goes_on(capsys):
    assert beadwave("look", "cantilever", "--set=strike.at=[0.5, 0.0]") == 0
    said = capsys.readouterr().out
    assert "beam" in said.splitlines()[3]
    assert said.splitlines()[-1].startswith("A run refuses this scene: cantilever")


def test_a_look_at_a_scene_without_a_strike_says_what_is_refused_as_well(capsys):
    text = scene("cantilever")
    Path("bare.toml").write_text(toml(text.but(strike=None, wall=None)))
    assert beadwave("look", "bare.toml", '--set=assembly.held=["beam:+q"]') == 0
    assert "A run refuses this scene:" in capsys.readouterr().out.splitlines()[-1]


def test_holes_that_miss_each_other_are_refused_and_not_left_out():
    """One of four, by a millimetre: the other three would hold the plate without it."""
    holes = [[0.02, 0.02], [0.18, 0.02], [0.18, 0.08], [0.02, 0.081]]
    with pytest.raises(InvalidScene, match=r"near \[0\.02, 0\.081, 0\.03\] m miss .* 1 mm"):
        pipeline_of(
            scene("plate-on-bolts", {"bodies.base.holes.at": holes}), lambda name: nullcontext()
        )("mesh")


@pytest.mark.slow
@pytest.mark.pictures
def test_the_picture_of_a_look_has_chain_bolts_and_held_faces(tmp_path):
    """Colours of what is drawn beside the meshes; without them the picture has none of these."""
    whole = Image.open(BytesIO(look("plate-on-bolts").plot().png)).convert("RGB")
    for red, green, blue in ((31, 95, 191), (200, 55, 27)):  # HELD, IMPACT of report.render
        near = np.abs(np.asarray(whole, float) - (red, green, blue)).max(axis=2) < 40
        assert near.sum() > 100
    run = pipeline_of(scene("plate-on-bolts"), lambda name: nullcontext())
    shown = fixtures(run.scene, run("mesh"))
    assert [name for name, *_ in shown["joints"]] == ["bolts"] * 4
    for _, _, axis in shown["joints"]:
        assert np.abs(axis) == pytest.approx([0, 0, 1], abs=1e-9)
    assert shown["strike"][3:] == pytest.approx([0, 0, -1])
    assert np.ptp(np.array(shown["held"])[..., 2]) < 1e-9


@pytest.mark.slow
def test_the_starter_scene_of_a_step_file_has_modes_and_a_reduced_model(step, capsys):
    assert beadwave("look", step, "--scene=start.toml") == 0
    assert beadwave("reduce", "start.toml", "--out=rom.npz", "--set=mesh.scale=2") == 0
    with np.load("rom.npz") as held:
        assert held["w"].sum() == pytest.approx(-1.0)  # the chain travels down
    assert len(Path("start.toml").read_text().splitlines()) <= 25


@pytest.mark.slow
def test_a_look_at_blind_holes_that_open_into_a_touching_face():
    """The outline of a foot that stands on two tapped holes parts the face around them."""
    holes = tuple(Hole(0.008, (0.02, y), depth=0.006) for y in (0.012, 0.028))
    sheet = ((0, 0), (0.06, 0), (0.06, 0.04), (0, 0.04))
    tapped = {
        "base": Slab(sheet, 0.01, holes),
        "foot": Box((0.03, 0.03, 0.02), at=(0.02, 0.02, 0.02)),
    }
    write_step(tapped, Path("tapped.step"))
    assert beadwave("look", "tapped.step", "--out=seen", "-q") == 0
    page = Path("seen/faces.html").read_text("utf-8")
    assert "base:hole" in page and "foot:+z" in page


@pytest.mark.slow
def test_a_starter_offers_bolts_where_holes_go_through_both_bodies(capsys):
    """Bolts leave the faces free between them: without comment signs modes are lower than tied."""
    holes = tuple(Hole(0.008, (x, 0.02)) for x in (0.01, 0.05))
    sheet = ((0, 0), (0.06, 0), (0.06, 0.04), (0, 0.04))
    bolted = {
        "base.1": Slab(sheet, 0.01, holes),
        "lid": Slab(sheet, 0.006, holes, at=(0.0, 0.0, 0.01)),
    }
    write_step(bolted, Path("bolted.step"))
    assert beadwave("look", "bolted.step", "--scene=tied.toml", "-q") == 0
    text = Path("tied.toml").read_text()
    assert "# 2 holes through both base.1 and lid: bolts in place of the tie\n" in text
    Path("bolts.toml").write_text(re.sub(r"^# (\[\[|name|between|kz)", r"\1", text, flags=re.M))
    assert scene("bolts.toml").joints[0].name == "base-1-lid"
    capsys.readouterr()
    first = [modes_of(capsys, name)[1][0]["frequency_hz"] for name in ("tied.toml", "bolts.toml")]
    assert first[1] < 0.5 * first[0]


def test_a_look_counts_the_elements_that_the_scene_asks_for(step, capsys):
    """Tetrahedra have another number of nodes than the hexahedra of a plate."""
    text = "materials = { s = { young = 2e11, poisson = 0.3, density = 7800.0 } }\n[assembly]\n"
    text += f'step = "{step}"\nmaterial = "s"\ntouching = "tied"\nheld = ["base:-z"]\n'
    Path("slabs.toml").write_text(text)
    counted = {}
    for element in ("hex", "tet"):
        change = f"mesh.element={element}"
        assert beadwave("look", "slabs.toml", f"--set={change}", "--mesh", "--json") == 0
        counted[element] = json.loads(capsys.readouterr().out)["dofs"]
        built = pipeline_of(scene("slabs.toml", (change,)), lambda name: nullcontext())
        made = 3 * sum(mesh.nvertices + mesh.nedges for mesh in built("mesh").meshes.values())
        assert counted[element] == made
    assert counted["tet"] != counted["hex"]


def notched_on_plate():
    """A block in the middle of a plate, its top notched by a half cylinder of 10 mm."""
    with session(), silent():
        occ = gmsh.model.occ
        occ.addBox(-0.05, -0.03, 0, 0.1, 0.06, 0.008)
        block = occ.addBox(-0.015, -0.01, 0.008, 0.03, 0.02, 0.03)
        notch = occ.addCylinder(-0.02, 0, 0.038, 0.04, 0, 0, 0.005)
        occ.cut([(3, block)], [(3, notch)])
        occ.synchronize()
        gmsh.write("notched.step")


def test_a_starter_strikes_where_nothing_lies_and_holes_at_an_edge_are_reported(capsys):
    notched_on_plate()
    assert beadwave("look", "notched.step", "--scene=start.toml", "--json") == 0
    seen = json.loads(capsys.readouterr().out)
    assert not seen["holes"]
    (message,) = seen["remarks"]
    assert "has a hole of 10 mm that an edge cuts" in message
    start = scene("start.toml")
    assert start.strike.on == "body-1:+z"  # its middle lies under the block, which ends at 10 mm
    assert abs(start.strike.at[1]) > 0.012
    covered = start.but(strike={"at": (0.0, 0.0)})
    with pytest.raises(InvalidScene, match=r'"body-2" lies on body-1 at the point struck, \[0.0, '):
        pipeline_of(covered, lambda name: nullcontext())("mesh")
    beside = covered.but(strike={"on": "body-1:+z", "at": (0.0175, 0.0)})
    assert pipeline_of(beside, lambda name: nullcontext())("mesh").struck is not None
    close_by = covered.but(strike={"on": "body-1:+z", "at": (0.0165, 0.0)})
    with pytest.raises(InvalidScene, match=r"less than 0.002 m next to it; move it by strike.at"):
        pipeline_of(close_by, lambda name: nullcontext())("mesh")


def turned(direction, bore):
    """A shaft of 24 mm, with a shoulder of 16 mm, along a direction (3,), bored through."""
    x, y, z = direction
    with session(), silent():
        occ = gmsh.model.occ
        shaft = occ.addCylinder(0, 0, 0, 0.04 * x, 0.04 * y, 0.04 * z, 0.012)
        end = occ.addCylinder(0.04 * x, 0.04 * y, 0.04 * z, 0.03 * x, 0.03 * y, 0.03 * z, 0.008)
        ends = [(3, end)] if bore < 0.008 else []
        if ends:
            occ.fuse([(3, shaft)], ends)
        else:
            occ.remove([(3, end)], recursive=True)
        tool = occ.addCylinder(-0.001 * x, -0.001 * y, -0.001 * z, 0.1 * x, 0.1 * y, 0.1 * z, bore)
        occ.synchronize()
        occ.cut([(3, tag) for _, tag in gmsh.model.getEntities(3) if tag != tool], [(3, tool)])
        occ.synchronize()
        gmsh.write("turned.step")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("direction", "bore", "on", "held"),
    [
        ((0.0, 0.0, 1.0), 0.004, "body:+z", "body:-z"),
        ((1.0, 0.0, 0.0), 0.004, "body:-x", "body:+x"),
        ((0.0, 0.0, 1.0), 0.0105, "body:cylinder(24 mm)", "body:-z"),
        ((0.6, 0.0, 0.8), 0.004, "body@", "body@"),
    ],
)
def test_the_starter_of_a_turned_part_strikes_beside_its_bore(direction, bore, on, held, capsys):
    """The patch lies on the part, as a run wants it, and another face is held."""
    turned(direction, bore)
    assert beadwave("look", "turned.step", "--scene=start.toml") == 0
    start = scene("start.toml", ("mesh.scale=3",))
    assert start.strike.on.startswith(on) and start.assembly.held[0].startswith(held)
    assert start.strike.on != start.assembly.held[0]
    struck = pipeline_of(start, lambda name: nullcontext())("mesh").struck
    along = struck.point @ np.array(direction)
    off_axis = np.linalg.norm(struck.point - along * np.array(direction))
    assert bore + start.strike.radius < off_axis < 0.012 + 1e-9


def test_the_starter_of_a_ball_floats(capsys):
    """No plane face can be held, and free modes need none."""
    with session(), silent():
        gmsh.model.occ.addSphere(0, 0, 0, 0.02)
        gmsh.model.occ.synchronize()
        gmsh.write("ball.step")
    assert beadwave("look", "ball.step", "--scene=start.toml") == 0
    start = scene("start.toml")
    assert start.assembly.held == () and start.reduction.kind == "free-modes"
    assert start.strike.at == (0.0, 0.0, 0.02)


def test_a_starter_holds_each_group_of_bodies_that_touches_no_other(capsys):
    """A ball on a plate meets it in a point: its scene runs, and without the hold it is refused
    with what helps. Of bodies 0.2 mm apart a wider gap does."""
    with session(), silent():
        occ = gmsh.model.occ
        occ.addBox(-0.02, -0.02, 0, 0.04, 0.04, 0.01)
        occ.addSphere(0, 0, 0.02, 0.01)
        occ.addBox(0.0202, -0.02, 0, 0.04, 0.04, 0.02)
        occ.synchronize()
        gmsh.write("apart.step")
    assert beadwave("look", "apart.step", "--scene=start.toml", "-q") == 0
    plate, ball, block = scene("start.toml").assembly.held
    assert (plate, block) == ("body-1:-z", "body-3:-z") and ball.startswith("body-2@")
    assert pipeline_of(scene("start.toml"), lambda name: nullcontext())("model").K.shape[0] > 0

    for held, loose, advice in (
        (
            [plate, block],
            "body-2",
            r'lies on another body, or hold it\. "body-1" and "body-2" meet',
        ),
        ([plate, ball], "body-3", r"hold it, or raise assembly\.gap above 0\.2 mm\. "),
        ([], "body-2", r"lies on another body, or hold it\."),
    ):
        with pytest.raises(InvalidScene, match=f'"{loose}" touches no other .*{advice}'):
            pipeline_of(
                scene("start.toml").but(assembly={"held": tuple(held)}), lambda name: nullcontext()
            )("mesh")


def refused(capsys, text, *more):
    """The sentence that a scene of this text is refused with, in status 2."""
    assert beadwave("modes", written(text), *more) == 2
    return capsys.readouterr().err


ASSEMBLY = """
materials = {{ steel = {{ young = 210e9, poisson = 0.3, density = 7850.0 }} }}
[assembly]
step = "slabs.step"
material = "steel"
{words}
"""


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ('held = ["base:-z"]', '[[ties]]\nbetween = "base|lid"'),
        ('held = ["base:-z"]\ntouching = "free"', '"lid" can still move'),
        ('held = ["base:-q"]\ntouching = "tied"', 'assembly.held: "base:-q" picks no face'),
        ('held = [{ on = "base:-z", directions = "z" }, { on = "lid:-q" }]',
         'assembly.held.on: "lid:-q" picks no face; write "lid:+x"'),
        ('held = []\n[strike]\non = "lid:up"', 'strike.on: "lid:up" picks no face'),
        ('held = []\n[[masses]]\nname = "nut"\nmass = 0.1\non = "lid:up"',
         'masses.nut.on: "lid:up" picks no face'),
        ('held = ["bse:-z"]\ntouching = "tied"', 'no body is called "bse", perhaps "base"'),
        ('touching = "tied"', "assembly.held is missing"),
        ('held = []\ntouching = "tid"', "assembly.touching = 'tid' must be"),
        ('held = []\nparts = ["block"]', "unknown key 'parts'"),
        ('held = []\n[[ties]]\nbetween = "lid"', 'write "a|b"'),
        ('held = []\n[[joints]]\nname = "b"\nbetween = "lid|base"', "no hole through both"),
        ('held = []\n[bodies.cap]\nseed = 1e-3', 'no body is called "cap"'),
        ('held = []\n[bodies.lid]\nmaterial = "cast"', "'cast' is not known, known are steel"),
        ('held = []\n[bodies.lid]\nmaterial = "aluminium"',
         "names a family, known of it: aluminium-6082, aluminium-6061, aluminium-7075"),
        ('held = []\n[bodies.lid]\nmaterial = "titan"', "nearest known is 'titanium'"),
        ('held = []\n[[targets]]\nhz = 5.0', "give one of its number, its shape, and body"),
        ('held = []\n[patch]\nradius = 1e-3', "[patch] belongs to the thesis' rig"),
    ],
)  # fmt: skip
def test_what_a_scene_leaves_unsaid_is_asked_for(words, message, step, capsys):
    assert message in refused(capsys, ASSEMBLY.format(words=words))


NAMES = ("../lid", "a/b", "a\\b", "..", ".lid", "a\nb", " lid", "lid\x00", "")


@pytest.mark.parametrize("kind", ["bodies", "materials"])
def test_a_name_that_could_lead_elsewhere_is_refused(kind):
    tables = tomllib.loads(STACK.replace("HZ", "1e3")) | {"name": "mine"}
    own = next(iter(tables[kind].values()))
    for name in (*NAMES, "ground" if kind == "bodies" else "steel.cast"):
        with pytest.raises(InvalidScene, match="rename it") as said:
            scene(tables | {kind: tables[kind] | {name: own}})
        assert "\n" not in str(said.value)
    assert scene(tables | {kind: tables[kind] | {"Gehäuse +x 1": own}})


def test_words_of_bodies_in_a_scene_of_the_rig_are_refused(capsys):
    text = '[assembly]\nconstraint = "full-tie"\n[strike]\non = "block:+x"\n'
    assert "[strike] belongs to an assembly of bodies" in refused(capsys, text)


STACK = """
materials = { steel = { young = 210e9, poisson = 0.3, density = 7850.0 } }
assembly = { held = ["foot:-z"], material = "steel", touching = "free" }
[bodies.foot]
box = [0.04, 0.04, 0.02]
seed = 0.01
[bodies.head]
box = [0.04, 0.04, 0.02]
seed = 0.01
at = [0.0, 0.0, 0.02]
[[joints]]
name = "pin"
between = "head|foot"
at = [[0.0, 0.0, 0.01]]
washer = 0.008
kz = 3e7
[[targets]]
hz = HZ
body = "head"
motion = "z"
"""


@pytest.mark.parametrize(
    ("at", "message"),
    [
        ("[[0.0, 0.0]]", r"at\.1 = \[0\.0, 0\.0\] has 2 values; give 3: x, y, z"),
        ("[]", "an empty list; give at least one value"),
        ("[[0.0, 0.0, 'x']]", "no number with a unit"),
        ("'hole'", "must be 'holes'"),
    ],
)
def test_points_of_a_joint_are_refused_with_what_they_lack(at, message):
    tables = tomllib.loads(STACK.replace("[[0.0, 0.0, 0.01]]", at).replace("HZ", "1e3"))
    with pytest.raises(InvalidScene, match=message):
        scene(tables)


@pytest.mark.slow
def test_a_joint_is_tuned_to_a_target_of_the_scene(capsys):
    """A target computed at kz = 5e7 N/m is met by that stiffness again."""
    reference_scene = written(STACK.replace("HZ", "1000.0"), "reference_scene")
    _, rows = modes_of(capsys, reference_scene, "--set=joints.pin.kz=5e7")
    (hz,) = (row["frequency_hz"] for row in rows if row["hammer_mode"] == 1)
    scene_file = written(STACK.replace("HZ", repr(hz)))
    order = ("tune", scene_file, "--free=joints.pin.kz", "--out=tuned.toml", "--json")
    assert beadwave(*order) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["stiffness"]["joints.pin.kz"] == pytest.approx(5e7, rel=1e-4)
    assert report["full_order_hz"]["1"] == pytest.approx(hz, rel=1e-6)
    assert scene("tuned.toml").bushings["pin"].kz == pytest.approx(5e7, rel=1e-4)


ARM = """
materials = { alloy = { young = 70e9, poisson = 0.33, density = 2700.0 } }
assembly = { held = ["wall:-x"], material = "alloy", touching = "free" }
[bodies.wall]
box = [0.012, 0.06, 0.08]
seed = 0.03
[bodies.arm]
box = [0.012, 0.05, 0.16]
seed = 0.03
at = [0.012, 0.0, 0.03]
[[joints]]
name = "bolts"
between = "arm|wall"
at = [[0.006, -0.015, -0.02], [0.006, 0.015, -0.02], [0.006, 0.0, 0.025]]
washer = WASHER
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("washer", "free", "rigid"),
    [("0.009", "kx,ky,kz", ["kx", "ky"]), ('"share"', "krx,kz,young", ["krx"])],
)
def test_what_modes_do_not_determine_keeps_its_value_and_the_rest_is_fitted_again(
    washer, free, rigid, capsys
):
    """Three bolts soft along z, of a truth with kz = 8e6 N/m, and two modes of it."""
    arm = ARM.replace("WASHER", washer) + "kz = 1e7\n"
    _, truth = modes_of(capsys, written(arm, "truth"), "--set=joints.bolts.kz=8e6")
    hz = [row["frequency_hz"] for row in truth[:6]]
    targets = "".join(f"[[targets]]\nhz = {f!r}\nnumber = {i + 1}\n" for i, f in enumerate(hz[:2]))
    names = [
        f"{'materials.alloy' if k == 'young' else 'joints.bolts'}.{k}" for k in free.split(",")
    ]
    order = ("tune", written(arm + targets), f"--free={','.join(names)}", "--out=tuned.toml")
    assert beadwave(*order, "--json") == 0
    report = json.loads(capsys.readouterr().out)

    fitted = [name for name in names if name.rpartition(".")[2] not in rigid]
    assert list(report["stiffness"]) == fitted
    assert report["stiffness"]["joints.bolts.kz"] == pytest.approx(8e6, rel=1e-2)
    assert all(deviation < 0.05 for deviation in report["deviation"].values())
    assert report["undetermined"] == {f"joints.bolts.{key}": "rigid" for key in rigid}
    assert f"{rigid[0]} is not determined by mode 1, 2: it stays rigid." in report["remarks"][0]
    assert report["remarks"][len(rigid)].endswith(f"determine: --free {','.join(fitted)}.")
    assert all(getattr(scene("tuned.toml").bushings["bolts"], key) == np.inf for key in rigid)
    _, rows = modes_of(capsys, "tuned.toml")
    assert [row["frequency_hz"] for row in rows[:6]] == pytest.approx(hz, rel=1e-4)


@pytest.mark.slow
def test_a_tuned_scene_keeps_comments_and_order_of_its_file(capsys):
    arm = ARM.replace("WASHER", '"9 mm"  # of the drawing') + "# a guess\nkz = 1e7  # per bolt\n"
    text = "# An arm on three bolts.\n" + arm
    assert (
        beadwave("tune", written(text), "--match=1=700", "--free=joints.bolts.kz", "--out=t.toml")
        == 0
    )
    _, *lines = Path("t.toml").read_text().splitlines()
    kz = scene("t.toml").bushings["bolts"].kz
    assert 1e4 < kz < 1e12 and kz != 1e7
    same = text.replace("kz = 1e7", f"kz = {kz!r}").splitlines()
    assert lines[: len(same)] == same
    assert [line for line in lines[len(same) :] if line] == [
        "[[targets]]",
        "hz = 700.0",
        "number = 1",
    ]

    assert scene("t.toml").name == "t"


@pytest.mark.slow
def test_match_gives_targets_to_a_scene_without_any(capsys):
    arm = ARM.replace("WASHER", "0.009")
    _, rows = modes_of(capsys, written(arm, "truth"), "--set=joints.bolts.kz=8e6")
    f = rows[1]["frequency_hz"]
    order = ("tune", written(arm), "--free=joints.bolts.kz", "--out=t.toml", "--json")
    assert beadwave(*order, f"--match=2={f!r}") == 0
    report = json.loads(capsys.readouterr().out)
    assert report["stiffness"]["joints.bolts.kz"] == pytest.approx(8e6, rel=1e-2)
    assert report["computed_mode"] == {"2": 2} and report["match"] == {"2": f}
    (target,) = scene("t.toml").targets
    assert (target.number, target.hz) == (2, f)
    for match in ("3", "3=a", "0=10", "500=10", "1=-5", "1=10,1=12"):
        assert beadwave(*order, f"--match={match}") == 2
        assert "needs its number and its frequency" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("kz", [1e2, 1e13])
def test_a_start_outside_of_the_bounds_is_no_obstacle(kz, capsys):
    """Bounds are 1e4 and 1e12 N/m: the fit starts within them."""
    arm = ARM.replace("WASHER", "0.009")
    _, truth = modes_of(capsys, written(arm, "truth"), "--set=joints.bolts.kz=8e6")
    target = f"[[targets]]\nhz = {truth[0]['frequency_hz']!r}\nnumber = 1\n"
    scene_file = written(f"{arm}kz = {kz}\n{target}")
    assert beadwave("tune", scene_file, "--free= joints.bolts.kz ", "--out=t.toml", "--json") == 0
    report = json.loads(capsys.readouterr().out)
    assert report["stiffness"]["joints.bolts.kz"] == pytest.approx(8e6, rel=1e-3)
    assert report["undetermined"] == {}


def test_what_cannot_be_tuned_is_named(capsys):
    scene_file = written(STACK.replace("HZ", "1000.0"))
    for free, message in (
        ("joints.pn.kz", "joints.pin.kz"),
        ("materials.steel.shear", "materials"),
    ):
        assert beadwave("tune", scene_file, f"--free={free}") == 2
        assert message in capsys.readouterr().err
    assert beadwave("tune", "cantilever", "--free=materials.aluminium.young") == 2
    assert "has no targets" in capsys.readouterr().err


def test_a_washer_beside_its_face_is_bad_input():
    box = {"box": [0.1, 0.1, 0.02]}
    tables = {
        "assembly": {"held": ["a:-z"], "material": "s", "touching": "free"},
        "materials": {"s": {"young": 210e9, "poisson": 0.3, "density": 7850.0}},
        "bodies": {"a": box, "b": {**box, "at": [0.0, 0.0, 0.02]}},
        "joints": [{"name": "j", "between": "b|a", "at": [[0.3, 0.0, 0.01]], "washer": 8e-3}],
    }
    with pytest.raises(InvalidScene, match=r"does not lie on the faces of a .*; move the point"):
        pipeline_of(resolved(tables, "w"), lambda name: nullcontext())("mesh")


@pytest.mark.parametrize("partner", ["[0.0, 0.0, 0.01]", "[0.015, 0.0, 0.01]"])
def test_bolts_whose_washers_overlap_are_bad_input(partner):
    tables = tomllib.loads(
        STACK.replace("[[0.0, 0.0, 0.01]]", f"[[0.0, 0.0, 0.01], {partner}]").replace("HZ", "1e3")
    )
    with pytest.raises(
        InvalidScene, match=r"points 1 and 2 of joints\.pin\.at .* washers need 0\.016 m"
    ):
        pipeline_of(resolved(tables, "w"), lambda name: nullcontext())("mesh")


def test_a_washer_in_millimetres_is_refused():
    tables = tomllib.loads(STACK.replace("washer = 0.008", "washer = 8").replace("HZ", "1e3"))
    with pytest.raises(InvalidScene, match=r"washer.* did you mean 0\.008"):
        scene(tables)


SHARED = STACK.replace("[[0.0, 0.0, 0.01]]", "[[-0.01, 0.0, 0.01], [0.005, 0.0, 0.01]]")


@pytest.mark.parametrize("sides", ['["rigid", "mean"]', '["mean", "rigid"]', '["mean", "mean"]'])
def test_bolts_without_washers_share_the_common_face_half_way(sides):
    """40 mm of face, bolts at -10 and 5 mm: 17.5 and 22.5 mm for each, on the side drawn."""
    text = SHARED.replace("washer = 0.008", f'washer = "share"\nsides = {sides}')
    stage = pipeline_of(scene(written(text.replace("HZ", "1.0"))), lambda name: nullcontext())
    drawn = "foot" if sides.startswith('["mean", "r') else "head"
    mesh, area = stage("mesh").meshes[drawn], []
    for i in (1, 2):
        facets = FacetBasis(mesh, mesh.elem(), facets=f"pin-{i}-{drawn}")
        area.append(facets.dx.sum())
    np.testing.assert_allclose(area, [0.0175 * 0.04, 0.0225 * 0.04], rtol=1e-9)
    first, second = stage("mesh").connections.joints[0][1:3]
    assert (first.face[:4], second.face[:4]) == ("head", "foot")
    assert {first.over, second.over} == {None, f"{drawn}:pin-1-{drawn}"}
    assert len(stage("modes").omega) > 4


def test_a_joint_whose_first_name_fits_both_bodies_keeps_their_order():
    text = STACK.replace("bodies.head", "bodies.foot-2").replace('"head"', '"foot-2"')
    text = text.replace("head|foot", "foot*|foot").replace("HZ", "1.0")
    stage = pipeline_of(scene(written(text)), lambda name: nullcontext())
    (joint,) = stage("mesh").connections.joints
    assert joint.first.face.startswith("foot-2:") and joint.second.face.startswith("foot:")


CORNER = """
assembly = { held = ["foot:-z", "head:+x"], material = "steel", touching = "tied" }
materials.steel = { young = 210e9, poisson = 0.3, density = 7850.0 }
bodies.foot = { box = [0.04, 0.04, 0.02], seed = 0.02 }
bodies.head = { box = [0.04, 0.04, 0.02], at = [0.0, 0.0, 0.02], seed = 0.02 }
"""


def test_nodes_that_a_tie_and_a_support_both_hold_are_reported(capsys):
    """The edge of 40 mm where the head's held side meets the tie: 5 nodes of 2 elements."""
    (Path("corner.toml")).write_text(CORNER)
    assert beadwave("modes", "corner.toml") == 0
    assert "5 nodes of the tie" in capsys.readouterr().out
    Path("corner.toml").write_text(CORNER.replace(', "head:+x"', ""))
    assert beadwave("modes", "corner.toml", "--json") == 0
    assert json.loads(capsys.readouterr().out)["warnings"] == []


@pytest.mark.slow
def test_the_rig_of_its_step_file_has_the_modes_of_the_rig(capsys):
    """Both on elements 1.7 times as large; at their own the four modes lie within 0.25 %."""
    assert beadwave("modes", "rig-rom", "--step=rig.step") == 0
    seeds = {"seed": 6e-3, "block_seed": 20e-3, "support_seed": 60e-3, "contact_seed": 5e-3}
    coarse = [f"--set=mesh.{key}={1.7 * seed}" for key, seed in seeds.items()]
    text = (Path(__file__).parents[2] / "examples" / "rig.toml").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 25
    example = scene(written(text, "rig"), ("mesh.scale=1.7",))
    stages = pipeline_of(example, lambda name: nullcontext())
    built = pipeline_of(scene("rig-rom"), lambda name: nullcontext())
    (mass, expected_mass) = (
        sum(stage("mesh").materials[n].density * volume(m) for n, m in stage("mesh").meshes.items())
        for stage in (stages, built)
    )
    assert mass / expected_mass == pytest.approx(1, rel=1e-6)
    capsys.readouterr()
    _, rows = modes_of(capsys, "rig-rom", *coarse)
    expected = {r["hammer_mode"]: r["frequency_hz"] for r in rows if r["hammer_mode"]}
    found = stages("modes").paired_hz
    np.testing.assert_allclose([found[str(i)] for i in expected], [*expected.values()], rtol=3e-3)


def volume(mesh):
    return Basis(mesh, mesh.elem(), intorder=3).dx.sum()


def test_plates_on_bolts_have_the_size_of_elements_asked_for(monkeypatch):
    """The first algorithm leaves a corner of 4 degrees; the next ones are tried before elements of
    0.7 of the size, which are 1.6 times as many."""
    bolted = scene("plate-on-bolts", ("mesh.scale=2",))
    n_elements = [sum(m.nelements for m in assembly.mesh(bolted).meshes.values())]
    smaller = tuple(a for a in hexahedra.JOINED if a.get("MeshSizeFactor") == 0.7)
    monkeypatch.setattr(hexahedra, "JOINED", smaller)
    n_elements.append(sum(m.nelements for m in assembly.mesh(bolted).meshes.values()))
    assert n_elements[0] < 0.75 * n_elements[1]
