"""Bodies meshed each on its own: volumes, areas of named faces, sizes, and what selectors pick."""

from math import pi

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from skfem import FacetBasis, MeshHex, MeshTet

from beadwave.geometry import InvalidGeometry, smallest_quality
from beadwave.geometry.cad.occ import model
from beadwave.geometry.cad.patches import Disc
from beadwave.geometry.cad.selectors import FaceSelection, bodies_named, faces, touches
from beadwave.geometry.cad.shapes import Box, Cylinder, Hole, Slab
from beadwave.geometry.cad.touching import neighbours
from beadwave.geometry.meshing import hexahedra
from beadwave.geometry.meshing.body_mesh import body_meshes, foreseen_nodes
from beadwave.geometry.meshing.hexahedra import JOINED
from beadwave.geometry.meshing.sizes import Fine, Sizes, default_seed, default_seeds, size_of

from known_models import facet_error

GAP = 1e-5
TURN = (10, 20, 30)
R = Rotation.from_euler("xyz", TURN, degrees=True).as_matrix()
CORNERS = ((0.02, 0.02), (0.18, 0.02), (0.18, 0.08), (0.02, 0.08))
RECTANGLE = ((0, 0), (0.2, 0), (0.2, 0.1), (0, 0.1))
BORE, WASHER = 4.25e-3, 9e-3


def at(*point):
    return {"at": tuple(R @ point), "turn": TURN}


def area(mesh, face):
    return FacetBasis(mesh, mesh.elem(), facets=face).dx.sum()


@pytest.fixture(scope="module")
def shapes():
    holes = tuple(Hole(2 * BORE, corner) for corner in CORNERS)
    bolts = {f"bolt-{i}": Cylinder(BORE, 0.05, **at(*c, 0)) for i, c in enumerate(CORNERS)}
    return bolts | {
        "cover": Slab(RECTANGLE, 0.008, holes, **at(0, 0, 0)),
        "base": Slab(RECTANGLE, 0.02, holes, **at(0, 0, -0.02)),
        "block": Box((0.03, 0.03, 0.03), **at(0.1, 0.05, 0.023 + 5e-6)),
    }


@pytest.fixture(scope="module", params=["tet", None], ids=["tet", "hex"])
def meshed(shapes, request):
    with model(shapes) as cad:
        pairs = neighbours(cad.bodies, GAP).touching
        upper = faces("cover@{:.9f},{:.9f},{:.9f}".format(*R @ [0.1, 0.01, 0.008]), cad.bodies)
        discs = {
            f"washer-{i}": Disc(upper, R @ [*corner, 0.008], R[:, 2], WASHER)
            for i, corner in enumerate(CORNERS)
        }
        named = {"upper": upper, "bores": faces("cover:hole(8..9 mm)", cad.bodies)}
        struck = Fine("block", R @ [0.1, 0.05, 0.038], 5e-4)
        order = {"sizes": Sizes(fine=[struck])} | {
            "named": named,
            "patches": discs,
            "element": request.param,
        }
        meshes = body_meshes(cad.bodies, pairs, gap=GAP, **order)
        kind = MeshTet if request.param == "tet" else MeshHex
        assert all(isinstance(mesh, kind) for mesh in meshes.values())
        return cad.bodies, meshes


@pytest.mark.slow
def test_meshes_enclose_the_volumes_of_their_bodies(meshed):
    bodies, meshes = meshed
    for name, mesh in meshes.items():
        assert facet_error(mesh, bodies[name]) == pytest.approx(0, abs=1e-9)
        assert smallest_quality(mesh) > 0.02
        signs = np.sign(mesh.mapping().detDF(mesh.elem().doflocs[:1].T))
        assert np.ptp(signs) == 0


