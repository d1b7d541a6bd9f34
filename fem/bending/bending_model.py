"""The model that a beam and a plate of bending theory become: K, M, the strike, the drawn body."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_array, csc_array, csr_matrix
from scipy.sparse.linalg import LinearOperator, eigsh
from skfem import MeshHex

from beadwave.fem.contact.contact_patch import ContactPatch
from beadwave.fem.modes.solver.factorisation import factorised

DOWN, ACROSS = np.array([0.0, 0.0, -1.0]), np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


class Buckled(ValueError):
    """A load under which the structure at rest is not stable."""


class Bending(NamedTuple):
    """A beam or plate in its free deflections and turns q (n,).

    It is drawn as a body of hexahedra whose vertices move by u (3 m,) = T @ q, x, y, z of vertex
    after vertex.
    """

    K: csc_array  # (n, n) [N/m], with what the axial force adds
    M: csc_array  # (n, n) [kg]
    T: csr_matrix  # (3 m, n)
    drawn: MeshHex  # of m vertices
    patch: ContactPatch
    inertia: NDArray[np.float64]  # (n,) [kg] forces on q by a unit acceleration along z
    mass: float  # [kg]
    half_space: float = 0.0  # [m/N] that K holds of the half-space in Hertz' law
    load_factor: float | None = None  # of the buckling load, where something presses

    @property
    def middle(self) -> NDArray[np.float64]:
        """Centre of mass (3,) [m]."""
        return (self.drawn.p.min(axis=1) + self.drawn.p.max(axis=1)) / 2

    def effective_mass(self, phi: NDArray[np.float64]) -> NDArray[np.float64]:
        """Share (k, 3) of the mass that mass-normalised modes phi (n, k) move along x, y, z."""
        along_z = (phi.T @ self.inertia) ** 2 / self.mass
        return np.column_stack([0 * along_z, 0 * along_z, along_z])


def load_factor(K: csc_array, K_G: csc_array) -> float:
    """Largest mu of -K_G x = mu K x: the load over the buckling load, 0 where it only pulls.

    K (n, n) [N/m] must hold the structure, K_G (n, n) [N/m] is the geometric stiffness of the load.
    """
    inverse, start = LinearOperator(K.shape, factorised(K).solve), np.ones(K.shape[0])
    largest = eigsh(-K_G, 1, K, Minv=inverse, which="LA", v0=start, return_eigenvectors=False)
    return max(float(largest[0]), 0.0)


def vertex_by_vertex(blocks: list[list]) -> csr_matrix:
    """T (3 m, n) of blocks (m, ..) for u_x, u_y, u_z."""
    T = csr_matrix(block_array(blocks))
    return T[np.arange(T.shape[0]).reshape(3, -1).T.ravel()]
