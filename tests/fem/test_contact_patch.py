"""The contact patch: moments of its pressure, what it reads of a rigid motion, its nodes."""

import numpy as np
import pytest
from skfem import MeshHex

from beadwave.fem import Connections, HeldFace, assemble, contact_patch, joined
from beadwave.fem.assembly.joints import rigid_motion
from beadwave.fem.contact.contact_patch import disc_quadrature, node_patch

from known_models import STEEL, at

# mean of r^2 and r^4 under p ~ sqrt(1 - r^2), and under a plain mean
MOMENTS = {"hertz": (2 / 5, 8 / 35), "area": (1 / 2, 1 / 3)}


@pytest.fixture(scope="module")
def model():
    line = np.linspace(-0.02, 0.02, 7)
    mesh = MeshHex.init_tensor(line, line, np.linspace(0, 0.03, 4))
    faces = {"base": at(0.0), "top": at(0.03)}
    structure = assemble({"block": mesh.with_boundaries(faces)}, {"block": STEEL})
    return joined(structure, Connections(held=[HeldFace("block:base")]))


@pytest.mark.parametrize("weights", MOMENTS)
@pytest.mark.parametrize(("n_radial", "n_around"), [(4, 5), (8, 12)])
def test_a_disc_has_the_moments_of_its_pressure(weights, n_radial, n_around):
    points, share = disc_quadrature(weights, n_radial, n_around)
    x, y = points.T
    square, fourth = MOMENTS[weights]
    assert len(share) == n_radial * n_around and share.min() > 0
    exact = {"1": 1, "x": 0, "y": 0, "xy": 0, "xx": square / 2, "yy": square / 2, "rr": fourth}
    computed = {
        "1": 1,
        "x": x,
        "y": y,
        "xy": x * y,
        "xx": x * x,
        "yy": y * y,
        "rr": np.hypot(x, y) ** 4,
    }
    for name in exact:
        # sums of up to 96 terms whose sizes add to one: eps, rarely two
        assert np.sum(share * computed[name]) == pytest.approx(exact[name], abs=1e-14), name


@pytest.mark.parametrize("weights", MOMENTS)
def test_a_patch_reads_the_rigid_motion_of_its_point_along_the_force(model, weights):
    """A shift along its normal as it is, turns about axes through its point not at all."""
    patch = contact_patch(model, "block:top", (0.004, -0.003), 0.005, weights=weights)
    np.testing.assert_allclose(patch.spot.point, [0.004, -0.003, 0.03], atol=1e-12)
    moved = rigid_motion(model.structure.points, patch.spot.point)
    order = np.argsort(np.argsort(np.arange(model.structure.n_dofs)))
    computed = patch.on_mesh @ moved[order]
    np.testing.assert_allclose(computed, [0, 0, -1, 0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(patch.w, model.T.T @ patch.on_mesh)


def test_a_patch_reads_the_mean_square_of_a_bent_face(model):
    """u_z = x^2, which quadratic elements hold exactly: a fifth of the squared radius."""
    radius = 0.006
    patch = contact_patch(model, "block:top", (0.0, 0.0), radius)
    bent = np.zeros(model.structure.n_dofs)
    bent[2::3] = model.structure.points[:, 0] ** 2
    assert -patch.on_mesh @ bent == pytest.approx(radius**2 / 5, rel=1e-5)


def test_the_boundary_of_a_patch_are_all_three_displacements_of_its_nodes(model):
    """The top is free: every dof of a node that is read stands in the model by itself."""
    patch = contact_patch(model, "block:top", (0.001, 0.002), 0.005)
    nodes = np.flatnonzero(np.abs(patch.on_mesh).reshape(-1, 3).any(axis=1))
    dofs = np.sort((3 * nodes[:, None] + np.arange(3)).ravel())
    np.testing.assert_array_equal(model.free[patch.boundary], dofs)
    assert 9 <= len(nodes) <= 60
    assert np.abs(model.structure.points[nodes, 2] - 0.03).max() < 1e-12


def test_a_disc_on_mirror_planes_is_folded_onto_one_side(model):
    """Half a model reads what the whole reads of a field that is even in x."""
    whole = contact_patch(model, "block:top", (0.0, 0.0), 0.005)
    folded = contact_patch(model, "block:top", (0.0, 0.0), 0.005, mirrors="x")
    even = np.zeros(model.structure.n_dofs)
    even[2::3] = np.cos(300 * model.structure.points[:, 0])
    assert folded.on_mesh @ even == pytest.approx(whole.on_mesh @ even, rel=1e-12)
    read = np.flatnonzero(np.abs(folded.on_mesh).reshape(-1, 3).any(axis=1))
    assert model.structure.points[read, 0].min() > -1e-12
    assert model.structure.points[read, 1].min() < -1e-3


def test_a_mean_of_nodes_reads_the_nearest_ones_alike(model):
    points = [(0.0, 0.0), (0.0068, 0.0), (0.0, -0.0131)]
    patch = node_patch(model, "block:top", points)
    nodes = np.flatnonzero(np.abs(patch.on_mesh).reshape(-1, 3).any(axis=1))
    spots = model.structure.points[nodes]
    h = 0.04 / 6
    exact = np.array([[0, 0, 0.03], [h, 0, 0.03], [0, -2 * h, 0.03]])
    np.testing.assert_allclose(spots[np.lexsort(spots.T)], exact[np.lexsort(exact.T)], atol=1e-12)
    np.testing.assert_allclose(patch.on_mesh.reshape(-1, 3)[nodes], [[0, 0, -1 / 3]] * 3)
    middle = exact.mean(axis=0)
    assert patch.radius == pytest.approx(np.linalg.norm(exact - middle, axis=1).max())
    np.testing.assert_allclose(patch.spot.point, middle, atol=1e-12)


def test_a_patch_that_leaves_its_face_is_refused(model):
    with pytest.raises(ValueError, match="leaves the face 'block:top'"):
        contact_patch(model, "block:top", (0.018, 0.0), 0.005)
