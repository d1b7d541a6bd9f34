"""Bodies of meshes: planes, bores and pins found on the facets, and where they touch."""

from math import pi

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from skfem import MeshHex, MeshTet

from beadwave.geometry.cad.holes import bores
from beadwave.geometry.cad.occ import model
from beadwave.geometry.cad.selectors import faces
from beadwave.geometry.cad.shapes import Cylinder, Hole, Slab
from beadwave.geometry.meshing.body_mesh import body_meshes
from beadwave.geometry.meshing.sizes import Sizes
from beadwave.geometry.own_mesh.faceted import bodies, skins
from beadwave.geometry.own_mesh.faceted_touching import meeting

GAP = 1e-5
STRAIGHT = np.eye(3)
R = Rotation.from_euler("xyz", (10, 20, 30), degrees=True).as_matrix()


def box(sides, at=(0.0, 0.0, 0.0), n=3, kind=MeshHex, turned=STRAIGHT):
    mesh = kind.init_tensor(*(np.linspace(-s / 2, s / 2, n + 1) for s in sides)).translated(at)
    return kind(np.ascontiguousarray(turned @ mesh.p), mesh.t)


def found_on_facets(meshes, gap=GAP):
    outside = skins(meshes, {})
    solids = bodies(outside, {})
    return solids, meeting(outside, solids, gap)


@pytest.mark.parametrize("kind", [MeshHex, MeshTet])
def test_a_turned_box_has_its_mass_and_six_planes(kind):
    a, b, c = 0.03, 0.02, 0.01
    solids, _ = found_on_facets({"box": box((a, b, c), (0.1, 0.2, 0.3), kind=kind, turned=R)})
    body = solids["box"]
    assert body.volume / (a * b * c) == pytest.approx(1, rel=1e-12)
    np.testing.assert_allclose(body.centroid, R @ [0.1, 0.2, 0.3], rtol=1e-12)
    own = a * b * c / 12 * np.diag([b * b + c * c, a * a + c * c, a * a + b * b])
    np.testing.assert_allclose(body.inertia, R @ own @ R.T, atol=1e-9 * own.max())
    assert [face.kind for face in body.faces] == 6 * ["plane"]
    areas = sorted(face.area for face in body.faces)
    np.testing.assert_allclose(areas, [b * c, b * c, a * c, a * c, a * b, a * b], rtol=1e-12)
    normals = np.array([face.normal for face in body.faces])
    np.testing.assert_allclose(normals.sum(axis=0), 0, atol=1e-12)
    (top,) = faces("box@{},{},{}".format(*R @ [0.1, 0.2, 0.305]), solids).tags
    np.testing.assert_allclose(body.face(top).normal, R[:, 2], atol=1e-9)


@pytest.mark.parametrize("turned", [np.eye(3), R])
def test_boxes_of_other_meshes_touch_over_their_common_area(turned):
    """Hexahedra below, tetrahedra above that hang over by 4 mm and float 5 um."""
    lower = box((0.04, 0.04, 0.01), turned=turned)
    upper = box((0.02, 0.03, 0.01), (0.014, 0, 0.01 + 5e-6), 4, MeshTet, turned)
    _, meets = found_on_facets({"lower": lower, "upper": upper})
    (touch,) = meets.near.touching
    assert touch.area / (0.016 * 0.03) == pytest.approx(1, rel=1e-9)
    assert touch.gap == pytest.approx(5e-6, rel=1e-6)
    assert not meets.near.overlaps and not meets.near.misses
    _, farther = found_on_facets({"lower": lower, "upper": upper}, gap=1e-6)
    (miss,) = farther.near.misses
    assert miss.distance == pytest.approx(5e-6, rel=1e-6)


def test_bodies_that_overlap_are_reported_with_their_volume():
    big, small = box((0.04, 0.04, 0.04), n=8), box((0.01, 0.01, 0.01), (0.02, 0, 0), n=4)
    (overlap,) = found_on_facets({"big": big, "small": small})[1].near.overlaps
    assert overlap.volume == pytest.approx(0.5e-6, rel=1e-9) and overlap.inside is None
    (inside,) = found_on_facets({"big": big, "in": box((0.01, 0.01, 0.01))})[1].near.overlaps
    assert inside.inside == "in"


@pytest.fixture(scope="module", params=["tet", None], ids=["tet", "hex"])
def pinned(request):
    """A pin in the hole of a plate with a rounded hole more, meshed apart."""
    outline = ((0, 0), (0.1, 0), (0.1, 0.05), (0, 0.05))
    plate = Slab(outline, 0.01, (Hole(0.012, (0.03, 0.02)), Hole(0.007, (0.08, 0.02))))
    shapes = {"plate": plate, "pin": Cylinder(0.006, 0.03, at=(0.03, 0.02, 0.005))}
    with model(shapes) as cad:
        return body_meshes(cad.bodies, gap=GAP, sizes=Sizes({"pin": 3e-3}), element=request.param)


def test_bores_and_pins_are_found_on_facets(pinned):
    solids, _ = found_on_facets(pinned)
    (pin,) = bores(solids["pin"], hollow=False)
    assert not bores(solids["pin"]) and not bores(solids["plate"], hollow=False)
    # nodes were moved out, so that the facets enclose the cylinder's volume
    assert pin.diameter == pytest.approx(0.012, rel=0.01)
    np.testing.assert_allclose(np.abs(pin.axis), [0, 0, 1], atol=1e-3)
    holes = sorted(bores(solids["plate"]), key=lambda bore: bore.diameter)
    np.testing.assert_allclose([b.diameter for b in holes], [0.007, 0.012], rtol=0.01)
    np.testing.assert_allclose(holes[0].ends[:, :2], [[0.08, 0.02]] * 2, atol=1e-5)
    assert len(faces("plate:hole(6.8..7.2 mm)", solids).tags) == 1


def test_a_pin_touches_its_bore_around_the_whole(pinned):
    _, meets = found_on_facets(pinned)
    (touch,) = meets.near.touching
    assert touch.area == pytest.approx(pi * 0.012 * 0.01, rel=0.05)
    assert touch.gap < 1e-4 and not meets.near.overlaps


def test_a_fillet_is_no_plane_and_the_faces_beside_it_are():
    """A quarter of a tube between two slabs, tangent to both."""
    angle = np.linspace(0, pi / 2, 9)
    inner = [[-0.02, 0.01]] + [[0.01 * np.sin(a), 0.01 * np.cos(a)] for a in angle]
    outer = [[-0.02, 0.015]] + [[0.015 * np.sin(a), 0.015 * np.cos(a)] for a in angle]
    inner, outer = [*inner, [0.01, -0.02]], [*outer, [0.015, -0.02]]
    flat = np.array(inner + outer)
    n = len(inner)
    p = np.vstack([np.column_stack([flat, np.full(2 * n, z)]) for z in (0.0, 0.01)])
    base = np.array([[i, i + 1, n + i + 1, n + i] for i in range(n - 1)]).T
    order = [0, 4, 3, 1, 7, 5, 2, 6]
    mesh = MeshHex(p.T.copy(), np.concatenate([base, base + 2 * n])[order])
    kinds = [(f.kind, f.hollow) for f in found_on_facets({"bent": mesh})[0]["bent"].faces]
    assert sorted(kinds).count(("plane", False)) == 8
    assert sorted(k for k in kinds if k[0] != "plane") == [("cylinder", False), ("cylinder", True)]