@pytest.mark.slow
def test_pairs_have_one_area_from_either_side(meshed):
    _, meshes = meshed
    flush = 0.02 - 4 * pi * BORE**2
    assert area(meshes["cover"], "cover|base") == pytest.approx(flush, rel=1e-4)
    assert area(meshes["base"], "cover|base") == pytest.approx(flush, rel=1e-4)
    for name in ("block", "cover"):
        assert area(meshes[name], "cover|block") == pytest.approx(9e-4, rel=1e-9)
    for plate, thickness in (("cover", 0.008), ("base", 0.02)):
        for name in (plate, "bolt-2"):
            around = area(meshes[name], f"bolt-2|{plate}")
            # facets of equal volume are longer than the circle, by 0.3 % at 20 around
            assert around == pytest.approx(2 * pi * BORE * thickness, rel=5e-3)


def test_named_faces_follow_the_imprints(meshed):
    _, meshes = meshed
    cover = meshes["cover"]
    assert area(cover, "upper") == pytest.approx(0.02 - 4 * pi * BORE**2, rel=1e-4)
    assert area(cover, "bores") == pytest.approx(4 * 2 * pi * BORE * 0.008, rel=5e-3)
    for i, corner in enumerate(CORNERS):
        ring = cover.p[:, np.unique(cover.facets[:, cover.boundaries[f"washer-{i}"]])]
        away = np.linalg.norm(ring - (R @ [*corner, 0.008])[:, None], axis=0)
        assert WASHER < away.max() < 1.01 * WASHER and BORE < away.min() < 1.01 * BORE
        # of tetrahedra the rim of a bore is not even, only the bore's volume as a whole is right
        assert area(cover, f"washer-{i}") == pytest.approx(pi * (WASHER**2 - BORE**2), rel=2e-3)


def test_elements_are_fine_at_a_fine_point_and_grow_away_from_it(meshed):
    _, meshes = meshed
    mesh = meshes["block"]
    edges = np.linalg.norm(mesh.p[:, mesh.edges[0]] - mesh.p[:, mesh.edges[1]], axis=0)
    middle = mesh.p[:, mesh.edges].mean(axis=1)
    away = np.linalg.norm(middle - (R @ [0.1, 0.05, 0.038])[:, None], axis=0)
    assert 2.5e-4 < edges[away < 1e-3].mean() < 1e-3
    # smaller ones are where it ends on the cover
    assert np.quantile(edges[away > 0.025], 0.8) > 2e-3


def test_a_body_that_touches_none_is_meshed_like_any():
    with model({"tube": Cylinder(0.05, 0.4, 0.045)}) as cad:
        held = {"end": faces("tube:-z", cad.bodies)}
        mesh = body_meshes(cad.bodies, gap=GAP, named=held, sizes=Sizes({"tube": 0.01}))["tube"]
        assert facet_error(mesh, cad.bodies["tube"]) == pytest.approx(0, abs=1e-9)
        assert area(mesh, "end") == pytest.approx(pi * (0.05**2 - 0.045**2), rel=1e-3)
        np.testing.assert_allclose(mesh.p[2, mesh.facets[:, mesh.boundaries["end"]]], -0.2)


def test_a_disc_beside_its_faces_is_refused(shapes):
    with model(shapes) as cad:
        on = FaceSelection("block", tuple(f.tag for f in cad.bodies["block"].faces))
        beside = Disc(on, R @ [0.2, 0.0, 0.5], R[:, 2], 0.004)
        with pytest.raises(
            ValueError, match=r'"pad": a disc .* does not lie on the faces of block'
        ):
            body_meshes({"block": cad.bodies["block"]}, gap=GAP, patches={"pad": beside})


def hexahedra_of(shapes, **order):
    """Meshes of shapes that are all to be hexahedra, where they touch imprinted."""
    with model(shapes) as cad:
        pairs = neighbours(cad.bodies, GAP).touching
        discs = {n: make(cad.bodies) for n, make in order.pop("patches", {}).items()}
        return body_meshes(cad.bodies, pairs, gap=GAP, patches=discs, **order)


