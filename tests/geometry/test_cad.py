"""Bodies of shapes and of STEP files, against volumes, areas and axes known exactly."""

import re
from dataclasses import replace
from math import pi
from pathlib import Path

import gmsh
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beadwave.geometry import InvalidGeometry
from beadwave.geometry.cad.holes import bores
from beadwave.geometry.cad.occ import body_of, model, write_step
from beadwave.geometry.cad.selectors import faces
from beadwave.geometry.cad.shapes import Box, Cylinder, Hole, RadialHole, Slab, volume
from beadwave.geometry.cad.touching import neighbours
from beadwave.geometry.meshing.gmsh_session import session, silent
from beadwave.workflows.files.scene import scene
from beadwave.workflows.scene.body_shapes import shapes

HOLES = tuple(Hole(8.5e-3, at) for at in ((0.02, 0.02), (0.18, 0.02), (0.18, 0.08), (0.02, 0.08)))
RECTANGLE = ((0, 0), (0.2, 0), (0.2, 0.1), (0, 0.1))
ELL = ((0, 0), (0, 0.1), (0.03, 0.1), (0.03, 0.02), (0.08, 0.02), (0.08, 0))  # clockwise
SHAPES = {
    "beam": Box((0.3, 0.04, 0.005), at=(0.1, 0.2, 0.3), turn=(10, 20, 30)),
    "cover": Slab(RECTANGLE, 0.008, HOLES, turn=(0, 90, 0)),
    "angle": Slab(ELL, 0.05, at=(1.0, 0, 0)),
    "tube": Cylinder(0.05, 0.4, 0.045, turn=(90, 0, 0)),
}


@pytest.fixture(scope="module")
def bodies():
    with model(SHAPES) as cad:
        return cad.bodies


@pytest.mark.parametrize("name", SHAPES)
def test_bodies_have_the_volumes_of_their_shapes(bodies, name):
    assert bodies[name].volume == pytest.approx(volume(SHAPES[name]), rel=1e-9)


def test_volumes_of_shapes_are_those_of_the_textbook():
    assert volume(SHAPES["angle"]) == pytest.approx(0.05 * (0.03 * 0.1 + 0.05 * 0.02))
    assert volume(SHAPES["cover"]) == pytest.approx(0.008 * (0.02 - pi * 8.5e-3**2))


def test_a_turned_box_has_the_inertia_of_a_cuboid_in_its_axes(bodies):
    a, b, c = SHAPES["beam"].sides
    about = np.diag([b * b + c * c, a * a + c * c, a * a + b * b]) / 12 * a * b * c
    turn = Rotation.from_euler("xyz", SHAPES["beam"].turn, degrees=True).as_matrix()
    beam = bodies["beam"]
    np.testing.assert_allclose(beam.centroid, SHAPES["beam"].at, atol=1e-12)
    assert beam.extent == pytest.approx(np.linalg.norm(SHAPES["beam"].sides))
    np.testing.assert_allclose(beam.inertia, turn @ about @ turn.T, atol=1e-9 * about.max())


def test_normals_of_faces_point_out_of_the_body(bodies):
    # by Gauss the flux of the position vector through a closed surface is three times the volume
    for name in ("beam", "angle"):
        flux = sum(f.area * f.centre @ f.normal for f in bodies[name].faces)
        assert flux == pytest.approx(3 * bodies[name].volume, rel=1e-9)


def test_bores_and_outer_cylinders_are_told_apart_with_axis_and_length(bodies):
    round_faces = [f for f in bodies["tube"].faces if f.axis is not None]
    assert {(round(f.radius, 9), f.hollow) for f in round_faces} == {(0.05, False), (0.045, True)}
    for face in round_faces:
        np.testing.assert_allclose(abs(face.axis), [0, 1, 0], atol=1e-12)
        assert face.along[1] - face.along[0] == pytest.approx(0.4)


