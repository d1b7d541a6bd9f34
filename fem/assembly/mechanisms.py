"""Bodies that can still move rigidly: mechanisms of the joined and held assembly.

Coordinates z are the six rigid motions of every body, and the elongation and motion of every joint,
U = Phi z. E z are the violations of all constraints and the elongations of all springs; a z with
E z = 0 costs neither force nor energy and is a mechanism. The singular values of E tell.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space
from scipy.sparse import block_diag, coo_array, csr_array, diags_array, vstack
from scipy.sparse.csgraph import connected_components

from beadwave.fem.assembly.elasticity import Structure
from beadwave.fem.assembly.grounding import motions_about
from beadwave.fem.assembly.joints import rigid_motion
from beadwave.fem.assembly.model import Connections, ConstrainedModel, constrained
from beadwave.fem.modes.mac import MOTIONS


class Loose(NamedTuple):
    """A body that nothing keeps from moving."""

    body: str
    motions: tuple[str, ...]  # of "x", ..., "rz", about its middle


def loose_bodies(
    structure: Structure,
    connections: Connections,
    constraints_of_all: ConstrainedModel | None = None,
    *,
    free: float = 1e-6,
    moving: float = 0.05,
) -> list[Loose]:
    """Bodies that can move rigidly, and how, those of the lightest group of joined bodies first; of
    an assembly that nothing holds at all only those that move relative to the others.

    A motion counts as free if its singular value of E is below `free` times the largest one; a body
    counts as at rest if it moves less than `moving` times the largest motion of the mechanism.
    Neither was varied. `constraints_of_all` are those of these connections, where they are known.
    E has 6 columns for each body and 12 for each joint, whatever the mesh. Raises ValueError as
    `joined` does.
    """
    n, k = structure.n_dofs, connections.stiffness

    # rigid motions G of each body in metres, turns times half its size; R is the assembly's own
    G, R, sizes = [], [], []
    for body in structure.basis:
        points = structure.points[structure.dofs(body)[0::3] // 3]
        centre = (points.min(axis=0) + points.max(axis=0)) / 2
        sizes.append(np.ptp(points, axis=0).max() / 2)
        G.append(rigid_motion(points, centre) / _lengths(sizes[-1]))
        R.append(_lengths(sizes[-1])[:, None] * motions_about(centre[None]))

    # Phi (n_total, m): these, elongations and motions of joints, and the table
    lengths = np.tile(_lengths(float(np.mean(sizes))), len(connections.joints))
    n_table = 2 if connections.table else 0
    n_parts = sum(len(part.omega) for part in structure.measured)
    others = [*(1 / lengths), *(1 / lengths), *[1.0] * (n_parts + n_table)]
    blocks = [*map(csr_array, G), *([diags_array(others)] if others else [])]
    Phi = block_diag(blocks, format="csr")
    about = lengths[:, None] * motions_about(connections.centres)
    R = np.vstack([*R, 0 * about, about, np.zeros((n_parts, 6)), np.eye(6)[:n_table]])

    # E (rows, m): what constraints and springs have against these coordinates
    n_total, constraints, _ = constraints_of_all or constrained(structure, connections)
    violations = [(Phi[c.slaves] - c.A @ Phi) for c in constraints]
    springs = n + np.flatnonzero((k > 0) & np.isfinite(k))
    table = np.arange(n + 2 * len(k), n_total)  # and oscillators, which are taken to stand still
    E = vstack([*violations, Phi[springs], Phi[table]]).tocsr()
    between = [*structure.springs, *structure.measured]
    points = vstack([csr_array((0, n)), *(one.B for one in between)]) @ Phi[:n]
    of_all = vstack([E, points]).tocsr()

    # null space; without the assembly's own motions where nothing but springs between points
    # resists these: on cords it may be free in some directions
    values, z = np.linalg.eigh((of_all.T @ of_all).toarray())
    Z = z[:, values <= free**2 * values[-1]]
    if np.abs(E @ R).max(initial=0.0) <= free * np.abs(R).max() * np.sqrt(values[-1]):
        common = np.linalg.qr(R @ null_space(points @ R, rcond=free))[0]
        U, s, _ = np.linalg.svd(Z - common @ (common.T @ Z), full_matrices=False)
        Z = U[:, s > 0.5]

    # groups of bodies that constraints, springs and joints join
    n_bodies = len(structure.basis)
    owner = np.append(np.repeat(np.arange(n_bodies), 6), n_bodies + np.arange(len(others)))
    of_owner = coo_array((np.ones(len(owner)), (np.arange(len(owner)), owner))).tocsr()
    _, group = connected_components(of_owner.T @ abs(of_all.T @ of_all) @ of_owner)
    mass = [structure.M[dofs][:, dofs].sum() for dofs in map(structure.dofs, structure.basis)]
    of_group = np.bincount(group[:n_bodies], mass)[group[:n_bodies]]

    loose = []
    for i in np.argsort(of_group, kind="stable"):
        body = list(structure.basis)[i]
        moved = np.linalg.norm(Z[6 * i : 6 * i + 6], axis=1) if Z.size else np.zeros(6)
        directions = tuple(MOTIONS[j] for j in np.flatnonzero(moved > moving))
        if directions:
            loose.append(Loose(body, directions))
    return loose


def _lengths(size: float) -> NDArray[np.float64]:
    """Factors (6,) on three shifts and three turns of a body of a size [m] that make both
    metres."""
    return np.array([1.0, 1.0, 1.0, size, size, size])
