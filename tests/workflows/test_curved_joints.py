"""Joints whose faces are round: saddles, bars on plates, balls; by scenes as a user writes them."""

import re
from functools import partial

import gmsh
import meshio
import numpy as np
import pytest

from beadwave import InvalidScene, modes
from beadwave.geometry.meshing.gmsh_session import session, silent
from beadwave.workflows.scene.toml import resolved
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.engine.progress import quiet

pytestmark = pytest.mark.usefixtures("shared_cache", "files_read_here")
R, L = 0.02, 0.04  # m, of the bar
E_STAR = 210e9 / (2 * (1 - 0.3**2))


def bar_between_plates(force=20e3, **joint):
    """A bar on a held plate and under another one, which a load presses."""
    plate = {"box": [0.06, L, 0.02]}
    contact = {"model": "contact"} | joint
    return {
        "name": "bar",
        "assembly": {"held": ["plate:-z"], "material": "steel", "touching": "free"},
        "mesh": {"scale": 1.3},
        "bodies": {
            "plate": plate | {"at": [0.0, 0.0, -0.01]},
            "bar": {
                "cylinder": {"radius": R, "length": L}, "turn": [90.0, 0.0, 0.0],
                "at": [0.0, 0.0, R],
            },
            "lid": plate | {"at": [0.0, 0.0, 2 * R + 0.01]},
        },
        "loads": [{"name": "push", "on": "lid:+z", "force": force}],
        "joints": [
            {"name": "below", "between": "bar|plate"} | contact,
            {"name": "above", "between": "bar|lid"} | contact,
        ],
    }  # fmt: skip


def through(scene, *stages):
    """Results of stages of a scene."""
    pipeline = pipeline_of(resolved(scene, "curved.toml"), quiet)
    return [pipeline(stage) for stage in stages]


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"loads": None}, r"joints\.below: nothing presses the faces on each other"),
        ({"below": {"washer": 0.01}}, r"joints\.below\.washer belongs to bolts"),
        ({"below": {"between": "bar|ground"}}, "the ground has no face to be in contact with"),
        ({"below": {"preload": 1e3}}, "preload belong to a bolt"),
        ({"below": {"kz": 1e8}}, "kz belong to springs"),
        ({"below": {"model": None, "friction": 0.1}}, "friction belong to a bolt"),
    ],
)
def test_faces_in_contact_without_a_bolt_that_contradict_themselves_are_refused(change, sentence):
    tables = bar_between_plates()
    below = tables["joints"][0] | change.pop("below", {})
    tables |= change | {"joints": [below, tables["joints"][1]]}
    tables = {key: value for key, value in tables.items() if value is not None}
    tables["joints"][0] = {k: v for k, v in below.items() if v is not None}
    with pytest.raises(InvalidScene, match=sentence) as refused:
        resolved(tables, "curved.toml")
    assert str(refused.value).count(". ") == 0


def test_a_bar_that_lies_on_a_plate_is_in_contact_along_a_line_alone():
    """Its springs by formula are refused: there is no area that they could hold."""
    tables = bar_between_plates()
    tables["joints"][0] = {"name": "below", "between": "bar|plate", "washer": 5e-3, "kz": 1e8}
    tables["joints"][0]["at"] = [[0.0, 0.0, 0.0]]
    with pytest.raises(InvalidScene, match=r'"bar\|plate" do not touch.* model = "contact"'):
        through(tables, "mesh")


@pytest.mark.slow
def test_a_bar_between_plates_has_hertz_pressure_within_its_stated_error():
    """p = p_0 sqrt(1 - x^2 / b^2) with b^2 = 4 F R / (pi L E*); the zone within a row of facets.
    Twice the load, sqrt(2) of the width."""
    widths = []
    for force in (20e3, 40e3):
        model, rows = through(bar_between_plates(force), "model", "contact-numbers")
        b = np.sqrt(4 * force * R / (np.pi * L * E_STAR))
        p_0 = 2 * force / (np.pi * b * L)
        contact = model.contact
        for i, row in enumerate(rows):
            mine = contact.facets.pair == i
            x, area = contact.facets.points[mine, 0], contact.facets.area[mine]
            exact = p_0 * np.sqrt(np.maximum(1 - (x / b) ** 2, 0.0))
            off = np.sqrt(area @ (contact.pressure[mine] - exact) ** 2 / (area @ exact**2))
            assert off < row.pressure_error <= 0.5
            assert row.zone_area_m2 == pytest.approx(2 * b * L, rel=row.zone_error)
            assert row.pressure_max_Pa == pytest.approx(p_0, rel=0.15)
            assert row.force_N == pytest.approx(force, rel=1e-3) and row.follows_preload
        widths.append(rows[0].zone_area_m2 / L)
    assert widths[1] / widths[0] == pytest.approx(np.sqrt(2), rel=0.3)


