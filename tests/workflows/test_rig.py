"""The thesis' rig written out as an ordinary scene of bodies."""

import numpy as np
import pytest
from skfem import Basis, FacetBasis

from beadwave import fem
from beadwave.geometry import smallest_quality
from beadwave.workflows.files.scene import scene
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.scene.rig import DIMENSIONS, PARTS, RigScene, RigTable, check
from beadwave.workflows.scene.toml import parsed, resolved, toml
from beadwave.workflows.stages.structure import assembly as stages
from beadwave.workflows.structure.dampings import known_dampings, with_dampings

from command_line import beadwave
from known_models import rig

SIZES = ("mesh.block_seed=15e-3", "mesh.support_seed=25e-3", "mesh.contact_seed=3e-3")
COARSE = ("mesh.seed=0.012", "mesh.block_seed=0.04", "mesh.contact_seed=0.02")


@pytest.mark.parametrize(
    ("dimension", "sentence"),
    [
        ({"sheet_thickness": -1e-3}, r"sheet_thickness = -0.001 m must be a positive"),
        ({"block_x": float("nan")}, r"block_x = nan m must be a positive"),
        ({"screw_x": (-0.03, 0.03)}, r"screw_x = -0.03 m .* does not fit"),
        ({"screw_x": ()}, r"screw_x = \[\] must list"),
        ({"screw_x": (0.015, -0.015)}, r"screw_x = .* ascending"),
        ({"head_screw_z": 0.005}, r"head_screw_z puts a washer .* not in the overlap"),
        ({"hole_radius": 0.02}, r"hole_radius = 0.02 m must be below washer_radius"),
        ({"sheet_width": 0.2}, r"sheet_width = 0.2 m must not exceed block_x"),
        ({"head_overlap": 0.05}, r"head_overlap = 0.05 m must not exceed block_z"),
        ({"block_y": 0.09}, r"sheets_support_y = 0.0982 m must equal block_y = 0.09"),
        ({"support_x": 0.2}, r"overhang each other"),
        ({"pad": 0.1}, r"pad = 0.1 m must be less than half"),
        ({"stack_inset": 0.004}, r"stack_inset = 0.004 m .* off a part of 0.078 m"),
        ({"bolt_inset": 0.005}, r"bolt_inset = 0.005 m .* off a plate"),
        ({"parts": ("sheets", "block")}, r"parts = .* must be the first of"),
    ],
)
def test_impossible_dimensions_are_refused_with_their_numbers(dimension, sentence):
    with pytest.raises(InvalidScene, match=sentence):
        check(RigTable().but(**dimension))


def test_every_dimension_tells_where_it_comes_from():
    for name in DIMENSIONS:
        assert "(" in RigTable.model_fields[name].description


def area(parts, face):
    mesh = parts.meshes[face.split(":")[0]]
    return FacetBasis(mesh, mesh.elem(), facets=face.split(":")[1]).dx.sum()


@pytest.fixture(scope="module", params=["hex", "tet"])
def screwed(request):
    """All parts tied under their screws, the plate bolted to the ground."""
    changes = (
        "assembly.constraint=screw-tie",
        "assembly.fixing=bolted",
        f"mesh.element={request.param}",
    )
    return rig(*SIZES, *changes)


@pytest.mark.slow
def test_parts_touch_from_the_block_down_to_the_plate(screwed):
    pairs = {frozenset(tie.slave.split(":")[1].split("|")) for tie in screwed.rigid.ties}
    sheets = [(sheet, on) for sheet in ("sheet-y", "sheet+y") for on in ("block", "sheets_support")]
    stack = [("sheets_support", "support"), ("support", "plate")]
    assert pairs == {frozenset(pair) for pair in (*sheets, *stack)}


def test_the_mesh_fills_the_dimensions(screwed):
    # straight edges of tetrahedra miss a part of the holes, 0.4 % of the sheets
    a = RigTable()
    solids = (("block", "block"), ("sheets_support", "sheets_support"), ("plate", "plate"))
    expected = {name: np.prod([getattr(a, f"{key}_{x}") for x in "xyz"]) for name, key in solids}
    length = a.foot_overlap + a.sheet_free_length + a.head_overlap
    holes = 2 * len(a.screw_x) * np.pi * a.hole_radius**2
    expected["sheet-y"] = expected["sheet+y"] = (length * a.sheet_width - holes) * a.sheet_thickness
    for name, volume in expected.items():
        mesh = screwed.meshes[name]
        assert Basis(mesh, mesh.elem(), intorder=3).dx.sum() == pytest.approx(volume, rel=1e-3)
    assert min(map(smallest_quality, screwed.meshes.values())) > 0.01


def test_screws_and_bolts_press_on_their_areas(screwed):
    a = RigTable()
    ring = np.pi * (a.washer_radius**2 - a.hole_radius**2)
    expected = {"sheet": len(a.screw_x) * ring, "support": 4 * a.stack_washer**2}
    for tie in screwed.connections.ties:
        kind = "sheet" if tie.slave.startswith(("sheet-", "sheet+")) else "support"
        assert area(screwed, tie.slave) == pytest.approx(expected[kind], rel=0.03)
    (held,) = screwed.connections.held
    assert area(screwed, held.face) == pytest.approx(4 * a.bolt_washer**2)
    assert area(screwed, "block:strike") == pytest.approx(a.block_y * a.block_z)


def test_a_contact_seed_refines_only_around_the_contact(screwed):
    block, a = screwed.meshes["block"], RigTable()
    corners = block.p[1:, block.facets[:, block.boundaries["strike"]]]
    size = np.ptp(corners, axis=1).max(axis=0)
    point = np.array([0.03, a.block_z / 2])
    distance = np.hypot(*(corners.mean(axis=1) - point[:, None]))
    assert size[distance.argmin()] < 5e-3 and size.max() > 9e-3


