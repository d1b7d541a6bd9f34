"""Faces that a STEP file has as B-splines: planes, cylinders, cones, spheres and tori are such."""

import json
import re
from collections import Counter
from math import pi
from pathlib import Path

import gmsh
import numpy as np
import pytest
from scipy.interpolate import BSpline

from beadwave.geometry.cad.holes import bores
from beadwave.geometry.cad.occ import model
from beadwave.geometry.cad.step_file import text_of
from beadwave.geometry.cad.step_splines import ALIKE, Spline, surface_of
from beadwave.geometry.meshing.gmsh_session import session, silent

from command_line import beadwave


def solid(kind):
    """Draws a solid in the kernel: in mm, as files have it."""
    occ = gmsh.model.occ
    if kind == "plate":
        plate = occ.addBox(0, 0, 0, 80, 40, 8)
        tools = [(3, occ.addCylinder(x, 20, -1, 0, 0, 10, 4.5)) for x in (20, 60)]
        occ.cut([(3, plate)], tools)
    elif kind == "turned":
        occ.addBox(0, 0, 0, 80, 40, 8)
        occ.rotate([(3, 1)], 0, 0, 0, 0.3, 0.5, 0.8, 0.7)
        tool = occ.addCylinder(10, 20, 30, 1, -1, -8, 3)
        occ.cut([(3, 1)], [(3, tool)])
    elif kind == "pin":
        occ.addCylinder(0, 0, 0, 0, 30, 0, 5)
    elif kind == "cone":
        occ.addCone(0, 0, 0, 0, 0, 20, 10, 4)
    elif kind == "tip":
        occ.addCone(5, 5, 0, 3, 0, 20, 10, 0)
    elif kind == "ball":
        occ.addSphere(1, 2, 3, 10)
    elif kind == "ring":
        occ.addTorus(0, 0, 0, 20, 4)
    elif kind == "half":  # a cylinder cut along its axis, and across at an angle
        occ.addCylinder(0, 0, 0, 0, 0, 40, 8)
        box = occ.addBox(-20, 0, -10, 40, 20, 60)
        occ.cut([(3, 1)], [(3, box)])
        wedge = occ.addBox(-30, -30, 30, 60, 60, 60)
        occ.rotate([(3, wedge)], 0, 0, 30, 1, 0, 0, 0.3)
        occ.cut([(3, 1)], [(3, wedge)])
    elif kind == "fillet":
        occ.addBox(0, 0, 0, 30, 20, 10)
        occ.synchronize()
        occ.fillet([1], [1], [2.0])
    elif kind == "lens":  # a ball cut off above and below
        occ.addSphere(0, 0, 0, 10)
        box = occ.addBox(-10, -10, -3, 20, 20, 9)
        occ.intersect([(3, 1)], [(3, box)])


def written(path, kind, *, splines):
    with session(), silent():
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
        solid(kind)
        gmsh.model.occ.synchronize()
        if splines:
            gmsh.model.occ.convertToNURBS(gmsh.model.occ.getEntities(3))
            gmsh.model.occ.synchronize()
        gmsh.write(str(path))
    return path


def described(path):
    """Kinds of faces with hollowness, radii, areas; holes; volume."""
    with model({}, path) as cad:
        (body,) = cad.bodies.values()
        kinds = Counter((face.kind, face.hollow) for face in body.faces)
        radii = sorted(face.radius for face in body.faces if face.radius)
        areas = sorted(face.area for face in body.faces)
        holes = sorted(bore.diameter for bore in bores(body))
    return kinds, np.array(radii), np.array(areas), holes, body.volume


KINDS = ["plate", "turned", "pin", "cone", "tip", "ball", "ring", "half", "fillet", "lens"]


@pytest.mark.parametrize("kind", KINDS)
def test_faces_written_as_splines_are_what_they_were(tmp_path, kind):
    given = described(written(tmp_path / "analytic.step", kind, splines=False))
    path = written(tmp_path / "splines.step", kind, splines=True)
    assert not re.search(r"=\s*(PLANE|\w+ICAL_SURFACE|TOROIDAL_SURFACE|CIRCLE)\b", text_of(path))
    read = described(path)
    assert read[0] == given[0]
    np.testing.assert_allclose(read[1], given[1], rtol=1e-9)
    # an ellipse between plane and cylinder stays a spline, up to which areas are integrated to 2e-4
    allowed = 5e-4 if kind == "half" else 1e-6
    np.testing.assert_allclose(read[2], given[2], rtol=allowed)
    assert read[3] == pytest.approx(given[3], rel=1e-9)
    assert read[4] == pytest.approx(given[4], rel=allowed)