def step(name, build):
    """A STEP file with the bodies that `build` draws."""
    with session():
        gmsh.option.setString("Geometry.OCCTargetUnit", "M")
        build(gmsh.model.occ)
        gmsh.model.occ.synchronize()
        with silent():
            gmsh.write(name)
    return name


def half_ball(occ):
    """A plate, and a ball of 20 mm cut off 15 mm above it."""
    occ.addBox(-0.02, -0.02, -0.02, 0.04, 0.04, 0.02)
    ball = occ.addSphere(0, 0, R, R)
    occ.cut([(3, ball)], [(3, occ.addBox(-0.03, -0.03, 0.015, 0.06, 0.06, 0.03))])


def ball_on_plate(force, scale):
    """Half a ball that a force [N] presses on a block, meshed at this scale."""
    return {
        "name": "ball",
        "assembly": {
            "step": step("ball.step", half_ball), "held": ["body-1:-z"], "material": "steel",
            "touching": "free",
        },
        "mesh": {"scale": scale},
        "loads": [{"name": "push", "on": "body-2:+z", "force": force}],
        "joints": [{"name": "seat", "between": "body-2|body-1", "model": "contact"}],
    }  # fmt: skip


@pytest.mark.slow
def test_a_ball_on_a_plate_has_hertz_zone_and_stiffens_with_its_load(tmp_path, monkeypatch):
    """a^3 = 3 F R / (4 E*); its stiffness k = 2 E* a is that of the mode in which it bounces, so
    that eight times the load raises this by a factor of sqrt(2)."""
    monkeypatch.chdir(tmp_path)
    bounces = []
    for force in (100.0, 800.0):
        pipeline = pipeline_of(resolved(ball_on_plate(force, 1.5), "ball.toml"), quiet)
        (row,), contact = pipeline("contact-numbers"), pipeline("model").contact
        a = np.cbrt(0.75 * force * R / E_STAR)
        assert row.zone_area_m2 == pytest.approx(np.pi * a**2, rel=row.zone_error)
        r2 = np.sum(contact.facets.points[:, :2] ** 2, axis=1)
        exact = 1.5 * force / (np.pi * a**2) * np.sqrt(np.maximum(1 - r2 / a**2, 0.0))
        area = contact.facets.area
        off = np.sqrt(area @ (contact.pressure - exact) ** 2 / (area @ exact**2))
        assert off < row.pressure_error < 0.3
        # the mode in which the ball moves up and down
        omega, phi = pipeline("modes").omega[:8], pipeline("modes").phi[:, :8]
        up = np.abs((pipeline("model").T @ phi)[2::3].mean(axis=0))
        bounces.append(omega[np.argmax(up)])
    assert bounces[1] / bounces[0] == pytest.approx(np.sqrt(2), rel=0.1)


@pytest.mark.slow
def test_a_ball_of_a_mesh_file_has_hertz_zone_and_rolls_beyond_an_amplitude(tmp_path, monkeypatch):
    """Of the mesh drawn for it: the faces are found round by their corners. The lowest mode rocks
    the ball, which loops about one place of contact follow up to some amplitude."""
    monkeypatch.chdir(tmp_path)
    force = 500.0
    scene = ball_on_plate(force, 1.8)
    (mesh,) = through(scene, "mesh")
    drawn = [mesh.meshes[name] for name in ("body-1", "body-2")]
    n = drawn[0].p.shape[1]
    cells = [("tetra", drawn[0].t.T), ("tetra", n + drawn[1].t.T)]
    elements, none = [np.arange(len(cell)) for _, cell in cells], np.arange(0)
    sets = {"body-1": [elements[0], none], "body-2": [none, elements[1]]}
    points = np.vstack([part.p.T for part in drawn])
    meshio.Mesh(points, cells, cell_sets=sets).write("ball.inp")
    del scene["mesh"], scene["assembly"]["step"]
    scene["assembly"]["mesh"] = "ball.inp"

    result = modes(scene, amplitude=True)
    (row,), a = result.table.contact, np.cbrt(0.75 * force * R / E_STAR)
    assert row.zone_area_m2 == pytest.approx(np.pi * a**2, rel=row.zone_error)
    assert row.pressure_max_Pa == pytest.approx(
        1.5 * force / (np.pi * a**2), rel=row.pressure_error
    )
    assert "bodies roll on their faces above" in " ".join(result.table.warnings)
    assert {one.mode for one in result.table.amplitude} == {1, 2, 3, 4, 5, 6}


