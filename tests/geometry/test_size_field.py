"""Meshes whose sizes of elements vary: what is asked of a place is what is there."""

import numpy as np
import pytest
from skfem import MeshHex, MeshTet

from beadwave.geometry.cad.joints import Words, picked
from beadwave.geometry.cad.shapes import Box
from beadwave.geometry.drawing import Sizing, drawn, meshed
from beadwave.geometry.meshing.size_field import GRADING, SizeField, rounded, smallest_at

SIDE = np.array([0.1, 0.06, 0.02])


def mesh_with(field, element=None):
    """A box with these sizes."""
    with drawn({"box": Box(SIDE, np.zeros(3))}, None, {}, 1e-5) as drawing:
        words = Words(
            bodies=("box",), under={}, groups={}, faces={}, struck=None, ties=[], joints=[]
        )
        chosen = picked(words, drawing.bodies, drawing.near.touching, 1e-5)
        sizing = Sizing(1e-5, 1.0, {"box": None}, [], 1.0, element, {"box": field}, 4.0)
        return meshed(drawing, chosen, [], {}, sizing)[0]["box"]


def lengths(mesh, at_low_x):
    """Mean lengths of edges of the cells in the lower or the upper fifth along x."""
    middle = mesh.p[0, mesh.t].mean(axis=0)
    low = middle < -0.3 * SIDE[0]
    cells = np.flatnonzero(low if at_low_x else middle > 0.3 * SIDE[0])
    edges = mesh.edges[:, np.unique(mesh.t2e[:, cells])]
    return np.linalg.norm(mesh.p[:, edges[0]] - mesh.p[:, edges[1]], axis=0).mean()


def points():
    """A grid of points over the box."""
    axes = [np.linspace(-s / 2, s / 2, 11) for s in SIDE]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def test_a_field_follows_the_box_of_its_body():
    """Twice as long along x and a third as thick along z: places keep their share of the box, sizes
    along each axis theirs, those of tetrahedra the least."""
    box = np.array([-SIDE / 2, SIDE / 2])
    onto = box * [2.0, 1.0, 1 / 3] + [1.0, 0.0, 0.0]
    p = points()
    along = SizeField(p, rounded(np.full((len(p), 3), 4e-3)), np.eye(3))
    assert along.stretched(box, box + 1e-9) is along
    moved = along.stretched(box, onto)
    share = (moved.points - onto[0]) / np.ptp(onto, axis=0)
    assert np.allclose(share, (p - box[0]) / np.ptp(box, axis=0), atol=1e-12)
    times = moved.sizes[0] / along.sizes[0]
    assert times == pytest.approx([2.0, 1.0, 1 / 3], rel=0.1)  # steps of 2^(1/4)
    of_any = along._replace(sizes=along.sizes[:, :1], axes=np.zeros((1, 3)))
    assert of_any.stretched(box, onto).sizes[0, 0] == moved.sizes[0, 2]
    # across z of an extrusion, the least of x and y
    axes = np.array([np.zeros(3), [0.0, 0.0, 1.0]])
    layered = along._replace(sizes=along.sizes[:, :2], axes=axes).stretched(box, onto)
    assert layered.sizes[0] == pytest.approx([along.sizes[0, 0], moved.sizes[0, 2]])


def test_tetrahedra_are_small_where_it_is_asked():
    p = points()
    sizes = np.where(p[:, 0] < 0, 3e-3, 9e-3)[:, None]
    mesh = mesh_with(SizeField(p, sizes, np.zeros((1, 3))), "tet")
    assert isinstance(mesh, MeshTet)
    # the mesher's edges are 1.15 times as long as asked in the mean
    assert lengths(mesh, True) == pytest.approx(1.15 * 3e-3, rel=0.15)
    assert lengths(mesh, False) == pytest.approx(1.15 * 9e-3, rel=0.2)


def test_sizes_of_tetrahedra_mesh_a_box_in_tetrahedra():
    """No layer fits sizes that vary in all directions."""
    p = points()
    field = SizeField(p, np.full((len(p), 1), 9e-3), np.zeros((1, 3)))
    assert isinstance(mesh_with(field), MeshTet)


def test_a_single_layer_of_elements_is_divided_as_its_size_asks_for():
    """Sizes at the middles of single elements: these do not grow within the elements."""
    sizes = SIDE / np.array([5.6, 2.6, 1.4])
    field = SizeField(np.zeros((1, 3)), sizes[None], np.eye(3))
    x, y, z = (np.unique(np.round(c, 9)) for c in mesh_with(field).p)
    assert (len(x) - 1, len(y) - 1, len(z) - 1) == (6, 3, 1)


def test_a_box_has_a_size_along_each_edge():
    """Small along x at its low end alone: no element is smaller along y and z."""
    p = points()
    sizes = np.column_stack(
        [np.where(p[:, 0] < -0.03, 1e-3, 1e-2), np.full(len(p), 0.02), np.full(len(p), 0.01)]
    )
    mesh = mesh_with(SizeField(p, sizes, np.eye(3)))
    assert isinstance(mesh, MeshHex)
    x, y, z = (np.unique(np.round(c, 9)) for c in mesh.p)
    assert (len(y) - 1, len(z) - 1) == (3, 2)
    assert np.diff(x)[0] == pytest.approx(1e-3, rel=0.25)
    assert np.all(np.diff(x)[1:] / np.diff(x)[:-1] < 1 + 2 * GRADING)


def test_sizes_grow_from_the_smallest_by_the_grading():
    size = smallest_at(np.array([0.0, 0.5, 1.0]), np.array([0.01, 1.0, 1.0]), np.array([0.0, 0.2]))
    assert size == pytest.approx([0.01, 0.01 + 0.2 * GRADING])


def test_rounding_does_not_make_another_size():
    sizes = np.array([1e-3, 2.3e-3, 0.7])
    assert np.array_equal(rounded(sizes * (1 + 1e-9)), rounded(sizes))
    assert rounded(sizes) == pytest.approx(sizes, rel=2**0.125 - 1)
