"""Heights of chords of round faces and rims, which ties allow for."""

import numpy as np
import pytest
from skfem import MeshHex

from beadwave.fem import Connections, HeldFace, Tie, assemble, joined
from beadwave.fem.assembly.chord_height import sagging
from beadwave.fem.assembly.trace import OffFace, trace

from known_models import STEEL, at

INNER, OUTER, HEIGHT = 1e-3, 2e-3, 3e-3  # m


def sector(n, inner=INNER, outer=OUTER, turn=0.0):
    """Hexahedra of a tube, open along a seam, n to a full turn."""
    angle = np.linspace(turn, turn + 2 * np.pi, n + 1)
    grid = MeshHex.init_tensor([inner, outer], angle, [0, HEIGHT])
    r, a, z = grid.p
    outside = grid.facets_satisfying(lambda x: np.isclose(x[0], outer))
    inside = grid.facets_satisfying(lambda x: np.isclose(x[0], inner))
    mesh = MeshHex(np.array([r * np.cos(a), r * np.sin(a), z]), grid.t)
    return mesh.with_boundaries({"outer": outside, "inner": inside, "top": at(HEIGHT)})


def tetrahedra(mesh):
    cut = mesh.to_meshtet()
    middle = cut.p[:, cut.facets].mean(axis=1)
    outer = np.hypot(*middle[:2]) > np.hypot(*mesh.p[:2, mesh.facets].mean(axis=1)).max() - 1e-9
    return cut.with_boundaries({"outer": np.flatnonzero(outer), "top": at(HEIGHT)})


@pytest.mark.parametrize("cut", [lambda mesh: mesh, tetrahedra])
@pytest.mark.parametrize("n", [8, 20])
def test_a_polygon_leaves_the_height_of_its_circle_s_arcs(n, cut):
    structure = assemble({"tube": cut(sector(n))}, {"tube": STEEL})
    height = OUTER * (1 - np.cos(np.pi / n))
    for face in ("tube:top", "tube:outer"):
        assert sagging(structure, face) / height == pytest.approx(1.0, rel=1e-9)


@pytest.mark.parametrize("n", [5, 6])
def test_pentagonal_and_hexagonal_faces_have_corners_and_leave_nothing(n):
    structure = assemble({"nut": sector(n)}, {"nut": STEEL})
    assert max(sagging(structure, "nut:top"), sagging(structure, "nut:outer")) < 1e-6 * OUTER


def pressed(ring, pin):
    """A ring of so many edges around a pin of so many, askew."""
    meshes = {
        "ring": sector(ring, OUTER, 2 * OUTER),
        "pin": sector(pin, INNER, OUTER, turn=0.1),
    }
    structure = assemble(meshes, dict.fromkeys(meshes, STEEL))
    return joined(
        structure, Connections([Tie("pin:outer", "ring:inner")], held=[HeldFace("ring:top")])
    )


@pytest.mark.parametrize(("ring", "pin"), [(10, 40), (40, 10), (12, 12)])
def test_a_pin_is_tied_into_its_hole_whatever_the_meshes(ring, pin):
    assert pressed(ring, pin).K.shape[0] > 0


def test_a_pin_smaller_than_its_hole_by_more_is_refused():
    meshes = {"ring": sector(40, 1.1 * OUTER, 2 * OUTER), "pin": sector(40)}
    structure = assemble(meshes, dict.fromkeys(meshes, STEEL))
    with pytest.raises(ValueError, match="does not lie on"):
        joined(structure, Connections([Tie("pin:outer", "ring:inner")]))


@pytest.mark.parametrize(("gap", "lies"), [(0.5e-3, True), (0.3e-3, False)])
def test_a_gap_is_a_distance_whatever_the_shape_of_the_elements(gap, lies):
    mesh = MeshHex.init_tensor([0, 10e-3], [0, 0.5e-3, 1e-3], [0, HEIGHT])
    structure = assemble({"strip": mesh.with_boundaries({"top": at(HEIGHT)})}, {"strip": STEEL})
    beside = np.array([[5e-3, 1.4e-3, HEIGHT]])
    if lies:
        assert trace(structure, "strip:top", beside, gap=gap).sum() == pytest.approx(3.0)
    else:
        with pytest.raises(OffFace):
            trace(structure, "strip:top", beside, gap=gap)