@pytest.mark.parametrize("turn", [(0, 0, 0), TURN])
def test_boxes_that_touch_on_part_of_a_top_and_of_a_side_are_grids(turn):
    def placed(sides, *point):
        turned = Rotation.from_euler("xyz", turn, degrees=True).as_matrix()
        return Box(sides, at=tuple(turned @ point), turn=turn)

    meshes = hexahedra_of(
        {
            "floor": placed((0.2, 0.1, 0.02), 0, 0, 0),
            "tower": placed((0.033, 0.041, 0.1), 0.01, 0.02, 0.06),
            "rib": placed((0.07, 0.02, 0.011), 0.013, 0.06, 0.001),
        }
    )
    for name in ("floor", "tower"):
        assert area(meshes[name], "floor|tower") == pytest.approx(0.033 * 0.041, rel=1e-9)
    for name in ("floor", "rib"):
        assert area(meshes[name], "floor|rib") == pytest.approx(0.07 * 0.011, rel=1e-9)
    for mesh in meshes.values():
        assert isinstance(mesh, MeshHex) and smallest_quality(mesh) == pytest.approx(1)


@pytest.mark.parametrize(("side", "seed", "finest"), [(50, 20, 2.5), (100, 20, 17), (50, 5, 5)])
def test_coarse_thick_bodies_are_fine_where_one_ends_on_the_other(side, seed, finest):
    """There stresses are singular; not where both end together, nor at the default seed [mm]."""
    side, seed, finest = 1e-3 * side, 1e-3 * seed, 1e-3 * finest
    floor, tower = Box((0.1, 0.1, 0.05)), Box((side, side, 0.05), at=(0, 0, 0.05))
    with model({"floor": floor, "tower": tower}) as cad:
        pairs = neighbours(cad.bodies, GAP).touching
        seeds = dict.fromkeys(cad.bodies, seed)
        meshes = body_meshes(cad.bodies, pairs, gap=GAP, sizes=Sizes(seeds))
    for mesh in meshes.values():
        for x in mesh.p:
            steps = np.diff(np.unique(x.round(9)))
            assert 0.7 * finest < steps.min() < 1.7 * finest
            assert seed / 2 < steps.max() < 1.3 * seed


def test_a_tube_in_a_ring_is_polar_and_touches_over_its_length():
    meshes = hexahedra_of(
        {
            "tube": Cylinder(0.05, 0.4, 0.045, turn=(0, 90, 0)),
            "ring": Cylinder(0.07, 0.03, 0.05, at=(0.1, 0, 0), turn=(0, 90, 0)),
        }
    )
    for mesh in meshes.values():
        assert isinstance(mesh, MeshHex) and smallest_quality(mesh) > 0.95
        assert area(mesh, "tube|ring") == pytest.approx(2 * pi * 0.05 * 0.03, rel=5e-3)


@pytest.mark.parametrize(("element", "hole"), [(None, False), (None, True), ("tet", True)])
def test_a_thin_body_is_fine_where_its_partner_ends_and_there_alone(element, hole):
    holes = (Hole(0.006, (0.08, 0.03)),) if hole else ()
    shapes = {
        "sheet": Slab(((0, 0), (0.1, 0), (0.1, 0.06), (0, 0.06)), 1e-3, holes),
        "clamp": Box((0.03, 0.06, 0.03), at=(0.015, 0.03, -0.015)),
    }
    seed = 4e-3
    with model(shapes) as cad:
        pairs = neighbours(cad.bodies, GAP).touching
        seeds = {"sheet": seed}
        mesh = body_meshes(cad.bodies, pairs, gap=GAP, sizes=Sizes(seeds), element=element)["sheet"]
    ends = mesh.p[:, mesh.edges]
    lower = np.all(ends[2] < 1e-9, axis=0)
    length = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=0)
    crossing = lower & (np.abs(ends[0] - 0.03).min(axis=0) < 1e-9)
    far = lower & (np.abs(ends[0] - 0.06).max(axis=0) < 0.005)
    # a grid is fine across the line only
    assert length[crossing & (np.ptp(ends[0], axis=0) > 5e-4)].mean() < 0.45 * seed
    assert length[far].mean() > 0.7 * seed


