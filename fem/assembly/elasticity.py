"""Stiffness and mass of linear elasticity, body by body.

    K_ij = int sigma(phi_i) : eps(phi_j),    M_ij = int rho phi_i . phi_j

Bodies are separate and free here, in tetrahedra or in hexahedra; `fem.assembly.model` joins and
holds them. The shape functions come from scikit-fem, the element integrals are batched matrix
products of their gradients,

    D_(ic)(jd) = int d_c phi_i d_d phi_j,    K_(ia)(jb) = C_acbd D_(ic)(jd).
"""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix, eye_array, kron
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

from beadwave.fem.assembly.materials import Material, Orthotropic


class AttachedMass(NamedTuple):
    """A mass that a face carries, apart from all others."""

    name: str
    M: csr_matrix  # (ndof, ndof) [kg]


class Dent(NamedTuple):
    """The dent that a spring makes in a body under its disc."""

    body: str
    per_length: float  # [1/m] compliance of the disc on a half-space, times E / (1 - nu^2)


class PointSprings(NamedTuple):
    """Springs of one name and stiffness between points, or from points to the ground."""

    name: str
    B: csr_matrix  # (m, ndof) their elongations
    stiffness: float  # [N/m] of each
    dashpot: float = 0.0  # [N s/m] of each
    dents: tuple[tuple[Dent, ...], ...] = ()  # m of one end or two


class JoinedPart(NamedTuple):
    """A part of measured oscillators at m points of faces (`fem.assembly.measured_part`)."""

    name: str
    B: csr_matrix  # (m, ndof) motions of the points
    omega: NDArray[np.float64]  # (k,) [rad/s]
    zeta: NDArray[np.float64]  # (k,)
    phi: NDArray[np.float64]  # (m, k) [kg^-1/2]
    stiffness: NDArray[np.float64]  # (m, m) [N/m] of the joint
    dents: tuple[Dent, ...] = ()  # (m,) under the points


class FastenerMass(NamedTuple):
    """A rigid body that moves with the mean of a face."""

    C: csr_matrix  # (6, ndof) its shifts and turns
    inertia: tuple[float, ...]  # (6,) [kg, kg m^2]


class Structure(NamedTuple):
    """All bodies, unjoined and free: x, y, z of node after node, body after body."""

    basis: dict[str, Basis]  # of each body, three displacements at each node of a quadratic element
    first: dict[str, int]  # dof of each body
    points: NDArray[np.float64]  # (n_nodes, 3) [m]
    K: csr_matrix  # (ndof, ndof) [N/m]
    M: csr_matrix  # (ndof, ndof) [kg], with the masses that faces carry
    carried: tuple[AttachedMass, ...] = ()  # these masses, each alone
    fasteners: tuple[FastenerMass, ...] = ()  # heads and nuts of bolts in M
    springs: tuple[PointSprings, ...] = ()  # between points; no part of K
    measured: tuple[JoinedPart, ...] = ()  # parts known by receptances; no part of K and M

    @property
    def n_dofs(self) -> int:
        """Three for each node."""
        return 3 * len(self.points)

    def dofs(self, body: str) -> NDArray[np.int64]:
        """Dofs (n,) of all nodes of a body."""
        return self.first[body] + np.arange(self.basis[body].N)

    def facets(self, face: str) -> tuple[str, NDArray[np.int64]]:
        """The body of a face "body:face" and the numbers (k,) of its facets in that body's mesh.

        Raises ValueError for a face that the body does not have, or not a facet of.
        """
        body, _, name = face.partition(":")
        named = self.basis[body].mesh.boundaries or {} if body in self.basis else {}
        if not len(named.get(name, ())):
            raise ValueError(f"the mesh has no facets named {face!r}; imprint that face on it.")
        return body, named[name]


# exact for elements with straight edges: gradients need order 2 in tetrahedra, masses 4; the
# 3-point Gauss product rule of the hexahedra (order 5) is that of CalculiX's C3D20
ELEMENTS: dict[type[Mesh], tuple[Element, int, int]] = {
    MeshTet: (ElementTetP2(), 2, 4),
    MeshHex: (ElementHexS2(), 5, 5),
}


def assemble(
    meshes: Mapping[str, Mesh], materials: Mapping[str, Material | Orthotropic]
) -> Structure:
    """K and M of bodies of tetrahedra or hexahedra, quadratic elements, a material per body.

    Raises ValueError when a body has no material or its mesh another cell type.
    """
    missing = set(meshes) - set(materials)
    if missing:
        raise ValueError(f"no material for {sorted(missing)}; name one for every body.")
    basis, K, M = {}, [], []
    for name, mesh in meshes.items():
        kind = next((kind for kind in ELEMENTS if isinstance(mesh, kind)), None)
        if kind is None:
            raise ValueError(
                f"the mesh of {name} is a {type(mesh).__name__}; take MeshTet or MeshHex."
            )
        # where the dofs are, without the shape functions' values: 3 kB of every element
        basis[name] = Basis(mesh, ElementVector(ELEMENTS[kind][0]), intorder=1)
        basis[name].basis = []
    for name, b in basis.items():
        stiffness, mass = _matrices(b, materials[name])
        K.append(stiffness)
        M.append(mass)
    first = np.cumsum([0, *(b.N for b in basis.values())]).tolist()
    return Structure(
        basis,
        dict(zip(basis, first, strict=False)),
        np.concatenate([b.doflocs[:, 0::3].T for b in basis.values()]),
        block_diagonal(K),
        block_diagonal(M),
    )