def test_step_files_keep_names_and_volumes(tmp_path):
    many = {f"part-{i}": Box((0.01, 0.02, 0.03 + i / 1000), at=(0.02 * i, 0, 0)) for i in range(14)}
    write_step(many, tmp_path / "many.step")
    with model({}, tmp_path / "many.step") as read:
        assert read.unit == "mm"
        assert {b.name: b.volume for b in read.bodies.values()} == pytest.approx(
            {name: volume(box) for name, box in many.items()}, rel=1e-9
        )


def test_the_rig_is_read_back_from_its_own_step_file(tmp_path):
    case = scene("rig-rom")
    drawn, rig = shapes(case), case.rig.assembly
    write_step(drawn, tmp_path / "rig.step")
    with model({}, tmp_path / "rig.step") as read:
        bodies = read.bodies
        pairs = {t.name: t.area for t in neighbours(bodies, 1e-5).touching}
    assert {name: body.volume for name, body in bodies.items()} == pytest.approx(
        {name: volume(shape) for name, shape in drawn.items()}, rel=1e-6
    )
    holes = 2 * pi * rig.hole_radius**2
    overlap = {"block": rig.head_overlap, "sheets_support": rig.foot_overlap}
    expected = {
        f"{body}|{sheet}": length * rig.sheet_width - holes
        for body, length in overlap.items()
        for sheet in ("sheet-y", "sheet+y")
    }
    expected |= {"sheets_support|support": rig.support_x * rig.support_y}
    expected |= {"support|plate": rig.support_x * rig.support_y}
    assert pairs == pytest.approx(expected, rel=1e-6)


def test_a_step_file_of_surfaces_alone_is_refused(tmp_path):
    path = str(tmp_path / "skin.step")
    with session(), silent():
        gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.write(path)
    with pytest.raises(InvalidGeometry, match="surfaces without a volume"), model({}, Path(path)):
        pass


def test_a_solid_of_no_thickness_is_refused():
    with session():
        tag = gmsh.model.occ.addBox(0, 0, 0, 0.1, 0.1, 4e-7)
        gmsh.model.occ.synchronize()
        with pytest.raises(InvalidGeometry, match=r'body "foil" .* has no volume'):
            body_of("foil", tag)


def test_a_step_file_in_inches_is_converted_and_says_so(tmp_path):
    write_step({"cube": Box((0.01, 0.01, 0.01))}, tmp_path / "cube.step")
    text = (tmp_path / "cube.step").read_text()
    assert "(-5.,-5.,-5.)" in text  # in the millimetres that it states
    millimetre = "( LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.) )"
    assert millimetre in text
    inch = (
        "DATA;\n#9001 = LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(25.4),#9002);\n"
        f"#9002 = {millimetre};\n#9003 = DIMENSIONAL_EXPONENTS(1.,0.,0.,0.,0.,0.,0.);"
    )
    text = text.replace(
        millimetre, "( CONVERSION_BASED_UNIT('INCH',#9001) LENGTH_UNIT() NAMED_UNIT(#9003) )"
    )
    (tmp_path / "cube.step").write_text(text.replace("DATA;", inch))
    with model({}, tmp_path / "cube.step") as read:
        assert read.unit == "inch"
        assert read.bodies["cube"].volume == pytest.approx(0.254**3)


def test_faces_named_in_a_step_file_are_picked_by_their_names(tmp_path):
    path = tmp_path / "named.step"
    write_step({"a": Box((0.1,) * 3), "b": Cylinder(0.02, 0.1, 0.01, at=(1, 0, 0))}, path)
    pieces = path.read_text().split("ADVANCED_FACE(''")
    # the first faces of the box are -x and +x, the last two of the tube its ends and its bore
    named = ["", "left", "right", *[""] * 4, "outside", "top", "bottom", "NONE"]
    text = pieces[0] + "".join(
        f"ADVANCED_FACE('{name}'{piece}" for name, piece in zip(named[1:], pieces[1:], strict=True)
    )
    path.write_text(text)
    with model({}, path) as read:
        (left,) = faces("#left", read.bodies).tags
        (outside,) = faces("b:#outside", read.bodies).tags
        a, b = read.bodies.values()
        np.testing.assert_allclose(a.face(left).centre, [-0.05, 0, 0], atol=1e-9)
        assert b.face(outside).radius == pytest.approx(0.02)
        with pytest.raises(InvalidGeometry, match='the CAD names "bottom", "left", "outside"'):
            faces("#NONE", read.bodies)


