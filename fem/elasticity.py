"""Stiffness and mass of linear elasticity.

    K_ij = int sigma(phi_i) : eps(phi_j),    M_ij = int rho phi_i . phi_j

Every part stands on its own here: nothing is joined and nothing is held. The shape functions come
from scikit-fem, the element integrals are batched matrix products of their gradients,

    D_(ia)(jb) = int d_a phi_i d_b phi_j
    K_(ia)(jb) = lambda D_(ia)(jb) + mu D_(ib)(ja) + mu delta_ab sum_c D_(ic)(jc).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix
from skfem import (
    Basis,
    Element,
    ElementHexS2,
    ElementTetP2,
    ElementVector,
    Mesh,
    MeshHex,
    MeshTet,
)


class Material(NamedTuple):
    """An isotropic elastic solid."""

    young: float  # [Pa]
    poisson: float
    density: float  # [kg/m^3]

    @property
    def lame(self) -> tuple[float, float]:
        """lambda and mu [Pa]."""
        E, nu = self.young, self.poisson
        return E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))


class Structure(NamedTuple):
    """All parts, unjoined and free."""

    basis: Basis  # three displacements at each node of a quadratic element
    K: csr_matrix  # (ndof, ndof) [N/m]
    M: csr_matrix  # (ndof, ndof) [kg]


# exact for elements with straight edges: gradients need order 2 in tetrahedra, masses 4; the
# 3-point Gauss product rule of the hexahedra (order 5) is that of CalculiX's C3D20
ELEMENTS: dict[type[Mesh], tuple[Element, int, int]] = {
    MeshTet: (ElementTetP2(), 2, 4),
    MeshHex: (ElementHexS2(), 5, 5),
}


def assemble(mesh: Mesh, materials: dict[str, Material]) -> Structure:
    """K and M of a mesh of tetrahedra or hexahedra, quadratic elements, a material per body.

    Raises ValueError when a body has no material or the mesh has another cell type.
    """
    element, stiffness_order, mass_order = _quadratic(mesh)
    missing = set(mesh.subdomains) - set(materials)
    if missing:
        raise ValueError(f"no material for {sorted(missing)}; name one for every body.")
    basis = Basis(mesh, ElementVector(element), intorder=1)
    K = M = csr_matrix((basis.N, basis.N))
    for name, cells in mesh.subdomains.items():
        dofs = basis.element_dofs[:, cells]
        material = materials[name]
        K = K + _scattered(_stiffness(mesh, element, cells, stiffness_order, material), dofs, K)
        M = M + _scattered(_mass(mesh, element, cells, mass_order, material), dofs, M)
    return Structure(basis, K.tocsr(), M.tocsr())


def _quadratic(mesh: Mesh) -> tuple[Element, int, int]:
    for kind, choice in ELEMENTS.items():
        if isinstance(mesh, kind):
            return choice
    raise ValueError(f"mesh is a {type(mesh).__name__}; take MeshTet or MeshHex.")


def _stiffness(mesh, element, cells, order, material) -> NDArray[np.float64]:
    basis = Basis(mesh, element, intorder=order, elements=cells)
    gradient = np.stack([phi[0].grad for phi in basis.basis])  # (i, a, cell, point)
    n, dim = gradient.shape[:2]
    G = gradient.transpose(2, 0, 1, 3).reshape(len(cells), n * dim, -1)
    D = ((G * basis.dx[:, None]) @ G.transpose(0, 2, 1)).reshape(-1, n, dim, n, dim)
    lam, mu = material.lame
    K = lam * D + mu * D.transpose(0, 1, 4, 3, 2)
    laplacian = mu * np.trace(D, axis1=2, axis2=4)
    for a in range(dim):
        K[:, :, a, :, a] += laplacian
    return K.reshape(-1, n * dim, n * dim)


def _mass(mesh, element, cells, order, material) -> NDArray[np.float64]:
    basis = Basis(mesh, element, intorder=order, elements=cells)
    phi = np.stack([np.broadcast_to(np.asarray(p[0]), basis.dx.shape) for p in basis.basis])
    P = phi.transpose(1, 0, 2)
    return np.kron((P * material.density * basis.dx[:, None]) @ P.transpose(0, 2, 1), np.eye(3))


def _scattered(local, dofs, like) -> csr_matrix:
    n = dofs.shape[0]
    rows = np.repeat(dofs.T[:, :, None], n, axis=2)
    columns = np.repeat(dofs.T[:, None, :], n, axis=1)
    entries = (local.ravel(), (rows.ravel(), columns.ravel()))
    return coo_matrix(entries, shape=like.shape).tocsr()