def elements_of(mesh: Mesh) -> tuple[Element, int, int]:
    """The quadratic element of a mesh of straight or curved cells, and the orders of its quadrature
    for stiffness and mass."""
    return next(choice for kind, choice in ELEMENTS.items() if isinstance(mesh, kind))


def block_diagonal(blocks: Sequence[csr_matrix]) -> csr_matrix:
    """Square matrices along the diagonal of one; scipy's own takes four times the memory."""
    first = np.cumsum([0, *(block.shape[0] for block in blocks)])
    stored = np.cumsum([0, *(block.nnz for block in blocks)])
    indptr = [block.indptr[1:] + n for block, n in zip(blocks, stored, strict=False)]
    return csr_matrix(
        (
            np.concatenate([block.data for block in blocks]),
            np.concatenate([b.indices + n for b, n in zip(blocks, first, strict=False)]),
            np.concatenate([[0], *indptr]),
        ),
        shape=(first[-1], first[-1]),
    )


def _matrices(basis: Basis, material) -> tuple[csr_matrix, csr_matrix]:
    """K and M (n, n) of a body."""
    element, order_K, order_M = elements_of(basis.mesh)
    C = material.elasticity.transpose(1, 3, 0, 2).reshape(9, 9)

    def of(cells: NDArray[np.int64]) -> tuple[csr_matrix, csr_matrix]:
        """K (n, n) of these elements and, of one displacement only, M (n / 3, n / 3)."""
        points = Basis(basis.mesh, element, intorder=order_K, elements=cells)
        gradient = np.stack([phi[0].grad for phi in points.basis])  # (i, c, cell, point)
        K = element_stiffness(gradient, gradient, points.dx, C)
        if order_M != order_K:
            points = Basis(basis.mesh, element, intorder=order_M, elements=cells)

        # int rho phi_i phi_j dV, the same along x, y and z, (n_elements, n, n)
        phi = np.stack([np.broadcast_to(np.asarray(p[0]), points.dx.shape) for p in points.basis])
        P = phi.transpose(1, 0, 2)
        M = (P * material.density * points.dx[:, None]) @ P.transpose(0, 2, 1)
        return (
            scattered(K, basis.element_dofs[:, cells], basis.N),
            scattered(M, points.element_dofs, points.N),
        )

    K, M = summed(np.arange(basis.nelems), of)
    return K, along_each_axis(M)


def element_stiffness(
    test: NDArray[np.float64],
    trial: NDArray[np.float64],
    dx: NDArray[np.float64],
    C: NDArray[np.float64],
) -> NDArray[np.float64]:
    """K_(ia)(jb) = C_acbd D_(ic)(jd) of elements, (n_elements, 3 m, 3 n) [N/m], of gradients
    (m or n, c, cell, point) [1/m] and weights (cell, point) [m^3]; C (9, 9) [Pa] from (c, d) to
    (a, b).

    Two products of matrices an element in place of a loop over its points and components: the
    gradients are summed over the points first, then turned into forces by C.
    """
    m, dim, n_cells, _ = test.shape
    n = len(trial)
    first, second = (
        g.transpose(2, 0, 1, 3).reshape(n_cells, len(g) * dim, -1) for g in (test, trial)
    )
    D = ((first * dx[:, None]) @ second.transpose(0, 2, 1)).reshape(-1, m, dim, n, dim)
    K = D.transpose(0, 1, 3, 2, 4).reshape(-1, dim * dim) @ C
    return K.reshape(-1, m, n, dim, dim).transpose(0, 1, 3, 2, 4).reshape(-1, m * dim, n * dim)


def along_each_axis(A: csr_matrix) -> csr_matrix:
    """A (n, n) of nodes as the matrix (3 n, 3 n) of their displacements along x, y and z, which it
    does not couple."""
    return csr_matrix(kron(A, eye_array(3), format="csr"))


def summed(
    cells: NDArray[np.int64],
    of: Callable[[NDArray[np.int64]], tuple[csr_matrix, ...]],
    *,
    at_once: int = 2000,
) -> tuple[csr_matrix, ...]:
    """The sums of matrices (n, n) that of(cells) gives for elements `cells` (k,), `at_once` of them
    at a time, which hold some 100 MB; added in pairs, which copies the sum log2(shares) times."""
    if len(cells) <= at_once:
        return of(cells)
    first, second = (summed(half, of, at_once=at_once) for half in np.array_split(cells, 2))
    return tuple(A + B for A, B in zip(first, second, strict=True))


def scattered(local: NDArray[np.float64], dofs: NDArray[np.int64], n: int) -> csr_matrix:
    """The sum (n, n) of matrices of elements (k, m, m), on their dofs (m, k)."""
    rows = np.repeat(dofs.T[:, :, None], len(dofs), axis=2)
    columns = np.repeat(dofs.T[:, None, :], len(dofs), axis=1)
    return coo_matrix((local.ravel(), (rows.ravel(), columns.ravel())), shape=(n, n)).tocsr()
