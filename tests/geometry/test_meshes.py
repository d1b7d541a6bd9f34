import signal

import numpy as np
import pytest
from skfem import Basis, MeshHex, MeshTet

from beadwave.geometry import InvalidGeometry, smallest_quality
from beadwave.geometry.cad.occ import model
from beadwave.geometry.cad.shapes import Box, Cylinder, Hole, RadialHole, Slab, volume
from beadwave.geometry.meshing.body_mesh import body_meshes
from beadwave.geometry.meshing.gmsh_session import session
from beadwave.geometry.meshing.grid_lines import Stop, refined
from beadwave.geometry.meshing.lined_blocks import HoleRing, Lines, lined_mesh
from beadwave.geometry.meshing.node_estimate import n_nodes, n_nodes_of_tetrahedra
from beadwave.geometry.meshing.sizes import Fine, Sizes
from beadwave.geometry.own_mesh.mesh_bodies import own_mesh

from signal_guard import dispositions, signals_restored

PLATE = Slab(
    ((-0.03, 0.0), (0.03, 0.0), (0.03, 0.02), (-0.03, 0.02)), 1e-3, (Hole(6e-3, (0.01, 0.011)),),
    at=(0.1, 0.2, 0.3), turn=(90.0, 30.0, 0.0),
)  # fmt: skip
RING = HoleRing(8e-3, (0.0, 0.002), (0.03, 0.02))
PLATE_LINES = Lines(x=[Stop(0.0)], y=[Stop(0.002)], rings=[RING])
# the same, off all sides of the plate
INSIDE_LINES = Lines(
    x=[Stop(0.0), Stop(0.025)],
    y=[Stop(0.002), Stop(0.0195)],
    rings=[HoleRing(8e-3, (0.0, 0.002), (0.025, 0.0195))],
)


@pytest.mark.parametrize("lines", [PLATE_LINES, INSIDE_LINES])
@pytest.mark.parametrize("seed", [2e-3, 5e-3, 9e-3])
def test_a_plate_with_rings_has_the_volume_of_the_drawn_one(seed, lines):
    """Polygons around holes have the area of their circles; all corners the same way round. With
    one hole the body is a solid torus, of Euler's characteristic 0 where cells share their nodes.
    """
    mesh = lined_mesh(PLATE, lines, seed)
    basis = Basis(mesh, mesh.elem(), intorder=3)
    assert np.ptp(np.sign(basis.mapping.detDF(basis.X))) == 0
    assert basis.dx.sum() == pytest.approx(volume(PLATE), rel=1e-12)
    assert smallest_quality(mesh) > 0.1
    assert mesh.nvertices - mesh.nedges + mesh.nfacets - mesh.nelements == 0


def test_a_ring_ends_on_a_circle_of_the_washers_area():
    """Turned and moved as its drawing: found on the facets, whose middles lie under the washer."""
    own = own_mesh({"plate": lined_mesh(PLATE, PLATE_LINES, 3e-3)}, 1e-5)
    face = next(f for f in own.bodies["plate"].faces if f.kind == "cylinder")
    off = np.linalg.norm(own.skins["plate"].middle - face.on_axis, axis=1)
    under = own.skins["plate"].area[off < 8e-3].sum() - face.area
    assert under == pytest.approx(2 * np.pi * (8e-3**2 - 3e-3**2), rel=1e-6)


def test_prescribed_lines_are_there_and_elements_grow_from_them():
    box = Box((0.1, 0.06, 0.04), at=(1.0, 2.0, 3.0))
    lines = Lines(x=[refined(0.02, 1e-3, 1.6), Stop(-0.013)], z=[Stop(0.011)])
    mesh = lined_mesh(box, lines, 0.02)
    x, _, z = (np.unique(np.round(row, 12)) for row in mesh.p)
    assert {1.02, 0.987, 0.95, 1.05} <= set(x) and {3.011, 2.98, 3.02} <= set(z)
    size = np.diff(x[x >= 1.02 - 1e-12])
    assert size[0] == pytest.approx(1e-3, rel=0.2)
    # elements are stretched to a whole number
    assert np.all(np.abs(size[1:-1] / size[:-2] - 1.6) < 0.3) and size.max() < 0.022


def test_nodes_between_lines_are_counted_before_they_are_made():
    lines = Lines(x=[refined(0.02, 1e-3)], y=[Stop(0.01)])
    mesh = lined_mesh(Box((0.1, 0.06, 0.04)), lines, 0.013)
    assert n_nodes(Box((0.1, 0.06, 0.04)), lines, 0.013) == mesh.nvertices + mesh.nedges


CROSS_HOLES = (RadialHole(5e-3, 0.0, -8e-3), RadialHole(5e-3, 90.0, 8e-3, depth=0.01))
RECTANGLE = ((0.0, 0.0), (0.08, 0.0), (0.08, 0.06), (0.0, 0.06))