@pytest.mark.usefixtures("files_read_here")
def test_a_scene_to_start_from_is_that_of_the_analytic_part(tmp_path, capsys):
    """Two holes of 9 mm in a plate, faces called body:+z and the like, meshes of one size."""
    reports = []
    for name, splines in (("analytic", False), ("nurbs", True)):
        path = written(tmp_path / f"{name}.step", "plate", splines=splines)
        scene = tmp_path / f"{name}.toml"
        assert beadwave("look", path, "--scene", scene) == 0
        capsys.readouterr()
        assert beadwave("look", path, "--json") == 0
        report = json.loads(capsys.readouterr().out)
        text = Path(scene).read_text().replace(name, "part")
        reports.append((report["holes"], report["dofs"], text))
    (holes, dofs, text), (other_holes, other_dofs, other_text) = reports
    assert (other_holes, other_text) == (holes, text)
    assert other_dofs == pytest.approx(dofs, rel=0.1)  # hexahedra both, from other first points
    assert [(h["number"], h["diameter_m"]) for h in holes] == [(2, pytest.approx(9e-3))]
    assert 'on = "body:+z"' in text and 'held = ["body:-z"]' in text


def bent(sag, *, points=6):
    """A square of 100 mm as a spline whose middle stands out by `sag` [mm]."""
    x = np.linspace(0, 100, points)
    X, Y = np.meshgrid(x, x, indexing="ij")
    Z = sag * 16 * (X * (100 - X) * Y * (100 - Y)) / 100**4
    control = np.stack([X, Y, Z, np.ones_like(X)], axis=-1)
    knots = np.concatenate([[0] * 4, np.linspace(0, 1, points - 2)[1:-1], [1] * 4])
    return Spline((3, 3), (knots, knots), control)


def test_a_surface_counts_as_a_plane_within_the_stated_share_of_its_size():
    """ALIKE of the diagonal: 2.8 um of 100 mm by 100 mm."""
    allowed = ALIKE * 100 * np.sqrt(2)
    for share, kind in ((0.5, "PLANE"), (0.0, "PLANE"), (10.0, None)):
        known = surface_of(bent(share * allowed))
        assert (known.kind if known else None) == kind


def test_what_is_free_form_stays_so():
    rng = np.random.default_rng(5)
    spline = bent(8.0)
    for _ in range(5):
        bumps = spline.control.copy()
        bumps[..., 2] += rng.normal(size=bumps.shape[:2])
        assert surface_of(spline._replace(control=bumps)) is None
    # a cylinder of elliptic section
    arc = bent(0.0).control.copy()
    angle = np.linspace(0, 1.2, 6)[:, None] * np.ones(6)
    arc[..., 0], arc[..., 2] = 50 * np.cos(angle), 30 * np.sin(angle)
    assert surface_of(spline._replace(control=arc)) is None


def test_a_circle_of_many_cubics_is_a_cylinder_within_its_tolerance():
    """Splines without weights, as some systems write them: 24 points around are off by 1e-6."""
    from scipy.interpolate import make_interp_spline

    angle = np.linspace(0, pi, 25)
    curve = make_interp_spline(angle, np.column_stack([np.cos(angle), np.sin(angle)]), k=3)
    section = 10 * curve.c
    control = np.stack([np.column_stack([section, np.full(len(section), z)]) for z in (0.0, 30.0)])
    control = np.concatenate([control, np.ones((*control.shape[:2], 1))], axis=-1)
    line = np.array([0.0, 0.0, 1.0, 1.0])
    known = surface_of(Spline((1, 3), (line, curve.t), control))
    assert known.kind == "CYLINDRICAL_SURFACE"
    assert known.numbers[0] == pytest.approx(10, rel=1e-5)
    assert abs(known.z[2]) == pytest.approx(1, abs=1e-9)
    assert isinstance(curve, BSpline)
