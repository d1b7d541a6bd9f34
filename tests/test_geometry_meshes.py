import signal

import numpy as np
import pytest
from skfem import Basis, FacetBasis, MeshHex, MeshTet

from geometry import Assembly, hex_mesh, smallest_quality, volume
from geometry.gmsh_session import session
from geometry.tet_mesh import tet_mesh
from signal_guard import dispositions, signals_restored

SIZES = {"seed": 6e-3, "block_seed": 15e-3, "support_seed": 25e-3}


@pytest.fixture(scope="module", params=[hex_mesh, tet_mesh], ids=["hex", "tet"])
def mesh(request):
    return request.param(Assembly(), **SIZES, contact_seed=3e-3, contact_point=(0.03, 0.0))


def area(mesh, face):
    return FacetBasis(mesh, mesh.elem(), facets=face).dx.sum()


def test_the_mesh_fills_the_assembly(mesh):
    # straight edges miss 2 % of the holes' 0.4 % of the sheets
    basis = Basis(mesh, mesh.elem(), intorder=3)
    filled = basis.dx.sum(axis=1)
    # all the same way round: other solvers refuse a mesh with some inside out
    assert np.ptp(np.sign(basis.mapping.detDF(basis.X))) == 0
    assert filled.sum() == pytest.approx(volume(Assembly()), rel=1e-4)


def test_bodies_share_no_nodes(mesh):
    nodes = [set(mesh.t[:, cells].ravel()) for cells in mesh.subdomains.values()]
    assert sum(map(len, nodes)) == mesh.p.shape[1]


def test_faces_have_their_areas(mesh):
    a = Assembly()
    holes = len(a.screw_x) * np.pi * a.hole_radius**2
    assert area(mesh, "block:+x") == pytest.approx(a.block_y * a.block_z)
    assert area(mesh, "plate:pads") == pytest.approx(4 * a.pad**2)
    assert area(mesh, "plate:bolts") == pytest.approx(4 * a.bolt_washer**2)
    assert area(mesh, "support:+z-screws") == pytest.approx(4 * a.stack_washer**2)
    strip = a.sheet_width * a.head_overlap - holes
    assert area(mesh, "sheet+y:head") == pytest.approx(strip, rel=1e-3)
    ring = np.pi * (a.washer_radius**2 - a.hole_radius**2)
    assert area(mesh, "sheet-y:foot-washer-2") == pytest.approx(ring, rel=0.03)
    shares = [area(mesh, f"sheet-y:head-share-{i}") for i in (1, 2)]
    assert sum(shares) == pytest.approx(area(mesh, "sheet-y:head"))


def test_a_contact_seed_refines_only_around_the_contact(mesh):
    facets = mesh.facets[:, mesh.boundaries["block:+x"]]
    corners = mesh.p[1:, facets]
    size = np.ptp(corners, axis=1).max(axis=0)
    point = np.array([0.03, Assembly().block_z / 2])
    distance = np.hypot(*(corners.mean(axis=1) - point[:, None]))
    assert size[distance.argmin()] < 5e-3 and size.max() > 9e-3


def test_quality_is_one_for_boxes_and_regular_tetrahedra_and_falls_with_the_shape():
    box = MeshHex.init_tensor([0, 1.0], [0, 2.0], [0, 5.0])
    assert smallest_quality(box) == pytest.approx(1.0)
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1.0]]).T
    regular = MeshTet(corners, np.array([[0], [1], [2], [3]]))
    assert smallest_quality(regular) == pytest.approx(1.0)
    # sheared by 45 degrees: the edges of a corner enclose sin(45)
    sheared = MeshHex(box.p + np.array([[1.0], [0], [0]]) * box.p[1], box.t)
    assert smallest_quality(sheared) == pytest.approx(np.sqrt(0.5))


def test_meshes_of_the_assembly_have_no_bad_corner(mesh):
    assert smallest_quality(mesh) > 0.01  # thin sheets: flat tetrahedra, good hexahedra


def test_screws_may_be_many_or_one():
    for screw_x in ((0.0,), (-0.02, 0.0, 0.02)):
        a = Assembly(screw_x=screw_x, washer_radius=0.006)
        mesh = hex_mesh(a, **SIZES)
        assert f"sheet+y:head-washer-{len(screw_x)}" in mesh.boundaries
        filled = Basis(mesh, mesh.elem(), intorder=3).dx.sum()
        assert filled == pytest.approx(volume(a), rel=1e-6)


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