@pytest.mark.parametrize(
    ("shape", "seed", "fine"),
    [
        (Box((0.1, 0.06, 0.04)), 0.012, 0.0015),
        (Slab(RECTANGLE, 0.012, (Hole(8e-3, (0.03, 0.02)),)), 0.006, None),
        (Slab(RECTANGLE, 0.03, (Hole(8e-3, (0.03, 0.02), depth=0.015),)), 0.006, None),
        (Slab(RECTANGLE, 0.003, (Hole(8e-3, (0.03, 0.02)), Hole(6e-3, (0.06, 0.04)))), 0.01, None),
        (Cylinder(0.012, 0.05, 0.006), 0.006, None),
        (Cylinder(0.02, 0.04, radial_holes=CROSS_HOLES), 0.006, None),
    ],
    ids=["struck box", "hole", "blind hole", "thin plate", "tube", "cross holes"],
)
def test_nodes_of_tetrahedra_are_foreseen_within_a_third(shape, seed, fine):
    with model({"body": shape}, None) as cad:
        top = np.array([0.0, 0.0, cad.bodies["body"].upper[2]])
        at = () if fine is None else (Fine("body", top, fine),)
        sizes = Sizes({"body": seed}, at)
        (mesh,) = body_meshes(cad.bodies, gap=1e-5, element="tet", sizes=sizes).values()
    n = mesh.nvertices + mesh.nedges
    assert 0.75 * n < n_nodes_of_tetrahedra(shape, seed, fine) < 4 / 3 * n


@pytest.mark.parametrize(
    ("shape", "lines", "sentence"),
    [
        (PLATE, PLATE_LINES._replace(rings=[]), "0 rings for 1 holes"),
        (PLATE, PLATE_LINES._replace(y=[]), "must end on lines"),
        (PLATE, PLATE_LINES._replace(rings=[RING._replace(washer=0.02)]), "hold a washer"),
        # 7 and 9 mm from the hole's middle to the ends of a ring with a washer of 8 mm
        (
            PLATE,
            Lines([Stop(0.0)], [Stop(0.004)], rings=[RING._replace(lower=(0.0, 0.004))]),
            "hold a washer",
        ),
        (
            PLATE,
            PLATE_LINES._replace(
                y=[Stop(0.002), Stop(0.018)], rings=[RING._replace(upper=(0.03, 0.018))]
            ),
            "hold a washer",
        ),
        (Slab(((0, 0), (0.1, 0), (0, 0.1)), 0.01), Lines(), "rectangular outline"),
        (Slab(((0, 0), (1, 0), (0.9, 1), (0, 1)), 0.01), Lines(), "rectangular outline"),
    ],
)
def test_lines_that_make_no_mesh_are_refused(shape, lines, sentence):
    with pytest.raises(InvalidGeometry, match=sentence):
        lined_mesh(shape, lines, 5e-3)


def test_quality_is_one_for_boxes_and_regular_tetrahedra_and_falls_with_the_shape():
    box = MeshHex.init_tensor([0, 1.0], [0, 2.0], [0, 5.0])
    assert smallest_quality(box) == pytest.approx(1.0)
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1.0]]).T
    regular = MeshTet(corners, np.array([[0], [1], [2], [3]]))
    assert smallest_quality(regular) == pytest.approx(1.0)
    # sheared by 45 degrees: the edges of a corner enclose sin(45)
    sheared = MeshHex(box.p + np.array([[1.0], [0], [0]]) * box.p[1], box.t)
    assert smallest_quality(sheared) == pytest.approx(np.sqrt(0.5))


def test_quality_of_tetrahedra_is_that_of_their_shape_whichever_way_they_are_numbered():
    # scikit-fem's refinement reverses 17 of these 40; renumbered all are right-handed
    mesh = MeshTet().refined(1)
    reversed_ = mesh.orientation() < 0
    assert 0 < reversed_.sum() < mesh.nelements
    t = mesh.t.copy()
    t[:2, reversed_] = t[1::-1, reversed_]
    assert smallest_quality(mesh) == pytest.approx(smallest_quality(MeshTet(mesh.p, t)))
    # the worst corner by its edges, |det| / (|a| |b| |c|), one tetrahedron after another
    worst = min(
        abs(np.linalg.det(edges)) / np.prod(np.linalg.norm(edges, axis=1))
        for corners in mesh.p.T[mesh.t.T]
        for i in range(4)
        for edges in [np.delete(corners, i, axis=0) - corners[i]]
    )
    assert smallest_quality(mesh) == pytest.approx(np.sqrt(2) * worst)


@pytest.mark.parametrize(
    ("handler", "kernel"), [(lambda *_: None, "caught"), (signal.SIG_IGN, "ignored")]
)
def test_signals_are_handled_after_gmsh_as_before(handler, kernel):
    """gmsh sets some to their defaults, unknown to Python: a run would die amid a file."""
    numbers = (signal.SIGHUP, signal.SIGINT, signal.SIGQUIT, signal.SIGTERM)
    with signals_restored():
        for number in numbers:
            signal.signal(number, handler)
        with session():
            within = dispositions()
        after = dispositions()
    assert {within.kernel[number] for number in numbers} == {kernel}
    assert {after.kernel[number] for number in numbers} == {kernel}
