"""Touching pairs found on the CAD, against areas, gaps and distances known exactly."""

from math import pi

import gmsh
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from skfem import FacetBasis, MeshHex

from beadwave.geometry import InvalidGeometry
from beadwave.geometry.cad.contacts import require_apart
from beadwave.geometry.cad.occ import body_of, model
from beadwave.geometry.cad.shapes import Box, Cylinder, Hole, Slab
from beadwave.geometry.cad.touching import neighbours
from beadwave.geometry.meshing.body_mesh import body_meshes
from beadwave.geometry.meshing.gmsh_session import session

from known_models import facet_error

GAP = 1e-5
TURNS = [(0, 0, 0), (10, 20, 30), (90, 0, 45)]
CORNERS = ((0.02, 0.02), (0.18, 0.02), (0.18, 0.08), (0.02, 0.08))
RECTANGLE = ((0, 0), (0.2, 0), (0.2, 0.1), (0, 0.1))


def turned(shape, turn, *at, **more):
    """A shape at a point of an assembly that is turned as a whole."""
    middle = Rotation.from_euler("xyz", turn, degrees=True).as_matrix() @ at
    return shape(**more, at=tuple(middle), turn=turn)


def neighbours_of(shapes, gap=GAP):
    with model(shapes) as cad:
        return neighbours(cad.bodies, gap), cad.bodies


@pytest.mark.parametrize("turn", TURNS)
def test_a_plate_on_four_bolts_touches_each_over_its_bore(turn):
    holes = tuple(Hole(8.5e-3, at) for at in CORNERS)
    plate = {"outline": RECTANGLE, "holes": holes}
    shapes = {
        "cover": turned(Slab, turn, 0, 0, 0, thickness=0.008, **plate),
        "base": turned(Slab, turn, 0, 0, -0.02, thickness=0.02, **plate),
    }
    for i, at in enumerate(CORNERS):
        shapes[f"bolt-{i}"] = turned(Cylinder, turn, *at, 0, radius=4.25e-3, length=0.05)
    pairs, bodies = neighbours_of(shapes)
    area = {touch.name: touch.area for touch in pairs.touching}
    around = 2 * pi * 4.25e-3
    expected = {"cover|base": 0.02 - 4 * pi * 4.25e-3**2}
    expected |= {f"cover|bolt-{i}": around * 0.008 for i in range(4)}
    expected |= {f"base|bolt-{i}": around * 0.02 for i in range(4)}
    assert area == pytest.approx(expected, rel=1e-6)
    assert pairs.misses == pairs.overlaps == () == pairs.free(bodies)


@pytest.mark.parametrize(("clearance", "touching"), [(0, 1), (8e-6, 1), (3e-5, 0)])
def test_a_pin_touches_its_bore_within_the_gap(clearance, touching):
    bored = Slab(RECTANGLE, 0.02, (Hole(0.01, (0.1, 0.05)),))
    pin = Cylinder(0.005 - clearance, 0.05, at=(0.1, 0.05, 0.01))
    pairs, _ = neighbours_of({"plate": bored, "pin": pin})
    assert len(pairs.touching) == touching and len(pairs.misses) == 1 - touching
    for touch in pairs.touching:
        assert touch.area == pytest.approx(2 * pi * 0.005 * 0.02, rel=2e-3)
        assert touch.gap == pytest.approx(clearance, abs=1e-12)
    for miss in pairs.misses:
        assert miss.distance == pytest.approx(clearance, rel=1e-6)


@pytest.mark.parametrize("turn", TURNS)
def test_faces_touch_across_a_gap_over_their_common_part(turn):
    shapes = {
        "lower": turned(Box, turn, 0, 0, 0, sides=(0.1, 0.1, 0.02)),
        "upper": turned(Box, turn, 0.04, 0.03, 0.02 + 8e-6, sides=(0.1, 0.1, 0.02)),
    }
    pairs, _ = neighbours_of(shapes)
    (touch,) = pairs.touching
    assert touch.name == "lower|upper"
    assert touch.area == pytest.approx(0.06 * 0.07, rel=1e-6)
    assert touch.gap == pytest.approx(8e-6, rel=1e-6)
    (miss,) = neighbours_of(shapes, gap=1e-6)[0].misses
    assert miss.distance == pytest.approx(8e-6, rel=1e-6)