@pytest.mark.parametrize("element", ["hex", "tet"])
@pytest.mark.parametrize("finer", [1.0, pytest.param(0.4, marks=pytest.mark.slow)])
def test_nodes_are_foreseen_within_a_factor_of_two(element, finer):
    shapes = {
        "block": Box((0.06, 0.05, 0.04)),
        "plate": Slab(RECTANGLE, 0.008, tuple(Hole(2 * BORE, corner) for corner in CORNERS)),
        "pin": Cylinder(0.01, 0.16),
        "tube": Cylinder(0.05, 0.2, 0.04),
    }
    with model(shapes) as cad:
        seeds = {name: finer * size_of(body).seed for name, body in cad.bodies.items()}
        meshes = body_meshes(cad.bodies, gap=GAP, sizes=Sizes(seeds), element=element)
        for name, mesh in meshes.items():
            size = size_of(cad.bodies[name], seeds[name])
            foreseen = foreseen_nodes(cad.bodies[name], size, element)
            assert 0.5 < foreseen / (mesh.nvertices + mesh.nedges) < 2


def test_a_seed_that_no_machine_solves_is_refused_before_meshing():
    with (
        model({"block": Box((0.1, 0.1, 0.1))}) as cad,
        pytest.raises(InvalidGeometry, match=r"seed = 0\.0002 m .* take a seed above 0\.00092 m"),
    ):
        body_meshes(cad.bodies, gap=GAP, sizes=Sizes({"block": 2e-4}))


def test_a_disc_on_a_side_that_cannot_be_extruded_makes_tetrahedra_of_that_body_only():
    outline = ((0, 0), (0.1, 0), (0.1, 0.05), (0.05, 0.08), (0, 0.05))
    shapes = {
        "pad": Slab(outline, 0.03),
        "leg": Box((0.02, 0.02, 0.1), at=(0.05, 0.03, -0.05)),
    }
    on_side = {"spot": lambda bodies: Disc(faces("pad:-y", bodies), SPOT, np.eye(3)[1], 0.008)}
    meshes = hexahedra_of(shapes, patches=on_side)
    assert isinstance(meshes["pad"], MeshTet) and isinstance(meshes["leg"], MeshHex)
    assert area(meshes["pad"], "spot") == pytest.approx(pi * 0.008**2, rel=1e-9)
    for mesh in meshes.values():
        assert area(mesh, "pad|leg") == pytest.approx(4e-4, rel=1e-9)


def test_a_disc_that_its_face_cuts_off_keeps_its_circle():
    place, radius = np.array([0.00625, 0.05, 0.01]), 0.0065
    discs = {"cut": lambda bodies: Disc(faces("pad:+z", bodies), place, np.eye(3)[2], radius)}
    mesh = hexahedra_of({"pad": Slab(RECTANGLE, 0.01)}, patches=discs)["pad"]
    nodes = mesh.p[:, np.unique(mesh.facets[:, mesh.boundaries["cut"]])]
    assert np.linalg.norm(nodes - place[:, None], axis=0).max() == pytest.approx(radius, rel=1e-9)
    off = place[0] / radius
    segment = radius**2 * (np.arccos(off) - off * np.sqrt(1 - off**2))
    assert area(mesh, "cut") == pytest.approx(pi * radius**2 - segment, rel=0.02)


def off_the_sides(mesh, turn, sides):
    """Distance [m] of outer facets of a box around the origin from its sides."""
    p = np.abs(turn.T @ mesh.p) - np.array(sides)[:, None] / 2
    return np.abs(p[:, mesh.facets[:, mesh.boundary_facets()]]).max(axis=1).min(axis=0).max()