@pytest.mark.parametrize("n_parts", [1, 2, 3, 4, 5])
def test_the_lowest_part_is_held(n_parts):
    a = RigTable()
    parts = rig(f"assembly.parts={list(PARTS[:n_parts])}", *COARSE, of="rig-full-tie")
    faces = [hold.face for hold in parts.connections.held]
    lowest = PARTS[n_parts - 1]
    assert {face.split(":")[0] for face in faces} == {
        "block": set(), "sheets": {"sheet-y", "sheet+y"}
    }.get(lowest, {lowest})  # fmt: skip
    if lowest == "sheets":
        foot = a.sheet_width * a.foot_overlap - len(a.screw_x) * np.pi * a.hole_radius**2
        assert area(parts, faces[0]) == pytest.approx(foot, rel=1e-6)


@pytest.mark.parametrize("screw_x", [(0.0,), (-0.02, 0.0, 0.02)])
def test_screws_may_be_many_or_one(screw_x):
    parts = rig(f"assembly.screw_x={list(screw_x)}", "assembly.washer_radius=6e-3", *COARSE)
    head = [j for j in parts.connections.joints if j.name == "head"]
    assert len(head) == 2 * len(screw_x)
    shares = [area(parts, j.first.face) for j in head[: len(screw_x)]]
    a = RigTable()
    overlap = a.sheet_width * a.head_overlap - len(screw_x) * np.pi * a.hole_radius**2
    assert sum(shares) == pytest.approx(overlap, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [
        (),
        ("assembly.constraint=screw-tie", "assembly.fixing=corners"),
        ("assembly.constraint=full-tie", "mesh.element=tet", "mesh.seed=0.02"),
        ("patch.weights=thesis", "targets=[{number=2, hz=270.0}]"),
    ],
)
def test_the_bodies_of_a_rig_are_an_ordinary_scene_of_the_same_model(changes, monkeypatch):
    """As TOML without a key of the rig, read again: the same modes and contact to rounding, between
    the grid lines of the rig, which are no keys of a scene."""
    given = scene("rig-rom", (*COARSE, *changes))
    monkeypatch.setattr(Scene, "grids", given.grids)
    text = toml(Scene.model_construct(**{name: x for name, x in given if name != "rig"}))
    again = resolved(parsed(text, "again"), "again")
    assert not isinstance(again, RigScene) and again.measured_hz == given.measured_hz
    solved = []
    for case in (given, again):
        parts = stages.mesh(case)
        model = stages.model(case, parts)
        w = stages.contact(case, parts, model).w
        solved.append(
            (fem.modes(model.K, model.M, 6).frequency_hz, w @ fem.factorised(model.K).solve(w))
        )
    for one, other in zip(*solved, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-8)


@pytest.mark.slow
def test_tetrahedra_approach_the_modes_of_grid_lines_as_they_are_refined():
    """The first modes of block and sheets, on gmsh's tetrahedra of the same bodies without lines.
    At half the size 0.11, 0.68 and 0.71 of their difference from a fine grid are left: the sheets
    are thinner than any of these tetrahedra, and their clamped edges are singular."""

    def hz(element, seed, block):
        sizes = (f"mesh.seed={seed}", f"mesh.block_seed={block}", f"mesh.element={element}")
        case = scene("rig-full-tie", sizes)
        parts = stages.mesh(case)
        model = stages.model(case, parts)
        return fem.modes(model.K, model.M, 3).frequency_hz

    limit = hz("hex", 3e-3, 8e-3)
    coarse, fine = (hz("tet", scale * 4e-3, scale * 12e-3) / limit - 1 for scale in (2, 1))
    assert np.all(abs(fine) < 0.8 * abs(coarse)) and np.all(abs(fine) < 0.03)


@pytest.mark.parametrize(
    "change",
    [
        lambda given: given.but(assembly={"block_x": 0.12}, mesh={"seed": 5e-3}),
        lambda given: given.but(patch={"radius": 1.5e-3}, time={"error": 1e-3}),
        lambda given: given.with_joints({"foot.kx": 1e8, "head.cy": 2.0}),
        lambda given: given.with_materials({"block": {"young": 200e9}, "plate": {"density": 7e3}}),
        lambda given: given.remeasured({1: {"hz": 51.0}, 2: {"hz": 270.0, "hz_deviation": 0.1}}),
    ],
    ids=["dimensions", "patch", "joints", "materials", "targets"],
)
def test_a_changed_rig_reads_back_as_the_same_bodies(change):
    given = scene("rig-rom")
    changed = change(given)
    assert changed != given and "[bodies" not in toml(changed)
    for again in (parsed(toml(changed), "again"), changed.model_dump(exclude_none=True)):
        assert resolved(again, "again") == changed


def test_measured_damping_is_that_of_the_mode_with_its_number():
    """Of a list that names the second mode alone."""
    targets = [{"number": 2, "hz": 269.0, "zeta": 0.004}]
    ratios = [target.zeta for target in scene("rig-rom", {"targets": targets}).targets]
    assert ratios == [None, 0.004, None, None]


def test_dashpots_of_the_rig_s_joints_are_set_as_those_of_any_joint():
    given = scene("rig-rom")
    name = "joints.head.cy"
    assert known_dampings(given, [])[name] == 0.0
    result = with_dampings(given, {name: 3.0})
    assert result.bushings["head"].cy == 3.0 and result.rig.joints.head.cy == 3.0


def test_a_table_of_the_thesis_needs_its_rig(capsys):
    assert beadwave("modes", "cantilever", "--table=5.2") == 2
    assert (
        "cantilever has no [assembly] of the thesis' rig; take rig-rom" in capsys.readouterr().err
    )
