"""The mean motion that a joint takes from a face (RBE3), beside its definition worked out anew.

The six motions q of a joint's side are those of the rigid motion nearest to the face,

    int |u - (q_shift + q_turn x (x - c))|^2 dA  ->  min,

here of meshes whose elements are of unlike sizes: there the weights of the places matter, which a
regular mesh would hide.
"""

from collections.abc import Callable, Iterator

import numpy as np
from skfem import MeshHex

from beadwave import fem
from beadwave.geometry.grid_lines import graded
from beadwave.workflows.evidence.harness import Comparison, compared

STEEL = fem.Material(210e9, 0.3, 7850.0)
HEIGHT, CENTRE = 0.04, np.array([0.013, -0.006, 0.04])  # m
WIDE, NARROW = ((-0.04, 0.05), (-0.03, 0.02)), ((-0.03, 0.03), (-0.02, 0.02))  # m, x and y
POINTS = 60  # of Gauss in each direction: exact for polynomials to the power of 119
SOURCE = "least squares over the face, by Gauss' rule of its own"
CLOSED = "int x^2 dA / A over the rectangle"


FIELDS: dict[str, Callable] = {  # u_x, u_y, u_z of x and y, quadratic: the elements hold them
    "a dome": lambda x, y: (0 * x, 0 * x, 5 * x**2 + y**2),
    "a twist": lambda x, y: (x * y, -(y**2), x * y),
    "a stretch": lambda x, y: (x**2, x + y, 0 * x),
}


def mean_joints() -> Iterator[Comparison]:
    """Mean motion that a joint takes from a face (RBE3), on meshes of unlike elements."""
    alone = _structure(block=(0.0, WIDE))
    covered = _structure(block=(0.0, WIDE), cover=(HEIGHT, NARROW))
    face = fem.Side("block:+z", "mean")
    footprint = fem.Side("block:+z", "mean", over="cover:-z")
    for words, field in FIELDS.items():
        for name, structure, side, rectangle in (
            ("its own face", alone, face, WIDE),
            ("the footprint of another mesh", covered, footprint, NARROW),
        ):
            yield compared(
                f"mean motion of {name} in {words} [m, rad]",
                _mean_motion(structure, side, field), _nearest_rigid_motion(rectangle, field),
                allowed=1e-9, source=SOURCE,
            )  # fmt: skip

    (x_low, x_high), _ = WIDE
    middle = (x_low + x_high) / 2
    bulge = _mean_motion(alone, face, lambda x, y: (0 * x, 0 * x, (x - middle) ** 2),
                         centre=np.array([middle, 0.0, HEIGHT]))  # fmt: skip
    exact = (x_high - x_low) ** 2 / 12
    yield compared("mean of (x - x_c)^2 over its own face [m^2]", bulge[2], exact,
                   allowed=1e-9, source=CLOSED)  # fmt: skip


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