@pytest.mark.parametrize("element", ["tet", None], ids=["tet", "hex"])
@pytest.mark.parametrize(
    ("beyond", "aside"),
    [
        (-20e-6, 0), (-4e-6, 0), (0, 0), (8e-8, 0), (5e-6, 0), (25e-6, 0),  # of an edge [m]
        (-20e-6, 4e-3), (4e-6, 4e-3),  # and of the disc beside it
        (2e-6, 3e-6),  # off the middle: of both edges
    ],
)  # fmt: skip
def test_a_washer_up_to_the_edge_of_its_face_leaves_the_sides_plane(element, beyond, aside):
    """The face is 8 mm wide. Straight edges around a circle leave up to 1.6 % of its area, which
    nodes beside an edge cannot take up."""
    sides, radius = (0.008, 0.03, 0.02), 4e-3 + beyond
    middle = {"one": [0.0, aside, 0.01]} | ({"other": [0, -aside, 0.01]} if aside > 1e-3 else {})
    if aside and aside < 1e-3:
        middle = {"one": [aside, 0.0, 0.01]}
    with model({"bar": Box(sides, turn=TURN)}) as cad:
        on = faces("bar@{:.9f},{:.9f},{:.9f}".format(*R @ [0.0, 0.013, 0.01]), cad.bodies)
        discs = {n: Disc(on, R @ centre, R[:, 2], radius) for n, centre in middle.items()}
        seeds = Sizes({"bar": 4e-3})
        mesh = body_meshes(cad.bodies, gap=GAP, sizes=seeds, patches=discs, element=element)["bar"]
        assert facet_error(mesh, cad.bodies["bar"]) == pytest.approx(0, abs=1e-9)
    assert off_the_sides(mesh, R, sides) < 1e-12
    assert smallest_quality(mesh) > 1e-4
    for name in discs:
        assert area(mesh, name) == pytest.approx(pi * radius**2, rel=2e-3 if not aside else 0.017)


@pytest.mark.parametrize("radius", [3.88e-3, 3.93e-3, 3.97e-3])
def test_elements_between_a_washer_and_an_edge_fill_the_body_once(radius):
    """A rim moved past the edge, and quadrilaterals folded in the gap, turn elements over."""
    with model({"bar": Box((0.008, 0.03, 0.02))}) as cad:
        on = faces("bar:+z", cad.bodies)
        disc = {"washer": Disc(on, np.array([0.0, 0.0, 0.01]), np.eye(3)[2], radius)}
        seeds = Sizes({"bar": 4e-3})
        mesh = body_meshes(cad.bodies, gap=GAP, sizes=seeds, patches=disc)["bar"]
        assert facet_error(mesh, cad.bodies["bar"]) == pytest.approx(0, abs=1e-9)
    corners = mesh.mapping().detDF(mesh.elem().doflocs[: mesh.t.shape[0]].T)
    assert np.ptp(np.sign(corners)) == 0


def test_a_body_that_cannot_be_meshed_is_named():
    box = {"block": Box((0.1, 0.1, 0.1))}
    with model(box) as cad:
        gone = cad.bodies["block"]._replace(tag=99)
        with pytest.raises(ValueError, match='"block" could not be meshed with elements of 0'):
            body_meshes({"block": gone}, gap=GAP, element="tet")


def test_a_side_touched_over_a_trapezium_makes_tetrahedra():
    wide = ((0, 0), (0.1, 0), (0.1, 0.05), (0.05, 0.08), (0, 0.05))
    slanted = ((0.02, 0), (0.08, 0), (0.06, 0.02), (0.04, 0.02))
    meshes = hexahedra_of(
        {
            "pad": Slab(wide, 0.03),
            "rib": Slab(slanted, 0.02, turn=(90, 0, 0)),
        }
    )
    assert isinstance(meshes["pad"], MeshTet) and isinstance(meshes["rib"], MeshHex)
    for mesh in meshes.values():
        assert area(mesh, "pad|rib") == pytest.approx(0.04 * 0.02, rel=1e-9)


SPOT = np.array([0.04, 0.0, 0.015])
L_SHAPE = ((0, 0), (0.08, 0), (0.08, 0.02), (0.03, 0.02), (0.03, 0.1), (0, 0.1))
PICKED = {
    "ell:+y": [0.015, 0.1, 0.025],  # not the lower step, which looks along +y as well
    "ell:-z": [0.025, 0.04, 0.0],
    "ell@0.06,0.03,0.02": [0.055, 0.02, 0.025],
    "ell@0.03,0.05,0.02": [0.03, 0.06, 0.025],
}


