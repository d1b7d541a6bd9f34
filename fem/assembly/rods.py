"""Rods between two faces: bolts from head to nut, tie rods, tendons, tight before the strike.

    c = x_2 - x_1,  L = |c|,  t = c / L,        B = C_2 - C_1,  C_i u the mean of u over face i,
    f = -N B^T t,   K_G = N / L B^T (1 - t t^T) B,   K = k B^T t t^T B

A rod is tightened until its tension is N, however far the faces yield, and then locked: from there
on it has its own stiffness k = E A / L. Its force turns with it, as that of a string. The model is
that of a tendon which touches nothing between its ends. Where a rod passes through the bodies that
it presses, its K_G and theirs cancel but for their bending between its ends, on which it acts as if
it had play in its hole.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags_array, kron, vstack

from beadwave.fem.assembly.elasticity import Structure
from beadwave.fem.assembly.trace import face_mean


class Rod(NamedTuple):
    """A rod that pulls two faces together."""

    first: str  # "body:face"
    second: str
    tension: float  # [N]; < 0 pushes them apart
    stiffness: float = 0.0  # [N/m] its own, E A / L


class RodForces(NamedTuple):
    """Forces and stiffnesses that rods add to a structure."""

    f: NDArray[np.float64]  # (ndof,) [N]
    K_G: csr_matrix  # (ndof, ndof) [N/m]
    elongation: csr_matrix  # (rods, ndof) of each, t . B
    stiffness: NDArray[np.float64]  # (rods,) [N/m]

    @property
    def K(self) -> csr_matrix:  # noqa: N802  the name of the field
        """(ndof, ndof) [N/m] of the rods once they are locked."""
        return csr_matrix(self.elongation.T @ diags_array(self.stiffness) @ self.elongation)


def tightened(structure: Structure, rods: Sequence[Rod], *, most_nodes: int = 600) -> RodForces:
    """Forces, K_G and K of all rods. Raises ValueError for faces
    without a distance, and for more than `most_nodes` nodes on a face: a rod couples all nodes of
    both, 9 (2 n)^2 entries."""
    n = structure.n_dofs
    f, K_G, elongations = np.zeros(n), csr_matrix((n, n)), [csr_matrix((0, n))]
    for rod in rods:
        # C_i (3, ndof), the means of both faces, and c between their centres
        C, centres = [], []
        for face in (rod.first, rod.second):
            mean = face_mean(structure, face)
            if len(mean.share) > most_nodes:
                raise ValueError(
                    f"the face {face!r} has {len(mean.share)} nodes, allowed for a rod are "
                    f"{most_nodes}; take a smaller face, as that of a washer, or a coarser mesh "
                    "there."
                )
            row = csr_matrix((mean.share, mean.node, [0, len(mean.node)]), shape=(1, n // 3))
            C.append(csr_matrix(kron(row, np.eye(3))))
            centres.append(mean.centre)
        B, c = C[1] - C[0], centres[1] - centres[0]
        if np.linalg.norm(c) < 1e-6 * np.ptp(structure.points, axis=0).max():
            raise ValueError(
                f"the faces {rod.first!r} and {rod.second!r} have the same centre, so that a rod "
                "between them has no length; name the faces under its head and under its nut."
            )

        # tension along t, its turning across t, and the rod's own elongation along t
        L = np.linalg.norm(c)
        t = c / L
        across = np.eye(3) - np.outer(t, t)
        f -= rod.tension * (B.T @ t)
        K_G = K_G + rod.tension / L * (B.T @ csr_matrix(across) @ B)
        elongations.append(csr_matrix(csr_matrix(t) @ B))
    stiffness = np.array([rod.stiffness for rod in rods])
    return RodForces(f, K_G, vstack(elongations).tocsr(), stiffness)