def test_equal_names_in_a_step_file_are_numbered(tmp_path):
    write_step({"a": Box((0.01,) * 3), "b": Box((0.02,) * 3)}, tmp_path / "two.step")
    text = (tmp_path / "two.step").read_text().replace("'b'", "'a'")
    (tmp_path / "two.step").write_text(text)
    with model({}, tmp_path / "two.step") as read:
        assert list(read.bodies) == ["a-1", "a-2"]


def test_a_name_both_drawn_and_read_is_refused(tmp_path):
    write_step({"a": Box((0.01,) * 3)}, tmp_path / "one.step")
    with (
        pytest.raises(InvalidGeometry, match='holds a body "a"'),
        model({"a": Box((0.02,) * 3)}, tmp_path / "one.step"),
    ):
        pass


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("", "is empty"),
        ("solid cube\n", "is no STEP file"),
        ("ISO-10303-21;\nHEADER;\n", "is cut off"),
        ("ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\nENDSEC;\nEND-ISO-10303-21;\n", "solids|read"),
        (None, "does not exist"),
    ],
)
def test_files_without_bodies_are_refused_in_a_sentence(tmp_path, content, says, capfd):
    path = tmp_path / "bad.step"
    if content is not None:
        path.write_text(content)
    with pytest.raises(InvalidGeometry, match=says), model({}, path):
        pass
    assert capfd.readouterr().out == ""


@pytest.mark.parametrize(
    ("build", "says"),
    [
        (lambda: Box((0.1, 0.0, 0.1)), "side along y = 0.0 m"),
        (lambda: Box((0.1, 0.1, 0.1), at=(0, float("nan"), 0)), "at = .* three finite"),
        (lambda: Cylinder(0.05, 0.4, 0.05), "bore = 0.05 m"),
        (lambda: Slab(RECTANGLE, 0.0), "thickness = 0.0 m"),
        (lambda: Slab(RECTANGLE[:2], 0.01), "at least three points"),
        (lambda: Slab(((0, 0), (1, 1), (1, 0), (0, 1)), 0.01), "edges 1 and 3 meet"),
        (
            lambda: Slab(RECTANGLE, 0.01, (Hole(0.01, (0.004, 0.05)),)),
            "not inside the outline",
        ),
        (
            lambda: Slab(RECTANGLE, 0.01, (Hole(0.01, (0.3, 0.05)),)),
            "not inside the outline",
        ),
        (
            lambda: Slab(RECTANGLE, 0.01, (Hole(0.01, (0.1, 0.05)), Hole(0.01, (0.105, 0.05)))),
            "which must exceed 0.01 m",
        ),
    ],
)
def test_shapes_that_cannot_be_are_refused_with_the_number(build, says):
    with pytest.raises(InvalidGeometry, match=says):
        build()


DRILLED = {
    "plate": Slab(RECTANGLE, 0.02, (Hole(0.01, (0.05, 0.05), 0.012), Hole(0.006, (0.15, 0.05)))),
    "flange": Cylinder(
        0.04, 0.02, 0.01, (Hole(0.008, (0.025, 0.0)), Hole(0.006, (-0.025, 0.0), 0.015))
    ),
    "shaft": Cylinder(0.01, 0.06, radial_holes=(RadialHole(0.008, 30.0, 0.01),)),
    # one ends in the metal, one in the bore, one beyond it, one goes through both walls
    "wall": Cylinder(0.03, 0.08, 0.01, radial_holes=(RadialHole(0.006, 0.0, -0.03, 0.015),)),
    "bore": Cylinder(0.03, 0.08, 0.01, radial_holes=(RadialHole(0.006, 200.0, 0.0, 0.025),)),
    "beyond": Cylinder(0.03, 0.08, 0.01, radial_holes=(RadialHole(0.006, 90.0, 0.0, 0.05),)),
    "through": Cylinder(0.03, 0.08, 0.01, radial_holes=(RadialHole(0.025, 0.0, 0.0),)),
}