@pytest.mark.parametrize("selector", PICKED)
def test_selectors_pick_the_face_that_is_meant(selector):
    with model({"ell": Slab(L_SHAPE, 0.05)}) as cad:
        picked = faces(selector, cad.bodies)
        (tag,) = picked.tags
        np.testing.assert_allclose(cad.bodies["ell"].face(tag).centre, PICKED[selector], atol=1e-9)


REFUSED = {
    "elle:+x": 'no body is called "elle", perhaps "ell"; there are "ell", "tube"',
    "ell:+u": 'picks no face; write "ell:\\+x"',
    "tube:+x": "no planar face that looks along \\+x; tube has a cylinder of diameter",
    "ell:hole": "ell has no holes",
    "tube:hole(6..7 mm)": "tube has holes of diameter 20 mm",
    "ell@0.08,0.02,0.02": "is as near to a plane .* as to a plane",
    "ell@0,x,0": 'holds "x" where a finite number belongs',
    "*:+x": 'fits "ell", "tube"; it must pick faces of one body',
    "#struck": "finds no face of this name",
}


@pytest.mark.parametrize("selector", REFUSED)
def test_selectors_that_pick_nothing_or_cannot_choose_say_what_there_is(selector):
    shapes = {
        "ell": Slab(L_SHAPE, 0.05),
        "tube": Cylinder(0.02, 0.1, 0.01, at=(0.3, 0, 0)),
    }
    with (
        model(shapes) as cad,
        pytest.raises(InvalidGeometry, match=REFUSED[selector]),
    ):
        faces(selector, cad.bodies)


def test_patterns_name_bodies_and_pairs(shapes):
    with model(shapes) as cad:
        pairs = neighbours(cad.bodies, GAP).touching
        bodies = cad.bodies
        assert len(bodies_named("bolt-*", bodies)) == 4
        assert len(touches("bolt-*|cover", bodies, pairs)) == 4
        assert [t.name for t in touches("block|cover", bodies, pairs)] == ["cover|block"]
        with pytest.raises(InvalidGeometry, match='do not touch; touching pairs are "bolt-0'):
            touches("block|base", bodies, pairs)


def test_small_bodies_have_elements_that_count_in_the_assembly():
    shapes = {"large": Box((0.3, 0.2, 0.1)), "small": Box((0.02, 0.02, 0.02), at=(0.0, 0.0, 0.06))}
    with model(shapes) as cad:
        seeds = default_seeds(cad.bodies)
        alone = {name: default_seed(body) for name, body in cad.bodies.items()}
        assert seeds["large"] == alone["large"]
        diagonal = np.linalg.norm([0.3, 0.2, 0.12])
        assert abs(seeds["small"] / (diagonal / 60) - 1) < 1e-6 and seeds["small"] > alone["small"]


@pytest.mark.parametrize("corner", [12, 16, 17])
def test_a_sharp_corner_of_the_outline_makes_no_finer_mesh(corner):
    """All algorithms have it, and rounding chose one that has half the size."""
    wide = 0.08 * np.tan(np.radians(corner))
    triangle = Slab(((0.0, 0.0), (0.08, 0.0), (0.08, wide)), 0.01)
    assert elements(triangle, 0.005) < 1.5 * elements(triangle, 0.005, JOINED[:1])


def elements(shape, seed, algorithms=JOINED):
    """Number of elements of an extrusion by the first fair one of the mesher's algorithms."""
    with pytest.MonkeyPatch.context() as patch, model({"body": shape}) as cad:
        patch.setattr(hexahedra, "JOINED", algorithms)
        meshes = body_meshes(cad.bodies, gap=GAP, sizes=Sizes({"body": seed}), element="hex")
    return meshes["body"].nelements