def test_bodies_that_overlap_or_lie_inside_each_other_are_refused():
    pairs, _ = neighbours_of({"a": Box((0.1,) * 3), "b": Box((0.1,) * 3, at=(0.09, 0, 0))})
    with pytest.raises(InvalidGeometry, match=r'"a" and "b" overlap by 1e\+05 mm\^3'):
        require_apart(pairs)
    pairs, _ = neighbours_of({"a": Box((0.1,) * 3), "core": Box((0.01,) * 3)})
    with pytest.raises(InvalidGeometry, match='"core" lies inside "a"'):
        require_apart(pairs)
    bored = Slab(RECTANGLE, 0.02, (Hole(0.01, (0.1, 0.05)),))
    pairs, _ = neighbours_of({"plate": bored, "pin": Cylinder(0.005, 0.01, at=(0.1, 0.05, 0.01))})
    require_apart(pairs)


def test_near_misses_and_lines_are_reported_in_a_sentence():
    cube = Box((0.1,) * 3)
    pairs, _ = neighbours_of({"a": cube, "b": Box((0.1,) * 3, at=(0.1003, 0, 0))})
    assert '"a" and "b" miss each other by 0.3 mm' in pairs.misses[0].sentence
    pairs, _ = neighbours_of({"a": cube, "b": Box((0.1,) * 3, at=(0.1, 0.1, 0))})
    assert "along a line or at a point, near [0.05, 0.05, " in pairs.misses[0].sentence


def test_bodies_that_meet_at_an_edge_miss_each_other_by_zero():
    shapes = {"a": Box((0.1,) * 3), "b": Box((0.1,) * 3, at=(0.1, 0.1, 0))}
    pairs, bodies = neighbours_of(shapes)
    (miss,) = pairs.misses
    assert not pairs.touching and miss.distance == pytest.approx(0, abs=1e-9)
    np.testing.assert_allclose(miss.at[:2], 0.05, atol=1e-6)
    assert pairs.free(bodies) == ("a", "b")


def test_a_cylinder_on_a_plane_touches_along_a_line_only():
    shapes = {
        "floor": Box((0.2, 0.2, 0.02)),
        "roll": Cylinder(0.03, 0.1, at=(0, 0, 0.04), turn=(90, 0, 0)),
    }
    pairs, _ = neighbours_of(shapes)
    assert not pairs.touching and not pairs.overlaps
    assert pairs.misses[0].distance == pytest.approx(0, abs=1e-9)


def test_overlaps_are_reported_with_their_volume():
    cube = Box((0.1,) * 3)
    pairs, _ = neighbours_of(
        {"a": cube, "b": Box((0.1,) * 3, at=(0.09, 0, 0)), "c": Box((0.01,) * 3)}
    )
    volume = {overlap.bodies: (overlap.volume, overlap.inside) for overlap in pairs.overlaps}
    assert volume.keys() == {("a", "b"), ("a", "c")}
    assert volume["a", "b"] == (pytest.approx(0.01 * 0.1**2), None)
    assert volume["a", "c"] == (pytest.approx(1e-6), "c")


def test_bodies_far_apart_are_not_reported():
    pairs, bodies = neighbours_of({"a": Box((0.1,) * 3), "b": Box((0.1,) * 3, at=(0.2, 0, 0))})
    assert pairs == ((), (), ()) and pairs.free(bodies) == ("a", "b")


def cut(solid, *tools):
    ((_, tag),), _ = gmsh.model.occ.cut([(3, solid)], [(3, tool) for tool in tools])
    return tag


def ball_in_socket(occ):
    """A ball of 20 mm in a hollow as deep as its radius."""
    hollow = occ.addSphere(0, 0, 0, 0.02)
    return {"ball": occ.addSphere(0, 0, 0, 0.02), "b": cut(_block(occ, -0.05, 0.0), hollow)}