@pytest.mark.parametrize("name", DRILLED)
def test_a_drilled_body_has_the_volume_of_its_chords(name):
    # independent: chords summed over the hole's width, against the kernel's surfaces, which are off
    # the integral by 1.8e-6 for the shaft and by 4.4e-6 for the last
    with model({name: replace(DRILLED[name], at=(0.1, 0.2, 0.3), turn=(30, 20, 10))}) as cad:
        assert cad.bodies[name].volume == pytest.approx(volume(DRILLED[name]), rel=1e-5)


def test_radial_holes_open_at_their_angle_and_height_and_are_found_as_holes():
    shape = Cylinder(0.03, 0.08, 0.01, radial_holes=(RadialHole(0.006, 30.0, 0.02, 0.015),))
    with model({"hub": shape}) as cad:
        hole = min(bores(cad.bodies["hub"]), key=lambda bore: bore.radius)
    outward = np.array([np.cos(np.pi / 6), np.sin(np.pi / 6), 0.0])
    assert hole.diameter == pytest.approx(0.006)
    np.testing.assert_allclose(np.cross(hole.axis, outward), 0, atol=1e-9)
    # it ends 15 mm below the round face
    assert min((hole.ends - [0, 0, 0.02]) @ outward) == pytest.approx(0.015)
    np.testing.assert_allclose(hole.ends[:, 2], 0.02, atol=1e-9)


def test_a_blind_hole_starts_at_the_upper_face():
    with model({"cap": Cylinder(0.02, 0.03, holes=(Hole(0.006, (0.01, 0.0), 0.012),))}) as cad:
        (hole,) = bores(cad.bodies["cap"])
    assert sorted(hole.ends[:, 2]) == pytest.approx([0.003, 0.015])


@pytest.mark.parametrize(
    ("shape", "words"),
    [
        (lambda: Slab(RECTANGLE, 0.02, (Hole(0.01, (0.05, 0.05), 0.02),)), "must be less than the"),
        (lambda: Cylinder(0.02, 0.03, holes=(Hole(0.01, (0.016, 0)),)), "less than 0.015 m from"),
        (lambda: Cylinder(0.02, 0.03, 0.01, (Hole(0.004, (0.011, 0)),)), "more than 0.012 m and"),
        (lambda: Cylinder(0.02, 0.03, holes=(Hole(0.01, (0, 0), -0.01),)), "depth = -0.01 m must"),
        (
            lambda: Cylinder(0.02, 0.03, holes=(Hole(0.01, (0, 0)), Hole(0.01, (0.009, 0)))),
            "must exceed 0.01 m",
        ),
        (lambda: around(0.01, 0.0, 0.011), "lie between -0.01 m and 0.01 m"),
        (lambda: around(0.04, 0.0, 0.0), "diameter must be less than 0.04 m"),
        (lambda: around(0.01, float("nan"), 0.0), "not inside its round face"),
        (lambda: around(0.01, 0.0, 0.0, 0.0395), "must be less than 0.0393649 m; without depth"),
        (lambda: around(0.01, 0.0, 0.0, 0.01, bore=0.01), "less than 0.01 m, to end before"),
        (lambda: around(0.01, 0.0, 0.0, 0.011, bore=0.01), "more than 0.0113397 m, to open into"),
        # the far mouth of one that goes through
        (
            lambda: Cylinder(
                0.02, 0.03,
                radial_holes=(RadialHole(0.004, 0.0, 0.0), RadialHole(0.004, 180.0, 0.003)),
            ),
            "meet in its round face",
        ),
    ],
)  # fmt: skip
def test_holes_that_cannot_be_drilled_are_refused_with_the_allowed_place(shape, words):
    with pytest.raises(InvalidGeometry, match=re.escape(words)):
        shape()


def around(diameter, angle, height, depth=None, bore=0.0):
    hole = RadialHole(diameter, angle, height, depth)
    return Cylinder(0.02, 0.03, bore, radial_holes=(hole,))
