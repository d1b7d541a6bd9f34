"""Static loads first: a structure that forces or heat have stressed, stiffer or softer for it.

    K u = f + f_T,   sigma = C : (eps(u) - alpha dT 1),
    K_G = int sigma_cd d_c phi_i d_d phi_j  on each of x, y, z,    (K + K_G) phi = omega^2 M phi

f is spread evenly over faces, f_T = int C : alpha dT 1 : eps(v). K is that of the shape at rest:
displacements are small, the forces keep their directions, joints that turn carry no geometric term.
With mu the largest of -K_G x = mu K x the loads are mu of those that buckle the structure.
Bathe, Finite Element Procedures (2014), sec. 6.3.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import LinearOperator, eigsh
from skfem import Basis, FacetBasis

from fem.bending import Buckled
from fem.constraints import congruent
from fem.elasticity import ELEMENTS, Structure, scattered, shares
from fem.factorisation import factorised
from fem.materials import Material, Orthotropic
from fem.model import Model
from fem.threads import one_thread

PRESSED = 1e-3  # of the buckling load: less is not told from nothing
PLANE = 0.5  # length of the mean normal: of half a cylinder it is 0.64, of a bore 0
CONVERGED, VECTORS = 1e-4, 40  # residual of 1 + mu: mu is off by the square of it


class FaceForce(NamedTuple):
    """A force spread evenly over a face; without a direction into it, along its mean normal."""

    face: str  # "body:face"
    force: float  # [N]
    direction: Sequence[float] | None = None  # of any length


class Heat(NamedTuple):
    """A body warmer than it was made."""

    temperature: float  # [K]
    expansion: float  # [1/K]


class Load(NamedTuple):
    """All that a structure bears before it is struck."""

    forces: Sequence[FaceForce] = ()
    heat: Mapping[str, Heat] = {}


def prestressed(model: Model, materials: Mapping[str, Material | Orthotropic], load: Load) -> Model:
    """The model with the stiffness that its static load adds, and the load's share of buckling.

    Raises Buckled for a load beyond buckling, ValueError for a structure that floats.
    """
    structure, K = model.structure, model.K
    factor = factorised(K)
    u = model.T @ factor.solve(model.T.T @ _forces(structure, materials, load))
    bodies = [_geometric(structure, b, u, materials[b], load.heat.get(b)) for b in structure.basis]
    K_G = congruent(model.T, sum(bodies))
    mu = buckling_share(K, K_G, factor)
    if mu >= 1:
        raise Buckled(
            f"the static load is {mu:.4g} times that which buckles the structure; take less"
        )
    return model._replace(K0=(model.K0 + K_G).tocsc(), load_factor=mu)


def buckling_share(K, K_G, factor) -> float:
    """The largest mu of -K_G x = mu K x; 0 below PRESSED, where nothing presses."""
    inverse = LinearOperator(K.shape, factor.solve)
    start = np.random.default_rng(0).standard_normal(K.shape[0])
    # of 1 + mu: what only pulls has thousands of mu near 0, which no iteration tells apart
    with one_thread():
        found = eigsh(
            K - K_G, 1, K, Minv=inverse, which="LA", v0=start, tol=CONVERGED, ncv=VECTORS,
            return_eigenvectors=False,
        )  # fmt: skip
    mu = float(found[0]) - 1
    return mu if mu > PRESSED else 0.0


def _forces(structure: Structure, materials, load: Load) -> NDArray[np.float64]:
    """f (ndof,) [N]."""
    f = np.zeros(structure.n_dofs)
    for one in load.forces:
        body, facets = structure.facets(one.face)
        basis = structure.basis[body]
        f[structure.dofs(body)] += _on_face(basis, facets, one)
    for body, heat in load.heat.items():
        f[structure.dofs(body)] += _thermal(structure.basis[body], materials[body], heat)
    return f


def _on_face(basis: Basis, facets: NDArray[np.int64], one: FaceForce) -> NDArray[np.float64]:
    """(n,) [N] on the dofs of a body."""
    on_face = FacetBasis(basis.mesh, basis.elem.elem, facets=facets, intorder=4)
    area, share = on_face.dx.sum(), np.zeros(on_face.N)
    for dofs, phi in zip(on_face.element_dofs, on_face.basis, strict=True):
        np.add.at(share, dofs, (np.asarray(phi[0]) * on_face.dx).sum(axis=1))
    normal = (on_face.normals * on_face.dx).sum(axis=(1, 2)) / area
    if one.direction is None and np.linalg.norm(normal) < PLANE:
        raise ValueError(f"the face {one.face!r} has no one normal; say the force's direction.")
    along = -normal if one.direction is None else np.asarray(one.direction, float)
    return np.outer(share / area, one.force * along / np.linalg.norm(along)).ravel()


def _thermal(basis: Basis, material, heat: Heat) -> NDArray[np.float64]:
    """int sigma_T : grad v of a body that may not expand, (n,) [N]."""
    element, order, _ = ELEMENTS[type(basis.mesh)]
    scalar = Basis(basis.mesh, element, intorder=order)
    stress = np.einsum("acbd,bd->ac", material.elasticity, np.eye(3))
    stress *= heat.expansion * heat.temperature
    f = np.zeros((scalar.N, 3))
    for i, phi in enumerate(scalar.basis):
        gradient = np.einsum("ckq,kq->kc", phi[0].grad, scalar.dx)
        np.add.at(f, scalar.element_dofs[i], gradient @ stress)
    return f.ravel()


def _geometric(
    structure: Structure, body: str, u: NDArray[np.float64], material, heat: Heat | None
) -> csr_matrix:
    """K_G of a body on the dofs of the structure."""
    basis = structure.basis[body]
    first, n = structure.first[body], basis.N
    element, order, _ = ELEMENTS[type(basis.mesh)]
    own = u[first : first + n].reshape(-1, 3)
    C = material.elasticity
    free = np.zeros((3, 3)) if heat is None else heat.expansion * heat.temperature * np.eye(3)
    K_G = csr_matrix((n, n))
    for cells in shares(basis.nelems):
        part = Basis(basis.mesh, element, intorder=order, elements=cells)
        gradient = np.stack([phi[0].grad for phi in part.basis])  # (i, c, cell, point)
        strain = np.einsum("ickq,ikb->bckq", gradient, own[part.element_dofs])
        strain -= free[:, :, None, None]
        stress = np.einsum("acbd,bdkq->ackq", C, strain)
        pulled = np.einsum("cdkq,jdkq->jckq", stress * part.dx, gradient)
        local = np.einsum("ickq,jckq->kij", gradient, pulled, optimize=True)
        K_G = K_G + scattered(np.kron(local, np.eye(3)), basis.element_dofs[:, cells], n)
    return _placed(K_G, first, structure.n_dofs)


def _placed(A: csr_matrix, first: int, n: int) -> csr_matrix:
    A = A.tocoo()
    return csr_matrix((A.data, (A.row + first, A.col + first)), shape=(n, n))
