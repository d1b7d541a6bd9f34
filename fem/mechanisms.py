"""Bodies that can still move rigidly: mechanisms of the joined and held assembly.

Every body keeps its six rigid motions z, and every joint its elongation and motion; what the
constraints and springs leave of U = Phi z is E z, and a z with E z = 0 moves bodies at no cost.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_diag, csr_matrix, diags_array, vstack

from fem.correlation import MOTIONS
from fem.elasticity import Structure
from fem.grounding import motions_about
from fem.joints import rigid_motion
from fem.model import Connections, constrained

FREE = 1e-6  # of the stiffest motion: singular values below are none
PART = 0.05  # of a mechanism's largest motion: a body that moves less stands still


class Loose(NamedTuple):
    """A body that nothing keeps from moving."""

    body: str
    motions: tuple[str, ...]  # of "x", ..., "rz", about its middle


def loose_bodies(structure: Structure, connections: Connections) -> list[Loose]:
    """Bodies that can move rigidly, and how; of an assembly that nothing holds at all only those
    that move beside the others.

    Raises ValueError as `joined` does.
    """
    whole, parts = _rigid_coordinates(structure, connections)
    E = _resistance(structure, connections, parts)
    values, z = np.linalg.eigh((E.T @ E).toarray())
    free = z[:, values <= FREE**2 * values[-1]]
    if np.abs(E @ whole).max(initial=0.0) <= FREE * np.abs(whole).max() * np.sqrt(values[-1]):
        free = _beside(free, whole)
    return list(_told(structure, free))


def _rigid_coordinates(structure: Structure, connections: Connections):
    """The assembly's six motions and Phi (n_total, m) of coordinates in metres."""
    G, motion, sizes = [], [], []
    for body in structure.basis:
        points = structure.points[structure.dofs(body)[0::3] // 3]
        centre = (points.min(axis=0) + points.max(axis=0)) / 2
        sizes.append(np.ptp(points, axis=0).max() / 2)
        G.append(rigid_motion(points, centre) / _lengths(sizes[-1]))
        motion.append(_lengths(sizes[-1])[:, None] * motions_about(centre[None]))
    lengths = np.tile(_lengths(float(np.mean(sizes))), len(connections.joints))
    n_table = 2 if connections.table else 0
    rest = [*(1 / lengths), *(1 / lengths), *[1.0] * n_table]
    parts = block_diag([*map(csr_matrix, G), diags_array(rest)] if rest else G, format="csr")
    about = lengths[:, None] * motions_about(connections.centres)
    sway = np.eye(6)[:n_table]
    return np.vstack([*motion, 0 * about, about, sway]), parts


def _lengths(size: float) -> NDArray[np.float64]:
    """What turns a shift and a turn into metres, (6,)."""
    return np.array([1.0, 1.0, 1.0, size, size, size])


def _resistance(structure: Structure, connections: Connections, parts: csr_matrix) -> csr_matrix:
    """E (rows, m): what constraints and springs have against the coordinates of `parts`."""
    n, k = structure.n_dofs, connections.stiffness
    n_total, constraints, _ = constrained(structure, connections)
    asked = [(parts[c.slaves] - c.A @ parts) for c in constraints]
    springs = n + np.flatnonzero((k > 0) & np.isfinite(k))
    table = np.arange(n + 2 * len(k), n_total)
    return vstack([*asked, parts[springs], parts[table]]).tocsr()


def _beside(free: NDArray[np.float64], whole: NDArray[np.float64]) -> NDArray[np.float64]:
    """The free motions without those of the assembly as a whole."""
    common = np.linalg.qr(whole)[0]
    left = free - common @ (common.T @ free)
    U, s, _ = np.linalg.svd(left, full_matrices=False)
    return U[:, s > 0.5]


def _told(structure: Structure, free: NDArray[np.float64]):
    """Each body's part in the mechanisms, given in directions."""
    for i, body in enumerate(structure.basis):
        moved = np.linalg.norm(free[6 * i : 6 * i + 6], axis=1) if free.size else np.zeros(6)
        directions = tuple(MOTIONS[j] for j in np.flatnonzero(moved > PART))
        if directions:
            yield Loose(body, directions)
