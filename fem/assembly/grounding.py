"""The structure moved as one rigid body: its mass and centre, and whether anything resists it.

A rigid motion R of all parts costs no energy, K R = 0, and every tie and joint follows it,
u_slave = A R; one that does not acts as a spring to the ground that nobody modelled. R^T M R holds
mass and first moments. Checks of NASA-STD-5002, annex on Craig-Bampton models.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.fem.assembly.constraints import Constraint
from beadwave.fem.assembly.elasticity import Structure
from beadwave.fem.assembly.joints import rigid_motion


class RigidBody(NamedTuple):
    """Mass, centre, and the forces |K R| under rigid motions relative to K, which are rounding."""

    mass: float  # [kg]
    centre: NDArray[np.float64]  # (3,) [m]
    grounding: float


def rigid_body(structure: Structure) -> RigidBody:
    """Mass, centre and residual forces of all bodies together, before they are joined and held."""
    R = rigid_motion(structure.points, np.zeros(3))
    inertia = R.T @ (structure.M @ R)
    mass = inertia[0, 0]
    largest = max(structure.K.data.max(), -structure.K.data.min())  # abs(K) would be a copy
    residual = np.abs(structure.K @ R).max() / (largest * np.abs(R).max())
    # first moments between shifts and turns: a turn about z moves along y by x, along x by -y
    centre = np.array([inertia[1, 5], -inertia[0, 5], inertia[0, 4]]) / mass
    return RigidBody(float(mass), centre, float(residual))


def require_free_joints(
    structure: Structure,
    constraints: Sequence[Constraint],
    centres: NDArray[np.float64],
    *,
    allowed: float = 1e-5,
) -> None:
    """Raise ValueError where a tie or a joint does not follow a rigid motion, but for `allowed` of
    the structure's size, which includes what faces may miss each other by.

    The dofs are U = [u, elongations (6 k), motions (6 k) about centres (k, 3), ...].
    """
    n = structure.n_dofs
    size = np.ptp(structure.points, axis=0).max()
    n_table = 2
    n_parts = sum(len(part.omega) for part in structure.measured)
    U = np.zeros((n + 12 * len(centres) + n_parts + n_table, 6))
    U[:n] = rigid_motion(structure.points, np.zeros(3))
    U[n + 6 * len(centres) :][: 6 * len(centres)] = motions_about(centres)
    for constraint in constraints:
        off = constraint.A @ U[: constraint.A.shape[1]] - U[constraint.slaves]
        worst = np.abs(off[constraint.slaves < n]).max(initial=0.0) / size
        if worst > allowed:
            raise ValueError(
                f"{constraint.name} restrains rigid-body motions, as springs to the ground would: "
                f"it misses them by {worst:.1e} of the structure's size, allowed is "
                f"{allowed:.0e}; let its faces lie on each other."
            )


def motions_about(centres: NDArray[np.float64]) -> NDArray[np.float64]:
    """Shifts and turns (6 k, 6) of frames at centres (k, 3) under the six rigid motions."""
    moved = rigid_motion(centres, np.zeros(3)).reshape(-1, 3, 6)
    turned = np.broadcast_to(np.eye(6)[3:], moved.shape)
    return np.concatenate([moved, turned], axis=1).reshape(-1, 6)
