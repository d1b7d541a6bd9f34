"""Surfaces of fewer nodes keep their form."""

import numpy as np
import pytest
from skfem import MeshHex, MeshTet

from beadwave.geometry import thinned

LONG, THICK = 0.1, 0.002  # m, of a square plate


def plate(kind):
    """Outside of a thin plate: nodes, faces."""
    across = np.linspace(0, LONG, 61)
    mesh = kind.init_tensor(across, across, np.array([0.0, THICK]))
    faces = mesh.facets[:, mesh.boundary_facets()].T
    nodes, faces = np.unique(faces, return_inverse=True)
    return mesh.p.T[nodes], faces.reshape(-1, mesh.facets.shape[0])


def area(points, faces):
    """Of faces as the page draws them: of a quadrilateral two triangles."""
    a, b, c, d = (points[faces[:, i]] for i in (0, 1, -2 if faces.shape[1] == 4 else 2, -1))
    halves = (np.cross(b - a, c - a), np.cross(c - a, d - a))
    return sum(np.linalg.norm(half, axis=1).sum() / 2 for half in halves)


@pytest.mark.parametrize("kind", [MeshHex, MeshTet])
def test_a_thin_plate_keeps_both_sides_its_corners_and_its_area(kind):
    points, faces = plate(kind)
    thin = thinned(points, faces, 600)
    assert 200 < len(thin.nodes) <= 600
    nodes = points[thin.nodes]
    assert area(nodes, thin.faces) == pytest.approx(area(points, faces), rel=0.02)
    corners = np.array([[x, y, z] for x in (0, LONG) for y in (0, LONG) for z in (0, THICK)])
    away = np.linalg.norm(nodes[:, None] - corners, axis=2).min(axis=0)
    assert away.max() < 1e-12


def test_faces_have_three_corners_and_stand_once():
    points, faces = plate(MeshHex)
    thin = thinned(points, faces, 600).faces
    assert min(len(set(face)) for face in thin.tolist()) >= 3
    assert len({tuple(sorted(face)) for face in thin.tolist()}) == len(thin)
    again = np.array([len(set(face)) == 3 for face in thin.tolist()])
    assert (thin[again, 2] == thin[again, 3]).all()


def test_bodies_that_touch_stay_apart():
    points, faces = plate(MeshHex)
    group = np.repeat([0, 1], len(points))
    twice = np.concatenate([points, points]), np.concatenate([faces, faces + len(points)])
    thin = thinned(*twice, 1200)
    assert all(len(set(group[thin.nodes[face]])) == 1 for face in thin.faces)
