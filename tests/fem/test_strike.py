"""A strike on any face: the patch turns with the body, and on round faces it does not matter."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from skfem import MeshHex

from beadwave.fem import (
    Connections,
    HeldFace,
    Material,
    Orthotropic,
    assemble,
    contact_patch,
    factorised,
    half_space_on_mesh,
    joined,
    planar_spot,
    round_spot,
)

STEEL = Material(210e9, 0.3, 7850.0)
PLY = Orthotropic((135e9, 9e9, 9e9), (0.3, 0.3, 0.45), (5e9, 5e9, 3.1e9), 1600.0)


def block(turn):
    """A box whose top is struck off its middle, turned; and what its axes have become."""
    lines = np.linspace(-0.03, 0.03, 9), np.linspace(-0.02, 0.02, 7), np.array([0, 0.012, 0.018])
    mesh = MeshHex.init_tensor(*lines)
    faces = {"top": lambda x: x[2] > 0.018 - 1e-9, "base": lambda x: x[2] < 1e-9}
    mesh = mesh.with_boundaries(faces)
    return MeshHex(turn @ mesh.p, mesh.t).with_boundaries(mesh.boundaries)


def answers(mesh, at, material=STEEL):
    structure = assemble({"block": mesh}, {"block": material})
    model = joined(structure, Connections(held=[HeldFace("block:base")]))
    patch = contact_patch(model, "block:top", at, 2e-3)
    local = half_space_on_mesh(model, "block:top", patch, STEEL)
    return patch.w @ factorised(model.K).solve(patch.w), local, patch.spot


def test_a_turned_block_struck_at_the_same_spot_answers_the_same():
    """Turned by any angles; the axes of its top are found anew, so the point is told by them."""
    plain = answers(block(np.eye(3)), (0.01, 0.004))
    np.testing.assert_allclose(plain[2].inward, [0, 0, -1], atol=1e-12)
    np.testing.assert_allclose(plain[2].point, [0.01, 0.004, 0.018], atol=1e-12)
    turn = Rotation.from_euler("xyz", [25.0, -40.0, 110.0], degrees=True).as_matrix()
    mesh = block(turn)
    middle = planar_spot(assemble({"block": mesh}, {"block": STEEL}), "block:top", (0.0, 0.0))
    offset = middle.axes @ (turn @ [0.01, 0.004, 0.018] - middle.point)
    turned = answers(mesh, tuple(offset))
    np.testing.assert_allclose(turned[2].inward, -turn[:, 2], atol=1e-12)
    np.testing.assert_allclose(turned[:2], plain[:2], rtol=1e-8)


@pytest.mark.parametrize("face", ["x", "y", "z"])
def test_a_face_along_an_axis_is_spanned_by_the_other_two_in_order(face):
    i = "xyz".index(face)
    cube = MeshHex.init_tensor(*[np.linspace(0, 1, 2)] * 3)
    cube = cube.with_boundaries({"up": lambda x: x[i] > 1 - 1e-9})
    spot = planar_spot(assemble({"cube": cube}, {"cube": STEEL}), "cube:up", (0.1, 0.2))
    np.testing.assert_allclose(spot.axes, np.delete(np.eye(3), i, axis=0), atol=1e-15)
    np.testing.assert_allclose(spot.point, np.insert([0.6, 0.7], i, 1.0))
    np.testing.assert_array_equal(spot.inward, -np.eye(3)[i])


R, LENGTH, AT = 0.03, 0.08, 0.5


@pytest.fixture(scope="module")
def bar():
    """A half of a round bar about x = 0, held at its back, fine towards the struck line."""
    angle = np.pi * np.concatenate([-np.geomspace(0.5, 0.02, 9), [0], np.geomspace(0.02, 0.5, 9)])
    radius = R * (1 - np.concatenate([[0], np.geomspace(0.06, 0.7, 7)]))
    z = np.concatenate([-np.geomspace(0.5, 0.02, 8), [0], np.geomspace(0.02, 0.5, 8)]) * LENGTH
    mesh = MeshHex.init_tensor(angle, radius[::-1], z)
    phi, r, height = mesh.p
    faces = {
        "round": mesh.facets_satisfying(lambda x: x[1] > R - 1e-9),
        "hollow": mesh.facets_satisfying(lambda x: x[1] < 0.3 * R + 1e-9),
        "ends": mesh.facets_satisfying(lambda x: np.abs(np.abs(x[0]) - np.pi / 2) < 1e-9),
    }
    bent = MeshHex(np.array([r * np.cos(phi), r * np.sin(phi), height]), mesh.t)
    whole = assemble({"bar": bent.with_boundaries(faces)}, {"bar": STEEL})
    return joined(whole, Connections(held=[HeldFace("bar:ends")]))


@pytest.mark.slow
def test_on_a_round_bar_the_patch_does_not_matter_once_the_half_space_is_off(bar):
    """To 1 % of what is left, 2e-4 of the half-space's own, up to patches of R/12."""
    where = (0.04, 0.001, 0.002), np.zeros(3), R, np.array([0, 0, 1.0])
    spot = round_spot(bar.structure, "bar:round", *where)
    assert spot.radii == (np.inf, R) and np.linalg.norm(spot.point[:2]) == pytest.approx(R)
    factor, left = factorised(bar.K), []
    for radius in (5e-4, 1e-3, 2.5e-3):
        patch = contact_patch(bar, "bar:round", spot, radius)
        assert patch.on_mesh.reshape(-1, 3).sum(axis=0) @ spot.inward == pytest.approx(1.0)
        local = half_space_on_mesh(bar, "bar:round", patch, STEEL)
        left.append(patch.w @ factor.solve(patch.w) - local)
    assert np.ptp(left) < 0.02 * abs(np.mean(left))


def test_a_patch_too_large_for_its_curvature_and_a_face_that_is_not_so_are_refused(bar):
    about = np.zeros(3), R, np.array([0, 0, 1.0])
    spot = round_spot(bar.structure, "bar:round", (0.04, 0, 0), *about)
    with pytest.raises(
        ValueError, match=r"0\.004 m on a face of curvature radius 0\.03 m is 0\.13"
    ):
        contact_patch(bar, "bar:round", spot, 4e-3)
    with pytest.raises(ValueError, match="is not plane: it leaves its mean plane"):
        contact_patch(bar, "bar:round", (0.0, 0.0), 1e-3)
    with pytest.raises(ValueError, match=r"is not of radius 0\.03 m"):
        round_spot(bar.structure, "bar:hollow", (0.01, 0, 0), *about)
    hollow = round_spot(bar.structure, "bar:hollow", (0.01, 0, 0), np.zeros(3), 0.3 * R, about[2])
    assert hollow.radii == (np.inf, -0.3 * R) and hollow.inward[0] == pytest.approx(1.0)


def test_a_curved_face_of_an_orthotropic_body_has_no_half_space_here(bar):
    spot = round_spot(bar.structure, "bar:round", (0.04, 0, 0), np.zeros(3), R, np.eye(3)[2])
    patch = contact_patch(bar, "bar:round", spot, 1e-3)
    with pytest.raises(ValueError, match="is a curved face of an orthotropic material"):
        half_space_on_mesh(bar, "bar:round", patch, PLY)
