"""The mean motion that a joint takes from a face (RBE3), compared with its definition.

The six motions q of a joint's side are those of the rigid motion nearest to the face,

    int |u - (q_shift + q_turn x (x - c))|^2 dA  ->  min,

here of meshes whose elements are of unlike sizes: there the weights of the places matter, which a
regular mesh would hide.
"""

from collections.abc import Callable

import numpy as np
import pytest
from skfem import MeshHex

from beadwave import fem
from beadwave.fem.assembly import joints
from beadwave.geometry.meshing.grid_lines import graded

STEEL = fem.Material(210e9, 0.3, 7850.0)
HEIGHT, CENTRE = 0.04, np.array([0.013, -0.006, 0.04])  # m
WIDE, NARROW = ((-0.04, 0.05), (-0.03, 0.02)), ((-0.03, 0.03), (-0.02, 0.02))  # m, x and y
POINTS = 60  # of Gauss in each direction: exact for polynomials to the power of 119

FIELDS: dict[str, Callable] = {  # u_x, u_y, u_z of x and y, quadratic: the elements hold them
    "a dome": lambda x, y: (0 * x, 0 * x, 5 * x**2 + y**2),
    "a twist": lambda x, y: (x * y, -(y**2), x * y),
    "a stretch": lambda x, y: (x**2, x + y, 0 * x),
}


@pytest.mark.parametrize("words", FIELDS)
def test_a_joint_follows_the_rigid_motion_nearest_to_its_face(words):
    """On its own face, and on the footprint of another mesh."""
    structure, side = _structure(block=(0.0, WIDE)), fem.Side("block:+z", "mean")
    covered = _structure(block=(0.0, WIDE), cover=(HEIGHT, NARROW))
    footprint = fem.Side("block:+z", "mean", over="cover:-z")
    assert difference(structure, side, WIDE, FIELDS[words]) < 1e-9
    assert difference(covered, footprint, NARROW, FIELDS[words]) < 1e-9


def test_weights_of_a_wrong_power_are_noticed(monkeypatch):
    """To the power of 0.5 they are off by 0.01 to 40."""
    right = joints.distributing
    monkeypatch.setattr(joints, "distributing", lambda p, w, c: right(p, w**0.5, c))
    structure, side = _structure(block=(0.0, WIDE)), fem.Side("block:+z", "mean")
    for field in FIELDS.values():
        assert difference(structure, side, WIDE, field) > 1e-3


def test_the_mean_of_a_bulge_is_that_of_its_rectangle():
    """int (x - x_c)^2 dA / A = b^2 / 12."""
    (x_low, x_high), _ = WIDE
    middle = (x_low + x_high) / 2
    structure, side = _structure(block=(0.0, WIDE)), fem.Side("block:+z", "mean")
    bulge = _mean_motion(structure, side, lambda x, y: (0 * x, 0 * x, (x - middle) ** 2),
                         centre=np.array([middle, 0.0, HEIGHT]))  # fmt: skip
    assert bulge[2] == pytest.approx((x_high - x_low) ** 2 / 12, rel=1e-9)


def difference(structure, side, rectangle, field) -> float:
    """Largest difference of the six motions from those of the nearest rigid motion, by Gauss' rule,
    over the largest of these."""
    theirs = _nearest_rigid_motion(rectangle, field)
    return np.abs(_mean_motion(structure, side, field) - theirs).max() / np.abs(theirs).max()


def _structure(**blocks) -> fem.Structure:
    """Blocks of HEIGHT from z on rectangles, elements small at one corner and large at another."""
    meshes = {}
    for name, (z, ((x_low, x_high), (y_low, y_high))) in blocks.items():
        lines = (
            graded(x_low, x_high, x_low, 2e-3, 2e-2), graded(y_low, y_high, y_high, 3e-3, 2e-2)
        )  # fmt: skip
        mesh = MeshHex.init_tensor(*lines, np.linspace(z, z + HEIGHT, 3))
        meshes[name] = mesh.with_boundaries({
            "-z": lambda x, z=z: np.abs(x[2] - z) < 1e-9,
            "+z": lambda x, z=z: np.abs(x[2] - z - HEIGHT) < 1e-9,
        })  # fmt: skip
    return fem.assemble(meshes, dict.fromkeys(meshes, STEEL))


def _mean_motion(structure: fem.Structure, side: fem.Side, field, centre=CENTRE) -> np.ndarray:
    """Shifts and turns (6,) of a joint's side when its body moves by a field.

    The side's motion is the elongation of a joint to the ground: that of U = T u, where u has the
    field at the nodes which stay free.
    """
    joint = fem.Joint("screw", side, None, centre, fem.Bushing(*[1.0] * 6))
    model = fem.joined(structure, fem.Connections(joints=[joint]))
    u = np.column_stack(field(*structure.points.T[:2])).ravel()
    nodes = model.free < structure.n_dofs
    followed = u - model.T[:, nodes] @ u[model.free[nodes]]
    return np.linalg.lstsq(model.T[:, model.elongation].toarray(), followed, rcond=None)[0]


def _nearest_rigid_motion(rectangle, field) -> np.ndarray:
    """q (6,) by least squares on a rectangle x and y [m] at the joint's height."""
    x, w = np.polynomial.legendre.leggauss(POINTS)
    (a, b), (c, d) = rectangle
    X, Y = np.meshgrid(a + (b - a) * (x + 1) / 2, c + (d - c) * (x + 1) / 2, indexing="ij")
    points = np.column_stack([X.ravel(), Y.ravel(), np.full(X.size, HEIGHT)])
    root = np.sqrt(np.outer(w, w).ravel())[:, None]
    motions = [np.broadcast_to(e, points.shape) for e in np.eye(3)]
    motions += [np.cross(e, points - CENTRE) for e in np.eye(3)]
    columns = np.column_stack([(root * motion).ravel() for motion in motions])
    u = np.column_stack(field(*points.T[:2]))
    return np.linalg.lstsq(columns, (root * u).ravel(), rcond=None)[0]