def plug_in_cone(occ):
    """Radii 20 and 10 mm over a height of 30 mm, seated over 20 mm."""
    plug, seat = (occ.addCone(0, 0, 0, 0, 0, 0.03, 0.02, 0.01) for _ in "ab")
    return {"plug": plug, "b": cut(_block(occ, 0, 0.02), seat)}


def half_shell(occ):
    """Half of a block around a shaft of 20 mm, over 30 mm."""
    shaft, bore = (occ.addCylinder(0, 0, 0, 0, 0, 0.2, 0.02) for _ in "ab")
    return {"shaft": shaft, "b": cut(occ.addBox(-0.04, 0, 0.05, 0.08, 0.04, 0.03), bore)}


def cube_in_a_corner(occ):
    corner = cut(occ.addBox(-0.01, 0, -0.01, 0.06, 0.03, 0.06), occ.addBox(0, -1, 0, 1, 2, 1))
    return {"cube": occ.addBox(0, 0, 0, 0.05, 0.05, 0.05), "b": corner}


def bridge_on_two_feet(occ):
    bridge = cut(_block(occ, 0, 0.03), occ.addBox(-0.02, -0.1, -0.1, 0.04, 0.2, 0.12))
    return {"bridge": bridge, "b": occ.addBox(-0.05, -0.05, -0.01, 0.1, 0.1, 0.01)}


def shaft_through_a_housing(occ):
    housing = cut(
        occ.addBox(-0.06, -0.04, 0, 0.12, 0.08, 0.06),
        occ.addBox(-0.05, -0.03, 0.01, 0.1, 0.06, 0.1),
        occ.addCylinder(-0.1, 0, 0.03, 0.2, 0, 0, 0.01),
    )
    return {"shaft": occ.addCylinder(-0.08, 0, 0.03, 0.16, 0, 0, 0.01), "b": housing}


def _block(occ, lower, upper):
    return occ.addBox(-0.03, -0.03, lower, 0.06, 0.06, upper - lower)


# common area, pairs of faces, how far the facets' area may be off it
ASSEMBLED = {
    ball_in_socket: (2 * pi * 0.02**2, 1, 0.03),
    plug_in_cone: (pi * (0.02 + 0.04 / 3) * np.hypot(0.02, 0.02 / 3), 1, 0.02),
    half_shell: (pi * 0.02 * 0.03, 1, 0.01),
    cube_in_a_corner: (2 * 0.05 * 0.03, 2, 1e-9),
    bridge_on_two_feet: (2 * 0.01 * 0.06, 2, 1e-9),
    shaft_through_a_housing: (2 * 2 * pi * 0.01 * 0.01, 2, 0.01),
}


@pytest.mark.parametrize("make", ASSEMBLED)
def test_pairs_of_any_shape_touch_over_their_common_area_and_mesh_with_it(make):
    expected, n_faces, facets = ASSEMBLED[make]
    with session():
        tags = make(gmsh.model.occ)
        gmsh.model.occ.rotate([(3, tag) for tag in tags.values()], 0, 0, 0, 1, 2, 3, 0.4)
        gmsh.model.occ.synchronize()
        bodies = {name: body_of(name, tag) for name, tag in tags.items()}
        pairs = neighbours(bodies, GAP)
        require_apart(pairs)
        (touch,) = pairs.touching
        assert touch.area == pytest.approx(expected, rel=1e-6)
        assert len(touch.contacts) == n_faces
        for name, mesh in body_meshes(bodies, pairs.touching, gap=GAP).items():
            basis = FacetBasis(mesh, mesh.elem(), facets=touch.name)
            assert basis.dx.sum() == pytest.approx(expected, rel=facets)
            assert abs(facet_error(mesh, bodies[name])) < facets
            round_about = make in (ball_in_socket, plug_in_cone)
            hollow = make is shaft_through_a_housing and name == "b"
            assert isinstance(mesh, MeshHex) != (round_about or hollow)