def saddles(occ):
    """A bar between two saddles, and one hole through all."""

    def hole():
        return occ.addCylinder(0, 0, -0.05, 0, 0, 0.1, 0.0045)

    def bar():
        return occ.addCylinder(0, -0.03, 0, 0, 0.06, 0, 0.02)

    occ.cut([(3, bar())], [(3, hole())])
    for z in (0, -0.03):
        block = occ.addBox(-0.015, -0.02, z, 0.03, 0.04, 0.03)
        occ.cut([(3, block)], [(3, bar()), (3, hole())])


def clamped(**joint):
    """One M8 from the upper saddle through the bar to the lower one."""
    return {
        "name": "saddles",
        "assembly": {
            "step": step("saddles.step", saddles), "held": ["body-1:-y"], "material": "steel",
            "touching": "free",
        },
        "mesh": {"scale": 4.0},
        "joints": [
            {
                "name": "clamp", "stack": ["body-2", "body-1", "body-3"], "bolt": "M8-8.8",
                "preload": 10e3,
            }
            | joint
        ],
    }  # fmt: skip


@pytest.mark.minutes
def test_saddles_on_a_bar_carry_the_bolt_and_have_frequencies_of_their_springs(
    tmp_path, monkeypatch
):
    """Pressure and shear of each round face are in balance with the bolt; springs by formula give
    the lowest modes within the spreads of both."""
    monkeypatch.chdir(tmp_path)
    tables = {model: modes(clamped(model=model)).table for model in ("contact", "springs")}
    (contact,) = through(clamped(model="contact"), "model")
    contact = contact.contact
    for i in range(2):
        mine = contact.facets.pair == i
        axes, area = contact.facets.axes[mine], contact.facets.area[mine]
        normal = (contact.pressure[mine] * area) @ axes[:, 0]
        shear = np.einsum("im,mij->j", contact.shear[:, mine], axes[:, 1:])
        force = normal + shear
        assert abs(force[2]) == pytest.approx(10e3, rel=0.01)
        assert abs(normal[2]) < 10e3 or np.hypot(*force[:2]) < 100
    assert "hard faces that fit each other" in tables["contact"].text()
    assert [row.joint for row in tables["contact"].contact] == ["clamp"]
    for one, other in zip(*(table.rows[:4] for table in tables.values()), strict=True):
        spread = np.hypot(one.deviation_hz, other.deviation_hz)
        assert abs(one.frequency_hz - other.frequency_hz) < 2.5 * spread
        assert one.frictionless_hz < one.frequency_hz < one.tied_hz


def cone_in_its_seat(occ, tip=0.004):
    """A truncated cone in a block, and one hole through both; it stands on a floor of the radius
    `tip` where that is wider than the hole."""

    def hole():
        return occ.addCylinder(0, 0, -0.01, 0, 0, 0.05, 0.0045)

    def cone():
        return occ.addCone(0, 0, 0.01, 0, 0, 0.02, tip, 0.021)

    block = occ.addBox(-0.03, -0.03, 0, 0.06, 0.06, 0.025)
    occ.cut([(3, block)], [(3, cone()), (3, hole())])
    occ.cut([(3, cone())], [(3, hole())])


@pytest.mark.parametrize("tip", [0.004, 0.012])
def test_springs_of_bolts_are_not_those_of_conical_faces(tip, tmp_path, monkeypatch):
    """Springs gave 8.8 kHz within 6 %, the contact 16.9 kHz; with it the scene goes on."""
    monkeypatch.chdir(tmp_path)
    scene = clamped()
    drawn = step("cone.step", partial(cone_in_its_seat, tip=tip))
    scene["assembly"] |= {"step": drawn, "held": ["body-1:-z"]}
    scene["joints"][0] |= {"between": "body-1|body-2"}
    del scene["joints"][0]["stack"]
    with pytest.raises(InvalidScene, match=r'presses conical faces .* take model = "contact"'):
        through(scene, "mesh")
    scene["joints"][0]["model"] = "contact"
    (mesh,) = through(scene, "mesh")
    assert mesh.contacts


@pytest.mark.slow
def test_head_and_nut_stand_on_plane_faces(tmp_path, monkeypatch):
    """Of a bolt whose nut would stand on the bar."""
    monkeypatch.chdir(tmp_path)
    tables = clamped(model="contact")
    del tables["joints"][0]["stack"]
    tables["joints"][0]["between"] = "body-2|body-1"
    with pytest.raises(InvalidScene) as refused:
        through(tables, "mesh")
    assert re.search(r"hole in body-1 at .* has no plane face at its other end", str(refused.value))
