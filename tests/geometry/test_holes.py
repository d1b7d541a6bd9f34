"""Holes and what goes through two bodies, against the axes and diameters they were drawn with."""

from math import pi

import gmsh
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beadwave.geometry.cad.holes import bores, concentric
from beadwave.geometry.cad.occ import body_of, model
from beadwave.geometry.cad.shapes import Cylinder, Hole, Slab
from beadwave.geometry.cad.touching import neighbours
from beadwave.geometry.meshing.gmsh_session import session

GAP = 1e-5
TURN = (10, 20, 30)
R = Rotation.from_euler("xyz", TURN, degrees=True).as_matrix()
RECTANGLE = ((0, 0), (0.2, 0), (0.2, 0.1), (0, 0.1))


def at(*point):
    return {"at": tuple(R @ point), "turn": TURN}


def plate(thickness, z, *holes):
    drilled = tuple(Hole(diameter, place) for diameter, place in holes)
    return Slab(RECTANGLE, thickness, drilled, **at(0, 0, z))


@pytest.fixture(scope="module")
def bolted():
    shapes = {
        "cover": plate(0.008, 0, (8.5e-3, (0.02, 0.02)), (9e-3, (0.18, 0.02)), (0.02, (0.1, 0.05))),
        # the second is off the cover's by 1 mm
        "base": plate(0.02, -0.02, (6.8e-3, (0.02, 0.02)), (9e-3, (0.181, 0.02))),
        "roll": Cylinder(0.01, 0.1, **at(0.1, 0.05, 0.4)),
    }
    with model(shapes) as cad:
        return cad.bodies, neighbours(cad.bodies, GAP).touching


def test_bores_have_their_diameters_axes_and_ends(bolted):
    bodies, _ = bolted
    by_radius = sorted(bores(bodies["cover"]), key=lambda bore: bore.radius)
    assert [bore.diameter for bore in by_radius] == pytest.approx([8.5e-3, 9e-3, 0.02])
    for bore, place in zip(by_radius, [(0.02, 0.02), (0.18, 0.02), (0.1, 0.05)], strict=True):
        ends = sorted(bore.ends.tolist(), key=lambda end: end @ R[:, 2])
        expected = [R @ [*place, 0], R @ [*place, 0.008]]
        np.testing.assert_allclose(ends, expected, atol=1e-9)
    assert bores(bodies["roll"]) == ()
    assert bores(bodies["roll"], hollow=False)[0].diameter == pytest.approx(0.02)


def test_holes_about_one_axis_go_through_both_bodies_of_a_pair(bolted):
    bodies, touching = bolted
    (pair,) = touching
    (hole,) = concentric(pair, bodies, GAP)
    assert hole.bodies == ("cover", "base")
    assert hole.diameters == pytest.approx((8.5e-3, 6.8e-3))
    np.testing.assert_allclose(hole.centre, R @ [0.02, 0.02, 0], atol=1e-9)
    np.testing.assert_allclose(hole.axis, -R[:, 2], atol=1e-9)


@pytest.fixture
def cut():
    """A body of a solid with others cut out of it."""

    def of(solid, tools):
        ((_, tag),), _ = gmsh.model.occ.cut([(3, solid)], [(3, tool) for tool in tools])
        gmsh.model.occ.synchronize()
        return body_of("cut", tag)

    with session():
        yield of


def test_a_rounded_corner_is_no_hole(cut):
    # a slot's ends go half around
    occ = gmsh.model.occ
    slot = [occ.addBox(-0.02, -0.005, -1, 0.04, 0.01, 2)]
    slot += [occ.addCylinder(x, 0, -1, 0, 0, 2, 0.005) for x in (-0.02, 0.02)]
    body = cut(occ.addBox(-0.05, -0.05, 0, 0.1, 0.1, 0.01), slot)
    round_faces = [f for f in body.faces if f.axis is not None]
    assert sum(f.area for f in round_faces) == pytest.approx(2 * pi * 0.005 * 0.01)
    assert bores(body) == ()


def test_a_fork_has_two_holes_on_one_axis(cut):
    occ = gmsh.model.occ
    between = occ.addBox(-0.05, -0.01, 0.02, 0.1, 0.05, 0.01)
    drill = occ.addCylinder(0, 0.005, -1, 0, 0, 2, 0.004)
    body = cut(occ.addBox(-0.02, -0.02, 0, 0.04, 0.04, 0.05), [between, drill])
    ends = sorted(sorted(bore.ends[:, 2]) for bore in bores(body))
    np.testing.assert_allclose(ends, [[0, 0.02], [0.03, 0.05]], atol=1e-9)


def test_of_a_stepped_hole_the_step_at_the_pair_counts(cut):
    occ = gmsh.model.occ
    steps = [occ.addCylinder(0, 0, z, 0, 0, 0.1, r) for z, r in ((0.01, 0.008), (-0.01, 0.004))]
    upper = cut(occ.addBox(-0.02, -0.02, 0, 0.04, 0.04, 0.03), steps)
    drill = occ.addCylinder(0, 0, -0.1, 0, 0, 0.2, 0.003)
    lower = cut(occ.addBox(-0.02, -0.02, -0.02, 0.04, 0.04, 0.02), [drill])
    bodies = {"upper": upper._replace(name="upper"), "lower": lower._replace(name="lower")}
    (pair,) = neighbours(bodies, GAP).touching
    (hole,) = concentric(pair, bodies, GAP)
    assert hole.diameters == pytest.approx((0.008, 0.006))


def test_a_bolt_goes_through_a_saddle_and_its_bar(cut):
    """Holes that open into round faces; the bar's other end opens into the lower saddle alone. A
    seam of the upper saddle's face runs through its hole."""
    occ = gmsh.model.occ

    def drill():
        return occ.addCylinder(0, 0, -0.05, 0, 0, 0.1, 0.0045)

    def bar():
        return occ.addCylinder(0, -0.06, 0, 0, 0.12, 0, 0.02)

    cut_out = {
        "upper": cut(occ.addBox(-0.015, -0.02, 0, 0.03, 0.04, 0.03), [bar(), drill()]),
        "bar": cut(bar(), [drill()]),
        "lower": cut(occ.addBox(-0.015, -0.02, -0.03, 0.03, 0.04, 0.03), [bar(), drill()]),
    }
    bodies = {name: body._replace(name=name) for name, body in cut_out.items()}
    above, below = neighbours(bodies, GAP).touching
    for touch, z in ((above, 0.02), (below, -0.02)):
        (hole,) = concentric(touch, bodies, GAP)
        np.testing.assert_allclose(hole.centre, [0, 0, z], atol=1e-9)
        assert hole.diameters == pytest.approx((0.009, 0.009))
        lengths = dict(zip(hole.bodies, hole.lengths, strict=True))
        assert lengths.pop("bar") == pytest.approx(0.04)
        assert [*lengths.values()] == pytest.approx([0.01])
